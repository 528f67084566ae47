//! Spheres: bounds and exact test.

use core::f64::consts::TAU;

use crate::aabb::Aabb;
use crate::geometry::instance::dot;
use crate::geometry::nearest::{Near, Place};
use crate::geometry::primitives::dropped::DropReason;
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::scalar::{ScalarPrim, ScalarShape, SurfacePoint, clamped, is_finite_box};
use crate::geometry::{Geometry, Sphere};
use crate::hash::Random;
use crate::math;
use crate::ray::{Hit, Ray};

impl Sphere {
    /// The sphere, if it can be kept.
    fn checked(self) -> Result<Self, DropReason> {
        if !is_finite_box(&self.bounds()) {
            Err(DropReason::NotFinite)
        } else if !(self.radius > 0.0) {
            Err(DropReason::NoRadius)
        } else {
            Ok(self)
        }
    }
}

impl ScalarShape for Sphere {
    /// Box around the sphere, rounded outwards.
    fn bounds(&self) -> Aabb {
        Aabb {
            min: self.center.map(|x| (x - self.radius).next_down()),
            max: self.center.map(|x| (x + self.radius).next_up()),
        }
    }

    /// The nearer of the two distances inside the ray's interval.
    ///
    /// The quadratic is solved in double precision, which the levels share, so the bits do too.
    fn hit(&self, _: u32, ray: &RaySetup, _: f32) -> Option<[f32; 3]> {
        let to_center: [f64; 3] =
            core::array::from_fn(|axis| f64::from(self.center[axis]) - f64::from(ray.org[axis]));
        let dir = ray.dir.map(f64::from);
        let length2 = dot(dir, dir);
        let middle = dot(to_center, dir) / length2;
        // Squared distance from the centre to the ray's line, by the foot of the perpendicular: less
        // cancellation than the textbook discriminant when the sphere is far away.
        let foot: [f64; 3] = core::array::from_fn(|axis| to_center[axis] - middle * dir[axis]);
        let radius = f64::from(self.radius);
        let half_chord2 = (radius * radius - dot(foot, foot)) / length2;
        if !(half_chord2 >= 0.0) {
            return None;
        }
        let half_chord = math::sqrt(half_chord2);
        [middle - half_chord, middle + half_chord]
            .into_iter()
            .map(|t| t as f32)
            .filter(|t| ray.tnear < *t && *t < ray.tfar)
            .find_map(|t| clamped(&self.bounds(), t, ray))
            .map(|t| [t, 0.0, 0.0])
    }

    /// Normal that points outwards, not of unit length.
    fn normal(&self, ray: &Ray, hit: &Hit) -> Option<[f64; 3]> {
        Some(core::array::from_fn(|axis| {
            let to_org = f64::from(ray.org[axis]) - f64::from(self.center[axis]);
            to_org + f64::from(hit.t) * f64::from(ray.dir[axis])
        }))
    }

    fn near(&self, _: u32, place: &Place<'_>) -> Option<Near> {
        Some(place.sphere(self))
    }

    fn crossing(&self, point: [f64; 3]) -> i32 {
        let way: [f64; 3] = core::array::from_fn(|axis| point[axis] - f64::from(self.center[axis]));
        let radius = f64::from(self.radius);
        i32::from(dot(way, way) < radius * radius)
    }

    fn area(&self) -> f64 {
        let radius = f64::from(self.radius);
        2.0 * TAU * radius * radius
    }

    fn surface_point(&self, random: &mut Random) -> SurfacePoint {
        let normal = random.direction();
        SurfacePoint {
            position: core::array::from_fn(|axis| {
                f64::from(self.center[axis]) + f64::from(self.radius) * normal[axis]
            }),
            normal,
        }
    }
}

impl ScalarPrim for Sphere {
    const NAME: &'static str = "spheres";
    const NOTHING: Self = Self {
        center: [0.0; 3],
        radius: 0.0,
    };
    const NUMBERS: usize = 4;

    fn count(geometry: &Geometry<'_>) -> usize {
        match geometry {
            Geometry::Spheres(spheres) => spheres.len(),
            _ => 0,
        }
    }

    fn of(geometry: &Geometry<'_>, prim_id: u32) -> Option<Result<Self, DropReason>> {
        match geometry {
            Geometry::Spheres(spheres) => Some(spheres.get(prim_id as usize)?.checked()),
            _ => None,
        }
    }

    fn numbers(&self) -> [f32; 8] {
        let [x, y, z] = self.center;
        [x, y, z, self.radius, 0.0, 0.0, 0.0, 0.0]
    }

    fn from_numbers([x, y, z, radius, ..]: [f32; 8]) -> Result<Self, DropReason> {
        let center = [x, y, z];
        Self { center, radius }.checked()
    }
}
