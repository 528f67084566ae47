//! Nearest points of a mesh, beside parry3d: one call for each point or one for all of them.
//!
//! Parry's tree is built from the same buffers with its default options. Both return the position, the triangle and the
//! place on it. Parry's distances are in single precision.

use antumbra::{Aabb, Bvh, Geometry, Recipe};
use antumbra_lab::harness::{Bench, Case, Mesh, cross, dot, each, less};
use antumbra_testkit::Rng;
use parry3d::math::Vector;
use parry3d::query::PointQueryWithLocation;
use parry3d::shape::TriMesh;

/// Points on each side of the grid.
const GRID: usize = 64;
/// Largest relative difference of distances.
const TOLERANCE: f32 = 1e-4;

pub fn run(bench: &mut Bench, name: &str, mesh: &Mesh) -> Result<(), Box<dyn std::error::Error>> {
    let geometry = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
    let bvh = Bvh::build(&geometry, &Recipe::default())?;
    let corners = mesh.positions.iter().map(|&corner| Vector::from(corner));
    let parry = TriMesh::new(corners.collect(), mesh.indices.clone()).expect("triangles");
    let (bounds, count) = (bvh.bounds(), bench.rays());
    for (kind, points) in [
        ("uniform", uniform(&bounds, count)),
        ("surface", near_surface(&bounds, mesh, count)),
        ("grid", grid(&bounds, GRID / bench.part.min(GRID))),
    ] {
        let none = vec![None; points.len()];
        let mut case = Case::new(format!("{name} {kind}"), points.len());
        case.base("parry3d", vec![0.0; points.len()], |distances| {
            each(&points, distances, |&point| {
                let point = Vector::from(point);
                let (near, place) = parry.project_local_point_and_get_location(point, false);
                std::hint::black_box(place);
                (near.point - point).length()
            });
        });
        case.add("closest", none.clone(), |found| {
            each(&points, found, |point| bvh.closest(*point, f32::INFINITY));
        });
        case.add("closest_batch", none, |found| {
            bvh.points(&points).closest_into(found)
        });
        case.run(bench, [TOLERANCE, 0.0])?;
    }
    Ok(())
}

fn uniform(bounds: &Aabb, count: usize) -> Vec<[f32; 3]> {
    let mut rng = Rng::new(1);
    let point = |_| [0, 1, 2].map(|axis| rng.range(bounds.min[axis], bounds.max[axis]));
    (0..count).map(point).collect()
}

/// Points up to a hundredth of the diagonal away from points that are uniform on the surface.
fn near_surface(bounds: &Aabb, mesh: &Mesh, count: usize) -> Vec<[f32; 3]> {
    let length = |v: [f32; 3]| dot(v, v).sqrt();
    let mut sum = 0.0;
    let mut sums = Vec::new();
    for triangle in 0..mesh.indices.len() {
        let [a, b, c] = mesh.corners(triangle);
        sum += f64::from(length(cross(less(b, a), less(c, a))));
        sums.push(sum);
    }
    let far = 0.01 * length(less(bounds.max, bounds.min));
    let mut rng = Rng::new(2);
    let point = |_| {
        let place = f64::from(rng.unit()) * sum;
        let triangle = sums.partition_point(|sum| *sum <= place);
        let [a, b, c] = mesh.corners(triangle.min(sums.len() - 1));
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
    (0..count).map(point).collect()
}

fn grid(bounds: &Aabb, side: usize) -> Vec<[f32; 3]> {
    let point = |index: usize| {
        let cell = [index % side, index / side % side, index / side / side];
        [0, 1, 2].map(|axis| {
            let part = (cell[axis] as f32 + 0.5) / side as f32;
            bounds.min[axis] + part * (bounds.max[axis] - bounds.min[axis])
        })
    };
    (0..side * side * side).map(point).collect()
}
