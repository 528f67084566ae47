//! `antumbra merge` of plans: results as one file.

use std::path::{Path, PathBuf};

use antumbra_image::atomic_write;
use antumbra_load::MemorySize;
use antumbra_raster::{Purpose, Quantity, VrtTile, read_all, vrt_text};

use super::{PLAN, Part, Plan, State};
use crate::args::MergeArgs;
use crate::bake::{self, tile};
use crate::exit::{Failure, tell};
use crate::output::{Files, is_one_of};
use crate::{archive, interrupt};

/// Whether a file is a plan, by its first bytes.
pub fn is_plan(path: &Path) -> bool {
    archive::starts_with(path, format!("{{\"schema\":\"{PLAN}\"").as_bytes())
}

/// Joins the results of a plan. Returns the parts of a rendering or a bake, which their own command joins.
pub fn merge(args: &MergeArgs, memory: MemorySize) -> Result<Option<Vec<PathBuf>>, Failure> {
    let [path] = &args.parts[..] else {
        return Err(Failure::usage("a plan is merged by itself"));
    };
    let plan = Plan::read(path, &[])?;
    let (mut paths, mut tiles) = (Vec::new(), Vec::new());
    for task in &plan.tasks {
        interrupt::check()?;
        if plan.state(task)? != State::Done {
            let name = path.display();
            return Err(Failure::Work(format!(
                "{name}: the task {} is not done; antumbra check {name} names all of these",
                task.id
            )));
        }
        let path = plan.result(task);
        match task.part {
            Part::Sweep { .. } => {}
            Part::Shard(_) => paths.push(path),
            Part::Tile([column, row, columns, rows]) => tiles.push(VrtTile {
                path,
                at: [column, row],
                size: [columns, rows],
            }),
        }
    }
    if !paths.is_empty() {
        return Ok(Some(paths));
    }
    let bands: Vec<Quantity<'_>> = (plan.head.bands.iter())
        .map(|[name, unit]| Quantity { name, unit })
        .collect();
    let mut files = Files::default();
    files.reads("the plan", path)?;
    for output in &args.output {
        files.writes("--output", output)?;
    }
    files.check()?;
    let _writing = interrupt::writing();
    for output in &args.output {
        if is_one_of(output, &["vrt"]) {
            let raster = tile::open(&plan.beside(&plan.head.scene), memory)?;
            let whole = raster.index().whole();
            let grid = raster.grid(&whole)?;
            let text = vrt_text(output, &grid, &bands, &tiles);
            atomic_write(output, |file| file.write_all(text.as_bytes()))?;
        } else if bands.len() == 1 {
            let paths: Vec<PathBuf> = tiles.iter().map(|tile| tile.path.clone()).collect();
            let mosaic = read_all(&paths, memory.bytes(), Purpose::Values);
            let mosaic = mosaic
                .map_err(|error| Failure::Scene(error.to_string()))?
                .raster;
            let values: Vec<f32> = mosaic.values.iter().map(|&value| value as f32).collect();
            bake::write_values(output, &mosaic.grid, &values, &bands)?;
        } else {
            let reason = format!(
                "tiles with {} bands are joined as a .vrt, which names them",
                bands.len()
            );
            return Err(Failure::name(output, reason));
        }
        tell(format_args!(
            "joined {} tiles; wrote {}",
            tiles.len(),
            output.display()
        ));
    }
    Ok(None)
}
