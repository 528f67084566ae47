//! All hits of rays: visited, counted, listed.

use std::ffi::c_void;
use std::sync::atomic::{AtomicI32, Ordering};

use antumbra::{Bvh, Hit, HitLists, Ray, Visit};

use crate::arrays::{Answers, Slot, shared, take_back};
use crate::batch::{BatchOptions, PIECE, Rays};
use crate::status::{Failure, Status, guarded, if_no_memory};

type OnHit = extern "C" fn(*mut c_void, usize, *const Hit) -> i32;

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

/// Calls a function with the hits of each ray, front to back.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_visit_hits(
    bvh: *const Bvh,
    batch: *const BatchOptions,
    visit: Option<OnHit>,
    data: *mut c_void,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (bvh, rays) = unsafe { (shared(bvh, "bvh")?, Rays::new(batch)?) };
        let Some(visit) = visit else {
            return Err(Failure::argument("`visit` is null"));
        };
        let wrong = AtomicI32::new(0);
        let visitor = Visitor { data, visit, wrong };
        let visitor = &visitor;
        rays.place().in_pieces(
            rays.count(),
            PIECE,
            |memory: &mut (Vec<Ray>, Vec<usize>), range| {
                let (gathered, states) = memory;
                states.clear();
                states.extend(range.clone());
                rays.with(bvh, range, false, gathered, |batch| {
                    batch.visit_hits(states, |ray, hit| visitor.visit(*ray, &hit));
                });
            },
        );
        match visitor.wrong.load(Ordering::Relaxed) {
            0 => Ok(()),
            wrong => Err(Failure::argument(format_args!(
                "`visit` returned {wrong}, which is neither ANTUMBRA_REJECT nor ANTUMBRA_ACCEPT nor ANTUMBRA_STOP"
            ))),
        }
    })
}

/// Counts the hits of each ray.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_count_hits(
    bvh: *const Bvh,
    batch: *const BatchOptions,
    counts: *mut u32,
    stride: usize,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (bvh, rays, answers) = unsafe {
            let rays = Rays::new(batch)?;
            let answers = Answers::new(counts, rays.count(), stride, "counts")?;
            (shared(bvh, "bvh")?, rays, answers)
        };
        rays.place()
            .in_pieces(rays.count(), PIECE / 4, |gathered, range| {
                let first = range.start;
                let counts = rays.with(bvh, range, false, gathered, |batch| batch.count_hits());
                for (index, count) in counts.into_iter().enumerate() {
                    answers.set(first + index, count);
                }
            });
        Ok(())
    })
}

/// Lists the hits of each ray.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_all_hits(
    bvh: *const Bvh,
    batch: *const BatchOptions,
    lists: *mut *mut HitLists,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (bvh, rays, slot) = unsafe {
            let slot = Slot::handle(lists, "lists")?;
            (shared(bvh, "bvh")?, Rays::new(batch)?, slot)
        };
        // A hit for each ray, and where its list ends.
        if_no_memory(
            rays.count(),
            size_of::<Hit>() + size_of::<usize>(),
            "lists of hits",
        )?;
        let place = rays.place();
        let lists = place.run(|| {
            let range = 0..rays.count();
            rays.with(bvh, range, !place.is_here(), &mut Vec::new(), |batch| {
                batch.all_hits()
            })
        });
        slot.give(lists);
        Ok(())
    })
}

/// Returns the arrays of lists of hits.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_hit_lists_get(
    lists: *const HitLists,
    splits: *mut *const usize,
    hits: *mut *const Hit,
    hit_count: *mut usize,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (lists, splits, hits, hit_count) = unsafe {
            (
                shared(lists, "lists")?,
                Slot::optional(splits, "splits")?,
                Slot::optional(hits, "hits")?,
                Slot::optional(hit_count, "hit_count")?,
            )
        };
        if let Some(splits) = splits {
            splits.put(lists.splits.as_ptr());
        }
        if let Some(hits) = hits {
            hits.put(lists.hits.as_ptr());
        }
        if let Some(hit_count) = hit_count {
            hit_count.put(lists.hits.len());
        }
        Ok(())
    })
}

/// Frees lists of hits.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_hit_lists_free(lists: *mut HitLists) {
    // SAFETY: the header says that a handle is freed once.
    unsafe { take_back(lists) }
}
