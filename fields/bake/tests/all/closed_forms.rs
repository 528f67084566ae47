//! Scenes whose ambient occlusion is known on paper.

use antumbra::{Bvh, Geometry, Recipe};
use antumbra_bake::{AmbientOcclusion, Weighting, ambient_occlusion, bent_normals};

const UP: [f32; 3] = [0.0, 0.0, 1.0];

fn tree(positions: &[[f32; 3]], indices: &[[u32; 3]]) -> Bvh {
    Bvh::build(
        &[Geometry::triangles(positions, indices)],
        &Recipe::default(),
    )
    .expect("a tree")
}

/// Value of one point.
fn at(bvh: &Bvh, point: [f32; 3], normal: [f32; 3], options: AmbientOcclusion) -> f32 {
    let values = ambient_occlusion(bvh, &[point], &[normal], &options, &());
    values.expect("a value")[0]
}

fn near(found: f32, expected: f32, what: &str) {
    assert!(
        (found - expected).abs() < 4e-3,
        "{what}: {found}, not {expected}"
    );
}

fn options(weighting: Weighting) -> AmbientOcclusion {
    AmbientOcclusion {
        samples: 4096,
        weighting,
        ..AmbientOcclusion::default()
    }
}

/// Two triangles with these corners.
fn quad(corners: [[f32; 3]; 4]) -> Bvh {
    tree(&corners, &[[0, 1, 2], [0, 2, 3]])
}

const BOTH: [Weighting; 2] = [Weighting::Cosine, Weighting::Uniform];

#[test]
fn a_plane_under_the_open_sky_is_open() {
    let plane = quad([
        [-1.0, -1.0, 0.5],
        [1.0, -1.0, 0.5],
        [1.0, 1.0, 0.5],
        [-1.0, 1.0, 0.5],
    ]);
    for weighting in BOTH {
        for point in [[0.0, 0.0, 0.5], [0.3, -0.9, 0.5], [1.0, 1.0, 0.5]] {
            assert_eq!(at(&plane, point, UP, options(weighting)), 1.0);
            assert_eq!(at(&plane, point, [0.0, 0.0, -7.0], options(weighting)), 1.0);
        }
    }
}

#[test]
fn the_inside_of_a_closed_box_is_closed() {
    let corner = |i: u32| [0, 1, 2].map(|axis| 1.0 + ((i >> axis) & 1) as f32);
    let corners: Vec<_> = (0..8).map(corner).collect();
    let faces = [
        [0, 1, 3],
        [0, 3, 2],
        [4, 6, 7],
        [4, 7, 5],
        [0, 4, 5],
        [0, 5, 1],
        [2, 3, 7],
        [2, 7, 6],
        [0, 2, 6],
        [0, 6, 4],
        [1, 5, 7],
        [1, 7, 3],
    ];
    let closed = tree(&corners, &faces);
    for weighting in BOTH {
        assert_eq!(at(&closed, [1.5, 1.5, 1.0], UP, options(weighting)), 0.0);
        assert_eq!(
            at(
                &closed,
                [1.01, 1.5, 1.99],
                [1.0, 0.0, 0.0],
                options(weighting)
            ),
            0.0
        );
        let inside = [1.5, 1.5, 1.0];
        let bent = bent_normals(
            &closed,
            &[inside],
            &[[0.0, 0.0, 5.0]],
            &options(weighting),
            &(),
        );
        let bent = bent.expect("a value")[0];
        assert_eq!((bent.open, bent.direction), (0.0, UP), "the normal is left");
        // From outside, the box is convex.
        assert_eq!(at(&closed, [1.5, 1.5, 2.0], UP, options(weighting)), 1.0);
        let both = AmbientOcclusion {
            two_sided: true,
            ..options(weighting)
        };
        assert_eq!(
            at(&closed, [1.5, 1.5, 1.0], UP, both),
            1.0,
            "the other side is open"
        );
    }
}

#[test]
fn the_foot_of_an_endless_wall_and_half_a_ceiling_are_half_open() {
    let far = 1000.0;
    let wall = quad([
        [0.0, -far, 0.0],
        [0.0, far, 0.0],
        [0.0, far, far],
        [0.0, -far, far],
    ]);
    let ceiling = quad([
        [0.0, -far, 1.0],
        [far, -far, 1.0],
        [far, far, 1.0],
        [0.0, far, 1.0],
    ]);
    for weighting in BOTH {
        near(
            at(&wall, [0.1, 0.0, 0.0], UP, options(weighting)),
            0.5,
            "wall",
        );
        near(
            at(&ceiling, [0.0; 3], UP, options(weighting)),
            0.5,
            "ceiling",
        );
    }
}

/// Openness at a distance of `1 / k` from the foot of an endless wall of height 1, which no longer wall may change:
/// `1/2 + 1/2 / sqrt(1 + k²)`, by integration of the cosine over what is above the wall.
#[test]
fn a_wall_hides_as_much_in_large_scenes_as_in_small_ones() {
    for half in [100.0, 1000.0, 4000.0, 20_000.0] {
        let bvh = quad([
            [0.0, -half, 0.0],
            [0.0, half, 0.0],
            [0.0, half, 1.0],
            [0.0, -half, 1.0],
        ]);
        for k in [60.0, 10.0, 2.0, 1.0, 0.6, 0.1_f32] {
            let many = AmbientOcclusion {
                samples: 65_536,
                ..options(Weighting::Cosine)
            };
            let found = at(&bvh, [1.0 / k, 0.0, 0.0], [0.0, 0.0, 1.0], many);
            let expected = 0.5 + 0.5 / (1.0 + k * k).sqrt();
            let error = (found - expected).abs();
            assert!(error < 4e-4, "{half} {k}: {found} for {expected}");
        }
    }
}

#[test]
fn a_disc_overhead_covers_its_projected_solid_angle() {
    let count = 512;
    let mut corners = vec![[0.0, 0.0, 1.0]];
    let rim = |i: u32| std::f32::consts::TAU * i as f32 / count as f32;
    corners.extend((0..count).map(|i| [rim(i).cos(), rim(i).sin(), 1.0]));
    let faces: Vec<_> = (0..count)
        .map(|i| [0, 1 + i, 1 + (i + 1) % count])
        .collect();
    let disc = tree(&corners, &faces);
    // Seen at 45 degrees: sin² of the light by cosine, 1 - cos of the sky.
    near(
        at(&disc, [0.0; 3], UP, options(Weighting::Cosine)),
        0.5,
        "cosine",
    );
    near(
        at(&disc, [0.0; 3], UP, options(Weighting::Uniform)),
        0.5_f32.sqrt(),
        "uniform",
    );
}

#[test]
fn surfaces_beyond_the_distance_do_not_occlude() {
    let far = 1000.0;
    let ceiling = quad([
        [-far, -far, 1.0],
        [far, -far, 1.0],
        [far, far, 1.0],
        [-far, far, 1.0],
    ]);
    // Rays are stopped where 1 / cos < distance.
    for (distance, cosine, uniform) in [(0.9, 1.0, 1.0), (2.0, 0.25, 0.5), (4.0, 0.0625, 0.25)] {
        for (weighting, expected) in [(Weighting::Cosine, cosine), (Weighting::Uniform, uniform)] {
            let options = AmbientOcclusion {
                distance,
                ..options(weighting)
            };
            near(at(&ceiling, [0.0; 3], UP, options), expected, "ceiling");
        }
    }
}

#[test]
fn bent_normals_lean_away_from_walls() {
    let far = 1000.0;
    let wall = quad([
        [0.0, -far, 0.0],
        [0.0, far, 0.0],
        [0.0, far, far],
        [0.0, -far, far],
    ]);
    // Of half a hemisphere: the mean height is 2/3 by cosine and 1/2 by solid angle, the mean width of the quarter sphere
    // 4/(3 pi) and 1/2.
    let lean = 4.0 / (3.0 * std::f64::consts::PI) / (2.0 / 3.0);
    for (weighting, lean) in [(Weighting::Cosine, lean), (Weighting::Uniform, 1.0)] {
        let options = options(weighting);
        let found = bent_normals(&wall, &[[0.1, 0.0, 0.0]], &[[0.0, 0.0, 3.0]], &options, &());
        let found = found.expect("a value")[0];
        let [x, y, z] = found.direction;
        near(x / z, lean as f32, "lean");
        near(y, 0.0, "along the wall");
        near(x * x + y * y + z * z, 1.0, "length");
        assert_eq!(
            found.open,
            at(&wall, [0.1, 0.0, 0.0], [0.0, 0.0, 3.0], options)
        );
        let short = AmbientOcclusion {
            samples: 1,
            ..options
        };
        let none = bent_normals(&wall, &[[0.0; 3]], &[[0.0; 3]], &short, &()).expect("a value")[0];
        assert!(none.open.is_nan() && none.direction.iter().all(|x| x.is_nan()));
    }
}

#[test]
fn bent_normals_belong_to_the_more_open_side() {
    let far = 1000.0;
    let lids = [0.0, 1.0].map(|z| {
        [
            [-far, -far, z],
            [far, -far, z],
            [far, far, z],
            [-far, far, z],
        ]
    });
    let slab = tree(
        &lids.concat(),
        &[[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]],
    );
    let bent = |two_sided| {
        let options = AmbientOcclusion {
            two_sided,
            ..AmbientOcclusion::default()
        };
        let found = bent_normals(&slab, &[[0.0; 3]], &[[0.0, 0.0, 2.0]], &options, &());
        found.expect("a value")[0]
    };
    // Rays along the slab get out at its far ends only.
    let closed = bent(false);
    assert!(closed.open < 0.01, "{closed:?}");
    let open = bent(true);
    assert_eq!(open.open, 1.0);
    near(open.direction[2], -1.0, "down");
}
