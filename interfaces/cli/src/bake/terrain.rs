//! Height rasters that are baked without a mesh and without a tree.

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use antumbra::LocalOrigin;
use antumbra_bake::{HeightField, Sensors, UpAxis};
use antumbra_lab::count;
use antumbra_load::{Extent, Heights, MemorySize, raster_name};
use antumbra_raster::{Crs, Grid, Quantity, Raster, Site};
use antumbra_terrain::{Tile, Tiles};
use antumbra_tiles::Indexed;

use super::raster::{self, is_raster};
use super::site::Asked;
use super::tile::{self, is_index};
use crate::exit::{Failure, tell};
use crate::output::Files;
use crate::scenes;

/// A height raster.
pub struct Terrain {
    pub name: String,
    pub heights: Heights,
    pub extent: Extent,
    /// Number of cells with data.
    pub known: usize,
    pub load_seconds: f64,
    /// Cells whose values are written, if these are not all.
    own: Option<Tile>,
}

/// Bytes of a cell of a raster that is read as a whole, with what is computed of it.
const WHOLE: u64 = 16;

/// Whether a scene is a height raster that lies as it does on a map.
pub fn is_terrain(scene: &[PathBuf], up: Option<UpAxis>) -> bool {
    is_raster(scene) && up.is_none_or(|up| up == UpAxis::Z)
}

impl Terrain {
    /// Reads a raster, perhaps of several files.
    pub fn load(scene: &[PathBuf], memory: MemorySize, files: &mut Files) -> Result<Self, Failure> {
        let name = raster_name(scene);
        let start = Instant::now();
        if let [index] = scene
            && is_index(index)
        {
            let raster = tile::open(index, memory)?;
            files.reads("the index", index)?;
            let whole = raster.index().whole();
            let [columns, rows] = whole.size.map(|cells| cells as u64);
            if columns.saturating_mul(rows).saturating_mul(WHOLE) > memory.bytes() {
                let reason = format!(
                    "{columns} x {rows} cells do not fit into {memory} of memory; compute them in tiles: antumbra plan {} -o \
                     plan.jsonl COMMAND",
                    index.display()
                );
                return Err(Failure::scene(&name, reason));
            }
            return Self::of_tile(&raster, &whole, name);
        }
        let heights = scenes::load_heights(scene, memory)?;
        files.reads_all(&heights.inputs)?;
        let Some(extent) = heights.extent else {
            return Err(Failure::scene(&name, "it has no cell with data"));
        };
        let known = heights.raster.values.iter();
        Ok(Self {
            name,
            known: known.filter(|height| height.is_finite()).count(),
            heights,
            extent,
            load_seconds: start.elapsed().as_secs_f64(),
            own: None,
        })
    }

    /// Reads a tile of a raster with the cells around it. Place and extent are of the whole.
    pub fn of_tile(raster: &Indexed, tile: &Tile, name: String) -> Result<Self, Failure> {
        let start = Instant::now();
        let index = raster.index();
        let window = tile.with_margin([1; 2], &index.whole());
        let values = raster.read(window)?;
        let at = [0, 1].map(|axis| tile.at[axis] - window.at[axis]);
        Ok(Self {
            name,
            known: values.iter().filter(|height| height.is_finite()).count(),
            heights: Heights {
                raster: Raster {
                    grid: raster.grid(&window)?,
                    values,
                    height_factor: index.height_factor,
                },
                extent: None,
                warnings: Vec::new(),
                tiles: None,
                inputs: Vec::new(),
            },
            extent: Extent {
                low: index.low.into(),
                high: index.high.into(),
            },
            load_seconds: start.elapsed().as_secs_f64(),
            own: (*tile != window).then_some(Tile { at, ..*tile }),
        })
    }

    /// Writes values of all cells, plane by plane; of a tile, only its own cells.
    pub fn write(
        &self,
        path: &Path,
        crs: Option<&Crs>,
        values: &[f32],
        bands: &[Quantity<'_>],
    ) -> Result<(), Failure> {
        raster::write_values(path, &self.own_grid(crs), &self.own(values), bands)
    }

    /// Grid of the cells whose values are written.
    pub fn own_grid(&self, crs: Option<&Crs>) -> Grid {
        let mut grid = self.grid(crs);
        if let Some(Tile { at, size }) = self.own {
            let [x, y] = grid.corner(at[0] as f64, at[1] as f64);
            (grid.transform[0], grid.transform[3]) = (x, y);
            [grid.width, grid.height] = size;
        }
        grid
    }

    /// Values of these cells, of values of all, plane by plane.
    pub fn own<'v>(&self, values: &'v [f32]) -> Cow<'v, [f32]> {
        let Some(Tile { at, size }) = self.own else {
            return values.into();
        };
        let grid = &self.heights.raster.grid;
        let [column, row] = at.map(|at| at as usize);
        let planes = values.chunks_exact(grid.width * grid.height);
        let rows = planes.flat_map(|plane| plane.chunks_exact(grid.width).skip(row).take(size[1]));
        let own = rows.flat_map(|row| &row[column..][..size[0]]);
        own.copied().collect()
    }

    /// Settles what its coordinate system answers. Returns the place on the earth, if it is known.
    pub fn settle(&self, asked: &Asked<'_>) -> Result<Option<Site>, Failure> {
        let middle = self.extent.low.midpoint(self.extent.high).to_array();
        let own = self.heights.raster.grid.crs.as_ref();
        asked.settle(&self.name, own, middle)
    }

    /// Cells with data.
    pub fn cells(&self) -> impl Iterator<Item = usize> + Clone {
        let heights = &self.heights.raster.values;
        (0..heights.len()).filter(|&cell| heights[cell].is_finite())
    }

    /// Sensors at the cells with data, so high above them.
    pub fn sensors(&self, rise: f64) -> Sensors {
        let (raster, local) = (&self.heights.raster, self.local());
        let point = |cell: usize| {
            let width = raster.grid.width;
            let [x, y] = raster.grid.centre(cell % width, cell / width);
            local.local([x, y, raster.values[cell] + rise])
        };
        Sensors {
            points: self.cells().map(point).collect(),
            ..Sensors::default()
        }
    }

    /// Values of all cells, of values of those with data.
    pub fn spread(&self, values: &[f32]) -> Vec<f32> {
        let mut all = vec![f32::NAN; self.heights.raster.values.len()];
        for (cell, &value) in self.cells().zip(values) {
            all[cell] = value;
        }
        all
    }

    /// Says what was read.
    pub fn tell_read(&self) {
        let [x, y, z] = self.extent.size().to_array().map(scenes::rounded);
        let grid = &self.heights.raster.grid;
        tell(format_args!(
            "{}: {x} x {y} x {z} {} (x, y, z); z is up, as rasters of heights have it; {} x {} cells",
            self.name,
            scenes::unit(grid.crs.as_ref()),
            grid.width,
            grid.height
        ));
    }

    /// Says how many cells were read.
    pub fn tell(&self) {
        tell(format_args!(
            "{}: {} cells, loaded in {:.2} s",
            self.name,
            count(self.known as u64),
            self.load_seconds
        ));
    }

    /// Its surface.
    pub fn field(&self) -> Result<HeightField<'_>, Failure> {
        let raster = &self.heights.raster;
        let size = [raster.grid.width, raster.grid.height];
        let field = HeightField::new(size, &raster.values, raster.grid.transform);
        Ok(field.map_err(antumbra_bake::Error::from)?)
    }

    /// Origin of points in single precision.
    pub fn local(&self) -> LocalOrigin {
        LocalOrigin {
            origin: self.extent.local_origin().to_array(),
        }
    }

    /// Its grid, in the coordinate system that the command line says.
    pub fn grid(&self, crs: Option<&Crs>) -> Grid {
        let mut grid = self.heights.raster.grid.clone();
        if crs.is_some() {
            grid.crs = crs.cloned();
        }
        grid
    }
}
