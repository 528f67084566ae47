//! Nearest points of a mesh, beside parry3d. One thread, one call for each point or one for all of them.
//!
//! Parry's tree is built from the same buffers with its default options. Both return the position, the triangle and the
//! place on it.

use std::cell::RefCell;

use antumbra::{Aabb, Bvh, ClosestPoint};
use antumbra_testkit::Rng;
use parry3d::math::Vector;
use parry3d::query::PointQueryWithLocation;
use parry3d::shape::TriMesh;

use crate::input::Mesh;
use crate::turns::{Work, medians};

/// Points of the first two kinds.
const POINTS: usize = 1 << 16;
/// Points on each side of the grid.
const GRID: usize = 64;
/// Largest relative difference of distances, of which Parry's are in single precision.
const TOLERANCE: f32 = 1e-5;

/// Prints the nanoseconds of a point and rates relative to Parry's.
pub fn run(name: &str, bvh: &Bvh, mesh: &Mesh, rounds: usize) {
    let corners = mesh.positions.iter().map(|&corner| Vector::from(corner));
    let parry = TriMesh::new(corners.collect(), mesh.indices.clone()).expect("triangles");
    let bounds = bvh.bounds();
    let kinds = [
        ("uniform", uniform(&bounds)),
        ("surface", near_surface(&bounds, mesh)),
        ("grid", grid(&bounds)),
    ];
    for (kind, points) in &kinds {
        let found = RefCell::new(vec![None; points.len()]);
        let distances = RefCell::new(vec![0.0f32; points.len()]);
        let mut works: Vec<Work<'_>> = vec![
            (
                "parry3d".into(),
                Box::new(|| {
                    for (&point, distance) in points.iter().zip(distances.borrow_mut().iter_mut()) {
                        let point = Vector::from(point);
                        let (near, place) =
                            parry.project_local_point_and_get_location(point, false);
                        std::hint::black_box(place);
                        *distance = (near.point - point).length();
                    }
                }),
            ),
            (
                "closest".into(),
                Box::new(|| {
                    for (&point, found) in points.iter().zip(found.borrow_mut().iter_mut()) {
                        *found = bvh.closest(point, f32::INFINITY);
                    }
                }),
            ),
            (
                "closest_batch".into(),
                Box::new(|| bvh.points(points).closest_into(&mut found.borrow_mut())),
            ),
        ];
        let names: Vec<String> = works.iter().map(|(name, _)| name.clone()).collect();
        works[0].1();
        for (of, work) in &mut works[1..] {
            work();
            let differ = differing(&found.borrow(), &distances.borrow(), points);
            assert_eq!(differ, 0, "{name} {kind}: answers of {of} differ");
        }
        let times = medians(rounds, &mut works);
        for (of, time) in names.iter().zip(&times) {
            let (each, ratio) = (1e9 * time / points.len() as f64, times[0] / time);
            println!("{name:16} {kind:8} {of:14} {each:8.1} ns {ratio:6.2}");
        }
    }
}

/// How many distances differ by more than single precision explains.
fn differing(found: &[Option<ClosestPoint>], right: &[f32], points: &[[f32; 3]]) -> usize {
    let differs = |((near, right), point): ((&Option<ClosestPoint>, &f32), &[f32; 3])| {
        let size = point.iter().fold(*right, |size, x| size.max(x.abs()));
        near.is_none_or(|near| (near.distance - right).abs() > TOLERANCE * size)
    };
    let all = found.iter().zip(right).zip(points);
    all.filter(|one| differs(*one)).count()
}

fn uniform(bounds: &Aabb) -> Vec<[f32; 3]> {
    let mut rng = Rng::new(1);
    let point = |_| [0, 1, 2].map(|axis| rng.range(bounds.min[axis], bounds.max[axis]));
    (0..POINTS).map(point).collect()
}

/// Points up to a hundredth of the diagonal away from points that are uniform on the surface.
fn near_surface(bounds: &Aabb, mesh: &Mesh) -> Vec<[f32; 3]> {
    let minus = |a: [f32; 3], b: [f32; 3]| [0, 1, 2].map(|axis| a[axis] - b[axis]);
    let length = |v: [f32; 3]| v.iter().map(|x| x * x).sum::<f32>().sqrt();
    let mut sum = 0.0;
    let mut sums = Vec::new();
    for triangle in &mesh.indices {
        let [a, b, c] = triangle.map(|index| mesh.positions[index as usize]);
        let ([x, y, z], [u, v, w]) = (minus(b, a), minus(c, a));
        sum += f64::from(length([y * w - z * v, z * u - x * w, x * v - y * u]));
        sums.push(sum);
    }
    let far = 0.01 * length(minus(bounds.max, bounds.min));
    let mut rng = Rng::new(2);
    let point = |_| {
        let place = f64::from(rng.unit()) * sum;
        let triangle = sums.partition_point(|sum| *sum <= place);
        let triangle = mesh.indices[triangle.min(sums.len() - 1)];
        let [a, b, c] = triangle.map(|index| mesh.positions[index as usize]);
        let (u, v) = (rng.unit(), rng.unit());
        let [u, v] = if u + v > 1.0 {
            [1.0 - u, 1.0 - v]
        } else {
            [u, v]
        };
        let (direction, distance) = (rng.direction(), far * rng.unit());
        [0, 1, 2].map(|axis| {
            a[axis] + u * (b[axis] - a[axis]) + v * (c[axis] - a[axis]) + distance * direction[axis]
        })
    };
    (0..POINTS).map(point).collect()
}

fn grid(bounds: &Aabb) -> Vec<[f32; 3]> {
    let side = 0..GRID * GRID * GRID;
    side.map(|index| {
        let cell = [index % GRID, index / GRID % GRID, index / GRID / GRID];
        [0, 1, 2].map(|axis| {
            let part = (cell[axis] as f32 + 0.5) / GRID as f32;
            bounds.min[axis] + part * (bounds.max[axis] - bounds.min[axis])
        })
    })
    .collect()
}
