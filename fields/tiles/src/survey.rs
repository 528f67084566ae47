//! Making an index: all cells of all files are read once, square by square.

use std::io;
use std::path::{Path, PathBuf};

use antumbra_files::write_file;
use antumbra_raster::Lattice;
use antumbra_terrain::{Monitor, Progress, Tile};
use rayon::prelude::*;

use crate::peaks::{self, Record};
use crate::store::{Store, checksum};
use crate::{Error, Index, Listed};

/// Bytes of cells that are kept for the next squares.
const KEPT: u64 = 256 << 20;

/// What a square of a file has.
struct Found {
    record: Record,
    cells: u64,
    differing: u64,
    low: [f64; 3],
    high: [f64; 3],
}

/// Reads all files, writes peaks beside `path`, and returns the index.
pub fn survey(files: &[PathBuf], path: &Path, monitor: &dyn Monitor) -> Result<Index, Error> {
    let Lattice {
        whole,
        grids,
        places,
    } = Lattice::of(files)?;
    let mut index = Index {
        columns: whole.width,
        rows: whole.height,
        transform: whole.transform,
        cells: 0,
        low: [f64::INFINITY; 3],
        high: [f64::NEG_INFINITY; 3],
        height_factor: None,
        differing: 0,
        peaks: 0,
        files: Vec::new(),
    };
    for ((path, grid), at) in files.iter().zip(&grids).zip(places) {
        let (bytes, xxh3) = checksum(path)?;
        let path = std::path::absolute(path).map_err(|error| Error::io(path, error))?;
        let size = [grid.width, grid.height];
        index.files.push(Listed {
            path,
            at,
            size,
            bytes,
            xxh3,
            peaks: Vec::new(),
        });
    }
    let store = Store::new(files.len(), KEPT);
    let squares = index.files.iter().map(|file| file.blocks().count()).sum();
    let progress = Progress::new(monitor, squares);
    let peaks_path = peaks::path(path);
    // A failure of the survey is not one of the file that it writes.
    let mut failure = None;
    let written = write_file(&peaks_path, |out| {
        let writer = peaks::Writer::new(out)?;
        fill(&mut index, &store, writer, (monitor, &progress)).map_err(|error| match error {
            Error::Io { path, source } if path.as_os_str().is_empty() => source,
            other => {
                failure = Some(other);
                io::ErrorKind::Other.into()
            }
        })
    });
    match (failure, written) {
        (Some(failure), _) => Err(failure),
        (None, Err(error)) => Err(Error::io(&peaks_path, error)),
        (None, Ok(())) => Ok(index),
    }
}

/// Fills an index that has its files, and the file of peaks.
fn fill(
    index: &mut Index,
    store: &Store,
    mut writer: peaks::Writer<'_>,
    watch: (&dyn Monitor, &Progress<'_>),
) -> Result<(), Error> {
    let unwritten = |error| Error::io(Path::new(""), error);
    for number in 0..index.files.len() {
        let listed = &index.files[number];
        let own = store.open(number, listed)?.height_factor();
        let [new, before] = [own, index.height_factor].map(|factor| factor.unwrap_or(1.0));
        if number > 0 && new != before {
            let reason = format!(
                "a unit of its heights is {new} of the ground, and in files before it {before}; bring all to one unit"
            );
            return Err(Error::broken(&listed.path, reason));
        }
        index.height_factor = index.height_factor.or(own);
        for square in of_file(store, index, number, watch)? {
            writer.push(&square.record).map_err(unwritten)?;
            index.files[number].peaks.push(square.record.peak());
            index.cells += square.cells;
            index.differing += square.differing;
            for axis in 0..3 {
                index.low[axis] = index.low[axis].min(square.low[axis]);
                index.high[axis] = index.high[axis].max(square.high[axis]);
            }
        }
    }
    if index.cells == 0 {
        return Err(Error::broken(
            &index.files[0].path,
            "no file has a cell with data",
        ));
    }
    index.peaks = writer.finish().map_err(unwritten)?;
    Ok(())
}

/// Looks at all squares of a file.
fn of_file(
    store: &Store,
    index: &Index,
    number: usize,
    (monitor, progress): (&dyn Monitor, &Progress<'_>),
) -> Result<Vec<Found>, Error> {
    let squares: Vec<Tile> = index.files[number].blocks().collect();
    let all = squares.par_iter().map(|square| {
        if monitor.cancelled() {
            return Err(antumbra_terrain::Error::Cancelled.into());
        }
        let found = of_square(store, index, number, square);
        progress.add(1);
        found
    });
    all.collect()
}

/// Looks at the cells of a square that no file before has.
fn of_square(store: &Store, index: &Index, number: usize, square: &Tile) -> Result<Found, Error> {
    let mut heights = vec![f64::NAN; square.size[0] * square.size[1]];
    let mut differing = 0;
    // The own cells first, of which other files take some.
    let before = (0..number).filter(|&other| square.touches(&index.files[other].tile()));
    for other in [number].into_iter().chain(before) {
        let file = &index.files[other];
        let part = square.within(&file.tile());
        let inner = Tile {
            at: [0, 1].map(|axis| part.at[axis] - file.at[axis] as i64),
            size: part.size,
        };
        store.read((other, file), &inner, |[column, row], run| {
            let column = file.at[0] + column - square.at[0] as usize;
            let row = file.at[1] + row - square.at[1] as usize;
            let cells = &mut heights[row * square.size[0] + column..][..run.len()];
            for (cell, &height) in cells.iter_mut().zip(run) {
                if other == number {
                    *cell = height;
                } else if !height.is_nan() {
                    differing += u64::from(!cell.is_nan() && *cell != height);
                    *cell = f64::NAN;
                }
            }
        })?;
    }
    let mut found = Found {
        record: Record::new(),
        cells: 0,
        differing,
        low: [f64::INFINITY; 3],
        high: [f64::NEG_INFINITY; 3],
    };
    let [_, a, b, _, d, e] = index.transform;
    let [x, y] = [index.transform[0], index.transform[3]];
    for (row, heights) in heights.chunks_exact(square.size[0]).enumerate() {
        let known = |height: &f64| height.is_finite();
        let ends = heights
            .iter()
            .position(known)
            .into_iter()
            .chain(heights.iter().rposition(known));
        for column in ends {
            let at = [square.at[0] as usize + column, square.at[1] as usize + row]
                .map(|at| at as f64 + 0.5);
            let centre = [x + at[0] * a + at[1] * b, y + at[0] * d + at[1] * e];
            for (axis, place) in centre.into_iter().enumerate() {
                found.low[axis] = found.low[axis].min(place);
                found.high[axis] = found.high[axis].max(place);
            }
        }
        for (column, &height) in heights
            .iter()
            .enumerate()
            .filter(|(_, height)| known(height))
        {
            found.cells += 1;
            found.low[2] = found.low[2].min(height);
            found.high[2] = found.high[2].max(height);
            found.record.add([column, row], height);
        }
    }
    Ok(found)
}
