//! Rays that begin an origin offset away from a surface do not visit the leaf they leave, and those that begin the offset of
//! their point away from it are not hidden by it.

use antumbra::parts::{BinaryTree, Cost, Steps};
use antumbra::recipe::{Builder, Collapse, Engine};
use antumbra::{Aabb, Bvh, Geometry, Primitives, Ray, Recipe};
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
    let nothing = Bvh::build(&[], &Recipe::default()).expect("nothing is fine");
    assert_eq!(nothing.origin_offset([0.0; 3]), 0.0);
    assert_eq!(nothing.origin_offset([1.0, f32::NAN, 2.0]), 0.0);
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// A plane of two triangles and many small ones, tilted in any way, and up to 40 km long: no point of it shades itself.
#[test]
fn grounds_of_any_size_and_tilt_do_not_shade_themselves() {
    let mut rng = Rng::new(40_000);
    let mut near_misses = 0;
    for round in 0..60 {
        let size = [1.0, 200.0, 40_000.0][round % 3];
        let centre = rng.point([0.0, 0.1, 3.0][round / 3 % 3] * size);
        let up = rng.direction().map(f64::from);
        let right = {
            let other = rng.direction().map(f64::from);
            let along = dot(other, up) / dot(up, up);
            let right: [f64; 3] = core::array::from_fn(|axis| other[axis] - along * up[axis]);
            let length = dot(right, right).sqrt();
            right.map(|x| x / length)
        };
        let ahead = [
            up[1] * right[2] - up[2] * right[1],
            up[2] * right[0] - up[0] * right[2],
            up[0] * right[1] - up[1] * right[0],
        ];
        let on_plane = |x: f64, y: f64| {
            core::array::from_fn(|axis| {
                let along = x * right[axis] + y * ahead[axis];
                (f64::from(centre[axis]) + f64::from(size) * along) as f32
            })
        };
        let corners = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)];
        let corners: Vec<[f32; 3]> = corners.map(|(x, y)| on_plane(x, y)).into();
        let geometry = [Geometry::triangles(
            &corners[..],
            vec![[0, 1, 2], [0, 2, 3]],
        )];
        let bvh = Bvh::build(&geometry, &Recipe::default()).expect("a tree");
        for _ in 0..300 {
            let half = rng.below(2);
            let [a, b, c] = [0, 1 + half, 2 + half].map(|corner| corners[corner].map(f64::from));
            // The normal of the triangle as it is stored.
            let [e, f] = [b, c].map(|to| [0, 1, 2].map(|axis| to[axis] - a[axis]));
            let normal = [
                e[1] * f[2] - e[2] * f[1],
                e[2] * f[0] - e[0] * f[2],
                e[0] * f[1] - e[1] * f[0],
            ];
            let length = dot(normal, normal).sqrt();
            let normal = normal.map(|x| x / length);
            let [u, v] = [rng.unit(), rng.unit()].map(f64::from);
            let [u, v] = if u + v > 1.0 {
                [1.0 - u, 1.0 - v]
            } else {
                [u, v]
            };
            let point: [f32; 3] =
                core::array::from_fn(|axis| (a[axis] + u * e[axis] + v * f[axis]) as f32);
            let offset = f64::from(bvh.origin_offset(point));
            let above = |offset: f64| {
                core::array::from_fn(|axis| (f64::from(point[axis]) + offset * normal[axis]) as f32)
            };
            let direction = rng.direction().map(f64::from);
            let cosine = dot(direction, normal);
            // Upwards, and half of them within a degree of the ground.
            let lift = if rng.below(2) == 0 {
                cosine.abs()
            } else {
                0.01
            };
            let direction = core::array::from_fn(|axis| {
                (direction[axis] + (lift - cosine) * normal[axis]) as f32
            });
            let ray = Ray::new(above(offset), direction);
            assert!(!bvh.occluded(&ray), "{round}: {point:?} {ray:?}");
            near_misses += usize::from(bvh.occluded(&Ray::new(above(0.0), direction)));
        }
    }
    assert!(near_misses > 500, "{near_misses}");
}

/// What is around a point decides its offset, and nothing else of the scene.
#[test]
fn offsets_follow_the_point_and_its_surface() {
    let near = [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0]];
    let far = [
        [0.0, 20.0, 0.0],
        [40_000.0, 20.0, 0.0],
        [0.0, 20.0, 40_000.0],
    ];
    let triangle = |corners: [[f32; 3]; 3]| Geometry::triangles(corners.to_vec(), vec![[0, 1, 2]]);
    let tree = |list: &[Geometry<'_>]| Bvh::build(list, &Recipe::default()).expect("a tree");
    let alone = tree(&[triangle(near)]);
    let both = tree(&[triangle(near), triangle(far)]);
    for (point, reach) in [
        ([1.0, 2.0, 0.0], 10.0),
        ([1.0, 2.0, 0.1], 2.0),
        ([8.0, 18.0, 1.0], 18.0),
    ] {
        let offset = Aabb::around(&[[reach; 3]]).origin_offset();
        assert_eq!(alone.origin_offset(point), offset, "{point:?}");
        assert_eq!(both.origin_offset(point), offset, "{point:?}");
    }
    let offset = Aabb::around(&far).origin_offset();
    assert_eq!(both.origin_offset([1.0, 20.0, 1.0]), offset);
}
