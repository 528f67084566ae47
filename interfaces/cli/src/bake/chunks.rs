//! Files of unfinished bakes and of shares: where they are, when they are written, and what is said about them.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use antumbra::Bvh;
use antumbra_bake::{Error, Job, Part, Work};
use antumbra_image::atomic_write;
use antumbra_render::Shard;

use crate::args::ChunkArgs;
use crate::exit::{Failure, say, tell};
use crate::output::{self, Files};
use crate::progress::Progress;
use crate::{archive, interrupt};

/// Extension of shards.
const PART: &str = "part";
/// Time after which finished chunks are written, while they are not all done.
const KEEP_EVERY: Duration = Duration::from_secs(20);

/// A part that was read from a file.
pub struct PartFile {
    pub path: PathBuf,
    pub part: Part,
}

impl PartFile {
    /// Reads a part; `None` if there is no such file.
    pub fn read(path: &Path) -> Result<Option<Self>, Failure> {
        let Some(bytes) = archive::read(path)? else {
            return Ok(None);
        };
        let part = Part::read(&bytes).map_err(|error| {
            let more = match error {
                Error::NoPart => ", and is left as it is",
                _ => "",
            };
            Failure::Data(format!("{}: {error}{more}", path.display()))
        })?;
        let path = path.to_path_buf();
        Ok(Some(Self { path, part }))
    }
}

/// Whether a file is a part, by its first bytes.
pub fn is_part(path: &Path) -> bool {
    archive::starts_with(path, Part::MAGIC)
}

/// Checks the names of outputs against the share to compute, and notes them and the file of chunks.
pub fn declare(
    outputs: &[PathBuf],
    shard: Option<Shard>,
    files: &mut Files,
) -> Result<(), Failure> {
    for path in outputs {
        files.writes("--output", path)?;
    }
    let Some(first) = outputs.first() else {
        return Err(Failure::Usage("--output is missing".into()));
    };
    if shard.is_some() {
        if outputs.len() != 1 || !output::is_one_of(first, &[PART]) {
            let path = first.display();
            return Err(Failure::Usage(format!(
                "{path}: a shard is written as one .{PART}, for merge"
            )));
        }
    } else if let Some(path) = output::checkpoint(first) {
        files.writes("the checkpoint", &path)?;
        if path.exists() && !is_part(&path) {
            return Err(Failure::Data(format!(
                "{} is no file of antumbra's bakes: it is left as it is, but the checkpoint would replace it; \
                 move it, or choose another --output",
                path.display()
            )));
        }
    }
    Ok(())
}

/// Takes all chunks from shares.
pub fn join<J: Job>(work: &mut Work<'_, J>, parts: &[PartFile]) -> Result<(), Failure> {
    for PartFile { path, part } in parts {
        let path = path.display();
        work.add(part.clone()).map_err(|error| match error {
            Error::CutShort => Failure::Data(format!(
                "{path}: {error}; give its command again to complete it"
            )),
            _ => Failure::Usage(format!(
                "{path}: {error}, or its mesh or sensors have changed since"
            )),
        })?;
    }
    Ok(())
}

/// Computes all missing chunks, and saves them meanwhile: the chunks of a share in `output`, all others beside it in a
/// checkpoint, which is returned. A checkpoint that cannot be written is reported once, and the work goes on.
///
/// # Errors
/// [`Failure::Continuable`] if the work was interrupted and chunks are kept.
pub fn compute<J: Job>(
    work: &mut Work<'_, J>,
    bvh: &Bvh,
    args: &ChunkArgs,
    output: &Path,
    progress: &Progress,
) -> Result<Option<PathBuf>, Failure> {
    let path = match args.shard {
        Some(_) => Some(output.to_path_buf()),
        None => output::checkpoint(output),
    };
    let mut keeper = Keeper {
        path,
        is_open: false,
        is_failing: false,
        last: Instant::now(),
    };
    if !args.restart {
        keeper.resume(work)?;
    }
    let [found, total] = work.progress();
    if found > 0 {
        let left = total - found;
        tell(format_args!(
            "{found} of {total} items were done before; {left} are left"
        ));
    }
    loop {
        let step = interrupt::check().and_then(|()| Ok(work.step(bvh, progress)?));
        match step {
            Ok(true) => keeper.keep_now_and_then(work),
            Ok(false) => break,
            Err(Failure::Interrupted) => return Err(keeper.interrupted(work)),
            Err(failure) => return Err(failure),
        }
    }
    progress.finish();
    if args.shard.is_some() {
        keeper.keep(work)?;
        return Ok(None);
    }
    // Outputs may fail yet: what took long is not to be lost.
    if keeper.is_open || keeper.is_due() {
        keeper.try_to_keep(work);
    }
    Ok(keeper.path)
}

/// Removes a checkpoint that is no longer needed.
pub fn forget(checkpoint: Option<&Path>) {
    if let Some(path) = checkpoint.filter(|path| is_part(path)) {
        // If it cannot be removed, the next run finds all chunks in it.
        let _ = fs::remove_file(path);
        interrupt::goes_on_from_nothing();
    }
}

/// Keeps chunks in a file.
struct Keeper {
    path: Option<PathBuf>,
    /// Whether the file belongs to the work and is sound, so that records may follow.
    is_open: bool,
    /// Whether the last attempt failed.
    is_failing: bool,
    last: Instant,
}

impl Keeper {
    /// Takes the chunks of an earlier run.
    fn resume<J: Job>(&mut self, work: &mut Work<'_, J>) -> Result<(), Failure> {
        let Some(path) = self.path.as_deref() else {
            return Ok(());
        };
        let Some(PartFile { part, .. }) = PartFile::read(path)? else {
            return Ok(());
        };
        let is_sound = part.is_sound;
        work.resume(part).map_err(|_| {
            Failure::Usage(format!(
                "{} is of another bake; --restart forgets it, or choose another --output",
                path.display()
            ))
        })?;
        self.is_open = is_sound;
        Ok(())
    }

    /// Writes chunks that are not in the file yet. False if there is no file to write to.
    fn keep<J: Job>(&mut self, work: &mut Work<'_, J>) -> Result<bool, Failure> {
        let Some(path) = &self.path else {
            return Ok(false);
        };
        let _writing = interrupt::writing();
        // Another process on the same work may have removed the file, or a record may be cut short: then all are written.
        self.is_open = self.is_open && append(path, work).is_ok();
        if !self.is_open {
            output::check_room(path, work.bytes())?;
            atomic_write(path, |file| work.write(file))?;
            self.is_open = true;
        }
        interrupt::goes_on_from(path);
        Ok(true)
    }

    /// Writes chunks; false if there are none in the file. The work goes on.
    fn try_to_keep<J: Job>(&mut self, work: &mut Work<'_, J>) -> bool {
        self.last = Instant::now();
        match self.keep(work) {
            Ok(is_kept) => {
                self.is_failing = false;
                is_kept
            }
            Err(failure) => {
                // Said once, not every time.
                if !std::mem::replace(&mut self.is_failing, true) {
                    say(format_args!("warning: no checkpoint: {failure}"));
                }
                false
            }
        }
    }

    fn keep_now_and_then<J: Job>(&mut self, work: &mut Work<'_, J>) {
        if self.is_due() {
            self.try_to_keep(work);
        }
    }

    fn is_due(&self) -> bool {
        self.last.elapsed() > KEEP_EVERY || interrupt::checkpoint_requested()
    }

    /// The failure to end with.
    fn interrupted<J: Job>(&mut self, work: &mut Work<'_, J>) -> Failure {
        match &self.path {
            Some(path) if work.progress()[0] > 0 => {
                let path = path.clone();
                match self.try_to_keep(work) {
                    true => Failure::Continuable(path),
                    false => Failure::Interrupted,
                }
            }
            _ => Failure::Interrupted,
        }
    }
}

fn append<J: Job>(path: &Path, work: &mut Work<'_, J>) -> io::Result<()> {
    let mut file = BufWriter::new(File::options().append(true).open(path)?);
    work.append(&mut file)?;
    file.flush()?;
    file.get_ref().sync_data()
}
