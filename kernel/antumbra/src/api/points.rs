//! Queries about points: what is nearest, what is within a distance, what is inside, and how deep.

use alloc::vec::Vec;

use super::batch::filled;
use super::bvh::Bvh;
use crate::geometry::instance::dot;
use crate::geometry::nearest::minus;
use crate::geometry::quad::told_uv;
use crate::geometry::ray_setup::ORIGIN_OFFSET;
use crate::math;
use crate::parallel::for_each;
use crate::ray_columns::Distance;
use crate::trace::brute::Brute;
use crate::trace::brute_points;
use crate::trace::inside::{self, Around};
use crate::trace::memory::Memory;
use crate::trace::nearest::{Candidate, Nearest, Reach, Seeker, Within};

/// A scene that reaches no more than so many times as far as a point has the offset of its box there: it costs no search, and
/// rays do not visit the leaf that they leave.
const NEAR: f32 = 4.0;

/// Points that one thread takes at a time.
const CHUNK: usize = 64;

/// Where a primitive is nearest to a point.
///
/// Of several primitives at equal distance the one of the smallest (inst_id, geom_id, prim_id) is nearest, as with
/// [`Hit`](crate::Hit).
///
/// ```
/// # use antumbra::{Bvh, Geometry, Recipe};
/// use antumbra::ClosestPoint;
///
/// # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
/// # let bvh = Bvh::build(&geometry, &Recipe::default())?;
/// let near: ClosestPoint = bvh.closest([0.25, 0.25, 3.0], 10.0).expect("a triangle within 10");
/// assert_eq!((near.distance, near.position, near.prim_id), (2.0, [0.25, 0.25, 1.0], 0));
/// # Ok::<(), antumbra::Error>(())
/// ```
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
    #[inline]
    fn new(candidate: &Candidate) -> Self {
        let near = &candidate.near;
        let id = candidate.id.told();
        let ([u, v], [x, y, z]) = (near.uv, near.position);
        let [u, v] = told_uv(candidate.id.prim_id, [u as f32, v as f32]);
        Self {
            distance: candidate.distance(),
            position: [x as f32, y as f32, z as f32],
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
/// Distances are measured to surfaces: a point inside a sphere or a closed mesh is as far away as the surface is.
/// Instances are measured in the world, whatever their transforms: corners are placed first, and spheres become
/// ellipsoids. Distances are computed and compared in double precision. The `f32` returned is the distance rounded
/// once. So answers are the same bits for every tree, one by one and together. Partly transparent triangles count as
/// if they were opaque. A quad is nearest where the nearer of its two triangles is, and counts once.
///
/// User geometry answers by [`UserGeometry::closest_point`](crate::shapes::UserGeometry::closest_point). Queries for
/// distances panic when they come to a primitive without it. No point is inside user geometry.
///
/// Neighbours among many points share work: points of a grid, a curve or a surface are fastest in that order.
impl Bvh {
    /// Points that are queried together: see [`Points`]. Shared among the threads of the current rayon pool, if the `parallel`
    /// feature is on.
    pub fn points<'a>(&'a self, points: &'a [[f32; 3]]) -> Points<'a> {
        Points {
            bvh: self,
            points,
            limits: Distance::Same(f32::INFINITY),
        }
    }

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
    ///
    /// # Panics
    /// If it comes to user geometry without [`closest_point`](crate::shapes::UserGeometry::closest_point).
    #[must_use]
    pub fn closest(&self, point: impl Into<[f32; 3]>, max_distance: f32) -> Option<ClosestPoint> {
        let point = point.into();
        let found = closest_by(point, max_distance, None, |nearest| {
            self.pool.with(|memory| self.seek(memory, point, nearest));
        });
        found.as_ref().map(ClosestPoint::new)
    }

    /// All primitives at a distance of at most `radius`, each once, the nearest first and at equal distances by (inst_id,
    /// geom_id, prim_id). Empty for a point with a NaN or infinite coordinate, and for a radius that is NaN or negative.
    ///
    /// ```
    /// # use antumbra::{Bvh, Geometry, Recipe};
    /// # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
    /// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
    /// # let bvh = Bvh::build(&geometry, &Recipe::default())?;
    /// assert_eq!(bvh.within([0.0, 0.0, 0.0], 1.5).len(), 1);
    /// assert!(bvh.within([0.0, 0.0, 0.0], 0.5).is_empty());
    /// # Ok::<(), antumbra::Error>(())
    /// ```
    ///
    /// # Panics
    /// As [`Bvh::closest`].
    #[must_use]
    pub fn within(&self, point: impl Into<[f32; 3]>, radius: f32) -> Vec<ClosestPoint> {
        let point = point.into();
        within_by(point, radius, |within| {
            self.pool.with(|memory| self.seek(memory, point, within));
        })
    }

    /// Origin offset: the distance from its surface at which a ray that leaves this point should begin, so that the surface does
    /// not hide what is around it.
    ///
    /// It is [`Aabb::origin_offset`](crate::Aabb::origin_offset) of a box that holds the point and the primitives on which the point lies:
    /// 4 millionths of the largest coordinate. So what is near is as sharp in a scene of 40 km as in one of 200 m. Only where
    /// everything is within four times the point's largest coordinate, it is the offset of the whole scene, since rays then do
    /// not even visit the leaf that they leave. 0 for a point with a NaN or infinite coordinate.
    ///
    /// A point that is farther off its surface than its own coordinates are rounded needs a larger offset: `org + t * dir` of a
    /// ray that came from far away is one, [`Surface::position`](crate::Surface::position) is not.
    ///
    /// Why that is enough: let `u = 2⁻²⁴`, and let `m` be the largest coordinate. A point that was computed from a surface is off it
    /// by a rounding or two of each coordinate, within `8 u m`, which is what "lies on" means here. Moving it along the normal
    /// rounds once more, so it is off by `10 u m` at most. A hit on a triangle is decided within `11 u` of its size on each
    /// axis, see the module `ray_setup`, which is `19 u` of at most `2 m`. So a ray that begins `48 u m` above the plane and goes
    /// upwards hits neither this triangle nor another one around the point in this plane. The offset is `68 u m`, which leaves
    /// room for normals of vertices that are 45 degrees off.
    ///
    /// Triangles, quads, spheres, disks and curves count, user geometry does not.
    ///
    /// ```
    /// # use antumbra::{Bvh, Geometry, Recipe};
    /// # let positions = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
    /// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
    /// # let bvh = Bvh::build(&geometry, &Recipe::default())?;
    /// use antumbra::Ray;
    ///
    /// let (point, normal) = ([1.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    /// let offset = bvh.origin_offset(point);
    /// assert!(offset < 2e-5, "4 millionths of 4");
    /// let org: [f32; 3] = std::array::from_fn(|axis| point[axis] + offset * normal[axis]);
    /// assert!(!bvh.occluded(&Ray::new(org, [0.6, 0.0, 0.8])));
    /// # Ok::<(), antumbra::Error>(())
    /// ```
    #[must_use]
    pub fn origin_offset(&self, point: impl Into<[f32; 3]>) -> f32 {
        let point = point.into();
        origin_offset(point, self.tree.reach, |reach| {
            self.pool.with(|memory| self.seek(memory, point, reach));
        })
    }

    /// Distance of the nearest surface, negative for points that [`Bvh::contains`] finds inside. 0 on a surface. Infinite if
    /// there is no geometry, and NaN for a point with a NaN or infinite coordinate.
    ///
    /// The sign is as exact as [`Bvh::contains`]: for bodies whose edges are each shared by an even number of triangles. A
    /// surface with holes, a disk or user geometry has a distance, but no inside: near them, the sign means little.
    /// Where bodies overlap, the distance is measured to the nearest surface, even if that is inside another body.
    ///
    /// ```
    /// # use antumbra::shapes::Sphere;
    /// # use antumbra::{Bvh, Geometry, Recipe};
    /// let ball = [Geometry::spheres(vec![Sphere { center: [0.0; 3], radius: 2.0 }])];
    /// let bvh = Bvh::build(&ball, &Recipe::default())?;
    /// assert_eq!(bvh.signed_distance([0.0, 5.0, 0.0]), 3.0);
    /// assert_eq!(bvh.signed_distance([0.0, 0.5, 0.0]), -1.5);
    /// # Ok::<(), antumbra::Error>(())
    /// ```
    ///
    /// # Panics
    /// As [`Bvh::closest`].
    #[must_use]
    pub fn signed_distance(&self, point: impl Into<[f32; 3]>) -> f32 {
        let point = point.into();
        let near = self.closest(point, f32::INFINITY);
        signed(point, near.map(|near| near.distance), |point| {
            self.contains(point)
        })
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
    ///
    /// ```
    /// # use antumbra::shapes::Sphere;
    /// # use antumbra::{Bvh, Geometry, Recipe};
    /// let ball = [Geometry::spheres(vec![Sphere { center: [0.0; 3], radius: 2.0 }])];
    /// let bvh = Bvh::build(&ball, &Recipe::default())?;
    /// assert!(bvh.contains([1.0, 0.0, 0.0]) && !bvh.contains([3.0, 0.0, 0.0]));
    /// # Ok::<(), antumbra::Error>(())
    /// ```
    #[must_use]
    pub fn contains(&self, point: impl Into<[f32; 3]>) -> bool {
        self.around(point.into()).is_inside
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
        self.pool
            .with(|memory| inside::around(&self.tree, point, &mut memory.children))
    }

    fn seek(&self, memory: &mut Memory, point: [f32; 3], seeker: &mut dyn Seeker) {
        (self.engine.0).search(&self.tree, point, memory, seeker);
    }
}

/// Many points of one query. Made by [`Bvh::points`]; nothing happens before the last call, which names the query.
///
/// Item `i` answers point `i`, with the bits of the query of one point.
///
/// ```
/// # use antumbra::{Bvh, Geometry, Recipe};
/// # let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
/// # let bvh = Bvh::build(&geometry, &Recipe::default())?;
/// let points = [[0.25, 0.25, 3.0], [0.25, 0.25, -2.0]];
/// let distance = |near: Option<antumbra::ClosestPoint>| near.map(|near| near.distance);
/// let closest = bvh.points(&points).closest();
/// assert_eq!([0, 1].map(|point| distance(closest[point])), [Some(3.0), Some(2.0)]);
/// let closest = bvh.points(&points).within(&[1.0, 2.0][..]).closest();
/// assert_eq!([0, 1].map(|point| distance(closest[point])), [None, Some(2.0)]);
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
#[must_use = "points do nothing until the last call"]
pub struct Points<'a> {
    bvh: &'a Bvh,
    points: &'a [[f32; 3]],
    limits: Distance<'a>,
}

impl<'a> Points<'a> {
    /// Looks no farther than this: one distance for all points, or one for each. Without a call, at any distance. Counts for
    /// [`Points::closest`] and [`Points::all`]; [`Points::inside`] and [`Points::signed_distances`] have no limit.
    ///
    /// # Panics
    /// If there are fewer distances than points.
    pub fn within(self, distances: impl Into<Distance<'a>>) -> Self {
        let limits = distances.into();
        let checked = limits.check("distances", self.points.len());
        assert!(checked.is_ok(), "one distance per point");
        Self { limits, ..self }
    }

    /// [`Bvh::closest`] of each point.
    ///
    /// # Panics
    /// As [`Bvh::closest`].
    #[must_use]
    pub fn closest(self) -> Vec<Option<ClosestPoint>> {
        filled(self.points.len(), None, |found| self.closest_into(found))
    }

    /// [`Points::closest`] into a slice.
    ///
    /// # Panics
    /// If there are not as many answers as points, and as [`Bvh::closest`].
    pub fn closest_into(self, closest: &mut [Option<ClosestPoint>]) {
        self.closest_each(closest, |_, found| found.map(ClosestPoint::new));
    }

    /// [`Bvh::within`] of each point: all primitives that are near enough.
    ///
    /// # Panics
    /// As [`Bvh::closest`].
    #[must_use]
    pub fn all(self) -> Vec<Vec<ClosestPoint>> {
        let within = |index, point| self.bvh.within(point, self.limits.get(index));
        filled(self.points.len(), Vec::new(), |found| {
            each(self.points, found, within)
        })
    }

    /// [`Bvh::contains`] of each point.
    #[must_use]
    pub fn inside(self) -> Vec<bool> {
        filled(self.points.len(), false, |found| self.inside_into(found))
    }

    /// [`Points::inside`] into a slice.
    ///
    /// # Panics
    /// If there are not as many answers as points.
    pub fn inside_into(self, inside: &mut [bool]) {
        each(self.points, inside, |_, point| self.bvh.contains(point));
    }

    /// [`Bvh::signed_distance`] of each point.
    ///
    /// # Panics
    /// As [`Bvh::closest`].
    #[must_use]
    pub fn signed_distances(self) -> Vec<f32> {
        filled(self.points.len(), 0.0, |found| {
            self.signed_distances_into(found)
        })
    }

    /// [`Points::signed_distances`] into a slice.
    ///
    /// # Panics
    /// If there are not as many answers as points, and as [`Bvh::closest`].
    pub fn signed_distances_into(self, distances: &mut [f32]) {
        let (bvh, limits) = (self.bvh, Distance::Same(f32::INFINITY));
        Self { limits, ..self }.closest_each(distances, |point, found| {
            signed(point, found.map(Candidate::distance), |point| {
                bvh.contains(point)
            })
        });
    }

    /// Answers every point by the primitive nearest to it. One thread takes neighbours one after the other, and guesses
    /// that the distance changes little from one point to the next.
    fn closest_each<A: Send>(
        self,
        answers: &mut [A],
        answer: impl Fn([f32; 3], Option<&Candidate>) -> A + Sync + Send,
    ) {
        in_chunks(self.points, answers, |first, points, answers| {
            self.bvh.pool.with(|memory| {
                let mut last = None;
                for (index, (&point, slot)) in points.iter().zip(answers).enumerate() {
                    let limit = self.limits.get(first + index);
                    let found = closest_by(point, limit, last, |nearest| {
                        self.bvh.seek(memory, point, nearest);
                    });
                    *slot = answer(point, found.as_ref());
                    if let Some(found) = found {
                        last = Some(found.near.position);
                    }
                }
            });
        });
    }
}

impl Brute {
    /// [`Bvh::closest`].
    #[must_use]
    pub fn closest(&self, point: impl Into<[f32; 3]>, max_distance: f32) -> Option<ClosestPoint> {
        let point = point.into();
        let found = closest_by(point, max_distance, None, |nearest| {
            brute_points::offer_all(self.primitives(), point, nearest);
        });
        found.as_ref().map(ClosestPoint::new)
    }

    /// [`Bvh::signed_distance`].
    #[must_use]
    pub fn signed_distance(&self, point: impl Into<[f32; 3]>) -> f32 {
        let point = point.into();
        let near = self.closest(point, f32::INFINITY);
        signed(point, near.map(|near| near.distance), |point| {
            self.contains(point)
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

    /// [`Bvh::origin_offset`].
    #[must_use]
    pub fn origin_offset(&self, point: impl Into<[f32; 3]>) -> f32 {
        let point = point.into();
        origin_offset(point, self.reach(), |reach| {
            brute_points::offer_all(self.primitives(), point, reach);
        })
    }

    /// Whether the point is inside, from a test of every primitive: the answer that [`Bvh::contains`] must have.
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

#[inline]
fn is_finite([x, y, z]: [f32; 3]) -> bool {
    x.is_finite() & y.is_finite() & z.is_finite()
}

/// The nearest primitive. `last` is a point of some surface, perhaps a near one.
#[inline]
fn closest_by(
    point: [f32; 3],
    max_distance: f32,
    last: Option<[f64; 3]>,
    mut seek: impl FnMut(&mut Nearest),
) -> Option<Candidate> {
    // Not for NaN.
    if !(is_finite(point) && max_distance >= 0.0) {
        return None;
    }
    let max_distance = f64::from(max_distance);
    let mut nearest = Nearest::new(max_distance);
    if let Some(last) = last {
        let way = minus(last, point.map(f64::from));
        // More than rounding could change.
        let guess = math::sqrt(dot(way, way)) * (1.0 + 1e-6);
        nearest.guess(guess);
        seek(&mut nearest);
        if nearest.is_known() {
            return nearest.best;
        }
        nearest = Nearest::new(max_distance);
    }
    seek(&mut nearest);
    nearest.best
}

/// The distance of a point with its sign.
fn signed(point: [f32; 3], distance: Option<f32>, contains: impl FnOnce([f32; 3]) -> bool) -> f32 {
    match distance {
        // Not -0.
        Some(distance) if contains(point) => 0.0 - distance,
        Some(distance) => distance,
        None if is_finite(point) => f32::INFINITY,
        None => f32::NAN,
    }
}

fn within_by(point: [f32; 3], radius: f32, seek: impl FnOnce(&mut Within)) -> Vec<ClosestPoint> {
    if !(is_finite(point) && radius >= 0.0) {
        return Vec::new();
    }
    let mut within = Within::new(radius.into());
    seek(&mut within);
    within.sorted().iter().map(ClosestPoint::new).collect()
}

/// See [`Bvh::origin_offset`]. `extent` is the largest coordinate of the scene.
fn origin_offset(point: [f32; 3], extent: f32, seek: impl FnOnce(&mut Reach)) -> f32 {
    if !is_finite(point) {
        return 0.0;
    }
    let most = point
        .into_iter()
        .fold(0.0, |most: f32, x| most.max(x.abs()));
    if extent <= NEAR * most {
        return extent.max(most) * ORIGIN_OFFSET;
    }
    let most = f64::from(most);
    let mut reach = Reach {
        distance: most / (1 << 21) as f64,
        reach: most,
    };
    seek(&mut reach);
    reach.reach as f32 * ORIGIN_OFFSET
}

/// Answers every point, given its index.
fn each<A: Send>(
    points: &[[f32; 3]],
    answers: &mut [A],
    query: impl Fn(usize, [f32; 3]) -> A + Sync + Send,
) {
    in_chunks(points, answers, |first, points, answers| {
        for (index, (point, answer)) in points.iter().zip(answers).enumerate() {
            *answer = query(first + index, *point);
        }
    });
}

/// Answers points, some at a time per thread, given the index of the first of them.
fn in_chunks<A: Send>(
    points: &[[f32; 3]],
    answers: &mut [A],
    work: impl Fn(usize, &[[f32; 3]], &mut [A]) + Sync + Send,
) {
    assert_eq!(points.len(), answers.len(), "one answer per point");
    let jobs = points.chunks(CHUNK).zip(answers.chunks_mut(CHUNK));
    for_each(jobs.enumerate().collect(), |(chunk, (points, answers))| {
        work(chunk * CHUNK, points, answers);
    });
}
