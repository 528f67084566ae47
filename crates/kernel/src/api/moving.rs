//! Trees over scenes that move while rays are traced.

use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;
use core::fmt;

use antumbra_simd::{Dispatch, Isa};

use super::batch::CHUNK;
use super::build::Build;
use super::bvh::Bvh;
use super::recipe::Recipe;
use crate::aabb::Aabb;
use crate::error::Error;
use crate::geometry::PrimRef;
use crate::geometry::instance::ObjectShape;
use crate::geometry::motion::{MovingGeometry, MovingInstance, MovingScene, locate};
use crate::geometry::path::MovingPlacement;
use crate::geometry::primitives::Primitives;
use crate::parallel::{for_each, threads};
use crate::ray::{Hit, Ray};
use crate::trace::memory::{Memory, Stored};
use crate::trace::moving::{BlockQuery, Moving, SingleMoving};
use crate::trace::query::{Closest, Occlusion};
use crate::trace::ray_batch::RayBatch;
use crate::trace::stack::stack_size;
use crate::tree::any::on_tree;
use crate::tree::motion::Keys;

/// A tree over a scene that moves, in which every ray has a time.
///
/// Times go from 0, the first key, to 1, the last one. Times outside are clamped, and NaN counts as 0. An answer at a
/// time equals the answer of [`Brute`](crate::Brute) over [`MovingScene::at`] that time, for every recipe, width and
/// level, for single rays and in batches.
///
/// Two exceptions are known, both from the clamping of distances into boxes. In an object squeezed by a factor of
/// thousands, the distance of a hit at a grazing angle may differ, because the box around a moving instance is larger than
/// needed. Distances of user geometry may differ that are not inside its own box.
///
/// Each span between two keys has a tree of its own, which is built and learned in the middle of the span. Boxes
/// move along: a node tests where its boxes are at the time of the ray. Objects are stored once for every span.
///
/// ```
/// use antumbra::{MovingBvh, MovingMesh, MovingScene, Ray, Recipe};
///
/// let at = |x: f32| vec![[x, 0.0, 1.0], [x + 1.0, 0.0, 1.0], [x, 1.0, 1.0]];
/// let mesh = MovingMesh::new(vec![at(0.0).into(), at(4.0).into()], vec![[0, 1, 2]]);
/// let scene = MovingScene::new(vec![mesh.into()], vec![], vec![])?;
/// let bvh = MovingBvh::build(&scene, &Recipe::default())?;
/// let ray = Ray::new([2.2, 0.2, 0.0], [0.0, 0.0, 1.0]);
/// assert!(bvh.occluded(&ray, 0.5));
/// assert!(!bvh.occluded(&ray, 0.0));
/// # Ok::<(), antumbra::Error>(())
/// ```
///
/// Moving trees are not saved to files, and have no masks, filters and queries about points. For those, build a tree over
/// [`MovingScene::at`] the time in question.
#[derive(Clone)]
pub struct MovingBvh {
    /// One tree for each span between two keys.
    spans: Vec<Bvh>,
}

impl MovingBvh {
    /// Builds the trees of a scene, each learned from surface rays.
    ///
    /// # Errors
    /// As [`Bvh::build`]; [`Error::OutOfRange`] for an instance whose path leaves the range of `f32`.
    pub fn build(scene: &MovingScene<'_>, recipe: &Recipe) -> Result<Self, Error> {
        Self::learn(scene, &[], &[], recipe)
    }

    /// Builds the trees of a scene, each learned from the `rays` whose times are in its span: `times[i]` is the time of
    /// `rays[i]`. They are followed through the middle of the span.
    ///
    /// # Errors
    /// As [`MovingBvh::build`].
    ///
    /// # Panics
    /// If there are not as many times as rays.
    pub fn learn(
        scene: &MovingScene<'_>,
        rays: &[Ray],
        times: &[f32],
        recipe: &Recipe,
    ) -> Result<Self, Error> {
        assert_eq!(rays.len(), times.len(), "one time per ray");
        let mut trees = Vec::with_capacity(scene.spans());
        for span in 0..scene.spans() {
            let is_in = |time: f32| locate(time, scene.spans()).0 == span;
            let own = rays.iter().zip(times).filter(|(_, time)| is_in(**time));
            let own: Vec<Ray> = own.map(|(ray, _)| *ray).collect();
            let primitives = scene.middle(span)?;
            trees.push(Build::new(&primitives).recipe(recipe).rays(&own).bvh()?);
        }
        Self::from_trees(&Motion::new(scene)?, trees)
    }

    /// Makes trees of one's own move, one for each span: tree `i` is one over [`MovingScene::middle`] of span `i`, however it
    /// was built. `motion` belongs to the scene.
    ///
    /// # Errors
    /// [`Error::OtherTrees`] if there are not as many trees as spans; [`Error::PrimitiveIsGone`] if a triangle of a
    /// moving mesh is not where it is in the middle of the span, as in a tree of another scene or span. Other
    /// primitives are not compared.
    pub fn from_trees(motion: &Motion, trees: Vec<Bvh>) -> Result<Self, Error> {
        if trees.len() != motion.spans.len() {
            return Err(Error::OtherTrees {
                expected: motion.spans.len(),
                found: trees.len(),
            });
        }
        let mut spans = Vec::with_capacity(trees.len());
        for (mut bvh, keys) in trees.into_iter().zip(&motion.spans) {
            bvh.tree.set_motion(keys)?;
            spans.push(bvh);
        }
        Ok(Self { spans })
    }

    /// Returns the number of spans between two keys, each of which has a tree.
    #[must_use]
    pub fn spans(&self) -> usize {
        self.spans.len()
    }

    /// The smallest box around everything at all times; boxes of moving instances are a little larger than needed.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        (self.spans.iter()).fold(Aabb::EMPTY, |all, bvh| all.union(&bvh.bounds()))
    }

    /// The instruction set that queries run on.
    #[must_use]
    pub fn isa(&self) -> Isa {
        self.spans[0].isa()
    }

    /// Runs queries on another instruction set from now on.
    pub fn set_isa(&mut self, isa: Isa) {
        for bvh in &mut self.spans {
            bvh.set_isa(isa);
        }
    }

    /// Whether anything lies in the ray's interval at a time.
    #[must_use]
    pub fn occluded(&self, ray: &Ray, time: f32) -> bool {
        self.one::<Occlusion>(ray, time)
    }

    /// The closest hit in the ray's interval at a time; at equal distances the smallest (inst_id, geom_id, prim_id).
    #[must_use]
    pub fn intersect(&self, ray: &Ray, time: f32) -> Option<Hit> {
        self.one::<Closest>(ray, time)
    }

    /// Whether anything lies in the interval of each ray at its time: `occluded[i]` answers `rays[i]` at `times[i]`.
    ///
    /// More than 16 384 rays are shared among the threads of the current rayon pool, if the `parallel` feature is on.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn occluded_batch(&self, rays: &[Ray], times: &[f32], occluded: &mut [bool]) {
        self.batch::<Occlusion>(rays, times, occluded);
    }

    /// The closest hit of each ray at its time: `hits[i]` answers `rays[i]` at `times[i]`. Shared among threads as
    /// [`MovingBvh::occluded_batch`].
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn intersect_batch(&self, rays: &[Ray], times: &[f32], hits: &mut [Option<Hit>]) {
        self.batch::<Closest>(rays, times, hits);
    }

    /// Checks that the boxes of the world hold what is below them, at both keys of every span; for tests and bug reports.
    ///
    /// # Errors
    /// The first box that does not, in words.
    pub fn validate(&self) -> Result<(), alloc::string::String> {
        self.spans
            .iter()
            .try_for_each(|bvh| bvh.tree.check_motion())
    }

    #[inline(always)]
    fn one<Q: BlockQuery<Item: Stored + antumbra_simd::scratch::Bits>>(
        &self,
        ray: &Ray,
        time: f32,
    ) -> Q::Answer {
        let (span, share) = locate(time, self.spans.len());
        self.spans[span].one_at::<Q>(ray, share)
    }

    fn batch<Q: BlockQuery<Item: Stored, Answer: Copy + Send>>(
        &self,
        rays: &[Ray],
        times: &[f32],
        answers: &mut [Q::Answer],
    ) {
        assert_eq!(rays.len(), times.len(), "one time per ray");
        assert_eq!(rays.len(), answers.len(), "one answer per ray");
        let piece = |(index, answers): (usize, &mut [Q::Answer])| {
            let range = index * CHUNK..index * CHUNK + answers.len();
            self.piece::<Q>(&rays[range.clone()], &times[range], answers);
        };
        let pieces = answers.chunks_mut(CHUNK).enumerate();
        if threads() == 1 || rays.len() <= CHUNK {
            pieces.for_each(piece);
        } else {
            for_each(pieces.collect(), piece);
        }
    }

    /// Answers rays on this thread, span by span.
    fn piece<Q: BlockQuery<Item: Stored, Answer: Copy>>(
        &self,
        rays: &[Ray],
        times: &[f32],
        answers: &mut [Q::Answer],
    ) {
        let spans = self.spans.len();
        if let [bvh] = &self.spans[..] {
            let shares: Vec<f32> = times.iter().map(|time| locate(*time, 1).1).collect();
            return bvh.at_shares::<Q>(rays, &shares, answers);
        }
        let mut own = (Vec::new(), Vec::new(), Vec::new());
        for (span, bvh) in self.spans.iter().enumerate() {
            let (places, own_rays, shares) = &mut own;
            places.clear();
            own_rays.clear();
            shares.clear();
            for (place, time) in times.iter().enumerate() {
                let (found, share) = locate(*time, spans);
                if found == span {
                    places.push(place);
                    own_rays.push(rays[place]);
                    shares.push(share);
                }
            }
            let mut found = vec![Q::Answer::default(); places.len()];
            bvh.at_shares::<Q>(own_rays, shares, &mut found);
            for (place, answer) in places.iter().zip(found) {
                answers[*place] = answer;
            }
        }
    }
}

impl fmt::Debug for MovingBvh {
    /// Counts, not contents.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("MovingBvh")
            .field("spans", &self.spans)
            .finish()
    }
}

impl Bvh {
    #[inline(always)]
    fn one_at<Q: BlockQuery<Item: Stored + antumbra_simd::scratch::Bits>>(
        &self,
        ray: &Ray,
        share: f32,
    ) -> Q::Answer {
        let mut answer = [Q::miss()];
        let shares = [share];
        let batch = &RayBatch::new(core::slice::from_ref(ray), 0).at(&shares);
        self.with_stack(|stack: &mut [Q::Item]| {
            let answers = &mut answer[..];
            on_tree!(&self.tree, bvh => {
                self.isa().dispatch(SingleMoving::<Q, _> { bvh, stack, batch, answers });
            });
        });
        let [answer] = answer;
        answer
    }

    fn at_shares<Q: BlockQuery<Item: Stored>>(
        &self,
        rays: &[Ray],
        shares: &[f32],
        answers: &mut [Q::Answer],
    ) {
        self.pool.with(|memory: &mut Memory| {
            let batch = &RayBatch::new(rays, 0).at(shares);
            if self.is_worth_a_stream(rays.len()) {
                let mut pending = core::mem::take(&mut memory.pending);
                pending.clear();
                pending.extend(0..rays.len() as u32);
                self.stream_of::<Moving<Q>, false>(memory, batch, &pending, answers);
                memory.pending = pending;
            } else {
                let stack =
                    Stored::at_least(memory, stack_size(self.width().lanes(), self.depth()));
                on_tree!(&self.tree, bvh => {
                    self.isa().dispatch(SingleMoving::<Q, _> { bvh, stack, batch, answers });
                });
            }
        });
    }
}

/// Meshes and instances of a scene that move, prepared for trees: see [`MovingBvh::from_trees`].
///
/// Keeps copies of the keys, and none of what does not move.
///
/// ```
/// use antumbra::{Motion, MovingInstance, MovingScene, Geometry, Sphere};
///
/// let ball = vec![Geometry::spheres(vec![Sphere { center: [0.0; 3], radius: 1.0 }])];
/// let place = |x| [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
/// let instance = MovingInstance::new(0, vec![place(0.0), place(8.0)]);
/// let motion = Motion::new(&MovingScene::new(vec![], vec![ball], vec![instance])?)?;
/// assert!(motion.bounds().max[0] >= 9.0);
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone)]
pub struct Motion {
    spans: Vec<SpanKeys>,
}

/// Meshes and instances that move, at both keys of a span.
#[derive(Clone)]
struct SpanKeys {
    /// By `geom_id`; `None` for geometry that does not move.
    meshes: Vec<Option<MeshSpan>>,
    /// By `inst_id`. `None` for an instance that does not move, or whose object is empty.
    placements: Vec<Option<MovingPlacement>>,
}

/// A mesh at both keys of a span.
#[derive(Clone)]
struct MeshSpan {
    positions: [Arc<[[f32; 3]]>; 2],
    indices: Arc<[[u32; 3]]>,
}

impl Motion {
    /// Prepares the meshes and instances of a scene that move.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for an instance whose path leaves the range of `f32`; as [`Primitives::new`] for objects
    /// that move.
    pub fn new(scene: &MovingScene<'_>) -> Result<Self, Error> {
        let mut shapes: Vec<Option<ObjectShape>> = vec![None; scene.objects.len()];
        for instance in &scene.instances {
            let object = instance.object as usize;
            if instance.keys.len() > 1 && shapes[object].is_none() {
                let mut shape = ObjectShape::new(&Primitives::new(&scene.objects[object])?);
                shape.expect_many();
                shapes[object] = Some(shape);
            }
        }
        let meshes: Vec<_> = scene.world.iter().map(of_mesh).collect();
        let spans = (0..scene.spans()).map(|span| {
            let of_instance = |(instance, inst_id): (&MovingInstance, u32)| {
                let shape = shapes[instance.object as usize].as_ref();
                let path = instance.path(inst_id, span)?;
                match (path, shape.filter(|shape| !shape.is_empty())) {
                    (Some(path), Some(shape)) => MovingPlacement::new(path, shape, inst_id)
                        .map(Some)
                        .ok_or(Error::OutOfRange { inst_id }),
                    _ => Ok(None),
                }
            };
            let placements = scene.instances.iter().zip(0u32..).map(of_instance);
            Ok(SpanKeys {
                meshes: (meshes.iter())
                    .map(|mesh| mesh.as_ref().map(|mesh| mesh.span(span)))
                    .collect(),
                placements: placements.collect::<Result<_, Error>>()?,
            })
        });
        Ok(Self {
            spans: spans.collect::<Result<_, Error>>()?,
        })
    }

    /// The smallest box around the meshes and instances that move, at all times; boxes of instances are a little larger than
    /// needed. Empty if nothing moves.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        let mut all = Aabb::EMPTY;
        for span in &self.spans {
            for mesh in span.meshes.iter().flatten() {
                for key in &mesh.positions {
                    all = all.union(&Aabb::around(key));
                }
            }
            for placement in span.placements.iter().flatten() {
                for bounds in placement.bounds() {
                    all = all.union(&bounds);
                }
            }
        }
        all
    }
}

impl fmt::Debug for Motion {
    /// Counts, not contents.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        (f.debug_struct("Motion").field("spans", &self.spans.len())).finish_non_exhaustive()
    }
}

/// All keys of a mesh that moves.
struct MeshKeys {
    keys: Vec<Arc<[[f32; 3]]>>,
    indices: Arc<[[u32; 3]]>,
}

fn of_mesh(geometry: &MovingGeometry<'_>) -> Option<MeshKeys> {
    match geometry {
        MovingGeometry::Mesh(mesh) if mesh.keys.len() > 1 => Some(MeshKeys {
            keys: mesh.keys.iter().map(|key| Arc::from(&key[..])).collect(),
            indices: Arc::from(&mesh.indices[..]),
        }),
        _ => None,
    }
}

impl MeshKeys {
    fn span(&self, span: usize) -> MeshSpan {
        MeshSpan {
            positions: [span, span + 1].map(|key| Arc::clone(&self.keys[key])),
            indices: Arc::clone(&self.indices),
        }
    }
}

impl Keys for SpanKeys {
    fn corners(&self, id: PrimRef) -> Option<[[[f32; 3]; 3]; 2]> {
        let mesh = self.meshes.get(id.geom_id as usize)?.as_ref()?;
        let indices = mesh.indices.get(id.prim_id as usize)?;
        let corners = |key: usize| indices.map(|index| mesh.positions[key][index as usize]);
        Some([corners(0), corners(1)])
    }

    fn placement(&self, inst_id: u32) -> Option<&MovingPlacement> {
        self.placements.get(inst_id as usize)?.as_ref()
    }
}
