//! Jobs: bakes as items that are computed in any order and in any share, and their keys.

use std::ops::Range;

use antumbra::{Bvh, Ray};
use rayon::prelude::*;
use xxhash_rust::xxh3::Xxh3;

use crate::monitor::Progress;
use crate::{Error, Monitor, memory};

/// Answers of some items of a [`Job`], as bytes.
pub type Answers = Result<Vec<u8>, Error>;

/// A bake of numbered items, such as points.
///
/// The answers of an item depend on the item only. So items may be computed at different times and on different machines:
/// see [`Work`](crate::Work). [`run`] computes all of them at once.
pub trait Job: Sync {
    /// Result of the whole job.
    type Found;

    /// Name and version of the answers, part of the [`Key`].
    const NAME: &'static str;

    /// Number of items.
    fn items(&self) -> usize;

    /// Number of rays of one item, about.
    fn rays_per_item(&self) -> u64;

    /// Least bytes of the answer of one item. All answers of a job are kept until its end.
    fn answer_bytes(&self) -> u64;

    /// Adds everything that answers depend on, except the geometry.
    fn identify(&self, key: &mut Key);

    /// Answers of some items, as bytes.
    ///
    /// # Errors
    /// [`Error`] if the job makes no sense, or if `monitor` cancels.
    fn answers(&self, bvh: &Bvh, items: Range<usize>, monitor: &dyn Monitor) -> Answers;

    /// Result of the answers of all items, which may come in pieces.
    ///
    /// # Errors
    /// [`Error::Answers`] if the answers do not fit this job.
    fn finish(&self, answers: &[Vec<u8>]) -> Result<Self::Found, Error>;

    /// Some rays of the job: `count` at most, and `per_item` of each item. None if trees cannot learn from this job.
    fn training_rays(&self, bvh: &Bvh, count: usize, per_item: usize) -> Vec<Ray> {
        let _ = (bvh, count, per_item);
        Vec::new()
    }
}

/// Answers that all threads compute: `of` computes the answers of a piece of so many items.
pub(crate) fn in_pieces(
    items: Range<usize>,
    each: usize,
    monitor: &dyn Monitor,
    of: impl Fn(Range<usize>) -> Answers + Sync,
) -> Answers {
    let progress = Progress::new(monitor, items.len());
    let firsts: Vec<usize> = items.clone().step_by(each).collect();
    let pieces = firsts.into_par_iter().map(|first| {
        if monitor.cancelled() {
            return Err(Error::Cancelled);
        }
        let piece = first..(first + each).min(items.end);
        let number = piece.len();
        let answers = of(piece)?;
        progress.add(number);
        Ok(answers)
    });
    Ok(pieces.collect::<Result<Vec<_>, Error>>()?.concat())
}

/// Computes a job as a whole.
///
/// # Errors
/// [`Error`] if the job makes no sense, or if `monitor` cancels.
pub fn run<J: Job>(job: &J, bvh: &Bvh, monitor: &dyn Monitor) -> Result<J::Found, Error> {
    job.finish(&[job.answers(bvh, 0..job.items(), monitor)?])
}

/// Hash of everything that the answers of a job depend on.
pub struct Key(Xxh3);

impl Key {
    /// Key of a job on the geometry that `geometry` adds.
    pub fn of<J: Job>(job: &J, geometry: impl FnOnce(&mut Self)) -> u64 {
        let mut key = Self(Xxh3::new());
        key.text(J::NAME);
        geometry(&mut key);
        job.identify(&mut key);
        key.0.digest()
    }

    /// Adds a text, such as the options of a job.
    pub fn text(&mut self, text: &str) {
        self.0.update(&(text.len() as u64).to_le_bytes());
        self.0.update(text.as_bytes());
    }

    /// Adds the length of the list and the bits of its numbers.
    pub fn vectors(&mut self, vectors: &[[f32; 3]]) {
        self.list(vectors.as_flattened(), |x| x.to_bits().to_le_bytes());
    }

    /// Adds the length of the list and the bits of its numbers.
    pub fn numbers(&mut self, numbers: &[f64]) {
        self.list(numbers, |x| x.to_bits().to_le_bytes());
    }

    fn list<T, const N: usize>(&mut self, numbers: &[T], bytes: fn(&T) -> [u8; N]) {
        self.0.update(&(numbers.len() as u64).to_le_bytes());
        for piece in numbers.chunks(1 << 12) {
            let bytes: Vec<u8> = piece.iter().flat_map(bytes).collect();
            self.0.update(&bytes);
        }
    }

    /// Adds a mesh: vertices, and three vertex indices of each triangle.
    pub fn mesh(&mut self, positions: &[[f32; 3]], indices: &[[u32; 3]]) {
        self.vectors(positions);
        self.0.update(&(indices.len() as u64).to_le_bytes());
        for corner in indices.as_flattened() {
            self.0.update(&corner.to_le_bytes());
        }
    }
}

/// Little-endian bytes of words.
pub(crate) fn bytes_of(words: &[u64]) -> Result<Vec<u8>, Error> {
    let mut bytes = memory::room("bytes of answers", size_of_val(words))?;
    bytes.extend(words.iter().flat_map(|word| word.to_le_bytes()));
    Ok(bytes)
}

/// Words of answers. Trailing bytes that fill no word are left out.
pub(crate) fn words_of(answers: &[Vec<u8>]) -> Result<Vec<u64>, Error> {
    let len = answers.iter().map(|bytes| bytes.len() / 8).sum();
    let mut all = memory::room("words of answers", len)?;
    let words = answers.iter().flat_map(|bytes| bytes.as_chunks::<8>().0);
    all.extend(words.map(|word| u64::from_le_bytes(*word)));
    Ok(all)
}

/// Numbers of answers, which are so many.
pub(crate) fn floats_of(answers: &[Vec<u8>], count: usize) -> Result<Vec<f32>, Error> {
    let mut all = memory::room("numbers of answers", count)?;
    let numbers = answers.iter().flat_map(|bytes| bytes.as_chunks::<4>().0);
    all.extend(numbers.map(|bytes| f32::from_le_bytes(*bytes)));
    let is_all = all.len() == count;
    is_all.then_some(all).ok_or(Error::Answers)
}
