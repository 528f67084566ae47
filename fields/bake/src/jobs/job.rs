//! Jobs: bakes as items that are computed in any order and in any share, and their keys.

use std::ops::Range;

use antumbra::{Bvh, Ray};
use rayon::prelude::*;
use xxhash_rust::xxh3::Xxh3;

use crate::Progress;
use crate::points::curve::Places;
use crate::{Error, Monitor, memory};

/// Answers of some items of a [`Job`].
pub type Answers<J> = Result<Vec<<J as Job>::Number>, Error>;

/// A bake of numbered items, such as points.
///
/// The answers of an item depend on the item only. So items may be computed at different times and on different machines:
/// see [`Work`](crate::Work). [`run`] computes all of them at once.
pub trait Job: Sync {
    /// Result of the whole job.
    type Found;

    /// Kind of the numbers that answers are made of, and that files keep.
    type Number: Number;

    /// Name and version of the answers, part of the [`Key`].
    const NAME: &'static str;

    /// How much there is to do.
    fn size(&self) -> Size;

    /// Adds everything that answers depend on, except the geometry.
    fn identify(&self, key: &mut Key);

    /// Numbers of some items, one item after the other.
    ///
    /// # Errors
    /// [`Error`] if the job makes no sense, or if `monitor` cancels.
    fn answers(&self, bvh: &Bvh, items: Range<usize>, monitor: &dyn Monitor) -> Answers<Self>;

    /// Result of the numbers of all items.
    ///
    /// # Errors
    /// [`Error::Answers`] if the numbers do not fit this job.
    fn found(&self, numbers: Vec<Self::Number>) -> Result<Self::Found, Error>;

    /// Points that are the items, if [`Job::found`] takes their numbers in the order of the list instead of the curve.
    fn places(&self) -> Option<&Places> {
        None
    }

    /// Some rays of the job: `count` at most, and `per_item` of each item. None if trees cannot learn from this job.
    fn training_rays(&self, bvh: &Bvh, count: usize, per_item: usize) -> Vec<Ray> {
        let _ = (bvh, count, per_item);
        Vec::new()
    }
}

/// How much a [`Job`] has to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Number of items.
    pub items: usize,
    /// Number of rays of one item, about.
    pub rays: u64,
    /// How many numbers an item has.
    pub numbers: Numbers,
}

impl Size {
    /// So many items with so many rays and numbers each.
    pub fn each(items: usize, rays: u64, numbers: usize) -> Self {
        let numbers = Numbers::Each(numbers);
        Self {
            items,
            rays,
            numbers,
        }
    }
}

/// How many numbers an item of a [`Job`] has. All are kept until the end of the job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Numbers {
    /// As many as all others.
    Each(usize),
    /// Not fewer than these.
    AtLeast(usize),
}

/// A number that files of answers keep in little-endian order.
pub trait Number: Copy + Send + Sync {
    /// Appends the bytes of the number.
    fn write(self, bytes: &mut Vec<u8>);

    /// The number that has these bytes, which are as many as it takes.
    fn read(bytes: &[u8]) -> Self;
}

macro_rules! numbers {
    ($($kind:ty),*) => {$(
        impl Number for $kind {
            fn write(self, bytes: &mut Vec<u8>) {
                bytes.extend(self.to_le_bytes());
            }

            fn read(bytes: &[u8]) -> Self {
                Self::from_le_bytes(bytes.try_into().unwrap_or_default())
            }
        }
    )*};
}
numbers!(u8, u64, f32);

/// Answers that all threads compute: `of` computes the answers of a piece of so many items.
pub(crate) fn in_pieces<T: Number>(
    items: Range<usize>,
    each: usize,
    monitor: &dyn Monitor,
    of: impl Fn(Range<usize>) -> Result<Vec<T>, Error> + Sync,
) -> Result<Vec<T>, Error> {
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
    finish(job, job.answers(bvh, 0..job.size().items, monitor)?)
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

    /// Adds points and their normals.
    pub fn places(&mut self, places: &Places) {
        self.vectors(&places.points);
        self.vectors(&places.normals);
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

/// Result of the numbers of all items, in the order in which they were computed.
fn finish<J: Job>(job: &J, mut numbers: Vec<J::Number>) -> Result<J::Found, Error> {
    let size = job.size();
    if let Numbers::Each(each) = size.numbers {
        if numbers.len() != size.items * each {
            return Err(Error::Answers);
        }
        if let Some(places) = job.places().filter(|_| each > 0) {
            places.put_back(each, &mut numbers);
        }
    }
    job.found(numbers)
}

/// Bytes of answers.
pub(crate) fn bytes_of<T: Number>(numbers: &[T]) -> Result<Vec<u8>, Error> {
    let mut bytes = memory::room("bytes of answers", size_of_val(numbers))?;
    numbers.iter().for_each(|number| number.write(&mut bytes));
    Ok(bytes)
}

/// Result of the bytes of all answers, which may come in pieces.
pub(crate) fn finish_bytes<J: Job>(job: &J, pieces: &[Vec<u8>]) -> Result<J::Found, Error> {
    let size = size_of::<J::Number>();
    let count = pieces.iter().map(|bytes| bytes.len() / size).sum();
    let mut numbers = memory::room("numbers of answers", count)?;
    let all = pieces.iter().flat_map(|bytes| bytes.chunks_exact(size));
    numbers.extend(all.map(J::Number::read));
    finish(job, numbers)
}
