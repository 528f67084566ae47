//! `antumbra run`: one task of a plan, or all.

use std::cell::OnceCell;
use std::collections::hash_map::RandomState;
use std::ffi::OsString;
use std::fs::{self, File};
use std::hash::{BuildHasher, Hasher};
use std::path::{Path, PathBuf};
use std::time::Instant;

use antumbra_image::atomic_write;
use antumbra_lab::count;
use antumbra_load::MemorySize;
use antumbra_raster::{Quantity, VrtTile};
use antumbra_render::Snapshot;
use antumbra_terrain::Tile;
use antumbra_tiles::Indexed;

use super::make::parse;
use super::merge::join;
use super::{Input, Part, Plan, RECEIPT, Receipt, State, Task, checksum, from, line, sum_text};
use crate::args::{Command, RunArgs};
use crate::bake::city::Store;
use crate::bake::tile::{self, TileWork};
use crate::bake::{self, run_tile};
use crate::exit::{Failure, Loudness, quietly, tell};
use crate::output::text;
use crate::version::VERSION;
use crate::{interrupt, render};

/// Most cells on a side of what is computed at once, of sums over light.
pub const PART: usize = 1024;

/// Runs the command.
pub fn run(args: &RunArgs, memory: MemorySize) -> Result<(), Failure> {
    let plan = Plan::read(&args.plan, &args.task)?;
    args.threads.start()?;
    fs::create_dir_all(plan.folder()).map_err(Failure::work)?;
    let runner = Runner {
        plan: &plan,
        memory,
        raster: OnceCell::new(),
    };
    let (mut done, mut before) = (0, 0);
    for task in &plan.tasks {
        interrupt::check()?;
        match plan.state(task, true)? {
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
            // Sweeps read hulls of others, which have checksums of their own, and not the angles.
            let is_read = !matches!(task.part, Part::Sweep { .. });
            let state = match plan.state(needed, is_read)? {
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
        let lock = |end: &str| match task.part {
            Part::Shard(_) => {
                File::create(plan.folder().join(format!(".{}.{end}", task.id))).map(Some)
            }
            _ => Ok(None),
        };
        let [lock, last] = [lock("lock"), lock("last")];
        let (lock, last) = (lock.map_err(Failure::work)?, last.map_err(Failure::work)?);
        let own = match lock.as_ref().is_some_and(|lock| lock.try_lock().is_ok()) {
            true => plan.folder().join(format!("unfinished.{}", task.output)),
            false => scratch.0.join(&task.output),
        };
        let mut inputs = task.inputs.clone();
        match task.part {
            Part::Tile(tile) => self.tile(task, tile_of(tile), (&own, &scratch.0))?,
            Part::Sweep { tile, quarter } => self.sweep(task, tile_of(tile), (quarter, &own))?,
            Part::Shard(shard) => self.shard(shard, (&own, &scratch.0))?,
            Part::File(number) => self.file(number, &own)?,
        }
        if let Some(raster) = self.raster.get() {
            for number in raster.used_files() {
                let file = &raster.index().files[number];
                let path = from(&plan.path, &file.path)?;
                if inputs.iter().all(|input| input.path != path) {
                    let xxh3 = sum_text(file.xxh3);
                    inputs.push(Input { path, xxh3 });
                }
            }
        }
        let (bytes, xxh3) = checksum(&own)?;
        let key = plan.key(task)?;
        let _writing = interrupt::writing();
        // Runs of a share note other times, so that the result of one must not have the receipt of another. Where files have no locks,
        // that is found out by `check`.
        let _ = last.as_ref().map(File::lock);
        if let Some(other) = plan.receipt(&task.id).filter(|other| other.key == key) {
            let is_there = checksum(&result)
                .is_ok_and(|found| found == (other.bytes, other.output.xxh3.clone()));
            if is_there && other.output.xxh3 != xxh3 {
                if lock.is_some() && content(&own)? == content(&result)? {
                    return fs::remove_file(&own).map_err(Failure::work);
                }
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
        let raster = tile::open(&self.plan.scene(), self.memory)?;
        Ok(self.raster.get_or_init(|| raster))
    }

    fn bake(&self, work: &TileWork<'_>, output: &Path) -> Result<(), Failure> {
        let output = text(output);
        let command = parse(self.plan.line(), &["-o", &output])?;
        match &command {
            // What there is to say was said when the plan was made.
            Command::Bake(bake) => quietly(Loudness::Quiet, || {
                run_tile(bake.args().0, self.memory, work)
            }),
            _ => Err(Failure::usage("a task of tiles is a bake")),
        }
    }

    /// Computes a tile, part by part if it is large and takes much memory.
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
        // Only sums of light take much memory for each cell.
        let has_sums = self
            .plan
            .head
            .command
            .first()
            .is_some_and(|name| name == "sun");
        let is_small = tile.size.iter().all(|&cells| cells <= PART);
        let bands = match &self.plan.head.bands[..] {
            [[name, unit]] if has_sums && !is_small => [Quantity { name, unit }],
            _ => return self.bake(&TileWork::new(raster, tile, (None, &sweeps)), output),
        };
        let mut parts = Vec::new();
        for top in (0..tile.size[1]).step_by(PART) {
            for left in (0..tile.size[0]).step_by(PART) {
                let size = [PART.min(tile.size[0] - left), PART.min(tile.size[1] - top)];
                let at = [tile.at[0] + left as i64, tile.at[1] + top as i64];
                let path = scratch.join(format!("{top}-{left}.tif"));
                let part = Tile { at, size };
                self.bake(&TileWork::new(raster, part, (None, &[])), &path)?;
                let at = [left, top];
                parts.push(VrtTile { path, at, size });
            }
        }
        let values = join(tile.size, &parts, self.memory)?;
        let grid = raster.grid(&tile)?;
        bake::write_values(output, &grid, &values, &bands)
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

    fn file(&self, number: usize, output: &Path) -> Result<(), Failure> {
        let index = self.plan.scene();
        let store = Store::open(&index, self.memory)?;
        let missing = || Failure::Data(format!("{}: it has no file {number}", index.display()));
        let piece = store.city.files.get(number).ok_or_else(missing)?;
        let line = line(&piece.path, &self.plan.head.command);
        match parse(line, &["--city", &text(&index), "-o", &text(output)])? {
            Command::Bake(bake) => quietly(Loudness::Quiet, || {
                bake::run(bake.args().0, self.memory, None)
            }),
            _ => Err(Failure::usage("a task of files is a bake")),
        }
    }

    fn shard(
        &self,
        [index, of]: [u32; 2],
        (output, scratch): (&Path, &Path),
    ) -> Result<(), Failure> {
        let (shard, output) = (format!("{index}/{of}"), text(output));
        match parse(self.plan.line(), &["--shard", &shard, "-o", &output])? {
            Command::Render(mut args) => {
                args.resume = true;
                // The part has what errors are made of.
                if let Some(path) = &mut args.stderr_image {
                    *path = scratch.join("errors.exr");
                }
                render::run(&args, self.memory)
            }
            Command::Bake(bake) => {
                let own = ["--shard", &shard, "-o", "share.part"].map(OsString::from);
                let line = self.plan.line().into_iter().map(OsString::from);
                bake::run_share(bake.args().0, self.memory, line.chain(own).collect())
            }
            _ => Err(Failure::usage("a share is of a rendering or a bake")),
        }
    }
}

/// What a share holds, without how long that took.
fn content(path: &Path) -> Result<Vec<u8>, Failure> {
    let bytes = fs::read(path).map_err(Failure::work)?;
    let Ok((identity, share)) = Snapshot::from_bytes(&bytes) else {
        return Ok(bytes);
    };
    let mut content = Vec::new();
    let written = share.without_effort().write(&identity, &mut content);
    written.map(|()| content).map_err(Failure::work)
}

fn tile_of([column, row, columns, rows]: [usize; 4]) -> Tile {
    Tile {
        at: [column as i64, row as i64],
        size: [columns, rows],
    }
}
