//! Geometry that moves while rays are traced: meshes with keys of vertices, instances with keys of transforms.

use alloc::borrow::Cow;
use alloc::vec;
use alloc::vec::Vec;

use crate::error::Error;
use crate::geometry::Geometry;
use crate::geometry::instance::Instance;
use crate::geometry::path::{Path, Unfit, between};
use crate::geometry::primitives::Primitives;

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

/// Triangles whose vertices move: one list of positions for each key.
///
/// The first key is time 0, the last one time 1, and the others lie evenly between. Between two keys, at a share `s` from 0 to 1,
/// a coordinate is `a + s * (b - a)` in `f32`, rounded after every operation. A mesh with one key does not move.
///
/// A triangle is missed at a time when two of its corners coincide. It is dropped if they do so at all times.
///
/// ```
/// use antumbra::MovingMesh;
///
/// let (here, there) = (vec![[0.0; 3]; 3], vec![[2.0, 0.0, 0.0]; 3]);
/// let mesh = MovingMesh::new(vec![here.into(), there.into()], vec![[0, 1, 2]]);
/// assert_eq!(mesh.positions_at(0.25)[0], [0.5, 0.0, 0.0]);
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct MovingMesh<'a> {
    /// Vertex positions of every key, each `[n, 3]`, finite and below 2¹²⁵ by magnitude.
    pub keys: Vec<Cow<'a, [[f32; 3]]>>,
    /// Three indices into the positions per triangle, `[m, 3]`. The place in this list is the `prim_id`.
    pub indices: Cow<'a, [[u32; 3]]>,
}

impl<'a> MovingMesh<'a> {
    /// A mesh from owned or borrowed buffers. Keys and indices are checked when a tree is built.
    #[must_use]
    pub fn new(keys: Vec<Cow<'a, [[f32; 3]]>>, indices: impl Into<Cow<'a, [[u32; 3]]>>) -> Self {
        Self {
            keys,
            indices: indices.into(),
        }
    }

    /// Positions at a time, clamped to 0 to 1. Empty without keys.
    ///
    /// # Panics
    /// If a later key has fewer positions.
    #[must_use]
    pub fn positions_at(&self, time: f32) -> Vec<[f32; 3]> {
        let spans = self.keys.len().saturating_sub(1).max(1);
        let (span, share) = locate(time, spans);
        let Some(start) = self.keys.get(span) else {
            return Vec::new();
        };
        let end = self.keys.get(span + 1).unwrap_or(start);
        (start.iter().enumerate())
            .map(|(vertex, at)| between(at, &end[vertex], share))
            .collect()
    }

    /// Positions at the start and the end of a span. A mesh with one key has them in every span.
    pub(crate) fn span(&self, span: usize) -> [&[[f32; 3]]; 2] {
        match &self.keys[..] {
            [one] => [one, one],
            keys => [&keys[span], &keys[span + 1]],
        }
    }

    fn check(&self, geom_id: u32, keys: usize) -> Result<(), Error> {
        let one = ("mesh", geom_id);
        check_count(one, self.keys.len(), keys)?;
        let vertices = self.keys[0].len();
        for (positions, key) in self.keys.iter().zip(0u32..) {
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
        for (indices, prim_id) in self.indices.iter().zip(0u32..) {
            if let Some(&index) = indices.iter().find(|index| **index as usize >= vertices) {
                return Err(Error::IndexOutOfRange {
                    geom_id,
                    prim_id,
                    index,
                    vertices,
                });
            }
        }
        Ok(())
    }

    /// The middle of a span, for a build. Triangles that only there have equal corners are replaced by tiny ones, as a build
    /// drops those.
    fn middle(&self, span: usize) -> Geometry<'static> {
        let [start, end] = self.span(span);
        let mut positions: Vec<[f32; 3]> = (start.iter().zip(end))
            .map(|(a, b)| between(a, b, 0.5))
            .collect();
        let mut indices = self.indices.to_vec();
        for triangle in &mut indices {
            let corners = triangle.map(|index| index as usize);
            let coincide = |p: &[[f32; 3]], i: usize, j: usize| p[corners[i]] == p[corners[j]];
            let pairs = [(0, 1), (1, 2), (2, 0)];
            let meets = pairs.iter().any(|&(i, j)| coincide(&positions, i, j));
            let always = (pairs.iter()).any(|&(i, j)| coincide(start, i, j) && coincide(end, i, j));
            if meets && !always {
                let [x, y, z] = positions[corners[0]];
                let first = positions.len() as u32;
                positions.extend([[x, y, z], [x.next_up(), y, z], [x, y.next_up(), z]]);
                *triangle = [first, first + 1, first + 2];
            }
        }
        Geometry::triangles(positions, indices)
    }
}

/// An instance whose transform moves: one transform for each key.
///
/// The keys lie evenly from time 0 to time 1. Between two keys the translation moves in a straight line. The rest is
/// divided into a rotation and a stretch (polar decomposition). The rotation turns about one axis at one speed, the
/// shorter way, and the stretch changes linearly. The transform of a time is rounded to `f32`. An instance with one key
/// does not move.
///
/// ```
/// use antumbra::MovingInstance;
///
/// let place = |x| [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
/// let instance = MovingInstance::new(0, vec![place(1.0), place(3.0)]);
/// assert_eq!(instance.transform_at(0.5)?, place(2.0));
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct MovingInstance {
    /// Index of the object in the list of objects.
    pub object: u32,
    /// From the object to the world, as [`Instance::transform`]. All of them mirror, or none does.
    pub keys: Vec<[[f32; 4]; 3]>,
}

impl MovingInstance {
    /// Places an object, named by its index in the list of objects. Keys are checked when a tree is built.
    #[must_use]
    pub const fn new(object: u32, keys: Vec<[[f32; 4]; 3]>) -> Self {
        Self { object, keys }
    }

    /// Transform at a time, clamped to 0 to 1.
    ///
    /// # Errors
    /// [`Error::KeyTransform`] if a key beside that time has a number that is not finite or no inverse, and [`Error::KeysMirror`] if one
    /// mirrors and the other does not, both with 0 as the instance; [`Error::OtherKeys`] without keys.
    pub fn transform_at(&self, time: f32) -> Result<[[f32; 4]; 3], Error> {
        let keys = self.keys.len();
        check_count(("instance", 0), keys, keys.max(2))?;
        let (span, share) = locate(time, (keys - 1).max(1));
        Ok(self.placed(0, span, share)?.transform)
    }

    /// The path of the instance in a span; `None` if it does not move there.
    pub(crate) fn path(&self, inst_id: u32, span: usize) -> Result<Option<Path>, Error> {
        let [start, end] = match &self.keys[..] {
            [_] => return Ok(None),
            keys => [&keys[span], &keys[span + 1]],
        };
        if start == end {
            return Ok(None);
        }
        match Path::new([start, end]) {
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

    /// The instance at a share of a span.
    fn placed(&self, inst_id: u32, span: usize, share: f32) -> Result<Instance, Error> {
        let transform = match self.path(inst_id, span)? {
            Some(path) => path.transform(share),
            None => self.keys[span.min(self.keys.len() - 1)],
        };
        Ok(Instance::new(self.object, transform))
    }
}

/// One geometry of a scene that moves; its place in the list is the `geom_id`.
///
/// ```
/// use antumbra::{Geometry, MovingGeometry, Sphere};
///
/// let ball = Geometry::spheres(vec![Sphere { center: [0.0; 3], radius: 1.0 }]);
/// assert!(matches!(MovingGeometry::from(ball), MovingGeometry::Still(_)));
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum MovingGeometry<'a> {
    /// Geometry of any kind that does not move.
    Still(Geometry<'a>),
    /// Triangles whose vertices move.
    Mesh(MovingMesh<'a>),
}

impl<'a> From<Geometry<'a>> for MovingGeometry<'a> {
    fn from(geometry: Geometry<'a>) -> Self {
        Self::Still(geometry)
    }
}

impl<'a> From<MovingMesh<'a>> for MovingGeometry<'a> {
    fn from(mesh: MovingMesh<'a>) -> Self {
        Self::Mesh(mesh)
    }
}

/// A scene whose meshes and instances move from time 0 to time 1: see [`MovingBvh`](crate::MovingBvh).
///
/// Objects do not change inside: instances of them move.
///
/// ```
/// use antumbra::{MovingMesh, MovingScene};
///
/// let at = |x: f32| vec![[x, 0.0, 1.0], [x + 1.0, 0.0, 1.0], [x, 1.0, 1.0]];
/// let mesh = MovingMesh::new(vec![at(0.0).into(), at(4.0).into()], vec![[0, 1, 2]]);
/// let scene = MovingScene::new(vec![mesh.into()], vec![], vec![])?;
/// assert_eq!((scene.spans(), scene.at(0.5)?.bounds().min[0]), (1, 2.0));
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct MovingScene<'a> {
    pub(crate) world: Vec<MovingGeometry<'a>>,
    pub(crate) objects: Vec<Vec<Geometry<'a>>>,
    pub(crate) instances: Vec<MovingInstance>,
    /// Spans between two keys, at least one.
    pub(crate) spans: usize,
}

impl<'a> MovingScene<'a> {
    /// A scene of geometries in the world itself, of objects, and of instances that place objects. All that moves has the same
    /// number of keys.
    ///
    /// # Errors
    /// The first key that is of no use: [`Error::OtherKeys`], [`Error::OtherVertices`], [`Error::KeyPosition`],
    /// [`Error::KeyTransform`], [`Error::KeysMirror`]; an index of a vertex or an object out of range.
    pub fn new(
        world: Vec<MovingGeometry<'a>>,
        objects: Vec<Vec<Geometry<'a>>>,
        instances: Vec<MovingInstance>,
    ) -> Result<Self, Error> {
        let of_meshes = world.iter().filter_map(|geometry| match geometry {
            MovingGeometry::Mesh(mesh) => Some(mesh.keys.len()),
            MovingGeometry::Still(_) => None,
        });
        let of_instances = instances.iter().map(|instance| instance.keys.len());
        let keys = of_meshes.chain(of_instances).find(|keys| *keys > 1);
        let spans = keys.map_or(1, |keys| keys - 1);
        for (geometry, geom_id) in world.iter().zip(0u32..) {
            if let MovingGeometry::Mesh(mesh) = geometry {
                mesh.check(geom_id, spans + 1)?;
            }
        }
        for (instance, inst_id) in instances.iter().zip(0u32..) {
            check_count(("instance", inst_id), instance.keys.len(), spans + 1)?;
            if instance.object as usize >= objects.len() {
                return Err(Error::ObjectOutOfRange {
                    inst_id,
                    object: instance.object,
                    objects: objects.len(),
                });
            }
            for span in 0..spans {
                instance.path(inst_id, span)?;
            }
        }
        Ok(Self {
            world,
            objects,
            instances,
            spans,
        })
    }

    /// Spans between two keys: one less than there are keys, and 1 if nothing moves.
    #[must_use]
    pub fn spans(&self) -> usize {
        self.spans
    }

    /// Primitives in the middle of a span, over which the tree of the span is built.
    ///
    /// # Errors
    /// As [`Primitives::with_instances`].
    ///
    /// # Panics
    /// If there is no such span.
    pub fn middle(&self, span: usize) -> Result<Primitives, Error> {
        assert!(span < self.spans, "{} spans", self.spans);
        self.primitives(span, 0.5, |mesh| mesh.middle(span))
    }

    /// Primitives at a time, clamped to 0 to 1: what a moving tree is traced over at that time.
    ///
    /// # Errors
    /// As [`Primitives::with_instances`].
    pub fn at(&self, time: f32) -> Result<Primitives, Error> {
        let (span, share) = locate(time, self.spans);
        self.primitives(span, share, |mesh| {
            Geometry::triangles(mesh.positions_at(time), mesh.indices.to_vec())
        })
    }

    fn primitives(
        &self,
        span: usize,
        share: f32,
        of_mesh: impl Fn(&MovingMesh<'a>) -> Geometry<'static>,
    ) -> Result<Primitives, Error> {
        let world: Vec<Geometry<'_>> = (self.world.iter())
            .map(|geometry| match geometry {
                MovingGeometry::Still(geometry) => geometry.clone(),
                MovingGeometry::Mesh(mesh) => of_mesh(mesh),
            })
            .collect();
        let mut instances = vec![];
        for (instance, inst_id) in self.instances.iter().zip(0u32..) {
            instances.push(instance.placed(inst_id, span, share)?);
        }
        Primitives::with_instances(&world, &self.objects, &instances)
    }
}

/// Fails unless something has one key, or as many as everything else that moves.
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
