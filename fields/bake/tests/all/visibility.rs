//! What points see: against brute force and closed forms, and with equal bits in parts.

use antumbra::recipe::Engine;
use antumbra::{Aabb, Bvh, Geometry, Ray, Recipe, Width};
use antumbra_bake::{
    BitMatrix, Error, Orientation, SkyDivision, UpAxis, Weighting, sees_directions,
    sees_each_other, sees_points, sky_view, sun_hours,
};
use antumbra_testkit::Rng;
use antumbra_testkit::mesh::{self, Mesh};

const ANY: f32 = f32::INFINITY;

fn tree(mesh: &Mesh, width: Width) -> Bvh {
    let geometry = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
    Bvh::build(&geometry, &Recipe::default().engine(Engine::best(width))).expect("a tree")
}

/// Some points in the box around a mesh and outside of it.
fn points(rng: &mut Rng, bvh: &Bvh, count: usize) -> Vec<[f32; 3]> {
    let mut bounds = bvh.bounds();
    if bounds.is_empty() {
        bounds = Aabb::around(&[[0.0; 3], [1.0; 3]]);
    }
    let mut at = |axis: usize| {
        let (low, high) = (bounds.min[axis], bounds.max[axis]);
        low + (high - low) * (1.4 * (rng.bits() >> 40) as f32 / (1 << 24) as f32 - 0.2)
    };
    (0..count).map(|_| [at(0), at(1), at(2)]).collect()
}

/// The vector scaled to length 1, rounded once.
fn unit(vector: [f32; 3]) -> [f32; 3] {
    let vector = vector.map(f64::from);
    let largest = vector.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    let scaled = vector.map(|x| x / largest);
    let length = scaled.iter().map(|x| x * x).sum::<f64>().sqrt();
    scaled.map(|x| (x / length) as f32)
}

fn length(vector: [f32; 3]) -> f64 {
    vector
        .map(|x| f64::from(x).powi(2))
        .iter()
        .sum::<f64>()
        .sqrt()
}

#[test]
fn bits_are_those_of_single_rays_on_every_width() {
    let mut rng = Rng::new(11);
    for (generate, width) in mesh::ALL.iter().zip(Width::ALL.into_iter().cycle()) {
        let mesh = generate(&mut rng, 80);
        let bvh = tree(&mesh, width);
        let from = points(&mut rng, &bvh, 40);
        let to = points(&mut rng, &bvh, 67);
        let normals: Vec<_> = from.iter().map(|_| rng.direction()).collect();
        let directions: Vec<_> = to.iter().map(|_| rng.direction()).collect();

        let seen = sees_directions(&bvh, &from, &[], &directions, ANY, &()).expect("bits");
        let facing = sees_directions(&bvh, &from, &normals, &directions, ANY, &()).expect("bits");
        let near = sees_directions(&bvh, &from, &[], &directions, 0.5, &()).expect("bits");
        let sight = sees_points(&bvh, &from, &to, Some(0.0), &()).expect("bits");
        for (row, (&org, normal)) in from.iter().zip(&normals).enumerate() {
            for (column, &dir) in directions.iter().enumerate() {
                let offset = f64::from(bvh.origin_offset(org));
                // The offset counts in units of the scene, along the direction scaled to length 1.
                let mut ray = Ray::new(org, unit(dir));
                ray.tnear = offset as f32;
                assert_eq!(seen.get(row, column), !bvh.occluded(&ray), "{}", mesh.name);
                let cosine: f64 = (0..3)
                    .map(|i| f64::from(normal[i]) * f64::from(dir[i]))
                    .sum();
                if cosine.abs() > 1e-6 {
                    let above = [0, 1, 2].map(|i| {
                        let normal = f64::from(normal[i]) / length(*normal);
                        (f64::from(org[i]) + offset * normal) as f32
                    });
                    let blocked = bvh.occluded(&Ray::new(above, dir));
                    let expected = cosine > 0.0 && !blocked;
                    assert_eq!(facing.get(row, column), expected, "{}", mesh.name);
                }
                // So does the distance.
                ray.tfar = 0.5;
                assert_eq!(near.get(row, column), !bvh.occluded(&ray), "{}", mesh.name);
                let between = Ray::between(org, to[column]);
                assert_eq!(
                    sight.get(row, column),
                    !bvh.occluded(&between),
                    "{}",
                    mesh.name
                );
            }
        }
    }
}

fn landscape() -> (Mesh, Bvh) {
    let mesh = mesh::bumpy_grid(&mut Rng::new(5), 2000);
    let bvh = tree(&mesh, Width::W8);
    (mesh, bvh)
}

#[test]
fn threads_and_parts_change_no_bit() {
    let (mesh, bvh) = landscape();
    let mut rng = Rng::new(8);
    let from = &mesh.positions[..700];
    let normals = vec![[0.0, 0.0, 1.0]; from.len()];
    let directions: Vec<_> = (0..130).map(|_| rng.direction()).collect();
    let weights: Vec<f64> = (0..130).map(|i| 1.0 / f64::from(1 + i)).collect();
    let patches = SkyDivision::Tregenza.patches().expect("patches");
    let sky = (&patches, &Orientation::default());

    type All = (Vec<u64>, Vec<u64>, Vec<u64>, Vec<u32>);
    let ask = |from: &[[f32; 3]], normals: &[[f32; 3]]| -> Result<All, Error> {
        let seen = sees_directions(&bvh, from, normals, &directions, ANY, &())?;
        let sight = sees_points(&bvh, from, &mesh.positions[..99], None, &())?;
        let hours = sun_hours(&bvh, from, normals, &directions, &weights, &())?;
        assert_eq!(hours, seen.weighted_sums(&weights)?);
        let view = sky_view(&bvh, from, normals, sky, Weighting::Cosine, &())?;
        let hours = hours.iter().map(|x| x.to_bits()).collect();
        let view = view.iter().map(|x| x.to_bits()).collect();
        Ok((seen.into_words(), sight.into_words(), hours, view))
    };
    let all = ask(from, &normals).expect("answers");
    assert!(all.0.iter().any(|&word| word != 0) && all.1.iter().any(|&word| word != u64::MAX));
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let again = pool.expect("threads").install(|| ask(from, &normals));
        assert_eq!(again.expect("answers"), all, "{threads} threads");
    }
    let mut parts = All::default();
    for (from, normals) in from.chunks(77).zip(normals.chunks(77)) {
        let part = ask(from, normals).expect("answers");
        parts.0.extend(part.0);
        parts.1.extend(part.1);
        parts.2.extend(part.2);
        parts.3.extend(part.3);
    }
    assert_eq!(parts, all);
}

#[test]
fn visibility_of_one_list_is_symmetric_and_the_same_in_parts() {
    let (mesh, bvh) = landscape();
    let above = |point: &[f32; 3]| [point[0], point[1], point[2] + 0.01];
    let points: Vec<_> = mesh.positions.iter().step_by(4).map(above).collect();
    let whole = sees_each_other(&bvh, &points, 0..points.len(), Some(0.0), &()).expect("bits");
    assert!(
        whole.count() < (points.len() * points.len()) as u64,
        "some are hidden"
    );
    for row in 0..points.len() {
        assert!(!whole.get(row, row), "no point sees itself");
        for column in 0..row {
            assert_eq!(whole.get(row, column), whole.get(column, row));
        }
    }
    let mut parts = BitMatrix::new(0, points.len()).expect("a matrix");
    for rows in [0..1, 1..100, 100..100, 100..points.len()] {
        let part = sees_each_other(&bvh, &points, rows, Some(0.0), &()).expect("bits");
        parts.append(&part).expect("as many columns");
    }
    assert_eq!(parts, whole);
    let error = sees_each_other(&bvh, &points, 0..points.len() + 1, None, &());
    assert!(matches!(error, Err(Error::Length { .. })));
}

#[test]
fn margins_leave_out_both_ends() {
    let square = [
        [0.0, 0.0, 0.0],
        [4.0, 0.0, 0.0],
        [4.0, 4.0, 0.0],
        [0.0, 4.0, 0.0],
    ];
    let geometry = [Geometry::triangles(&square[..], vec![[0, 1, 2], [0, 2, 3]])];
    let bvh = Bvh::build(&geometry, &Recipe::default()).expect("a tree");
    let sees = |from, to, margin| {
        sees_points(&bvh, &[from], &[to], Some(margin), &())
            .expect("a bit")
            .get(0, 0)
    };
    let (low, high) = ([1.0, 2.0, -0.1], [1.0, 2.0, 1.9]);
    assert!(!sees(low, high, 0.0));
    assert!(!sees(low, high, 0.09));
    assert!(sees(low, high, 0.11), "the square lies within the margin");
    assert!(sees(high, low, 0.11));
    assert!(sees(low, high, 1.5), "nearer than twice the margin");
    assert!(sees(low, low, 0.0) && sees(low, low, 0.1));
    assert!(!sees([f32::NAN; 3], high, 0.0) && !sees(low, [f32::INFINITY, 0.0, 0.0], 0.5));
    for margin in [-1.0, f32::NAN, f32::INFINITY] {
        assert!(sees_points(&bvh, &[low], &[high], Some(margin), &()).is_err());
    }
}

/// A cube of 2 around a point, turned, and for each point its face's normal.
fn turned_cube(rng: &mut Rng, middle: [f64; 3]) -> (Bvh, Vec<[f32; 3]>, Vec<[f64; 3]>) {
    let turn = |[x, y, z]: [f64; 3]| {
        let (x, y) = (0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y);
        let (y, z) = (0.28 * y - 0.96 * z, 0.96 * y + 0.28 * z);
        [x, y, z]
    };
    let place = |point| {
        let turned = turn(point);
        [0, 1, 2].map(|axis| (middle[axis] + turned[axis]) as f32)
    };
    let (mut corners, mut triangles) = (Vec::new(), Vec::new());
    let (mut points, mut normals) = (Vec::new(), Vec::new());
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let on = |u: f64, v: f64| {
                let mut point = [side; 3];
                (point[(axis + 1) % 3], point[(axis + 2) % 3]) = (u, v);
                point
            };
            let first = corners.len() as u32;
            triangles.extend([[0, 1, 2], [0, 2, 3]].map(|face| face.map(|i: u32| first + i)));
            let square = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
            corners.extend(square.map(|(u, v)| place(on(u, v))));
            for _ in 0..60 {
                let mut number = || 1.8 * (rng.bits() >> 40) as f64 / f64::from(1 << 24) - 0.9;
                points.push(place(on(number(), number())));
                let mut normal = [0.0; 3];
                normal[axis] = side;
                normals.push(turn(normal));
            }
        }
    }
    let geometry = [Geometry::triangles(&corners[..], &triangles[..])];
    let bvh = Bvh::build(&geometry, &Recipe::default()).expect("a tree");
    (bvh, points, normals)
}

#[test]
fn points_on_a_body_see_all_that_is_outside_of_it() {
    let mut rng = Rng::new(21);
    for middle in [[0.0; 3], [3.0, -70.0, 900.0], [1e4, 1e4, 10.0]] {
        let (bvh, points, normals) = turned_cube(&mut rng, middle);
        let directions: Vec<_> = (0..100).map(|_| unit(rng.direction())).collect();
        let seen = sees_directions(&bvh, &points, &[], &directions, ANY, &()).expect("bits");
        for (row, (&point, normal)) in points.iter().zip(&normals).enumerate() {
            // Also of ends far away, from where the cube is hardly to be hit.
            let along = |dir: &[f32; 3], far: f32| [0, 1, 2].map(|i| point[i] + far * dir[i]);
            for far in [9.0, 1e5] {
                let ends: Vec<_> = directions.iter().map(|dir| along(dir, far)).collect();
                let sight = sees_points(&bvh, &[point], &ends, None, &()).expect("bits");
                let back = sees_points(&bvh, &ends, &[point], None, &()).expect("bits");
                for (column, dir) in directions.iter().enumerate() {
                    let cosine: f64 = (0..3).map(|i| normal[i] * f64::from(dir[i])).sum();
                    // A few degrees above and below the surface, rounding decides.
                    if cosine.abs() > 0.1 {
                        let expected = cosine > 0.0;
                        assert_eq!(seen.get(row, column), expected, "{point:?} {dir:?}");
                        assert_eq!(sight.get(0, column), expected, "{point:?} {dir:?} {far}");
                        assert_eq!(back.get(column, 0), expected, "{point:?} {dir:?} {far}");
                    }
                }
            }
        }
    }
}

#[test]
fn open_ground_has_the_whole_sky() {
    let square = [
        [0.0, 0.0, 0.0],
        [9.0, 0.0, 0.0],
        [9.0, 9.0, 0.0],
        [0.0, 9.0, 0.0],
    ];
    let geometry = [Geometry::triangles(&square[..], vec![[0, 1, 2], [0, 2, 3]])];
    let bvh = Bvh::build(&geometry, &Recipe::default()).expect("a tree");
    let points: Vec<_> = (0..400u16)
        .map(|index| [17, 23].map(|step| f32::from(index * step % 90) / 10.0))
        .map(|[x, y]| [x, y, 0.0])
        .collect();
    let patches = SkyDivision::Tregenza.patches().expect("patches");
    let sky = (&patches, &Orientation::default());
    let view = sky_view(&bvh, &points, &[], sky, Weighting::Cosine, &());
    assert_eq!(view, Ok(vec![1.0; points.len()]));
}

#[test]
fn an_endless_wall_takes_half_of_the_sky() {
    let far = 1e4;
    let wall = [
        [0.0, -far, -far],
        [0.0, far, -far],
        [0.0, far, far],
        [0.0, -far, far],
    ];
    let geometry = [Geometry::triangles(&wall[..], vec![[0, 1, 2], [0, 2, 3]])];
    let bvh = Bvh::build(&geometry, &Recipe::default()).expect("a tree");
    let points = [
        [1.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [f32::NAN, 0.0, 0.0],
        [1.0, 0.0, 0.0],
    ];
    let normals = [[0.0, 0.0, 3.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]];
    // Of the divisions in rows, the patches due north and south lie in the plane of the wall, and are open.
    for (division, tolerance) in [
        (SkyDivision::Tregenza, 0.07),
        (SkyDivision::Reinhart(2), 0.035),
        (SkyDivision::Uniform(2000), 0.01),
    ] {
        let patches = division.patches().expect("patches");
        for weighting in [Weighting::Cosine, Weighting::Uniform] {
            let sky = (&patches, &Orientation::default());
            let view = sky_view(&bvh, &points, &normals, sky, weighting, &()).expect("values");
            assert!(
                (view[0] - 0.5).abs() < tolerance,
                "{division:?} {weighting:?} {view:?}"
            );
            assert!(
                (view[1] - 0.5).abs() < tolerance,
                "{division:?} {weighting:?} {view:?}"
            );
            assert!(view[2].is_nan() && view[3].is_nan());
            let open = sky_view(
                &bvh,
                &[[1.0, 0.0, 2.0 * far]],
                &normals[..1],
                sky,
                weighting,
                &(),
            );
            assert_eq!(open.expect("a value"), [1.0]);
        }
    }
    // The same wall where y points up.
    let turned = wall.map(|[x, y, z]| [x, z, -y]);
    let geometry = [Geometry::triangles(&turned[..], vec![[0, 1, 2], [0, 2, 3]])];
    let bvh = Bvh::build(&geometry, &Recipe::default()).expect("a tree");
    let y = Orientation::new(UpAxis::Y, 0.0).expect("axes");
    let patches = SkyDivision::Tregenza.patches().expect("patches");
    let ups = [[0.0, 1.0, 0.0]];
    let view = sky_view(
        &bvh,
        &points[..1],
        &ups,
        (&patches, &y),
        Weighting::Cosine,
        &(),
    );
    assert!((view.expect("a value")[0] - 0.5).abs() < 0.07);
}

#[test]
fn lists_that_do_not_fit_are_refused() {
    let (mesh, bvh) = landscape();
    let up = [[0.0, 0.0, 1.0]];
    let points = &mesh.positions[..2];
    let error = sees_directions(&bvh, points, &up, &up, ANY, &()).unwrap_err();
    assert_eq!(error.to_string(), "normals: found 1, wanted 2");
    let error = sees_directions(&bvh, points, &[], &up, -1.0, &()).unwrap_err();
    assert!(matches!(error, Error::Distance(_)));
    assert!(sun_hours(&bvh, points, &[], &up, &[], &()).is_err());
    // Nothing to see, and nobody to look.
    assert_eq!(
        sun_hours(&bvh, points, &[], &[], &[], &()),
        Ok(vec![0.0; 2])
    );
    let nobody = sees_directions(&bvh, &[], &[], &up, ANY, &()).expect("no bits");
    assert_eq!((nobody.rows(), nobody.columns()), (0, 1));
    let nothing = sees_directions(&bvh, points, &[], &[], ANY, &()).expect("no bits");
    assert_eq!((nothing.rows(), nothing.count()), (2, 0));
    let zero = sees_directions(&bvh, points, &[], &[[0.0; 3], [f32::NAN; 3]], ANY, &());
    assert_eq!(zero.expect("bits").count(), 0);
}
