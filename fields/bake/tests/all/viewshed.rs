//! Viewsheds over a round earth: against the horizon of a sphere, and against lines of sight in double precision.

use antumbra::{Bvh, Geometry, Recipe};
use antumbra_bake::{
    Curvature, EARTH_RADIUS, Eyes, HeightField, Limits, Observer, Orientation, REFRACTION, Sensors,
    ViewshedJob, VisibilityJob, run,
};
use antumbra_raster::{Grid, Raster};

/// Cells without data are not used here.
struct Terrain {
    raster: Raster,
    cell: f64,
    curvature: Curvature,
}

impl Terrain {
    fn new(size: usize, cell: f64, refraction: f64, height: impl Fn(usize, usize) -> f64) -> Self {
        let half = 0.5 * cell * size as f64;
        let cells = (0..size * size).map(|index| height(index % size, index / size));
        Self {
            raster: Raster {
                grid: Grid::north_up([size, size], [-half, half], cell),
                values: cells.collect(),
                height_factor: None,
            },
            cell,
            curvature: Curvature::new(EARTH_RADIUS, refraction, [0.0; 3], Orientation::default())
                .expect("an earth"),
        }
    }

    /// The cells that each observer sees, in rows; observers are cells, `eye` above the surface.
    fn seen(&self, observers: &[usize], eye: f64, range: Option<f64>) -> Vec<Vec<bool>> {
        let mesh = self.raster.mesh([0.0; 3]);
        let bent: Vec<[f32; 3]> = mesh
            .positions
            .iter()
            .map(|&point| self.curvature.bend(point))
            .collect();
        let geometry = [Geometry::triangles(&bent[..], &mesh.indices[..])];
        let bvh = Bvh::build(&geometry, &Recipe::default()).expect("a tree");
        let list = |points: Vec<[f32; 3]>| Sensors {
            points,
            ..Sensors::default()
        };
        let up = [0.0, 0.0, 1.0];
        let places = list(bent.clone());
        let rows = Eyes::new(&places, &bvh, up, 0.0);
        let looking = list(observers.iter().map(|&cell| bent[cell]).collect());
        let columns = Eyes::new(&looking, &bvh, up, eye);
        let job = VisibilityJob {
            rows: &rows,
            columns: Some(&columns),
            margin: None,
            range: range.map(|range| (range, up)),
        };
        let matrix = run(&job, &bvh, &()).expect("a matrix");
        (0..observers.len())
            .map(|column| (0..bent.len()).map(|row| matrix.get(row, column)).collect())
            .collect()
    }

    /// Cells that each observer sees, swept as a height field.
    fn swept(&self, observers: &[usize], eye: f64) -> Vec<Vec<bool>> {
        let grid = &self.raster.grid;
        let size = [grid.width, grid.height];
        let field = HeightField::new(size, &self.raster.values, grid.transform).expect("a field");
        let observer = |&cell: &usize| Observer {
            place: [cell % grid.width, cell / grid.width].map(|at| at as f64),
            height: self.raster.values[cell] + eye,
            normal: [0.0; 3],
        };
        let observers: Vec<Observer> = observers.iter().map(observer).collect();
        let limits = Limits {
            drop: self.curvature.factor(),
            ..Limits::default()
        };
        let job = ViewshedJob::new(&field, &observers, limits).expect("memory");
        let bvh = Bvh::build(&[], &Recipe::default()).expect("a tree");
        let found = run(&job, &bvh, &()).expect("viewsheds");
        let cells = |observer: usize| {
            let mut cells = vec![false; self.raster.values.len()];
            found.seen(observer).for_each(|run| cells[run].fill(true));
            cells
        };
        (0..observers.len()).map(cells).collect()
    }

    /// Distance in plan between two cells.
    fn apart(&self, a: usize, b: usize) -> f64 {
        let width = self.raster.grid.width as i64;
        let [a, b] = [a as i64, b as i64];
        let [x, y] = [a % width - b % width, a / width - b / width];
        self.cell * ((x * x + y * y) as f64).sqrt()
    }

    /// Height of a cell, by the formula for this observer.
    fn height(&self, observer: usize, column: i64, row: i64) -> f64 {
        let width = self.raster.grid.width as i64;
        let cell = (row * width + column) as usize;
        let distance = self.apart(observer, cell);
        let factor = self.curvature.drop([1.0, 0.0, 0.0]);
        self.raster.values[cell] - factor * distance * distance
    }

    /// Smallest height of the line of sight above the surface, strictly between its ends: at all lines between cells and at all
    /// diagonals, between which both are straight.
    fn clearance(&self, observer: usize, target: usize, eye: f64) -> f64 {
        let width = self.raster.grid.width as i64;
        let place = |cell: usize| [cell as i64 % width, cell as i64 / width];
        let ([x0, y0], [x1, y1]) = (place(observer), place(target));
        let from = self.height(observer, x0, y0) + eye;
        let to = self.height(observer, x1, y1);
        let mut least = f64::INFINITY;
        let mut take = |t: f64, surface: f64| {
            if t > 1e-12 && t < 1.0 - 1e-12 {
                least = f64::min(least, from + t * (to - from) - surface);
            }
        };
        let mix = |part: f64, a: f64, b: f64| a + part * (b - a);
        let part = |x: f64| (x.floor() as i64, x - x.floor());
        let at = |x: i64, y: i64| self.height(observer, x, y);
        let last = width - 1;
        for x in x0.min(x1)..=x0.max(x1) {
            if x0 == x1 {
                break;
            }
            let t = (x - x0) as f64 / (x1 - x0) as f64;
            let (y, f) = part(y0 as f64 + t * (y1 - y0) as f64);
            take(t, mix(f, at(x, y), at(x, (y + 1).min(last))));
        }
        for y in y0.min(y1)..=y0.max(y1) {
            if y0 == y1 {
                break;
            }
            let t = (y - y0) as f64 / (y1 - y0) as f64;
            let (x, f) = part(x0 as f64 + t * (x1 - x0) as f64);
            take(t, mix(f, at(x, y), at((x + 1).min(last), y)));
        }
        // Diagonals run to the south east, so that x - y is the same along each.
        let (d0, d1) = (x0 - y0, x1 - y1);
        for d in d0.min(d1)..=d0.max(d1) {
            if d0 == d1 {
                break;
            }
            let t = (d - d0) as f64 / (d1 - d0) as f64;
            let (x, f) = part(x0 as f64 + t * (x1 - x0) as f64);
            let y = x - d;
            if (0..width).contains(&y) {
                take(
                    t,
                    mix(f, at(x, y), at((x + 1).min(last), (y + 1).min(last))),
                );
            }
        }
        least
    }
}

#[test]
fn the_horizon_of_a_sphere_is_where_it_should_be() {
    let (size, cell, eye) = (401, 50.0, 2.0);
    for refraction in [0.0, REFRACTION] {
        let sea = Terrain::new(size, cell, refraction, |_, _| 0.0);
        let middle = size * size / 2;
        let seen = &sea.seen(&[middle], eye, None)[0];
        // Tangent from a height h to a sphere whose radius refraction makes longer.
        let radius = EARTH_RADIUS / (1.0 - refraction);
        let horizon = (2.0 * radius * eye + eye * eye).sqrt();
        assert!(horizon < 0.5 * cell * (size as f64 - 4.0));
        for (target, &seen) in seen.iter().enumerate() {
            let distance = sea.apart(middle, target);
            if (distance - horizon).abs() > 2.0 * cell {
                assert_eq!(seen, distance < horizon, "{distance} of {horizon}");
            }
        }
    }
}

/// Pseudorandom hills.
fn hills(size: usize) -> Terrain {
    let noise = |x: usize, y: usize| {
        let mut state = (x as u64 * 0x9E37_79B9 + y as u64 * 0x85EB_CA6B + 1)
            .wrapping_mul(0x2545_F491_4F6C_DD1D);
        state ^= state >> 29;
        (state.wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 40) as f64 / (1 << 24) as f64
    };
    Terrain::new(size, 30.0, REFRACTION, |x, y| {
        let wave = (x as f64 / 9.0).sin() * (y as f64 / 13.0).cos();
        300.0 + 30.0 * wave + 10.0 * noise(x, y)
    })
}

#[test]
fn ten_thousand_cells_agree_with_double_precision() {
    let (hills, eye) = (hills(100), 1.7);
    let observers = [2525, 5050, 7710, 0, 9999];
    let found = hills.seen(&observers, eye, None);
    let (mut visible, mut close) = (0, 0);
    for (&observer, seen) in observers.iter().zip(&found) {
        for (target, &seen) in seen.iter().enumerate() {
            let clearance = match target == observer {
                true => f64::INFINITY,
                false => hills.clearance(observer, target, eye),
            };
            visible += usize::from(seen);
            // Coordinates have steps of 1e-4 in single precision.
            if clearance.abs() < 5e-4 {
                close += 1;
                continue;
            }
            let cell = [target % 100, target / 100];
            assert_eq!(seen, clearance > 0.0, "{observer} to {cell:?}: {clearance}");
        }
    }
    assert!(
        visible > 1000 && close < 20,
        "{visible} visible, {close} close"
    );
}

#[test]
fn height_fields_agree_with_double_precision() {
    let (hills, eye) = (hills(300), 5.0);
    let observers = [150 * 301, 10 * 300 + 280];
    let (mut visible, mut close) = (0, 0);
    for (&observer, seen) in observers.iter().zip(hills.swept(&observers, eye)) {
        for (target, seen) in seen.into_iter().enumerate() {
            let clearance = match target == observer {
                true => f64::INFINITY,
                false => hills.clearance(observer, target, eye),
            };
            visible += usize::from(seen);
            if clearance.abs() < 1e-9 {
                close += 1;
                continue;
            }
            assert_eq!(seen, clearance > 0.0, "{observer} to {target}: {clearance}");
        }
    }
    assert!(
        visible > 1000 && close < 5,
        "{visible} visible, {close} close"
    );
}

#[test]
fn a_radius_leaves_out_what_is_farther() {
    let hills = hills(100);
    let all = &hills.seen(&[5050], 1.7, None)[0];
    let near = &hills.seen(&[5050], 1.7, Some(600.0))[0];
    for target in 0..all.len() {
        let is_near = hills.apart(5050, target) <= 600.0;
        assert_eq!(near[target], all[target] && is_near);
    }
}
