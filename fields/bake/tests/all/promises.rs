//! What holds of every result: equal bits, errors, cancellation.

use std::sync::atomic::{AtomicUsize, Ordering};

use antumbra::recipe::Builder;
use antumbra::{Bvh, Geometry, Recipe};
use antumbra_bake::{AmbientOcclusion, Error, Monitor, ambient_occlusion, vertex_normals};
use antumbra_testkit::Rng;
use antumbra_testkit::mesh::{Mesh, bumpy_grid};

fn landscape() -> (Mesh, Bvh, Vec<[f32; 3]>) {
    let mesh = bumpy_grid(&mut Rng::new(5), 4000);
    let geometry = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
    let bvh = Bvh::build(&geometry, &Recipe::default()).expect("a tree");
    let normals = vertex_normals(&mesh.positions, &mesh.indices);
    (mesh, bvh, normals)
}

fn bits(values: Result<Vec<f32>, Error>) -> Vec<u32> {
    let values = values.expect("values").into_iter();
    values.map(f32::to_bits).collect()
}

#[test]
fn threads_parts_and_places_change_no_bit() {
    let (mesh, bvh, normals) = landscape();
    let points = &mesh.positions[..];
    let options = AmbientOcclusion {
        samples: 33,
        two_sided: true,
        seed: 9,
        ..AmbientOcclusion::default()
    };
    let bake = |points: &[[f32; 3]], normals: &[[f32; 3]]| {
        bits(ambient_occlusion(&bvh, points, normals, &options, &()))
    };
    let all = bake(points, &normals);
    assert!(
        all.iter().any(|&value| value < 0.9_f32.to_bits()),
        "some occlusion"
    );
    for threads in [1, 2, 5] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let values = pool.expect("threads").install(|| bake(points, &normals));
        assert_eq!(values, all, "{threads} threads");
    }
    let mut parts = Vec::new();
    for (points, normals) in points.chunks(1001).zip(normals.chunks(1001)) {
        parts.extend(bake(points, normals));
    }
    assert_eq!(parts, all, "parts");
    let reversed = |list: &[[f32; 3]]| list.iter().rev().copied().collect::<Vec<_>>();
    let mut back = bake(&reversed(points), &reversed(&normals));
    back.reverse();
    assert_eq!(back, all, "the other way round");
    let other = AmbientOcclusion {
        seed: 10,
        ..options
    };
    assert_ne!(
        bits(ambient_occlusion(&bvh, points, &normals, &other, &())),
        all
    );
}

#[test]
fn builders_collapses_and_orders_change_no_bit() {
    let (mesh, bvh, normals) = landscape();
    let geometry = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
    let options = AmbientOcclusion {
        samples: 9,
        ..AmbientOcclusion::default()
    };
    let bake = |bvh: &Bvh| {
        bits(ambient_occlusion(
            bvh,
            &mesh.positions,
            &normals,
            &options,
            &(),
        ))
    };
    let expected = bake(&bvh);
    for builder in Builder::ALL {
        for recipe in [Recipe::default(), Recipe::paper()] {
            let other = Bvh::build(&geometry, &recipe.builder(builder)).expect("a tree");
            assert_eq!(bake(&other), expected, "{builder}");
        }
    }
}

#[test]
fn points_and_normals_without_a_value_are_nan() {
    let (_, bvh, _) = landscape();
    let up = [0.0, 0.0, 1.0];
    let high = [0.0, 0.0, 1e9];
    let cases = [
        (high, up, false),
        (high, [0.0, 0.0, 1e-40], false),
        (high, [0.0, 0.0, f32::MAX], false),
        (high, [0.0; 3], true),
        (high, [f32::NAN, 0.0, 1.0], true),
        (high, [f32::INFINITY, 0.0, 0.0], true),
        ([f32::NAN, 0.0, 0.0], up, true),
        ([f32::INFINITY; 3], up, true),
    ];
    let points: Vec<_> = cases.iter().map(|case| case.0).collect();
    let normals: Vec<_> = cases.iter().map(|case| case.1).collect();
    let values = ambient_occlusion(&bvh, &points, &normals, &AmbientOcclusion::default(), &());
    for (value, (point, normal, is_nan)) in values.expect("values").iter().zip(&cases) {
        assert_eq!(value.is_nan(), *is_nan, "{point:?} {normal:?}");
        assert!(*is_nan || *value == 1.0, "{value}");
    }
}

#[test]
fn what_makes_no_sense_is_refused() {
    let (mesh, bvh, normals) = landscape();
    let default = AmbientOcclusion::default();
    let bake = |normals: &[[f32; 3]], options| {
        ambient_occlusion(&bvh, &mesh.positions, normals, &options, &()).unwrap_err()
    };
    let error = bake(&normals[1..], default);
    assert!(error.to_string().contains("normals"), "{error}");
    let none = AmbientOcclusion {
        samples: 0,
        ..default
    };
    assert_eq!(bake(&normals, none), Error::NoSamples);
    for distance in [0.0, -1.0, f32::NAN] {
        let error = bake(
            &normals,
            AmbientOcclusion {
                distance,
                ..default
            },
        );
        assert!(matches!(error, Error::Distance(_)), "{error}");
    }
}

/// Counts points, and cancels at so many.
struct Count {
    most: AtomicUsize,
    limit: usize,
}

impl Monitor for Count {
    fn progress(&self, done: usize, total: usize) {
        assert!(done <= total);
        self.most.fetch_max(done, Ordering::Relaxed);
    }

    fn cancelled(&self) -> bool {
        self.most.load(Ordering::Relaxed) >= self.limit
    }
}

#[test]
fn progress_reaches_the_end_and_cancelling_comes_before() {
    let (mesh, bvh, normals) = landscape();
    let points = &mesh.positions[..];
    let bake = |limit| {
        let count = Count {
            most: AtomicUsize::new(0),
            limit,
        };
        let values =
            ambient_occlusion(&bvh, points, &normals, &AmbientOcclusion::default(), &count);
        (values.map(|values| values.len()), count.most.into_inner())
    };
    assert_eq!(bake(usize::MAX), (Ok(points.len()), points.len()));
    let (values, done) = bake(points.len() / 4);
    assert_eq!(values, Err(Error::Cancelled));
    assert!(done < points.len(), "{done} of {}", points.len());
}
