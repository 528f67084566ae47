//! Surface rays: synthetic training rays that resemble the rays of a renderer, made only from the surfaces.

use alloc::vec::Vec;

use crate::aabb::Aabb;
use crate::geometry::primitives::{Prim, Primitives};
use crate::geometry::scalar::SurfacePoint;
use crate::hash::Random;
use crate::learn::placed_surfaces::PlacedSurfaces;
use crate::math;
use crate::parallel;
use crate::ray::Ray;

/// Period with which one ray is a segment between two points on surfaces.
const SEGMENT_PERIOD: usize = 4;
/// Primitives of which only the sum of the weights is kept. Where a ray starts is found chunk by chunk, then
/// primitive by primitive; a ray of the default log has 64 primitives to itself.
const CHUNK: usize = 16;
/// Chunks and rays that make a task.
const CHUNKS_PER_TASK: usize = 256;
const RAYS_PER_TASK: usize = 64;

/// Makes `count` training rays that start at points spread over all surfaces.
///
/// Three of four run without end in directions distributed by the cosine about the normal, on either side, like
/// bounces and ambient occlusion. The fourth is a segment to another such point, like the rays to an area light. Every
/// ray begins an [origin offset](Aabb::origin_offset) away from its surface.
///
/// Half of the points are spread by area. The other half are given to primitives by the root of their
/// area, so that a ground plane or a sky of two triangles does not get them all. Every instance has the
/// surface of its object, as large as it is in the world.
///
/// The result depends only on the primitives, the count and the seed. The list is empty if no primitive has an area.
/// Uses the rayon pool that is current, if the `parallel` feature is on.
pub fn surface_rays(primitives: &Primitives, count: usize, seed: u64) -> Vec<Ray> {
    surface_rays_within(primitives, &primitives.bounds(), count, seed)
}

/// Fewer primitives than this are not worth learning: 360 triangles take 25 times as long to build, and answer as many rays
/// per second.
const FEW: usize = 1000;

/// Number of surface rays that suits the size of a scene: following them costs a share of what the build costs, and
/// more of them save next to nothing. None for a small one.
pub(crate) fn default_count(primitives: &Primitives) -> usize {
    match primitives.stored() {
        ..FEW => 0,
        stored => (stored / 64).clamp(512, 2048),
    }
}

/// [`surface_rays`] of primitives whose bounds are known.
pub(crate) fn surface_rays_within(
    primitives: &Primitives,
    bounds: &Aabb,
    count: usize,
    seed: u64,
) -> Vec<Ray> {
    let own = Surfaces::new(primitives);
    let placed = PlacedSurfaces::new(primitives, own.all);
    if placed.all.area <= 0.0 {
        return Vec::new();
    }
    let point = |place: f64, random: &mut Random| match placed.point(place, random) {
        Some(point) => point,
        None => own.point(place, &placed.all, random),
    };
    let offset = f64::from(bounds.origin_offset());
    parallel::map(count, RAYS_PER_TASK, |index| {
        // Numbers of its own, so that rays can be made in any order.
        let mut random = Random::new(seed, index);
        // One point in each of `count` equal shares of the surfaces.
        let place = (index as f64 + random.unit()) / count as f64;
        let from = point(place, &mut random);
        if index % SEGMENT_PERIOD == 0 {
            let place = random.unit();
            between(&from, &point(place, &mut random), offset)
        } else {
            bounce(&from, &mut random, offset)
        }
    })
}

/// The surfaces of primitives one after the other, to be found by their weights.
pub(crate) struct Surfaces<'a> {
    primitives: &'a Primitives,
    /// All of them.
    pub all: Weights,
    /// The primitives before each chunk.
    before: Vec<Weights>,
}

impl<'a> Surfaces<'a> {
    /// Surfaces of the world itself or of an object.
    pub fn new(primitives: &'a Primitives) -> Self {
        let chunks = primitives.len().div_ceil(CHUNK);
        let mut before = parallel::map(chunks, CHUNKS_PER_TASK, |chunk| {
            Self::range(primitives, chunk)
                .map(|index| Weights::of(primitives, index))
                .fold(Weights::NONE, Weights::plus)
        });
        let mut all = Weights::NONE;
        for chunk in &mut before {
            let next = all.plus(*chunk);
            *chunk = all;
            all = next;
        }
        Self {
            primitives,
            all,
            before,
        }
    }

    fn range(primitives: &Primitives, chunk: usize) -> core::ops::Range<usize> {
        chunk * CHUNK..primitives.len().min((chunk + 1) * CHUNK)
    }

    /// A point on the primitive that such a share of the whole, counted from the first one, leads to. There are some
    /// primitives.
    pub fn point(&self, place: f64, whole: &Weights, random: &mut Random) -> SurfacePoint {
        let begins = |before: &Weights| before.share_of(whole) <= place;
        // The first chunk begins at 0, so there is one.
        let chunk = self.before.partition_point(begins).max(1) - 1;
        let mut before = self.before[chunk].share_of(whole);
        // Rounding may leave the place just beyond the last one.
        let mut found = chunk * CHUNK;
        for index in Self::range(self.primitives, chunk) {
            let share = Weights::of(self.primitives, index).share_of(whole);
            if share > 0.0 {
                found = index;
            }
            before += share;
            if place < before {
                break;
            }
        }
        SurfacePoint::on(self.primitives, found, random)
    }
}

/// Amount of surface.
#[derive(Clone, Copy)]
pub(crate) struct Weights {
    pub area: f64,
    /// Sum of the roots of the areas of all primitives.
    pub root: f64,
}

impl Weights {
    pub const NONE: Self = Self {
        area: 0.0,
        root: 0.0,
    };

    #[inline(always)]
    fn of(primitives: &Primitives, index: usize) -> Self {
        let area = area(primitives, index);
        Self {
            area,
            root: math::sqrt(area),
        }
    }

    #[inline(always)]
    pub fn plus(self, other: Self) -> Self {
        Self {
            area: self.area + other.area,
            root: self.root + other.root,
        }
    }

    /// The weights if every area is multiplied by a number.
    pub fn enlarged(self, by: f64) -> Self {
        Self {
            area: self.area * by,
            root: self.root * math::sqrt(by),
        }
    }

    /// Share of a whole: half by area, half by the root of the area.
    pub fn share_of(self, whole: &Self) -> f64 {
        0.5 * (self.area / whole.area + self.root / whole.root)
    }
}

impl SurfacePoint {
    /// A point anywhere on a primitive.
    fn on(primitives: &Primitives, index: usize, random: &mut Random) -> Self {
        match primitives.prim(index) {
            Prim::Triangle(corners, _) => {
                let (mut u, mut v) = (random.unit(), random.unit());
                if u + v > 1.0 {
                    (u, v) = (1.0 - u, 1.0 - v);
                }
                let [a, b, c] = corners.map(|corner| corner.map(f64::from));
                Self {
                    position: core::array::from_fn(|axis| {
                        a[axis] + u * (b[axis] - a[axis]) + v * (c[axis] - a[axis])
                    }),
                    normal: unit_normal(corners),
                }
            }
            Prim::Scalar(shape, _) => shape.surface_point(random),
        }
    }
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

#[inline(always)]
pub(crate) fn area(primitives: &Primitives, index: usize) -> f64 {
    match primitives.prim(index) {
        Prim::Triangle(corners, _) => {
            let normal = unscaled_normal(corners);
            0.5 * math::sqrt(dot(&normal, &normal))
        }
        Prim::Scalar(shape, _) => shape.area(),
    }
}

/// The cross product of two edges: twice the area long. In double precision nothing overflows.
#[inline(always)]
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
pub(crate) fn unit_normal(corners: &[[f32; 3]; 3]) -> [f64; 3] {
    unit(unscaled_normal(corners))
}

/// The direction of a vector, of unit length; any if there is none.
pub(crate) fn unit(vector: [f64; 3]) -> [f64; 3] {
    let length = math::sqrt(dot(&vector, &vector));
    if length > 0.0 {
        vector.map(|x| x / length)
    } else {
        [0.0, 0.0, 1.0]
    }
}

#[inline(always)]
fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn to_f32(vector: [f64; 3]) -> [f32; 3] {
    vector.map(|x| x as f32)
}
