//! The binary tree of every builder is valid, complete and shallow, whatever it is built over.

use antumbra::parts::{BLOCK, BinaryKind, BinaryTree, surface_rays};
use antumbra::recipe::Builder;
use antumbra::{Aabb, Primitives};
use antumbra_testkit::{Mesh, Rng, mesh};

use super::sbvh::clip::within;
use super::{BUILDERS, SBVH, SRDH};
use crate::test_primitives::primitives;

/// A leaf and its box.
type Leaf<'a> = (&'a [u32], Aabb);

/// Checks the subtree at `index` and collects its leaves. Returns where it ends and how deep it is.
fn check<'a>(tree: &'a BinaryTree, index: usize, leaves: &mut Vec<Leaf<'a>>) -> (usize, usize) {
    let node = &tree.nodes[index];
    match node.kind {
        BinaryKind::Leaf { first, count } => {
            let before: usize = leaves.iter().map(|leaf| leaf.0.len()).sum();
            assert_eq!(
                first as usize, before,
                "leaves own ranges in depth-first order"
            );
            let prims = &tree.prims[first as usize..][..count as usize];
            assert!((1..=BLOCK).contains(&prims.len()));
            leaves.push((prims, node.bounds));
            (index + 1, 1)
        }
        BinaryKind::Inner { right } => {
            let right = index + right as usize;
            let (left_end, left_depth) = check(tree, index + 1, leaves);
            assert_eq!(left_end, right, "depth-first order");
            let (end, right_depth) = check(tree, right, leaves);
            let both = [index + 1, right].map(|child| tree.nodes[child].bounds);
            assert!(node.bounds.contains(&both[0].union(&both[1])));
            (end, 1 + left_depth.max(right_depth))
        }
    }
}

/// Points of a primitive that its leaves have to hold between them.
fn points(primitives: &Primitives, prim: usize, rng: &mut Rng) -> Vec<[f64; 3]> {
    let Some(corners) = primitives.corners(prim) else {
        let bounds = primitives.bounds_of(prim);
        return vec![bounds.min.map(f64::from), bounds.max.map(f64::from)];
    };
    let [a, b, c] = corners.map(|corner| corner.map(f64::from));
    let mut points = vec![a, b, c];
    for _ in 0..6 {
        let (u, v) = (f64::from(rng.unit()), f64::from(rng.unit()));
        let (u, v) = if u + v > 1.0 {
            (1.0 - u, 1.0 - v)
        } else {
            (u, v)
        };
        points.push(std::array::from_fn(|axis| {
            a[axis] * (1.0 - u - v) + b[axis] * u + c[axis] * v
        }));
    }
    points
}

fn check_tree(primitives: &Primitives, tree: &BinaryTree, builder: Builder, place: &str) {
    let mut leaves = Vec::new();
    if primitives.is_empty() {
        assert!(tree.nodes.is_empty(), "{place}");
        return;
    }
    let (end, depth) = check(tree, 0, &mut leaves);
    assert_eq!(end, tree.nodes.len(), "{place}");
    assert!(depth <= 95, "{place}: {depth} levels");
    assert!(
        tree.nodes[0].bounds.contains(&primitives.bounds()),
        "{place}"
    );
    let mut boxes = vec![Vec::new(); primitives.len()];
    for (prims, bounds) in &leaves {
        let kind = primitives.kind(prims[0] as usize);
        for (index, &prim) in prims.iter().enumerate() {
            assert_eq!(primitives.kind(prim as usize), kind, "{place}");
            assert!(!prims[..index].contains(&prim), "{place}: twice in a leaf");
            let whole = primitives.bounds_of(prim as usize);
            assert!(!within(&whole, bounds).is_empty(), "{place}: nothing of it");
            boxes[prim as usize].push(*bounds);
        }
    }
    if builder != SBVH {
        assert_eq!(tree.prims.len(), primitives.len(), "{place}");
    }
    assert!(tree.prims.len() <= 2 * primitives.len(), "{place}");
    let mut rng = Rng::new(7);
    for (prim, boxes) in boxes.iter().enumerate() {
        for point in points(primitives, prim, &mut rng) {
            // As close as the sum that makes the point is rounded.
            let holds = |bounds: &Aabb| {
                (0..3).all(|axis| {
                    let slack = 1e-14 * point[axis].abs();
                    f64::from(bounds.min[axis]) - slack <= point[axis]
                        && point[axis] <= f64::from(bounds.max[axis]) + slack
                })
            };
            assert!(
                boxes.iter().any(holds),
                "{place}: {point:?} of {prim} is lost"
            );
        }
    }
}

fn check_builders(primitives: &Primitives, place: &str) {
    let rays = surface_rays(primitives, 300, 5);
    for builder in BUILDERS {
        let place = format!("{builder}, {place}");
        let tree = BinaryTree::build_for(primitives, builder, &rays);
        check_tree(primitives, &tree, builder, &place);
    }
}

/// Every generator of the test kit is also seen flat and so large that areas overflow.
#[test]
fn trees_are_valid_and_complete() {
    let mut rng = Rng::new(61);
    for generate in mesh::ALL {
        for size in [1, 8, 9, 40, 700] {
            for spheres in [0, 3, size] {
                let mesh = generate(&mut rng, size);
                let flat = mesh.map("flat", |[x, _, z]| [x, 0.25, z]);
                let huge = mesh.map("huge", |p| p.map(|x| x * 1e30));
                for mesh in [&mesh, &flat, &huge] {
                    let primitives = primitives(mesh, spheres, &mut rng);
                    let place = format!("{} {size} with {spheres} spheres", mesh.name);
                    check_builders(&primitives, &place);
                }
            }
        }
    }
}

/// Long triangles across each other.
fn sticks(rng: &mut Rng, count: usize) -> Mesh {
    let mut sticks = Mesh {
        name: "sticks",
        positions: Vec::new(),
        indices: Vec::new(),
    };
    for index in 0..count as u32 {
        let (a, b) = (rng.point(1.0), rng.point(1.0));
        let c = std::array::from_fn(|axis| a[axis] + rng.range(-0.02, 0.02));
        sticks.positions.extend([a, b, c]);
        sticks
            .indices
            .push([0, 1, 2].map(|corner| 3 * index + corner));
    }
    sticks
}

#[test]
fn spatial_splits_pay_where_boxes_overlap() {
    let mut rng = Rng::new(62);
    let mesh = sticks(&mut rng, 2000);
    let primitives = primitives(&mesh, 0, &mut rng);
    let cost = |builder| {
        let tree = BinaryTree::build(&primitives, builder);
        check_tree(&primitives, &tree, builder, "sticks");
        let area: f64 = tree
            .nodes
            .iter()
            .map(|node| f64::from(node.bounds.half_area()))
            .sum();
        (area, tree.prims.len())
    };
    let (object_area, _) = cost(Builder::BinnedSah);
    let (area, references) = cost(SBVH);
    assert!(references > 5 * primitives.len() / 4, "{references}");
    assert!(area < 0.95 * object_area, "{area} {object_area}");
}

/// Without rays nothing is left of the ray-driven builders but binned SAH.
#[test]
fn without_rays_there_is_binned_sah() {
    let mut rng = Rng::new(64);
    let mesh = mesh::soup(&mut rng, 1000);
    let primitives = primitives(&mesh, 50, &mut rng);
    let expected = format!("{:?}", BinaryTree::build(&primitives, Builder::BinnedSah));
    let with_rays = BinaryTree::build(&primitives, SRDH);
    assert!(format!("{with_rays:?}") != expected);
    for builder in BUILDERS.into_iter().filter(|one| one.needs_rays()) {
        let tree = BinaryTree::build_for(&primitives, builder, &[]);
        assert!(format!("{tree:?}") == expected, "{builder}");
    }
}
