//! Work in chunks: what is kept of it while it lasts, shards, and their merging.
//!
//! Items are numbered, and so are chunks of items. The bytes of an item depend on the item alone, so chunks that were
//! computed at different times or on different machines make the same whole. Chunks are kept in a file of records, each with
//! a check sum. A record that was cut short is left out and computed again.

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use antumbra_image::atomic_write;
use antumbra_lab::count;
use antumbra_render::Shard;
use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_64;

use crate::exit::{Failure, tell};
use crate::output::{self, Files};
use crate::progress::Progress;
use crate::{checkpoint, interrupt};

/// First bytes of a file of chunks.
const MAGIC: &[u8; 16] = b"ANTUMBRABAKE\0\0\0\x01";
/// Extension of shards.
const PART: &str = "part";
/// Rays of a chunk, about.
const RAYS: u64 = 1 << 22;
/// Time after which finished chunks are written down, while they are not all done.
const KEEP_EVERY: Duration = Duration::from_secs(20);

/// What a file of chunks is about.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    /// Hash of everything that answers depend on.
    pub key: u64,
    /// Number of items.
    pub items: usize,
    /// Items of a chunk.
    pub chunk: usize,
    /// The command line that made it, for `merge`.
    pub command: Vec<String>,
    /// Share, of how many.
    pub shard: [u32; 2],
}

/// Chunks that were read from a file.
#[derive(Debug)]
pub struct Part {
    path: PathBuf,
    pub identity: Identity,
    chunks: Vec<(usize, Vec<u8>)>,
    /// Whether nothing was cut short.
    is_sound: bool,
}

/// What was done, in words: `number` things in so many seconds, or those of so many merged parts.
pub fn work_done(things: &str, number: u64, seconds: f64, parts: Option<&[Part]>) -> String {
    let things = format!("{} {things}", count(number));
    match parts {
        Some(parts) => format!("{things}, merged from {} parts", parts.len()),
        None => {
            let rate = number as f64 / 1e6 / seconds.max(1e-9);
            format!("{things} in {seconds:.2} s, {rate:.1} million a second")
        }
    }
}

/// Whether a file has chunks, by its first bytes.
pub fn is_part(path: &Path) -> bool {
    let mut head = Vec::new();
    let read =
        File::open(path).and_then(|file| file.take(MAGIC.len() as u64).read_to_end(&mut head));
    read.is_ok() && head == MAGIC
}

impl Part {
    /// Reads a file of chunks; `None` if there is no such file.
    pub fn read(path: &Path) -> Result<Option<Self>, Failure> {
        let Some(bytes) = checkpoint::read(path)? else {
            return Ok(None);
        };
        let refuse = |reason| Failure::Data(format!("{}: {reason}", path.display()));
        let Some(rest) = bytes.strip_prefix(MAGIC) else {
            return Err(refuse(
                "it is no file of antumbra's bakes, and is left as it is",
            ));
        };
        let mut reader = Reader(rest);
        let identity = reader
            .record()
            .and_then(|(_, text)| serde_json::from_slice(text).ok());
        let identity: Identity = identity.ok_or_else(|| refuse("it is damaged"))?;
        let mut chunks = Vec::new();
        while let Some((index, bytes)) = reader.record() {
            chunks.push((index as usize, bytes.to_vec()));
        }
        Ok(Some(Self {
            path: path.to_path_buf(),
            identity,
            chunks,
            is_sound: reader.0.is_empty(),
        }))
    }
}

/// Reads records: number, length, check sum, bytes.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn record(&mut self) -> Option<(u64, &'a [u8])> {
        let (head, rest) = self.0.split_at_checked(24)?;
        let number = |at: usize| {
            let bytes = head[at..at + 8].try_into();
            bytes.map(u64::from_le_bytes).unwrap_or_default()
        };
        let (bytes, rest) = rest.split_at_checked(usize::try_from(number(8)).ok()?)?;
        if xxh3_64(bytes) ^ number(0) != number(16) {
            return None;
        }
        self.0 = rest;
        Some((number(0), bytes))
    }
}

fn record(number: u64, bytes: &[u8]) -> [u8; 24] {
    let mut head = [0; 24];
    head[..8].copy_from_slice(&number.to_le_bytes());
    head[8..16].copy_from_slice(&(bytes.len() as u64).to_le_bytes());
    head[16..].copy_from_slice(&(xxh3_64(bytes) ^ number).to_le_bytes());
    head
}

/// Items to be computed, and what to do with them meanwhile.
pub struct Work<'a> {
    /// Hash of everything that answers depend on.
    pub key: u64,
    pub items: usize,
    pub rays_per_item: u64,
    /// Share to be computed, if not all.
    pub shard: Option<Shard>,
    /// First output. The share is written there, and chunks of unfinished work beside it.
    pub output: &'a Path,
    /// Whether to forget chunks of an earlier run.
    pub restart: bool,
    /// Shares to take instead of computing anything.
    pub parts: Option<&'a [Part]>,
}

/// Bytes of every chunk; `None` if a share was written.
pub type Chunks = Option<Vec<Vec<u8>>>;

/// Notes parts as inputs.
pub fn reads(parts: Option<&[Part]>, files: &mut Files) -> Result<(), Failure> {
    let mut parts = parts.unwrap_or_default().iter();
    parts.try_for_each(|part| files.reads("the part", &part.path))
}

/// Checks the names of outputs against the share asked for, and notes them and the file of chunks.
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
        let extension = first.extension().unwrap_or_default();
        if outputs.len() != 1 || !extension.eq_ignore_ascii_case(PART) {
            let path = first.display();
            return Err(Failure::Usage(format!(
                "{path}: a shard is written as one .{PART}, for merge"
            )));
        }
    } else if let Some(path) = checkpoint::beside(first) {
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

impl Work<'_> {
    /// Items of a chunk.
    fn chunk(&self) -> usize {
        let items = RAYS / self.rays_per_item.max(1);
        usize::try_from(items)
            .unwrap_or(usize::MAX)
            .clamp(1, self.items.max(1))
    }

    fn range(&self, chunk: usize) -> Range<usize> {
        let size = self.chunk();
        chunk * size..((chunk + 1) * size).min(self.items)
    }

    /// Where chunks are kept.
    fn store(&self) -> Option<PathBuf> {
        match self.shard {
            Some(_) => Some(self.output.to_path_buf()),
            None => checkpoint::beside(self.output),
        }
    }

    /// Computes all chunks that are not there yet, and keeps them on the way.
    ///
    /// # Errors
    /// [`Failure::Continuable`] if it was interrupted and chunks are kept.
    pub fn run(
        &self,
        progress: &Progress,
        mut compute: impl FnMut(Range<usize>, &dyn antumbra_bake::Monitor) -> Result<Vec<u8>, Failure>,
    ) -> Result<Chunks, Failure> {
        let count = self.items.div_ceil(self.chunk());
        let mut chunks: Vec<Option<Vec<u8>>> = vec![None; count];
        if let Some(parts) = self.parts {
            return self.join(parts, chunks);
        }
        let share = self
            .shard
            .map_or([0, 1], |shard| [shard.index(), shard.count()]);
        let identity = Identity {
            key: self.key,
            items: self.items,
            chunk: self.chunk(),
            command: std::env::args_os()
                .map(|arg| arg.to_string_lossy().into_owned())
                .collect(),
            shard: share,
        };
        let mut keeper = Keeper::new(self.store(), identity);
        keeper.resume(self.restart, &mut chunks)?;
        let mine = |index: &usize| *index as u64 % u64::from(share[1]) == u64::from(share[0]);
        let size = |index: usize| self.range(index).len();
        let total: usize = (0..count).filter(mine).map(size).sum();
        let found: usize = (0..count)
            .filter(|&i| mine(&i) && chunks[i].is_some())
            .map(size)
            .sum();
        if found > 0 {
            let left = total - found;
            tell(format_args!(
                "{found} of {total} items were done before; {left} are left"
            ));
        }
        let mut done = found;
        for index in (0..count).filter(mine) {
            if chunks[index].is_some() {
                continue;
            }
            let range = self.range(index);
            let monitor = Offset {
                progress,
                before: done,
                total,
            };
            let outcome = match interrupt::check() {
                Ok(()) => compute(range.clone(), &monitor),
                Err(failure) => Err(failure),
            };
            match outcome {
                Ok(bytes) => chunks[index] = Some(bytes),
                Err(Failure::Interrupted) => return Err(keeper.interrupted(&chunks)?),
                Err(failure) => return Err(failure),
            }
            done += range.len();
            keeper.keep_now_and_then(&chunks)?;
        }
        progress.finish();
        if self.shard.is_some() {
            keeper.finish(&chunks)?;
            return Ok(None);
        }
        keeper.forget();
        Ok(Some(chunks.into_iter().flatten().collect()))
    }

    /// Takes all chunks from shares.
    fn join(&self, parts: &[Part], mut chunks: Vec<Option<Vec<u8>>>) -> Result<Chunks, Failure> {
        for part in parts {
            let path = part.path.display();
            let identity = &part.identity;
            if (identity.key, identity.items, identity.chunk)
                != (self.key, self.items, self.chunk())
            {
                return Err(Failure::Usage(format!(
                    "{path}: it is a part of something else, or its mesh or sensors have changed since"
                )));
            }
            if !part.is_sound {
                return Err(Failure::Data(format!(
                    "{path}: it is cut short; give its command again to complete it"
                )));
            }
            for (index, bytes) in &part.chunks {
                if let Some(chunk) = chunks.get_mut(*index) {
                    *chunk = Some(bytes.clone());
                }
            }
        }
        let missing = chunks.iter().position(Option::is_none);
        if let Some(index) = missing {
            let of = parts.first().map_or(1, |part| part.identity.shard[1]);
            return Err(Failure::Usage(format!(
                "the shard {}/{of} is missing, or not complete",
                index as u64 % u64::from(of)
            )));
        }
        Ok(Some(chunks.into_iter().flatten().collect()))
    }
}

/// Progress of one chunk as that of all.
struct Offset<'a> {
    progress: &'a Progress,
    before: usize,
    total: usize,
}

impl antumbra_bake::Monitor for Offset<'_> {
    fn progress(&self, done: usize, _: usize) {
        antumbra_bake::Monitor::progress(self.progress, self.before + done, self.total);
    }

    fn cancelled(&self) -> bool {
        interrupt::requested()
    }
}

/// Keeps chunks in a file.
struct Keeper {
    path: Option<PathBuf>,
    identity: Identity,
    /// Whether each chunk is in the file.
    kept: Vec<bool>,
    /// Whether the file is ours and sound, so that records may follow.
    is_open: bool,
    last: Instant,
}

impl Keeper {
    fn new(path: Option<PathBuf>, identity: Identity) -> Self {
        Self {
            path,
            identity,
            kept: Vec::new(),
            is_open: false,
            last: Instant::now(),
        }
    }

    /// Takes the chunks of an earlier run.
    fn resume(&mut self, restart: bool, chunks: &mut [Option<Vec<u8>>]) -> Result<(), Failure> {
        self.kept = vec![false; chunks.len()];
        let Some(path) = &self.path else {
            return Ok(());
        };
        if restart || !path.exists() {
            return Ok(());
        }
        let Some(part) = Part::read(path)? else {
            return Ok(());
        };
        let same = |a: &Identity, b: &Identity| {
            (a.key, a.items, a.chunk, a.shard) == (b.key, b.items, b.chunk, b.shard)
        };
        if !same(&part.identity, &self.identity) {
            return Err(Failure::Usage(format!(
                "{} is of another bake; --restart forgets it, or choose another --output",
                path.display()
            )));
        }
        for (index, bytes) in part.chunks {
            if let Some(chunk) = chunks.get_mut(index) {
                *chunk = Some(bytes);
                self.kept[index] = true;
            }
        }
        self.is_open = part.is_sound;
        Ok(())
    }

    /// Writes chunks that are not in the file yet. False if there is no file to write to.
    fn keep(&mut self, chunks: &[Option<Vec<u8>>]) -> Result<bool, Failure> {
        let Some(path) = &self.path else {
            return Ok(false);
        };
        let failed =
            |error: io::Error| Failure::Work(format!("cannot write {}: {error}", path.display()));
        let _writing = interrupt::writing();
        if self.is_open {
            let mut file = File::options().append(true).open(path).map_err(failed)?;
            for (index, bytes) in chunks.iter().enumerate() {
                if let (Some(bytes), false) = (bytes, self.kept[index]) {
                    file.write_all(&record(index as u64, bytes))
                        .map_err(failed)?;
                    file.write_all(bytes).map_err(failed)?;
                }
            }
            file.sync_data().map_err(failed)?;
        } else {
            let identity = serde_json::to_vec(&self.identity).map_err(Failure::work)?;
            let size = chunks
                .iter()
                .flatten()
                .map(|bytes| 24 + bytes.len() as u64)
                .sum();
            output::check_room(path, size)?;
            let written = atomic_write(path, |file| {
                file.write_all(MAGIC)?;
                file.write_all(&record(0, &identity))?;
                file.write_all(&identity)?;
                for (index, bytes) in chunks.iter().enumerate() {
                    if let Some(bytes) = bytes {
                        file.write_all(&record(index as u64, bytes))?;
                        file.write_all(bytes)?;
                    }
                }
                Ok(())
            });
            written.map_err(Failure::from)?;
            self.is_open = true;
        }
        for (kept, chunk) in self.kept.iter_mut().zip(chunks) {
            *kept = chunk.is_some();
        }
        interrupt::goes_on_from(path);
        Ok(true)
    }

    fn keep_now_and_then(&mut self, chunks: &[Option<Vec<u8>>]) -> Result<(), Failure> {
        if self.last.elapsed() > KEEP_EVERY || interrupt::checkpoint_requested() {
            self.keep(chunks)?;
            self.last = Instant::now();
        }
        Ok(())
    }

    /// The failure to end with.
    fn interrupted(&mut self, chunks: &[Option<Vec<u8>>]) -> Result<Failure, Failure> {
        if chunks.iter().any(Option::is_some) && self.keep(chunks)? {
            return Ok(Failure::Continuable(self.path.clone().unwrap_or_default()));
        }
        Ok(Failure::Interrupted)
    }

    /// Completes the file of a share.
    fn finish(&mut self, chunks: &[Option<Vec<u8>>]) -> Result<(), Failure> {
        self.keep(chunks).map(drop)
    }

    /// Removes the file, which is no longer needed.
    fn forget(&self) {
        if let Some(path) = self.path.as_deref().filter(|path| is_part(path)) {
            // If it cannot be removed, the next run finds all chunks in it.
            let _ = fs::remove_file(path);
        }
    }
}
