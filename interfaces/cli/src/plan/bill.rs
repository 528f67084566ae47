//! What a plan takes: measured on a part of its own raster, before anything is run.

use std::time::Instant;

use antumbra_bake::{Direction, Error, FieldHorizonJob, HeightField};
use antumbra_load::MemorySize;
use antumbra_terrain::{Tile, Tiles};
use antumbra_tiles::Indexed;

use super::run::PART;
use crate::args::start_threads;
use crate::bake::tile::TileWork;
use crate::bake::{BakeCommand, run_tile};
use crate::exit::{Failure, Loudness, quietly};

/// Cells on a side of the part that is measured.
const SAMPLE: usize = 512;

/// Bytes of a program that has read nothing.
const PROGRAM: u64 = 40 << 20;

/// Bytes of heights and of what is made of them, for each cell of a tile.
const CELL: u64 = 96;

/// Seconds of one core for a cell; `None` where the files of the raster are not here.
pub struct Rates {
    sweep: Option<f64>,
    tile: Option<f64>,
    planes: usize,
}

/// Measures a command on the middle of a raster. `line` has its output.
pub fn rates(
    bake: &BakeCommand,
    raster: &Indexed,
    directions: &[Direction],
    memory: MemorySize,
) -> Result<Rates, Failure> {
    let none = Rates {
        sweep: None,
        tile: None,
        planes: directions.len(),
    };
    let index = raster.index();
    if index.files.iter().any(|file| !file.path.is_file()) {
        return Ok(none);
    }
    start_threads(None)?;
    let threads = rayon::current_num_threads() as f64;
    // The middle of the file in the middle, which has data.
    let middle = &index.files[index.files.len() / 2];
    let size = middle.size.map(|cells| cells.min(SAMPLE));
    let at = [0, 1].map(|axis| (middle.at[axis] + (middle.size[axis] - size[axis]) / 2) as i64);
    let sample = Tile { at, size };
    let cells = (size[0] * size[1]) as f64;
    let step = |direction: &&Direction| matches!(direction, Direction::Step(_));
    let steps = directions.iter().filter(step).count();
    if steps == 0 {
        let work = TileWork::new(raster, sample, (None, &[]));
        let start = Instant::now();
        quietly(Loudness::Quiet, || run_tile(bake.args().0, memory, &work))?;
        let seconds = start.elapsed().as_secs_f64() * threads;
        return Ok(Rates {
            tile: Some(seconds / cells),
            ..none
        });
    }
    let heights = raster.read(sample)?;
    let field = HeightField::new(size, &heights, index.transform_at(at)).map_err(Error::from)?;
    let job = FieldHorizonJob::new(&field, directions, 0.0, 0.0)?;
    let time = |wanted: bool| {
        let find = |direction: &Direction| matches!(direction, Direction::Step(_)) == wanted;
        let Some(index) = directions.iter().position(find) else {
            return Ok(0.0);
        };
        let start = Instant::now();
        job.plane(index, &())?;
        Ok::<f64, Error>(start.elapsed().as_secs_f64() * threads / cells)
    };
    // Once more, since the first one meets cold caches.
    let (_, sweep, azimuth) = (time(true)?, time(true)?, time(false)?);
    let tile = (directions.len() - steps) as f64 * azimuth + directions.len() as f64 * WRITTEN;
    Ok(Rates {
        sweep: Some(sweep + WRITTEN),
        tile: Some(tile),
        ..none
    })
}

/// Seconds to write and to read a number, about.
const WRITTEN: f64 = 2e-8;

impl Rates {
    /// Seconds of a sweep.
    pub fn sweep(&self, tile: &Tile, steps: usize) -> Option<f64> {
        self.sweep
            .map(|rate| rate * (tile.size[0] * tile.size[1] * steps) as f64)
    }

    /// Seconds of a tile.
    pub fn tile(&self, tile: &Tile) -> Option<f64> {
        self.tile
            .map(|rate| rate * (tile.size[0] * tile.size[1]) as f64)
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
