//! The order that the book in `docs/` shows how to write: here it is compiled and tested.

// ANCHOR: order
use antumbra::Error;
use antumbra::parts::{Log, Plan, Row, SlotOrder, Tree};
use antumbra::recipe::{CostModel, Order};

/// Flat boxes first: children sorted by how much thinner they are than wide.
struct Flat;

impl Row for Flat {
    fn name(&self) -> &'static str {
        "flat"
    }

    fn sentence(&self) -> &'static str {
        "Flat boxes first"
    }

    fn source(&self) -> Option<&'static str> {
        None
    }
}

impl Plan for Flat {
    fn plan(&self, tree: &Tree, _: Option<&Log>, _: &CostModel) -> Result<SlotOrder, Error> {
        let mut order = SlotOrder::of_nodes(tree);
        for index in 0..tree.node_count() {
            let node = tree.node(index);
            let thickness = |slot: &usize| {
                let bounds = node.bounds(*slot);
                let mut sides: [f32; 3] =
                    std::array::from_fn(|axis| bounds.max[axis] - bounds.min[axis]);
                sides.sort_by(f32::total_cmp);
                // Never NaN, not even for a point.
                sides[0].max(1e-30) / sides[2].max(1e-30)
            };
            let mut slots: Vec<_> = (0..node.width()).collect();
            // Empty slots stay behind; equal ones stay as they are.
            slots[..node.len()].sort_by(|a, b| thickness(a).total_cmp(&thickness(b)));
            order.arrange(index, |place| slots[place]);
        }
        Ok(order)
    }
}

/// The order for recipes.
const FLAT: Order = Order::Other(&Flat);
// ANCHOR_END: order

// ANCHOR: test
#[test]
fn flat_boxes_first_changes_no_answer() {
    use antumbra::{Bvh, Geometry, Ray, Recipe};
    use antumbra_testkit::{Rng, mesh};

    let mut rng = Rng::new(3);
    let soup = mesh::soup(&mut rng, 500);
    let geometry = [Geometry::triangles(&soup.positions[..], &soup.indices[..])];
    let built = Bvh::build(&geometry, &Recipe::default()).expect("indices in range");
    let mut ordered = built.clone();
    ordered.relearn(&[], &Recipe::default().order(FLAT));
    ordered.validate().expect("a sound tree");
    assert_ne!(ordered.to_bytes(), built.to_bytes());

    let rays: Vec<Ray> = (0..2000)
        .map(|_| Ray::between(rng.point(2.0), rng.point(2.0)))
        .collect();
    let before = built.batch(&rays).occluded();
    assert_eq!(ordered.batch(&rays).occluded(), before);
    assert!(before.contains(&true) && before.contains(&false));
}
// ANCHOR_END: test
