//! Queries about points: what is nearest, what is within a distance, what is inside, and how deep.

use antumbra::{Bvh, INVALID_ID};

use crate::arrays::{Answers, Items, Slot, Versioned, shared, sized, take_back};
use crate::batch::{THIS_THREAD, checked_flags};
use crate::status::{Failure, Outcome, Status, guarded};
use crate::threads::{Place, Threads};

/// Points that a thread takes at a time. The kernel keeps so many on the calling thread.
const PIECE: usize = 64;

/// Points with distances, `antumbra_points`.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct PointOptions {
    pub size: usize,
    pub count: usize,
    pub points: *const f32,
    pub point_stride: usize,
    pub max_distances: *const f32,
    pub max_distance_stride: usize,
    pub flags: u32,
    pub reserved: u32,
    pub threads: *const Threads,
}

// SAFETY: `repr(C)`, the size first, and then numbers and pointers, which are only used as the header says.
unsafe impl Versioned for PointOptions {
    const NAME: &'static str = "antumbra_points";
}

/// Where a primitive is nearest to a point, `antumbra_closest_point`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Near {
    pub distance: f32,
    pub position: [f32; 3],
    pub u: f32,
    pub v: f32,
    pub prim_id: u32,
    pub geom_id: u32,
    pub inst_id: u32,
}

impl Near {
    /// What the structure holds where nothing is near.
    const NOTHING: Self = Self {
        distance: f32::INFINITY,
        position: [f32::INFINITY; 3],
        u: 0.0,
        v: 0.0,
        prim_id: INVALID_ID,
        geom_id: INVALID_ID,
        inst_id: INVALID_ID,
    };
}

impl From<antumbra::ClosestPoint> for Near {
    fn from(found: antumbra::ClosestPoint) -> Self {
        Self {
            distance: found.distance,
            position: found.position,
            u: found.u,
            v: found.v,
            prim_id: found.prim_id,
            geom_id: found.geom_id,
            inst_id: found.inst_id,
        }
    }
}

/// Points of the caller, checked.
struct Points<'a> {
    points: Items<'a, [f32; 3]>,
    limits: Option<Items<'a, f32>>,
    place: Place<'a>,
}

impl Points<'_> {
    /// # Safety
    /// If the pointer is not null, it is of a structure as the header says.
    unsafe fn new(points: *const PointOptions) -> Outcome<Self> {
        // SAFETY: the caller's promise.
        let options = unsafe { sized(points, "points") }?;
        let PointOptions {
            count,
            max_distance_stride,
            ..
        } = options;
        let flags = checked_flags(options.flags, THIS_THREAD, "points->flags")?;
        if options.reserved != 0 {
            return Err(crate::recipe::unknown(options.reserved, "points->reserved"));
        }
        // SAFETY: as above, for the arrays of the structure.
        let (points, limits, place) = unsafe {
            (
                Items::new(
                    options.points.cast(),
                    count,
                    options.point_stride,
                    "points->points",
                )?,
                Items::optional(
                    options.max_distances,
                    count,
                    max_distance_stride,
                    "max_distances",
                )?,
                Place::of(options.threads)?,
            )
        };
        Ok(Self {
            points,
            limits,
            place: if flags & THIS_THREAD != 0 {
                Place::Here
            } else {
                place
            },
        })
    }

    fn limit(&self, index: usize) -> f32 {
        self.limits
            .map_or(f32::INFINITY, |limits| limits.get(index))
    }

    /// Answers some points at a time, given the points and their limits.
    fn answer<A: Clone + Default + Send, C: Copy + Send>(
        &self,
        answers: &Answers<'_, C>,
        query: impl Fn(&[[f32; 3]], &[f32], &mut [A]) + Sync + Send,
        told: impl Fn(&A) -> C + Sync + Send,
    ) {
        type Memory<A> = (Vec<[f32; 3]>, Vec<f32>, Vec<A>);
        (self.place).in_pieces(
            self.points.count(),
            PIECE,
            |memory: &mut Memory<A>, range| {
                let (points, limits, found) = memory;
                points.clear();
                points.extend(range.clone().map(|index| self.points.get(index)));
                limits.clear();
                limits.extend(range.clone().map(|index| self.limit(index)));
                found.resize(range.len(), A::default());
                query(points, limits, found);
                for (index, found) in range.zip(found) {
                    answers.set(index, told(found));
                }
            },
        );
    }
}

/// A query with an answer for each point.
macro_rules! query {
    ($name:ident, $doc:literal, $places:literal: $Found:ty, $Answer:ty, $query:expr, $told:expr) => {
        #[doc = $doc]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(
            bvh: *const Bvh,
            points: *const PointOptions,
            answers: *mut $Answer,
            stride: usize,
        ) -> Status {
            guarded(|| {
                // SAFETY: the header says what is at these addresses.
                let (bvh, points, answers) = unsafe {
                    let points = Points::new(points)?;
                    let answers = Answers::new(answers, points.points.count(), stride, $places)?;
                    (shared(bvh, "bvh")?, points, answers)
                };
                let query: fn(&Bvh, &[[f32; 3]], &[f32], &mut [$Found]) = $query;
                points.answer(
                    &answers,
                    |points, limits, found| query(bvh, points, limits, found),
                    $told,
                );
                Ok(())
            })
        }
    };
}

query!(
    antumbra_closest,
    "Finds the nearest primitive of each point.",
    "closest": Option<antumbra::ClosestPoint>,
    Near,
    |bvh, points, limits, found| bvh.points(points).within(limits).closest_into(found),
    |found| found.map_or(Near::NOTHING, Near::from)
);
query!(
    antumbra_contains,
    "Returns for each point whether it is inside.",
    "inside": bool,
    u8,
    |bvh, points, _, found| bvh.points(points).inside_into(found),
    |found| u8::from(*found)
);
query!(
    antumbra_signed_distance,
    "Returns the distance of each point, negative inside.",
    "distances": f32,
    f32,
    |bvh, points, _, found| bvh.points(points).signed_distances_into(found),
    |found| *found
);
query!(
    antumbra_winding_number,
    "Returns how often surfaces go around each point.",
    "numbers": i32,
    i32,
    |bvh, points, _, found| {
        for (point, found) in points.iter().zip(found) {
            *found = bvh.winding_number(*point);
        }
    },
    |found| *found
);

/// Primitives near points, one list after the other, `antumbra_closest_lists`.
pub struct NearLists {
    splits: Vec<usize>,
    items: Vec<Near>,
}

/// Lists the primitives within a distance of each point.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_within(
    bvh: *const Bvh,
    points: *const PointOptions,
    lists: *mut *mut NearLists,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (bvh, points, slot) = unsafe {
            let slot = Slot::handle(lists, "lists")?;
            (shared(bvh, "bvh")?, Points::new(points)?, slot)
        };
        if points.limits.is_none() && points.points.count() > 0 {
            return Err(Failure::argument("`max_distances` is null"));
        }
        let count = points.points.count();
        let found = std::sync::Mutex::new(vec![Vec::new(); count]);
        (points.place).in_pieces(count, PIECE, |_: &mut (), range| {
            for index in range {
                let near = bvh.within(points.points.get(index), points.limit(index));
                let mut found = found
                    .lock()
                    .unwrap_or_else(std::sync::PoisonError::into_inner);
                found[index] = near;
            }
        });
        let found = found
            .into_inner()
            .unwrap_or_else(std::sync::PoisonError::into_inner);
        let mut joined = NearLists {
            splits: vec![0],
            items: Vec::with_capacity(found.iter().map(Vec::len).sum()),
        };
        for near in found {
            joined.items.extend(near.into_iter().map(Near::from));
            joined.splits.push(joined.items.len());
        }
        slot.give(joined);
        Ok(())
    })
}

/// Returns the arrays of lists of near primitives.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_closest_lists_get(
    lists: *const NearLists,
    splits: *mut *const usize,
    items: *mut *const Near,
    item_count: *mut usize,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (lists, splits, items, item_count) = unsafe {
            (
                shared(lists, "lists")?,
                Slot::optional(splits, "splits")?,
                Slot::optional(items, "items")?,
                Slot::optional(item_count, "item_count")?,
            )
        };
        if let Some(splits) = splits {
            splits.put(lists.splits.as_ptr());
        }
        if let Some(items) = items {
            items.put(lists.items.as_ptr());
        }
        if let Some(item_count) = item_count {
            item_count.put(lists.items.len());
        }
        Ok(())
    })
}

/// Frees lists of near primitives.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_closest_lists_free(lists: *mut NearLists) {
    // SAFETY: the header says that a handle is freed once.
    unsafe { take_back(lists) }
}
