//! Viewsheds of height fields against all triangles in double precision, and against the horizon of a sphere.

use std::sync::Mutex;

use antumbra::{Bvh, Recipe};
use antumbra_bake::{
    Direction, EARTH_RADIUS, FieldHorizonJob, HeightField, Job, Key, Limits, Monitor, Observer,
    Part, REFRACTION, TargetHeightJob, ViewshedJob, Viewsheds, Work, run,
};
use antumbra_raster::{Grid, Raster};
use antumbra_terrain::Error;

fn tree() -> Bvh {
    Bvh::build(&[], &Recipe::default()).expect("a tree")
}

/// How far work is: never farther than all of it.
struct Done(Mutex<[usize; 2]>);

impl Monitor for Done {
    fn progress(&self, done: usize, total: usize) {
        assert!(done <= total, "{done} of {total}");
        let mut last = self.0.lock().expect("no panic");
        *last = [done.max(last[0]), total];
    }
}

/// What so many shares of a job find together.
pub fn in_shares<J: Job>(job: &J, bvh: &Bvh, shares: u32) -> J::Found {
    let key = Key::of(job, |_| {});
    let mut together = Work::new(job, key, [0, 1], Vec::new());
    for index in 0..shares {
        let mut work = Work::new(job, key, [index, shares], Vec::new());
        let done = Done(Mutex::default());
        while work.step(bvh, &done).expect("a step") {}
        let [done, total] = *done.0.lock().expect("no panic");
        assert_eq!(done, total);
        let mut file = Vec::new();
        work.write(&mut file).expect("bytes");
        let part = Part::read(&file).expect("a part");
        together.add(part).expect("the same job");
    }
    together.finish().expect("all")
}

/// Pseudorandom numbers from 0 to 1.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f64 / (1 << 24) as f64
    }
}

/// Hills with noise, and perhaps with holes. Heights are multiples of 2^-10, which single precision holds.
fn hills([width, height]: [usize; 2], transform: [f64; 6], holes: f64, seed: u64) -> Raster {
    let mut random = Random(seed);
    let values = (0..width * height).map(|cell| {
        let [x, y] = [(cell % width) as f64, (cell / width) as f64];
        let wave = 20.0 * (x / 7.0).sin() * (y / 5.0).cos() + 8.0 * random.next();
        match random.next() < holes {
            true => f64::NAN,
            false => (wave * 1024.0).round() / 1024.0,
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

/// A surface as triangles: places as columns and rows, and heights.
struct Triangles(Vec<[[f64; 3]; 3]>);

impl Triangles {
    fn of(raster: &Raster) -> Self {
        let mesh = raster.mesh([0.0; 3]);
        let corner = |index: u32| {
            let cell = mesh.cells[index as usize] as usize;
            let [column, row] = [cell % raster.grid.width, cell / raster.grid.width];
            [column as f64, row as f64, raster.values[cell]]
        };
        Self(
            mesh.indices
                .iter()
                .map(|indices| indices.map(corner))
                .collect(),
        )
    }

    /// Least height of a line above the surface, strictly between its ends; heights of the surface sink by `drop` times the
    /// squared distance from the eye.
    fn clearance(
        &self,
        eye: [f64; 3],
        target: [f64; 3],
        squared: impl Fn([f64; 2]) -> f64,
        drop: f64,
    ) -> f64 {
        let mut least = f64::INFINITY;
        let along = [target[0] - eye[0], target[1] - eye[1]];
        let sunk = |p: [f64; 3]| p[2] - drop * squared([p[0] - eye[0], p[1] - eye[1]]);
        let end = sunk(target);
        for corners in &self.0 {
            for side in 0..3 {
                let [a, b] = [corners[side], corners[(side + 1) % 3]];
                let edge = [b[0] - a[0], b[1] - a[1]];
                let area = along[0] * edge[1] - along[1] * edge[0];
                if area == 0.0 {
                    continue;
                }
                let from = [a[0] - eye[0], a[1] - eye[1]];
                let t = (from[0] * edge[1] - from[1] * edge[0]) / area;
                let part = (from[0] * along[1] - from[1] * along[0]) / area;
                if t > 1e-9 && t < 1.0 - 1e-9 && (-1e-12..=1.0 + 1e-12).contains(&part) {
                    let surface = sunk(a) + part * (sunk(b) - sunk(a));
                    least = least.min(eye[2] + t * (end - eye[2]) - surface);
                }
            }
        }
        least
    }
}

struct Case {
    raster: Raster,
    target: f64,
    drop: f64,
    range: f64,
}

impl Case {
    /// A surface on a flat earth, all of which is in range.
    fn level(raster: Raster) -> Self {
        Self {
            raster,
            target: 0.0,
            drop: 0.0,
            range: f64::INFINITY,
        }
    }

    fn field(&self) -> HeightField<'_> {
        let grid = &self.raster.grid;
        HeightField::new(
            [grid.width, grid.height],
            &self.raster.values,
            grid.transform,
        )
        .expect("a field")
    }

    fn run(&self, observers: &[Observer]) -> Viewsheds {
        let field = self.field();
        run(&self.job(&field, observers), &tree(), &()).expect("viewsheds")
    }

    fn job<'a>(&self, field: &'a HeightField<'a>, observers: &'a [Observer]) -> ViewshedJob<'a> {
        let limits = Limits {
            target: self.target,
            drop: self.drop,
            range: self.range,
        };
        ViewshedJob::new(field, observers, limits).expect("memory")
    }

    fn squared(&self, [c, r]: [f64; 2]) -> f64 {
        let [_, a, b, _, d, e] = self.raster.grid.transform;
        (a * c + b * r).powi(2) + (d * c + e * r).powi(2)
    }

    /// Compares all cells. Returns how many are visible, and how many lines nearly touch.
    fn check(&self, observers: &[Observer]) -> [usize; 2] {
        let (found, triangles) = (self.run(observers), Triangles::of(&self.raster));
        let width = self.raster.grid.width;
        let [mut visible, mut close] = [0; 2];
        for (index, observer) in observers.iter().enumerate() {
            let mut seen = vec![false; self.raster.values.len()];
            found.seen(index).for_each(|run| seen[run].fill(true));
            for (cell, &seen) in seen.iter().enumerate() {
                let [column, row] = [(cell % width) as f64, (cell / width) as f64];
                let [x, y] = observer.place;
                let (eye, to) = (
                    [x, y, observer.height],
                    [column, row, self.raster.values[cell] + self.target],
                );
                let apart = self.squared([column - x, row - y]);
                visible += usize::from(seen);
                if to[2].is_nan() || apart > self.range * self.range {
                    assert!(!seen);
                    continue;
                }
                let clearance =
                    triangles.clearance(eye, to, |apart| self.squared(apart), self.drop);
                if clearance.abs() < 1e-9 {
                    close += 1;
                    continue;
                }
                assert_eq!(
                    seen,
                    clearance > 0.0,
                    "{observer:?} to {column} {row}: {clearance}"
                );
            }
        }
        [visible, close]
    }

    /// Observers on the surface, so high above it.
    fn observer(&self, place: [f64; 2], eye: f64) -> Option<Observer> {
        let surface = self.field().surface(place)?;
        Some(Observer {
            place,
            height: surface + eye,
            normal: [0.0; 3],
        })
    }
}

const PLAIN: [f64; 6] = [0.0, 1.0, 0.0, 0.0, 0.0, -1.0];

#[test]
fn cells_agree_with_all_triangles() {
    let skewed = [600_000.0, 3.0, 1.0, 5_340_000.0, -0.5, -2.0];
    let [mut visible, mut close, mut all] = [0; 3];
    for seed in 0..12 {
        let mut random = Random(seed);
        let holes = [0.0, 0.1, 0.5][seed as usize % 3];
        let case = Case {
            raster: hills(
                [23, 17],
                if seed % 2 == 0 { PLAIN } else { skewed },
                holes,
                seed,
            ),
            target: if seed % 4 < 2 { 0.0 } else { 1.5 },
            drop: if seed % 5 == 0 { 0.01 } else { 0.0 },
            range: if seed % 6 == 5 { 20.0 } else { f64::INFINITY },
        };
        let mut observers = Vec::new();
        while observers.len() < 12 {
            let on_cells = observers.len() % 2 == 0;
            let at = |most: f64, number: f64| {
                if on_cells {
                    (most * number).round()
                } else {
                    (most * number * 1024.0).round() / 1024.0
                }
            };
            let place = [at(22.0, random.next()), at(16.0, random.next())];
            observers.extend(case.observer(place, 6.0 * random.next()));
        }
        // Beside the raster, on its edge, and above all.
        for (place, height) in [
            ([-4.5, 3.0], 30.0),
            ([30.0, 40.0], 60.0),
            ([11.0, -1.0], 40.0),
            ([22.0, 16.0], 45.0),
            ([0.0, 8.5], 50.0),
        ] {
            observers.push(Observer {
                place,
                height,
                normal: [0.0; 3],
            });
        }
        let counts = case.check(&observers);
        visible += counts[0];
        close += counts[1];
        all += observers.len() * 23 * 17;
    }
    assert!(
        visible * 10 > all && visible * 10 < 9 * all,
        "{visible} of {all} visible"
    );
    assert!(close * 1000 < all, "{close} of {all} close");
}

#[test]
fn cells_of_a_large_field_agree_with_double_precision() {
    let mut case = Case {
        raster: hills([101, 99], [0.0, 30.0, 0.0, 0.0, 0.0, -30.0], 0.0, 7),
        target: 0.0,
        drop: (1.0 - REFRACTION) / (2.0 * EARTH_RADIUS),
        range: f64::INFINITY,
    };
    let observers =
        [[50.0, 49.0], [13.25, 71.5]].map(|place| case.observer(place, 4.0).expect("a surface"));
    let [visible, close] = case.check(&observers);
    assert!(
        visible > 500 && close < 10,
        "{visible} visible, {close} close"
    );
    // The same from far above.
    case.target = 3.0;
    let above = case.observer([50.0, 49.0], 1000.0).expect("a surface");
    assert_eq!(case.run(&[above]).counts(), vec![1; 101 * 99]);
}

#[test]
fn the_horizon_of_a_sphere_is_where_it_should_be() {
    let (size, cell, eye) = (1001, 20.0, 2.0);
    for refraction in [0.0, REFRACTION] {
        let mut raster = hills([size, size], PLAIN, 0.0, 0);
        raster.values.fill(0.0);
        raster.grid.transform = [0.0, cell, 0.0, 0.0, 0.0, -cell];
        let case = Case {
            raster,
            target: 0.0,
            drop: (1.0 - refraction) / (2.0 * EARTH_RADIUS),
            range: f64::INFINITY,
        };
        let middle = (size / 2) as f64;
        let observer = case.observer([middle; 2], eye).expect("a surface");
        let counts = case.run(&[observer]).counts();
        // Tangent from a height h to a sphere whose radius refraction makes longer.
        let radius = EARTH_RADIUS / (1.0 - refraction);
        let horizon = (2.0 * radius * eye + eye * eye).sqrt();
        assert!(horizon < 0.5 * cell * size as f64 - 2.0 * cell);
        for (index, count) in counts.into_iter().enumerate() {
            let [x, y] = [
                (index % size) as f64 - middle,
                (index / size) as f64 - middle,
            ];
            let distance = cell * x.hypot(y);
            // Edges are chords between cells: 2 cells of doubt.
            if (distance - horizon).abs() > 2.0 * cell {
                assert_eq!(count == 1, distance < horizon, "{distance} of {horizon}");
            }
        }
    }
}

#[test]
fn lines_may_touch_a_plane() {
    let slope = |x: f64, y: f64| 0.37 * x - 1.3 * y + 5.1;
    let mut raster = hills([60, 50], PLAIN, 0.0, 0);
    for (cell, value) in raster.values.iter_mut().enumerate() {
        *value = slope((cell % 60) as f64, (cell / 60) as f64);
    }
    let case = Case::level(raster);
    let on = case.observer([17.3, 22.8], 0.0).expect("a surface");
    let below = Observer {
        height: on.height - 0.01,
        ..on
    };
    let found = case.run(&[on, below]);
    assert_eq!(found.seen(0).map(|run| run.len()).sum::<usize>(), 3000);
    assert_eq!(found.seen(1).count(), 0, "an eye below the surface");
}

#[test]
fn nothing_behind_a_normal_is_seen() {
    let case = Case::level(hills([30, 20], PLAIN, 0.0, 1));
    let free = case.observer([15.0, 10.0], 1000.0).expect("a surface");
    let facing = Observer {
        normal: [1.0, 0.0, 0.0],
        ..free
    };
    let counts = case.run(&[facing]).counts();
    for (cell, count) in counts.into_iter().enumerate() {
        assert_eq!(count == 1, cell % 30 > 15, "{cell}");
    }
    // A wall that is higher than the eye, but sinks below it on a round earth.
    let mut raster = hills([30, 20], PLAIN, 0.0, 0);
    for (cell, value) in raster.values.iter_mut().enumerate() {
        *value = if cell % 30 == 29 { 10.0 } else { 0.0 };
    }
    let mut case = Case::level(raster);
    let eye = case.observer([15.0, 10.0], 5.0).expect("a surface");
    let upwards = Observer {
        normal: [0.0, 0.0, 1.0],
        ..eye
    };
    for (drop, seen) in [(0.0, 20), (0.03, 0)] {
        case.drop = drop;
        assert_eq!(case.run(&[upwards]).counts().iter().sum::<u32>(), seen);
    }
}

#[test]
fn shares_and_threads_have_the_same_bits() {
    let case = Case::level(hills([80, 60], PLAIN, 0.05, 3));
    let observers: Vec<Observer> = (0..40)
        .filter_map(|i| case.observer([f64::from(i) * 1.9, f64::from(i) * 1.4], 3.0))
        .collect();
    let whole = case.run(&observers);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a pool");
    assert_eq!(pool.install(|| case.run(&observers)), whole);
    let field = case.field();
    let job = case.job(&field, &observers);
    assert_eq!(in_shares(&job, &tree(), 2), whole);
    // One by one, and as a matrix.
    let matrix = whole
        .matrix(&(0..4800).collect::<Vec<_>>())
        .expect("a matrix");
    for (index, observer) in observers.iter().enumerate() {
        let one = case.run(&[*observer]);
        assert_eq!(
            one.seen(0).collect::<Vec<_>>(),
            whole.seen(index).collect::<Vec<_>>()
        );
        let mut cells = one.seen(0).flatten();
        assert!(
            (0..4800).all(|cell| !matrix.get(cell, index) || cells.next() == Some(cell))
                && cells.next().is_none()
        );
    }
}

#[test]
fn shares_have_the_least_heights_and_angles_of_all_observers() {
    let mut case = Case::level(hills([50, 40], PLAIN, 0.05, 3));
    case.target = 1.5;
    // More than there are groups, so that some groups have several.
    let observers: Vec<Observer> = (0..40)
        .filter_map(|i| case.observer([f64::from(i) * 1.2, f64::from(i) * 0.9], 0.3))
        .collect();
    assert!(observers.len() > 32);
    let field = case.field();
    let job = TargetHeightJob(case.job(&field, &observers));
    let whole = job.heights(&()).expect("heights");
    let bits = |heights: &[f32]| heights.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&in_shares(&job, &tree(), 3)), bits(&whole));
    // Cells that nobody sees are those whose least height is above the target, and the others have the least of all angles.
    let sheds = case.run(&observers);
    let angles = case.job(&field, &observers).elevations(&sheds);
    let mut wanted = vec![f32::NAN; angles.len()];
    for (index, eye) in observers.iter().enumerate() {
        for cell in sheds.seen(index).flatten() {
            let [x, y] = [
                (cell % 50) as f64 - eye.place[0],
                eye.place[1] - (cell / 50) as f64,
            ];
            let up = case.raster.values[cell] + case.target - eye.height;
            wanted[cell] = wanted[cell].min(up.atan2(x.hypot(y)).to_degrees() as f32);
        }
    }
    let [mut seen, mut hidden] = [0; 2];
    for (cell, count) in sheds.counts().into_iter().enumerate() {
        let (angle, wanted) = (angles[cell], wanted[cell]);
        assert_eq!(angle.is_nan(), count == 0);
        assert!(
            count == 0 || (angle - wanted).abs() < 1e-5,
            "{angle}, not {wanted}"
        );
        if (whole[cell] - 1.5).abs() > 1e-6 {
            assert_eq!(whole[cell] < 1.5, count > 0, "{cell}: {}", whole[cell]);
            seen += usize::from(count > 0);
            hidden += usize::from(whole[cell] > 1.5);
        }
    }
    assert!(seen > 200 && hidden > 200, "{seen} seen, {hidden} hidden");
    let pairs: u64 = sheds.counts().into_iter().map(u64::from).sum();
    assert_eq!(sheds.count(), pairs);
}

#[test]
fn what_is_no_field_is_refused() {
    let heights = [0.0; 6];
    let error = HeightField::new([2, 2], &heights, PLAIN).expect_err("a length");
    assert!(matches!(error, Error::Length { found: 6, .. }));
    let error = HeightField::new([0, 5], &[], PLAIN).expect_err("a number of cells");
    assert!(matches!(error, Error::Range { found: 0.0, .. }));
    let flat = [0.0, 1.0, 2.0, 0.0, 2.0, 4.0];
    assert!(matches!(
        HeightField::new([3, 2], &heights, flat),
        Err(Error::Range { .. })
    ));
    // A row without neighbours has no surface, and hides nothing.
    let mut raster = hills([40, 9], PLAIN, 0.0, 0);
    for (cell, value) in raster.values.iter_mut().enumerate() {
        *value = [0.0, 0.0, 0.0, f64::NAN, 50.0, f64::NAN, 0.0, 0.0, 0.0][cell / 40];
    }
    let case = Case::level(raster);
    let observer = case.observer([20.0, 0.0], 1.0).expect("a surface");
    assert_eq!(case.run(&[observer]).counts().iter().sum::<u32>(), 7 * 40);
    // Neither has a raster of one row.
    let mut raster = hills([6, 1], PLAIN, 0.0, 0);
    raster.values = vec![0.0, 9.0, 0.0, 9.0, 0.0, 0.0];
    let observer = Observer {
        place: [0.0, 0.0],
        height: 1.0,
        normal: [0.0; 3],
    };
    assert_eq!(Case::level(raster).run(&[observer]).counts(), [1; 6]);
    for size in [[1, 6], [6, 1]] {
        let field = HeightField::new(size, &heights, PLAIN).expect("a field");
        assert_eq!(field.surface([0.0; 2]), None, "{size:?}");
    }
}

#[test]
fn shares_of_horizons_are_all_horizons() {
    let raster = hills([300, 200], [0.0, 2.0, 0.0, 0.0, 0.0, -2.0], 0.01, 3);
    let field = HeightField::new([300, 200], &raster.values, raster.grid.transform);
    let field = field.expect("a field");
    let directions = [
        Direction::Step([2, 1]),
        Direction::Azimuth(17.0),
        Direction::Azimuth(200.0),
    ];
    let job = FieldHorizonJob::new(&field, &directions, 0.0, 0.0).expect("a job");
    let bits = |angles: Vec<f32>| angles.into_iter().map(f32::to_bits).collect::<Vec<_>>();
    let whole = run(&job, &tree(), &()).expect("angles");
    assert_eq!(bits(in_shares(&job, &tree(), 2)), bits(whole));
}
