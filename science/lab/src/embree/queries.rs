//! Queries: of rays that lie ready, of rays that are made one by one or in packets, and of points.

use std::ffi::{c_int, c_uint, c_void};
use std::ptr::null_mut;

use antumbra::Ray;
use antumbra::shapes::TriangleMesh;

use super::callbacks::{
    FilterFunction, Nearest, PointContext, PointQuery, Visiting, nearer, visit_hits,
};
use super::rays::{HitPacket, RayN};
use super::{Handle, Packet, RayHit, Scene, SingleRay};

/// A function that answers a packet.
pub(super) type Many<R> = unsafe extern "C" fn(*const c_int, Handle, *mut R, *mut Arguments);

/// How rays are handed over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Call {
    /// `rtcOccluded1`, `rtcIntersect1`.
    Single,
    /// `rtcOccluded4`, `8` or `16`, and `rtcIntersect16`.
    Packets(usize),
    /// Packets of 16 with `RTC_RAY_QUERY_FLAG_COHERENT`.
    Coherent,
}

impl Call {
    /// Ways that most programs would try.
    pub const USUAL: [(&str, Self); 3] = [
        ("single", Self::Single),
        ("packets", Self::Packets(16)),
        ("coherent packets", Self::Coherent),
    ];
}

/// `RTCOccludedArguments` and `RTCIntersectArguments`.
#[repr(C)]
pub(super) struct Arguments {
    flags: c_uint,
    features: c_uint,
    context: *mut c_void,
    filter: Option<FilterFunction>,
    function: *mut c_void,
}

const COHERENT: c_uint = 1 << 16;
const INVOKE_ARGUMENT_FILTER: c_uint = 1 << 1;

impl Arguments {
    fn of(call: Call) -> Self {
        Self {
            flags: if call == Call::Coherent { COHERENT } else { 0 },
            features: c_uint::MAX,
            context: null_mut(),
            filter: None,
            function: null_mut(),
        }
    }
}

/// Queries of rays that lie ready, in the mode that Embree recommends.
impl Scene<'_> {
    /// `rtcOccluded1` for every ray.
    pub fn occluded_rays(&self, rays: &mut [SingleRay]) {
        let occluded1 = self.functions().occluded1;
        let _mode = self.mode();
        for ray in rays {
            // SAFETY: the scene is committed and alive; the ray has the layout of `RTCRay`; no arguments
            // are given.
            unsafe { occluded1(self.handle(), ray, null_mut()) };
        }
    }

    /// `rtcIntersect1` for every ray.
    pub fn intersect_rays(&self, rays: &mut [RayHit]) {
        let intersect1 = self.functions().intersect1;
        let _mode = self.mode();
        for ray in rays {
            // SAFETY: as above, with room for an `RTCRayHit`.
            unsafe { intersect1(self.handle(), ray, null_mut()) };
        }
    }

    /// `rtcOccluded16` for every packet.
    pub fn occluded_packets(&self, packets: &mut [Packet<16>]) {
        let occluded16 = self.functions().occluded16;
        let _mode = self.mode();
        for Packet { valid, rays } in packets {
            // SAFETY: as above, with the layout and alignment of a mask of 16 and an `RTCRay16`.
            unsafe { occluded16(valid.as_ptr(), self.handle(), rays, null_mut()) };
        }
    }
}

/// Queries of rays that are made while they are handed over.
impl Scene<'_> {
    /// Whether each of `count` rays is occluded.
    #[inline]
    pub fn occluded<R: Into<SingleRay>>(
        &self,
        call: Call,
        count: usize,
        ray: impl Fn(usize) -> R,
        found: impl FnMut(usize, bool),
    ) {
        self.occluded_by(Arguments::of(call), call, (count, ray), found);
    }

    #[inline]
    fn occluded_by<R: Into<SingleRay>>(
        &self,
        mut arguments: Arguments,
        call: Call,
        (count, ray): (usize, impl Fn(usize) -> R),
        mut found: impl FnMut(usize, bool),
    ) {
        let functions = self.functions();
        match call {
            Call::Single => {
                for index in 0..count {
                    let mut asked: SingleRay = ray(index).into();
                    asked.id = index as c_uint;
                    // SAFETY: the scene is committed, and the ray is an `RTCRay`.
                    unsafe { (functions.occluded1)(self.handle(), &mut asked, &mut arguments) };
                    found(index, asked.is_occluded());
                }
            }
            Call::Packets(4) => self.packets(functions.occluded4, arguments, (count, ray), found),
            Call::Packets(8) => self.packets(functions.occluded8, arguments, (count, ray), found),
            _ => self.packets(functions.occluded16, arguments, (count, ray), found),
        }
    }

    #[inline]
    fn packets<const N: usize, R: Into<SingleRay>>(
        &self,
        occluded: Many<RayN<N>>,
        mut arguments: Arguments,
        (count, ray): (usize, impl Fn(usize) -> R),
        mut found: impl FnMut(usize, bool),
    ) {
        for first in (0..count).step_by(N) {
            let mut packet = Packet::<N>::new(first, count, &ray);
            let Packet { valid, rays } = &mut packet;
            // SAFETY: the scene is committed, and the rays are those of a packet of this size.
            unsafe { occluded(valid.as_ptr(), self.handle(), rays, &mut arguments) };
            for (index, occluded) in (first..).zip(packet.occluded()) {
                found(index, occluded);
            }
        }
    }

    /// Distance of the closest hit of each of `count` rays, infinite for none, and the primitive.
    #[inline]
    pub fn intersect<R: Into<SingleRay>>(
        &self,
        call: Call,
        count: usize,
        ray: impl Fn(usize) -> R,
        mut found: impl FnMut(usize, (f32, u32)),
    ) {
        let (functions, mut arguments) = (self.functions(), Arguments::of(call));
        if call == Call::Single {
            for index in 0..count {
                let mut asked = RayHit::from(ray(index));
                // SAFETY: the scene is committed, and the ray is an `RTCRayHit`.
                unsafe { (functions.intersect1)(self.handle(), &mut asked, &mut arguments) };
                found(index, asked.found());
            }
            return;
        }
        for first in (0..count).step_by(16) {
            let Packet { valid, rays } = Packet::new(first, count, &ray);
            let mut asked = HitPacket::from(rays);
            let intersect = functions.intersect16;
            // SAFETY: the scene is committed, and the rays are an `RTCRayHit16`.
            unsafe { intersect(valid.as_ptr(), self.handle(), &mut asked, &mut arguments) };
            for index in first..count.min(first + 16) {
                found(index, asked.found(index - first));
            }
        }
    }

    /// Calls a function with the value of a ray and the primitive, for every hit on the way of every ray: in a filter function
    /// that rejects every hit. The scene must have filters in arguments.
    pub fn visit_hits<T, F: Fn(&mut T, u32)>(
        &self,
        call: Call,
        rays: &[Ray],
        values: &mut [T],
        visit: &F,
    ) {
        assert_eq!(rays.len(), values.len(), "a value for every ray");
        let mut visiting = Visiting::new(values, visit);
        let mut arguments = Arguments::of(call);
        arguments.flags |= INVOKE_ARGUMENT_FILTER;
        arguments.context = (&raw mut visiting).cast();
        arguments.filter = Some(visit_hits::<T, F>);
        let ray = |index: usize| rays[index];
        self.occluded_by(arguments, call, (rays.len(), ray), |_, _| {});
    }

    /// Distance of the nearest triangle for every point, of a scene that is this one mesh. `is_bounded`: searches no farther
    /// than the nearest triangle of the point before can be.
    pub fn distances(
        &self,
        mesh: &TriangleMesh,
        points: &[[f32; 3]],
        is_bounded: bool,
        distances: &mut [f32],
    ) {
        let point_query = self.functions().point_query;
        let mut last: Option<([f32; 3], f32)> = None;
        for (&position, distance) in points.iter().zip(distances) {
            let radius = match last {
                Some((before, distance)) if is_bounded => {
                    let step = [0, 1, 2].map(|axis| position[axis] - before[axis]);
                    1.0001 * (distance + step.iter().map(|x| x * x).sum::<f32>().sqrt())
                }
                _ => f32::INFINITY,
            };
            let mut nearest = Nearest::new(mesh);
            let mut query = PointQuery::new(position, radius);
            let mut context = PointContext::default();
            let user = (&raw mut nearest).cast();
            // SAFETY: the scene is committed and alive. Query and context have their layouts, and the function is told what
            // it expects.
            unsafe {
                point_query(self.handle(), &mut query, &mut context, Some(nearer), user);
            }
            *distance = nearest.distance();
            last = Some((position, *distance));
        }
    }
}
