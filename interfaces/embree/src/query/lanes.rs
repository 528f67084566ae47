//! Many rays: packets of 4, 8 and 16, and streams of single rays as in Embree 3.
//!
//! Plain rays go to the kernel in batches, which form packets and streams of their own. Others are answered one by one.

use std::ffi::c_int;

use antumbra::{Batch, Bvh, Hit, Ray};

use super::{OCCLUDED, Way};
use crate::abi::{Arguments, Context, RAY_FIELDS, RtcHit, RtcRay};
use crate::device::{Failure, Outcome, with};
use crate::geometry::Query;
use crate::scene::{Committed, Scene};

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

    /// Writes what a query has found: a distance, and a hit if the query looks for hits.
    ///
    /// # Safety
    /// The ray has a hit behind it if the query looks for hits.
    #[inline(always)]
    pub unsafe fn write(self, query: Query, (t, hit): &(f32, RtcHit)) {
        // SAFETY: as the caller vouches.
        unsafe {
            self.set(8, *t);
            if query == Query::Occluded {
                return;
            }
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

/// Number of rays, and where each is: `None` of a ray that is not to be traced.
type Lanes<F> = (usize, F);

/// Fewer rays are answered one by one: what a batch prepares takes longer.
const FEW: usize = 12;

/// Rays of a stream that go to the kernel at a time.
const STREAM: usize = 512;

/// What the kernel answers about many rays.
trait Answer: Copy + Default {
    fn of(bvh: &Bvh, ray: &Ray) -> Self;
    fn of_many(batch: Batch<'_>, answers: &mut [Self]);
    /// What a ray has found; `None` of a ray that has found nothing.
    fn found(self, committed: &Committed, ray: &RtcRay) -> Option<(f32, RtcHit)>;
}

impl Answer for bool {
    fn of(bvh: &Bvh, ray: &Ray) -> Self {
        bvh.occluded(ray)
    }

    fn of_many(batch: Batch<'_>, answers: &mut [Self]) {
        batch.occluded_into(answers);
    }

    fn found(self, _: &Committed, _: &RtcRay) -> Option<(f32, RtcHit)> {
        self.then_some(OCCLUDED)
    }
}

impl Answer for Option<Hit> {
    fn of(bvh: &Bvh, ray: &Ray) -> Self {
        bvh.intersect(ray)
    }

    fn of_many(batch: Batch<'_>, answers: &mut [Self]) {
        batch.intersect_into(answers);
    }

    fn found(self, committed: &Committed, ray: &RtcRay) -> Option<(f32, RtcHit)> {
        self.map(|hit| committed.found(ray, &hit, None))
    }
}

/// Answers many rays, at most `N` at a time.
///
/// # Safety
/// The memory is as the client says.
unsafe fn answer_many<A: Answer, const N: usize>(
    query: Query,
    committed: &Committed,
    (count, lane_of): &Lanes<impl Fn(usize) -> Option<Lane>>,
    arguments: Option<&Arguments>,
) {
    const NOWHERE: Ray = Ray {
        org: [0.0; 3],
        tnear: 0.0,
        dir: [0.0; 3],
        tfar: 0.0,
    };
    let bvh = committed.bvh();
    let mut rays = [NOWHERE; N];
    let mut places = [Lane {
        first: std::ptr::null_mut(),
        stride: 0,
    }; N];
    let mut answers = [A::default(); N];
    let mut pending = 0;
    for index in 0..*count {
        // SAFETY: as the caller vouches.
        unsafe {
            if let Some(lane) = lane_of(index) {
                let ray = lane.ray();
                if committed.way(query, ray.mask, arguments) == Way::Plain {
                    rays[pending] = committed.kernel_ray(&ray);
                    places[pending] = lane;
                    pending += 1;
                } else if let Some(found) = committed.answer(query, &ray, arguments) {
                    lane.write(query, &found);
                }
            }
            if pending == N || (pending > 0 && index + 1 == *count) {
                let (rays, answers) = (&rays[..pending], &mut answers[..pending]);
                if pending < FEW {
                    for (ray, answer) in rays.iter().zip(&mut *answers) {
                        *answer = A::of(bvh, ray);
                    }
                } else {
                    A::of_many(bvh.batch(rays).on_this_thread(), answers);
                }
                for (lane, answer) in places.iter().zip(answers) {
                    if let Some(found) = answer.found(committed, &lane.ray()) {
                        lane.write(query, &found);
                    }
                }
                pending = 0;
            }
        }
    }
}

/// Answers the rays of a scene.
///
/// # Safety
/// A scene of this library, or null; the memory is as the client says, and arguments are null or valid.
unsafe fn answer<const N: usize>(
    query: Query,
    scene: *const Scene,
    arguments: *const Arguments,
    lanes: Outcome<Lanes<impl Fn(usize) -> Option<Lane>>>,
) {
    // SAFETY: the caller's handle and memory.
    unsafe {
        with(scene, |scene| {
            let committed = scene.committed()?;
            let (lanes, arguments) = (lanes?, arguments.as_ref());
            match query {
                Query::Intersect => {
                    answer_many::<Option<Hit>, N>(query, committed, &lanes, arguments);
                }
                Query::Occluded => answer_many::<bool, N>(query, committed, &lanes, arguments),
            }
            Ok(())
        })
    }
}

/// Answers a stream. The context is handed to functions of the client, and may be null.
///
/// # Safety
/// A scene of this library, or null; the memory is as the client says.
unsafe fn stream(
    query: Query,
    scene: *const Scene,
    context: *mut Context,
    lanes: Outcome<Lanes<impl Fn(usize) -> Option<Lane>>>,
) {
    let arguments = Arguments {
        flags: 0,
        feature_mask: -1,
        context,
        filter: None,
        user: None,
    };
    // SAFETY: as the caller vouches.
    unsafe { answer::<STREAM>(query, scene, &raw const arguments, lanes) }
}

/// Rays of a packet, which count where `valid` is -1.
///
/// # Safety
/// `N` flags, or null.
unsafe fn packet<const N: usize>(
    valid: *const c_int,
    first: *mut f32,
) -> Outcome<Lanes<impl Fn(usize) -> Option<Lane>>> {
    if valid.is_null() || first.is_null() {
        return Err(Failure::argument("a pointer is null"));
    }
    let lane = move |index: usize| {
        // SAFETY: N flags, as the client says.
        let is_active = unsafe { *valid.add(index) == -1 };
        is_active.then(|| Lane {
            first: first.wrapping_add(index),
            stride: N,
        })
    };
    Ok((N, lane))
}

/// Rays at a stride in bytes.
fn strided(
    query: Query,
    first: *mut f32,
    count: u32,
    stride: usize,
) -> Outcome<Lanes<impl Fn(usize) -> Option<Lane>>> {
    if first.is_null() && count > 0 {
        return Err(Failure::argument("a stream is null"));
    }
    let fields = match query {
        Query::Intersect => RAY_FIELDS + 9,
        Query::Occluded => RAY_FIELDS,
    };
    let bytes = 4 * fields;
    if count > 1 && (stride < bytes || !stride.is_multiple_of(4)) {
        return Err(Failure::argument(format!(
            "a stride of {stride} bytes for rays of {bytes} bytes"
        )));
    }
    let lane = move |index: usize| {
        let first = first.wrapping_byte_add(index * stride);
        Some(Lane { first, stride: 1 })
    };
    Ok((count as usize, lane))
}

macro_rules! packets {
    ($($query:ident $size:literal: $($name:ident)*;)*) => {$($(
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
            unsafe { answer::<$size>(Query::$query, scene, arguments, packet::<$size>(valid, rays)) }
        }
    )*)*};
}

packets! {
    Intersect 4: rtcIntersect4 rtcTraversableIntersect4;
    Intersect 8: rtcIntersect8 rtcTraversableIntersect8;
    Intersect 16: rtcIntersect16 rtcTraversableIntersect16;
    Occluded 4: rtcOccluded4 rtcTraversableOccluded4;
    Occluded 8: rtcOccluded8 rtcTraversableOccluded8;
    Occluded 16: rtcOccluded16 rtcTraversableOccluded16;
}

macro_rules! streams {
    ($($query:ident: $name:ident;)*) => {$(
        /// # Safety
        /// A scene of this library, and so many rays, each `stride` bytes behind the one before.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(
            scene: *const Scene,
            context: *mut Context,
            rays: *mut f32,
            count: u32,
            stride: usize,
        ) {
            let query = Query::$query;
            // SAFETY: the caller's handle and memory.
            unsafe { stream(query, scene, context, strided(query, rays, count, stride)) }
        }
    )*};
}

streams! {
    Intersect: rtcIntersect1M;
    Occluded: rtcOccluded1M;
}
