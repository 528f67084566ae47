//! Rays that resemble those of a renderer, made from the surfaces alone: what a tree learns from when
//! nobody gives it rays.

use core::f64::consts::TAU;

use super::placed_surfaces::PlacedSurfaces;
use crate::aabb::Aabb;
use crate::build::parallel;
use crate::hash;
use crate::primitives::Primitives;
use crate::ray::Ray;

/// How far rays start from the surface, relative to the largest coordinate: more than the rounding of
/// the coordinates, less than anything one would see.
const OFFSET: f64 = 1.0 / (1 << 17) as f64;
/// Every so many rays, one is a segment between two points on surfaces.
const SEGMENT_PERIOD: usize = 4;
/// Primitives whose extents are added up by one task.
const CHUNK: usize = 4096;

/// `count` rays from points spread over all surfaces: three of four in directions distributed by the cosine
/// about the normal, on either side, without end, as bounces and ambient occlusion make them; the fourth a
/// segment to another such point, as an area light makes them.
///
/// Half of the points are spread by area. The other half are given to primitives by the root of their
/// area, so that a ground plane or a sky of two triangles does not get them all. Every instance has the
/// surface of its object, as large as it is in the world.
///
/// A function of the primitives, the count and the seed. Empty if no primitive has an area.
pub fn surface_rays(primitives: &Primitives, count: usize, seed: u64) -> Vec<Ray> {
    let chunks = parallel::map(primitives.len().div_ceil(CHUNK), 1, |chunk| {
        range(primitives, chunk)
            .map(|index| Extent::of(primitives, index))
            .fold(Extent::NONE, Extent::plus)
    });
    let placed = PlacedSurfaces::new(primitives);
    let extents = chunks.iter().chain(&placed.extents).copied();
    let all = extents.fold(Extent::NONE, Extent::plus);
    let offset = f64::from(all.bounds.reach()) * OFFSET;
    let mut random = Random(seed);
    let points = surface_points(primitives, &chunks, &placed, all, count, &mut random);
    let mut rays = Vec::with_capacity(points.len());
    for (index, from) in points.iter().enumerate() {
        rays.push(if index % SEGMENT_PERIOD == 0 {
            between(from, &points[random.below(points.len())], offset)
        } else {
            bounce(from, &mut random, offset)
        });
    }
    rays
}

/// A point on a surface and the normal there, of unit length.
pub(super) struct SurfacePoint {
    pub position: [f64; 3],
    pub normal: [f64; 3],
}

/// A direction about the normal, distributed by the cosine, on a side chosen at random.
fn bounce(from: &SurfacePoint, random: &mut Random, offset: f64) -> Ray {
    let side = if random.bits() & 1 == 0 { 1.0 } else { -1.0 };
    let normal = from.normal.map(|x| side * x);
    let org = core::array::from_fn(|axis| from.position[axis] + offset * normal[axis]);
    // The normal plus a point on the unit sphere; the opposite point would give no direction.
    let sphere = random.direction();
    let dir: [f64; 3] = core::array::from_fn(|axis| normal[axis] + sphere[axis]);
    let dir = if dot(&dir, &dir) > 1e-6 { dir } else { normal };
    Ray::new(to_f32(org), to_f32(dir))
}

/// The segment between two points, each on the side of its surface that the other one sees.
fn between(from: &SurfacePoint, to: &SurfacePoint, offset: f64) -> Ray {
    let way: [f64; 3] = core::array::from_fn(|axis| to.position[axis] - from.position[axis]);
    let lift = |point: &SurfacePoint, towards: f64| -> [f32; 3] {
        let side = (dot(&point.normal, &way) * towards).signum() * offset;
        to_f32(core::array::from_fn(|axis| {
            point.position[axis] + side * point.normal[axis]
        }))
    };
    Ray::between(lift(from, 1.0), lift(to, -1.0))
}

/// Points spread over the surfaces, one in each of `count` shares of equal weight, in the order of the
/// primitives. Empty if no primitive has an area.
fn surface_points(
    primitives: &Primitives,
    chunks: &[Extent],
    placed: &PlacedSurfaces<'_>,
    all: Extent,
    count: usize,
    random: &mut Random,
) -> Vec<SurfacePoint> {
    let mut points = Vec::new();
    if !(all.area > 0.0) {
        return points;
    }
    points.reserve(count);
    // Weights are shares of the whole, which add up to 1.
    let weight = |extent: Extent| 0.5 * (extent.area / all.area + extent.root / all.root);
    let share = 1.0 / count as f64;
    // Weight of what comes before the chunk, or primitive, at hand.
    let mut before = 0.0;
    let mut target = share * random.unit();
    for (chunk, &extent) in chunks.iter().enumerate() {
        if before + weight(extent) <= target {
            before += weight(extent);
            continue;
        }
        for index in range(primitives, chunk) {
            before += weight(Extent::of(primitives, index));
            while target < before && points.len() < count {
                points.push(point(primitives, index, random));
                target = share * (points.len() as f64 + random.unit());
            }
        }
    }
    for (instance, &extent) in placed.extents.iter().enumerate() {
        before += weight(extent);
        while target < before && points.len() < count {
            points.push(placed.point(instance, &all, random));
            target = share * (points.len() as f64 + random.unit());
        }
    }
    // Rounding may leave the last target just beyond the end.
    while points.len() < count {
        points.push(
            match placed.extents.iter().rposition(|extent| extent.area > 0.0) {
                Some(instance) => placed.point(instance, &all, random),
                None => point(primitives, primitives.len() - 1, random),
            },
        );
    }
    points
}

/// How much surface there is, and where.
#[derive(Clone, Copy)]
pub(super) struct Extent {
    pub area: f64,
    /// Sum of the roots of the areas of all primitives.
    pub root: f64,
    pub bounds: Aabb,
}

impl Extent {
    const NONE: Self = Self {
        area: 0.0,
        root: 0.0,
        bounds: Aabb::EMPTY,
    };

    fn of(primitives: &Primitives, index: usize) -> Self {
        let area = area(primitives, index);
        Self {
            area,
            root: area.sqrt(),
            bounds: primitives.bounds_of(index),
        }
    }

    fn plus(self, other: Self) -> Self {
        Self {
            area: self.area + other.area,
            root: self.root + other.root,
            bounds: self.bounds.union(&other.bounds),
        }
    }
}

fn range(primitives: &Primitives, chunk: usize) -> core::ops::Range<usize> {
    chunk * CHUNK..primitives.len().min((chunk + 1) * CHUNK)
}

pub(super) fn area(primitives: &Primitives, index: usize) -> f64 {
    match index.checked_sub(primitives.triangles.len()) {
        None => {
            let normal = unscaled_normal(&primitives.triangles[index]);
            0.5 * dot(&normal, &normal).sqrt()
        }
        Some(sphere) => {
            let radius = f64::from(primitives.spheres[sphere].radius);
            2.0 * TAU * radius * radius
        }
    }
}

/// A point anywhere on a primitive.
pub(super) fn point(primitives: &Primitives, index: usize, random: &mut Random) -> SurfacePoint {
    match index.checked_sub(primitives.triangles.len()) {
        None => {
            let corners = &primitives.triangles[index];
            let (mut u, mut v) = (random.unit(), random.unit());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let [a, b, c] = corners.map(|corner| corner.map(f64::from));
            SurfacePoint {
                position: core::array::from_fn(|axis| {
                    a[axis] + u * (b[axis] - a[axis]) + v * (c[axis] - a[axis])
                }),
                normal: unit_normal(corners),
            }
        }
        Some(sphere) => {
            let sphere = primitives.spheres[sphere];
            let normal = random.direction();
            SurfacePoint {
                position: core::array::from_fn(|axis| {
                    f64::from(sphere.center[axis]) + f64::from(sphere.radius) * normal[axis]
                }),
                normal,
            }
        }
    }
}

/// The cross product of two edges: twice the area long. In double precision nothing overflows.
fn unscaled_normal(corners: &[[f32; 3]; 3]) -> [f64; 3] {
    let [a, b, c] = corners.map(|corner| corner.map(f64::from));
    let u: [f64; 3] = core::array::from_fn(|axis| b[axis] - a[axis]);
    let v: [f64; 3] = core::array::from_fn(|axis| c[axis] - a[axis]);
    [
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    ]
}

/// The normal; any direction if there is none.
pub(super) fn unit_normal(corners: &[[f32; 3]; 3]) -> [f64; 3] {
    let normal = unscaled_normal(corners);
    let length = dot(&normal, &normal).sqrt();
    if length > 0.0 {
        normal.map(|x| x / length)
    } else {
        [0.0, 0.0, 1.0]
    }
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn to_f32(vector: [f64; 3]) -> [f32; 3] {
    vector.map(|x| x as f32)
}

/// SplitMix64 (Steele, Lea and Flood 2014).
pub(super) struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(hash::STEP);
        hash::mixed(self.0)
    }

    /// A number in `[0, 1)`.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A whole number below `end`, which is not 0.
    fn below(&mut self, end: usize) -> usize {
        ((u128::from(self.bits()) * end as u128) >> 64) as usize
    }

    /// A point on the unit sphere, none preferred.
    fn direction(&mut self) -> [f64; 3] {
        loop {
            // Rejection instead of sines: the same bits on every platform.
            let point: [f64; 3] = core::array::from_fn(|_| 2.0 * self.unit() - 1.0);
            let length2 = dot(&point, &point);
            if length2 > 1e-6 && length2 <= 1.0 {
                let length = length2.sqrt();
                return point.map(|x| x / length);
            }
        }
    }
}
