//! Height rasters as meshes.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use antumbra_mesh::{Warning, plain_material};
use antumbra_raster::{Crs, Mosaic, Purpose, Raster, Tiles, read_all, unit_name};
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
    let warnings = warnings(&paths[0], &raster);
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
    let warnings = paths.first().map(|path| warnings(path, &raster));
    let warnings = warnings.unwrap_or_default();
    if options.strict && !warnings.is_empty() {
        return Err(Error::Strict(warnings));
    }
    let width = raster.grid.width;
    let cells = raster.values.iter().enumerate();
    let centres = cells.map(|(cell, &z)| {
        let [x, y] = raster.grid.centre(cell % width, cell / width);
        [x, y, z]
    });
    let extent = Extent::around(centres);
    Ok(Heights {
        raster,
        extent,
        warnings,
        tiles,
        inputs,
    })
}

/// Warnings about a raster that seems not to be in one unit of length.
fn warnings(path: &Path, raster: &Raster) -> Vec<Warning> {
    let grid = &raster.grid;
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
    match raster.height_factor {
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
