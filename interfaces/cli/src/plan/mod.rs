//! Plans: jobs as text, of tasks that any engine can run.
//!
//! A task is a pure function of the plan, its line and the files that both name. It writes one file by renaming it, and then a receipt
//! with its checksum. So a task that was lost is run again, one that is done is not, and two runs of one task do no harm.
//!
//! - `make`: `antumbra plan`;  `run`: `antumbra run`;  `check`: `antumbra check`;  `merge`: results as one file
//! - `survey`: `antumbra index`;  `bill`: what a plan takes

mod bill;
mod check;
mod make;
mod merge;
mod run;
mod survey;

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use antumbra_image::atomic_write;
use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_64;

use crate::exit::Failure;
use crate::farm::is_built_in;
use crate::output::text;
use crate::{input, interrupt};

pub use check::check;
pub use make::{make, parse, planned};
pub use merge::{is_plan, merge};
pub use run::run;
pub use survey::survey;

const PLAN: &str = "antumbra.plan/1";
const RECEIPT: &str = "antumbra.receipt/1";

/// The first line of a plan.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Head {
    schema: String,
    /// The scene or the index; relative to the folder of the plan if it is in it.
    scene: PathBuf,
    /// The command of all tasks, without its scene and its output.
    pub command: Vec<String>,
    /// Folder of results and receipts, as `scene`.
    folder: PathBuf,
    /// Name and unit of each band of the tiles.
    bands: Vec<[String; 2]>,
    /// Rows and columns of tiles, from north to south and from west to east: numbers of cells, as chunks of dask.
    chunks: [Vec<usize>; 2],
    /// Numbers of tasks that only need those before: so many first, so many next, and so on.
    pub levels: Vec<usize>,
    bill: Bill,
}

/// What a plan takes, all tasks together.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Bill {
    pub tasks: usize,
    /// Cells whose results are written; 0 of scenes that are no rasters.
    pub cells: u64,
    /// Hours of one core.
    pub core_hours: Option<f64>,
    /// Most memory of a task in bytes.
    pub memory: Option<u64>,
    /// Bytes of the files that tasks begin with, once for each task, and of results.
    pub bytes_read: u64,
    pub bytes_written: u64,
}

/// A task: a line of a plan.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Task {
    id: String,
    /// What it computes.
    #[serde(flatten)]
    part: Part,
    /// Tasks whose results it needs.
    after: Vec<String>,
    /// Files that it certainly reads. Receipts name those that it did read.
    inputs: Vec<Input>,
    /// Its file in the folder.
    output: String,
    /// Estimates for one core.
    seconds: Option<f64>,
    memory: Option<u64>,
}

/// What a task computes.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Part {
    /// Cells of a raster: column, row, columns and rows.
    Tile([usize; 4]),
    /// Sweeps of a quarter of the steps over the same.
    Sweep { tile: [usize; 4], quarter: usize },
    /// One of some shares of the work.
    Shard([u32; 2]),
    /// Sensors on a file of a city.
    File(usize),
}

/// A file and its checksum: XXH3, 64 bits, hexadecimal.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Input {
    path: PathBuf,
    xxh3: String,
}

/// What a task has done.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Receipt {
    schema: String,
    task: String,
    /// Checksum of what the result is made of.
    key: String,
    output: Input,
    bytes: u64,
    inputs: Vec<Input>,
    seconds: f64,
    version: String,
}

/// A plan that was read.
pub struct Plan {
    path: PathBuf,
    pub head: Head,
    tasks: Vec<Task>,
    /// Tasks whose results these need.
    needed: HashMap<String, Task>,
}

/// What there is of a task.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
enum State {
    /// Its result and its receipt are there and agree.
    Done,
    /// There is no receipt, or none that can be read.
    Missing,
    /// The receipt is of another plan, or of other inputs.
    Stale,
    /// The result is not as the receipt says.
    Disagreeing,
}

impl Plan {
    /// Reads a plan; with names of tasks or their numbers only these, and the tasks that they need.
    pub fn read(path: &Path, wanted: &[String]) -> Result<Self, Failure> {
        let bad = |line: usize, reason: String| {
            Failure::Data(format!("{}:{}: {reason}", path.display(), line + 1))
        };
        let text = input::text(path)?;
        let (first, rest) = text.split_once('\n').unwrap_or((&text, ""));
        let head: Head = serde_json::from_str(first)
            .map_err(|error| bad(0, format!("wanted a plan of `antumbra plan`: {error}")))?;
        if head.schema != PLAN {
            let reason = format!("found the schema `{}`, wanted {PLAN}", head.schema);
            return Err(bad(0, reason));
        }
        let lines: Vec<&str> = rest.lines().collect();
        if lines.len() != head.bill.tasks {
            let (found, wanted) = (lines.len(), head.bill.tasks);
            let reason = format!("found {found} tasks, wanted {wanted}; it is cut short");
            return Err(bad(found, reason));
        }
        let task = |number: usize| {
            let task = serde_json::from_str::<Task>(lines[number]);
            task.map_err(|error| bad(number + 1, error.to_string()))
        };
        // Other lines need not be understood, since there may be many of them.
        let find = |id: &String| {
            let start = format!("{{\"id\":\"{id}\",");
            let found = lines.iter().position(|line| line.starts_with(&start));
            let missing = || {
                Failure::Usage(format!(
                    "{}: there is no task {id}; tasks have ids, and the numbers 0 to {}",
                    path.display(),
                    lines.len().saturating_sub(1)
                ))
            };
            let number = || id.parse().ok().filter(|&number| number < lines.len());
            task(found.or_else(number).ok_or_else(missing)?)
        };
        let tasks: Vec<Task> = match wanted {
            [] => (0..lines.len()).map(task).collect::<Result<_, _>>()?,
            wanted => wanted.iter().map(find).collect::<Result<_, _>>()?,
        };
        let mut needed = HashMap::new();
        for id in tasks.iter().flat_map(|task| &task.after) {
            if !needed.contains_key(id) {
                needed.insert(id.clone(), find(id)?);
            }
        }
        let path = path.to_path_buf();
        Ok(Self {
            path,
            head,
            tasks,
            needed,
        })
    }

    /// A file beside the plan.
    fn beside(&self, path: &Path) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(path)
    }

    /// Folder of results.
    fn folder(&self) -> PathBuf {
        self.beside(&self.head.folder)
    }

    /// The result of a task.
    fn result(&self, task: &Task) -> PathBuf {
        self.folder().join(&task.output)
    }

    fn receipt_path(&self, id: &str) -> PathBuf {
        self.folder().join(format!("{id}.receipt.json"))
    }

    /// The receipt of a task, if there is one.
    fn receipt(&self, id: &str) -> Option<Receipt> {
        let text = fs::read_to_string(self.receipt_path(id)).ok()?;
        let receipt: Receipt = serde_json::from_str(&text).ok()?;
        (receipt.schema == RECEIPT && receipt.task == id).then_some(receipt)
    }

    /// Writes the plan.
    pub fn write(&self) -> Result<(), Failure> {
        let _writing = interrupt::writing();
        Ok(atomic_write(&self.path, |file| {
            serde_json::to_writer(&mut *file, &self.head)?;
            for task in &self.tasks {
                file.write_all(b"\n")?;
                serde_json::to_writer(&mut *file, task)?;
            }
            file.write_all(b"\n")
        })?)
    }

    /// The scene or the index, wherever this program runs.
    pub fn scene(&self) -> PathBuf {
        match is_built_in(&self.head.scene) {
            true => self.head.scene.clone(),
            false => {
                let path = self.beside(&self.head.scene);
                std::path::absolute(&path).unwrap_or(path)
            }
        }
    }

    /// The command line of all tasks, without an output.
    fn line(&self) -> Vec<String> {
        line(&self.scene(), &self.head.command)
    }

    /// Whether another plan has the same tasks.
    pub fn is_as(&self, other: &Self) -> Result<bool, Failure> {
        let keys = |plan: &Self| -> Result<Vec<_>, _> {
            plan.tasks.iter().map(|task| plan.key(task)).collect()
        };
        Ok(keys(self)? == keys(other)?)
    }

    /// Numbers of the tasks that are not done.
    pub fn open(&self) -> Result<Vec<usize>, Failure> {
        let mut open = Vec::new();
        for (number, task) in self.tasks.iter().enumerate() {
            interrupt::check()?;
            if self.state(task, true)? != State::Done {
                open.push(number);
            }
        }
        Ok(open)
    }

    /// A number that changes with all that the result of a task is made of.
    fn key(&self, task: &Task) -> Result<String, Failure> {
        let Head { scene, command, .. } = &self.head;
        let of = (scene, command, &task.part, &task.after, &task.inputs);
        let text = serde_json::to_string(&of).map_err(Failure::work)?;
        Ok(sum_text(xxh3_64(text.as_bytes())))
    }

    /// What there is of a task, by the checksum of its result or only by its length.
    fn state(&self, task: &Task, is_read: bool) -> Result<State, Failure> {
        let Some(receipt) = self.receipt(&task.id) else {
            return Ok(State::Missing);
        };
        if receipt.key != self.key(task)? {
            return Ok(State::Stale);
        }
        let (result, known) = (self.result(task), (receipt.bytes, receipt.output.xxh3));
        let agrees = match is_read {
            true => checksum(&result).is_ok_and(|found| found == known),
            false => fs::metadata(result).is_ok_and(|found| found.len() == known.0),
        };
        Ok(match agrees {
            true => State::Done,
            false => State::Disagreeing,
        })
    }
}

/// The command line of a scene, without an output.
pub fn line(scene: &Path, command: &[String]) -> Vec<String> {
    let (name, flags) = command
        .split_first()
        .map_or(("", &[][..]), |(name, flags)| (&**name, flags));
    let line = ["antumbra".to_owned(), name.to_owned(), text(scene)];
    line.into_iter().chain(flags.iter().cloned()).collect()
}

/// A file as a plan names it: relative to the folder of the plan if it is in it.
fn from(plan: &Path, path: &Path) -> Result<PathBuf, Failure> {
    let absolute = |path| std::path::absolute(path).map_err(Failure::work);
    let (plan, path) = (absolute(plan)?, absolute(path)?);
    let folder = plan.parent().unwrap_or(Path::new(""));
    let inside = path.strip_prefix(folder).map(Path::to_path_buf);
    Ok(inside.unwrap_or(path))
}

/// A checksum as text.
fn sum_text(sum: u64) -> String {
    format!("{sum:016x}")
}

/// Length and checksum of a file.
fn checksum(path: &Path) -> Result<(u64, String), Failure> {
    let (bytes, sum) = antumbra_tiles::checksum(path)?;
    Ok((bytes, sum_text(sum)))
}
