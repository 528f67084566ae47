//! Files kept of a rendering while it lasts: the checkpoint beside the image, and the file of `--save-order`.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, OnceLock};
use std::time::{Duration, Instant};

use antumbra_image::atomic_write;
use antumbra_render::{
    Identity, Lesson, LiveTiles, Monitor, Options, Phase, Place, Shard, Snapshot,
};
use antumbra_scene::Scene;

use super::looks::Looks;
use super::start::Picture;
use crate::args::RenderArgs;
use crate::exit::{Failure, say, tell};
use crate::output::Files;
use crate::progress::{Progress, lock};
use crate::{archive, interrupt, output};

/// Flag that keeps the samples of a finished picture.
pub const KEEP: &str = "--keep-samples";

/// Notes the checkpoint of an output as a file to be written.
///
/// # Errors
/// Another file of the run is the same one, or it is no checkpoint of this program, which is then left as it is.
pub fn declare(output: &Path, files: &mut Files) -> Result<(), Failure> {
    let Some(path) = output::checkpoint(output) else {
        return Ok(());
    };
    files.writes("the checkpoint", &path)?;
    match fs::metadata(&path) {
        // What else is wrong there is found when all outputs are checked.
        Err(_) => Ok(()),
        Ok(found) if found.is_file() && archive::is_own(&path) => Ok(()),
        Ok(_) => Err(Failure::Data(format!(
            "{} is no file of antumbra: it is left as it is, but the checkpoint would replace it; \
             move it, or choose another --output",
            path.display()
        ))),
    }
}

/// A rendering as it is watched by this program.
pub struct Keeper<'a> {
    scene: &'a Scene,
    options: &'a Options,
    /// Path of the checkpoint. `None` if there is no place for one.
    path: Option<PathBuf>,
    /// How people look at it.
    looks: Looks,
    every: Duration,
    order_file: Option<&'a Path>,
    progress: Progress,
    /// Whether the number of samples grows while rendering.
    grows: bool,
    identity: OnceLock<Identity>,
    /// When the last checkpoint was written, or the rendering began.
    last: Mutex<Instant>,
    /// Whether a thread is writing one.
    writing: AtomicBool,
    /// Whether there is one of this rendering.
    written: AtomicBool,
    /// Whether the last attempt failed.
    failing: AtomicBool,
    /// Why the order could not be written.
    order_failure: Mutex<Option<Failure>>,
}

impl<'a> Keeper<'a> {
    /// For the rendering of a picture, which people look at meanwhile.
    pub fn new(args: &'a RenderArgs, picture: &'a Picture) -> Result<Self, Failure> {
        let scene = &picture.scene;
        let [x0, x1, y0, y1] = scene.film.pixel_bounds().map(u64::from);
        let samples = (x1 - x0) * (y1 - y0) * u64::from(picture.spp());
        Ok(Self {
            scene,
            options: &picture.options,
            path: output::checkpoint(&picture.file),
            looks: Looks::begin(args, scene, &picture.file)?,
            every: args.checkpoint_every.0,
            order_file: args.save_order.as_deref(),
            progress: Progress::of_picture(&scene.name, samples),
            grows: picture.until.is_some(),
            identity: OnceLock::new(),
            last: Mutex::new(Instant::now()),
            writing: AtomicBool::new(false),
            written: AtomicBool::new(false),
            failing: AtomicBool::new(false),
            order_failure: Mutex::default(),
        })
    }

    /// Identity of the rendering. Computed on first use, because large scenes take time.
    pub fn identity(&self) -> &Identity {
        self.identity
            .get_or_init(|| Identity::new(self.scene, self.options))
    }

    /// The checkpoint to go on from, if there is one.
    pub fn resume(&self, shard: Shard) -> Result<Option<Snapshot>, Failure> {
        let Some(path) = &self.path else {
            return Ok(None);
        };
        let snapshot = self.load(path, shard)?;
        if snapshot.is_some() {
            self.written.store(true, Ordering::Relaxed);
            interrupt::goes_on_from(path);
        }
        Ok(snapshot)
    }

    /// A checkpoint or part of this very rendering, or of the finished picture with fewer samples; `None` if there is
    /// no such file.
    pub fn load(&self, path: &Path, shard: Shard) -> Result<Option<Snapshot>, Failure> {
        let Some(bytes) = archive::read(path)? else {
            return Ok(None);
        };
        let (identity, snapshot) =
            Snapshot::from_bytes(&bytes).map_err(|error| Failure::refused(path, &error))?;
        let wanted = self.identity();
        // A finished picture of fewer samples can get more.
        let may_differ = snapshot.is_complete() && snapshot.spp() < wanted.spp();
        let found_as = if self.grows || may_differ {
            identity.with_spp(wanted.spp())
        } else {
            identity
        };
        let reason = found_as.difference(wanted).or_else(|| {
            let found = snapshot.shard();
            (found != shard).then(|| format!("shard {found}, not {shard}"))
        });
        match reason {
            None => Ok(Some(snapshot)),
            Some(reason) => Err(Failure::Usage(format!(
                "{}: cannot go on from it: {reason}; --restart forgets it",
                path.display()
            ))),
        }
    }

    /// Part of this shard from its file, if it is complete there.
    pub fn finished_part(&self, part: &Path, shard: Shard) -> Result<Option<Snapshot>, Failure> {
        if output::is_stream(part) {
            return Ok(None);
        }
        let snapshot = self.load(part, shard)?;
        Ok(snapshot.filter(Snapshot::is_complete))
    }

    /// Writes a part.
    pub fn write_part(&self, path: &Path, snapshot: &Snapshot) -> Result<(), Failure> {
        let identity = self.identity().with_spp(snapshot.spp());
        atomic_write(path, |file| snapshot.write(&identity, file))?;
        Ok(())
    }

    /// How it ends when it was interrupted.
    pub fn interrupted(&self) -> Failure {
        match &self.path {
            Some(path) if self.written.load(Ordering::Relaxed) => {
                Failure::Continuable(path.clone())
            }
            _ => Failure::Interrupted,
        }
    }

    /// How it ends when it was interrupted, but a picture of fewer samples is finished: with a checkpoint, if it is only of
    /// that picture.
    pub fn interrupted_after(&self, finished: &Snapshot) -> Failure {
        if !self.written.load(Ordering::Relaxed) {
            self.write(finished);
        }
        self.interrupted()
    }

    /// Takes the progress off the terminal.
    pub fn finish(&self) {
        self.progress.finish();
    }

    /// The last checkpoint, before outputs are written: of a rendering that has had one, or took as long.
    pub fn keep_finished(&self, snapshot: &Snapshot) {
        if self.written.load(Ordering::Relaxed) || self.is_due() {
            self.write(snapshot);
        }
    }

    /// The outputs could not be written: whatever it takes, the samples are not to be lost.
    pub fn rescue(&self, snapshot: &Snapshot, failure: Failure) -> Failure {
        if self.write(snapshot)
            && let Some(path) = &self.path
        {
            say(format_args!(
                "all samples are kept: the same command goes on from {}",
                path.display()
            ));
        }
        failure
    }

    /// All outputs are complete: keeps the samples as the checkpoint, from which more samples go on.
    ///
    /// # Errors
    /// The samples cannot be written, or cannot be extended; or as [`Self::discard`].
    pub fn keep(&self, snapshot: &Snapshot) -> Result<(), Failure> {
        let Some(path) = &self.path else {
            return Err(Failure::work("the samples of a stream cannot be kept"));
        };
        if !snapshot.is_extendable() {
            self.discard()?;
            return Err(Failure::Work(format!(
                "the samples are not kept: the rendering was begun without {KEEP}"
            )));
        }
        self.write_part(path, snapshot)?;
        tell(format_args!(
            "kept the samples in {}: a larger --spp goes on from them",
            path.display()
        ));
        Ok(())
    }

    /// All outputs are complete: takes away the checkpoint.
    ///
    /// # Errors
    /// The checkpoint cannot be removed.
    pub fn discard(&self) -> Result<(), Failure> {
        // One that was there before and not gone on with is out of date, too.
        if let Some(path) = &self.path
            && let Err(error) = fs::remove_file(path)
            && error.kind() != io::ErrorKind::NotFound
        {
            let path = path.display();
            return Err(Failure::Work(format!("cannot remove {path}: {error}")));
        }
        interrupt::goes_on_from_nothing();
        Ok(())
    }

    /// Shows the picture for the last time, and takes away the preview of a complete one. Not to be called while
    /// [`interrupt::writing`] holds off signals, because a slow viewer takes seconds.
    ///
    /// # Errors
    /// The outcome that is given, or that the order could not be written when it was known.
    pub fn ended(&self, outcome: Result<(), Failure>) -> Result<(), Failure> {
        match &outcome {
            Ok(()) => self.looks.end(),
            Err(Failure::Interrupted | Failure::Continuable(_)) => self.looks.finish(),
            Err(_) => {}
        }
        match (outcome, lock(&self.order_failure).take()) {
            (Ok(()), Some(failure)) => Err(failure),
            (Err(other), Some(failure)) => {
                say(format_args!("{failure}"));
                Err(other)
            }
            (outcome, None) => outcome,
        }
    }

    fn is_due(&self) -> bool {
        lock(&self.last).elapsed() >= self.every
    }

    /// Writes a checkpoint; the last one is kept if that fails.
    fn write(&self, snapshot: &Snapshot) -> bool {
        let Some(path) = &self.path else {
            return false;
        };
        let _writing = interrupt::writing();
        match self.write_part(path, snapshot) {
            Ok(()) => {
                interrupt::goes_on_from(path);
                self.written.store(true, Ordering::Relaxed);
                self.failing.store(false, Ordering::Relaxed);
                true
            }
            Err(failure) => {
                // Said once, not every second.
                if !self.failing.swap(true, Ordering::Relaxed) {
                    say(format_args!("warning: no checkpoint: {failure}"));
                }
                false
            }
        }
    }
}

impl Monitor for Keeper<'_> {
    fn progress(&self, phase: Phase, done: u64, total: u64) {
        Monitor::progress(&self.progress, phase, done, total);
    }

    fn traced(&self, samples: u64, rays: u64) {
        self.progress.traced(samples, rays);
    }

    fn cancelled(&self) -> bool {
        interrupt::requested()
    }

    fn tiles(&self) -> Option<&LiveTiles> {
        self.looks.tiles()
    }

    fn learned(&self, lesson: &Lesson) {
        let Some(path) = self.order_file else { return };
        let written = (|| {
            let place = Place::new(self.scene);
            atomic_write(path, |file| lesson.write(&place, file))?;
            Ok::<_, Failure>(())
        })();
        *lock(&self.order_failure) = written.err();
    }

    fn wants_snapshot(&self) -> bool {
        if self.path.is_none() || self.writing.load(Ordering::Relaxed) {
            return false;
        }
        (self.is_due() || interrupt::checkpoint_requested())
            && !self.writing.swap(true, Ordering::Relaxed)
    }

    fn keep(&self, snapshot: Snapshot) {
        self.write(&snapshot);
        *lock(&self.last) = Instant::now();
        self.writing.store(false, Ordering::Relaxed);
    }
}
