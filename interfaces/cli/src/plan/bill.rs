//! What a plan takes: measured on a part of its own raster, before anything is run.

use std::path::{Path, PathBuf};

use antumbra_lab::thread_seconds;
use antumbra_load::MemorySize;
use antumbra_terrain::Tile;
use antumbra_tiles::Indexed;

use super::checksum;
use super::make::parse;
use super::run::PART;
use crate::args::Command;
use crate::bake::run_tile;
use crate::bake::tile::{self, MOST_KEPT, TileWork, Tiling};
use crate::exit::{Failure, Loudness, quietly};
use crate::output::text;

/// Cells on a side of the squares that are measured, and seconds that the larger ones may take.
const SMALL: usize = 160;
const SAMPLE: usize = 512;
const LONG: f64 = 6.0;

/// Bytes of a program that has read nothing.
const PROGRAM: u64 = 40 << 20;

/// Bytes of heights and of what is made of them, for each cell of a tile.
const CELL: u64 = 96;

/// Most bytes of what tiles around hide, as `antumbra_terrain::Pull` says.
const AROUND: u64 = 24 * (12 << 20);

/// Bytes of a cell between an observer and a tile.
const BETWEEN: u64 = 24;

/// What a part of the work takes.
pub struct Rates {
    /// Seconds of one core for a task; `None` where files of the raster are not here.
    seconds: Option<Seconds>,
    /// Cells of the raster.
    whole: Tile,
    planes: usize,
    eyes: Vec<Tile>,
}

/// Seconds of one core for each cell, and for each one along the border.
#[derive(Clone, Copy, Default)]
struct Seconds {
    /// Of a sweep, for each of its steps.
    sweep: [f64; 2],
    /// Of a tile; with observers, for each cell up to one of them.
    tile: [f64; 2],
}

impl Rates {
    /// Measures the command of a line on some parts of a raster.
    pub fn measure(
        line: &[String],
        raster: &Indexed,
        tiling: &Tiling,
        memory: MemorySize,
    ) -> Result<Self, Failure> {
        let mut rates = Self {
            seconds: None,
            whole: raster.index().whole(),
            planes: tiling.directions.len(),
            eyes: tiling.eyes.clone(),
        };
        if raster.index().files.iter().any(|file| !file.path.is_file()) {
            return Ok(rates);
        }
        let folder = tempfile::tempdir().map_err(Failure::work)?;
        let sample = Sample {
            line,
            raster,
            memory,
            quarters: &tile::quarters(&tiling.directions),
            folder: folder.path(),
        };
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let seconds = one
            .map_err(Failure::work)?
            .install(|| match rates.eyes.is_empty() {
                true => sample.squares(),
                false => sample.viewsheds(|tile| rates.between(tile)),
            });
        rates.seconds = Some(seconds?);
        Ok(rates)
    }

    /// Seconds of a sweep.
    pub fn sweep(&self, tile: &Tile, steps: usize) -> Option<f64> {
        let [columns, rows] = tile.size.map(|cells| cells as f64);
        let [cell, along] = self.seconds?.sweep;
        Some((cell * columns * rows + along * 2.0 * (columns + rows)) * steps as f64)
    }

    /// Cells between observers and a tile, all together.
    fn between(&self, tile: &Tile) -> f64 {
        let hulls = self.eyes.iter().map(|eye| tile.hull(eye).size);
        hulls.map(|[columns, rows]| (columns * rows) as f64).sum()
    }

    /// Seconds of a tile, which is computed part by part if there are no observers.
    pub fn tile(&self, tile: &Tile) -> Option<f64> {
        let [cell, along] = self.seconds?.tile;
        if !self.eyes.is_empty() {
            return Some(cell * self.between(tile));
        }
        let [columns, rows] = tile.size.map(|cells| cells as f64);
        let [across, down] = tile.size.map(|cells| cells.div_ceil(PART) as f64);
        let border = 2.0 * (columns * down + rows * across);
        Some(cell * columns * rows + along * border)
    }

    /// Most bytes of memory of a tile, about.
    pub fn memory_of_tile(&self, tile: &Tile) -> u64 {
        let cells = |tile: &Tile| tile.size[0] as u64 * tile.size[1] as u64;
        let whole = cells(&self.whole);
        // Larger tiles are computed part by part, but for planes and viewsheds.
        let part = match self.planes + self.eyes.len() {
            0 => tile
                .size
                .map(|cells| cells.min(PART) as u64)
                .iter()
                .product(),
            _ => cells(tile),
        };
        let between = self.eyes.iter().map(|eye| BETWEEN * cells(&tile.hull(eye)));
        let around = match between.max() {
            Some(between) => between,
            None => AROUND.min(24 * whole),
        };
        let kept = MOST_KEPT.min(8 * whole);
        PROGRAM + kept + around + CELL * part + 8 * cells(tile)
    }
}

/// Places that are measured.
const PLACES: usize = 6;

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

/// A command that is measured on squares of its raster.
struct Sample<'a> {
    line: &'a [String],
    raster: &'a Indexed,
    memory: MemorySize,
    quarters: &'a [(usize, Vec<[i32; 2]>)],
    /// A folder for its files.
    folder: &'a Path,
}

impl Sample<'_> {
    /// Seconds of the sweeps of a square, and of what follows.
    fn seconds(&self, tile: Tile) -> Result<[f64; 2], Failure> {
        let output = text(&self.folder.join("tile.tif"));
        let Command::Bake(bake) = parse(self.line.to_vec(), &["-o", &output])? else {
            return Ok([0.0; 2]);
        };
        // With the checksums of its result, and of the sweeps whose angles it needs.
        let time = |work: &TileWork<'_>, files: &[&Path]| {
            let start = thread_seconds();
            quietly(Loudness::Quiet, || {
                run_tile(bake.args().0, self.memory, work)
            })?;
            for file in files {
                checksum(file)?;
            }
            Ok::<f64, Failure>(thread_seconds() - start)
        };
        let sweeps = (0..4).map(|quarter| self.folder.join(format!("{quarter}.sweep")));
        let sweeps: Vec<PathBuf> = sweeps.collect();
        let mut swept = 0.0;
        for (quarter, _) in self.quarters {
            let part = Some((*quarter, &*sweeps[*quarter]));
            let mut work = TileWork::new(self.raster, tile, (part, &[]));
            work.is_sample = true;
            swept += time(&work, &[&*sweeps[*quarter]])?;
        }
        let work = TileWork::new(self.raster, tile, (None, &sweeps));
        let files = self.quarters.iter().map(|(quarter, _)| &*sweeps[*quarter]);
        let files: Vec<&Path> = files.chain([Path::new(&output)]).collect();
        Ok([swept, time(&work, &files)?])
    }

    /// Seconds for each cell, and for each one along the border, by squares of two sizes.
    fn squares(&self) -> Result<Seconds, Failure> {
        // Seconds, cells and cells along borders of all places.
        let measure = |side: usize| {
            let (mut seconds, mut cells) = ([0.0; 2], [0.0; 2]);
            for place in 0..PLACES {
                let tile = sample(self.raster, side, place);
                let found = self.seconds(tile)?;
                let [columns, rows] = tile.size.map(|cells| cells as f64);
                seconds = [0, 1].map(|kind| seconds[kind] + found[kind]);
                cells = [cells[0] + columns * rows, cells[1] + 2.0 * (columns + rows)];
            }
            Ok::<_, Failure>((seconds, cells))
        };
        // What is only read once is read before.
        measure(SMALL / 2)?;
        let small = measure(SMALL)?;
        let seconds: f64 = small.0.iter().sum();
        let side = SMALL as f64 * (LONG / seconds.max(1e-6)).sqrt();
        let large = measure(side.clamp(2.0 * SMALL as f64, SAMPLE as f64) as usize)?;
        let rates = |kind: usize| {
            let ([first, second], [[cells, border], [more, longer]]) =
                ([small.0[kind], large.0[kind]], [small.1, large.1]);
            let area = cells * longer - more * border;
            // Of files that are no larger than the small square there is one measure only.
            if area.abs() < 1.0 {
                return [second / more, 0.0];
            }
            let cell = (first * longer - second * border) / area;
            let cell = cell.clamp(0.0, second / more);
            [cell, ((second - cell * more) / longer).max(0.0)]
        };
        let steps: usize = self.quarters.iter().map(|(_, steps)| steps.len()).sum();
        Ok(Seconds {
            sweep: rates(0).map(|seconds| seconds / steps.max(1) as f64),
            tile: rates(1),
        })
    }

    /// Seconds for each cell between observers and a tile.
    fn viewsheds(&self, between: impl Fn(&Tile) -> f64) -> Result<Seconds, Failure> {
        let (mut seconds, mut cells) = (0.0, 0.0);
        for place in 0..PLACES {
            // What is only read once is read before.
            self.seconds(sample(self.raster, SMALL, place))?;
            let tile = sample(self.raster, SAMPLE, place);
            seconds += self.seconds(tile)?[1];
            cells += between(&tile);
        }
        Ok(Seconds {
            tile: [seconds / cells, 0.0],
            ..Seconds::default()
        })
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
