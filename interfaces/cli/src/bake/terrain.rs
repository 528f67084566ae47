//! Height rasters that are baked without a mesh and without a tree.

use std::path::PathBuf;
use std::time::Instant;

use antumbra::LocalOrigin;
use antumbra_bake::{HeightField, Sensors, UpAxis};
use antumbra_lab::count;
use antumbra_load::{Extent, Heights, MemorySize, raster_name};
use antumbra_raster::{Crs, Grid, Site};

use super::raster::is_raster;
use super::site::Asked;
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
}

/// Whether a scene is a height raster that lies as it does on a map.
pub fn is_terrain(scene: &[PathBuf], up: Option<UpAxis>) -> bool {
    is_raster(scene) && up.is_none_or(|up| up == UpAxis::Z)
}

impl Terrain {
    /// Reads a raster, perhaps of several files.
    pub fn load(scene: &[PathBuf], memory: MemorySize, files: &mut Files) -> Result<Self, Failure> {
        let name = raster_name(scene);
        let start = Instant::now();
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
        })
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
