//! The steps that all bakes have in common.

use std::path::{Path, PathBuf};
use std::time::Instant;

use antumbra::{Bvh, Isa};
use antumbra_bake::{Error, Job, Key, Work};
use antumbra_lab::{Machine, count};
use antumbra_load::MemorySize;
use serde::Serialize;

use super::chunks::{self, PartFile};
use super::ground::{Earth, Ground};
use crate::args::{ChunkArgs, MachineArgs};
use crate::exit::{Failure, tell};
use crate::json::Destination;
use crate::output::Files;
use crate::progress::Progress;
use crate::{input, scenes, version};

/// Arguments that all bakes have.
pub struct Bake<'a> {
    pub scene: &'a Path,
    pub outputs: &'a [PathBuf],
    pub json: Option<&'a Destination>,
    pub chunks: &'a ChunkArgs,
    pub machine: &'a MachineArgs,
    /// Shares to take instead of computing anything.
    pub parts: Option<&'a [PartFile]>,
    /// Curvature of the earth that was applied to the scene.
    pub earth: Option<Earth<'a>>,
}

/// Beginning of a JSON document.
#[derive(Serialize)]
pub struct Head<'a> {
    schema: &'static str,
    #[serde(flatten)]
    machine: Machine,
    pub scene: &'a str,
}

/// A job that was computed.
pub struct Done<T> {
    /// Its result; `None` if a share was written.
    pub found: Option<T>,
    pub seconds: f64,
    /// File of its chunks, which is needed until all outputs are written.
    pub checkpoint: Option<PathBuf>,
}

/// A flag, or another name of a file's purpose, and the file if it is given.
pub type Named<'a> = (&'a str, Option<&'a Path>);

impl Bake<'_> {
    /// Notes all files, with the files of these flags, and checks that outputs can be written.
    pub fn declare(&self, written: &[Named<'_>], read: &[Named<'_>]) -> Result<Files, Failure> {
        let is_shared = self.chunks.shard.is_some() || self.parts.is_some();
        if is_shared && self.scene == Path::new(scenes::STDIN) {
            let reason = "merge reads the mesh again: shards need a file, not the standard input";
            return Err(Failure::Usage(reason.into()));
        }
        let mut files = Files::default();
        chunks::declare(self.outputs, self.chunks.shard, &mut files)?;
        let json = ("--json", self.json.map(Destination::path));
        for (purpose, path) in written.iter().chain([&json]) {
            path.map_or(Ok(()), |path| files.writes(purpose, path))?;
        }
        for file in self.parts.unwrap_or_default() {
            files.reads("the part", &file.path)?;
        }
        let scene = ("the scene", Some(self.scene));
        for (purpose, path) in [&scene].into_iter().chain(read) {
            path.map_or(Ok(()), |path| files.reads(purpose, path))?;
        }
        files.check()?;
        Ok(files)
    }

    /// Starts the threads, reads the scene and builds its tree.
    pub fn ground(
        &self,
        isa: Isa,
        memory: MemorySize,
        files: &mut Files,
    ) -> Result<Ground, Failure> {
        self.machine.start_threads()?;
        Ground::load(self.scene, isa, memory, files, self.earth)
    }

    /// Computes a job, or one share of it, with a tree of the scene. With parts, joins them instead.
    pub fn compute<J: Job>(
        &self,
        job: &J,
        ground: &Ground,
        bvh: &Bvh,
    ) -> Result<Done<J::Found>, Failure> {
        let key = Key::of(job, |key| ground.identify(key));
        self.compute_known(job, (&ground.loaded.scene.name, key), bvh)
    }

    /// [`compute`](Self::compute) of a job with a name for the progress and a key of its own.
    pub fn compute_known<J: Job>(
        &self,
        job: &J,
        (name, key): (&str, u64),
        bvh: &Bvh,
    ) -> Result<Done<J::Found>, Failure> {
        let shard = self.chunks.shard;
        let share = shard.map_or([0, 1], |shard| [shard.index(), shard.count()]);
        let mut work = Work::new(job, key, share, std::env::args_os().collect());
        input::check_answers(name, work.memory())?;
        let start = Instant::now();
        let progress = Progress::new(name);
        let checkpoint = match self.parts {
            Some(parts) => {
                chunks::join(&mut work, parts)?;
                None
            }
            None => chunks::compute(&mut work, bvh, self.chunks, &self.outputs[0], &progress)?,
        };
        progress.finish();
        let seconds = start.elapsed().as_secs_f64();
        let found = match shard {
            Some(_) => None,
            None => Some(work.finish().map_err(|error| self.failure(error))?),
        };
        Ok(Done {
            found,
            seconds,
            checkpoint,
        })
    }

    /// Failure of a job that was not finished.
    fn failure(&self, error: Error) -> Failure {
        let chunk = match error {
            Error::Missing { chunk } => chunk,
            Error::Answers if self.parts.is_none() => {
                return Failure::Data(format!("{error}; --restart forgets them"));
            }
            _ => return error.into(),
        };
        let first = self.parts.and_then(|parts| parts.first());
        let of = first.map_or(1, |file| file.part.identity.shard[1]);
        Failure::Usage(format!(
            "the shard {}/{of} is missing, or not complete",
            chunk as u64 % u64::from(of)
        ))
    }

    /// Beginning of the JSON document.
    pub fn head<'g>(&self, schema: &'static str, isa: Isa, scene: &'g str) -> Head<'g> {
        Head {
            schema,
            machine: version::machine(isa),
            scene,
        }
    }

    /// Names of the outputs.
    pub fn output_names(&self) -> Vec<String> {
        self.outputs.iter().map(|path| text(path)).collect()
    }

    /// The share as `I/N`.
    pub fn shard(&self) -> Option<String> {
        self.chunks.shard.map(|shard| shard.to_string())
    }

    /// Prints what was done and written: `number` things in so many seconds, or the things of the merged parts.
    pub fn tell_done(&self, things: &str, number: u64, seconds: f64) {
        let things = format!("{} {things}", count(number));
        let wrote = self.output_names().join(", ");
        match self.parts {
            Some(parts) => {
                let parts = parts.len();
                tell(format_args!(
                    "{things}, merged from {parts} parts; wrote {wrote}"
                ));
            }
            None => {
                let rate = number as f64 / 1e6 / seconds.max(1e-9);
                tell(format_args!(
                    "{things} in {seconds:.2} s, {rate:.1} million a second; wrote {wrote}"
                ));
            }
        }
    }
}

/// A path as text.
pub fn text(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}
