//! A random order: what every other one has to beat. One permutation for each node, the same for all rays and the same
//! in every call.

use crate::hash;
use crate::order::AS_THEY_ARE;
use crate::tree::slot_order::SlotOrder;
use crate::tree::wide::Tree;

/// Any seed does.
const SEED: u64 = 2016;

/// Children at random.
pub(crate) fn plan(tree: &Tree) -> SlotOrder {
    let mut planned = SlotOrder::as_built(tree.shape());
    for (index, node) in tree.nodes.iter().enumerate() {
        let mut state = hash::mixed(SEED ^ index as u64);
        let mut order = AS_THEY_ARE;
        // Fisher and Yates.
        for last in (1..node.len()).rev() {
            state = state.wrapping_add(hash::STEP);
            order.swap(last, (hash::mixed(state) % (last as u64 + 1)) as usize);
        }
        planned.push(&order);
    }
    planned
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builder::Builder;
    use crate::geometry::Geometry;
    use crate::geometry::primitives::Primitives;
    use crate::tree::binary::BinaryTree;
    use crate::tree::width::Width;
    use crate::{Bvh, Isa};
    use antumbra_testkit::{Rng, mesh};

    /// Every child is about as often in every slot, and no two runs differ.
    #[test]
    fn every_slot_is_as_likely() {
        let mesh = mesh::soup(&mut Rng::new(5), 20_000);
        let geometry = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
        let primitives = Primitives::new(&geometry).expect("indices in range");
        let tree = BinaryTree::build(&primitives, Builder::default());
        let bvh = Bvh::collapse(
            &primitives,
            &tree,
            crate::recipe::Collapse::Area,
            Width::W4,
            Isa::best(),
        );
        let order = plan(&bvh.tree);
        assert_eq!(order, plan(&bvh.tree));
        let mut counts = [[0u32; 4]; 4];
        let mut full = 0;
        for (node, slots) in bvh.tree.nodes.iter().zip(order.slots.as_chunks::<4>().0) {
            if node.len() == 4 {
                full += 1;
                for (slot, from) in slots.iter().enumerate() {
                    counts[slot][*from as usize] += 1;
                }
            }
        }
        assert!(full > 500, "{full}");
        for count in counts.as_flattened() {
            let share = f64::from(*count) / f64::from(full);
            assert!((share - 0.25).abs() < 0.08, "{counts:?} of {full}");
        }
    }
}
