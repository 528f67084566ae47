//! All hits of rays: visited, counted, listed.

use std::ffi::c_void;
use std::sync::atomic::{AtomicI32, Ordering};

use antumbra::{Bvh, Hit, HitLists, Ray, Visit};

use crate::arrays::{Answers, Handle, MaybeSlot};
use crate::batch::{PIECE, Rays};
use crate::interface::{frees, functions};
use crate::status::{Failure, if_no_memory};

pub type OnHit = extern "C" fn(*mut c_void, usize, *const Hit) -> i32;

/// A visitor with its data.
struct Visitor {
    data: *mut c_void,
    visit: OnHit,
    /// An answer that stands for nothing.
    wrong: AtomicI32,
}

// SAFETY: the library never looks at what `data` points to. The header says that visitors are called from any thread.
unsafe impl Sync for Visitor {}

impl Visitor {
    fn visit(&self, ray: usize, hit: &Hit) -> Visit {
        match (self.visit)(self.data, ray, hit) {
            0 => Visit::Reject,
            1 => Visit::Accept,
            2 => Visit::Stop,
            wrong => {
                self.wrong.store(wrong, Ordering::Relaxed);
                Visit::Stop
            }
        }
    }
}

functions! {
    /// Calls `visit` with the hits of each ray that count, front to back, until it returns something else than ANTUMBRA_REJECT.
    /// `ray` is the number of the ray in the batch. Calls for one ray come one after another; different rays may be on different
    /// threads. For shadow rays through glass, and whatever accumulates along a ray.
    ///
    /// Errors: INVALID_ARGUMENT, also if `visit` returns an unknown number, which ends the ray.
    fn antumbra_visit_hits(
        bvh: &Bvh,
        batch: Rays<'_>,
        visit: Option<OnHit>,
        data: *mut c_void,
    ) {
        let visit = visit.ok_or_else(|| Failure::argument("`visit` is null"))?;
        let wrong = AtomicI32::new(0);
        let visitor = Visitor { data, visit, wrong };
        let visitor = &visitor;
        let visit = |memory: &mut (Vec<Ray>, Vec<usize>), range: std::ops::Range<usize>| {
            let (gathered, states) = memory;
            states.clear();
            states.extend(range.clone());
            batch.with(bvh, range, false, gathered, |rays| {
                rays.visit_hits(states, |ray, hit| visitor.visit(*ray, &hit));
            });
        };
        batch.place().in_pieces(batch.count(), PIECE, visit);
        match visitor.wrong.load(Ordering::Relaxed) {
            0 => Ok(()),
            wrong => Err(Failure::argument(format_args!(
                "`visit` returned {wrong}, which is neither ANTUMBRA_REJECT nor ANTUMBRA_ACCEPT nor ANTUMBRA_STOP"
            ))),
        }
    }

    /// Writes the number of hits of each ray that count.
    fn antumbra_count_hits(bvh: &Bvh, batch: Rays<'_>, counts: *mut u32, stride: usize) {
        // SAFETY: the header says what is at this address.
        let answers = unsafe { Answers::new(counts, batch.count(), stride, "counts") }?;
        let place = batch.place();
        place.in_pieces(batch.count(), PIECE / 4, |gathered, range| {
            let first = range.start;
            let counts = batch.with(bvh, range, false, gathered, |rays| rays.count_hits());
            for (index, count) in counts.into_iter().enumerate() {
                answers.set(first + index, count);
            }
        });
        Ok(())
    }

    /// Lists all hits of each ray that count.
    fn antumbra_all_hits(bvh: &Bvh, batch: Rays<'_>, lists: Handle<HitLists>) {
        // A hit for each ray, and where its list ends.
        let each = size_of::<Hit>() + size_of::<usize>();
        if_no_memory(batch.count(), each, "lists of hits")?;
        let found = batch.place().run(|| batch.whole(bvh, |rays| rays.all_hits()));
        lists.give(found);
        Ok(())
    }

    /// Lends the arrays: hits of ray i are hits[splits[i]] to hits[splits[i + 1] - 1]. `splits` has one number more than there are
    /// rays, the last is `hit_count`. The arrays live as long as the lists. Each of the three may be NULL.
    fn antumbra_hit_lists_get(
        lists: &HitLists,
        splits: MaybeSlot<*const usize>,
        hits: MaybeSlot<*const Hit>,
        hit_count: MaybeSlot<usize>,
    ) {
        splits.put(lists.splits.as_ptr());
        hits.put(lists.hits.as_ptr());
        hit_count.put(lists.hits.len());
        Ok(())
    }
}

frees! {
    /// Frees lists of hits.
    fn antumbra_hit_lists_free(lists: HitLists);
}
