//! Rasters of results: values of the cells of a height raster, or of a grid, with their place on the map.

use std::path::{Path, PathBuf};

use antumbra_bake::{Layout, Orientation, Sensors, UpAxis};
use antumbra_image::atomic_write;
use antumbra_raster::{Crs, Grid, Quantity, RasterCells};

use super::ground::Ground;
use super::tile::is_index;
use crate::exit::Failure;
use crate::output;

/// Whether a scene is a height raster, perhaps of several files, by its names.
pub fn is_raster(scene: &[PathBuf]) -> bool {
    let is_raster = |path| antumbra_raster::is_raster(path) || is_index(path);
    scene.iter().all(|path: &PathBuf| is_raster(path))
}

/// Writes values of sensors, which are the vertices of a height raster or the cells of a grid. A unit of the scene has so many
/// `metres`, and coordinates of a grid are written in the unit of the coordinate system.
pub fn write(
    path: &Path,
    ground: &Ground,
    (sensors, values): (&Sensors, &[f32]),
    (crs, metres): (Option<&Crs>, f64),
    (up, quantity): (UpAxis, Quantity<'_>),
) -> Result<(), Failure> {
    let mut all = match (&sensors.layout, &ground.loaded.raster) {
        (Layout::Vertices, Some(cells)) => RasterCells::clone(cells),
        (Layout::Grid(grid), _) => {
            let own = ground.loaded.raster.as_ref();
            let own = own.and_then(|raster| raster.grid.crs.as_ref());
            let metres = match own {
                // Coordinates of a raster are those of its system, whatever --units says of lengths.
                Some(_) => 1.0,
                None => metres / crs.and_then(Crs::metres).unwrap_or(1.0),
            };
            let plan = Orientation::new(up, 0.0).map_err(Failure::usage)?;
            let origin = plan.local(ground.local.origin);
            let corner = [0, 1].map(|axis| metres * (origin[axis] + grid.corner[axis]));
            let size = [grid.width, grid.height];
            let mut known = Grid::north_up(size, corner, metres * grid.spacing);
            known.crs = own.cloned();
            RasterCells {
                grid: known,
                cells: grid.cells.clone(),
            }
        }
        _ => {
            let reason = "a raster needs --grid, or a scene that is a raster";
            return Err(Failure::name(path, reason));
        }
    };
    if let Some(crs) = crs {
        all.grid.crs = Some(crs.clone());
    }
    write_cells(path, &all, values, quantity)
}

/// Writes values of the vertices of a height raster.
pub fn write_cells(
    path: &Path,
    all: &RasterCells,
    values: &[f32],
    quantity: Quantity<'_>,
) -> Result<(), Failure> {
    write_values(path, &all.grid, &all.spread(values), &[quantity])
}

/// Writes values of all cells of a raster, plane by plane.
pub fn write_values(
    path: &Path,
    grid: &Grid,
    values: &[f32],
    bands: &[Quantity<'_>],
) -> Result<(), Failure> {
    let bytes = antumbra_raster::write(path, grid, values, bands);
    let bytes = bytes.map_err(|error| Failure::Usage(error.to_string()))?;
    output::check_room(path, bytes.len() as u64)?;
    Ok(atomic_write(path, |file| file.write_all(&bytes))?)
}
