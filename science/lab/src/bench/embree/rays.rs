//! Rays as Embree wants them: the layouts of `rtcore_ray.h`.

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
    id: c_uint,
    flags: c_uint,
}

/// `RTCRayHit`. What follows `geom_id` depends on how the library was compiled: by default the id of an instance
/// and, in later versions, the number inside an array of instances, with padding to 96 bytes. There is room for two
/// levels of instances; Embree writes no more than the first, because none of ours is inside another.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub struct RayHit {
    ray: SingleRay,
    normal: [f32; 3],
    u: f32,
    v: f32,
    prim_id: c_uint,
    geom_id: c_uint,
    instances: [c_uint; 5],
}

/// `RTCRay16`: sixteen rays, property by property.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct Ray16 {
    org: [[f32; 16]; 3],
    tnear: [f32; 16],
    dir: [[f32; 16]; 3],
    time: [f32; 16],
    tfar: [f32; 16],
    mask: [c_uint; 16],
    id: [c_uint; 16],
    flags: [c_uint; 16],
}

/// Up to sixteen rays with the mask that says how many.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Packet {
    pub(super) valid: [c_int; 16],
    pub(super) rays: Ray16,
}

impl SingleRay {
    /// The ray as Embree wants it, before any query.
    pub fn new(ray: &Ray) -> Self {
        Self {
            org: ray.org,
            tnear: ray.tnear,
            dir: ray.dir,
            time: 0.0,
            tfar: ray.tfar,
            mask: ALL_GEOMETRY,
            id: 0,
            flags: 0,
        }
    }

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

impl RayHit {
    /// The ray as Embree wants it, before any query.
    pub fn new(ray: &Ray) -> Self {
        Self {
            ray: SingleRay::new(ray),
            normal: [0.0; 3],
            u: 0.0,
            v: 0.0,
            prim_id: 0,
            geom_id: NO_GEOMETRY,
            instances: [NO_GEOMETRY; 5],
        }
    }

    /// The ray as our kernel has it, up to the best hit so far.
    pub(super) fn to_kernel(self) -> Ray {
        self.ray.to_kernel()
    }

    /// Keeps a hit if it is in what is left of the interval.
    pub(super) fn meet(&mut self, hit: UserHit, [prim_id, geom_id]: [c_uint; 2]) {
        if self.ray.tnear < hit.t && hit.t < self.ray.tfar {
            self.ray.tfar = hit.t;
            [self.u, self.v] = [hit.u, hit.v];
            [self.prim_id, self.geom_id] = [prim_id, geom_id];
            self.instances[0] = NO_GEOMETRY;
        }
    }

    /// Distance of the closest hit, infinite for none.
    pub fn distance(&self) -> f32 {
        if self.geom_id == NO_GEOMETRY {
            f32::INFINITY
        } else {
            self.ray.tfar
        }
    }
}

impl Packet {
    /// A packet of the first sixteen rays, or fewer.
    pub fn new(rays: &[Ray]) -> Self {
        let mut packet = Self {
            valid: [0; 16],
            rays: Ray16 {
                org: [[0.0; 16]; 3],
                tnear: [0.0; 16],
                // Lanes without a ray are not looked at, but they are computed with.
                dir: [[1.0; 16]; 3],
                time: [0.0; 16],
                tfar: [0.0; 16],
                mask: [ALL_GEOMETRY; 16],
                id: [0; 16],
                flags: [0; 16],
            },
        };
        for (lane, ray) in rays.iter().take(16).enumerate() {
            packet.valid[lane] = -1;
            for axis in 0..3 {
                packet.rays.org[axis][lane] = ray.org[axis];
                packet.rays.dir[axis][lane] = ray.dir[axis];
            }
            packet.rays.tnear[lane] = ray.tnear;
            packet.rays.tfar[lane] = ray.tfar;
        }
        packet
    }

    /// Answers of an occlusion query to the rays of the packet.
    pub fn occluded(&self) -> impl Iterator<Item = bool> {
        let lanes = self.valid.iter().zip(self.rays.tfar);
        lanes
            .filter(|(valid, _)| **valid != 0)
            .map(|(_, tfar)| tfar == f32::NEG_INFINITY)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layouts_are_those_of_the_headers() {
        assert_eq!((size_of::<SingleRay>(), align_of::<SingleRay>()), (48, 16));
        assert_eq!(std::mem::offset_of!(SingleRay, tfar), 32);
        assert_eq!((size_of::<RayHit>(), align_of::<RayHit>()), (96, 16));
        assert_eq!(std::mem::offset_of!(RayHit, prim_id), 68);
        assert_eq!(std::mem::offset_of!(RayHit, geom_id), 72);
        assert_eq!((size_of::<Ray16>(), align_of::<Ray16>()), (768, 64));
        assert_eq!(std::mem::offset_of!(Packet, rays), 64);
    }
}
