//! Heights from which cells are seen, and angles of sight, against all edges in double precision.

use std::collections::HashSet;
use std::sync::atomic::{AtomicUsize, Ordering};

use antumbra_terrain::{Error, HeightField, Limits, Monitor, Observer, Viewer};
use antumbra_testkit::Rng;

const PLAIN: [f64; 6] = [0.0, 1.0, 0.0, 0.0, 0.0, -1.0];
const OBLONG: [f64; 6] = [600_000.0, 9.0, 0.0, 5_340_000.0, 0.0, -2.0];
const TURNED: [f64; 6] = [600_000.0, 3.0, 1.0, 5_340_000.0, -0.5, -2.0];

/// Hills with noise, walls and perhaps holes.
fn hills([width, height]: [usize; 2], holes: f64, seed: u64) -> Vec<f64> {
    let mut rng = Rng::new(seed);
    let cells = (0..width * height).map(|cell| {
        let [x, y] = [(cell % width) as f64, (cell / width) as f64];
        let wave = 9.0 * (x / 17.0).sin() * (y / 13.0).cos() + 3.0 * f64::from(rng.unit());
        let wall = if rng.unit() < 0.02 { 12.0 } else { 0.0 };
        match f64::from(rng.unit()) < holes {
            true => f64::NAN,
            false => wave + wall,
        }
    });
    cells.collect()
}

/// Edges of all triangles, as columns and rows.
fn edges([width, height]: [usize; 2], heights: &[f64]) -> HashSet<[[usize; 2]; 2]> {
    let has = |[column, row]: [usize; 2]| heights[row * width + column].is_finite();
    let mut edges = HashSet::new();
    for (c, r) in (1..height).flat_map(|r| (1..width).map(move |c| (c - 1, r - 1))) {
        let [a, b, d, e] = [[c, r], [c + 1, r], [c, r + 1], [c + 1, r + 1]];
        for corners in [[a, b, e], [a, d, e], [a, b, d], [b, d, e]] {
            let is_cut = has(a) && has(e);
            let is_triangle = corners.into_iter().all(has);
            if is_triangle && (corners.contains(&a) && corners.contains(&e) || !is_cut) {
                for [i, k] in [[0, 1], [1, 2], [0, 2]] {
                    edges.insert([corners[i], corners[k]]);
                }
            }
        }
    }
    edges
}

/// A surface, observers, and what counts as seen.
struct Case {
    size: [usize; 2],
    transform: [f64; 6],
    heights: Vec<f64>,
    limits: Limits,
}

impl Case {
    fn of(seed: u64, size: [usize; 2]) -> Self {
        let [holes, drop, range] = [
            [0.0, 0.05, 0.4][seed as usize % 3],
            [0.0, 4e-3][seed as usize % 2],
            [f64::INFINITY, f64::INFINITY, 40.0][seed as usize / 2 % 3],
        ];
        Self {
            size,
            transform: [PLAIN, OBLONG, TURNED, TURNED][seed as usize % 4],
            heights: hills(size, holes, seed),
            limits: Limits {
                target: 0.0,
                drop,
                range,
            },
        }
    }

    fn field(&self) -> HeightField<'_> {
        HeightField::new(self.size, &self.heights, self.transform).expect("a field")
    }

    /// Observers over cells, between them and beside the field.
    fn observers(&self, count: usize, rng: &mut Rng) -> Vec<Observer> {
        let field = self.field();
        let mut observers = Vec::new();
        while observers.len() < count {
            let beside = if rng.unit() < 0.2 { 1.4 } else { 1.0 };
            let on_cell = rng.unit() < 0.5;
            let place = self.size.map(|size| {
                let most = (size - 1) as f64;
                let at = 0.5 * most + beside * most * (f64::from(rng.unit()) - 0.5);
                if on_cell { at.round() } else { at }
            });
            let surface = field.surface(place).unwrap_or(12.0);
            observers.push(Observer {
                place,
                height: surface + 0.05 + 8.0 * f64::from(rng.unit()).powi(2),
                normal: [0.0; 3],
            });
        }
        observers
    }

    /// Way to the east and to the north, and squared length.
    fn way(&self, eye: &Observer, [column, row]: [f64; 2]) -> ([f64; 2], f64) {
        let [_, a, b, _, d, e] = self.transform;
        let [c, r] = [column - eye.place[0], row - eye.place[1]];
        let [east, north] = [a * c + b * r, d * c + e * r];
        ([east, north], east * east + north * north)
    }

    /// Height of the surface at a cell under the level of an eye on a round earth.
    fn sunk(&self, eye: &Observer, [column, row]: [usize; 2]) -> f64 {
        let (_, squared) = self.way(eye, [column as f64, row as f64]);
        self.heights[row * self.size[0] + column] - self.limits.drop * squared
    }

    /// Least height above a cell at which no edge is above the line to it.
    fn brute_force(&self, edges: &HashSet<[[usize; 2]; 2]>, eye: &Observer, cell: usize) -> f64 {
        let to = [cell % self.size[0], cell / self.size[0]];
        let (_, squared) = self.way(eye, to.map(|at| at as f64));
        if !self.heights[cell].is_finite() {
            return f64::NAN;
        }
        if squared.sqrt() > self.limits.range {
            return f64::INFINITY;
        }
        let apart = |at: [usize; 2]| [0, 1].map(|axis| at[axis] as f64 - eye.place[axis]);
        let cross = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
        let (along, low) = (apart(to), self.sunk(eye, to));
        let mut least = 0.0_f64;
        for &[a, b] in edges {
            let (from, end) = (apart(a), apart(b));
            let edge = [end[0] - from[0], end[1] - from[1]];
            let area = cross(along, edge);
            let [t, part] = [cross(from, edge) / area, cross(from, along) / area];
            if area != 0.0 && t > 1e-9 && t < 1.0 - 1e-9 && (-1e-12..=1.0 + 1e-12).contains(&part) {
                let [from, end] = [self.sunk(eye, a), self.sunk(eye, b)];
                let surface = from + part * (end - from);
                least = least.max(eye.height + (surface - eye.height) / t - low);
            }
        }
        least
    }
}

/// Whether numbers are the same to rounding of single precision, and of slopes.
fn is_near(found: f64, wanted: f64) -> bool {
    found.to_bits() == wanted.to_bits() || (found - wanted).abs() < 1.2e-7 * wanted.abs() + 1e-8
}

#[test]
fn heights_are_those_of_all_edges() {
    let [mut hidden, mut all] = [0; 2];
    for seed in 0..12 {
        let case = Case::of(seed, [27, 22]);
        let (field, edges) = (case.field(), edges(case.size, &case.heights));
        let viewer = Viewer::new(&field).expect("memory");
        for eye in case.observers(8, &mut Rng::new(seed)) {
            let found = viewer.target_heights(&[eye], &case.limits, &());
            for (cell, &height) in found.expect("heights").iter().enumerate() {
                let wanted = match field.buries(&eye) {
                    true => case.heights[cell] + f64::INFINITY,
                    false => case.brute_force(&edges, &eye, cell),
                };
                assert!(
                    is_near(f64::from(height), wanted) || height.is_nan() && wanted.is_nan(),
                    "seed {seed}, {eye:?} to {cell}: {height}, not {wanted}"
                );
                hidden += usize::from(height > 0.0);
                all += 1;
            }
        }
    }
    assert!(
        hidden * 5 > all && hidden * 5 < 4 * all,
        "{hidden} of {all} are hidden"
    );
}

#[test]
fn targets_are_seen_above_their_heights() {
    let mut is_seen = [0; 2];
    for seed in 0..24 {
        let mut rng = Rng::new(seed);
        let case = Case::of(seed, [150, 130]);
        let field = case.field();
        let viewer = Viewer::new(&field).expect("memory");
        for (index, mut eye) in case.observers(4, &mut rng).into_iter().enumerate() {
            if index % 2 == 1 {
                let [x, y] = [0, 1].map(|_| 2.0 * f64::from(rng.unit()) - 1.0);
                eye.normal = [x, y, f64::from(rng.unit())];
            }
            let heights = viewer
                .target_heights(&[eye], &case.limits, &())
                .expect("heights");
            for target in [0.0, 0.01, 12.0 * f64::from(rng.unit()), 60.0] {
                let limits = Limits {
                    target,
                    ..case.limits
                };
                let seen = viewer.sees(&eye, &limits).expect("bits");
                for (cell, &height) in heights.iter().enumerate() {
                    let (height, seen) =
                        (f64::from(height), seen[cell / 64] >> (cell % 64) & 1 == 1);
                    let is_close = height.is_finite() && is_near(height, target);
                    assert!(
                        seen == (height <= target) || is_close && (target > 0.0 || index % 2 == 1),
                        "seed {seed}, {eye:?} to {cell}: {height}, target {target}"
                    );
                    is_seen[usize::from(seen)] += 1;
                }
            }
        }
    }
    assert!(
        is_seen.iter().all(|&number| number > 100_000),
        "{is_seen:?}"
    );
}

#[test]
fn many_observers_have_the_least_of_their_heights() {
    for seed in 0..6 {
        let case = Case::of(seed, [60, 45]);
        let field = case.field();
        let viewer = Viewer::new(&field).expect("memory");
        let mut observers = case.observers(9, &mut Rng::new(seed));
        let heights = |observers: &[Observer]| {
            let found = viewer.target_heights(observers, &case.limits, &());
            found.expect("heights")
        };
        let mut wanted = heights(&[]);
        assert!(
            wanted
                .iter()
                .zip(&case.heights)
                .all(|(found, height)| match height.is_nan() {
                    true => found.is_nan(),
                    false => *found == f32::INFINITY,
                })
        );
        for one in &observers {
            let pairs = wanted.iter_mut().zip(heights(&[*one]));
            pairs.for_each(|(least, height)| *least = least.min(height));
        }
        let bits = |heights: Vec<f32>| heights.into_iter().map(f32::to_bits).collect::<Vec<_>>();
        let wanted = bits(wanted);
        assert_eq!(bits(heights(&observers)), wanted);
        observers.reverse();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let alone = pool.expect("a pool").install(|| heights(&observers));
        assert_eq!(bits(alone), wanted);
    }
}

#[test]
fn a_wall_hides_what_is_below_the_line_over_it() {
    // 40 columns 5 m wide on level ground. The wall is 3 m high, and 50 m away from an eye at 2 m.
    let row: Vec<f64> = (0..40)
        .map(|column| if column == 15 { 3.0 } else { 0.0 })
        .collect();
    let heights = row.repeat(9);
    let field =
        HeightField::new([40, 9], &heights, [0.0, 5.0, 0.0, 0.0, 0.0, -5.0]).expect("a field");
    let viewer = Viewer::new(&field).expect("memory");
    let eye = Observer {
        place: [5.0, 4.0],
        height: 2.0,
        normal: [0.0; 3],
    };
    for (drop, range) in [(0.0, f64::INFINITY), (1e-3, 100.0)] {
        let limits = Limits {
            target: 1.0,
            drop,
            range,
        };
        let found = viewer
            .target_heights(&[eye], &limits, &())
            .expect("heights");
        for column in 0..40 {
            let apart = 5.0 * (column as f64 - 5.0);
            let line = 2.0 + apart * (1.0 - drop * 2500.0) / 50.0 + drop * apart * apart;
            let wanted = match column {
                _ if apart.abs() > range => f64::INFINITY,
                16.. => line.max(0.0),
                _ => 0.0,
            };
            let height = f64::from(found[4 * 40 + column]);
            assert!(is_near(height, wanted), "{column}: {height}, not {wanted}");
            // The angle is that of the target.
            let up = heights[column] + 1.0 - drop * apart * apart - 2.0;
            let angle = f64::from(viewer.elevation(&eye, &limits, 4 * 40 + column));
            let wanted = up.atan2(apart.abs()).to_degrees();
            assert!(
                (angle - wanted).abs() < 1e-5,
                "{column}: {angle}, not {wanted}"
            );
        }
    }
    // 15 m to the east and 20 m to the south, 1 m below the eye.
    let limits = Limits::default();
    let angle = viewer.elevation(&Observer { height: 1.0, ..eye }, &limits, 8 * 40 + 8);
    assert!(
        (angle - (-1.0_f32 / 25.0).atan().to_degrees()).abs() < 1e-5,
        "{angle}"
    );
    assert!(
        viewer
            .elevation(&Observer { height: 0.0, ..eye }, &limits, 4 * 40 + 5)
            .is_nan()
    );
}

#[test]
fn work_ends_when_it_is_cancelled() {
    /// Cancels after so many reports.
    struct After(AtomicUsize);
    impl Monitor for After {
        fn progress(&self, done: usize, total: usize) {
            assert!(done > 0 && done <= total);
            let _ = self
                .0
                .fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| {
                    left.checked_sub(1)
                });
        }
        fn cancelled(&self) -> bool {
            self.0.load(Ordering::Relaxed) == 0
        }
    }
    let case = Case::of(0, [40, 30]);
    let field = case.field();
    let viewer = Viewer::new(&field).expect("memory");
    let observers = case.observers(20, &mut Rng::new(1));
    let found = |after: usize| {
        let monitor = After(AtomicUsize::new(after));
        viewer.target_heights(&observers, &case.limits, &monitor)
    };
    assert_eq!(found(5), Err(Error::Cancelled));
    assert!(found(1 << 20).is_ok());
}
