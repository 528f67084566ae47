//! `antumbra index`: height rasters of many files as one, and meshes.

use antumbra_lab::count;
use antumbra_load::{MemorySize, raster_warnings};
use antumbra_raster::Parts;
use antumbra_tiles::Index;

use crate::args::IndexArgs;
use crate::bake::city;
use crate::bake::raster::is_raster;
use crate::bake::tile::is_index;
use crate::exit::{Failure, tell};
use crate::output::Files;
use crate::progress::Progress;
use crate::scenes;

/// Runs the command.
pub fn survey(args: &IndexArgs, memory: MemorySize) -> Result<(), Failure> {
    let output = &args.output;
    if !is_index(output) {
        return Err(Failure::name(output, "wanted a name that ends with .index"));
    }
    if !is_raster(&args.files[..1]) {
        return survey_city(args, memory);
    }
    let rasters = antumbra_raster::files(&args.files);
    let rasters = rasters.map_err(|error| Failure::Scene(error.to_string()))?;
    let mut files = Files::default();
    files.reads_all(&rasters)?;
    files.writes("--output", output)?;
    files.check()?;
    // All files have one unit of heights, or there is no index of them.
    let first = Parts::open(&rasters[0]).map_err(|error| Failure::Scene(error.to_string()))?;
    let warnings = raster_warnings(&rasters[0], first.grid(), first.height_factor());
    scenes::tell_warnings(&warnings)?;
    args.threads.start()?;
    let name = output.to_string_lossy();
    let progress = Progress::new(name.as_ref());
    let index = Index::make(&rasters, output, &progress)?;
    progress.finish();
    let mut text = format!(
        "{name}: {} files are one raster of {} x {} cells, {} with data",
        index.files.len(),
        index.columns,
        index.rows,
        count(index.cells)
    );
    if index.differing > 0 {
        text += &format!(
            "; in {} of them files differ, and the first one has them",
            count(index.differing)
        );
    }
    tell(format_args!("{text}"));
    Ok(())
}

/// The index of meshes.
fn survey_city(args: &IndexArgs, memory: MemorySize) -> Result<(), Failure> {
    let mut files = Files::default();
    files.reads_all(&args.files)?;
    files.writes("--output", &args.output)?;
    files.check()?;
    args.threads.start()?;
    let city = city::index(&args.files, memory)?;
    city.write(&args.output)?;
    tell(format_args!(
        "{}: {} files are one scene of {} triangles",
        args.output.display(),
        city.files.len(),
        count(city.triangles)
    ));
    Ok(())
}
