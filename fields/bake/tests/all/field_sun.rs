//! Sun and sky on the cells of height fields, against rays to the mesh of the same raster.

use antumbra::{Bvh, Geometry, Recipe};
use antumbra_bake::{
    Clock, FieldSunJob, HeightField, Irradiance, Moment, Orientation, Place, SkyDivision, SunFound,
    SunJob, Sunlight, TimeStep, UpAxis, run,
};
use antumbra_raster::{Grid, Raster};
use antumbra_terrain::March;

pub const NORTH: f64 = 3.7;

/// A day in steps of ten minutes, with light.
pub fn sunlight(up: UpAxis) -> Sunlight {
    let place = Place {
        latitude: 47.0,
        longitude: 9.0,
        ..Place::default()
    };
    let at = |day| Moment {
        year: 2025,
        month: 4,
        day,
        seconds: 0.0,
    };
    let steps = TimeStep::regular([at(20), at(21)], &Clock::Fixed(1.0), 600.0);
    let mut steps = steps.expect("steps");
    for step in &mut steps {
        step.irradiance = Irradiance {
            direct_normal: 700.0,
            diffuse_horizontal: 90.0,
        };
    }
    let patches = SkyDivision::Tregenza.patches().expect("patches");
    let plan = Orientation::new(up, NORTH).expect("an orientation");
    Sunlight::new(&place, steps, true, patches, plan).expect("sunlight")
}

/// Hills with small noise, houses, and holes for this part of the cells. Heights are multiples of 2^-10, which single precision holds.
pub fn village([width, height]: [usize; 2], cell: f64, holes: f64) -> Raster {
    let noise = |cell: usize| (cell * 7919 % 1013) as f64 / 1013.0;
    let values = (0..width * height).map(|cell| {
        let [x, y] = [cell % width, cell / width];
        let wave = 9.0 * (x as f64 / 7.0).sin() * (y as f64 / 5.0).cos();
        let house = if x % 16 > 11 && y % 12 > 6 { 6.0 } else { 0.0 };
        match noise(cell + 11) < holes {
            true => f64::NAN,
            false => ((wave + 0.4 * noise(cell) + house) * 1024.0).round() / 1024.0,
        }
    });
    Raster {
        values: values.collect(),
        grid: Grid::north_up([width, height], [0.0; 2], cell),
        height_factor: None,
    }
}

/// What rays find at the vertices of the mesh.
fn by_rays(raster: &Raster, sunlight: &Sunlight) -> (SunFound, Vec<[f32; 3]>) {
    let mesh = raster.mesh([0.0; 3]);
    let geometry = [Geometry::triangles(&mesh.positions[..], mesh.indices)];
    let bvh = Bvh::build(&geometry, &Recipe::default()).expect("a tree");
    let job = SunJob::new(&mesh.positions, &mesh.normals, sunlight).expect("a job");
    (run(&job, &bvh, &()).expect("values"), mesh.normals)
}

#[test]
fn cells_receive_what_rays_say() {
    let sunlight = sunlight(UpAxis::Z);
    let (mut bits, mut differing) = (0, 0);
    for holes in [0.0, 0.03] {
        let raster = village([70, 50], 2.0, holes);
        let size = [raster.grid.width, raster.grid.height];
        let field = HeightField::new(size, &raster.values, raster.grid.transform).expect("a field");
        let job = FieldSunJob::new(&field, &sunlight, (0.0, NORTH), true).expect("a job");
        let found = job.whole(true, &()).expect("values");
        let (wanted, normals) = by_rays(&raster, &sunlight);
        let apart = |a: &[f32; 3], b: &[f32; 3]| {
            (0..3)
                .map(|axis| (a[axis] - b[axis]).abs())
                .fold(0.0, f32::max)
        };
        let all = job.normals();
        assert_eq!(all.len(), normals.len());
        assert!(all.iter().zip(&normals).all(|(a, b)| apart(a, b) < 1e-6));
        let cells: Vec<usize> = (0..raster.values.len())
            .filter(|&cell| raster.values[cell].is_finite())
            .collect();
        for (sun, position) in sunlight.suns.positions.iter().enumerate() {
            let march = March::new(&field, 0.0, 0.0).expect("a march");
            let horizons = march.horizons(position.azimuth + NORTH, antumbra_terrain::degrees, &());
            let horizons = horizons.expect("horizons");
            for (row, &cell) in cells.iter().enumerate() {
                bits += 1;
                if found.suns_seen.get(row, sun) != wanted.suns_seen.get(row, sun) {
                    differing += 1;
                    let apart = (f64::from(horizons[cell]) - position.elevation).abs();
                    // Rays pass through holes, and go on below the surface behind them.
                    assert!(holes > 0.0 || apart < 0.05, "{row} {sun}: {apart} degrees");
                }
            }
        }
        for row in 0..cells.len() {
            let (own, rays) = (&found.values, &wanted.values);
            let is_equal = found.suns_seen.row(row) == wanted.suns_seen.row(row)
                && found.sky_seen.row(row) == wanted.sky_seen.row(row);
            if !is_equal || rays.hours[row].is_nan() {
                assert_eq!(own.hours[row].is_nan(), rays.hours[row].is_nan());
                continue;
            }
            for (a, b) in [
                (&own.hours, &rays.hours),
                (&own.direct, &rays.direct),
                (&own.diffuse, &rays.diffuse),
                (&own.sky_view, &rays.sky_view),
                (&own.sky_open, &rays.sky_open),
            ] {
                assert!(
                    (a[row] - b[row]).abs() < 1e-6 * b[row].max(1.0),
                    "{row}: {} {}",
                    a[row],
                    b[row]
                );
            }
            assert_eq!(own.by_month[12 * row + 3], own.hours[row]);
            assert_eq!(own.diffuse_by_month[12 * row + 3], own.diffuse[row]);
        }
    }
    assert!(1000 * differing < bits, "{differing} of {bits}");
}

#[test]
fn batches_and_jobs_have_the_same_bits() {
    let sunlight = sunlight(UpAxis::Z);
    let raster = village([67, 40], 1.0, 0.02);
    let size = [raster.grid.width, raster.grid.height];
    let field = HeightField::new(size, &raster.values, raster.grid.transform).expect("a field");
    let job = FieldSunJob::new(&field, &sunlight, (0.5, NORTH), false).expect("a job");
    let whole = job.whole(true, &()).expect("values");
    let tree = Bvh::build(&[], &Recipe::default()).expect("a tree");
    let by_items = run(&job, &tree, &()).expect("values");
    let lean = job.whole(false, &()).expect("values");
    let bits = |list: &[f64]| list.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    for found in [&by_items, &lean] {
        let pairs = [
            (&found.values.hours, &whole.values.hours),
            (&found.values.direct, &whole.values.direct),
            (&found.values.diffuse, &whole.values.diffuse),
            (&found.values.sky_view, &whole.values.sky_view),
        ];
        assert!(pairs.iter().all(|(a, b)| bits(a) == bits(b)));
        assert!(found.values.by_month.is_empty() && found.values.direct_by_month.is_empty());
    }
    assert!(by_items.suns_seen == whole.suns_seen && by_items.sky_seen == whole.sky_seen);
    assert_eq!(lean.suns_seen.rows(), 0);
}
