//! Height rasters as meshes.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use antumbra_mesh::{Warning, plain_material};
use antumbra_raster::{Crs, Grid, Mosaic, Purpose, Raster, Tiles, read_all, unit_name};
use antumbra_scene::TriangleMesh;
use glam::DVec3;

use crate::file::{Loaded, raster_name};
use crate::stage::{OwnStage, scene_of_mesh};
use crate::{Error, Extent, Options};

/// Reads rasters as the surface between the centres of their cells, measured from `origin`, within `limit` bytes.
pub fn load(paths: &[PathBuf], limit: u64, origin: DVec3) -> Result<Loaded, Error> {
    let Mosaic {
        raster,
        inputs,
        tiles,
    } = read_all(paths, limit, Purpose::Mesh)?;
    let warnings = raster_warnings(&paths[0], &raster.grid, raster.height_factor);
    let surface = raster.mesh(origin.to_array());
    let cells = raster.into_cells(&surface);
    let mesh = TriangleMesh {
        positions: surface.positions,
        indices: surface.indices,
        normals: surface.normals.into_iter().map(Into::into).collect(),
        uvs: Vec::new(),
        colors: Vec::new(),
    };
    Ok(Loaded {
        stage: Some(OwnStage::default()),
        warnings,
        raster: Some(Arc::new(cells)),
        tiles,
        inputs,
        ..Loaded::plain(scene_of_mesh(raster_name(paths), mesh, plain_material()))
    })
}

/// A height raster that was read without making a mesh of it.
#[derive(Clone, Debug)]
pub struct Heights {
    /// Heights and where they are.
    pub raster: Raster,
    /// Box around the centres of cells with data, in map coordinates; `None` without data.
    pub extent: Option<Extent>,
    /// Doubts that the raster is in one unit of length.
    pub warnings: Vec<Warning>,
    /// What there is to say about several files that are one raster.
    pub tiles: Option<Tiles>,
    /// Every file that was read.
    pub inputs: Vec<PathBuf>,
}

/// Reads a height raster for work that needs no mesh: a `.tif`, `.asc`, `.npy` or `.vrt`, or files and folders that are one
/// raster, as [`read_all`] reads them.
///
/// # Errors
/// A file has mistakes, or all take more memory than allowed. With [`Options::strict`], warnings are errors, too.
pub fn load_heights(paths: &[PathBuf], options: &Options) -> Result<Heights, Error> {
    let Mosaic {
        raster,
        inputs,
        tiles,
    } = read_all(paths, options.max_memory.bytes(), Purpose::Values)?;
    let of = |path: &PathBuf| raster_warnings(path, &raster.grid, raster.height_factor);
    let warnings = paths.first().map(of);
    let warnings = warnings.unwrap_or_default();
    if options.strict && !warnings.is_empty() {
        return Err(Error::Strict(warnings));
    }
    let extent = Extent::around(ends(&raster));
    Ok(Heights {
        raster,
        extent,
        warnings,
        tiles,
        inputs,
    })
}

/// The first and last centres with data of each row, at its least and at its greatest height: all others are between them.
fn ends(raster: &Raster) -> impl Iterator<Item = [f64; 3]> {
    let rows = raster
        .values
        .chunks_exact(raster.grid.width.max(1))
        .enumerate();
    rows.flat_map(move |(row, heights)| {
        let is_known = |height: &f64| height.is_finite();
        let first = heights.iter().position(is_known);
        let last = heights.iter().rposition(is_known);
        // Without data, nothing is less and nothing greater.
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for &height in heights {
            let height = if height.is_finite() { height } else { f64::NAN };
            low = if height < low { height } else { low };
            high = if height > high { height } else { high };
        }
        let columns = first.into_iter().chain(last);
        columns.flat_map(move |column| {
            let [x, y] = raster.grid.centre(column, row);
            [low, high].map(|z| [x, y, z])
        })
    })
}

/// Warnings about a raster that seems not to be in one unit of length. `height_factor` is as in [`Raster`].
pub fn raster_warnings(path: &Path, grid: &Grid, height_factor: Option<f64>) -> Vec<Warning> {
    let mut warnings = Vec::new();
    let mut warn = |text: String| {
        let place = path.display().to_string();
        warnings.push(Warning { place, text });
    };
    if grid.may_be_degrees() {
        let cell = grid.transform[1];
        warn(format!(
            "cells of {cell} on coordinates that are on the globe look like degrees; sizes must be in the unit of the heights"
        ));
    }
    let ground = grid.crs.as_ref().and_then(Crs::metres).unwrap_or(1.0);
    match height_factor {
        Some(factor) if (factor - 1.0).abs() > 1e-9 => warn(format!(
            "heights are in {} and coordinates in {}: heights are multiplied by {factor:.6}",
            unit_name(factor * ground),
            unit_name(ground)
        )),
        None if ground != 1.0 => warn(format!(
            "coordinates are in {}; the file does not say in which unit its heights are, and they are taken to be in the same",
            unit_name(ground)
        )),
        _ => {}
    }
    warnings
}

#[cfg(test)]
mod tests {
    use std::fs;

    use antumbra_scene::Geometry;

    use crate::{Extent, Options, Up, load, load_heights};

    #[test]
    fn rasters_are_meshes_in_double_precision() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("hill.asc");
        let head = "ncols 3\nnrows 2\nxllcorner 600000.25\nyllcorner 5340000\ncellsize 0.5\n";
        fs::write(&path, format!("{head}1 2 3\n4 5 6\n")).expect("a file");
        let loaded = load(&path, &Options::default()).expect("a scene");
        assert_eq!(loaded.up.axis, Up::Z);
        let Geometry::Mesh(mesh) = &loaded.scene.shapes[0].geometry else {
            panic!("no mesh");
        };
        let world = glam::DVec3::from(glam::Vec3::from(mesh.positions[0])) + loaded.scene.origin;
        assert_eq!(world.to_array(), [600_000.5, 5_340_000.75, 1.0]);
        assert_eq!(mesh.indices.len(), 4);
        let cells = loaded.raster.expect("cells");
        assert_eq!(cells.cells, [0, 1, 2, 3, 4, 5]);
        let extent = Extent::of(&loaded.scene).expect("an extent");
        let plain = load_heights(&[path], &Options::default()).expect("heights");
        assert_eq!(plain.extent.expect("an extent").size(), extent.size());
        assert!(loaded.warnings.is_empty() && plain.raster.values[5] == 6.0);
    }

    #[test]
    fn the_extent_is_that_of_all_centres_with_data() {
        let transforms = [
            [6e5, 2.0, 0.0, 5e6, 0.0, -2.0],
            [6e5, 1.7, 0.3, 5e6, 0.4, -2.1],
            [6e5, -1.1, 0.9, 5e6, -0.8, -1.3],
        ];
        let mut state = 1_u64;
        for transform in transforms {
            for size in [[1, 1], [1, 7], [9, 1], [13, 8], [40, 31]] {
                let heights = (0..size[0] * size[1]).map(|_| {
                    state = state
                        .wrapping_mul(6_364_136_223_846_793_005)
                        .wrapping_add(1);
                    let height = (state >> 40) as f64;
                    if state >> 62 == 0 { height } else { f64::NAN }
                });
                let values: Vec<f64> = heights.collect();
                let mut grid = antumbra_raster::Grid::north_up(size, [0.0; 2], 1.0);
                grid.transform = transform;
                let centres = values.iter().enumerate().map(|(cell, &z)| {
                    let [x, y] = grid.centre(cell % size[0], cell / size[0]);
                    [x, y, z]
                });
                let wanted = Extent::around(centres).map(|extent| [extent.low, extent.high]);
                let raster = antumbra_raster::Raster {
                    grid: grid.clone(),
                    values: values.clone(),
                    height_factor: None,
                };
                let found = Extent::around(super::ends(&raster));
                assert_eq!(found.map(|extent| [extent.low, extent.high]), wanted);
            }
        }
    }

    #[test]
    fn degrees_are_refused_or_warned_of() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("hill.asc");
        let head = "ncols 2\nnrows 2\nxllcorner 11\nyllcorner 48\ncellsize 0.001\n";
        fs::write(&path, format!("{head}1 2\n3 4\n")).expect("a file");
        let loaded = load(&path, &Options::default()).expect("a scene");
        assert!(loaded.warnings[0].text.contains("degrees"));
        let strict = Options {
            strict: true,
            ..Options::default()
        };
        assert!(load(&path, &strict).is_err());
        fs::write(path.with_extension("prj"), "GEOGCS[\"WGS 84\"]").expect("a file");
        let error = load(&path, &Options::default()).expect_err("degrees");
        assert!(error.to_string().contains("gdalwarp"), "{error}");
    }

    #[test]
    fn units_of_heights_are_those_of_the_ground() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../raster/tests/rasters");
        let open =
            |name: &str| load_heights(&[format!("{folder}/{name}").into()], &Options::default());
        let both = open("feet.tif").expect("feet");
        assert!(both.warnings.is_empty(), "{:?}", both.warnings);
        let mixed = open("feet_metres.tif").expect("feet and metres");
        let text = &mixed.warnings[0].text;
        assert!(
            text.contains("heights are in m and coordinates in US survey ft"),
            "{text}"
        );
        let height = mixed.raster.values[0] / both.raster.values[0];
        assert!((height - 3937.0 / 1200.0).abs() < 1e-12, "{height}");
    }
}
