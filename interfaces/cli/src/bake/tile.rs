//! Tiles of a raster of many files, with the bits of the whole.
//!
//! Lights, and azimuths that are no steps between cells, are pulled: a tile reads the parts of others that may matter. Steps are
//! pushed: a tile takes the hulls of the lines that enter it from the tiles ahead, and gives on those that leave it. Tiles of all
//! steps of a quarter of the compass follow each other in one order, so that a tile has four such tasks.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use antumbra_bake::{Direction, Error, HeightField, Limits, Observer};
use antumbra_image::atomic_write;
use antumbra_load::MemorySize;
use antumbra_terrain::{Border, Monitor, Pull, Share, Sweep, Tile, TileSweep, Tiles, degrees};
use antumbra_tiles::{self as tiles, Indexed};
use glam::DVec3;

use super::site::Asked;
use crate::exit::Failure;
use crate::input::check_answers;
use crate::output::is_one_of;

/// Part of the memory that heights of other tiles may take, and most bytes of them, since many tasks may share a machine.
const KEPT: u64 = 4;
pub const MOST_KEPT: u64 = 256 << 20;

/// Azimuths that are pulled together, at most, and bytes of their slopes: 8 for each cell.
const TOGETHER: usize = 16;
const SLOPES: usize = 256 << 20;

/// Whether a file is an index, by its name.
pub fn is_index(path: &Path) -> bool {
    is_one_of(path, &["index"])
}

/// Opens the raster of an index.
pub fn open(index: &Path, memory: MemorySize) -> Result<Indexed, Failure> {
    let kept = (memory.bytes() / KEPT).min(MOST_KEPT);
    Ok(Indexed::open(index, kept)?)
}

/// Settles north and units as of the whole raster of this name.
pub fn settle(raster: &Indexed, scene: &[PathBuf], asked: &Asked<'_>) -> Result<(), Failure> {
    let index = raster.index();
    let grid = raster.grid(&index.whole())?;
    let middle = DVec3::from(index.low).midpoint(index.high.into());
    let name = antumbra_load::raster_name(scene);
    asked.settle(&name, grid.crs.as_ref(), middle.to_array())?;
    Ok(())
}

/// How tiles of a raster are computed.
pub struct Tiling {
    /// Directions, of which steps are swept from tile to tile.
    pub directions: Vec<Direction>,
    /// Name and unit of each band of the results.
    pub bands: Vec<[String; 2]>,
    /// Cells around observers: all between these and a tile are read.
    pub eyes: Vec<Tile>,
}

/// Quarters that have steps, and these.
pub fn quarters(directions: &[Direction]) -> Vec<(usize, Vec<[i32; 2]>)> {
    let quarters = (0..4).map(|quarter| (quarter, steps(directions, quarter)));
    quarters.filter(|(_, steps)| !steps.is_empty()).collect()
}

/// The quarter of the compass of a step: from the first of its ends to before the other.
pub fn quarter([columns, rows]: [i32; 2]) -> usize {
    match (columns.signum(), rows.signum()) {
        (1, 0 | 1) => 0,
        (0 | -1, 1) => 1,
        (-1, 0 | -1) => 2,
        _ => 3,
    }
}

/// A tile that a command computes instead of the whole.
pub struct TileWork<'a> {
    pub raster: &'a Indexed,
    pub tile: Tile,
    /// A quarter of which the steps are swept, instead of the answers of the command, and the file to write.
    pub quarter: Option<(usize, &'a Path)>,
    /// Files of the sweeps of this tile, quarter by quarter, or for a sweep the files of the tiles ahead.
    pub sweeps: &'a [PathBuf],
    /// Whether sweeps begin in this tile, as if it were the whole, to see how long they take.
    pub is_sample: bool,
    /// Why other tiles cannot be read.
    failure: Mutex<Option<tiles::Error>>,
}

impl<'a> TileWork<'a> {
    pub fn new(
        raster: &'a Indexed,
        tile: Tile,
        (quarter, sweeps): (Option<(usize, &'a Path)>, &'a [PathBuf]),
    ) -> Self {
        Self {
            raster,
            tile,
            quarter,
            sweeps,
            is_sample: false,
            failure: Mutex::default(),
        }
    }

    /// The tile with the cells around it.
    fn window(&self) -> Tile {
        self.tile.with_margin([1; 2], &self.raster.index().whole())
    }

    /// An observer at a point, in columns and rows of the whole; on the surface if the point has no height. `None` beside the surface.
    pub fn observer(raster: &Indexed, [x, y, z]: [f64; 3]) -> Result<Option<Observer>, Failure> {
        let index = raster.index();
        let whole = HeightField::new([2, 2], &[0.0; 4], index.transform).map_err(Error::from)?;
        let place = whole.place([x, y]);
        let around = around(place).within(&index.whole());
        if around.size.contains(&0) {
            return Ok(None);
        }
        let heights = raster.read(around)?;
        let field = HeightField::new(around.size, &heights, index.transform);
        let field = field.map_err(Error::from)?;
        let own = [0, 1].map(|axis| place[axis] - around.at[axis] as f64);
        let height = if z.is_nan() {
            field.surface(own)
        } else {
            Some(z)
        };
        Ok(height.map(|height| Observer {
            place,
            height,
            normal: [0.0; 3],
        }))
    }

    /// Answers with a field that has the window and all cells between it and an observer, who is moved into it, and with the window in
    /// it; not at all if every cell is out of range.
    pub fn seen(
        &self,
        observer: &Observer,
        limits: &Limits,
        answer: impl FnOnce(&HeightField<'_>, &Observer, Tile) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let (index, window) = (self.raster.index(), self.window());
        let [_, a, b, _, d, e] = index.transform;
        let ends = [0, 1].map(|axis| {
            let first = window.at[axis] as f64 - observer.place[axis];
            [first, first + window.size[axis] as f64]
        });
        // Cells beyond the nearest corner are as far away, along columns or rows.
        let away = ends.map(|[first, last]| first.max(-last).max(0.0));
        let least = (a * e - b * d).abs() / a.hypot(d).max(b.hypot(e));
        if away[0].max(away[1]) * least > limits.range {
            return Ok(());
        }
        let eye = around(observer.place).within(&index.whole());
        let hull = window.hull(&eye);
        check_answers("viewshed", 9 * hull.size[0] as u64 * hull.size[1] as u64)?;
        let heights = self.raster.read(hull)?;
        let field = HeightField::new(hull.size, &heights, index.transform_at(hull.at));
        let place = [0, 1].map(|axis| observer.place[axis] - hull.at[axis] as f64);
        let at = [0, 1].map(|axis| window.at[axis] - hull.at[axis]);
        let eye = Observer { place, ..*observer };
        answer(&field.map_err(Error::from)?, &eye, Tile { at, ..window })
    }

    /// Which of the cells of the window get light from each of some directions, for [`FieldSunJob`](antumbra_bake::FieldSunJob).
    pub fn lit(
        &self,
        rise: f64,
        directions: &[[f64; 2]],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Vec<u64>>, Error> {
        let pull = Pull {
            tiles: self.raster,
            rise,
        };
        match pull.lit(&self.window(), directions, monitor) {
            Ok(found) => Ok(found.values),
            Err(tiles::Error::Terrain(error)) => Err(error.into()),
            Err(error) => {
                *self.failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                Err(Error::Cancelled)
            }
        }
    }

    /// The failure of a job of which other tiles are a part.
    pub fn failure(&self, error: Error) -> Failure {
        let mut own = self.failure.lock().unwrap_or_else(PoisonError::into_inner);
        own.take().map_or_else(|| error.into(), Failure::from)
    }

    /// Sweeps a quarter of the steps of some directions, and writes what cells of the tile see and what tiles behind need.
    pub fn sweep(
        &self,
        (quarter, path): (usize, &Path),
        directions: &[Direction],
        rise: f64,
        monitor: &dyn Monitor,
    ) -> Result<(), Failure> {
        let steps = steps(directions, quarter);
        let most = |axis: usize| steps.iter().map(|step| i64::from(step[axis].abs())).max();
        let margin = [0, 1].map(|axis| most(axis).unwrap_or(0).max(1));
        let index = self.raster.index();
        let whole = match self.is_sample {
            true => self.tile,
            false => index.whole(),
        };
        let window = self.tile.with_margin(margin, &whole);
        let heights = self.raster.read(window)?;
        let field = HeightField::new(window.size, &heights, index.transform_at(window.at));
        let field = field.map_err(Error::from)?;
        let ahead = self.sweeps.iter().map(|path| Sweeps::open(path));
        let mut ahead = ahead.collect::<Result<Vec<Sweeps>, Failure>>()?;
        let mut found = Vec::new();
        for (number, &step) in steps.iter().enumerate() {
            let entering = ahead.iter_mut().map(|sweeps| sweeps.border(step));
            let entering = entering.collect::<Result<Vec<Border>, Failure>>()?;
            let sweep = TileSweep {
                sweep: Sweep {
                    field: &field,
                    rise,
                    drop: 0.0,
                },
                at: [0, 1].map(|axis| window.at[axis] - whole.at[axis]),
                tile: Tile {
                    at: [0, 1].map(|axis| self.tile.at[axis] - whole.at[axis]),
                    ..self.tile
                },
                whole: whole.size.map(|cells| cells as i64),
                has_holes: index.has_holes(),
            };
            let share = Share(monitor, [number, steps.len()]);
            let swept = sweep.horizons(step, &entering, degrees, &share);
            let (angles, border) = swept.map_err(Error::from)?;
            found.push((step, border.to_bytes(), angles));
        }
        Ok(atomic_write(path, |file| Sweeps::write(file, &found))?)
    }

    /// Angles of the cells of the window, in the direction of this number. Along steps they are NaN beside the tile.
    pub fn plane<'d>(
        &'d self,
        directions: &'d [Direction],
        rise: f64,
    ) -> impl Fn(usize, &dyn Monitor) -> Result<Vec<f32>, Failure> + 'd {
        let pulled = RefCell::new(BTreeMap::new());
        move |index, monitor| {
            if let Direction::Step(step) = directions[index] {
                let angles = Sweeps::open(&self.sweeps[quarter(step)])?.angles(step)?;
                return Ok(self.around(&angles));
            }
            if let Some(angles) = pulled.borrow_mut().remove(&index) {
                return Ok(angles);
            }
            let azimuth = |at: &usize| match directions[*at] {
                Direction::Azimuth(azimuth) => Some(azimuth),
                Direction::Step(_) => None,
            };
            let next = (index..directions.len()).filter(|at| azimuth(at).is_some());
            let window = self.window();
            let together = SLOPES / (8 * window.size[0] * window.size[1]);
            let next: Vec<usize> = next.take(together.clamp(1, TOGETHER)).collect();
            let azimuths: Vec<f64> = next.iter().filter_map(azimuth).collect();
            let pull = Pull {
                tiles: self.raster,
                rise,
            };
            let found = pull.horizons(&window, &azimuths, 0.0, monitor)?;
            let angles = found.values.into_iter();
            let angles = angles.map(|slopes| slopes.into_iter().map(degrees).collect::<Vec<f32>>());
            let mut pulled = pulled.borrow_mut();
            pulled.extend(next.into_iter().zip(angles));
            Ok(pulled.remove(&index).unwrap_or_default())
        }
    }

    /// Values of the window, of values of the tile.
    fn around(&self, values: &[f32]) -> Vec<f32> {
        let window = self.window();
        let mut all = vec![f32::NAN; window.size[0] * window.size[1]];
        let [column, row] = [0, 1].map(|axis| (self.tile.at[axis] - window.at[axis]) as usize);
        let rows = all.chunks_exact_mut(window.size[0]).skip(row);
        for (all, values) in rows.zip(values.chunks_exact(self.tile.size[0])) {
            all[column..][..values.len()].copy_from_slice(values);
        }
        all
    }
}

/// The cells around a place.
pub fn around(place: [f64; 2]) -> Tile {
    Tile {
        at: place.map(|at| at.floor() as i64 - 1),
        size: [4; 2],
    }
}

/// Steps of a quarter.
fn steps(directions: &[Direction], wanted: usize) -> Vec<[i32; 2]> {
    let steps = directions.iter().filter_map(|direction| match direction {
        Direction::Step(step) => Some(*step),
        Direction::Azimuth(_) => None,
    });
    steps.filter(|&step| quarter(step) == wanted).collect()
}

/// A file of sweeps: for each step its columns and rows, the length of its border, and the number of its angles; then borders; then
/// angles. All numbers are little-endian.
struct Sweeps {
    path: PathBuf,
    file: File,
    /// Place of the border and of the angles of each step, and their lengths in bytes.
    steps: Vec<([i32; 2], [[u64; 2]; 2])>,
}

impl Sweeps {
    const MAGIC: &'static [u8; 16] = b"antumbra.sweep/1";

    fn write(file: &mut dyn Write, found: &[([i32; 2], Vec<u8>, Vec<f32>)]) -> io::Result<()> {
        file.write_all(Self::MAGIC)?;
        file.write_all(&(found.len() as u64).to_le_bytes())?;
        for (step, border, angles) in found {
            for number in step {
                file.write_all(&number.to_le_bytes())?;
            }
            for length in [border.len(), 4 * angles.len()] {
                file.write_all(&(length as u64).to_le_bytes())?;
            }
        }
        for (_, border, _) in found {
            file.write_all(border)?;
        }
        for (_, _, angles) in found {
            let bytes: Vec<u8> = angles
                .iter()
                .flat_map(|angle| angle.to_le_bytes())
                .collect();
            file.write_all(&bytes)?;
        }
        Ok(())
    }

    fn open(path: &Path) -> Result<Self, Failure> {
        let read = || {
            let mut file = antumbra_files::open(path)?;
            let mut head = [0; 24];
            file.read_exact(&mut head)?;
            let (magic, count) = head.split_at(16);
            let count = u64::from_le_bytes(count.try_into().unwrap_or_default());
            if magic != Self::MAGIC || count > 1 << 16 {
                return Err(io::Error::new(
                    io::ErrorKind::InvalidData,
                    "it is no file of sweeps",
                ));
            }
            let (mut steps, mut bytes) = (Vec::new(), [0; 24]);
            for _ in 0..count {
                file.read_exact(&mut bytes)?;
                let (words, _) = bytes.as_chunks::<4>();
                let step = [0, 1].map(|word| i32::from_le_bytes(words[word]));
                let (words, _) = bytes[8..].as_chunks::<8>();
                let lengths = [0, 1].map(|word| u64::from_le_bytes(words[word]));
                steps.push((step, lengths.map(|length| [0, length])));
            }
            let mut place = 24 + 24 * count;
            for kind in 0..2 {
                for (_, parts) in &mut steps {
                    parts[kind][0] = place;
                    place = place.saturating_add(parts[kind][1]);
                }
            }
            if file.metadata()?.len() != place {
                return Err(io::Error::new(
                    io::ErrorKind::InvalidData,
                    "it is cut short",
                ));
            }
            let path = path.to_path_buf();
            Ok(Self { path, file, steps })
        };
        read().map_err(|error| Failure::Data(format!("{}: {error}", path.display())))
    }

    /// The border or the angles of a step as bytes.
    fn bytes(&mut self, step: [i32; 2], kind: usize) -> Result<Vec<u8>, Failure> {
        let name = self.path.display();
        let found = self.steps.iter().find(|(own, _)| *own == step);
        let missing = || Failure::Data(format!("{name}: it has no sweep along {step:?}"));
        let [place, length] = found.ok_or_else(missing)?.1[kind];
        let mut bytes = vec![0; length as usize];
        let read = self.file.seek(SeekFrom::Start(place));
        let read = read.and_then(|_| self.file.read_exact(&mut bytes));
        read.map_err(|error| Failure::Data(format!("{name}: {error}")))?;
        Ok(bytes)
    }

    fn border(&mut self, step: [i32; 2]) -> Result<Border, Failure> {
        let border = Border::from_bytes(&self.bytes(step, 0)?);
        border.map_err(|error| Failure::Data(format!("{}: {error}", self.path.display())))
    }

    fn angles(&mut self, step: [i32; 2]) -> Result<Vec<f32>, Failure> {
        let bytes = self.bytes(step, 1)?;
        let (words, _) = bytes.as_chunks::<4>();
        Ok(words.iter().map(|word| f32::from_le_bytes(*word)).collect())
    }
}
