//! `antumbra merge` of plans: results as one file.

use std::path::{Path, PathBuf};

use antumbra_image::atomic_write;
use antumbra_load::MemorySize;
use antumbra_raster::{EXTENSIONS, Quantity, VrtTile, read_numbers, vrt_text};

use super::{PLAN, Part, Plan, State};
use crate::args::MergeArgs;
use crate::bake::{self, tile};
use crate::exit::{Failure, tell};
use crate::input::{self, check_answers};
use crate::output::{Files, is_one_of};
use crate::{archive, interrupt};

/// Whether a file is a plan, by its first bytes.
pub fn is_plan(path: &Path) -> bool {
    archive::starts_with(path, format!("{{\"schema\":\"{PLAN}\"").as_bytes())
}

/// Values of a raster of so many columns and rows, of files with parts of it; NaN between them. Numbers are as they were written,
/// whatever the unit of heights is in their coordinate system.
pub fn join(size: [usize; 2], parts: &[VrtTile], memory: MemorySize) -> Result<Vec<f32>, Failure> {
    let bytes = 4 * size[0] as u64 * size[1] as u64;
    check_answers("results", 2 * bytes)?;
    let mut values = vec![f32::NAN; size[0] * size[1]];
    for part in parts {
        interrupt::check()?;
        let found = read_numbers(&part.path, memory.bytes());
        let found = found.map_err(|error| Failure::Data(error.to_string()))?;
        if [found.grid.width, found.grid.height] != part.size {
            return Err(Failure::Data(format!(
                "{}: it has another size than in the plan",
                part.path.display()
            )));
        }
        let ([left, top], [columns, _]) = (part.at, part.size);
        for (row, found) in found.values.chunks_exact(columns).enumerate() {
            let own = &mut values[(top + row) * size[0] + left..][..columns];
            let cells = own.iter_mut().zip(found);
            cells.for_each(|(own, &found)| *own = found as f32);
        }
    }
    Ok(values)
}

impl Plan {
    /// Refuses outputs as which results cannot be joined.
    pub fn check_outputs(&self, outputs: &[PathBuf]) -> Result<(), Failure> {
        let is_city = self
            .tasks
            .iter()
            .any(|task| matches!(task.part, Part::File(_)));
        let (known, reason) = match self.head.bands.len() {
            0 if is_city => (&["csv"][..], "tables of a city are joined as a .csv"),
            0 => return Ok(()),
            1 => (
                &EXTENSIONS[..],
                "tiles are joined as a .tif, .asc, .npy or .vrt",
            ),
            _ => (
                &["vrt"][..],
                "tiles with several bands are joined as a .vrt, which names them",
            ),
        };
        let mut outputs = outputs.iter();
        let bad = outputs.find(|output| !is_one_of(output, known));
        bad.map_or(Ok(()), |output| Err(Failure::name(output, reason)))
    }
}

/// Writes tables one after the other, with the names of columns once.
fn join_tables(tables: &[PathBuf], output: &Path) -> Result<(), Failure> {
    let _writing = interrupt::writing();
    let mut failure = None;
    let written = atomic_write(output, |file| {
        for (number, table) in tables.iter().enumerate() {
            let text = input::text(table).map_err(|error| {
                failure = Some(error);
                std::io::Error::from(std::io::ErrorKind::Other)
            })?;
            let rows = text.split_once('\n').map_or("", |(_, rows)| rows);
            let own = if number == 0 { &text[..] } else { rows };
            file.write_all(own.as_bytes())?;
        }
        Ok(())
    });
    failure.map_or(Ok(()), Err)?;
    written?;
    let (number, output) = (tables.len(), output.display());
    tell(format_args!("joined {number} tables; wrote {output}"));
    Ok(())
}

/// Joins the results of a plan. Returns the parts of a rendering or a bake, which their own command joins.
pub fn merge(args: &MergeArgs, memory: MemorySize) -> Result<Option<Vec<PathBuf>>, Failure> {
    let [path] = &args.parts[..] else {
        return Err(Failure::usage("a plan is merged by itself"));
    };
    let plan = Plan::read(path, &[])?;
    plan.check_outputs(&args.output)?;
    let (mut paths, mut tiles, mut tables) = (Vec::new(), Vec::new(), Vec::new());
    for task in &plan.tasks {
        interrupt::check()?;
        if plan.state(task, true)? != State::Done {
            let name = path.display();
            return Err(Failure::Work(format!(
                "{name}: the task {} is not done; antumbra check {name} names all of these",
                task.id
            )));
        }
        let path = std::path::absolute(plan.result(task)).map_err(Failure::work)?;
        match task.part {
            Part::Sweep { .. } => {}
            Part::Shard(_) => paths.push(path),
            Part::File(_) => tables.push(path),
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
    if !tables.is_empty() {
        for output in &args.output {
            join_tables(&tables, output)?;
        }
        return Ok(None);
    }
    let raster = tile::open(&plan.scene(), memory)?;
    let whole = raster.index().whole();
    let grid = raster.grid(&whole)?;
    let _writing = interrupt::writing();
    for output in &args.output {
        if is_one_of(output, &["vrt"]) {
            let path = std::path::absolute(output).map_err(Failure::work)?;
            let text = vrt_text(&path, &grid, &bands, &tiles);
            atomic_write(output, |file| file.write_all(text.as_bytes()))?;
        } else {
            let values = join(whole.size, &tiles, memory)?;
            bake::write_values(output, &grid, &values, &bands)?;
        }
        tell(format_args!(
            "joined {} tiles; wrote {}",
            tiles.len(),
            output.display()
        ));
    }
    Ok(None)
}
