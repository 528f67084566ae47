//! What rays hit: one answer for each ray.

use antumbra::{Batch, Bvh, Hit, PrimId, Ray};

use crate::arrays::{Answers, shared};
use crate::batch::{BatchOptions, FEW, PIECE, Rays};
use crate::single::{Surface, hit, occluder, surface};
use crate::status::{Failure, Status, guarded};

/// Memory of a thread that answers pieces.
struct Memory<A> {
    rays: Vec<Ray>,
    answers: Vec<A>,
}

impl<A> Default for Memory<A> {
    fn default() -> Self {
        Self {
            rays: Vec::new(),
            answers: Vec::new(),
        }
    }
}

/// Answers all rays, and writes what `told` makes of the answers.
fn answer<A: Copy + Default + Send, C: Copy + Send>(
    bvh: &Bvh,
    rays: &Rays<'_>,
    answers: &Answers<'_, C>,
    query: impl Fn(Batch<'_>, &mut [A]) + Sync + Send,
    told: impl Fn(A) -> C + Sync + Send,
) {
    let place = rays.place();
    let is_whole = rays.are_sorted();
    let piece = |memory: &mut Memory<A>, range: std::ops::Range<usize>| {
        let first = range.start;
        memory.answers.resize(range.len(), A::default());
        let found = &mut memory.answers[..];
        let is_shared = is_whole && !place.is_here();
        rays.with(bvh, range, is_shared, &mut memory.rays, |batch| {
            query(batch, found)
        });
        for (index, found) in found.iter().enumerate() {
            answers.set(first + index, told(*found));
        }
    };
    if is_whole {
        place.run(|| piece(&mut Memory::default(), 0..rays.count()));
    } else {
        place
            .unless_few(rays.count())
            .in_pieces(rays.count(), PIECE, piece);
    }
}

/// Returns for each ray whether anything lies in its interval, in a byte.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_occluded(
    bvh: *const Bvh,
    batch: *const BatchOptions,
    occluded: *mut u8,
    stride: usize,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (bvh, rays, occluded) = unsafe {
            let rays = Rays::new(batch)?;
            let occluded = Answers::new(occluded, rays.count(), stride, "occluded")?;
            (shared(bvh, "bvh")?, rays, occluded)
        };
        let is_packed = matches!(stride, 0 | 1);
        if !(is_packed && rays.are_in_place()) {
            let query = |batch: Batch<'_>, occluded: &mut [bool]| batch.occluded_into(occluded);
            answer(bvh, &rays, &occluded, query, u8::from);
            return Ok(());
        }
        let occluded = occluded.into_bools().unwrap_or_default();
        let (rays, place) = (&rays, rays.place());
        let mut work = move || {
            let range = 0..rays.count();
            rays.with(bvh, range, !place.is_here(), &mut Vec::new(), |batch| {
                batch.occluded_into(occluded)
            });
        };
        // So few rays stay on one thread.
        match rays.count() <= FEW {
            true => work(),
            false => place.run(work),
        }
        Ok(())
    })
}

/// Returns for each ray whether anything lies in its interval, in a bit.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_occluded_bits(
    bvh: *const Bvh,
    batch: *const BatchOptions,
    bits: *mut u64,
    word_count: usize,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (bvh, rays, bits) = unsafe {
            let bits = Answers::new(bits, word_count, 0, "bits")?;
            (shared(bvh, "bvh")?, Rays::new(batch)?, bits)
        };
        let (count, needed) = (rays.count(), rays.count().div_ceil(64));
        if word_count != needed {
            return Err(Failure::argument(format_args!(
                "`word_count` is {word_count}, and {count} rays need {needed} words"
            )));
        }
        let bits = bits.into_words("bits")?;
        let place = rays.place();
        if rays.are_in_place() || rays.are_sorted() {
            place.run(|| {
                rays.with(bvh, 0..count, !place.is_here(), &mut Vec::new(), |batch| {
                    batch.occluded_bits_into(bits)
                });
            });
            return Ok(());
        }
        // SAFETY: `bits` are ours until the end of the call. Pieces are of whole words, so no word is of two.
        let bits = unsafe { Answers::new(bits.as_mut_ptr(), bits.len(), 0, "bits") }?;
        let place = place.unless_few(count);
        place.in_pieces(count, PIECE, |memory: &mut Memory<u64>, range| {
            let first = range.start / 64;
            memory.answers.resize(range.len().div_ceil(64), 0);
            let words = &mut memory.answers[..];
            rays.with(bvh, range, false, &mut memory.rays, |batch| {
                batch.occluded_bits_into(words)
            });
            for (index, word) in words.iter().enumerate() {
                bits.set(first + index, *word);
            }
        });
        Ok(())
    })
}

/// A query with a structure for each ray.
macro_rules! query {
    ($name:ident, $doc:literal, $places:literal: $Found:ty, $Answer:ty, $query:expr, $told:expr) => {
        #[doc = $doc]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(
            bvh: *const Bvh,
            batch: *const BatchOptions,
            answers: *mut $Answer,
            stride: usize,
        ) -> Status {
            guarded(|| {
                // SAFETY: the header says what is at these addresses.
                let (bvh, rays, answers) = unsafe {
                    let rays = Rays::new(batch)?;
                    let answers = Answers::new(answers, rays.count(), stride, $places)?;
                    (shared(bvh, "bvh")?, rays, answers)
                };
                let query: fn(Batch<'_>, &mut [Option<$Found>]) = $query;
                answer(bvh, &rays, &answers, query, $told);
                Ok(())
            })
        }
    };
}

query!(
    antumbra_intersect,
    "Finds the closest hit of each ray.",
    "hits": Hit,
    Hit,
    |batch, hits| batch.intersect_into(hits),
    hit
);
query!(
    antumbra_surface_of,
    "Finds the closest hit of each ray, with position and normal.",
    "surfaces": antumbra::Surface,
    Surface,
    |batch, found| batch.surfaces_into(found),
    surface
);
query!(
    antumbra_occluder,
    "Finds any occluder of each ray.",
    "occluders": PrimId,
    PrimId,
    |batch, found| batch.occluders_into(found),
    occluder
);
