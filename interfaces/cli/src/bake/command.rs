//! The steps that all bakes have in common.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Instant;

use antumbra::{Bvh, Isa, Recipe};
use antumbra_bake::{Error, Job, Key, Work};
use antumbra_lab::{Machine, count};
use antumbra_load::MemorySize;
use antumbra_tiles::Indexed;
use serde::{Serialize, Serializer};

use super::chunks::{self, PartFile};
use super::city::Store;
use super::ground::Ground;
use super::map;
use super::neighbours::tell_neighbours;
use super::raster::is_raster;
use super::terrain::Terrain;
use super::tile::{TileWork, Tiling};
use super::visible::VisibleArgs;
use crate::args::ChunkArgs;
use crate::exit::{Failure, tell};
use crate::json::Destination;
use crate::output::{Files, text};
use crate::progress::Progress;
use crate::{input, json, scenes, version};

/// What a command has of its own. It has the arguments of all bakes, [`Shared`], and more.
pub trait Baking: Shared {
    /// Refuses outputs that cannot be made, before anything is read.
    fn check(&self) -> Result<(), Failure>;

    /// Computes and writes everything. `files` are to note what is read and written beside the arguments of all bakes.
    fn bake(&self, bake: &Bake<'_>, files: Files) -> Result<(), Failure>;

    /// How tiles of a raster of many files are computed.
    ///
    /// # Errors
    /// The command has no tiles, or not with these flags.
    fn tiling(&self, raster: &Indexed) -> Result<Tiling, Failure> {
        let _ = raster;
        Err(Failure::usage(
            "tiles of an index are for horizon and sun with --cells",
        ))
    }

    /// Refuses flags with which files of a city cannot be tasks of a plan.
    fn check_city(&self) -> Result<(), Failure> {
        Err(Failure::usage("files of a city are for sun"))
    }

    /// Files that are written beside `--output` and `--json`, and files that are read beside the scene.
    fn files(&self) -> [Vec<Named<'_>>; 2] {
        Default::default()
    }

    /// Whether the only output is a mesh or a picture, which flags make out of what a share computes. Pictures are no maps.
    fn is_picture(&self) -> bool {
        false
    }

    /// Where lines of sight go, for a command that has them.
    fn lines(&mut self) -> Option<&mut Option<PathBuf>> {
        None
    }
}

/// Arguments of all bakes. [`bakes`] implements it.
pub trait Shared {
    /// Files of the scene, outputs, document, and flags about chunks.
    fn shared(&self) -> (&[PathBuf], &[PathBuf], Option<&Destination>, &ChunkArgs);

    /// Wants the whole as these outputs and this document.
    fn want(&mut self, outputs: &[PathBuf], json: Option<&Destination>);
}

/// Defines the list of commands: a name, a variant, and arguments that have the fields `scene`, `output`, `json` and `chunks`.
macro_rules! bakes {
    ($($(#[$attribute:meta])* $name:literal $kind:ident($args:ty),)*) => {
        /// A command that bakes.
        #[derive(Debug, clap::Subcommand)]
        pub enum BakeCommand {
            $($(#[$attribute])* #[command(name = $name)] $kind(Box<$args>),)*
        }

        impl BakeCommand {
            /// Names of all commands.
            pub const NAMES: &[&str] = &[$($name),*];

            /// Arguments of the command, and its name.
            pub fn args(&self) -> (&dyn command::Baking, &'static str) {
                match self { $(Self::$kind(args) => (&**args, $name),)* }
            }

            /// Arguments of the command.
            pub fn args_mut(&mut self) -> &mut dyn command::Baking {
                match self { $(Self::$kind(args) => &mut **args,)* }
            }
        }

        $(impl command::Shared for $args {
            fn shared(&self) -> (&[PathBuf], &[PathBuf], Option<&Destination>, &ChunkArgs) {
                (&self.scene, &self.output, self.json.as_ref(), &self.chunks)
            }

            fn want(&mut self, outputs: &[PathBuf], json: Option<&Destination>) {
                (self.output, self.json) = (outputs.to_vec(), json.cloned());
                self.chunks.shard = None;
            }
        })*
    };
}
pub(super) use bakes;

/// Runs a command, or merges parts of it.
pub fn run(
    args: &dyn Baking,
    memory: MemorySize,
    parts: Option<&[PartFile]>,
) -> Result<(), Failure> {
    run_some(args, memory, (parts, None), std::env::args_os().collect())
}

/// Runs a command for a share, in whose file this line is noted: `merge` gives it again.
pub fn run_share(
    args: &dyn Baking,
    memory: MemorySize,
    line: Vec<OsString>,
) -> Result<(), Failure> {
    run_some(args, memory, (None, None), line)
}

/// Runs a command for a tile of its raster.
pub fn run_tile(args: &dyn Baking, memory: MemorySize, tile: &TileWork<'_>) -> Result<(), Failure> {
    run_some(args, memory, (None, Some(tile)), Vec::new())
}

fn run_some(
    args: &dyn Baking,
    memory: MemorySize,
    (parts, tile): (Option<&[PartFile]>, Option<&TileWork<'_>>),
    line: Vec<OsString>,
) -> Result<(), Failure> {
    let (scene, outputs, json, chunks) = args.shared();
    let isa = chunks.machine.isa()?;
    let is_other = |path: &&PathBuf| scene.len() > 1 && !is_raster(std::slice::from_ref(path));
    if let Some(other) = scene.iter().find(is_other) {
        let reason = "it is no height raster, and only rasters are one scene together";
        return Err(Failure::name(other, reason));
    }
    if chunks.shard.is_none() || args.is_picture() {
        args.check()?;
    }
    let bake = Bake {
        scene,
        outputs,
        json,
        chunks,
        isa,
        memory,
        parts,
        tile,
        line,
    };
    let maps = if args.is_picture() { &[] } else { outputs };
    let world_files = map::world_files(maps)?;
    let [mut written, read] = args.files();
    written.extend(
        world_files
            .iter()
            .map(|path| ("the world file", Some(&**path))),
    );
    args.bake(&bake, bake.declare([written, read])?)
}

/// Arguments that all bakes have.
pub struct Bake<'a> {
    scene: &'a [PathBuf],
    pub outputs: &'a [PathBuf],
    json: Option<&'a Destination>,
    chunks: &'a ChunkArgs,
    pub isa: Isa,
    memory: MemorySize,
    /// Shares to take instead of computing anything.
    pub parts: Option<&'a [PartFile]>,
    /// The tile to compute instead of the whole.
    pub tile: Option<&'a TileWork<'a>>,
    /// The command line, as files of chunks note it.
    line: Vec<OsString>,
}

/// A job that was computed.
pub struct Done<T> {
    /// Its result; `None` if a share was written.
    pub found: Option<T>,
    pub seconds: f64,
    /// File of its chunks, which is needed until all outputs are written.
    checkpoint: Option<PathBuf>,
}

/// A flag, or another name of a file's purpose, and the file if it is given.
pub type Named<'a> = (&'a str, Option<&'a Path>);

/// A name and a value of a document.
pub type Figure<'a> = (&'a str, &'a dyn erased_serde::Serialize);

/// Figures as they are written.
struct Figures<'a>(&'a [Figure<'a>]);

impl Serialize for Figures<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().copied())
    }
}

/// A JSON document.
#[derive(Serialize)]
struct Document<'a> {
    schema: &'a str,
    #[serde(flatten)]
    machine: Machine,
    scene: &'a str,
    #[serde(flatten)]
    figures: Figures<'a>,
}

impl<T> Done<T> {
    /// A job that was computed as a whole, without files of its chunks.
    pub fn whole(found: T, seconds: f64) -> Self {
        Self {
            found: Some(found),
            seconds,
            checkpoint: None,
        }
    }

    /// What `of` makes of the result.
    pub fn map<U>(self, of: impl FnOnce(T) -> Result<U, Error>) -> Result<Done<U>, Failure> {
        Ok(Done {
            found: self.found.map(of).transpose()?,
            seconds: self.seconds,
            checkpoint: self.checkpoint,
        })
    }
}

impl Bake<'_> {
    /// Whether the command computes everything itself.
    pub fn is_whole(&self) -> bool {
        self.chunks.shard.is_none() && self.parts.is_none()
    }

    /// Notes all files, with the files of these flags, and checks that outputs can be written.
    fn declare(&self, [written, read]: [Vec<Named<'_>>; 2]) -> Result<Files, Failure> {
        let is_shared = self.chunks.shard.is_some() || self.parts.is_some();
        if is_shared && self.scene == [Path::new(scenes::STDIN)] {
            let reason = "merge reads the mesh again: shards need a file, not the standard input";
            return Err(Failure::Usage(reason.into()));
        }
        let mut files = Files::default();
        chunks::declare(self.outputs, self.chunks.shard, &mut files)?;
        let json = ("--json", self.json.map(Destination::path));
        files.writes_some(written.into_iter().chain([json]))?;
        let parts = self.parts.unwrap_or_default().iter();
        let parts = parts.map(|file| ("the part", Some(&*file.path)));
        let scene = self.scene.iter().map(|path| ("the scene", Some(&**path)));
        files.reads_some(parts.chain(scene).chain(read))?;
        files.check()?;
        Ok(files)
    }

    /// Starts the threads.
    fn start_threads(&self) -> Result<(), Failure> {
        self.chunks.machine.start_threads()
    }

    /// Starts the threads, reads the scene and builds its tree, [bent](Ground::load) if flags say so.
    pub fn ground(&self, files: &mut Files, bent: Option<&VisibleArgs>) -> Result<Ground, Failure> {
        self.start_threads()?;
        Ground::load(self.scene, (self.isa, self.memory), files, (bent, None))
    }

    /// As [`ground`](Self::ground), perhaps in the city of an index.
    pub fn ground_in(&self, files: &mut Files, city: Option<&Path>) -> Result<Ground, Failure> {
        self.start_threads()?;
        let city = city.map(|index| Store::open(index, self.memory));
        let city = city.transpose()?;
        Ground::load(self.scene, (self.isa, self.memory), files, (None, city))
    }

    /// Starts the threads and reads a height raster, for a job without a mesh and without a tree.
    pub fn terrain(&self, files: &mut Files) -> Result<Terrain, Failure> {
        self.terrain_of(self.scene, files)
    }

    /// Starts the threads and reads a height raster around the scene.
    pub fn terrain_of(&self, raster: &[PathBuf], files: &mut Files) -> Result<Terrain, Failure> {
        self.start_threads()?;
        match self.tile {
            Some(work) => {
                let name = antumbra_load::raster_name(raster);
                Terrain::of_tile(work.raster, &work.tile, name)
            }
            None => Terrain::load(raster, self.memory, files),
        }
    }

    /// Says which files beside a height raster go on where it ends, if it is one. Not for lines between two of its points, which stay
    /// inside of it.
    pub fn tell_neighbours(&self, raster: &[PathBuf]) {
        if self.parts.is_none() && self.tile.is_none() {
            tell_neighbours(raster, self.memory);
        }
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

    /// Computes a job on a height raster.
    pub fn compute_cells<J: Job>(&self, job: &J, name: &str) -> Result<Done<J::Found>, Failure> {
        let no_tree = Bvh::build(&[], &Recipe::default()).map_err(Failure::work)?;
        self.compute_known(job, (name, Key::of(job, |_| {})), &no_tree)
    }

    fn compute_known<J: Job>(
        &self,
        job: &J,
        (name, key): (&str, u64),
        bvh: &Bvh,
    ) -> Result<Done<J::Found>, Failure> {
        let shard = self.chunks.shard;
        let share = shard.map_or([0, 1], |shard| [shard.index(), shard.count()]);
        let mut work = Work::new(job, key, share, self.line.clone());
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

    /// Names of the outputs.
    pub fn output_names(&self) -> Vec<String> {
        self.outputs.iter().map(|path| text(path)).collect()
    }

    /// The share as `I/N`.
    pub fn shard(&self) -> Option<String> {
        self.chunks.shard.map(|shard| shard.to_string())
    }

    /// Writes the document, if it is wanted. Says where a share was written, and `more`; false then, since nothing else is known.
    pub fn document<T>(
        &self,
        (schema, scene): (&str, &str),
        figures: &[Figure<'_>],
        (done, more): (&Done<T>, &str),
    ) -> Result<bool, Failure> {
        let document = Document {
            schema,
            machine: version::machine(self.isa),
            scene,
            figures: Figures(figures),
        };
        json::write(&document, self.json)?;
        if done.found.is_none() {
            let outputs = self.output_names().join(", ");
            tell(format_args!("wrote {outputs}, for merge{more}"));
        }
        Ok(done.found.is_some())
    }

    /// Ends a command that is done: says what was written, of `number` things in so many seconds or of merged parts.
    pub fn end<T>(&self, things: &str, number: u64, done: &Done<T>) {
        let things = format!("{} {things}", count(number));
        let wrote = self.output_names().join(", ");
        let how = match self.parts {
            Some(parts) => format!(", merged from {} parts", parts.len()),
            None => {
                let (seconds, number) = (done.seconds, number as f64);
                let rate = number / 1e6 / seconds.max(1e-9);
                format!(" in {seconds:.2} s, {rate:.1} million a second")
            }
        };
        tell(format_args!("{things}{how}; wrote {wrote}"));
        chunks::forget(done.checkpoint.as_deref());
    }
}
