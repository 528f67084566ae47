//! Groups: rays from many points in the same directions.

use std::borrow::Cow;

use antumbra::{Bvh, Directions};

use crate::arrays::{Answers, Handle, Items, Versioned, sized};
use crate::batch::{THIS_THREAD, checked_flags};
use crate::interface::{frees, functions};
use crate::status::{Failure, Outcome, Status};
use crate::threads::{Place, Threads};

/// Points that look in directions, `antumbra_group`.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct GroupOptions {
    pub size: usize,
    pub count: usize,
    pub points: *const f32,
    pub point_stride: usize,
    pub normals: *const f32,
    pub normal_stride: usize,
    pub tnear: *const f32,
    pub tnear_stride: usize,
    pub tfar: f32,
    pub flags: u32,
    pub threads: *const Threads,
}

// SAFETY: `repr(C)`, the size first, and then numbers and pointers, which are only used as the header says.
unsafe impl Versioned for GroupOptions {
    const NAME: &'static str = "antumbra_group";
}

/// Points of a group, checked.
pub struct Points<'a> {
    points: Cow<'a, [[f32; 3]]>,
    normals: Option<Cow<'a, [[f32; 3]]>>,
    tnear: Option<Cow<'a, [f32]>>,
    tfar: f32,
    place: Place<'a>,
}

impl<'a> Points<'a> {
    /// # Safety
    /// If the pointer is not null, it is of a structure as the header says.
    pub unsafe fn new(group: *const GroupOptions) -> Outcome<Self> {
        // SAFETY: the caller's promise.
        let group = unsafe { sized(group, "group") }?;
        let GroupOptions { count, tfar, .. } = group;
        let flags = checked_flags(group.flags, THIS_THREAD, "group->flags")?;
        // SAFETY: as above, for the arrays of the structure.
        let (points, normals, tnear, place) = unsafe {
            let (points, normals) = (group.points.cast(), group.normals.cast());
            (
                Items::new(points, count, group.point_stride, "points")?,
                Items::optional(normals, count, group.normal_stride, "normals")?,
                Items::optional(group.tnear, count, group.tnear_stride, "tnear")?,
                Place::flagged(group.threads, flags)?,
            )
        };
        Ok(Self {
            points: points.all(),
            normals: normals.map(|normals| normals.all()),
            tnear: tnear.map(|tnear| tnear.all()),
            tfar,
            place,
        })
    }
}

functions! {
    /// Prepares directions of 3 floats, of any length. A direction that is zero, not finite or shorter than 3e-39 has the bit 0
    /// for all points.
    fn antumbra_directions_new(
        directions: *const f32,
        count: usize,
        stride: usize,
        prepared: Handle<Directions>,
    ) {
        // SAFETY: the header says what is at this address.
        let directions = unsafe { Items::new(directions.cast(), count, stride, "directions") }?;
        if u32::try_from(count).is_err() {
            return Err(Failure::new(Status::TooMany, "more than 2^32 directions"));
        }
        prepared.give(Directions::new(&directions.all()));
        Ok(())
    }

    /// Writes which rays nothing is in the way of: bit j % 64 of bits[i * words_per_row + j / 64] is of point i and direction j.
    /// Bits behind the last direction become 0. `words_per_row` must be (directions + 63) / 64, and `bits` a multiple of 8 bytes. Each
    /// answer equals the answer of antumbra_occluded1().
    fn antumbra_group_open(
        bvh: &Bvh,
        group: Points<'_>,
        directions: &Directions,
        bits: *mut u64,
        words_per_row: usize,
    ) {
        let needed = directions.len().div_ceil(64);
        if words_per_row != needed {
            return Err(Failure::argument(format_args!(
                "`words_per_row` is {words_per_row}, and {} directions need {needed} words",
                directions.len()
            )));
        }
        let Some(words) = group.points.len().checked_mul(needed) else {
            return Err(Failure::argument("more rays than any memory has bits for"));
        };
        // SAFETY: the header says what is at this address.
        let bits = unsafe { Answers::new(bits, words, 0, "bits") }?.into_words("bits")?;
        let mut rays = bvh.group(&group.points, directions).far(group.tfar);
        if let Some(normals) = &group.normals {
            rays = rays.above(normals);
        }
        if let Some(tnear) = &group.tnear {
            rays = rays.near(tnear);
        }
        if group.place.is_here() {
            rays.on_this_thread().open_into(bits);
        } else {
            group.place.run(|| rays.open_into(bits));
        }
        Ok(())
    }
}

frees! {
    /// Frees directions.
    fn antumbra_directions_free(directions: Directions);
}
