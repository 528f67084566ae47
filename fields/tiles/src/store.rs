//! Parts of the files of a raster, of which those that were read last are kept.

use std::collections::HashMap;
use std::io::Read;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use antumbra_raster::Parts;
use antumbra_terrain::Tile;
use xxhash_rust::xxh3::Xxh3;

use crate::{Error, Listed};

/// Least number of cells that are read at once.
const LEAST: usize = 1 << 16;

/// Files, and the cells of them that were read last.
#[derive(Debug)]
pub struct Store {
    files: Vec<OnceLock<Parts>>,
    used: Vec<AtomicBool>,
    kept: Mutex<Kept>,
    most_bytes: usize,
}

/// File, and place of a unit among the units of the file.
type Key = (usize, [usize; 2]);

#[derive(Debug, Default)]
struct Kept {
    units: HashMap<Key, (u64, Arc<Vec<f64>>)>,
    bytes: usize,
    /// Number of the last use.
    time: u64,
}

impl Store {
    /// Of so many files, of which about so many bytes are kept.
    pub fn new(files: usize, most_bytes: u64) -> Self {
        Self {
            files: (0..files).map(|_| OnceLock::new()).collect(),
            used: (0..files).map(|_| AtomicBool::new(false)).collect(),
            kept: Mutex::default(),
            most_bytes: usize::try_from(most_bytes).unwrap_or(usize::MAX),
        }
    }

    /// Numbers of the files that were used since the last call.
    pub fn used(&self) -> Vec<usize> {
        let all = self.used.iter().enumerate();
        let used = all.filter(|(_, used)| used.swap(false, Ordering::Relaxed));
        used.map(|(number, _)| number).collect()
    }

    /// The file of this number. Its checksum is looked at when it is opened.
    pub fn open(&self, number: usize, listed: &Listed) -> Result<&Parts, Error> {
        self.used[number].store(true, Ordering::Relaxed);
        if let Some(file) = self.files[number].get() {
            return Ok(file);
        }
        let found = checksum(&listed.path)?;
        if found != (listed.bytes, listed.xxh3) {
            let reason = format!(
                "it has {} bytes and the checksum {:016x}, and when the index was made {} and {:016x}; make the index again by \
                 `antumbra index`",
                found.0, found.1, listed.bytes, listed.xxh3
            );
            return Err(Error::broken(&listed.path, reason));
        }
        let parts = Parts::open(&listed.path)?;
        let grid = parts.grid();
        if [grid.width, grid.height] != listed.size {
            return Err(Error::broken(
                &listed.path,
                "it has another size than in the index",
            ));
        }
        Ok(self.files[number].get_or_init(|| parts))
    }

    /// Gives cells of a file, which are some of its own, to `put`: column and row in the file, and heights of a run of a row.
    pub fn read(
        &self,
        (number, listed): (usize, &Listed),
        part: &Tile,
        mut put: impl FnMut([usize; 2], &[f64]),
    ) -> Result<(), Error> {
        let parts = self.open(number, listed)?;
        let unit = unit(parts.chunk(), listed.size);
        let first = part.at.map(|at| at as usize);
        let end = [0, 1].map(|axis| first[axis] + part.size[axis]);
        for down in first[1] / unit[1]..end[1].div_ceil(unit[1]) {
            for across in first[0] / unit[0]..end[0].div_ceil(unit[0]) {
                let at = [across * unit[0], down * unit[1]];
                let size = [0, 1].map(|axis| unit[axis].min(listed.size[axis] - at[axis]));
                let cells = self.unit((number, [across, down]), || {
                    Ok(parts.read([at[0], at[1], size[0], size[1]])?)
                })?;
                let columns = first[0].max(at[0])..end[0].min(at[0] + size[0]);
                for row in first[1].max(at[1])..end[1].min(at[1] + size[1]) {
                    let run = (row - at[1]) * size[0] + columns.start - at[0];
                    put([columns.start, row], &cells[run..][..columns.len()]);
                }
            }
        }
        Ok(())
    }

    /// Cells of a unit, kept or read.
    fn unit(
        &self,
        key: Key,
        read: impl FnOnce() -> Result<Vec<f64>, Error>,
    ) -> Result<Arc<Vec<f64>>, Error> {
        let kept = || self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(cells) = kept().find(key) {
            return Ok(cells);
        }
        // Others go on meanwhile; two may read the same.
        let cells = Arc::new(read()?);
        kept().add(key, Arc::clone(&cells), self.most_bytes);
        Ok(cells)
    }
}

impl Kept {
    fn find(&mut self, key: Key) -> Option<Arc<Vec<f64>>> {
        self.time += 1;
        let (used, cells) = self.units.get_mut(&key)?;
        *used = self.time;
        Some(Arc::clone(cells))
    }

    fn add(&mut self, key: Key, cells: Arc<Vec<f64>>, most_bytes: usize) {
        let bytes = size_of_val(&cells[..]);
        while self.bytes + bytes > most_bytes {
            let oldest = self.units.iter().min_by_key(|(_, (used, _))| *used);
            let Some(oldest) = oldest.map(|(key, _)| *key) else {
                return;
            };
            self.remove(oldest);
        }
        self.remove(key);
        self.bytes += bytes;
        self.units.insert(key, (self.time, cells));
    }

    fn remove(&mut self, key: Key) {
        if let Some((_, cells)) = self.units.remove(&key) {
            self.bytes -= size_of_val(&cells[..]);
        }
    }
}

/// Columns and rows that are read at once: tiles or strips of a file, or several of them if these are small.
fn unit([columns, rows]: [usize; 2], size: [usize; 2]) -> [usize; 2] {
    let [columns, rows] = [
        columns.clamp(1, size[0].max(1)),
        rows.clamp(1, size[1].max(1)),
    ];
    let times = (LEAST / (columns * rows)).max(1);
    match columns == size[0] {
        true => [columns, rows * times],
        // As far to the side as down.
        false => [columns, rows].map(|cells| cells * times.isqrt()),
    }
}

/// Length of a file, and the checksum of its bytes: XXH3, 64 bits.
///
/// ```
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("empty");
/// std::fs::write(&path, "")?;
/// assert_eq!(antumbra_tiles::checksum(&path)?, (0, 0x2d06_8005_38d3_94c2));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The file cannot be read.
pub fn checksum(path: &Path) -> Result<(u64, u64), Error> {
    let read = || {
        let mut file = antumbra_files::open(path)?;
        let (mut sum, mut bytes, mut total) = (Xxh3::new(), vec![0; 1 << 16], 0);
        loop {
            let count = file.read(&mut bytes)?;
            if count == 0 {
                return Ok((total, sum.digest()));
            }
            sum.update(&bytes[..count]);
            total += count as u64;
        }
    };
    read().map_err(|error| Error::io(path, error))
}
