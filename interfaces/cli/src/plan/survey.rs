//! `antumbra index`: height rasters of many files as one.

use antumbra_lab::count;
use antumbra_load::raster_warnings;
use antumbra_tiles::{Index, Indexed};

use crate::args::IndexArgs;
use crate::bake::tile::is_index;
use crate::exit::{Failure, tell};
use crate::output::Files;
use crate::progress::Progress;

/// Runs the command.
pub fn survey(args: &IndexArgs) -> Result<(), Failure> {
    let output = &args.output;
    if !is_index(output) {
        return Err(Failure::name(output, "wanted a name that ends with .index"));
    }
    let rasters = antumbra_raster::files(&args.rasters);
    let rasters = rasters.map_err(|error| Failure::Scene(error.to_string()))?;
    let mut files = Files::default();
    files.reads_all(&rasters)?;
    files.writes("--output", output)?;
    files.check()?;
    args.machine.start_threads()?;
    let name = output.to_string_lossy();
    let progress = Progress::new(name.as_ref());
    let index = Index::make(&rasters, output, &progress)?;
    progress.finish();
    let grid = Indexed::open(output, 0)?.grid(&index.whole())?;
    for warning in raster_warnings(&rasters[0], &grid, index.height_factor) {
        tell(format_args!("{warning}"));
    }
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
