//! Geometry that moves while rays are traced: meshes with keys of vertices, instances with keys of transforms.

use alloc::borrow::Cow;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use crate::aabb::Aabb;
use crate::error::Error;
use crate::geometry::instance::{Instance, ObjectShape};
use crate::geometry::path::{MovingPlacement, Path, Unfit};
use crate::geometry::primitives::Primitives;
use crate::geometry::{Geometry, PrimRef, TriangleMesh};

/// Coordinates of keys are below this: `2¹²⁵`, so that differences of two are far from overflow.
const LARGEST: f32 = (1u128 << 125) as f32;

/// Place of a time among keys: the span between two of them, and the share of that span, from 0 to 1.
///
/// Times before 0 and NaN count as 0, times after 1 as 1.
pub(crate) fn locate(time: f32, spans: usize) -> (usize, f32) {
    // NaN is not above 0.
    let time = if time > 0.0 { time.min(1.0) } else { 0.0 };
    let place = time * spans as f32;
    let span = (place as usize).min(spans - 1);
    (span, place - span as f32)
}

impl<'a> Geometry<'a> {
    /// A mesh of triangles whose vertices move while rays are traced: one list of positions for each key, from owned or
    /// borrowed buffers.
    ///
    /// The first key is time 0, the last one time 1, and the others lie evenly between. Everything in a scene that moves has
    /// as many keys. Between two keys, at a share `s` from 0 to 1, a coordinate is `a + s * (b - a)` in `f32`, rounded after
    /// every operation. A mesh with one key does not move.
    ///
    /// A triangle is missed at a time when two of its corners coincide. It is dropped if they do so at all times. Meshes
    /// inside of objects do not move; [instances](Instance::moving) of objects do.
    ///
    /// ```
    /// use antumbra::{Bvh, Geometry, Ray, Recipe};
    ///
    /// let at = |x: f32| vec![[x, 0.0, 1.0], [x + 1.0, 0.0, 1.0], [x, 1.0, 1.0]];
    /// let mesh = Geometry::moving([at(0.0), at(4.0)], vec![[0, 1, 2]]);
    /// let bvh = Bvh::build(&[mesh], &Recipe::default())?;
    /// let ray = Ray::new([2.2, 0.2, 0.0], [0.0, 0.0, 1.0]);
    /// assert!(bvh.query(&ray).at(0.5).occluded() && !bvh.occluded(&ray));
    /// # Ok::<(), antumbra::Error>(())
    /// ```
    pub fn moving(
        keys: impl IntoIterator<Item = impl Into<Cow<'a, [[f32; 3]]>>>,
        indices: impl Into<Cow<'a, [[u32; 3]]>>,
    ) -> Self {
        let mut keys = keys.into_iter().map(Into::into);
        let first = keys.next().unwrap_or_default();
        Self::Triangles(TriangleMesh {
            moves_to: keys.collect(),
            ..TriangleMesh::new(first, indices)
        })
    }

    /// Fails if the geometry moves where nothing may.
    pub(crate) fn stands_still(&self, why: &'static str) -> Result<(), Error> {
        let moves = matches!(self, Self::Triangles(mesh) if !mesh.moves_to.is_empty());
        Error::if_moves(moves, why)
    }
}

impl TriangleMesh<'_> {
    /// Positions at the start and the end of each span.
    fn spans(&self) -> impl Iterator<Item = [&[[f32; 3]]; 2]> {
        let ends = self.moves_to.iter().map(|key| &key[..]);
        let starts = core::iter::once(&self.positions[..]).chain(ends.clone());
        starts.zip(ends).map(|(start, end)| [start, end])
    }

    /// Whether a triangle has three different corners at some time.
    pub(crate) fn is_ever_sound(&self, prim_id: u32) -> bool {
        let corners = self.indices[prim_id as usize];
        let corners_at = |key: &[[f32; 3]]| corners.map(|index| key[index as usize]);
        (self.spans()).any(|keys| !is_always_unsound(&keys.map(corners_at)))
    }

    fn check_keys(&self, geom_id: u32, keys: usize) -> Result<(), Error> {
        if self.opacity.is_some() {
            return Err(Error::Moves("a mesh with a filter cannot move"));
        }
        check_count(("mesh", geom_id), 1 + self.moves_to.len(), keys)?;
        let vertices = self.positions.len();
        let all = core::iter::once(&self.positions).chain(&self.moves_to);
        for (positions, key) in all.zip(0u32..) {
            if positions.len() != vertices {
                return Err(Error::OtherVertices {
                    geom_id,
                    key,
                    expected: vertices,
                    found: positions.len(),
                });
            }
            let is_bad = |position: &[f32; 3]| !position.iter().all(|x| x.abs() < LARGEST);
            if let Some(vertex) = positions.iter().position(is_bad) {
                return Err(Error::KeyPosition {
                    geom_id,
                    key,
                    vertex,
                    position: positions[vertex],
                });
            }
        }
        Ok(())
    }
}

/// Whether two corners coincide at both keys of a span, and so all the time between.
pub(crate) fn is_always_unsound([start, end]: &[[[f32; 3]; 3]; 2]) -> bool {
    let pairs = [(0, 1), (1, 2), (2, 0)];
    (pairs.iter()).any(|&(i, j)| start[i] == start[j] && end[i] == end[j])
}

impl Instance {
    /// An instance whose transform moves while rays are traced: one transform for each key, and the identity without any.
    ///
    /// The keys lie evenly from time 0 to time 1. Between two keys the translation moves in a straight line. The rest is
    /// divided into a rotation and a stretch (polar decomposition). The rotation turns about one axis at one speed, the
    /// shorter way, and the stretch changes linearly. The transform of a time is rounded to `f32`. An instance with one key
    /// does not move. All keys mirror, or none does.
    ///
    /// ```
    /// use antumbra::Instance;
    ///
    /// let place = |x| [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    /// let instance = Instance::moving(0, [place(1.0), place(3.0)]);
    /// assert_eq!(instance.transform_at(0.5)?, place(2.0));
    /// # Ok::<(), antumbra::Error>(())
    /// ```
    #[must_use]
    pub fn moving(object: u32, keys: impl IntoIterator<Item = [[f32; 4]; 3]>) -> Self {
        const IDENTITY: [[f32; 4]; 3] = [
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
        ];
        let mut keys = keys.into_iter();
        Self {
            object,
            transform: keys.next().unwrap_or(IDENTITY),
            moves_to: keys.collect(),
        }
    }

    /// Transform at a time, clamped to 0 to 1.
    ///
    /// # Errors
    /// [`Error::KeyTransform`] if a key beside that time has a number that is not finite or no inverse, and
    /// [`Error::KeysMirror`] if one mirrors and the other does not, both with 0 as the instance.
    pub fn transform_at(&self, time: f32) -> Result<[[f32; 4]; 3], Error> {
        let (span, share) = locate(time, self.moves_to.len().max(1));
        let path = self.path(0, span)?;
        Ok(path.map_or(self.key(span), |path| path.transform(share)))
    }

    /// Fails if the instance moves where nothing may.
    pub(crate) fn stands_still(&self, why: &'static str) -> Result<(), Error> {
        Error::if_moves(!self.moves_to.is_empty(), why)
    }

    /// The transform at the start of a span.
    fn key(&self, span: usize) -> [[f32; 4]; 3] {
        let later = span.checked_sub(1).and_then(|key| self.moves_to.get(key));
        *later.unwrap_or(&self.transform)
    }

    /// The path of the instance in a span; `None` if it does not move there.
    fn path(&self, inst_id: u32, span: usize) -> Result<Option<Path>, Error> {
        let (start, end) = (self.key(span), self.key(span + 1));
        if self.moves_to.is_empty() || start == end {
            return Ok(None);
        }
        match Path::new([&start, &end]) {
            Ok(path) => Ok(Some(path)),
            Err(Unfit::Key(key)) => Err(Error::KeyTransform {
                inst_id,
                key: (span + key) as u32,
            }),
            Err(Unfit::Mirrors) => Err(Error::KeysMirror {
                inst_id,
                key: span as u32,
            }),
        }
    }
}

/// Fails unless something that moves has as many keys as everything else that does.
fn check_count(
    (what, id): (&'static str, u32),
    found: usize,
    expected: usize,
) -> Result<(), Error> {
    if found == 1 || found == expected {
        return Ok(());
    }
    Err(Error::OtherKeys {
        what,
        id,
        expected,
        found,
    })
}

/// What moves in a list of primitives: meshes and instances, span by span.
#[derive(Debug)]
pub(crate) struct Motion {
    spans: Vec<SpanKeys>,
    /// All instances as they were given.
    instances: Vec<Instance>,
}

/// Meshes and instances that move, at both keys of a span.
#[derive(Debug)]
pub(crate) struct SpanKeys {
    /// By `geom_id`; `None` for geometry that does not move.
    meshes: Vec<Option<MeshSpan>>,
    /// By `inst_id`. `None` for an instance that does not move in this span, or whose object is empty.
    placements: Vec<Option<MovingPlacement>>,
}

/// A mesh at both keys of a span.
#[derive(Debug)]
struct MeshSpan {
    positions: [Arc<[[f32; 3]]>; 2],
    indices: Arc<[[u32; 3]]>,
}

/// Checks the keys of a scene. Returns the number of spans between two keys, or 0 if nothing moves.
///
/// # Errors
/// The first key that is of no use.
pub(crate) fn check_keys(world: &[Geometry<'_>], instances: &[Instance]) -> Result<usize, Error> {
    let meshes = || {
        world.iter().zip(0u32..).filter_map(|one| match one {
            (Geometry::Triangles(mesh), geom_id) if !mesh.moves_to.is_empty() => {
                Some((mesh, geom_id))
            }
            _ => None,
        })
    };
    let of_meshes = meshes().map(|(mesh, _)| mesh.moves_to.len());
    let of_instances = instances.iter().map(|instance| instance.moves_to.len());
    let spans = of_meshes.chain(of_instances).find(|spans| *spans > 0);
    let spans = spans.unwrap_or(0);
    for (mesh, geom_id) in meshes() {
        mesh.check_keys(geom_id, spans + 1)?;
    }
    for (instance, inst_id) in instances.iter().zip(0u32..) {
        check_count(
            ("instance", inst_id),
            1 + instance.moves_to.len(),
            spans + 1,
        )?;
        for span in 0..instance.moves_to.len() {
            instance.path(inst_id, span)?;
        }
    }
    Ok(spans)
}

impl Motion {
    /// The motion of a scene whose keys were [checked](check_keys), given the primitives of its objects.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for an instance whose path leaves the range of `f32`.
    pub fn new(
        spans: usize,
        world: &[Geometry<'_>],
        objects: &[Primitives],
        instances: &[Instance],
    ) -> Result<Self, Error> {
        let mut shapes: Vec<Option<ObjectShape>> = vec![None; objects.len()];
        for instance in instances.iter().filter(|one| !one.moves_to.is_empty()) {
            let object = instance.object as usize;
            shapes[object].get_or_insert_with(|| {
                let mut shape = ObjectShape::new(&objects[object]);
                shape.expect_many();
                shape
            });
        }
        let meshes: Vec<_> = world.iter().map(keys_of).collect();
        let spans = (0..spans).map(|span| {
            let of_instance = |(instance, inst_id): (&Instance, u32)| {
                let shape = shapes[instance.object as usize].as_ref();
                let path = instance.path(inst_id, span)?;
                match (path, shape.filter(|shape| !shape.is_empty())) {
                    (Some(path), Some(shape)) => MovingPlacement::new(path, shape, inst_id)
                        .map(Some)
                        .ok_or(Error::OutOfRange { inst_id }),
                    _ => Ok(None),
                }
            };
            let placements = instances.iter().zip(0u32..).map(of_instance);
            let of_mesh = |(keys, indices): &MeshKeys| MeshSpan {
                positions: [span, span + 1].map(|key| Arc::clone(&keys[key])),
                indices: Arc::clone(indices),
            };
            Ok(SpanKeys {
                meshes: meshes
                    .iter()
                    .map(|mesh| mesh.as_ref().map(of_mesh))
                    .collect(),
                placements: placements.collect::<Result<_, Error>>()?,
            })
        });
        Ok(Self {
            spans: spans.collect::<Result<_, Error>>()?,
            instances: instances.to_vec(),
        })
    }

    pub fn spans(&self) -> &[SpanKeys] {
        &self.spans
    }

    /// Transform of an instance at a share of a span; `None` for one that never moves.
    pub fn transform(&self, inst_id: u32, span: usize, share: f32) -> Option<[[f32; 4]; 3]> {
        let instance = &self.instances[inst_id as usize];
        let path = self.spans[span].placement(inst_id);
        let is_moving = !instance.moves_to.is_empty();
        is_moving.then(|| path.map_or_else(|| instance.key(span), |path| path.transform(share)))
    }

    /// The smallest box around the meshes and instances that move, at all times; boxes of instances are a little larger than
    /// needed.
    pub fn bounds(&self) -> Aabb {
        let mut all = Aabb::EMPTY;
        for span in &self.spans {
            let meshes = span.meshes.iter().flatten();
            let keys = meshes.flat_map(|mesh| &mesh.positions);
            let placements = span.placements.iter().flatten();
            let boxes = placements.flat_map(MovingPlacement::bounds);
            for bounds in keys.map(|key| Aabb::around(key)).chain(boxes) {
                all = all.union(&bounds);
            }
        }
        all
    }
}

/// All keys of a mesh that moves, and its indices.
type MeshKeys = (Vec<Arc<[[f32; 3]]>>, Arc<[[u32; 3]]>);

fn keys_of(geometry: &Geometry<'_>) -> Option<MeshKeys> {
    match geometry {
        Geometry::Triangles(mesh) if !mesh.moves_to.is_empty() => {
            let keys = core::iter::once(&mesh.positions).chain(&mesh.moves_to);
            let keys = keys.map(|key| Arc::from(&key[..])).collect();
            Some((keys, Arc::from(&mesh.indices[..])))
        }
        _ => None,
    }
}

impl SpanKeys {
    /// Corners of a triangle that moves, at both keys.
    pub fn corners(&self, id: PrimRef) -> Option<[[[f32; 3]; 3]; 2]> {
        let mesh = self.meshes.get(id.geom_id as usize)?.as_ref()?;
        let indices = mesh.indices.get(id.prim_id as usize)?;
        let corners = |key: usize| indices.map(|index| mesh.positions[key][index as usize]);
        Some([corners(0), corners(1)])
    }

    /// The path of an instance that moves.
    pub fn placement(&self, inst_id: u32) -> Option<&MovingPlacement> {
        self.placements.get(inst_id as usize)?.as_ref()
    }
}
