//! `antumbra run`: one task of a plan, or all.

use std::cell::OnceCell;
use std::collections::hash_map::RandomState;
use std::fs::{self, File};
use std::hash::{BuildHasher, Hasher};
use std::path::{Path, PathBuf};
use std::time::Instant;

use antumbra_image::atomic_write;
use antumbra_lab::count;
use antumbra_load::MemorySize;
use antumbra_raster::{Grid, Quantity};
use antumbra_terrain::Tile;
use antumbra_tiles::Indexed;

use super::make::parse;
use super::{Input, Part, Plan, RECEIPT, Receipt, State, Task, checksum, sum_text};
use crate::args::{Command, RunArgs};
use crate::bake::tile::{self, TileWork};
use crate::bake::{self, run_tile};
use crate::exit::{Failure, Loudness, quietly, tell};
use crate::output::text;
use crate::version::VERSION;
use crate::{interrupt, render};

/// Most cells on a side of what is computed at once, where a tile needs nothing of others but heights.
pub const PART: usize = 1024;

/// Runs the command.
pub fn run(args: &RunArgs, memory: MemorySize) -> Result<(), Failure> {
    let plan = Plan::read(&args.plan, &args.task)?;
    args.machine.start_threads()?;
    fs::create_dir_all(plan.folder()).map_err(Failure::work)?;
    let runner = Runner {
        plan: &plan,
        memory,
        raster: OnceCell::new(),
    };
    let (mut done, mut before) = (0, 0);
    for task in &plan.tasks {
        interrupt::check()?;
        match plan.state(task)? {
            State::Done => before += 1,
            _ => {
                runner.run(task)?;
                done += 1;
            }
        }
    }
    let before = match before {
        0 => String::new(),
        before => format!("; {} were done before", count(before)),
    };
    tell(format_args!(
        "{}: {} tasks done{before}",
        plan.path.display(),
        count(done)
    ));
    Ok(())
}

/// Runs tasks.
struct Runner<'a> {
    plan: &'a Plan,
    memory: MemorySize,
    raster: OnceCell<Indexed>,
}

/// A folder that is removed at the end.
struct Scratch(PathBuf);

impl Scratch {
    fn new(folder: &Path, id: &str) -> Result<Self, Failure> {
        // Machines that share the folder may have processes of the same number.
        let number = RandomState::new().build_hasher().finish();
        let path = folder.join(format!(".{id}.{number:016x}"));
        fs::create_dir_all(&path).map_err(Failure::work)?;
        Ok(Self(path))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // What is left is harmless.
        let _ = fs::remove_dir_all(&self.0);
    }
}

impl Runner<'_> {
    fn run(&self, task: &Task) -> Result<(), Failure> {
        let (plan, start) = (self.plan, Instant::now());
        for (id, needed) in task
            .after
            .iter()
            .filter_map(|id| plan.needed.get_key_value(id))
        {
            let state = match plan.state(needed)? {
                State::Done => continue,
                State::Missing => "is not there",
                State::Stale => "is of another plan",
                State::Disagreeing => "is damaged",
            };
            return Err(Failure::Work(format!(
                "{}: it needs the result of {id}, which {state}; run that first: antumbra run {} --task {id}",
                task.id,
                plan.path.display()
            )));
        }
        for input in &task.inputs {
            let path = plan.beside(&input.path);
            let (_, found) = checksum(&path)?;
            if found != input.xxh3 {
                return Err(Failure::Data(format!(
                    "{} has the checksum {found}, and when the plan was made {}; make the plan again",
                    path.display(),
                    input.xxh3
                )));
            }
        }
        let result = plan.result(task);
        let scratch = Scratch::new(&plan.folder(), &task.id)?;
        // The unfinished work of a share has a name of its own, with which the same task goes on, unless it goes on elsewhere.
        let lock = match task.part {
            Part::Shard(_) => Some(File::create(
                plan.folder().join(format!(".{}.lock", task.id)),
            )),
            _ => None,
        };
        let lock = lock.transpose().map_err(Failure::work)?;
        let own = match lock.as_ref().is_some_and(|lock| lock.try_lock().is_ok()) {
            true => plan.folder().join(format!("unfinished.{}", task.output)),
            false => scratch.0.join(&task.output),
        };
        let mut inputs = task.inputs.clone();
        match task.part {
            Part::Tile(tile) => self.tile(task, tile_of(tile), (&own, &scratch.0))?,
            Part::Sweep { tile, quarter } => self.sweep(task, tile_of(tile), (quarter, &own))?,
            Part::Shard(shard) => self.shard(shard, &own)?,
        }
        if let Some(raster) = self.raster.get() {
            let known = |path: &Path| inputs.iter().any(|input| input.path == path);
            let files = raster
                .read_files()
                .into_iter()
                .map(|number| &raster.index().files[number]);
            let more: Vec<Input> = files
                .filter(|file| !known(&file.path))
                .map(|file| Input {
                    path: file.path.clone(),
                    xxh3: sum_text(file.xxh3),
                })
                .collect();
            inputs.extend(more);
        }
        let (bytes, xxh3) = checksum(&own)?;
        let key = plan.key(task)?;
        let _writing = interrupt::writing();
        if let Some(other) = plan.receipt(&task.id).filter(|other| other.key == key) {
            let is_there = checksum(&result)
                .is_ok_and(|found| found == (other.bytes, other.output.xxh3.clone()));
            if is_there && other.output.xxh3 != xxh3 {
                return Err(Failure::Work(format!(
                    "{}: its result has the checksum {xxh3}, and another run of the same task found {}; the other one is left as it is",
                    task.id, other.output.xxh3
                )));
            }
        }
        fs::rename(&own, &result).map_err(Failure::work)?;
        let receipt = Receipt {
            schema: RECEIPT.to_owned(),
            task: task.id.clone(),
            key,
            output: Input {
                path: task.output.clone().into(),
                xxh3,
            },
            bytes,
            inputs,
            seconds: start.elapsed().as_secs_f64(),
            version: VERSION.to_owned(),
        };
        let text = serde_json::to_string(&receipt).map_err(Failure::work)?;
        atomic_write(plan.receipt_path(&task.id), |file| writeln!(file, "{text}"))?;
        Ok(())
    }

    /// The raster, which all tasks of a run have.
    fn raster(&self) -> Result<&Indexed, Failure> {
        if let Some(raster) = self.raster.get() {
            return Ok(raster);
        }
        let raster = tile::open(&self.plan.beside(&self.plan.head.scene), self.memory)?;
        Ok(self.raster.get_or_init(|| raster))
    }

    fn bake(&self, work: &TileWork<'_>, output: &Path) -> Result<(), Failure> {
        let output = text(output);
        let command = parse(self.plan.command(), &["-o", &output])?;
        match &command {
            // What there is to say was said when the plan was made.
            Command::Bake(bake) => quietly(Loudness::Quiet, || {
                run_tile(bake.args().0, self.memory, work)
            }),
            _ => Err(Failure::usage("a task of tiles is a bake")),
        }
    }

    /// Computes a tile, part by part if it is large and needs no sweeps.
    fn tile(
        &self,
        task: &Task,
        tile: Tile,
        (output, scratch): (&Path, &Path),
    ) -> Result<(), Failure> {
        let raster = self.raster()?;
        let sweeps: Vec<PathBuf> = (0..4)
            .map(|quarter| {
                self.plan
                    .folder()
                    .join(format!("{}q{quarter}.sweep", task.id))
            })
            .collect();
        let is_small = tile.size.iter().all(|&cells| cells <= PART);
        if is_small || !task.after.is_empty() {
            return self.bake(&TileWork::new(raster, tile, (None, &sweeps)), output);
        }
        let [[name, unit]] = &self.plan.head.bands[..] else {
            return self.bake(&TileWork::new(raster, tile, (None, &sweeps)), output);
        };
        let mut values = vec![f32::NAN; tile.size[0] * tile.size[1]];
        for top in (0..tile.size[1]).step_by(PART) {
            for left in (0..tile.size[0]).step_by(PART) {
                let size = [PART.min(tile.size[0] - left), PART.min(tile.size[1] - top)];
                let at = [tile.at[0] + left as i64, tile.at[1] + top as i64];
                let path = scratch.join("part.npy");
                self.bake(
                    &TileWork::new(raster, Tile { at, size }, (None, &[])),
                    &path,
                )?;
                let bytes = fs::read(&path).map_err(Failure::work)?;
                // Numbers of single precision are at the end.
                let numbers = &bytes[bytes.len() - 4 * size[0] * size[1]..];
                let rows = numbers.chunks_exact(4 * size[0]);
                for (row, numbers) in rows.enumerate() {
                    let own = &mut values[(top + row) * tile.size[0] + left..][..size[0]];
                    let (words, _) = numbers.as_chunks::<4>();
                    own.iter_mut()
                        .zip(words)
                        .for_each(|(own, word)| *own = f32::from_le_bytes(*word));
                }
            }
        }
        let grid: Grid = raster.grid(&tile)?;
        bake::write_values(output, &grid, &values, &[Quantity { name, unit }])
    }

    fn sweep(&self, task: &Task, tile: Tile, part: (usize, &Path)) -> Result<(), Failure> {
        let ahead: Vec<PathBuf> = task
            .after
            .iter()
            .map(|id| self.plan.folder().join(format!("{id}.sweep")))
            .collect();
        let work = TileWork::new(self.raster()?, tile, (Some(part), &ahead));
        self.bake(&work, Path::new("tile.tif"))
    }

    fn shard(&self, [index, of]: [u32; 2], output: &Path) -> Result<(), Failure> {
        let (shard, output) = (format!("{index}/{of}"), text(output));
        match parse(self.plan.command(), &["--shard", &shard, "-o", &output])? {
            Command::Render(mut args) => {
                args.resume = true;
                render::run(&args, self.memory)
            }
            Command::Bake(bake) => bake::run(bake.args().0, self.memory, None),
            _ => Err(Failure::usage("a share is of a rendering or a bake")),
        }
    }
}

fn tile_of([column, row, columns, rows]: [usize; 4]) -> Tile {
    Tile {
        at: [column as i64, row as i64],
        size: [columns, rows],
    }
}
