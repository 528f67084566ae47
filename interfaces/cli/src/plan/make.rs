//! `antumbra plan`: the tasks of a job.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::{Path, PathBuf};

use antumbra_lab::count;
use antumbra_load::MemorySize;
use antumbra_raster::is_raster;
use antumbra_terrain::Tile;
use antumbra_tiles::{City, Index, Piece};
use clap::Parser;

use super::bill::{self, Rates};
use super::{Bill, Head, Input, PLAN, Part, Plan, Task, checksum, from, line, sum_text};
use crate::args::{Cli, Command, PlanArgs};
use crate::bake::BakeCommand;
use crate::bake::city::is_city;
use crate::bake::tile::{self, is_index};
use crate::exit::{Failure, tell};
use crate::farm::{check_flags, is_built_in};
use crate::output::{Files, beside, text};
use crate::{json, scenes};

/// Makes a plan, which is not written.
pub fn planned(args: &PlanArgs, memory: MemorySize) -> Result<Plan, Failure> {
    if args.scene == Path::new(scenes::STDIN) {
        let reason = "a plan names its scene: tasks need a file, not the standard input";
        return Err(Failure::usage(reason));
    }
    if !is_built_in(&args.scene) && !args.scene.exists() {
        let scene = args.scene.display();
        return Err(Failure::Usage(format!("there is no file {scene}")));
    }
    let of_machine = |word: &&String| {
        ["--max-memory", "--threads"].contains(&word.split('=').next().unwrap_or_default())
    };
    if let Some(flag) = args.command.iter().find(of_machine) {
        return Err(Failure::Usage(format!(
            "{flag}: machines differ, so `run` has this flag and a plan does not; with Slurm, --sbatch=--cpus-per-task=N and --sbatch=--mem=SIZE"
        )));
    }
    let folder = match &args.folder {
        Some(folder) => folder.clone(),
        None => beside(&args.output, ".results").ok_or_else(|| {
            Failure::name(&args.output, "a plan is a file, beside which results go")
        })?,
    };
    let scene = match is_built_in(&args.scene) {
        true => args.scene.clone(),
        false => from(&args.output, &args.scene)?,
    };
    let mut head = Head {
        schema: PLAN.to_owned(),
        scene,
        command: args.command.clone(),
        folder: from(&args.output, &folder)?,
        bands: Vec::new(),
        chunks: [Vec::new(), Vec::new()],
        levels: Vec::new(),
        bill: Bill::default(),
    };
    let name = args.command.first().map_or("", |name| name);
    if name != "render" && !BakeCommand::NAMES.contains(&name) {
        let names = BakeCommand::NAMES.join(", ");
        let reason = format!("{name}: a plan is for render, {names}");
        return Err(Failure::Usage(reason));
    }
    let tasks = match is_index(&args.scene) {
        true if is_city(&args.scene) => of_files(args, &mut head)?,
        true => of_tiles(args, memory, &mut head)?,
        false => of_shards(args, memory, &mut head)?,
    };
    let sum = |of: fn(&Task) -> Option<f64>| tasks.iter().map(of).sum::<Option<f64>>();
    head.bill.tasks = tasks.len();
    head.bill.core_hours = sum(|task| task.seconds).map(|seconds| seconds / 3600.0);
    head.bill.memory = tasks.iter().filter_map(|task| task.memory).max();
    Ok(Plan {
        path: args.output.clone(),
        head,
        tasks,
        needed: HashMap::new(),
    })
}

/// Runs the command.
pub fn make(args: &PlanArgs, memory: MemorySize) -> Result<(), Failure> {
    let mut files = Files::default();
    if !is_built_in(&args.scene) {
        files.reads("the scene", &args.scene)?;
    }
    files.writes("--output", &args.output)?;
    files.check()?;
    let plan = planned(args, memory)?;
    plan.write()?;
    let head = &plan.head;
    json::write(&head.bill, args.json.as_ref())?;
    let Bill {
        tasks,
        cells,
        core_hours,
        memory,
        bytes_read,
        bytes_written,
    } = &head.bill;
    let things = if *tasks == 1 { "task" } else { "tasks" };
    let mut words = format!(
        "{}: {} {things}",
        args.output.display(),
        count(*tasks as u64)
    );
    if head.levels.len() > 1 {
        words += &format!(
            " in {} levels, of which each needs the one before",
            head.levels.len()
        );
    }
    if *cells > 0 {
        let giga = |bytes: u64| bytes as f64 / 1e9;
        words += &format!(
            ", {} cells; it reads {:.2} GB at least and writes {:.2} GB",
            count(*cells),
            giga(*bytes_read),
            giga(*bytes_written)
        );
    }
    if *cells > 0 && core_hours.is_none() {
        words += "; how long it takes is not estimated, since its files are not here";
    }
    if let (Some(hours), Some(memory)) = (core_hours, memory) {
        words += &format!(
            "; about {} of one core, and {:.2} GB of memory for a task at most",
            bill::time(3600.0 * hours),
            *memory as f64 / 1e9
        );
    }
    tell(format_args!("{words}"));
    Ok(())
}

/// The command of a plan, with an output and more. Its flags say how tolerant readers of scenes are from then on.
pub fn parse(line: Vec<String>, more: &[&str]) -> Result<Command, Failure> {
    let line = line
        .into_iter()
        .chain(more.iter().map(|&flag| flag.to_owned()));
    let cli = Cli::try_parse_from(line).map_err(|error| {
        let text = error.to_string();
        Failure::usage(text.strip_prefix("error: ").unwrap_or(&text))
    })?;
    if cli.strict || cli.skip_unsupported {
        scenes::set_tolerance(cli.strict, cli.skip_unsupported);
    }
    cli.command
        .ok_or_else(|| Failure::usage("a plan needs a command"))
}

/// Names flags that would write files of their own, and makes names of files absolute. Returns the files that are read.
fn settle_files(bake: &BakeCommand, command: &mut [String]) -> Result<Vec<Input>, Failure> {
    let [written, read] = bake.args().0.files();
    if let Some((flag, _)) = written.iter().find(|(_, path)| path.is_some()) {
        return Err(Failure::Usage(format!(
            "{flag}: every task of a plan writes one file only"
        )));
    }
    let (_, outputs, json, chunks) = bake.args().0.shared();
    let is_shared = chunks.shard.is_some_and(|shard| shard.count() > 1);
    if outputs.len() != 1 || json.is_some() || is_shared {
        let reason = "--output, --json, --shard: every task of a plan writes one file, which it names by itself";
        return Err(Failure::usage(reason));
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
        inputs.extend(inputs_of(&absolute, None)?);
    }
    Ok(inputs)
}

/// Files that are read under a name: of a folder, its rasters; of a scene, all that it is read from.
fn inputs_of(path: &Path, scene: Option<MemorySize>) -> Result<Vec<Input>, Failure> {
    let files = match scene {
        Some(memory) if !is_raster(path) => scenes::load_with_looks(path, memory)?.inputs,
        _ if path.is_dir() => {
            let files = antumbra_raster::files(&[path.to_path_buf()]);
            files.map_err(|error| Failure::Scene(error.to_string()))?
        }
        _ => vec![path.to_path_buf()],
    };
    let input = |path: PathBuf| {
        let (_, xxh3) = checksum(&path)?;
        Ok(Input { path, xxh3 })
    };
    files.into_iter().map(input).collect()
}

/// Shares of a rendering or of a bake.
fn of_shards(args: &PlanArgs, memory: MemorySize, head: &mut Head) -> Result<Vec<Task>, Failure> {
    let command = parse(
        line(&args.scene, &args.command),
        &["-o", "0.part", "--shard", "0/1"],
    )?;
    let mut inputs = match &command {
        Command::Render(render) => {
            check_flags(render)?;
            Vec::new()
        }
        Command::Bake(bake) => settle_files(bake, &mut head.command)?,
        _ => {
            return Err(Failure::usage(
                "a plan is for render and for commands that bake",
            ));
        }
    };
    if !is_built_in(&args.scene) {
        for Input { path, xxh3 } in inputs_of(&args.scene, Some(memory))? {
            let path = from(&args.output, &path)?;
            inputs.push(Input { path, xxh3 });
        }
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

/// Files of a city.
fn of_files(args: &PlanArgs, head: &mut Head) -> Result<Vec<Task>, Failure> {
    let Command::Bake(bake) = parse(line(&args.scene, &args.command), &["-o", "0.csv"])? else {
        return Err(Failure::usage("files of a city are for sun"));
    };
    let mut common = settle_files(&bake, &mut head.command)?;
    bake.args().0.check_city()?;
    bake.args().0.check()?;
    let city = City::read(&args.scene)?;
    let (_, xxh3) = checksum(&args.scene)?;
    let path = head.scene.clone();
    common.push(Input { path, xxh3 });
    head.levels = vec![city.files.len()];
    head.bill.bytes_read = city.files.iter().map(|file| file.bytes).sum();
    let task = |(number, file): (usize, &Piece)| {
        let id = format!("f{number:05}");
        let path = from(&args.output, &file.path)?;
        let xxh3 = sum_text(file.xxh3);
        Ok(Task {
            output: format!("{id}.csv"),
            id,
            part: Part::File(number),
            after: Vec::new(),
            inputs: [&common[..], &[Input { path, xxh3 }]].concat(),
            seconds: None,
            memory: None,
        })
    };
    city.files.iter().enumerate().map(task).collect()
}

/// Squares of a raster, and what they are made of.
struct Squares<'a> {
    side: usize,
    size: [usize; 2],
    /// Numbers of squares across and down.
    counts: [usize; 2],
    /// What all tasks read.
    common: Vec<Input>,
    /// Files that a square touches, and their bytes.
    files: HashMap<[usize; 2], (Vec<Input>, u64)>,
    rates: &'a Rates,
}

/// Least number of columns or rows of a square beside another one.
const LEAST: usize = 16;

impl<'a> Squares<'a> {
    fn new(
        args: &PlanArgs,
        index: &Index,
        common: Vec<Input>,
        rates: &'a Rates,
    ) -> Result<Self, Failure> {
        let (side, size) = (args.tile as usize, [index.columns, index.rows]);
        // What is left over goes to the last square if it is small.
        let count = |cells: usize| {
            cells.div_ceil(side) - usize::from(cells > side && (1..LEAST).contains(&(cells % side)))
        };
        let mut squares = Self {
            side,
            size,
            counts: size.map(count),
            common,
            files: HashMap::new(),
            rates,
        };
        for file in &index.files {
            let [last_column, last_row] =
                [0, 1].map(|axis| squares.at(axis, file.at[axis] + file.size[axis] - 1));
            for row in squares.at(1, file.at[1])..=last_row {
                for column in squares.at(0, file.at[0])..=last_column {
                    let path = from(&args.output, &file.path)?;
                    let xxh3 = sum_text(file.xxh3);
                    let (files, bytes) = squares.files.entry([column, row]).or_default();
                    files.push(Input { path, xxh3 });
                    *bytes += file.bytes;
                }
            }
        }
        Ok(squares)
    }

    /// Column or row of the square with a column or row of cells.
    fn at(&self, axis: usize, cell: usize) -> usize {
        (cell / self.side).min(self.counts[axis] - 1)
    }

    /// All squares, row by row.
    fn places(&self) -> impl Iterator<Item = [usize; 2]> + '_ {
        near([0, 0], self.counts.map(|count| count.saturating_sub(1)))
    }

    fn tile(&self, place: [usize; 2]) -> Tile {
        let cells = |axis: usize| match place[axis] + 1 == self.counts[axis] {
            true => self.size[axis] - place[axis] * self.side,
            false => self.side,
        };
        Tile {
            at: place.map(|place| (place * self.side) as i64),
            size: [cells(0), cells(1)],
        }
    }

    fn inputs(&self, place: [usize; 2]) -> Vec<Input> {
        let own = self.files.get(&place).map(|(files, _)| files);
        self.common
            .iter()
            .chain(own.into_iter().flatten())
            .cloned()
            .collect()
    }

    /// Rows and columns of squares.
    fn chunks(&self) -> [Vec<usize>; 2] {
        let sizes = |axis: usize| {
            let count = 0..self.counts[axis];
            count.map(|at| self.tile([at, at]).size[axis]).collect()
        };
        [sizes(1), sizes(0)]
    }

    /// The sweep of a quarter of the steps over a square.
    fn sweep(&self, place: [usize; 2], (quarter, steps): &(usize, Vec<[i32; 2]>)) -> Task {
        let (own, name) = (self.tile(place), format!("{}q{quarter}", id(place)));
        let least = place.map(|at| at.saturating_sub(1));
        let most = [0, 1].map(|axis| (place[axis] + 1).min(self.counts[axis] - 1));
        let near: Vec<[usize; 2]> = near(least, most).collect();
        let tiles: Vec<Tile> = near.iter().map(|&place| self.tile(place)).collect();
        let ahead = steps.iter().flat_map(|step| own.ahead(*step, &tiles));
        let after: BTreeSet<String> = ahead
            .map(|at| format!("{}q{quarter}", id(near[at])))
            .collect();
        Task {
            output: format!("{name}.sweep"),
            id: name,
            part: Part::Sweep {
                tile: corners(own),
                quarter: *quarter,
            },
            after: after.into_iter().collect(),
            inputs: self.inputs(place),
            seconds: self.rates.sweep(&own, steps.len()),
            memory: Some(bill::memory_of_sweep(&own, steps.len())),
        }
    }

    /// How many other squares lines of a quarter have passed, at most.
    fn level(&self, place: [usize; 2], steps: &[[i32; 2]]) -> usize {
        let passed = |axis: usize| match steps.iter().any(|step| step[axis] > 0) {
            true => self.counts[axis] - 1 - place[axis],
            false => place[axis],
        };
        passed(0) + passed(1)
    }
}

/// Columns and rows between two of them, both included, row by row.
fn near(least: [usize; 2], most: [usize; 2]) -> impl Iterator<Item = [usize; 2]> {
    let rows = least[1]..=most[1];
    rows.flat_map(move |row| (least[0]..=most[0]).map(move |column| [column, row]))
}

fn id([column, row]: [usize; 2]) -> String {
    format!("r{row:04}c{column:04}")
}

fn corners(Tile { at, size }: Tile) -> [usize; 4] {
    [at[0] as usize, at[1] as usize, size[0], size[1]]
}

/// Tiles of a raster.
fn of_tiles(args: &PlanArgs, memory: MemorySize, head: &mut Head) -> Result<Vec<Task>, Failure> {
    let Command::Bake(bake) = parse(line(&args.scene, &args.command), &["-o", "tile.tif"])? else {
        let reason =
            "tiles of an index are for horizon and sun with --cells, and visible --viewshed";
        return Err(Failure::usage(reason));
    };
    let mut common = settle_files(&bake, &mut head.command)?;
    bake.args().0.check()?;
    let raster = tile::open(&args.scene, memory)?;
    let tiling = bake.args().0.tiling(&raster)?;
    let (_, xxh3) = checksum(&args.scene)?;
    let path = head.scene.clone();
    common.insert(0, Input { path, xxh3 });
    let command = line(&args.scene, &args.command);
    let rates = Rates::measure(&command, &raster, &tiling, memory)?;
    let squares = Squares::new(args, raster.index(), common, &rates)?;
    let quarters = tile::quarters(&tiling.directions);
    let mut levels: BTreeMap<usize, Vec<Task>> = BTreeMap::new();
    for quarter in &quarters {
        for place in squares.places() {
            let level = levels.entry(squares.level(place, &quarter.1)).or_default();
            level.push(squares.sweep(place, quarter));
        }
    }
    let mut last = Vec::new();
    for place in squares.places() {
        let Some((_, bytes)) = squares.files.get(&place) else {
            continue;
        };
        let (own, name) = (squares.tile(place), id(place));
        last.push(Task {
            output: format!("{name}.tif"),
            part: Part::Tile(corners(own)),
            after: quarters
                .iter()
                .map(|(quarter, _)| format!("{name}q{quarter}"))
                .collect(),
            id: name,
            inputs: squares.inputs(place),
            seconds: rates.tile(&own),
            memory: Some(rates.memory_of_tile(&own)),
        });
        head.bill.bytes_read += bytes;
        let cells = own.size[0] as u64 * own.size[1] as u64;
        head.bill.bytes_written += 4 * cells * tiling.bands.len() as u64;
        head.bill.cells += cells;
    }
    head.chunks = squares.chunks();
    head.bands = tiling.bands;
    let levels: Vec<Vec<Task>> = levels.into_values().chain([last]).collect();
    head.levels = levels.iter().map(Vec::len).collect();
    Ok(levels.into_iter().flatten().collect())
}
