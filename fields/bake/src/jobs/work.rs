//! Work on a job in chunks, which can be kept in files, resumed, and shared among machines.

use std::ffi::OsString;
use std::io::{self, Write};
use std::ops::Range;

use antumbra::Bvh;

use crate::jobs::job::{bytes_of, finish_bytes};
use crate::jobs::part::{record_bytes, write_head, write_record};
use crate::{Error, Identity, Job, Monitor, Numbers, Part, Size};

/// Rays of a chunk, about.
const RAYS: u64 = 1 << 22;

/// A job, or a share of one, of which some chunks are computed.
///
/// ```
/// # use antumbra::{Bvh, Recipe};
/// # use antumbra_bake::{AmbientOcclusion, Key, OcclusionJob, Part, Work};
/// # let bvh = Bvh::build(&[], &Recipe::default())?;
/// let (points, normals) = ([[0.0; 3]; 5], [[0.0, 0.0, 1.0]; 5]);
/// let options = AmbientOcclusion::default();
/// let job = OcclusionJob::new(&points, &normals, options, false)?;
/// let key = Key::of(&job, |geometry| geometry.mesh(&[], &[]));
///
/// // Two machines take a share each.
/// let mut files = [Vec::new(), Vec::new()];
/// for (index, file) in files.iter_mut().enumerate() {
///     let mut work = Work::new(&job, key, [index as u32, 2], Vec::new());
///     while work.step(&bvh, &())? {}
///     work.write(file)?;
/// }
/// let mut whole = Work::new(&job, key, [0, 1], Vec::new());
/// for file in &files {
///     whole.add(Part::read(file)?)?;
/// }
/// assert_eq!(whole.finish()?.open, [1.0; 5]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Work<'a, J> {
    job: &'a J,
    identity: Identity,
    chunks: Vec<Chunk>,
}

#[derive(Clone, Default)]
struct Chunk {
    answers: Option<Vec<u8>>,
    is_written: bool,
}

impl<'a, J: Job> Work<'a, J> {
    /// Work of which nothing is done, on the share `shard[0]` of `shard[1]`: `[0, 1]` is the whole. `command` is a note in files.
    pub fn new(job: &'a J, key: u64, shard: [u32; 2], command: Vec<OsString>) -> Self {
        let Size { items, rays, .. } = job.size();
        let chunk = usize::try_from(RAYS / rays.max(1)).unwrap_or(usize::MAX);
        let chunk = chunk.clamp(1, items.max(1));
        let identity = Identity {
            key,
            items,
            chunk,
            command,
            shard,
        };
        let chunks = vec![Chunk::default(); items.div_ceil(chunk)];
        Self {
            job,
            identity,
            chunks,
        }
    }

    /// Goes on from a file of the same work. Its chunks count as written.
    ///
    /// # Errors
    /// [`Error::OtherJob`] if the file belongs to another job or share.
    pub fn resume(&mut self, part: Part) -> Result<(), Error> {
        if part.identity.shard != self.identity.shard {
            return Err(Error::OtherJob);
        }
        let is_sound = part.is_sound;
        self.take(part, is_sound)
    }

    /// Adds the chunks of a share.
    ///
    /// # Errors
    /// [`Error::OtherJob`] if the share belongs to another job, [`Error::CutShort`] if it is not complete.
    pub fn add(&mut self, part: Part) -> Result<(), Error> {
        match part.is_sound {
            _ if !self.is_same_job(&part.identity) => Err(Error::OtherJob),
            false => Err(Error::CutShort),
            true => self.take(part, false),
        }
    }

    fn is_same_job(&self, other: &Identity) -> bool {
        let own = &self.identity;
        (own.key, own.items, own.chunk) == (other.key, other.items, other.chunk)
    }

    fn take(&mut self, part: Part, is_written: bool) -> Result<(), Error> {
        if !self.is_same_job(&part.identity) {
            return Err(Error::OtherJob);
        }
        for (index, answers) in part.chunks {
            if let Some(chunk) = self.chunks.get_mut(index) {
                *chunk = Chunk {
                    answers: Some(answers),
                    is_written,
                };
            }
        }
        Ok(())
    }

    fn range(&self, chunk: usize) -> Range<usize> {
        let size = self.identity.chunk;
        chunk * size..((chunk + 1) * size).min(self.identity.items)
    }

    /// Chunks of the share.
    fn share(&self) -> impl Iterator<Item = usize> + use<J> {
        let [index, count] = self.identity.shard.map(u64::from);
        (0..self.chunks.len()).filter(move |&chunk| chunk as u64 % count.max(1) == index)
    }

    /// Number of items of the share that are done, and of all.
    pub fn progress(&self) -> [usize; 2] {
        let items = |chunk| self.range(chunk).len();
        let is_done = |&chunk: &usize| self.chunks[chunk].answers.is_some();
        [
            self.share().filter(is_done).map(items).sum(),
            self.share().map(items).sum(),
        ]
    }

    /// Computes the next chunk; false if the share is complete. `monitor` sees which part of the share is done.
    ///
    /// # Errors
    /// [`Error`] if the job makes no sense, or if `monitor` cancels: nothing is known then of this chunk.
    pub fn step(&mut self, bvh: &Bvh, monitor: &dyn Monitor) -> Result<bool, Error> {
        let is_open = |&chunk: &usize| self.chunks[chunk].answers.is_none();
        let Some(next) = self.share().find(is_open) else {
            return Ok(false);
        };
        let [before, total] = self.progress();
        let items = self.range(next);
        let monitor = OfShare {
            monitor,
            before,
            items: items.len(),
            total,
        };
        let answers = self.job.answers(bvh, items, &monitor)?;
        self.chunks[next].answers = Some(bytes_of(&answers)?);
        Ok(true)
    }

    /// Memory in bytes that the answers of the share take at least, and again as much to make a result of them if the share is
    /// the whole.
    pub fn memory(&self) -> u64 {
        let [_, items] = self.progress();
        let copies = if self.identity.shard[1] > 1 { 1 } else { 2 };
        let (Numbers::Each(numbers) | Numbers::AtLeast(numbers)) = self.job.size().numbers;
        let bytes = numbers as u64 * size_of::<J::Number>() as u64;
        (items as u64).saturating_mul(copies * bytes)
    }

    /// Size in bytes of what [`write`](Self::write) writes, about.
    pub fn bytes(&self) -> u64 {
        let answers = self
            .chunks
            .iter()
            .filter_map(|chunk| chunk.answers.as_ref());
        answers.map(|answers| record_bytes(answers.len())).sum()
    }

    /// Writes a file of all chunks that are done.
    ///
    /// # Errors
    /// Errors of `out`.
    pub fn write(&mut self, out: &mut dyn Write) -> io::Result<()> {
        write_head(&self.identity, out)?;
        self.chunks
            .iter_mut()
            .for_each(|chunk| chunk.is_written = false);
        self.append(out)
    }

    /// Writes the chunks that were done since the last time, to be appended to the chunks of the file.
    ///
    /// # Errors
    /// Errors of `out`.
    pub fn append(&mut self, out: &mut dyn Write) -> io::Result<()> {
        for (index, chunk) in self.chunks.iter_mut().enumerate() {
            if let (Some(answers), false) = (&chunk.answers, chunk.is_written) {
                write_record(index as u64, answers, out)?;
                chunk.is_written = true;
            }
        }
        Ok(())
    }

    /// Result of the job.
    ///
    /// # Errors
    /// [`Error::Missing`] if chunks are missing.
    pub fn finish(self) -> Result<J::Found, Error> {
        if let Some(chunk) = self.chunks.iter().position(|chunk| chunk.answers.is_none()) {
            return Err(Error::Missing { chunk });
        }
        let answers = self.chunks.into_iter().filter_map(|chunk| chunk.answers);
        finish_bytes(self.job, &answers.collect::<Vec<_>>())
    }
}

/// Progress of one chunk as progress of the share.
struct OfShare<'a> {
    monitor: &'a dyn Monitor,
    before: usize,
    /// Items of the chunk, whatever the job counts.
    items: usize,
    total: usize,
}

/// Parts of an item that progress distinguishes.
const PARTS: usize = 1000;

impl Monitor for OfShare<'_> {
    fn progress(&self, done: usize, of: usize) {
        let own = PARTS * self.items * done / of.max(1);
        self.monitor
            .progress(PARTS * self.before + own, PARTS * self.total);
    }

    fn cancelled(&self) -> bool {
        self.monitor.cancelled()
    }
}

#[cfg(test)]
mod tests {
    use antumbra::Recipe;

    use super::*;
    use crate::{Answers, Key};

    /// The bytes 0 to 4. Items have so many rays that there are two in a chunk.
    struct Bytes(&'static str);

    impl Job for Bytes {
        type Found = Vec<u8>;
        type Number = u8;

        const NAME: &'static str = "numbers";

        fn size(&self) -> Size {
            Size::each(5, RAYS / 2, 1)
        }

        fn identify(&self, key: &mut Key) {
            key.text(self.0);
        }

        fn answers(&self, _: &Bvh, items: Range<usize>, _: &dyn Monitor) -> Answers<Self> {
            Ok(items.map(|item| item as u8).collect())
        }

        fn found(&self, numbers: Vec<u8>) -> Result<Vec<u8>, Error> {
            Ok(numbers)
        }
    }

    fn work(job: &Bytes, shard: [u32; 2]) -> Work<'_, Bytes> {
        Work::new(job, Key::of(job, |_| {}), shard, Vec::new())
    }

    fn bvh() -> Bvh {
        Bvh::build(&[], &Recipe::default()).expect("a tree")
    }

    /// File of some chunks of a share.
    fn file(job: &Bytes, shard: [u32; 2], chunks: usize) -> Vec<u8> {
        let mut work = work(job, shard);
        let mut file = Vec::new();
        work.write(&mut file).expect("a vector");
        for _ in 0..chunks {
            assert_eq!(work.step(&bvh(), &()), Ok(true));
            work.append(&mut file).expect("a vector");
        }
        file
    }

    fn read(bytes: &[u8]) -> Part {
        Part::read(bytes).expect("a part")
    }

    #[test]
    fn work_goes_on_from_what_is_whole_in_its_file() {
        let job = Bytes("a");
        let file = file(&job, [0, 1], 2);
        // Records of two chunks are 26 bytes each.
        for (cut, found) in [(0, 4), (1, 2), (26, 2), (27, 0)] {
            let part = read(&file[..file.len() - cut]);
            assert_eq!(part.is_sound, cut % 26 == 0);
            let mut work = work(&job, [0, 1]);
            work.resume(part).expect("the same work");
            assert_eq!(work.progress(), [found, 5], "{cut} bytes are missing");
            while work.step(&bvh(), &()).expect("answers") {}
            assert_eq!(work.finish(), Ok(vec![0, 1, 2, 3, 4]));
        }
    }

    #[test]
    fn parts_of_something_else_and_missing_ones_are_refused() {
        let job = Bytes("a");
        let first = file(&job, [0, 2], 2);
        let mut whole = work(&job, [0, 1]);
        assert_eq!(whole.resume(read(&first)), Err(Error::OtherJob));
        let cut = read(&first[..first.len() - 1]);
        assert_eq!(whole.add(cut), Err(Error::CutShort));
        let other = file(&Bytes("b"), [1, 2], 1);
        assert_eq!(whole.add(read(&other)), Err(Error::OtherJob));
        assert_eq!(whole.add(read(&first)), Ok(()));
        assert_eq!(whole.finish(), Err(Error::Missing { chunk: 1 }));
        assert!(matches!(Part::read(b"ANTUMBRA"), Err(Error::NoPart)));
        assert!(matches!(Part::read(Part::MAGIC), Err(Error::DamagedPart)));
    }

    #[test]
    fn shares_that_cannot_be_are_damage() {
        let job = Bytes("a");
        for shard in [[0, 0], [1, 0], [2, 2], [5, 2]] {
            let mut file = Vec::new();
            work(&job, shard).write(&mut file).expect("a vector");
            assert!(
                matches!(Part::read(&file), Err(Error::DamagedPart)),
                "{shard:?}"
            );
        }
    }
}
