//! Houses in terrain, against houses and terrain as one mesh.

use antumbra::{Bvh, Geometry, LocalOrigin, Recipe};
use antumbra_bake::{
    BitMatrix, FieldSunJob, HeightField, Job, Key, SunFound, SunJob, Sunlight, Surroundings,
    UpAxis, run,
};
use antumbra_raster::Raster;
use antumbra_terrain::Skyline;

use crate::field_sun::{NORTH, sunlight, village};
use crate::height_fields::in_shares;

/// Degrees within which rays in single precision may be at the other side of a horizon.
const CLOSE: f64 = 0.03;

fn field(raster: &Raster) -> HeightField<'_> {
    let size = [raster.grid.width, raster.grid.height];
    HeightField::new(size, &raster.values, raster.grid.transform).expect("a field")
}

/// Triangles, and points on them that are above the terrain, with their normals.
#[derive(Default)]
struct Houses {
    positions: Vec<[f32; 3]>,
    indices: Vec<[u32; 3]>,
    points: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
}

impl Houses {
    /// Boxes that stand in the ground of a field.
    fn new(field: &HeightField<'_>) -> Self {
        let mut all = Self::default();
        for index in 0..20_u8 {
            let (column, row) = (f64::from(index % 5), f64::from(index / 5));
            let middle = field.along([6.3 + 14.0 * column, 5.6 + 12.0 * row]);
            let ground = field.surface(field.place(middle)).expect("ground");
            let [x, y, z] =
                [middle[0], middle[1], ground].map(|x| (16.0 * x).round() as f32 / 16.0);
            let (low, high) = ([x - 3.0, y - 4.0, z - 5.0], [x + 3.0, y + 4.0, z + 6.0]);
            all.push(field, low, high);
        }
        all
    }

    fn push(&mut self, field: &HeightField<'_>, low: [f32; 3], high: [f32; 3]) {
        // Each side and the roof, with corners that run anticlockwise as seen from outside.
        for (axis, is_high) in [(0, false), (0, true), (1, false), (1, true), (2, true)] {
            let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
            let at = |s: f32, t: f32| {
                let mut point = if is_high { high } else { low };
                point[u] = low[u] + s * (high[u] - low[u]);
                point[v] = low[v] + t * (high[v] - low[v]);
                point
            };
            let first = self.positions.len() as u32;
            self.positions
                .extend([at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)]);
            let turned = |[a, b, c]: [u32; 3]| if is_high { [a, b, c] } else { [a, c, b] };
            self.indices
                .extend([[0, 1, 2], [0, 2, 3]].map(|side| turned(side.map(|i| first + i))));
            for place in 0..64_u8 {
                let [s, t] = [place % 8, place / 8].map(|at| (f32::from(at) + 0.5) / 8.0);
                let point = at(s, t);
                let [x, y, z] = point.map(f64::from);
                let ground = field.surface(field.place([x, y])).expect("ground");
                if z > ground + 0.3 {
                    let mut normal = [0.0; 3];
                    normal[axis] = if is_high { 1.0 } else { -1.0 };
                    self.points.push(point);
                    self.normals.push(normal);
                }
            }
        }
    }

    fn geometry(&self) -> Geometry<'_> {
        Geometry::triangles(&self.positions[..], &self.indices[..])
    }

    fn bvh(&self) -> Bvh {
        Bvh::build(&[self.geometry()], &Recipe::default()).expect("a tree")
    }

    /// The same houses with another axis up.
    fn turned(&self) -> Self {
        let turned = |list: &[[f32; 3]]| list.iter().map(|&[x, y, z]| [x, z, -y]).collect();
        Self {
            positions: turned(&self.positions),
            indices: self.indices.clone(),
            points: turned(&self.points),
            normals: turned(&self.normals),
        }
    }
}

/// Azimuths on the map and elevations of suns and patches.
fn lights(sunlight: &Sunlight) -> [Vec<[f64; 2]>; 2] {
    let suns = sunlight.suns.positions.iter();
    let patches = sunlight
        .patches
        .centres
        .iter()
        .map(|&[x, y, z]| [x.atan2(y).to_degrees() + NORTH, z.asin().to_degrees()]);
    [
        suns.map(|sun| [sun.azimuth + NORTH, sun.elevation])
            .collect(),
        patches.collect(),
    ]
}

/// Number of answers, and of those that differ. All of the latter are lights that the horizon of the terrain passes close by.
fn differing(
    field: &HeightField<'_>,
    points: &[[f32; 3]],
    sunlight: &Sunlight,
    [own, wanted]: [&SunFound; 2],
) -> [usize; 2] {
    let skyline = Skyline::new(field).expect("peaks");
    let [suns, patches] = lights(sunlight);
    let mut counts = [0; 2];
    let pairs: [(_, &BitMatrix, &BitMatrix); 2] = [
        (suns, &own.suns_seen, &wanted.suns_seen),
        (patches, &own.sky_seen, &wanted.sky_seen),
    ];
    for (lights, own, wanted) in pairs {
        for (row, point) in points.iter().enumerate() {
            let [x, y, z] = point.map(f64::from);
            for (light, [azimuth, elevation]) in lights.iter().enumerate() {
                counts[0] += 1;
                if own.get(row, light) != wanted.get(row, light) {
                    counts[1] += 1;
                    let hides = |elevation: f64| {
                        let light = skyline.light(*azimuth, elevation.to_radians().tan());
                        skyline.hides(field.place([x, y]), z, &light.expect("a light"))
                    };
                    assert!(
                        hides(elevation - CLOSE) && !hides(elevation + CLOSE),
                        "{point:?} {azimuth} {elevation}"
                    );
                }
            }
        }
    }
    counts
}

#[test]
fn houses_in_terrain_see_what_one_mesh_shows() {
    let sunlight = sunlight(UpAxis::Z);
    let raster = village([70, 50], 2.0, 0.0);
    let (field, mesh) = (field(&raster), raster.mesh([0.0; 3]));
    let houses = Houses::new(&field);
    let ground = Geometry::triangles(&mesh.positions[..], mesh.indices);
    let both = Bvh::build(&[houses.geometry(), ground], &Recipe::default()).expect("a tree");
    let terrain = Surroundings::new(&field, LocalOrigin::default(), (UpAxis::Z, NORTH));
    let terrain = terrain.expect("peaks");
    let bvh = houses.bvh();
    assert_eq!(terrain.buried(&bvh, &houses.points), 0);
    let (mut all, mut lit) = ([0; 2], 0);
    for normals in [&houses.normals[..], &[]] {
        let job = |tree: &Bvh, is_within: bool| {
            let job = SunJob::new(&houses.points, normals, &sunlight).expect("a job");
            let job = if is_within {
                job.within(&terrain).expect("lights")
            } else {
                job
            };
            run(&job, tree, &()).expect("values")
        };
        let (own, wanted, alone) = (job(&bvh, true), job(&both, false), job(&bvh, false));
        let counts = differing(&field, &houses.points, &sunlight, [&own, &wanted]);
        all = [all[0] + counts[0], all[1] + counts[1]];
        let sum = |found: &SunFound| found.values.hours.iter().sum::<f64>();
        // The terrain matters.
        assert!(
            sum(&own) < 0.95 * sum(&alone),
            "{} {}",
            sum(&own),
            sum(&alone)
        );
        lit += (own.values.sky_view.iter())
            .filter(|&&view| view > 0.1)
            .count();
    }
    assert!(
        all[0] > 500_000 && 2000 * all[1] < all[0] && lit > 1000,
        "{all:?} {lit}"
    );
}

#[test]
fn cells_among_houses_see_what_sensors_at_their_places_see() {
    let sunlight = sunlight(UpAxis::Z);
    let raster = village([70, 50], 2.0, 0.02);
    let field = field(&raster);
    let houses = Houses::new(&self::field(&village([70, 50], 2.0, 0.0)));
    let local = LocalOrigin {
        origin: [0.5, -0.25, 1.0],
    };
    let terrain = Surroundings::new(&field, local, (UpAxis::Z, NORTH)).expect("peaks");
    let mut moved = houses.positions.clone();
    for point in &mut moved {
        *point = local.local(point.map(f64::from));
    }
    let geometry = [Geometry::triangles(&moved[..], &houses.indices[..])];
    let bvh = Bvh::build(&geometry, &Recipe::default()).expect("a tree");
    let job = FieldSunJob::new(&field, &sunlight, (0.5, NORTH), true).expect("a job");
    let alone = job.whole(true, &()).expect("values");
    let job = job.among(&bvh, &terrain).expect("a job");
    let own = job.whole(true, &()).expect("values");
    let cells = (0..raster.values.len()).filter(|&cell| raster.values[cell].is_finite());
    let places = cells.map(|cell| {
        let [x, y] = raster.grid.centre(cell % 70, cell / 70);
        [x, y, raster.values[cell] + 0.5]
    });
    let places: Vec<[f64; 3]> = places.collect();
    let points: Vec<[f32; 3]> = places.iter().map(|&place| local.local(place)).collect();
    let normals = job.normals();
    let sensors = SunJob::new(&points, &normals, &sunlight).expect("a job");
    let sensors = sensors.within(&terrain).expect("lights");
    let wanted = run(&sensors, &bvh, &()).expect("values");
    let points: Vec<_> = places.iter().map(|place| place.map(|x| x as f32)).collect();
    let [all, apart] = differing(&field, &points, &sunlight, [&own, &wanted]);
    assert!(all > 500_000 && 2000 * apart < all, "{apart} of {all}");
    let bits = |found: &SunFound| {
        found
            .suns_seen
            .words()
            .iter()
            .map(|word| word.count_ones())
            .sum()
    };
    let [own_bits, alone_bits]: [u32; 2] = [&own, &alone].map(bits);
    assert!(
        own_bits * 10 < alone_bits * 9,
        "houses matter: {own_bits} {alone_bits}"
    );
    // Shares have the same bits, and neither houses nor their place are left out of the key.
    let shared = in_shares(&job, &bvh, 3);
    assert!(shared.suns_seen == own.suns_seen && shared.sky_seen == own.sky_seen);
    let plain = FieldSunJob::new(&field, &sunlight, (0.5, NORTH), true).expect("a job");
    assert_ne!(Key::of(&job, |_| {}), Key::of(&plain, |_| {}));
}

#[test]
fn neither_origin_nor_axes_nor_shares_change_an_answer() {
    let sunlight = sunlight(UpAxis::Z);
    let raster = village([70, 50], 2.0, 0.0);
    let own_field = field(&raster);
    let houses = Houses::new(&own_field);
    let bvh = houses.bvh();
    let found = |field: &HeightField<'_>, origin: [f64; 3]| {
        let local = LocalOrigin { origin };
        let terrain = Surroundings::new(field, local, (UpAxis::Z, NORTH)).expect("peaks");
        let job = SunJob::new(&houses.points, &houses.normals, &sunlight).expect("a job");
        let job = job.within(&terrain).expect("lights");
        let found = run(&job, &bvh, &()).expect("values");
        let shared = in_shares(&job, &bvh, 2);
        assert!(shared.suns_seen == found.suns_seen && shared.sky_seen == found.sky_seen);
        (found, Key::of(&job, |_| {}))
    };
    let (plain, key) = found(&own_field, [0.0; 3]);
    // The same place in map coordinates.
    let mut far = village([70, 50], 2.0, 0.0);
    (far.grid.transform[0], far.grid.transform[3]) = (600_000.25, 5_340_000.5);
    for height in &mut far.values {
        *height += 512.0;
    }
    let (moved, moved_key) = found(&field(&far), [600_000.25, 5_340_000.5, 512.0]);
    assert!(moved.suns_seen == plain.suns_seen && moved.sky_seen == plain.sky_seen);
    // A cell and an origin are parts of the key.
    let (_, other_origin) = found(&field(&far), [600_000.25, 5_340_000.5, 513.0]);
    far.values[0] += 1.0;
    let (_, other_cell) = found(&field(&far), [600_000.25, 5_340_000.5, 512.0]);
    let mut keys = vec![key, moved_key, other_origin, other_cell];
    keys.sort_unstable();
    keys.dedup();
    assert_eq!(keys.len(), 4);
    // With y up.
    let (turned, sunlight) = (houses.turned(), crate::field_sun::sunlight(UpAxis::Y));
    let terrain = Surroundings::new(&own_field, LocalOrigin::default(), (UpAxis::Y, NORTH));
    let terrain = terrain.expect("peaks");
    let job = SunJob::new(&turned.points, &turned.normals, &sunlight).expect("a job");
    let upright = run(&job.within(&terrain).expect("lights"), &turned.bvh(), &()).expect("values");
    let pairs = upright
        .suns_seen
        .words()
        .iter()
        .zip(plain.suns_seen.words());
    let apart: u32 = pairs.map(|(a, b)| (a ^ b).count_ones()).sum();
    assert!(apart < 20, "{apart}");
    // Points below the ground see nothing and are counted.
    let below: Vec<[f32; 3]> = houses
        .points
        .iter()
        .map(|&[x, y, z]| [x, y, z - 30.0])
        .collect();
    let terrain = Surroundings::new(&own_field, LocalOrigin::default(), (UpAxis::Z, NORTH));
    let terrain = terrain.expect("peaks");
    assert_eq!(terrain.buried(&bvh, &below), below.len());
    let sunlight = crate::field_sun::sunlight(UpAxis::Z);
    let job = SunJob::new(&below, &[], &sunlight).expect("a job");
    let dark = run(&job.within(&terrain).expect("lights"), &bvh, &()).expect("values");
    assert!(dark.values.hours.iter().all(|&hours| hours == 0.0));
    assert!(job_is_cancelled(&below, &sunlight, &terrain, &bvh));
}

/// Whether a job in terrain stops when it is cancelled.
fn job_is_cancelled(
    points: &[[f32; 3]],
    sunlight: &Sunlight,
    terrain: &Surroundings<'_>,
    bvh: &Bvh,
) -> bool {
    struct Stop;
    impl antumbra_bake::Monitor for Stop {
        fn progress(&self, _: usize, _: usize) {}
        fn cancelled(&self) -> bool {
            true
        }
    }
    let job = SunJob::new(points, &[], sunlight).expect("a job");
    let job = job.within(terrain).expect("lights");
    job.answers(bvh, 0..points.len(), &Stop).is_err()
}
