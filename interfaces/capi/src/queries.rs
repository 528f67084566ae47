//! What rays hit: one answer for each ray.

use antumbra::{Batch, Bvh, Hit, PrimId, Ray};

use crate::arrays::Answers;
use crate::batch::{FEW, PIECE, Rays};
use crate::interface::functions;
use crate::single::{Surface, hit, occluder, surface};
use crate::status::Failure;

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

functions! {
    /// Writes for each ray whether anything that counts is in its interval: a byte, 1 or 0. A bool of C has the size of a byte.
    fn antumbra_occluded(bvh: &Bvh, batch: Rays<'_>, occluded: *mut u8, stride: usize) {
        // SAFETY: the header says what is at this address.
        let occluded = unsafe { Answers::new(occluded, batch.count(), stride, "occluded") }?;
        let is_packed = matches!(stride, 0 | 1);
        if !(is_packed && batch.are_in_place()) {
            let query = |batch: Batch<'_>, occluded: &mut [bool]| batch.occluded_into(occluded);
            answer(bvh, &batch, &occluded, query, u8::from);
            return Ok(());
        }
        let occluded = occluded.into_bools().unwrap_or_default();
        let batch = &batch;
        let mut work = move || batch.whole(bvh, |rays| rays.occluded_into(occluded));
        // So few rays stay on one thread.
        match batch.count() <= FEW {
            true => work(),
            false => batch.place().run(work),
        }
        Ok(())
    }

    /// antumbra_occluded() with a bit for each ray: bit i % 64 of bits[i / 64]. Bits behind the last ray become 0. `word_count` must
    /// be (count + 63) / 64, and `bits` a multiple of 8 bytes.
    fn antumbra_occluded_bits(bvh: &Bvh, batch: Rays<'_>, bits: *mut u64, word_count: usize) {
        // SAFETY: the header says what is at this address.
        let bits = unsafe { Answers::new(bits, word_count, 0, "bits") }?;
        let (count, needed) = (batch.count(), batch.count().div_ceil(64));
        if word_count != needed {
            return Err(Failure::argument(format_args!(
                "`word_count` is {word_count}, and {count} rays need {needed} words"
            )));
        }
        let bits = bits.into_words("bits")?;
        let place = batch.place();
        if batch.are_in_place() || batch.are_sorted() {
            place.run(|| batch.whole(bvh, |rays| rays.occluded_bits_into(bits)));
            return Ok(());
        }
        // SAFETY: `bits` are ours until the end of the call. Pieces are of whole words, so no word is of two.
        let bits = unsafe { Answers::new(bits.as_mut_ptr(), bits.len(), 0, "bits") }?;
        let place = place.unless_few(count);
        place.in_pieces(count, PIECE, |memory: &mut Memory<u64>, range| {
            let first = range.start / 64;
            memory.answers.resize(range.len().div_ceil(64), 0);
            let words = &mut memory.answers[..];
            batch.with(bvh, range, false, &mut memory.rays, |rays| {
                rays.occluded_bits_into(words)
            });
            for (index, word) in words.iter().enumerate() {
                bits.set(first + index, *word);
            }
        });
        Ok(())
    }

    /// Writes the closest hit of each ray that counts.
    fn antumbra_intersect(bvh: &Bvh, batch: Rays<'_>, hits: *mut Hit, stride: usize) {
        // SAFETY: the header says what is at this address.
        let answers = unsafe { Answers::new(hits, batch.count(), stride, "hits") }?;
        let query = |batch: Batch<'_>, found: &mut [_]| batch.intersect_into(found);
        answer(bvh, &batch, &answers, query, hit);
        Ok(())
    }

    /// Writes the closest hit of each ray that counts, with position and normal. Takes about 1.25 times as long as
    /// antumbra_intersect().
    fn antumbra_surface_of(bvh: &Bvh, batch: Rays<'_>, surfaces: *mut Surface, stride: usize) {
        // SAFETY: the header says what is at this address.
        let answers = unsafe { Answers::new(surfaces, batch.count(), stride, "surfaces") }?;
        let query = |batch: Batch<'_>, found: &mut [_]| batch.surfaces_into(found);
        answer(bvh, &batch, &answers, query, surface);
        Ok(())
    }

    /// Writes any primitive that occludes each ray, not the closest one: see antumbra_occluder1(). Takes about 1.25 times as long as
    /// antumbra_occluded().
    fn antumbra_occluder(bvh: &Bvh, batch: Rays<'_>, occluders: *mut PrimId, stride: usize) {
        // SAFETY: the header says what is at this address.
        let answers = unsafe { Answers::new(occluders, batch.count(), stride, "occluders") }?;
        let query = |batch: Batch<'_>, found: &mut [_]| batch.occluders_into(found);
        answer(bvh, &batch, &answers, query, occluder);
        Ok(())
    }
}
