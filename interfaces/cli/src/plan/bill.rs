//! What a plan takes: measured on a part of its own raster, before anything is run.

use antumbra_bake::{Direction, Error, FieldHorizonJob, HeightField};
use antumbra_lab::thread_seconds;
use antumbra_load::MemorySize;
use antumbra_terrain::{Tile, Tiles};
use antumbra_tiles::Indexed;

use super::run::PART;
use crate::bake::tile::TileWork;
use crate::bake::{BakeCommand, run_tile};
use crate::exit::{Failure, Loudness, quietly};

/// Cells on a side of the squares that are measured, and seconds that the larger ones may take.
const SMALL: usize = 96;
const SAMPLE: usize = 512;
const LONG: f64 = 3.0;

/// Seconds to write and to read a number, about.
const WRITTEN: f64 = 2e-8;

/// Bytes of a program that has read nothing.
const PROGRAM: u64 = 40 << 20;

/// Bytes of heights and of what is made of them, for each cell of a tile.
const CELL: u64 = 96;

/// Seconds of one core for each cell; `None` where files of the raster are not here.
pub struct Rates {
    sweep: Option<f64>,
    /// For each cell of a tile, and for each one along its border.
    tile: Option<[f64; 2]>,
    planes: usize,
}

impl Rates {
    /// Measures a command on the middle of a raster.
    pub fn measure(
        bake: &BakeCommand,
        raster: &Indexed,
        directions: &[Direction],
        memory: MemorySize,
    ) -> Result<Self, Failure> {
        let mut rates = Self {
            sweep: None,
            tile: None,
            planes: directions.len(),
        };
        if raster.index().files.iter().any(|file| !file.path.is_file()) {
            return Ok(rates);
        }
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        one.map_err(Failure::work)?
            .install(|| {
                let is_step = |direction: &Direction| matches!(direction, Direction::Step(_));
                let swept = directions
                    .iter()
                    .filter(|direction| is_step(direction))
                    .count();
                if swept == 0 {
                    rates.tile = Some(of_tile(bake, raster, memory)?);
                    return Ok(());
                }
                let (sweep, azimuth) = of_directions(raster, directions)?;
                rates.sweep = Some(sweep + WRITTEN);
                let pulled = (directions.len() - swept) as f64 * azimuth;
                rates.tile = Some([pulled + directions.len() as f64 * WRITTEN, 0.0]);
                Ok(())
            })
            .map(|()| rates)
    }

    /// Seconds of a sweep.
    pub fn sweep(&self, tile: &Tile, steps: usize) -> Option<f64> {
        self.sweep
            .map(|rate| rate * (tile.size[0] * tile.size[1] * steps) as f64)
    }

    /// Seconds of a tile, which is computed part by part.
    pub fn tile(&self, tile: &Tile) -> Option<f64> {
        let [columns, rows] = tile.size.map(|cells| cells as f64);
        let [across, down] = tile.size.map(|cells| cells.div_ceil(PART) as f64);
        let border = 2.0 * (columns * down + rows * across);
        self.tile
            .map(|[cell, along]| cell * columns * rows + along * border)
    }

    /// Most bytes of memory of a tile.
    pub fn memory_of_tile(&self, tile: &Tile) -> u64 {
        let [columns, rows] = tile.size.map(|cells| cells as u64);
        // Larger tiles are computed part by part.
        let part = (PART as u64).min(columns) * (PART as u64).min(rows);
        let cells = if self.planes == 0 {
            part
        } else {
            columns * rows
        };
        PROGRAM + CELL * cells + 8 * columns * rows
    }
}

/// Places that are measured.
const PLACES: usize = 3;

/// A square in one of some files that are far from each other, each time elsewhere in the file.
fn sample(raster: &Indexed, side: usize, place: usize) -> Tile {
    let files = &raster.index().files;
    let file = &files[(2 * place + 1) * files.len() / (2 * PLACES)];
    let size = file.size.map(|cells| cells.min(side));
    let first =
        |axis: usize| file.at[axis] + (place + 1) * (file.size[axis] - size[axis]) / (PLACES + 1);
    Tile {
        at: [0, 1].map(|axis| first(axis) as i64),
        size,
    }
}

/// Seconds for each cell, and for each one along the border, by squares of two sizes.
fn of_tile(bake: &BakeCommand, raster: &Indexed, memory: MemorySize) -> Result<[f64; 2], Failure> {
    // Seconds, cells and cells along borders of all places.
    let measure = |side: usize| {
        let mut sum = [0.0; 3];
        for place in 0..PLACES {
            let tile = sample(raster, side, place);
            let work = TileWork::new(raster, tile, (None, &[]));
            let start = thread_seconds();
            quietly(Loudness::Quiet, || run_tile(bake.args().0, memory, &work))?;
            let [columns, rows] = tile.size.map(|cells| cells as f64);
            let found = [
                thread_seconds() - start,
                columns * rows,
                2.0 * (columns + rows),
            ];
            sum = [0, 1, 2].map(|at| sum[at] + found[at]);
        }
        Ok::<[f64; 3], Failure>(sum)
    };
    // What is only read once is read before.
    measure(SMALL)?;
    let [first, cells, border] = measure(SMALL)?;
    let side = SMALL as f64 * (LONG / first.max(1e-6)).sqrt();
    let [second, more, longer] = measure(side.clamp(2.0 * SMALL as f64, SAMPLE as f64) as usize)?;
    let area = cells * longer - more * border;
    // Of files that are no larger than the small square there is one measure only.
    if area.abs() < 1.0 {
        return Ok([second / more, 0.0]);
    }
    let cell = (first * longer - second * border) / area;
    let cell = cell.clamp(0.0, second / more);
    Ok([cell, ((second - cell * more) / longer).max(0.0)])
}

/// Seconds for each cell of a sweep, and of an azimuth that is pulled.
fn of_directions(raster: &Indexed, directions: &[Direction]) -> Result<(f64, f64), Failure> {
    let tile = sample(raster, SAMPLE, PLACES / 2);
    let heights = raster.read(tile)?;
    let transform = raster.index().transform_at(tile.at);
    let field = HeightField::new(tile.size, &heights, transform).map_err(Error::from)?;
    let job = FieldHorizonJob::new(&field, directions, 0.0, 0.0)?;
    let measure = |is_step: bool| {
        let find = |direction: &Direction| matches!(direction, Direction::Step(_)) == is_step;
        let Some(index) = directions.iter().position(find) else {
            return Ok(0.0);
        };
        let start = thread_seconds();
        job.plane(index, &())?;
        Ok::<f64, Error>((thread_seconds() - start) / heights.len() as f64)
    };
    // The first one finds caches cold.
    measure(true)?;
    Ok((measure(true)?, measure(false)?))
}

/// Most bytes of memory of a sweep.
pub fn memory_of_sweep(tile: &Tile, steps: usize) -> u64 {
    let [columns, rows] = tile.size.map(|cells| cells as u64);
    PROGRAM + (8 + 4 + 4 * steps as u64) * columns * rows
}

/// A time for people.
pub fn time(seconds: f64) -> String {
    match seconds {
        ..90.0 => format!("{seconds:.0} s"),
        ..5400.0 => format!("{:.0} minutes", seconds / 60.0),
        _ => format!("{:.1} hours", seconds / 3600.0),
    }
}
