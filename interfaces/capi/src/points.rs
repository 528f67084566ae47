//! Queries about points: what is nearest, what is within a distance, what is inside, and how deep.

use std::sync::{Mutex, PoisonError};

use antumbra::{Bvh, INVALID_ID};

use crate::arrays::{Answers, Handle, Items, MaybeSlot, Versioned, sized};
use crate::batch::{THIS_THREAD, checked_flags};
use crate::interface::{frees, functions};
use crate::recipe::unknown;
use crate::status::{Failure, Outcome};
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
pub struct Points<'a> {
    points: Items<'a, [f32; 3]>,
    limits: Option<Items<'a, f32>>,
    place: Place<'a>,
}

impl<'a> Points<'a> {
    /// # Safety
    /// If the pointer is not null, it is of a structure as the header says.
    pub unsafe fn new(points: *const PointOptions) -> Outcome<Self> {
        // SAFETY: the caller's promise.
        let options = unsafe { sized(points, "points") }?;
        let flags = checked_flags(options.flags, THIS_THREAD, "points->flags")?;
        if options.reserved != 0 {
            return Err(unknown(options.reserved, "points->reserved"));
        }
        let (count, points) = (options.count, options.points.cast());
        // SAFETY: as above, for the arrays of the structure.
        let (points, limits, place) = unsafe {
            let (limits, stride) = (options.max_distances, options.max_distance_stride);
            (
                Items::new(points, count, options.point_stride, "points->points")?,
                Items::optional(limits, count, stride, "max_distances")?,
                Place::flagged(options.threads, flags)?,
            )
        };
        Ok(Self {
            points,
            limits,
            place,
        })
    }

    fn limit(&self, index: usize) -> f32 {
        self.limits
            .map_or(f32::INFINITY, |limits| limits.get(index))
    }

    /// Answers some points at a time, given the points and their limits.
    fn answer<A: Clone + Default + Send, C: Copy + Send>(
        &self,
        (answers, stride, name): (*mut C, usize, &str),
        query: impl Fn(&[[f32; 3]], &[f32], &mut [A]) + Sync + Send,
        told: impl Fn(&A) -> C + Sync + Send,
    ) -> Outcome {
        // SAFETY: the header says what is at this address of a call.
        let answers = unsafe { Answers::new(answers, self.points.count(), stride, name) }?;
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
        Ok(())
    }
}

/// Primitives near points, one list after the other, `antumbra_closest_lists`.
pub struct NearLists {
    splits: Vec<usize>,
    items: Vec<Near>,
}

functions! {
    /// Writes the nearest primitive of each point within its largest distance. At equal distances the smallest (inst_id, geom_id,
    /// prim_id).
    fn antumbra_closest(bvh: &Bvh, points: Points<'_>, closest: *mut Near, stride: usize) {
        let query = |points: &[[f32; 3]], limits: &[f32], found: &mut [_]| bvh.points(points).within(limits).closest_into(found);
        points.answer((closest, stride, "closest"), query, |found| found.map_or(Near::NOTHING, Near::from))
    }

    /// Writes for each point whether it is inside of a sphere or a closed mesh: a byte, 1 or 0. Exact if every edge is shared, with
    /// the same coordinates, by an even number of triangles. 0 for points that are not finite.
    fn antumbra_contains(bvh: &Bvh, points: Points<'_>, inside: *mut u8, stride: usize) {
        let query = |points: &[[f32; 3]], _: &[f32], found: &mut [bool]| bvh.points(points).inside_into(found);
        points.answer((inside, stride, "inside"), query, |found| u8::from(*found))
    }

    /// Writes the distance of the nearest surface from each point, negative inside, see antumbra_contains(). INFINITY if there is no
    /// geometry, NAN for points that are not finite.
    fn antumbra_signed_distance(bvh: &Bvh, points: Points<'_>, distances: *mut f32, stride: usize) {
        let query = |points: &[[f32; 3]], _: &[f32], found: &mut [f32]| bvh.points(points).signed_distances_into(found);
        points.answer((distances, stride, "distances"), query, |found| *found)
    }

    /// Writes how often closed surfaces go around each point: 1 in a mesh whose triangles turn counter-clockwise seen from outside, 0
    /// outside, the sum where bodies overlap.
    fn antumbra_winding_number(
        bvh: &Bvh,
        points: Points<'_>,
        numbers: *mut i32,
        stride: usize,
    ) {
        let query = |points: &[[f32; 3]], _: &[f32], found: &mut [i32]| {
            for (point, found) in points.iter().zip(found) {
                *found = bvh.winding_number(*point);
            }
        };
        points.answer((numbers, stride, "numbers"), query, |found| *found)
    }

    /// Lists all primitives within the largest distance of each point, the nearest first.
    fn antumbra_within(bvh: &Bvh, points: Points<'_>, lists: Handle<NearLists>) {
        let count = points.points.count();
        if points.limits.is_none() && count > 0 {
            return Err(Failure::argument("`max_distances` is null"));
        }
        let found = Mutex::new(vec![Vec::new(); count]);
        points.place.in_pieces(count, PIECE, |_: &mut (), range| {
            for index in range {
                let near = bvh.within(points.points.get(index), points.limit(index));
                found.lock().unwrap_or_else(PoisonError::into_inner)[index] = near;
            }
        });
        let found = found.into_inner().unwrap_or_else(PoisonError::into_inner);
        let mut joined = NearLists {
            splits: vec![0],
            items: Vec::with_capacity(found.iter().map(Vec::len).sum()),
        };
        for near in found {
            joined.items.extend(near.into_iter().map(Near::from));
            joined.splits.push(joined.items.len());
        }
        lists.give(joined);
        Ok(())
    }

    /// Lends the arrays, as antumbra_hit_lists_get().
    fn antumbra_closest_lists_get(
        lists: &NearLists,
        splits: MaybeSlot<*const usize>,
        items: MaybeSlot<*const Near>,
        item_count: MaybeSlot<usize>,
    ) {
        splits.put(lists.splits.as_ptr());
        items.put(lists.items.as_ptr());
        item_count.put(lists.items.len());
        Ok(())
    }
}

frees! {
    /// Frees lists of near primitives.
    fn antumbra_closest_lists_free(lists: NearLists);
}
