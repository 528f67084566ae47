//! Spheres: bounds, leaf block, exact test.

use antumbra_simd::Scalar;

use crate::aabb::Aabb;
use crate::geometry::best::Best;
use crate::geometry::instance_ray::Interval;
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::{BLOCK, PrimRef, Sphere};
use crate::math;
use crate::ray::{Hit, INVALID_ID};

impl Sphere {
    /// A box that holds it, rounded outwards.
    pub(crate) fn bounds(&self) -> Aabb {
        Aabb {
            min: self.center.map(|x| (x - self.radius).next_down()),
            max: self.center.map(|x| (x + self.radius).next_up()),
        }
    }

    /// The nearer of the two distances inside the ray's interval.
    ///
    /// The quadratic is solved in double precision, which the levels share, so the bits do too.
    pub(crate) fn hit(&self, ray: &RaySetup) -> Option<f32> {
        let to_center: [f64; 3] =
            core::array::from_fn(|axis| f64::from(self.center[axis]) - f64::from(ray.org[axis]));
        let [dx, dy, dz] = ray.dir.map(f64::from);
        let dir = [dx, dy, dz];
        let dot = |a: &[f64; 3], b: &[f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let length2 = dot(&dir, &dir);
        let middle = dot(&to_center, &dir) / length2;
        // Squared distance from the centre to the ray's line, by the foot of the perpendicular: less
        // cancellation than the textbook discriminant when the sphere is far away.
        let foot: [f64; 3] = core::array::from_fn(|axis| to_center[axis] - middle * dir[axis]);
        let radius = f64::from(self.radius);
        let half_chord2 = (radius * radius - dot(&foot, &foot)) / length2;
        if !(half_chord2 >= 0.0) {
            return None;
        }
        let half_chord = math::sqrt(half_chord2);
        [middle - half_chord, middle + half_chord]
            .into_iter()
            .map(|t| t as f32)
            .filter(|t| ray.tnear < *t && *t < ray.tfar)
            .find_map(|t| self.confirm(t, ray))
    }

    /// The distance clamped into the interval of the sphere's box, see [`crate::geometry::ray_setup`], if the ray's own
    /// interval holds it.
    fn confirm(&self, t: f32, ray: &RaySetup) -> Option<f32> {
        let Aabb { min, max } = self.bounds();
        let planes = [min, max].map(|[x, y, z]| [x, y, z, 0.0]);
        let t = Interval::of(Scalar, ray, &planes)?.clamp(t);
        (ray.tnear < t && t < ray.tfar).then_some(t)
    }
}

/// Up to [`BLOCK`] spheres of a leaf. Tested one by one: scenes have few.
#[derive(Clone, Debug)]
pub(crate) struct SphereBlock {
    pub count: usize,
    pub spheres: [Sphere; BLOCK],
    pub refs: [PrimRef; BLOCK],
}

impl SphereBlock {
    pub const EMPTY: Self = Self {
        count: 0,
        spheres: [Sphere {
            center: [0.0; 3],
            radius: 0.0,
        }; BLOCK],
        refs: [PrimRef {
            geom_id: u32::MAX,
            prim_id: u32::MAX,
        }; BLOCK],
    };

    pub fn push(&mut self, sphere: Sphere, id: PrimRef) {
        self.spheres[self.count] = sphere;
        self.refs[self.count] = id;
        self.count += 1;
    }

    /// The first lane whose sphere occludes the ray.
    #[cold]
    pub fn occluded(&self, ray: &RaySetup) -> Option<usize> {
        self.spheres[..self.count]
            .iter()
            .position(|sphere| sphere.hit(ray).is_some())
    }

    /// Replaces `best` by the block's closest hit where that precedes it, and returns whether it did.
    #[cold]
    pub fn intersect(&self, ray: &RaySetup, best: &mut Best) -> bool {
        let mut improved = false;
        for lane in 0..self.count {
            if let Some(hit) = self.hit(lane, ray) {
                improved |= best.offer(hit);
            }
        }
        improved
    }

    /// The hit on the sphere of a lane.
    pub fn hit(&self, lane: usize, ray: &RaySetup) -> Option<Hit> {
        let PrimRef { geom_id, prim_id } = self.refs[lane];
        let t = self.spheres[lane].hit(ray)?;
        Some(Hit {
            t,
            u: 0.0,
            v: 0.0,
            prim_id,
            geom_id,
            inst_id: INVALID_ID,
        })
    }

    /// Puts the sphere of lane `lanes[i]` into lane `i`.
    pub fn permute(&mut self, lanes: &[u8; BLOCK]) {
        let old = self.clone();
        for (lane, &from) in lanes.iter().enumerate() {
            self.spheres[lane] = old.spheres[from as usize];
            self.refs[lane] = old.refs[from as usize];
        }
    }
}
