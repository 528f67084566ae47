//! A random order: what every other one has to beat. One permutation for each node, the same for all rays and the same
//! in every call.

use antumbra::parts::{MAX_WIDTH, SlotOrder, Tree};

/// Any seed does.
const SEED: u64 = 2016;

/// Growth of the state from one number to the next.
const STEP: u64 = 0x9e37_79b9_7f4a_7c15;

/// The output function of SplitMix64 (Steele, Lea and Flood 2014).
fn mixed(z: u64) -> u64 {
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Children at random.
pub(crate) fn plan(tree: &Tree) -> SlotOrder {
    let mut planned = SlotOrder::of_nodes(tree);
    for index in 0..tree.node_count() {
        let mut state = mixed(SEED ^ index as u64);
        let mut order: [usize; MAX_WIDTH] = std::array::from_fn(|slot| slot);
        // Fisher and Yates.
        for last in (1..tree.node(index).len()).rev() {
            state = state.wrapping_add(STEP);
            order.swap(last, (mixed(state) % (last as u64 + 1)) as usize);
        }
        planned.arrange(index, |place| order[place]);
    }
    planned
}

#[cfg(test)]
mod tests {
    use super::*;
    use antumbra::recipe::{Collapse, Engine, Order};
    use antumbra::{Build, Geometry, Recipe, Width};
    use antumbra_testkit::{Rng, mesh};

    /// Keeps the order of a tree and the lengths of its nodes.
    #[derive(Default)]
    struct Seen(std::sync::Mutex<Option<(SlotOrder, Vec<usize>)>>);

    impl antumbra::parts::Row for Seen {
        fn name(&self) -> &'static str {
            "seen"
        }

        fn sentence(&self) -> &'static str {
            "At random, and kept"
        }

        fn source(&self) -> Option<&'static str> {
            None
        }
    }

    impl antumbra::parts::Plan for Seen {
        fn plan(
            &self,
            tree: &Tree,
            _: Option<&antumbra::parts::Log>,
            _: &antumbra::recipe::CostModel,
        ) -> Result<SlotOrder, antumbra::Error> {
            let order = plan(tree);
            assert_eq!(order, plan(tree));
            let lens = (0..tree.node_count()).map(|node| tree.node(node).len());
            *self.0.lock().expect("alone") = Some((order.clone(), lens.collect()));
            Ok(order)
        }
    }

    static SEEN: Seen = Seen(std::sync::Mutex::new(None));

    /// Every child is about as often in every slot, and no two runs differ.
    #[test]
    fn every_slot_is_as_likely() {
        let mesh = mesh::soup(&mut Rng::new(5), 20_000);
        let geometry = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
        let recipe = Recipe::default()
            .collapse(Collapse::Area)
            .engine(Engine::best(Width::W4));
        let recipe = recipe.order(Order::Other(&SEEN));
        Build::new(&geometry)
            .recipe(&recipe)
            .bvh()
            .expect("indices in range");
        let (order, lens) = SEEN.0.lock().expect("alone").take().expect("planned");
        let mut counts = [[0u32; 4]; 4];
        let mut full = 0;
        for (node, len) in lens.into_iter().enumerate() {
            if len == 4 {
                full += 1;
                for (slot, from) in order.node(node).iter().enumerate() {
                    counts[slot][usize::from(*from)] += 1;
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
