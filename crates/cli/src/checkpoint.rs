//! Files kept of a rendering while it lasts: the checkpoint beside the image, and the file of `--save-order`.

use std::fs;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use antumbra_image::atomic_write;
use antumbra_load::MemorySize;
use antumbra_render::{Identity, Lesson, Monitor, Options, Phase, Place, Shard, Snapshot};
use antumbra_scene::Scene;
use antumbra_simd::process;

use crate::exit::{Failure, say};
use crate::progress::Progress;
use crate::{interrupt, output};

/// Where the checkpoint of an output lies.
pub fn beside(output: &Path) -> PathBuf {
    let mut name = output.as_os_str().to_owned();
    name.push(".checkpoint");
    name.into()
}

/// First bytes of our own files.
const START: &[u8] = b"ANTUMBRA";

/// The bytes of one of our own files; `None` if there is none. Of another file, which may be huge, only the first bytes
/// are read: those who read it refuse it for them.
pub fn read(path: &Path) -> Result<Option<Vec<u8>>, Failure> {
    let failed =
        |error: io::Error| Failure::Work(format!("cannot read {}: {error}", path.display()));
    match fs::metadata(path) {
        // Devices and pipes may have no end.
        Ok(metadata) if !metadata.is_file() => {
            Err(Failure::Data(format!("{} is not a file", path.display())))
        }
        Ok(metadata) => {
            let mut bytes = Vec::new();
            let mut file = fs::File::open(path).map_err(failed)?;
            file.by_ref()
                .take(START.len() as u64)
                .read_to_end(&mut bytes)
                .map_err(failed)?;
            if !bytes.starts_with(START) {
                return Ok(Some(bytes));
            }
            // Its contents take as much again.
            let (needed, allowed) = (2 * metadata.len(), process::limit());
            if needed > allowed {
                let needed = MemorySize::new(needed);
                let allowed = MemorySize::new(allowed);
                return Err(Failure::Data(format!(
                    "{} takes about {needed} of memory, more than the {allowed} allowed; allow more with --max-memory",
                    path.display()
                )));
            }
            bytes.reserve_exact(metadata.len() as usize);
            file.take(metadata.len())
                .read_to_end(&mut bytes)
                .map_err(failed)?;
            Ok(Some(bytes))
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(failed(error)),
    }
}

/// A rendering as it is watched by this program.
pub struct Keeper<'a> {
    scene: &'a Scene,
    options: &'a Options,
    /// Path of the checkpoint.
    path: PathBuf,
    every: Duration,
    order_file: Option<&'a Path>,
    progress: Progress,
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
    /// For the rendering of a scene to `output`, with a checkpoint every so often.
    pub fn new(
        scene: &'a Scene,
        options: &'a Options,
        output: &Path,
        every: Duration,
        order_file: Option<&'a Path>,
    ) -> Self {
        Self {
            scene,
            options,
            path: beside(output),
            every,
            order_file,
            progress: Progress::new(&scene.name),
            identity: OnceLock::new(),
            last: Mutex::new(Instant::now()),
            writing: AtomicBool::new(false),
            written: AtomicBool::new(false),
            failing: AtomicBool::new(false),
            order_failure: Mutex::default(),
        }
    }

    /// Identity of the rendering. Worked out on first use, because large scenes take time.
    pub fn identity(&self) -> &Identity {
        self.identity
            .get_or_init(|| Identity::new(self.scene, self.options))
    }

    /// The checkpoint to go on from, if there is one.
    pub fn resume(&self, shard: Shard) -> Result<Option<Snapshot>, Failure> {
        output::remove_leftovers(&self.path);
        let snapshot = self.load(&self.path, shard)?;
        self.written.store(snapshot.is_some(), Ordering::Relaxed);
        Ok(snapshot)
    }

    /// A checkpoint or part of this very rendering; `None` if there is no such file.
    pub fn load(&self, path: &Path, shard: Shard) -> Result<Option<Snapshot>, Failure> {
        let Some(bytes) = read(path)? else {
            return Ok(None);
        };
        let (identity, snapshot) =
            Snapshot::from_bytes(&bytes).map_err(|error| Failure::refused(path, &error))?;
        let reason = identity.difference(self.identity()).or_else(|| {
            let found = snapshot.shard();
            (found != shard).then(|| format!("shard {found}, not {shard}"))
        });
        match reason {
            None => Ok(Some(snapshot)),
            Some(reason) => Err(Failure::Usage(format!(
                "{}: cannot go on from it: {reason}; without --resume the rendering starts afresh",
                path.display()
            ))),
        }
    }

    /// Whether a file is this very part, complete.
    pub fn is_complete(&self, part: &Path, shard: Shard) -> Result<bool, Failure> {
        let snapshot = self.load(part, shard)?;
        Ok(snapshot.is_some_and(|snapshot| snapshot.is_complete()))
    }

    /// Writes a part.
    pub fn write_part(&self, path: &Path, snapshot: &Snapshot) -> Result<(), Failure> {
        let bytes = snapshot.to_bytes(self.identity())?;
        atomic_write(path, |file| file.write_all(&bytes))?;
        Ok(())
    }

    /// Tells of a checkpoint that the rendering is about to replace.
    pub fn warn_of_old(&self) {
        if self.path.exists() {
            say(format_args!(
                "note: {} is of an unfinished rendering that --resume may go on with; it will be replaced",
                self.path.display()
            ));
        }
    }

    /// How it ends when it was interrupted.
    pub fn interrupted(&self) -> Failure {
        if self.written.load(Ordering::Relaxed) {
            Failure::Resumable(self.path.clone())
        } else {
            Failure::Interrupted
        }
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
        if self.write(snapshot) {
            let path = self.path.display();
            say(format_args!(
                "all samples are kept: --resume goes on from {path}"
            ));
        }
        failure
    }

    /// All outputs are complete: takes away the checkpoint.
    ///
    /// # Errors
    /// Also if the order could not be written when it was known.
    pub fn discard(&self) -> Result<(), Failure> {
        // One that was there before and not gone on with is out of date, too.
        match fs::remove_file(&self.path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(Failure::Work(format!(
                "cannot remove {}: {error}",
                self.path.display()
            ))),
            _ => lock(&self.order_failure).take().map_or(Ok(()), Err),
        }
    }

    fn is_due(&self) -> bool {
        lock(&self.last).elapsed() >= self.every
    }

    /// Writes a checkpoint; the last one is kept if that fails.
    fn write(&self, snapshot: &Snapshot) -> bool {
        match self.write_part(&self.path, snapshot) {
            Ok(()) => {
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
        self.progress.progress(phase, done, total);
    }

    fn cancelled(&self) -> bool {
        interrupt::requested()
    }

    fn learned(&self, lesson: &Lesson) {
        let Some(path) = self.order_file else { return };
        let written = (|| {
            let bytes = lesson.to_bytes(&Place::new(self.scene))?;
            atomic_write(path, |file| file.write_all(&bytes))?;
            Ok::<_, Failure>(())
        })();
        if let Err(failure) = written {
            say(format_args!("{failure}"));
            *lock(&self.order_failure) = Some(failure);
        }
    }

    fn wants_snapshot(&self) -> bool {
        if self.writing.load(Ordering::Relaxed) {
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

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
