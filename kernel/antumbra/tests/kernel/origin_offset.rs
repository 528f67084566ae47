//! Rays that begin an origin offset away from a surface do not visit the leaf they leave.

use antumbra::parts::{BinaryTree, Cost, Steps};
use antumbra::recipe::{Builder, Collapse, Engine};
use antumbra::{Aabb, Bvh, Geometry, Primitives, Ray};
use antumbra_testkit::Rng;

/// Cells of a floor along each side.
const CELLS: u32 = 40;

/// A floor of squares in the plane where a coordinate is `height`, from corner `low` to `low + size` on the other axes.
fn floor(axis: usize, height: f32, low: f32, size: f32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let side = CELLS + 1;
    let mut positions = Vec::new();
    for index in 0..side * side {
        let mut point = [height; 3];
        let cells = [index % side, index / side].map(|cell| cell as f32 / CELLS as f32);
        point[(axis + 1) % 3] = low + size * cells[0];
        point[(axis + 2) % 3] = low + size * cells[1];
        positions.push(point);
    }
    let mut indices = Vec::new();
    for cell in 0..CELLS * CELLS {
        let corner = cell % CELLS + side * (cell / CELLS);
        indices.push([corner, corner + 1, corner + side]);
        indices.push([corner + 1, corner + side, corner + side + 1]);
    }
    (positions, indices)
}

fn prim_tests(bvh: &Bvh, rays: &[Ray]) -> u64 {
    let mut costs = vec![Cost::default(); rays.len()];
    let mut occluded = vec![false; rays.len()];
    bvh.occluded_batch_counted(rays, &mut occluded, &mut costs);
    assert!(!occluded.contains(&true));
    costs.iter().map(|cost| u64::from(cost.prim_tests)).sum()
}

#[test]
fn rays_that_begin_off_a_floor_test_none_of_its_triangles() {
    let mut rng = Rng::new(2016);
    for axis in 0..3 {
        for (height, low, size) in [(0.0, -8.0, 16.0), (-3.3, 100.0, 7.0), (1e4, 0.3, 0.01)] {
            let (positions, indices) = floor(axis, height, low, size);
            let geometry = [Geometry::triangles(&positions[..], &indices[..])];
            let primitives = Primitives::new(&geometry).expect("indices in range");
            let offset = primitives.bounds().origin_offset();
            let leaving = |rng: &mut Rng, distance: f32| -> Vec<Ray> {
                let mut ray = || {
                    let (mut org, mut dir) = (rng.point(1.0), rng.point(1.0));
                    org = org.map(|x| low + size * (0.5 + 0.5 * x));
                    org[axis] = height + distance;
                    dir[axis] = dir[axis].abs().max(1e-3);
                    Ray::new(org, dir)
                };
                (0..500).map(|_| ray()).collect()
            };
            let tree = BinaryTree::build(&primitives, Builder::default());
            for engine in Engine::all() {
                let bvh = Bvh::collapse(&primitives, &tree, Collapse::Area, engine);
                let place = format!("axis {axis} at {height} {engine:?}");
                let rays = leaving(&mut rng, offset);
                assert_eq!(prim_tests(&bvh, &rays), 0, "{place}");
                // Nearer ones do, or the offset would be larger than needed.
                let rays = leaving(&mut rng, 0.2 * offset);
                assert!(prim_tests(&bvh, &rays) > 0, "{place}");
            }
        }
    }
}

#[test]
fn an_empty_box_needs_no_offset() {
    assert_eq!(Aabb::EMPTY.origin_offset(), 0.0);
}
