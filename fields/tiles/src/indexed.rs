//! A raster that an index describes.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use antumbra_raster::Grid;
use antumbra_terrain::{self as terrain, Peaks, Tile, Tiles};

use crate::peaks::Reader;
use crate::store::Store;
use crate::{Error, Index};

/// A raster of many files, of which parts are read. Where several files have data in a cell, the first one has the cell.
#[derive(Debug)]
pub struct Indexed {
    index: Index,
    path: PathBuf,
    peaks: OnceLock<Reader>,
    store: Store,
    /// Squares of 512 cells of all files, and the largest height in each.
    blocks: Vec<Tile>,
    most: Vec<f64>,
}

impl Indexed {
    /// Opens the raster of an index, of which it keeps at most about so many bytes of heights that were read.
    ///
    /// Its files and the file of peaks are opened when something of them is read.
    ///
    /// # Errors
    /// The index cannot be read.
    pub fn open(path: &Path, most_bytes: u64) -> Result<Self, Error> {
        let index = Index::read(path)?;
        let blocks: Vec<Tile> = index.files.iter().flat_map(|file| file.blocks()).collect();
        let most = index.files.iter().flat_map(|file| &file.peaks);
        let most = most.map(|peak| peak.map_or(f64::NEG_INFINITY, f64::from));
        Ok(Self {
            path: path.to_path_buf(),
            peaks: OnceLock::new(),
            store: Store::new(index.files.len(), most_bytes),
            most: most.collect(),
            blocks,
            index,
        })
    }

    /// The index.
    pub fn index(&self) -> &Index {
        &self.index
    }

    /// The grid of a tile. The coordinate system is of the file in the north west.
    ///
    /// # Errors
    /// This file cannot be read, or has changed since the index was made.
    pub fn grid(&self, tile: &Tile) -> Result<Grid, Error> {
        let files = self.index.files.iter().enumerate();
        let corner = files.min_by_key(|(_, file)| (file.at[1], file.at[0]));
        let crs = match corner {
            Some((number, file)) => self.store.open(number, file)?.grid().crs.clone(),
            None => None,
        };
        let [width, height] = tile.size;
        let transform = self.index.transform_at(tile.at);
        Ok(Grid {
            width,
            height,
            transform,
            crs,
        })
    }

    /// Numbers of the files of which something was used since the last call.
    pub fn used_files(&self) -> Vec<usize> {
        self.store.used()
    }
}

impl Tiles for Indexed {
    type Error = Error;

    fn transform(&self) -> [f64; 6] {
        self.index.transform
    }

    fn tiles(&self) -> &[Tile] {
        &self.blocks
    }

    fn peak(&self, tile: usize) -> f64 {
        self.most[tile]
    }

    fn peaks(&self, tile: usize) -> Result<Option<Peaks>, Error> {
        let peaks = match self.peaks.get() {
            Some(peaks) => peaks,
            None => {
                let peaks = Reader::open(&self.path, self.blocks.len(), self.index.peaks)?;
                self.peaks.get_or_init(|| peaks)
            }
        };
        peaks.read(tile, self.blocks[tile].size).map(Some)
    }

    fn read(&self, part: Tile) -> Result<Vec<f64>, Error> {
        let mut heights = terrain::memory::filled(
            "heights",
            part.size[0].saturating_mul(part.size[1]),
            f64::NAN,
        )?;
        for (number, file) in self.index.files.iter().enumerate() {
            if !part.touches(&file.tile()) {
                continue;
            }
            let own = part.within(&file.tile());
            let place = [0, 1].map(|axis| (own.at[axis] - part.at[axis]) as usize);
            let at = [0, 1].map(|axis| own.at[axis] - file.at[axis] as i64);
            let inner = Tile { at, size: own.size };
            self.store
                .read((number, file), &inner, |[column, row], run| {
                    let column = column - at[0] as usize + place[0];
                    let row = row - at[1] as usize + place[1];
                    let cells = &mut heights[row * part.size[0] + column..][..run.len()];
                    for (cell, &height) in cells.iter_mut().zip(run) {
                        *cell = if cell.is_nan() { height } else { *cell };
                    }
                })?;
        }
        Ok(heights)
    }
}
