//! Meshes in double precision, far from the origin of their world.

use antumbra::{Bvh, Geometry, LocalOrigin};
use antumbra_testkit::{Rng, mesh};

/// A closed mesh around a point far away answers as the same mesh around 0: whether a segment between two points
/// meets it is a matter of inside and outside.
#[test]
fn a_mesh_far_away_is_as_exact_as_one_at_home() {
    let seed = 77;
    let mut rng = Rng::new(seed);
    let ball = mesh::icosphere(3);
    for (origin, size) in [
        ([6.371e6, -1e7, 1e7], 1.0),
        ([1e7; 3], 1e-7),
        ([-1e12, 3.0, 0.1], 1e-3),
        ([0.0; 3], 1e-7),
    ] {
        let far = |p: [f64; 3]| -> [f64; 3] { core::array::from_fn(|a| origin[a] + size * p[a]) };
        // Steps of double precision in units of the mesh.
        let step = origin.iter().fold(0.0, |m: f64, x| m.max(x.abs())) * f64::EPSILON / size;
        let positions: Vec<_> = ball
            .positions
            .iter()
            .map(|p| far(p.map(f64::from)))
            .collect();
        let local = LocalOrigin::middle(&positions);
        let geometry = Geometry::triangles_f64(&positions, &ball.indices[..], &local);
        let bvh = Bvh::build(&[geometry], &Default::default()).expect("indices in range");
        assert_eq!(bvh.report().dropped, 0, "{origin:?}");
        for _ in 0..2000 {
            let points = [0; 2].map(|_| rng.point(1.2).map(f64::from));
            let lengths = points.map(|p| p.iter().map(|x| x * x).sum::<f64>().sqrt());
            // Between the mesh, which is within 0.99 and 1, and what is not quite known.
            let is_clear = |length: f64| !(0.98 - step..1.01 + step).contains(&length);
            if !lengths.into_iter().all(is_clear) {
                continue;
            }
            let [from, to] = points.map(far);
            let found = bvh.occluded(&local.between(from, to));
            match lengths.map(|length| length < 1.0) {
                [true, true] => assert!(!found, "seed {seed}: {origin:?} {points:?}"),
                [false, false] => {}
                _ => assert!(found, "seed {seed}: {origin:?} {points:?}"),
            }
        }
    }
}
