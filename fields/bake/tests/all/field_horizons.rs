//! Horizon angles of height fields against all triangles in double precision, and against the dip of the sea.

use antumbra::{Bvh, Recipe};
use antumbra_bake::{
    Curvature, EARTH_RADIUS, FieldHorizonJob, HeightField, Job as _, Key, Observer, Orientation,
    Part, REFRACTION, Work, run,
};
use antumbra_raster::{Grid, Raster};
use antumbra_testkit::Rng;

fn tree() -> Bvh {
    Bvh::build(&[], &Recipe::default()).expect("a tree")
}

fn hills([width, height]: [usize; 2], transform: [f64; 6], holes: f64, rng: &mut Rng) -> Raster {
    let values = (0..width * height).map(|cell| {
        let [x, y] = [(cell % width) as f64, (cell / width) as f64];
        let wave = 20.0 * (x / 17.0).sin() * (y / 13.0).cos() + 8.0 * f64::from(rng.unit());
        match f64::from(rng.unit()) < holes {
            true => f64::NAN,
            false => wave,
        }
    });
    let values = values.collect();
    let mut grid = Grid::north_up([width, height], [0.0; 2], 1.0);
    grid.transform = transform;
    Raster {
        grid,
        values,
        height_factor: None,
    }
}

/// Largest slope of all edges of all triangles of the raster's mesh on the way from an eye along an azimuth.
fn brute(raster: &Raster, eye: &Observer, azimuth: f64, drop: f64) -> f64 {
    let mesh = raster.mesh([0.0; 3]);
    let t = raster.grid.transform;
    let flat = |[c, r]: [f64; 2]| [c * t[1] + r * t[2], c * t[4] + r * t[5]];
    let (east, north) = azimuth.to_radians().sin_cos();
    let corner = |index: u32| {
        let cell = mesh.cells[index as usize] as usize;
        let [column, row] = [cell % raster.grid.width, cell / raster.grid.width];
        let [x, y] = flat([column as f64 - eye.place[0], row as f64 - eye.place[1]]);
        // Ahead, to the right, and up.
        let up = raster.values[cell] - eye.height - drop * (x * x + y * y);
        [x * east + y * north, x * north - y * east, up]
    };
    let mut most = f64::NEG_INFINITY;
    for indices in &mesh.indices {
        let corners = indices.map(corner);
        for side in 0..3 {
            let (a, b) = (corners[side], corners[(side + 1) % 3]);
            // A crossing at a corner counts for both sides of it.
            let slack = 1e-9;
            if a[1].min(b[1]) > slack || a[1].max(b[1]) < -slack {
                continue;
            }
            let part = match (a[1] - b[1]).abs() > slack {
                true => (a[1] / (a[1] - b[1])).clamp(0.0, 1.0),
                false => continue,
            };
            let at = a[0] + part * (b[0] - a[0]);
            if at > 1e-6 {
                most = most.max((a[2] + part * (b[2] - a[2])) / at);
            }
        }
    }
    most.atan().to_degrees()
}

#[test]
fn angles_are_those_of_all_triangles() {
    let mut rng = Rng::new(35);
    let mut compared = 0;
    for (size, transform, holes, drop) in [
        ([80, 70], [0.0, 1.0, 0.0, 0.0, 0.0, -1.0], 0.0, 0.0),
        ([66, 33], [9.0, 2.0, 0.5, 7.0, -0.25, -1.5], 0.0, 1e-3),
        ([40, 90], [0.0, 1.0, 0.0, 0.0, 0.0, -1.0], 0.2, 0.0),
        ([35, 36], [0.0, 0.0, 3.0, 0.0, 2.0, 0.0], 0.4, 1e-3),
        ([2, 2], [0.0, 1.0, 0.0, 0.0, 0.0, -1.0], 0.0, 0.0),
    ] {
        let raster = hills(size, transform, holes, &mut rng);
        let field = HeightField::new(size, &raster.values, transform).expect("a field");
        let mut observers = Vec::new();
        while observers.len() < 40 {
            // Centres of cells, places between them, and places beside the field.
            let [x, y] = size.map(|side| (1.4 * f64::from(rng.unit()) - 0.2) * side as f64);
            let place = match observers.len() % 2 {
                0 => [x.floor(), y.floor()],
                _ => [x, y].map(|at| (at * 1024.0).round() / 1024.0),
            };
            let height = field.surface(place).unwrap_or(10.0) + 2.0 * f64::from(rng.unit());
            observers.push(Observer {
                place,
                height,
                normal: [0.0; 3],
            });
        }
        let azimuths = [0.0, 45.0, 90.0, 123.4, 180.0, 217.0, 270.0, 315.0, 359.0];
        let job = FieldHorizonJob::new(&field, &observers, &azimuths, drop).expect("a job");
        let found = run(&job, &tree(), &()).expect("angles");
        for (index, observer) in observers.iter().enumerate() {
            for (&azimuth, &found) in azimuths.iter().zip(&found[azimuths.len() * index..]) {
                let wanted = brute(&raster, observer, azimuth, drop);
                // Where a line runs along edges or touches a corner, rounding decides which of two neighbours it crosses.
                let is_beside = field.surface(observer.place).is_none();
                let is_along = azimuth % 45.0 == 0.0 && (holes > 0.0 || is_beside);
                let is_close = (f64::from(found) - wanted).abs() < 1e-4;
                assert!(
                    is_close || is_along,
                    "{size:?} {observer:?} {azimuth}: {found} for {wanted}"
                );
                compared += usize::from(is_close);
            }
        }
    }
    assert!(compared > 1700, "{compared}");
}

#[test]
fn the_sea_dips_below_the_level() {
    let cell = 25.0;
    let size = [1601, 1601];
    let transform = [0.0, cell, 0.0, 0.0, 0.0, -cell];
    let sea = vec![0.0; size[0] * size[1]];
    let field = HeightField::new(size, &sea, transform).expect("a field");
    for refraction in [0.0, REFRACTION] {
        let earth = Curvature::new(EARTH_RADIUS, refraction, [0.0; 3], Orientation::default());
        let drop = earth.expect("an earth").factor();
        let observers = [2.0, 10.0].map(|height| Observer {
            place: [800.0, 800.0],
            height,
            normal: [0.0; 3],
        });
        let azimuths = [0.0, 33.0, 90.0, 251.0];
        let job = FieldHorizonJob::new(&field, &observers, &azimuths, drop).expect("a job");
        let found = run(&job, &tree(), &()).expect("angles");
        for (index, &found) in found.iter().enumerate() {
            let height = observers[index / azimuths.len()].height;
            // Largest value of (-h - f t²) / t, at t = sqrt(h / f).
            let wanted = (-2.0 * (height * drop).sqrt()).atan().to_degrees();
            assert!(
                (f64::from(found) - wanted).abs() < 2e-5,
                "{found} for {wanted}"
            );
        }
    }
}

#[test]
fn eyes_below_the_surface_beside_it_and_nowhere() {
    let heights = [1.0; 9];
    let field = HeightField::new([3, 3], &heights, [0.0, 1.0, 0.0, 0.0, 0.0, -1.0]);
    let field = field.expect("a field");
    let eye = |place: [f64; 2], height: f64| Observer {
        place,
        height,
        normal: [0.0; 3],
    };
    let observers = [
        eye([1.0, 1.0], 0.5),
        eye([-1.0, 1.0], 1.0),
        eye([1.0, f64::NAN], 1.0),
        eye([1.0, 1.0], 1.0),
    ];
    let job = FieldHorizonJob::new(&field, &observers, &[90.0, 270.0], 0.0).expect("a job");
    let found = run(&job, &tree(), &()).expect("angles");
    assert_eq!(found[..4], [90.0, 90.0, 0.0, -90.0]);
    assert!(found[4..6].iter().all(|angle| angle.is_nan()));
    assert_eq!(found[6..], [0.0, 0.0]);
    assert!(FieldHorizonJob::new(&field, &observers, &[f64::INFINITY], 0.0).is_err());
}

#[test]
fn shares_have_the_bytes_of_the_whole() {
    let mut rng = Rng::new(7);
    let raster = hills([50, 40], [0.0, 1.0, 0.0, 0.0, 0.0, -1.0], 0.1, &mut rng);
    let field = HeightField::new([50, 40], &raster.values, raster.grid.transform);
    let field = field.expect("a field");
    let observers: Vec<Observer> = (0..2000)
        .map(|cell| Observer {
            place: [(cell % 50) as f64, (cell / 50) as f64],
            height: raster.values[cell] + 1.0,
            normal: [0.0; 3],
        })
        .collect();
    let job = FieldHorizonJob::new(&field, &observers, &[0.0, 100.0], 0.0).expect("a job");
    let whole = run(&job, &tree(), &()).expect("angles");
    let key = Key::of(&job, |_| {});
    let mut all = Work::new(&job, key, [0, 1], Vec::new());
    for share in [1, 0] {
        let mut work = Work::new(&job, key, [share, 2], Vec::new());
        while work.step(&tree(), &()).expect("a step") {}
        let mut file = Vec::new();
        work.write(&mut file).expect("a file");
        all.add(Part::read(&file[..]).expect("a part"))
            .expect("the same job");
    }
    let bits = |angles: Vec<f32>| angles.into_iter().map(f32::to_bits).collect::<Vec<_>>();
    assert_eq!(bits(all.finish().expect("angles")), bits(whole));
    assert_eq!(job.size().items, 2000);
}
