//! What was dropped is named, and binary trees know what they were built over.

use antumbra::parts::{BinaryTree, Steps, TreeLog};
use antumbra::recipe::{Builder, Collapse, Engine};
use antumbra::shapes::{DropReason, Dropped, Sphere};
use antumbra::{Bvh, Geometry, Instance, Primitives, Width};
use antumbra_testkit::{Rng, mesh};

use crate::support::{BUILDERS, geometry};
use crate::transforms::{IDENTITY, scale};

#[test]
fn what_was_dropped_is_named() {
    let nan = f32::NAN;
    let positions = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, nan, 1.0],
    ];
    // Different corners at the same place.
    let twice = [[0.0; 3], [0.0; 3], [1.0; 3]];
    let mesh = || {
        Geometry::triangles(
            &positions[..],
            vec![[0, 1, 2], [0, 1, 3], [2, 2, 1], [2, 1, 0]],
        )
    };
    let sphere = |radius| Sphere {
        center: [0.0; 3],
        radius,
    };
    let world = [
        Geometry::triangles(&twice[..], vec![[0, 1, 2]]),
        Geometry::spheres(vec![sphere(1.0), sphere(0.0), sphere(f32::INFINITY)]),
        mesh(),
    ];
    let objects = [vec![mesh()], vec![]];
    let place = |object, transform| Instance::new(object, transform);
    let instances = [
        place(0, IDENTITY),
        place(0, scale([1.0, 0.0, 1.0])),
        place(1, IDENTITY),
        place(0, scale([2.0; 3])),
    ];
    let primitives = Primitives::with_instances(&world, &objects, &instances).expect("in range");
    let primitive = |object, geom_id, prim_id, reason| Dropped::Primitive {
        object,
        geom_id,
        prim_id,
        reason,
    };
    use DropReason::*;
    let expected = [
        primitive(None, 0, 0, CornersCoincide),
        primitive(None, 2, 1, NotFinite),
        primitive(None, 2, 2, CornersCoincide),
        primitive(None, 1, 1, NoRadius),
        primitive(None, 1, 2, NotFinite),
        Dropped::Instance {
            inst_id: 1,
            reason: Transform,
        },
        Dropped::Instance {
            inst_id: 2,
            reason: EmptyObject,
        },
        primitive(Some(0), 0, 1, NotFinite),
        primitive(Some(0), 0, 2, CornersCoincide),
    ];
    assert_eq!(primitives.dropped_list(), expected);
    assert_eq!(primitives.dropped(), expected.len());
    assert_eq!(
        expected[5].to_string(),
        "instance 1: the transform cannot be used"
    );
    assert_eq!(
        expected[7].to_string(),
        "primitive 1 of geometry 0 of object 0: a coordinate is not finite"
    );
}

/// Two lists of as many primitives.
fn twins() -> [Primitives; 2] {
    let mut rng = Rng::new(1);
    let soup = mesh::soup(&mut rng, 100);
    [(); 2].map(|()| Primitives::new(&[geometry(&soup)]).expect("indices in range"))
}

#[test]
fn a_binary_tree_knows_its_primitives() {
    let [own, other] = twins();
    for builder in BUILDERS {
        let tree = BinaryTree::build(&own, builder);
        assert!(tree.is_of(&own) && tree.is_of(&own.clone()) && !tree.is_of(&other));
    }
}

#[test]
#[should_panic(expected = "built over other primitives")]
fn a_tree_of_other_primitives_is_not_collapsed() {
    let [own, other] = twins();
    let tree = BinaryTree::build(&own, Builder::default());
    Bvh::collapse(&other, &tree, Collapse::Area, Engine::best(Width::W8));
}

#[test]
#[should_panic(expected = "built over other primitives")]
fn a_tree_of_other_primitives_is_not_logged() {
    let [own, other] = twins();
    let tree = BinaryTree::build(&own, Builder::default());
    TreeLog::new(&tree).add(&other, &tree, &[], 1.0);
}
