//! `antumbra plan`: the tasks of a job.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use antumbra_image::atomic_write;
use antumbra_lab::count;
use antumbra_load::MemorySize;
use antumbra_terrain::Tile;
use clap::Parser;

use super::{Bill, Head, Input, PLAN, Part, Task, bill, checksum, sum_text};
use crate::args::{Cli, Command, PlanArgs};
use crate::bake::BakeCommand;
use crate::bake::tile::{self, Tiling, is_index};
use crate::exit::{Failure, tell};
use crate::output::{Files, beside, text};
use crate::{interrupt, json};

/// Runs the command.
pub fn make(args: &PlanArgs, memory: MemorySize) -> Result<(), Failure> {
    let mut files = Files::default();
    let is_built_in = args.scene.to_string_lossy().starts_with("builtin:");
    if !is_built_in {
        files.reads("the scene", &args.scene)?;
    }
    files.writes("--output", &args.output)?;
    files.check()?;
    let folder = match &args.folder {
        Some(folder) => folder.clone(),
        None => beside(&args.output, ".results").ok_or_else(|| {
            Failure::name(&args.output, "a plan is a file, beside which results go")
        })?,
    };
    let scene = match is_built_in {
        true => args.scene.clone(),
        false => from(&args.output, &args.scene)?,
    };
    let mut head = Head {
        schema: PLAN.to_owned(),
        scene,
        command: args.command.clone(),
        folder: from(&args.output, &folder)?,
        bands: Vec::new(),
        levels: Vec::new(),
        bill: Bill::default(),
    };
    let tasks = match is_index(&args.scene) {
        true => of_tiles(args, memory, &mut head)?,
        false => of_shards(args, &mut head)?,
    };
    let sum = |of: fn(&Task) -> Option<f64>| tasks.iter().map(of).sum::<Option<f64>>();
    head.bill.tasks = tasks.len();
    head.bill.core_hours = sum(|task| task.seconds).map(|seconds| seconds / 3600.0);
    head.bill.memory = tasks.iter().filter_map(|task| task.memory).max();
    let _writing = interrupt::writing();
    atomic_write(&args.output, |file| {
        serde_json::to_writer(&mut *file, &head)?;
        for task in &tasks {
            file.write_all(b"\n")?;
            serde_json::to_writer(&mut *file, task)?;
        }
        file.write_all(b"\n")
    })?;
    json::write(&head.bill, args.json.as_ref())?;
    let Bill {
        tasks,
        cells,
        core_hours,
        memory,
        bytes_read,
        bytes_written,
    } = &head.bill;
    let mut words = format!("{}: {} tasks", args.output.display(), count(*tasks as u64));
    if head.levels.len() > 1 {
        words += &format!(
            " in {} levels, of which each needs the one before",
            head.levels.len()
        );
    }
    if *cells > 0 {
        let giga = |bytes: u64| bytes as f64 / 1e9;
        words += &format!(
            ", {} cells; it reads {:.2} GB and writes {:.2} GB",
            count(*cells),
            giga(*bytes_read),
            giga(*bytes_written)
        );
    }
    if let (Some(hours), Some(memory)) = (core_hours, memory) {
        words += &format!(
            "; about {} of one core, and at most {:.2} GB of memory for a task",
            bill::time(3600.0 * hours),
            *memory as f64 / 1e9
        );
    }
    tell(format_args!("{words}"));
    Ok(())
}

/// A file as a plan names it: relative to the folder of the plan if it is in it.
fn from(plan: &Path, path: &Path) -> Result<PathBuf, Failure> {
    let absolute = |path| std::path::absolute(path).map_err(Failure::work);
    let (plan, path) = (absolute(plan)?, absolute(path)?);
    let folder = plan.parent().unwrap_or(Path::new(""));
    Ok(path
        .strip_prefix(folder)
        .map_or_else(|_| path.clone(), Path::to_path_buf))
}

/// The command of a plan, with an output and more.
pub fn parse(line: Vec<String>, more: &[&str]) -> Result<Command, Failure> {
    let line = line
        .into_iter()
        .chain(more.iter().map(|&flag| flag.to_owned()));
    let cli = Cli::try_parse_from(line).map_err(|error| Failure::Usage(error.to_string()))?;
    cli.command
        .ok_or_else(|| Failure::usage("a plan needs a command"))
}

/// The command line of a plan that is made, without an output.
fn line(args: &PlanArgs) -> Vec<String> {
    let (name, flags) = args
        .command
        .split_first()
        .map_or(("", &[][..]), |(name, flags)| (&**name, flags));
    let line = ["antumbra", name].map(str::to_owned).into_iter();
    line.chain([text(&args.scene)])
        .chain(flags.iter().cloned())
        .collect()
}

/// Names flags that would write files of their own, and makes names of files absolute. Returns the files that are read.
fn settle_files(bake: &BakeCommand, command: &mut [String]) -> Result<Vec<Input>, Failure> {
    let [written, read] = bake.args().0.files();
    if let Some((flag, _)) = written.iter().find(|(_, path)| path.is_some()) {
        return Err(Failure::Usage(format!(
            "{flag}: every task of a plan writes one file only"
        )));
    }
    if bake.args().0.shared().2.is_some() {
        return Err(Failure::usage(
            "--json: every task of a plan writes one file only",
        ));
    }
    let mut inputs = Vec::new();
    for path in read.into_iter().filter_map(|(_, path)| path) {
        let absolute = std::path::absolute(path).map_err(Failure::work)?;
        for word in command
            .iter_mut()
            .filter(|word| Path::new(word.as_str()) == path)
        {
            *word = text(&absolute);
        }
        let (_, xxh3) = checksum(path)?;
        inputs.push(Input {
            path: absolute,
            xxh3,
        });
    }
    Ok(inputs)
}

/// Shares of a rendering or of a bake.
fn of_shards(args: &PlanArgs, head: &mut Head) -> Result<Vec<Task>, Failure> {
    let command = parse(line(args), &["-o", "0.part", "--shard", "0/1"])?;
    let mut inputs = match &command {
        Command::Render(_) => Vec::new(),
        Command::Bake(bake) => settle_files(bake, &mut head.command)?,
        _ => {
            return Err(Failure::usage(
                "a plan is for render and for commands that bake",
            ));
        }
    };
    if args.scene.is_file() {
        let (_, xxh3) = checksum(&args.scene)?;
        inputs.insert(
            0,
            Input {
                path: head.scene.clone(),
                xxh3,
            },
        );
    }
    head.levels = vec![args.tasks as usize];
    let task = |index: u32| {
        let id = format!("s{index:05}");
        Task {
            output: format!("{id}.part"),
            id,
            part: Part::Shard([index, args.tasks]),
            after: Vec::new(),
            inputs: inputs.clone(),
            seconds: None,
            memory: None,
        }
    };
    Ok((0..args.tasks).map(task).collect())
}

/// Tiles of a raster.
fn of_tiles(args: &PlanArgs, memory: MemorySize, head: &mut Head) -> Result<Vec<Task>, Failure> {
    let Command::Bake(bake) = parse(line(args), &["-o", "tile.tif"])? else {
        return Err(Failure::usage(
            "tiles of an index are for horizon and sun with --cells",
        ));
    };
    let mut more = settle_files(&bake, &mut head.command)?;
    bake.args().0.check()?;
    let raster = tile::open(&args.scene, memory)?;
    let index = raster.index();
    let Tiling { directions, bands } = bake.args().0.tiling(&raster)?;
    head.bands = bands;
    let (_, xxh3) = checksum(&args.scene)?;
    more.insert(
        0,
        Input {
            path: head.scene.clone(),
            xxh3,
        },
    );
    let side = args.tile as usize;
    let [across, down] = [index.columns, index.rows].map(|cells| cells.div_ceil(side));
    let tile = |[column, row]: [usize; 2]| Tile {
        at: [(column * side) as i64, (row * side) as i64],
        size: [
            side.min(index.columns - column * side),
            side.min(index.rows - row * side),
        ],
    };
    let id = |[column, row]: [usize; 2]| format!("r{row:04}c{column:04}");
    // Files by the tiles that they touch.
    let mut touching: HashMap<[usize; 2], Vec<Input>> = HashMap::new();
    let mut bytes_of: HashMap<[usize; 2], u64> = HashMap::new();
    for file in &index.files {
        let ends = [0, 1].map(|axis| (file.at[axis] + file.size[axis] - 1) / side);
        for row in file.at[1] / side..=ends[1] {
            for column in file.at[0] / side..=ends[0] {
                let input = Input {
                    path: from(&args.output, &file.path)?,
                    xxh3: sum_text(file.xxh3),
                };
                touching.entry([column, row]).or_default().push(input);
                *bytes_of.entry([column, row]).or_default() += file.bytes;
            }
        }
    }
    let places: Vec<[usize; 2]> = (0..down)
        .flat_map(|row| (0..across).map(move |column| [column, row]))
        .collect();
    let corners = |Tile { at, size }: Tile| [at[0] as usize, at[1] as usize, size[0], size[1]];
    let inputs = |place: &[usize; 2]| {
        let own = touching.get(place).into_iter().flatten().cloned();
        more.iter().cloned().chain(own).collect::<Vec<Input>>()
    };
    let rates = bill::rates(&bake, &raster, &directions, memory)?;
    let mut tasks = Vec::new();
    let quarters = tile::quarters(&directions);
    for level in 0..across + down - 1 {
        let before = tasks.len();
        for (quarter, steps) in &quarters {
            for place in &places {
                let own = tile(*place);
                // Columns and rows to the corner at which lines of the quarter begin.
                let from = |axis: usize, count: usize| match steps.iter().any(|step| step[axis] > 0)
                {
                    true => count - 1 - place[axis],
                    false => place[axis],
                };
                if from(0, across) + from(1, down) != level {
                    continue;
                }
                let near: Vec<[usize; 2]> = neighbours(*place, [across, down]).collect();
                let tiles: Vec<Tile> = near.iter().map(|place| tile(*place)).collect();
                let ahead: HashSet<usize> = steps
                    .iter()
                    .flat_map(|step| own.ahead(*step, &tiles))
                    .collect();
                let mut after: Vec<String> = ahead
                    .into_iter()
                    .map(|at| format!("{}q{quarter}", id(near[at])))
                    .collect();
                after.sort();
                let name = format!("{}q{quarter}", id(*place));
                tasks.push(Task {
                    output: format!("{name}.sweep"),
                    id: name,
                    part: Part::Sweep {
                        tile: corners(own),
                        quarter: *quarter,
                    },
                    after,
                    inputs: inputs(place),
                    seconds: rates.sweep(&own, steps.len()),
                    memory: Some(bill::memory_of_sweep(&own, steps.len())),
                });
            }
        }
        head.levels.push(tasks.len() - before);
    }
    let before = tasks.len();
    for place in places.iter().filter(|place| touching.contains_key(*place)) {
        let (own, name) = (tile(*place), id(*place));
        tasks.push(Task {
            output: format!("{name}.tif"),
            part: Part::Tile(corners(own)),
            after: quarters
                .iter()
                .map(|(quarter, _)| format!("{name}q{quarter}"))
                .collect(),
            id: name,
            inputs: inputs(place),
            seconds: rates.tile(&own),
            memory: Some(rates.memory_of_tile(&own)),
        });
        head.bill.bytes_read += bytes_of.get(place).copied().unwrap_or(0);
        let cells = own.size[0] as u64 * own.size[1] as u64;
        head.bill.bytes_written += 4 * cells * head.bands.len() as u64;
        head.bill.cells += cells;
    }
    head.levels.push(tasks.len() - before);
    head.levels.retain(|&count| count > 0);
    Ok(tasks)
}

/// The tile and those around it.
fn neighbours(
    [column, row]: [usize; 2],
    [across, down]: [usize; 2],
) -> impl Iterator<Item = [usize; 2]> {
    let rows = row.saturating_sub(1)..(row + 2).min(down);
    rows.flat_map(move |row| {
        (column.saturating_sub(1)..(column + 2).min(across)).map(move |column| [column, row])
    })
}
