//! Groups: rays from many points in the same directions.

use std::borrow::Cow;

use antumbra::{Bvh, Directions};

use crate::arrays::{Answers, Items, Plain, Slot, Versioned, shared, sized, take_back};
use crate::batch::{THIS_THREAD, checked_flags};
use crate::status::{Failure, Outcome, Status, guarded};
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

/// Items as a list: where they are, or copied.
pub fn all<'a, T: Plain>(items: &Items<'a, T>) -> Cow<'a, [T]> {
    (items.as_slice()).map_or_else(|| Cow::Owned(items.to_vec()), Cow::Borrowed)
}

/// Prepares directions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_directions_new(
    directions: *const f32,
    count: usize,
    stride: usize,
    prepared: *mut *mut Directions,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (slot, directions) = unsafe {
            let slot = Slot::handle(prepared, "prepared")?;
            (
                slot,
                Items::<[f32; 3]>::new(directions.cast(), count, stride, "directions")?,
            )
        };
        if u32::try_from(count).is_err() {
            return Err(Failure::new(Status::TooMany, "more than 2^32 directions"));
        }
        slot.give(Directions::new(&all(&directions)));
        Ok(())
    })
}

/// Frees directions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_directions_free(directions: *mut Directions) {
    // SAFETY: the header says that a handle is freed once.
    unsafe { take_back(directions) }
}

/// Points of a group, checked.
struct Points<'a> {
    points: Cow<'a, [[f32; 3]]>,
    normals: Option<Cow<'a, [[f32; 3]]>>,
    tnear: Option<Cow<'a, [f32]>>,
    tfar: f32,
    place: Place<'a>,
}

impl Points<'_> {
    /// # Safety
    /// If the pointer is not null, it is of a structure as the header says.
    unsafe fn new(group: *const GroupOptions) -> Outcome<Self> {
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
                Place::of(group.threads)?,
            )
        };
        Ok(Self {
            points: all(&points),
            normals: normals.map(|normals| all(&normals)),
            tnear: tnear.map(|tnear| all(&tnear)),
            tfar,
            place: if flags & THIS_THREAD != 0 {
                Place::Here
            } else {
                place
            },
        })
    }
}

/// Returns which rays nothing is in the way of, a row of bits for each point.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_group_open(
    bvh: *const Bvh,
    group: *const GroupOptions,
    directions: *const Directions,
    bits: *mut u64,
    words_per_row: usize,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (bvh, group, directions) = unsafe {
            let directions = shared(directions, "directions")?;
            (shared(bvh, "bvh")?, Points::new(group)?, directions)
        };
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
        // SAFETY: as above.
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
    })
}
