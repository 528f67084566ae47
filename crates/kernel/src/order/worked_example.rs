//! The order that the book in `docs/` shows how to write. The order is no member of
//! [`Order::ALL`](crate::order::Order::ALL); it is here so that the book is compiled and tested.

use alloc::vec;
use alloc::vec::Vec;

// ANCHOR: order
use crate::order::sorted_slots;
use crate::tree::node::MAX_WIDTH;
use crate::tree::slot_order::SlotOrder;
use crate::tree::wide::Tree;

/// Flat boxes first: children sorted by how much thinner they are than wide.
fn plan(tree: &Tree) -> SlotOrder {
    let mut order = SlotOrder::of_nothing(tree);
    for node in tree.nodes.iter() {
        let mut flatness = [0.0; MAX_WIDTH];
        for (slot, key) in flatness.iter_mut().enumerate().take(node.len()) {
            let bounds = node.bounds(slot);
            let mut sides: [f32; 3] = core::array::from_fn(|i| bounds.max[i] - bounds.min[i]);
            sides.sort_by(f32::total_cmp);
            // Never NaN, not even for a point.
            *key = f64::from(sides[2] / sides[0].max(1e-30));
        }
        order.push(&sorted_slots(node, &flatness));
    }
    order
}
// ANCHOR_END: order

// ANCHOR: test
#[test]
fn flat_boxes_first_changes_no_answer() {
    use crate::{Bvh, Geometry, Ray};
    use antumbra_testkit::{Rng, mesh};

    let mut rng = Rng::new(3);
    let soup = mesh::soup(&mut rng, 500);
    let geometry = [Geometry::triangles(&soup.positions[..], &soup.indices[..])];
    let built = Bvh::build(&geometry, &Default::default()).expect("indices in range");
    let mut ordered = built.clone();
    ordered.apply(&plan(&built.tree));
    ordered.validate().expect("a sound tree");

    let rays: Vec<Ray> = (0..2000)
        .map(|_| Ray::between(rng.point(2.0), rng.point(2.0)))
        .collect();
    let (mut before, mut after) = (vec![false; rays.len()], vec![false; rays.len()]);
    built.occluded_batch(&rays, &mut before);
    ordered.occluded_batch(&rays, &mut after);
    assert_eq!(before, after);
    assert!(before.contains(&true) && before.contains(&false));
}
// ANCHOR_END: test
