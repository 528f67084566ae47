//! Flat disks: bounds, exact test, nearest point.

use core::f64::consts::PI;

use crate::aabb::Aabb;
use crate::geometry::Geometry;
use crate::geometry::instance::{Affine, cross, dot};
use crate::geometry::nearest::{Near, Place, eigen, minus};
use crate::geometry::primitives::dropped::DropReason;
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::scalar::{ScalarPrim, ScalarShape, SurfacePoint, clamped, is_finite_box};
use crate::hash::Random;
use crate::math;
use crate::ray::{Hit, Ray};

/// A flat disk, which is hit from both sides. A ray that runs in the plane of the disk misses it.
///
/// `u` and `v` of a hit are 0. [`Bvh::normal`](crate::Bvh::normal) is the normal given here, on whichever side the hit is.
///
/// ```
/// use antumbra::shapes::Disk;
/// use antumbra::{Bvh, Geometry, Ray, Recipe};
///
/// let disk = Disk { center: [0.0, 0.0, 1.0], normal: [0.0, 0.0, 1.0], radius: 0.5 };
/// let bvh = Bvh::build(&[Geometry::disks(vec![disk])], &Recipe::default())?;
/// assert!(bvh.occluded(&Ray::new([0.4, 0.0, 0.0], [0.0, 0.0, 1.0])));
/// assert!(!bvh.occluded(&Ray::new([0.4, 0.4, 0.0], [0.0, 0.0, 1.0])));
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disk {
    /// Centre, in the coordinates of the geometry.
    pub center: [f32; 3],
    /// Normal, of any length. A disk is dropped at build if its normal is zero.
    pub normal: [f32; 3],
    /// Radius. A disk is dropped at build unless its radius is positive and all numbers are finite.
    pub radius: f32,
}

impl Disk {
    /// The disk, if it can be kept.
    fn checked(self) -> Result<Self, DropReason> {
        let mut numbers = self.center.iter().chain(&self.normal);
        if !numbers.all(|x| x.is_finite()) || !self.radius.is_finite() {
            Err(DropReason::NotFinite)
        } else if self.normal == [0.0; 3] {
            Err(DropReason::NoNormal)
        } else if self.radius <= 0.0 {
            Err(DropReason::NoRadius)
        } else if !is_finite_box(&self.bounds()) {
            Err(DropReason::NotFinite)
        } else {
            Ok(self)
        }
    }

    /// The normal, of unit length.
    fn unit_normal(&self) -> [f64; 3] {
        let normal = self.normal.map(f64::from);
        let length = math::sqrt(dot(normal, normal));
        normal.map(|x| x / length)
    }

    /// Two directions of unit length that are perpendicular to the normal and to each other.
    fn axes(&self) -> [[f64; 3]; 2] {
        let normal = self.unit_normal();
        let least = (1..3).fold(0, |least, axis| {
            if normal[axis].abs() < normal[least].abs() {
                axis
            } else {
                least
            }
        });
        let mut other = [0.0; 3];
        other[least] = 1.0;
        let first = cross(normal, other);
        let length = math::sqrt(dot(first, first));
        let first = first.map(|x| x / length);
        [first, cross(normal, first)]
    }
}

impl ScalarShape for Disk {
    /// Box around the disk, rounded outwards.
    fn bounds(&self) -> Aabb {
        let normal = self.normal.map(f64::from);
        let length2 = dot(normal, normal);
        let side = |axis: usize, sign: f64| {
            // The sine of the angle between the normal and the axis.
            let [a, b] = [normal[(axis + 1) % 3], normal[(axis + 2) % 3]];
            let half = f64::from(self.radius) * math::sqrt((a * a + b * b) / length2);
            (f64::from(self.center[axis]) + sign * half) as f32
        };
        Aabb {
            min: core::array::from_fn(|axis| side(axis, -1.0).next_down()),
            max: core::array::from_fn(|axis| side(axis, 1.0).next_up()),
        }
    }

    /// Hit at the point where the ray passes the plane, if that is no farther from the centre than the radius. In double
    /// precision, which the levels share, so the bits are the same on all of them.
    fn hit(&self, _: u32, ray: &RaySetup, _: f32) -> Option<[f32; 3]> {
        let dir = ray.dir.map(f64::from);
        let normal = self.normal.map(f64::from);
        let to_center = minus(self.center.map(f64::from), ray.org.map(f64::from));
        // Infinite or NaN for a ray that runs in the plane or beside it.
        let along = dot(to_center, normal) / dot(dir, normal);
        let t = along as f32;
        if !(ray.tnear < t && t < ray.tfar) {
            return None;
        }
        let from_center: [f64; 3] =
            core::array::from_fn(|axis| along * dir[axis] - to_center[axis]);
        let radius = f64::from(self.radius);
        if !(dot(from_center, from_center) <= radius * radius) {
            return None;
        }
        Some([clamped(&self.bounds(), t, ray)?, 0.0, 0.0])
    }

    fn normal(&self, _: &Ray, _: &Hit) -> Option<[f64; 3]> {
        Some(self.normal.map(f64::from))
    }

    fn near(&self, _: u32, place: &Place<'_>) -> Option<Near> {
        let center = place.in_world(self.center);
        let to_point = minus(place.point, center);
        let axes = self.axes();
        let radius = f64::from(self.radius);
        let (axes, [x, y]) = match place.affine {
            None => (axes, on_disk(axes.map(|axis| dot(axis, to_point)), radius)),
            Some(affine) => on_ellipse(affine, axes, to_point, radius),
        };
        let way: [f64; 3] = core::array::from_fn(|axis| x * axes[0][axis] + y * axes[1][axis]);
        let position = core::array::from_fn(|axis| center[axis] + way[axis]);
        Some(place.near(position, [0.0; 2]))
    }

    fn area(&self) -> f64 {
        let radius = f64::from(self.radius);
        PI * radius * radius
    }

    fn flat_normal(&self) -> Option<[f64; 3]> {
        Some(self.unit_normal())
    }

    fn surface_point(&self, random: &mut Random) -> SurfacePoint {
        let [x, y] = loop {
            let [x, y] = [(); 2].map(|()| 2.0 * random.unit() - 1.0);
            if x * x + y * y <= 1.0 {
                break [x, y];
            }
        };
        let [a, b] = self.axes();
        SurfacePoint {
            position: core::array::from_fn(|axis| {
                let way = x * a[axis] + y * b[axis];
                f64::from(self.center[axis]) + f64::from(self.radius) * way
            }),
            normal: self.unit_normal(),
        }
    }
}

impl ScalarPrim for Disk {
    const NAME: &'static str = "disks";
    const NOTHING: Self = Self {
        center: [0.0; 3],
        normal: [0.0; 3],
        radius: 0.0,
    };
    const NUMBERS: usize = 7;

    fn count(geometry: &Geometry<'_>) -> usize {
        match geometry {
            Geometry::Disks(disks) => disks.len(),
            _ => 0,
        }
    }

    fn of(geometry: &Geometry<'_>, prim_id: u32) -> Option<Result<Self, DropReason>> {
        match geometry {
            Geometry::Disks(disks) => Some(disks.get(prim_id as usize)?.checked()),
            _ => None,
        }
    }

    fn numbers(&self) -> [f32; 8] {
        let ([x, y, z], [a, b, c]) = (self.center, self.normal);
        [x, y, z, a, b, c, self.radius, 0.0]
    }

    fn from_numbers([x, y, z, a, b, c, radius, _]: [f32; 8]) -> Result<Self, DropReason> {
        let (center, normal) = ([x, y, z], [a, b, c]);
        let disk = Self {
            center,
            normal,
            radius,
        };
        disk.checked()
    }
}

/// The nearest point to a point of the plane on a disk around the origin.
fn on_disk(point: [f64; 2], radius: f64) -> [f64; 2] {
    let [x, y] = point;
    let length = math::sqrt(x * x + y * y);
    if length > radius {
        point.map(|x| x / length * radius)
    } else {
        point
    }
}

/// The nearest point to `point` on the image of a disk around the origin under a linear map: the images of two
/// perpendicular directions in its plane, and a point in terms of them.
///
/// With the images as the columns of `B`, the least `|B x - point|` with `|x| <= radius` solves
/// `(B' B + l) x = B' point` for `l = 0`, or else for the `l > 0` that gives `x` the length of the radius. In the basis
/// of eigenvectors of `B' B`, which are chosen as directions, that is an equation for the single unknown `l`, found by
/// bisection.
fn on_ellipse(
    affine: &Affine,
    axes: [[f64; 3]; 2],
    point: [f64; 3],
    radius: f64,
) -> ([[f64; 3]; 2], [f64; 2]) {
    let images = axes.map(|axis| affine.vector(axis));
    let [aa, ab, bb] = [(0, 0), (0, 1), (1, 1)].map(|(i, j)| dot(images[i], images[j]));
    let (values, vectors) = eigen([[aa, ab, 0.0], [ab, bb, 0.0], [0.0; 3]]);
    // Turned in the plane, so the third vector stays what it is.
    let turned = [0, 1].map(|i| {
        let [x, y, _] = vectors[i];
        core::array::from_fn(|axis| x * images[0][axis] + y * images[1][axis])
    });
    let aim = turned.map(|axis| dot(axis, point));
    let at = |l: f64| -> [f64; 2] { core::array::from_fn(|i| aim[i] / (values[i] + l)) };
    let length2 = |[x, y]: [f64; 2]| x * x + y * y;
    let free = at(0.0);
    if length2(free) <= radius * radius {
        return (turned, free);
    }
    let (mut low, mut high) = (0.0, math::sqrt(length2(aim)) / radius);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if length2(at(middle)) > radius * radius {
            low = middle;
        } else {
            high = middle;
        }
    }
    (turned, at(high))
}
