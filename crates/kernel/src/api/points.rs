//! Queries about points: what is nearest, what is within a distance, what is inside.

use alloc::vec::Vec;

use antumbra_simd::Dispatch;

use super::bvh::Bvh;
use crate::geometry::quad::told_uv;
use crate::math;
use crate::parallel::for_each;
use crate::trace::brute::Brute;
use crate::trace::brute_points;
use crate::trace::inside::{self, Around};
use crate::trace::nearest::{Candidate, Nearest, Search, Seeker, Within};
use crate::tree::any::on_tree;

/// Points that one thread takes at a time.
const CHUNK: usize = 64;

/// Where a primitive is nearest to a point.
///
/// Of several primitives at equal distance the one of the smallest (inst_id, geom_id, prim_id) is nearest, as with
/// [`Hit`](crate::Hit).
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ClosestPoint {
    /// Distance in the world.
    pub distance: f32,
    /// Nearest point of the primitive, in the world.
    pub position: [f32; 3],
    /// Barycentric weight of the triangle's second corner; 0 without corners; on a quad as [`Hit::u`](crate::Hit::u).
    pub u: f32,
    /// Barycentric weight of the triangle's third corner; 0 without corners; on a quad as [`Hit::v`](crate::Hit::v).
    pub v: f32,
    /// Index of the primitive in its geometry.
    pub prim_id: u32,
    /// Index of the geometry in the list the tree was built from, or in the list of the instance's object.
    pub geom_id: u32,
    /// Index of the instance, or [`INVALID_ID`](crate::INVALID_ID) if the primitive lies in the world itself.
    pub inst_id: u32,
}

impl ClosestPoint {
    fn new(candidate: &Candidate) -> Self {
        let near = &candidate.near;
        let id = candidate.id.told();
        let [u, v] = told_uv(candidate.id.prim_id, near.uv.map(|weight| weight as f32));
        Self {
            distance: math::sqrt(near.distance2) as f32,
            position: near.position.map(|x| x as f32),
            u,
            v,
            prim_id: id.prim_id,
            geom_id: id.geom_id,
            inst_id: candidate.inst_id,
        }
    }
}

/// Queries about points.
///
/// Distances are those of surfaces: a point inside a sphere or a closed mesh is as far away as the surface is. Instances are
/// measured in the world, whatever their transforms: corners are placed first, and spheres become ellipsoids.
/// Distances are worked out in double precision and compared so; the `f32` returned is the distance rounded once. So
/// answers are the same bits for every tree. Partly transparent triangles count as if they were opaque.
///
/// [User geometry](crate::UserGeometry) is left out: nobody knows how far away it is, nor what is inside. A quad is nearest where
/// the nearer of its two triangles is, and counts once.
impl Bvh {
    /// The nearest primitive, if its distance is at most `max_distance`, which may be infinite. `None` for a point with a
    /// NaN or infinite coordinate, and for a distance that is NaN or negative.
    ///
    /// ```
    /// # use antumbra::{Bvh, Geometry, Recipe};
    /// let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
    /// let bvh = Bvh::build(&geometry, &Recipe::default())?;
    /// let near = bvh.closest([0.25, 0.25, 3.0], 5.0).expect("three away");
    /// assert_eq!((near.distance, near.position), (3.0, [0.25, 0.25, 0.0]));
    /// assert_eq!(bvh.closest([0.25, 0.25, 3.0], 2.0), None);
    /// # Ok::<(), antumbra::Error>(())
    /// ```
    #[must_use]
    pub fn closest(&self, point: impl Into<[f32; 3]>, max_distance: f32) -> Option<ClosestPoint> {
        let point = point.into();
        closest_by(point, max_distance, |nearest| self.seek(point, nearest))
    }

    /// [`Bvh::closest`] of many points: `closest[i]` answers `points[i]`. Shared among the threads of the current rayon
    /// pool, if the `parallel` feature is on.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn closest_batch(
        &self,
        points: &[[f32; 3]],
        max_distance: f32,
        closest: &mut [Option<ClosestPoint>],
    ) {
        each(points, closest, |point| self.closest(point, max_distance));
    }

    /// All primitives at a distance of at most `radius`, each once, the nearest first and at equal distances by (inst_id,
    /// geom_id, prim_id). Empty for a point with a NaN or infinite coordinate, and for a radius that is NaN or negative.
    #[must_use]
    pub fn within(&self, point: impl Into<[f32; 3]>, radius: f32) -> Vec<ClosestPoint> {
        let point = point.into();
        within_by(point, radius, |within| self.seek(point, within))
    }

    /// [`Bvh::within`] of many points: `found[i]` answers `points[i]`. Shared among threads as in [`Bvh::closest_batch`].
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn within_batch(&self, points: &[[f32; 3]], radius: f32, found: &mut [Vec<ClosestPoint>]) {
        each(points, found, |point| self.within(point, radius));
    }

    /// Whether a point lies in a sphere or in a closed mesh, in the world or in an instance: whether a half-line from the
    /// point crosses some geometry an odd number of times. False for a point with a NaN or infinite coordinate.
    ///
    /// Exact for every geometry in which each edge is shared, with the same coordinates, by two triangles or another even
    /// number of them; indices need not be shared, and which way triangles run does not matter. Only for points within
    /// rounding of a surface either answer may come out. Bodies of different geometries may overlap, bodies of one
    /// geometry leave out what they share. For surfaces with holes the answer means little.
    ///
    /// An instance counts for points inside its box.
    #[must_use]
    pub fn contains(&self, point: impl Into<[f32; 3]>) -> bool {
        self.around(point.into()).is_inside
    }

    /// [`Bvh::contains`] of many points: `inside[i]` answers `points[i]`. Shared among threads as in
    /// [`Bvh::closest_batch`].
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn contains_batch(&self, points: &[[f32; 3]], inside: &mut [bool]) {
        each(points, inside, |point| self.contains(point));
    }

    /// How often closed meshes and spheres go around a point, in the world and in instances: 1 in a mesh whose triangles
    /// are counterclockwise seen from outside, -1 where they are clockwise, 0 outside, the sum where bodies overlap. 0 for a
    /// point with a NaN or infinite coordinate.
    ///
    /// As exact as [`Bvh::contains`], if along each edge as many triangles run one way as the other. Where they do not,
    /// only whether the number is odd means something.
    #[must_use]
    pub fn winding_number(&self, point: impl Into<[f32; 3]>) -> i32 {
        self.around(point.into()).winding
    }

    fn around(&self, point: [f32; 3]) -> Around {
        if !is_finite(point) {
            return Around::default();
        }
        self.pool.with(|memory| {
            let stack = &mut memory.children;
            on_tree!(&self.tree, tree => inside::around(tree, point, stack))
        })
    }

    fn seek(&self, point: [f32; 3], seeker: &mut dyn Seeker) {
        self.pool.with(|memory| {
            let stack = &mut memory.entries;
            on_tree!(&self.tree, tree => self.isa.dispatch(Search { tree, point, stack, seeker }));
        });
    }
}

impl Brute {
    /// [`Bvh::closest`].
    #[must_use]
    pub fn closest(&self, point: impl Into<[f32; 3]>, max_distance: f32) -> Option<ClosestPoint> {
        let point = point.into();
        closest_by(point, max_distance, |nearest| {
            brute_points::offer_all(self.primitives(), point, nearest);
        })
    }

    /// [`Bvh::within`].
    #[must_use]
    pub fn within(&self, point: impl Into<[f32; 3]>, radius: f32) -> Vec<ClosestPoint> {
        let point = point.into();
        within_by(point, radius, |within| {
            brute_points::offer_all(self.primitives(), point, within);
        })
    }

    /// [`Bvh::contains`].
    #[must_use]
    pub fn contains(&self, point: impl Into<[f32; 3]>) -> bool {
        self.around(point.into()).is_inside
    }

    /// [`Bvh::winding_number`].
    #[must_use]
    pub fn winding_number(&self, point: impl Into<[f32; 3]>) -> i32 {
        self.around(point.into()).winding
    }

    fn around(&self, point: [f32; 3]) -> Around {
        if !is_finite(point) {
            return Around::default();
        }
        brute_points::around(self.primitives(), point)
    }
}

fn is_finite(point: [f32; 3]) -> bool {
    point.iter().all(|x| x.is_finite())
}

fn closest_by(
    point: [f32; 3],
    max_distance: f32,
    seek: impl FnOnce(&mut Nearest),
) -> Option<ClosestPoint> {
    // Not for NaN.
    if !(is_finite(point) && max_distance >= 0.0) {
        return None;
    }
    let mut nearest = Nearest::new(max_distance.into());
    seek(&mut nearest);
    nearest.best.as_ref().map(ClosestPoint::new)
}

fn within_by(point: [f32; 3], radius: f32, seek: impl FnOnce(&mut Within)) -> Vec<ClosestPoint> {
    if !(is_finite(point) && radius >= 0.0) {
        return Vec::new();
    }
    let mut within = Within::new(radius.into());
    seek(&mut within);
    within.sorted().iter().map(ClosestPoint::new).collect()
}

/// Answers every point, some at a time per thread.
fn each<A: Send>(
    points: &[[f32; 3]],
    answers: &mut [A],
    query: impl Fn([f32; 3]) -> A + Sync + Send,
) {
    assert_eq!(points.len(), answers.len(), "one answer per point");
    let jobs = points.chunks(CHUNK).zip(answers.chunks_mut(CHUNK));
    for_each(jobs.collect(), |(points, answers)| {
        for (point, answer) in points.iter().zip(answers) {
            *answer = query(*point);
        }
    });
}
