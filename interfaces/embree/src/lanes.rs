//! Many rays: packets of 4, 8 and 16, and streams as in Embree 3.
//!
//! Plain rays go to the kernel in batches, which form packets and streams of their own. Others are answered one by one.

use std::ffi::c_int;

use antumbra::{Hit, Ray};

use crate::abi::{Arguments, Context, RAY_FIELDS, RtcHit, RtcRay};
use crate::commit::Committed;
use crate::failure::{Failure, Outcome};
use crate::filter::Query;
use crate::query::{Way, start};
use crate::scene::{Scene, with};

/// One ray of many: its fields are so many numbers apart.
#[derive(Clone, Copy)]
pub struct Lane {
    /// The first field of the ray.
    pub first: *mut f32,
    pub stride: usize,
}

impl Lane {
    #[inline(always)]
    unsafe fn get(self, field: usize) -> f32 {
        // SAFETY: the caller vouches for rays with all fields.
        unsafe { self.first.add(field * self.stride).read() }
    }

    #[inline(always)]
    unsafe fn set(self, field: usize, value: f32) {
        // SAFETY: the caller vouches for rays with all fields.
        unsafe { self.first.add(field * self.stride).write(value) }
    }

    #[inline(always)]
    unsafe fn ray(self) -> RtcRay {
        // SAFETY: the caller vouches for rays with all fields.
        let get = |field: usize| unsafe { self.get(field) };
        RtcRay {
            org: [get(0), get(1), get(2)],
            tnear: get(3),
            dir: [get(4), get(5), get(6)],
            time: get(7),
            tfar: get(8),
            mask: get(9).to_bits(),
            id: get(10).to_bits(),
            flags: get(11).to_bits(),
        }
    }

    unsafe fn set_occluded(self) {
        // SAFETY: the caller vouches for rays with all fields.
        unsafe { self.set(8, f32::NEG_INFINITY) }
    }

    /// Writes a distance and a hit.
    ///
    /// # Safety
    /// The ray has a hit behind it.
    #[inline]
    pub unsafe fn set_hit(self, t: f32, hit: &RtcHit) {
        // SAFETY: the caller vouches for rays with hits behind them.
        unsafe {
            self.set(8, t);
            let numbers = [hit.ng[0], hit.ng[1], hit.ng[2], hit.u, hit.v];
            for (field, number) in numbers.into_iter().enumerate() {
                self.set(RAY_FIELDS + field, number);
            }
            let ids = [hit.prim_id, hit.geom_id, hit.inst_id, hit.inst_prim_id];
            for (field, id) in ids.into_iter().enumerate() {
                self.set(RAY_FIELDS + 5 + field, f32::from_bits(id));
            }
        }
    }
}

/// Where many rays are.
trait Lanes {
    fn count(&self) -> usize;
    /// `None` of a ray that is not to be traced.
    ///
    /// # Safety
    /// The memory is as the client says.
    unsafe fn lane(&self, index: usize) -> Option<Lane>;
}

/// A packet. Rays count where `valid` is -1.
struct Packet<const N: usize> {
    valid: *const c_int,
    first: *mut f32,
}

impl<const N: usize> Lanes for Packet<N> {
    fn count(&self) -> usize {
        N
    }

    #[inline(always)]
    unsafe fn lane(&self, index: usize) -> Option<Lane> {
        // SAFETY: N flags, as the client says.
        let is_active = unsafe { *self.valid.add(index) == -1 };
        is_active.then(|| Lane {
            first: self.first.wrapping_add(index),
            stride: N,
        })
    }
}

/// Rays, or packets of `size` of them, at a stride in bytes.
struct Strided {
    first: *mut u8,
    size: usize,
    packets: usize,
    stride: usize,
}

impl Lanes for Strided {
    fn count(&self) -> usize {
        self.size * self.packets
    }

    #[inline(always)]
    unsafe fn lane(&self, index: usize) -> Option<Lane> {
        let packet = self.first.wrapping_add(index / self.size * self.stride);
        Some(Lane {
            first: packet.cast::<f32>().wrapping_add(index % self.size),
            stride: self.size,
        })
    }
}

/// Pointers to rays.
struct Pointers {
    rays: *const *mut f32,
    count: usize,
}

impl Lanes for Pointers {
    fn count(&self) -> usize {
        self.count
    }

    unsafe fn lane(&self, index: usize) -> Option<Lane> {
        // SAFETY: so many pointers, as the client says.
        let first = unsafe { *self.rays.add(index) };
        (!first.is_null()).then_some(Lane { first, stride: 1 })
    }
}

/// Occlusion of many rays, at most `N` at a time.
///
/// # Safety
/// The memory is as the client says.
unsafe fn occluded_many<const N: usize>(
    committed: &Committed,
    lanes: &impl Lanes,
    arguments: Option<&Arguments>,
) {
    let bvh = committed.bvh();
    let mut rays = [const {
        Ray {
            org: [0.0; 3],
            tnear: 0.0,
            dir: [0.0; 3],
            tfar: 0.0,
        }
    }; N];
    let mut places = [Lane {
        first: std::ptr::null_mut(),
        stride: 0,
    }; N];
    let mut answers = [false; N];
    let mut pending = 0;
    for index in 0..lanes.count() {
        // SAFETY: as the caller vouches.
        unsafe {
            if let Some(lane) = lanes.lane(index) {
                let ray = lane.ray();
                if committed.way(Query::Occluded, ray.mask, arguments) == Way::Plain {
                    rays[pending] = committed.kernel_ray(&ray);
                    places[pending] = lane;
                    pending += 1;
                } else if committed.occluded(&ray, arguments) {
                    lane.set_occluded();
                }
            }
            if pending == N || (pending > 0 && index + 1 == lanes.count()) {
                let (rays, answers) = (&rays[..pending], &mut answers[..pending]);
                if pending < FEW {
                    for (ray, answer) in rays.iter().zip(&mut *answers) {
                        *answer = bvh.occluded(ray);
                    }
                } else {
                    bvh.batch(rays).on_this_thread().occluded_into(answers);
                }
                for (lane, is_occluded) in places.iter().zip(answers) {
                    if *is_occluded {
                        lane.set_occluded();
                    }
                }
                pending = 0;
            }
        }
    }
}

/// Fewer rays are answered one by one: what a batch prepares takes longer.
const FEW: usize = 12;

/// Closest hits of many rays, at most `N` at a time.
///
/// # Safety
/// The memory is as the client says.
unsafe fn intersect_many<const N: usize>(
    committed: &Committed,
    lanes: &impl Lanes,
    arguments: Option<&Arguments>,
) {
    let bvh = committed.bvh();
    let mut rays = [const {
        Ray {
            org: [0.0; 3],
            tnear: 0.0,
            dir: [0.0; 3],
            tfar: 0.0,
        }
    }; N];
    let mut places = [Lane {
        first: std::ptr::null_mut(),
        stride: 0,
    }; N];
    let mut answers: [Option<Hit>; N] = [None; N];
    let mut pending = 0;
    for index in 0..lanes.count() {
        // SAFETY: as the caller vouches.
        unsafe {
            if let Some(lane) = lanes.lane(index) {
                let ray = lane.ray();
                if committed.way(Query::Intersect, ray.mask, arguments) == Way::Plain {
                    rays[pending] = committed.kernel_ray(&ray);
                    places[pending] = lane;
                    pending += 1;
                } else if let Some((t, hit)) = committed.intersect(&ray, arguments) {
                    lane.set_hit(t, &hit);
                }
            }
            if pending == N || (pending > 0 && index + 1 == lanes.count()) {
                let (rays, answers) = (&rays[..pending], &mut answers[..pending]);
                if pending < FEW {
                    for (ray, answer) in rays.iter().zip(&mut *answers) {
                        *answer = bvh.intersect(ray);
                    }
                } else {
                    bvh.batch(rays).on_this_thread().intersect_into(answers);
                }
                for (lane, answer) in places.iter().zip(answers) {
                    if let Some(hit) = answer {
                        let (t, hit) = committed.found(&lane.ray(), hit, None);
                        lane.set_hit(t, &hit);
                    }
                }
                pending = 0;
            }
        }
    }
}

/// Rays of a stream that go to the kernel at a time.
const STREAM: usize = 512;

/// Answers a packet.
///
/// # Safety
/// A scene of this library, `N` flags, a packet and arguments, or null ones.
unsafe fn packet<const N: usize>(
    query: Query,
    valid: *const c_int,
    scene: *const Scene,
    first: *mut f32,
    arguments: *const Arguments,
) {
    // SAFETY: the caller's handle and memory.
    unsafe {
        with(scene, (), |scene| {
            let (committed, arguments) = start(scene, arguments)?;
            if valid.is_null() || first.is_null() {
                return Err(Failure::argument("a pointer is null"));
            }
            let lanes = Packet::<N> { valid, first };
            match query {
                Query::Intersect => intersect_many::<N>(committed, &lanes, arguments),
                Query::Occluded => occluded_many::<N>(committed, &lanes, arguments),
            }
            Ok(())
        })
    }
}

/// Answers a stream. The context is handed to functions of the client, and may be null.
///
/// # Safety
/// A scene of this library, and memory as the client says.
unsafe fn stream(
    query: Query,
    scene: *const Scene,
    context: *mut Context,
    lanes: Outcome<impl Lanes>,
) {
    // SAFETY: the caller's handle and memory.
    unsafe {
        with(scene, (), |scene| {
            let committed = scene.committed()?;
            let lanes = lanes?;
            let arguments = Arguments {
                flags: 0,
                feature_mask: -1,
                context,
                filter: None,
                user: None,
            };
            match query {
                Query::Intersect => intersect_many::<STREAM>(committed, &lanes, Some(&arguments)),
                Query::Occluded => occluded_many::<STREAM>(committed, &lanes, Some(&arguments)),
            }
            Ok(())
        })
    }
}

/// Rays at a stride.
fn strided(
    first: *mut f32,
    size: u32,
    packets: u32,
    stride: usize,
    fields: usize,
) -> Outcome<Strided> {
    if size == 0 || (first.is_null() && packets > 0) {
        return Err(Failure::argument(
            "a stream is null, or its packets are empty",
        ));
    }
    let bytes = 4 * fields * size as usize;
    if packets > 1 && (stride < bytes || !stride.is_multiple_of(4)) {
        return Err(Failure::argument(format!(
            "a stride of {stride} bytes for rays of {bytes} bytes"
        )));
    }
    Ok(Strided {
        first: first.cast(),
        size: size as usize,
        packets: packets as usize,
        stride,
    })
}

fn pointers(rays: *const *mut f32, count: u32) -> Outcome<Pointers> {
    if rays.is_null() && count > 0 {
        return Err(Failure::argument("a pointer is null"));
    }
    Ok(Pointers {
        rays,
        count: count as usize,
    })
}

macro_rules! packets {
    ($($size:literal: $intersect:ident $occluded:ident $traversable_intersect:ident $traversable_occluded:ident;)*) => {$(
        packets!(@ $intersect, Intersect, $size);
        packets!(@ $occluded, Occluded, $size);
        packets!(@ $traversable_intersect, Intersect, $size);
        packets!(@ $traversable_occluded, Occluded, $size);
    )*};
    (@ $name:ident, $query:ident, $size:literal) => {
        /// # Safety
        /// A scene of this library, flags, a packet and arguments, or null ones.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(
            valid: *const c_int,
            scene: *const Scene,
            rays: *mut f32,
            arguments: *const Arguments,
        ) {
            // SAFETY: the caller's handle and memory.
            unsafe { packet::<$size>(Query::$query, valid, scene, rays, arguments) }
        }
    };
}

packets! {
    4: rtcIntersect4 rtcOccluded4 rtcTraversableIntersect4 rtcTraversableOccluded4;
    8: rtcIntersect8 rtcOccluded8 rtcTraversableIntersect8 rtcTraversableOccluded8;
    16: rtcIntersect16 rtcOccluded16 rtcTraversableIntersect16 rtcTraversableOccluded16;
}

macro_rules! streams {
    ($($query:ident, $fields:ident: $m:ident $mp:ident $nm:ident;)*) => {$(
        /// `count` rays, each `stride` bytes behind the one before.
        ///
        /// # Safety
        /// A scene of this library, and so many rays.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $m(
            scene: *const Scene,
            context: *mut Context,
            rays: *mut f32,
            count: u32,
            stride: usize,
        ) {
            // SAFETY: the caller's handle and memory.
            unsafe { stream(Query::$query, scene, context, strided(rays, 1, count, stride, $fields)) }
        }

        /// Pointers to `count` rays. Null ones are left out.
        ///
        /// # Safety
        /// A scene of this library, and so many rays.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $mp(
            scene: *const Scene,
            context: *mut Context,
            rays: *const *mut f32,
            count: u32,
        ) {
            // SAFETY: the caller's handle and memory.
            unsafe { stream(Query::$query, scene, context, pointers(rays, count)) }
        }

        /// `packets` packets of `size` rays, each `stride` bytes behind the one before.
        ///
        /// # Safety
        /// A scene of this library, and so many rays.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $nm(
            scene: *const Scene,
            context: *mut Context,
            rays: *mut f32,
            size: u32,
            packets: u32,
            stride: usize,
        ) {
            // SAFETY: the caller's handle and memory.
            unsafe { stream(Query::$query, scene, context, strided(rays, size, packets, stride, $fields)) }
        }
    )*};
}

/// Numbers of a ray and of a hit: single rays with hits are padded to 24, packets never.
const HIT_FIELDS: usize = RAY_FIELDS + 9;

streams! {
    Intersect, HIT_FIELDS: rtcIntersect1M rtcIntersect1Mp rtcIntersectNM;
    Occluded, RAY_FIELDS: rtcOccluded1M rtcOccluded1Mp rtcOccludedNM;
}
