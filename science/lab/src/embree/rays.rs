//! Rays as Embree wants them: the layouts of `rtcore_ray.h`.

use std::array::from_fn;
use std::ffi::{c_int, c_uint};

use antumbra::Ray;
use antumbra::shapes::UserHit;

/// Every ray sees every geometry.
const ALL_GEOMETRY: c_uint = c_uint::MAX;
/// Id that means nothing.
const NO_GEOMETRY: c_uint = c_uint::MAX;

/// `RTCRay`.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub struct SingleRay {
    org: [f32; 3],
    tnear: f32,
    dir: [f32; 3],
    time: f32,
    /// Minus infinity after an occlusion query that found something, the distance after a closest hit.
    tfar: f32,
    mask: c_uint,
    pub(super) id: c_uint,
    flags: c_uint,
}

/// `RTCHit` and `RTCHit16`. What follows `geom_id` depends on how the library was compiled: by default the id of an instance
/// and, in later versions, the number inside an array of instances. Embree writes no more than one level of instances, because
/// none of ours is inside another.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
struct Hits<const N: usize> {
    normal: [[f32; N]; 3],
    uv: [[f32; N]; 2],
    prim_id: [c_uint; N],
    geom_id: [c_uint; N],
    instances: [[c_uint; N]; 2],
}

/// `RTCRayHit`, with its padding.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub struct RayHit {
    ray: SingleRay,
    hit: Hits<1>,
}

/// `RTCRay4`, `RTCRay8` and `RTCRay16`: rays property by property.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct RayN<const N: usize> {
    org: [[f32; N]; 3],
    tnear: [f32; N],
    dir: [[f32; N]; 3],
    time: [f32; N],
    tfar: [f32; N],
    mask: [c_uint; N],
    id: [c_uint; N],
    flags: [c_uint; N],
}

/// `RTCRayHit16`.
#[repr(C, align(64))]
pub(super) struct HitPacket {
    rays: RayN<16>,
    hits: Hits<16>,
}

/// Up to `N` rays with the mask that says how many.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Packet<const N: usize> {
    pub(super) valid: [c_int; N],
    pub(super) rays: RayN<N>,
}

impl From<Ray> for SingleRay {
    fn from(ray: Ray) -> Self {
        (ray, 0.0).into()
    }
}

/// A ray and its time.
impl From<(Ray, f32)> for SingleRay {
    fn from((ray, time): (Ray, f32)) -> Self {
        Self {
            org: ray.org,
            tnear: ray.tnear,
            dir: ray.dir,
            time,
            tfar: ray.tfar,
            mask: ALL_GEOMETRY,
            id: 0,
            flags: 0,
        }
    }
}

impl SingleRay {
    /// Answer of an occlusion query.
    pub fn is_occluded(&self) -> bool {
        self.tfar == f32::NEG_INFINITY
    }

    /// The ray as our kernel has it, with what is left of its interval.
    pub(super) fn to_kernel(self) -> Ray {
        Ray {
            org: self.org,
            dir: self.dir,
            tnear: self.tnear,
            tfar: self.tfar,
        }
    }

    /// Says that something occludes the ray.
    pub(super) fn stop(&mut self) {
        self.tfar = f32::NEG_INFINITY;
    }
}

impl<const N: usize> Hits<N> {
    const NONE: Self = Self {
        normal: [[0.0; N]; 3],
        uv: [[0.0; N]; 2],
        prim_id: [NO_GEOMETRY; N],
        geom_id: [NO_GEOMETRY; N],
        instances: [[NO_GEOMETRY; N]; 2],
    };

    /// Distance of the closest hit in a lane, infinite for none, and its primitive.
    fn found(&self, lane: usize, tfar: f32) -> (f32, u32) {
        let distance = match self.geom_id[lane] {
            NO_GEOMETRY => f32::INFINITY,
            _ => tfar,
        };
        (distance, self.prim_id[lane])
    }
}

impl<R: Into<SingleRay>> From<R> for RayHit {
    fn from(ray: R) -> Self {
        Self {
            ray: ray.into(),
            hit: Hits::NONE,
        }
    }
}

impl RayHit {
    /// The ray as our kernel has it, up to the best hit so far.
    pub(super) fn to_kernel(self) -> Ray {
        self.ray.to_kernel()
    }

    /// Keeps a hit if it is in what is left of the interval.
    pub(super) fn meet(&mut self, hit: UserHit, [prim_id, geom_id]: [c_uint; 2]) {
        if self.ray.tnear < hit.t && hit.t < self.ray.tfar {
            self.ray.tfar = hit.t;
            self.hit = Hits {
                uv: [[hit.u], [hit.v]],
                prim_id: [prim_id],
                geom_id: [geom_id],
                ..self.hit
            };
            self.hit.instances[0] = [NO_GEOMETRY];
        }
    }

    /// Distance of the closest hit, infinite for none, and its primitive.
    pub fn found(&self) -> (f32, u32) {
        self.hit.found(0, self.ray.tfar)
    }
}

impl HitPacket {
    /// The same of a lane.
    pub fn found(&self, lane: usize) -> (f32, u32) {
        self.hits.found(lane, self.rays.tfar[lane])
    }
}

impl From<RayN<16>> for HitPacket {
    fn from(rays: RayN<16>) -> Self {
        Self {
            rays,
            hits: Hits::NONE,
        }
    }
}

impl<const N: usize> Packet<N> {
    /// A packet of rays from `first` on, as far as there are `count`. Rays are numbered by their index.
    #[inline]
    pub fn new<R: Into<SingleRay>>(first: usize, count: usize, ray: impl Fn(usize) -> R) -> Self {
        let lanes: [usize; N] = from_fn(|lane| first + lane);
        // Lanes without a ray are not looked at, but they are computed with.
        let rays = lanes.map(|index| ray(index.min(count - 1)).into());
        Self {
            valid: lanes.map(|index| if index < count { -1 } else { 0 }),
            rays: RayN {
                org: [0, 1, 2].map(|axis| rays.map(|ray| ray.org[axis])),
                tnear: rays.map(|ray| ray.tnear),
                dir: [0, 1, 2].map(|axis| rays.map(|ray| ray.dir[axis])),
                time: rays.map(|ray| ray.time),
                tfar: rays.map(|ray| ray.tfar),
                mask: rays.map(|ray| ray.mask),
                id: lanes.map(|index| index as c_uint),
                flags: [0; N],
            },
        }
    }

    /// Answers of an occlusion query to the rays of the packet.
    pub fn occluded(&self) -> impl Iterator<Item = bool> {
        let lanes = self.valid.into_iter().zip(self.rays.tfar);
        lanes
            .filter(|(valid, _)| *valid != 0)
            .map(|(_, tfar)| tfar == f32::NEG_INFINITY)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::mem::offset_of;

    #[test]
    fn layouts_are_those_of_the_headers() {
        assert_eq!((size_of::<SingleRay>(), align_of::<SingleRay>()), (48, 16));
        assert_eq!(offset_of!(SingleRay, tfar), 32);
        assert_eq!((size_of::<RayHit>(), align_of::<RayHit>()), (96, 16));
        assert_eq!(offset_of!(RayHit, hit.prim_id), 68);
        assert_eq!(offset_of!(RayHit, hit.geom_id), 72);
        assert_eq!((size_of::<RayN<16>>(), align_of::<RayN<16>>()), (768, 64));
        assert_eq!(size_of::<RayN<4>>(), 192);
        assert_eq!(offset_of!(HitPacket, hits.geom_id), 768 + 6 * 64);
        assert_eq!(offset_of!(Packet<16>, rays), 64);
    }
}
