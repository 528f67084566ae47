//! The primitives of a scene, checked once and shared by every builder and by the brute-force oracle.
//!
//! Geometries become primitives in three stages, each with a file and a type of its own:
//!
//! - `copy`: geometries are checked and copied, what is unsound is dropped
//! - `classify`: filters decide which triangles are opaque, clear or partly transparent
//! - `place`: objects are placed in the world
//!
//! `still` has those that move, at a time.
//! `dropped` lists what was left out on the way, and why. `kinds` is the list of kinds. It numbers the result, kind
//! after kind, and tests single primitives.

use alloc::vec;
use alloc::vec::Vec;

mod classify;
mod copy;
pub(crate) mod dropped;
pub(crate) mod identity;
pub(crate) mod kinds;
mod place;
mod still;

use alloc::sync::Arc;

use crate::aabb::Aabb;
use crate::error::Error;
use crate::geometry::cutout::Filters;
use crate::geometry::instance::{Instance, PlacedObject};
use crate::geometry::motion::{Motion, check_keys};
use crate::geometry::{Geometry, PrimRef};
use crate::parallel::{chunk_len, map};
use classify::classified;
use copy::Copied;
use dropped::Dropped;
use identity::Identity;
use kinds::{OwnCutout, ScalarLists};
use place::asked_for;

pub(crate) use kinds::Prim;
pub use kinds::PrimKind;
pub(crate) use place::{INSTANCE_BYTES, MAX_INSTANCES};

/// Checked copies of all primitives that can be hit.
///
/// Dropped and [listed](Primitives::dropped_list) are:
/// - triangles with a NaN or infinite coordinate, and triangles of which two corners coincide,
/// - quads with a NaN or infinite coordinate, and quads of which each triangle has two corners that coincide,
/// - spheres without a positive finite radius and a finite centre,
/// - segments of curves with two equal ends, a negative radius, two radii of 0 or a NaN or infinite number,
/// - disks whose radius is not positive, whose normal is zero or which have a NaN or infinite number,
/// - primitives of user geometry whose box is empty or has a NaN or infinite number,
/// - instances whose transform is of no use (see [`Instance`]), and instances of objects without primitives.
///
/// A triangle whose three different corners lie on one line is kept. Seen by a ray, rounding makes it a sliver, and a
/// closed mesh may need that sliver to have no gap.
///
/// Triangles that their [`Opacity`](crate::cutout::Opacity) calls opaque are kept as triangles of a mesh without one. Triangles
/// that it calls clear are left out and counted as well.
///
/// ```
/// use antumbra::{Geometry, Primitives};
///
/// let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// let primitives = Primitives::new(&[Geometry::triangles(&positions[..], vec![[0, 1, 2], [0, 1, 1]])])?;
/// assert_eq!((primitives.len(), primitives.dropped()), (1, 1));
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Primitives {
    /// The opaque ones first, then the partly transparent ones.
    pub(crate) triangles: Vec<[[f32; 3]; 3]>,
    /// Names of the triangles, as many as `triangles`.
    pub(crate) triangle_refs: Vec<PrimRef>,
    /// One for each partly transparent triangle, which are the last of `triangles`.
    cutouts: Vec<OwnCutout>,
    /// Filters of the world and its objects, shared by all of them.
    pub(crate) filters: Arc<Filters>,
    /// All other primitives.
    pub(crate) scalars: ScalarLists,
    dropped: Vec<Dropped>,
    transparent: usize,
    /// Each with primitives and nothing else; empty where no instance needs one.
    pub(crate) objects: Vec<Primitives>,
    pub(crate) instances: Vec<PlacedObject>,
    pub(crate) identity: Identity,
    /// What moves. Everything else here is then as it is at time 0.
    pub(crate) motion: Option<Arc<Motion>>,
}

impl Primitives {
    /// Checks and copies the primitives of `geometries`. An empty list is fine.
    ///
    /// # Errors
    /// A vertex index out of range; more than 2²⁹ primitives, 2²⁸ spheres or 2²⁸ of user geometry
    /// among them, or 2³² - 1 geometries.
    pub fn new(geometries: &[Geometry<'_>]) -> Result<Self, Error> {
        Self::with_instances(geometries, &[[]; 0], &[])
    }

    /// A scene on two levels in which no instance is moved later: [`Bvh::build`](crate::Bvh::build) and
    /// [`Bvh::learn`](crate::Bvh::learn) make a tree of it. They take longer than a [`World`](crate::World) of finished objects,
    /// and the tree answers faster: training rays are followed from the top level into the objects, and both are learned
    /// together.
    ///
    /// Geometries lie in the world itself, beside `instances`, each of which places
    /// one of the `objects`. An object is a list of geometries and is stored once, however often it is
    /// placed; one that nobody places costs nothing and is not looked at.
    ///
    /// A [`Hit`](crate::Hit) names the instance by its place in `instances`, or [`INVALID_ID`](crate::INVALID_ID) in the world
    /// itself, and the geometry by its place in the list of the object, or in `world`.
    ///
    /// # Errors
    /// As [`Primitives::new`], for every list of geometries; an index of an object out of range; more than
    /// 2²⁹ - 2 instances; where something moves, the first key that is of no use: [`Error::OtherKeys`],
    /// [`Error::OtherVertices`], [`Error::KeyPosition`], [`Error::KeyTransform`], [`Error::KeysMirror`], [`Error::OutOfRange`],
    /// [`Error::Moves`].
    pub fn with_instances<'a>(
        world: &[Geometry<'_>],
        objects: &[impl AsRef<[Geometry<'a>]>],
        instances: &[Instance],
    ) -> Result<Self, Error> {
        let asked_for = asked_for(instances, objects.len())?;
        let spans = check_keys(world, instances)?;
        let mut opacities = Vec::new();
        let mut lists = vec![Copied::new(world, None, &mut opacities)?];
        for ((object, is_asked_for), index) in objects.iter().zip(asked_for).zip(0u32..) {
            let object: &[Geometry<'_>] = if is_asked_for { object.as_ref() } else { &[] };
            let why = "geometry of an object cannot move, but its instances can";
            object
                .iter()
                .try_for_each(|geometry| geometry.stands_still(why))?;
            lists.push(Copied::new(object, Some(index), &mut opacities)?);
        }
        let mut lists = classified(lists, opacities);
        let mut primitives = lists.next().unwrap_or_default();
        primitives.place(lists.collect(), instances);
        if spans > 0 {
            let motion = Motion::new(spans, world, &primitives.objects, instances)?;
            primitives.place_at(|inst_id| motion.transform(inst_id, 0, 0.0));
            primitives.motion = Some(Arc::new(motion));
        }
        Ok(primitives)
    }

    /// Number of primitives in the world itself, without dropped ones and without primitives of objects. A quad counts
    /// as the triangles it has: two, or one.
    pub fn len(&self) -> usize {
        self.triangles.len() + self.scalars.lens().iter().sum::<usize>()
    }

    /// Number of primitives stored: in the world itself and in every object that is placed.
    pub fn stored(&self) -> usize {
        let objects = self.objects.iter();
        self.len() + objects.map(Self::len).sum::<usize>()
    }

    /// Number of instances, without the dropped ones.
    pub fn instances(&self) -> usize {
        self.instances.len()
    }

    /// Number of objects that some instance places.
    pub fn objects(&self) -> usize {
        self.objects
            .iter()
            .filter(|object| !object.is_empty())
            .count()
    }

    /// The primitives of each object, which have no instances; empty where no instance needs one.
    pub fn object_list(&self) -> &[Primitives] {
        &self.objects
    }

    /// The corners of a primitive of the world itself, if it is a triangle, opaque or not.
    pub fn corners(&self, index: usize) -> Option<&[[f32; 3]; 3]> {
        self.triangles.get(index)
    }

    /// Whether there is nothing to hit.
    pub fn is_empty(&self) -> bool {
        self.len() == 0 && self.instances.is_empty()
    }

    /// Number of primitives and instances that were dropped. A primitive of an object counts once, however often
    /// the object is placed.
    pub fn dropped(&self) -> usize {
        self.dropped.len()
    }

    /// Primitives and instances that were dropped, by their ids, with the reason: first the primitives of the world, then
    /// instances, then primitives of objects.
    pub fn dropped_list(&self) -> &[Dropped] {
        &self.dropped
    }

    /// Number of partly transparent triangles. A triangle of an object counts once.
    pub fn cutouts(&self) -> usize {
        let of_objects = self.objects.iter().map(Self::cutouts);
        self.cutouts.len() + of_objects.sum::<usize>()
    }

    /// Number of primitives of user geometry. A primitive of an object counts once.
    pub fn users(&self) -> usize {
        let of_objects = self.objects.iter().map(Self::users);
        self.scalars.users.len() + of_objects.sum::<usize>()
    }

    /// Number of triangles that were left out because they are clear. A triangle of an object counts once.
    pub fn transparent(&self) -> usize {
        let of_objects = self.objects.iter().map(Self::transparent);
        self.transparent + of_objects.sum::<usize>()
    }

    /// The smallest box around primitives and the boxes of instances, at all times; empty if there is nothing. The box of
    /// an instance is a little larger than needed.
    pub fn bounds(&self) -> Aabb {
        let count = self.len() + self.instances.len();
        let chunk = chunk_len(count);
        map(count.div_ceil(chunk), 1, |place| {
            let range = place * chunk..count.min((place + 1) * chunk);
            range.fold(Aabb::EMPTY, |bounds, index| {
                bounds.union(&self.bounds_of(index))
            })
        })
        .iter()
        .chain(&self.motion.as_ref().map(|motion| motion.bounds()))
        .fold(Aabb::EMPTY, |all, bounds| all.union(bounds))
    }
}
