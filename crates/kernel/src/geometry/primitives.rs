//! The primitives of a scene, checked once and shared by every builder and by the brute-force oracle.

use core::sync::atomic::{AtomicBool, Ordering};
use std::sync::Arc;

use crate::aabb::Aabb;
use crate::error::Error;
use crate::geometry::cutout::micromap::{Cutout, Known, MicroMaps};
use crate::geometry::cutout::opacity::accepts;
use crate::geometry::cutout::{Filters, Representative};
use crate::geometry::instance::{Instance, ObjectShape, PlacedObject, Placement};
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::triangle::TriangleBlock;
use crate::geometry::{Geometry, Opacity, PrimRef, QueryKind, Sphere, TriangleMesh, triangle};
use crate::parallel::{chunk_len, for_each, map};
use crate::ray::{Hit, INVALID_ID};

/// Checked copies of all primitives that can be hit.
///
/// Dropped and counted are: triangles with a NaN or infinite coordinate, triangles of which two corners
/// coincide, spheres without a positive finite radius and a finite centre. A triangle whose three
/// different corners lie on one line is kept: seen by a ray, rounding makes it a sliver, and a closed
/// mesh may need that sliver to have no gap. Of instances: those whose transform is of no use (see
/// [`Instance`]) and those of objects without primitives.
///
/// Triangles that their [`Opacity`] calls opaque are kept as those of a mesh that has none; those that it
/// calls clear are left out and counted as well.
#[derive(Clone, Debug, Default)]
pub struct Primitives {
    /// The opaque ones first.
    pub(crate) triangles: Vec<[[f32; 3]; 3]>,
    /// As many as `triangles`.
    pub(crate) triangle_refs: Vec<PrimRef>,
    /// Which filter the partly transparent ones have, the last of `triangles`. Until those are known all triangles have
    /// one here, or [`NO_FILTER`], unless there is no filter at all.
    cutout_filters: Vec<u32>,
    /// As many as `cutout_filters`.
    cutouts: Vec<Cutout>,
    /// The same for the world and its objects.
    pub(crate) filters: Arc<Filters>,
    pub(crate) spheres: Vec<Sphere>,
    pub(crate) sphere_refs: Vec<PrimRef>,
    dropped: usize,
    /// Each with primitives and nothing else; empty where no instance needs one.
    pub(crate) objects: Vec<Primitives>,
    pub(crate) instances: Vec<PlacedObject>,
    transparent: usize,
}

/// What leaves hold one of. Primitives are numbered kind after kind, in this order, and instances after them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PrimKind {
    Triangle,
    /// A partly transparent triangle.
    Cutout,
    Sphere,
}

/// Leaf references have this many values per primitive kind.
const MAX_PRIMITIVES: usize = 1 << 29;

/// The same for instances; two of the values have another meaning.
const MAX_INSTANCES: usize = (1 << 29) - 2;

/// What a triangle has that is opaque.
const NO_FILTER: u32 = u32::MAX;

impl Primitives {
    /// Checks and copies the primitives of `geometries`.
    ///
    /// # Errors
    /// A vertex index out of range; more than 2²⁹ primitives or 2³² - 1 geometries.
    pub fn new(geometries: &[Geometry<'_>]) -> Result<Self, Error> {
        let mut opacities = Vec::new();
        let mut primitives = Self::copied(geometries, &mut opacities)?;
        primitives.separate_cutouts(opacities);
        Ok(primitives)
    }

    /// Without a look at what is partly transparent. Filters are added to `opacities`.
    fn copied(
        geometries: &[Geometry<'_>],
        opacities: &mut Vec<Arc<dyn Opacity>>,
    ) -> Result<Self, Error> {
        limit("geometries", geometries.len(), u32::MAX as usize)?;
        let count = geometries
            .iter()
            .map(|geometry| match geometry {
                Geometry::Triangles(mesh) => mesh.indices.len(),
                Geometry::Spheres(spheres) => spheres.len(),
            })
            .sum();
        limit("primitives", count, MAX_PRIMITIVES)?;

        let mut primitives = Self::default();
        primitives.copy_triangles(geometries)?;
        primitives.note_filters(geometries, opacities);
        for (geometry, geom_id) in geometries.iter().zip(0u32..) {
            let Geometry::Spheres(spheres) = geometry else {
                continue;
            };
            for (sphere, prim_id) in spheres.iter().zip(0u32..) {
                primitives.push_sphere(*sphere, PrimRef { geom_id, prim_id });
            }
        }
        Ok(primitives)
    }

    /// Writes triangles, by their indices, into the first lanes of a block.
    pub(crate) fn set_triangles(&self, block: &mut TriangleBlock, prims: &[u32]) {
        for (lane, &prim) in prims.iter().enumerate() {
            let index = prim as usize;
            block.set(lane, &self.triangles[index], self.triangle_refs[index]);
        }
    }

    /// A scene on two levels: geometries that lie in the world itself, and `instances`, each of which places
    /// one of the `objects`. An object is a list of geometries and is stored once, however often it is
    /// placed; one that nobody places costs nothing and is not looked at.
    ///
    /// A [`Hit`](crate::Hit) names the instance by its place in `instances`, or [`INVALID_ID`](crate::INVALID_ID) in the world
    /// itself, and the geometry by its place in the list of the object, or in `world`.
    ///
    /// # Errors
    /// As [`Primitives::new`], for every list of geometries; an index of an object out of range; 2²⁹ - 2
    /// instances or more.
    pub fn with_instances<'a>(
        world: &[Geometry<'_>],
        objects: &[impl AsRef<[Geometry<'a>]>],
        instances: &[Instance],
    ) -> Result<Self, Error> {
        limit("instances", instances.len(), MAX_INSTANCES)?;
        let mut placed = vec![false; objects.len()];
        for (instance, inst_id) in instances.iter().zip(0u32..) {
            *placed
                .get_mut(instance.object as usize)
                .ok_or(Error::ObjectOutOfRange {
                    inst_id,
                    object: instance.object,
                    objects: objects.len(),
                })? = true;
        }

        let mut opacities = Vec::new();
        let mut primitives = Self::copied(world, &mut opacities)?;
        for (object, placed) in objects.iter().zip(placed) {
            let object: &[Geometry<'_>] = if placed { object.as_ref() } else { &[] };
            let object = Self::copied(object, &mut opacities)?;
            primitives.objects.push(object);
        }
        primitives.separate_cutouts(opacities);
        let shapes = map(primitives.objects.len(), 1, |object| {
            ObjectShape::new(&primitives.objects[object])
        });
        for (instance, inst_id) in instances.iter().zip(0u32..) {
            let shape = &shapes[instance.object as usize];
            match Placement::new(&instance.transform, shape, inst_id) {
                Some(placement) => primitives.instances.push(PlacedObject {
                    placement,
                    object: instance.object,
                    world_from_object: instance.transform,
                }),
                None => primitives.dropped += 1,
            }
        }
        let dropped: usize = primitives.objects.iter().map(|object| object.dropped).sum();
        primitives.dropped += dropped;
        // What only dropped instances place is not needed.
        let mut placed = vec![false; primitives.objects.len()];
        for instance in &primitives.instances {
            placed[instance.object as usize] = true;
        }
        for (object, placed) in primitives.objects.iter_mut().zip(placed) {
            if !placed {
                *object = Self::default();
            }
        }
        Ok(primitives)
    }

    /// Copies all triangles, by many threads if there are many; then drops those that are not sound, which
    /// are rare.
    fn copy_triangles(&mut self, geometries: &[Geometry<'_>]) -> Result<(), Error> {
        let meshes = || {
            geometries
                .iter()
                .zip(0u32..)
                .filter_map(|(geometry, geom_id)| match geometry {
                    Geometry::Triangles(mesh) => Some((mesh, geom_id)),
                    Geometry::Spheres(_) => None,
                })
        };
        let count = meshes().map(|(mesh, _)| mesh.indices.len()).sum();
        let id = PrimRef {
            geom_id: 0,
            prim_id: 0,
        };
        self.triangles = vec![[[0.0; 3]; 3]; count];
        self.triangle_refs = vec![id; count];

        let chunk = chunk_len(count);
        let mut jobs = Vec::new();
        let mut triangles = &mut self.triangles[..];
        let mut refs = &mut self.triangle_refs[..];
        for (mesh, geom_id) in meshes() {
            for (indices, chunk_index) in mesh.indices.chunks(chunk).zip(0..) {
                let (triangles_here, others) = triangles.split_at_mut(indices.len());
                triangles = others;
                let (refs_here, others) = refs.split_at_mut(indices.len());
                refs = others;
                jobs.push(Job {
                    mesh,
                    indices,
                    id: PrimRef {
                        geom_id,
                        prim_id: (chunk_index * chunk) as u32,
                    },
                    triangles: triangles_here,
                    refs: refs_here,
                });
            }
        }
        let all_sound = AtomicBool::new(true);
        for_each(jobs, |job| {
            if !job.run() {
                all_sound.store(false, Ordering::Relaxed);
            }
        });
        if all_sound.into_inner() {
            return Ok(());
        }
        for (mesh, geom_id) in meshes() {
            check_indices(mesh, geom_id)?;
        }
        self.drop_unsound_triangles();
        Ok(())
    }

    fn drop_unsound_triangles(&mut self) {
        let mut kept = 0;
        for index in 0..self.triangles.len() {
            let triangle = self.triangles[index];
            if is_sound(triangle.each_ref()) {
                self.triangles[kept] = triangle;
                self.triangle_refs[kept] = self.triangle_refs[index];
                kept += 1;
            }
        }
        self.dropped += self.triangles.len() - kept;
        self.triangles.truncate(kept);
        self.triangle_refs.truncate(kept);
    }

    /// Keeps the filters of the meshes and which of them each triangle has.
    fn note_filters(&mut self, geometries: &[Geometry<'_>], opacities: &mut Vec<Arc<dyn Opacity>>) {
        let before = opacities.len();
        let mut filter_of = vec![NO_FILTER; geometries.len()];
        for (geometry, filter_of) in geometries.iter().zip(&mut filter_of) {
            if let Geometry::Triangles(mesh) = geometry
                && let Some(filter) = &mesh.opacity
            {
                *filter_of = opacities.len() as u32;
                opacities.push(Arc::clone(filter));
            }
        }
        if opacities.len() > before {
            let refs = self.triangle_refs.iter();
            self.cutout_filters = refs.map(|id| filter_of[id.geom_id as usize]).collect();
        }
    }

    /// Moves the partly transparent triangles of the world and of each object behind the opaque ones, and leaves out
    /// the clear ones. All are asked about together, because they may show the same.
    fn separate_cutouts(&mut self, opacities: Vec<Arc<dyn Opacity>>) {
        let lists = || core::iter::once(&*self).chain(&self.objects);
        // Only triangles that have a filter.
        let asked: Vec<_> = lists()
            .flat_map(|list| {
                let filters = list.cutout_filters.iter().zip(&list.triangle_refs);
                filters.filter(|&(&filter, _)| filter != NO_FILTER)
            })
            .map(|(&filter, &id)| Representative { filter, id })
            .collect();
        let (maps, known, mixed) = MicroMaps::new(asked.len(), |index| {
            let Representative { filter, id } = asked[index];
            (&*opacities[filter as usize], id.prim_id)
        });
        let filters = Arc::new(Filters {
            opacities,
            representatives: mixed.into_iter().map(|index| asked[index]).collect(),
            maps,
        });
        let mut known = known.into_iter();
        self.separate(&mut known, &filters);
        for object in &mut self.objects {
            object.separate(&mut known, &filters);
        }
    }

    /// The same for one list; takes what is known of each of its triangles that has a filter.
    fn separate(&mut self, known: &mut impl Iterator<Item = Known>, filters: &Arc<Filters>) {
        self.filters = Arc::clone(filters);
        let own_filters = core::mem::take(&mut self.cutout_filters);
        if own_filters.is_empty() {
            return;
        }
        let (mut kept, mut triangles, mut refs) = (0, Vec::new(), Vec::new());
        for (index, filter) in own_filters.into_iter().enumerate() {
            let (triangle, id) = (self.triangles[index], self.triangle_refs[index]);
            let known = if filter == NO_FILTER {
                Known::Opaque
            } else {
                known.next().expect("one for each")
            };
            match known {
                Known::Opaque => {
                    self.triangles[kept] = triangle;
                    self.triangle_refs[kept] = id;
                    kept += 1;
                }
                Known::Clear => self.transparent += 1,
                Known::Mixed(cutout) => {
                    triangles.push(triangle);
                    refs.push(id);
                    self.cutout_filters.push(filter);
                    self.cutouts.push(cutout);
                }
            }
        }
        self.triangles.truncate(kept);
        self.triangle_refs.truncate(kept);
        self.triangles.append(&mut triangles);
        self.triangle_refs.append(&mut refs);
    }

    fn push_sphere(&mut self, sphere: Sphere, id: PrimRef) {
        let bounds = sphere.bounds();
        let finite = bounds.min.iter().chain(&bounds.max).all(|x| x.is_finite());
        if finite && sphere.radius > 0.0 {
            self.spheres.push(sphere);
            self.sphere_refs.push(id);
        } else {
            self.dropped += 1;
        }
    }

    /// How many lie in the world itself, without the dropped ones and without what is in objects.
    pub fn len(&self) -> usize {
        self.triangles.len() + self.spheres.len()
    }

    /// How many are stored: those in the world itself and those of every object that is placed.
    pub fn stored(&self) -> usize {
        let objects = self.objects.iter();
        self.len() + objects.map(Self::len).sum::<usize>()
    }

    /// How many instances there are, without the dropped ones.
    pub fn instances(&self) -> usize {
        self.instances.len()
    }

    /// How many objects are placed by some instance.
    pub fn objects(&self) -> usize {
        self.objects
            .iter()
            .filter(|object| !object.is_empty())
            .count()
    }

    /// Whether there is nothing to hit.
    pub fn is_empty(&self) -> bool {
        self.len() == 0 && self.instances.is_empty()
    }

    /// How many primitives and instances were dropped. What is wrong in an object counts once, however often
    /// it is placed.
    pub fn dropped(&self) -> usize {
        self.dropped
    }

    /// How many are partly transparent triangles; those of an object count once.
    pub fn cutouts(&self) -> usize {
        let of_objects = self.objects.iter().map(Self::cutouts);
        self.cutouts.len() + of_objects.sum::<usize>()
    }

    /// How many triangles were left out because they are clear; those of an object count once.
    pub fn transparent(&self) -> usize {
        let of_objects = self.objects.iter().map(Self::transparent);
        self.transparent + of_objects.sum::<usize>()
    }

    /// The smallest box around primitives and the boxes of instances; empty if there is nothing. The box of an
    /// instance is a little larger than needed.
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
        .fold(Aabb::EMPTY, |all, bounds| all.union(bounds))
    }

    /// Bounds of one primitive: triangles come first, spheres after them, then instances.
    pub(crate) fn bounds_of(&self, index: usize) -> Aabb {
        match index.checked_sub(self.triangles.len()) {
            None => Aabb::around(&self.triangles[index]),
            Some(index) => match index.checked_sub(self.spheres.len()) {
                None => self.spheres[index].bounds(),
                Some(index) => self.instances[index].placement.bounds(),
            },
        }
    }

    /// The instance of this index; `None` if that is a primitive.
    pub(crate) fn instance(&self, index: usize) -> Option<&PlacedObject> {
        self.instances.get(index.checked_sub(self.len())?)
    }

    /// Where the second and each later kind of primitives begins in the numbering.
    pub(crate) fn kind_starts(&self) -> [usize; 2] {
        let triangles = self.triangles.len();
        [triangles - self.cutouts.len(), triangles]
    }

    /// Of what kind a primitive, which is no instance, is.
    pub(crate) fn kind(&self, index: usize) -> PrimKind {
        let [cutouts, spheres] = self.kind_starts();
        if index < cutouts {
            PrimKind::Triangle
        } else if index < spheres {
            PrimKind::Cutout
        } else {
            PrimKind::Sphere
        }
    }

    /// What is known of a partly transparent triangle without asking its filter.
    pub(crate) fn cutout(&self, index: usize) -> Cutout {
        self.cutouts[index - self.kind_starts()[0]]
    }

    /// The exact test of one primitive, in plain scalar code, and its own filter.
    pub(crate) fn hit(&self, index: usize, ray: &RaySetup, query: QueryKind) -> Option<Hit> {
        let kind = self.kind(index);
        let (id, t, u, v) = if kind == PrimKind::Sphere {
            let index = index - self.triangles.len();
            (
                self.sphere_refs[index],
                self.spheres[index].hit(ray)?,
                0.0,
                0.0,
            )
        } else {
            let (t, u, v) = triangle::hit(&self.triangles[index], ray)?;
            (self.triangle_refs[index], t, u, v)
        };
        let hit = Hit {
            t,
            u,
            v,
            prim_id: id.prim_id,
            geom_id: id.geom_id,
            inst_id: INVALID_ID,
        };
        let counts = kind != PrimKind::Cutout || {
            let filter = self.cutout_filters[index - self.kind_starts()[0]];
            let filter = &*self.filters.opacities[filter as usize];
            accepts(filter, id, [u, v], ray, id, query)
        };
        counts.then_some(hit)
    }
}

fn limit(what: &'static str, found: usize, limit: usize) -> Result<(), Error> {
    if found > limit {
        Err(Error::TooMany { what, found, limit })
    } else {
        Ok(())
    }
}

/// Triangles of one mesh to be copied.
struct Job<'a> {
    mesh: &'a TriangleMesh<'a>,
    indices: &'a [[u32; 3]],
    /// Of the first of them.
    id: PrimRef,
    triangles: &'a mut [[[f32; 3]; 3]],
    refs: &'a mut [PrimRef],
}

impl Job<'_> {
    /// Copies them. Returns whether all are sound; those with an index out of range are not.
    fn run(self) -> bool {
        let positions = &self.mesh.positions[..];
        let mut all_sound = true;
        let targets = self.triangles.iter_mut().zip(self.refs);
        for ((&[a, b, c], (triangle, id)), prim_id) in
            self.indices.iter().zip(targets).zip(self.id.prim_id..)
        {
            let corner = |index: u32| positions.get(index as usize).unwrap_or(&[f32::NAN; 3]);
            let corners = [corner(a), corner(b), corner(c)];
            *triangle = corners.map(|corner| *corner);
            *id = PrimRef { prim_id, ..self.id };
            all_sound &= is_sound(corners);
        }
        all_sound
    }
}

/// Whether all coordinates are finite and all corners different.
#[inline(always)]
fn is_sound([a, b, c]: [&[f32; 3]; 3]) -> bool {
    is_finite(a) && is_finite(b) && is_finite(c) && a != b && b != c && c != a
}

#[inline(always)]
fn is_finite([x, y, z]: &[f32; 3]) -> bool {
    x.is_finite() && y.is_finite() && z.is_finite()
}

/// Finds the first index out of range.
fn check_indices(mesh: &TriangleMesh<'_>, geom_id: u32) -> Result<(), Error> {
    let vertices = mesh.positions.len();
    for (indices, prim_id) in mesh.indices.iter().zip(0u32..) {
        for &index in indices {
            if index as usize >= vertices {
                return Err(Error::IndexOutOfRange {
                    geom_id,
                    prim_id,
                    index,
                    vertices,
                });
            }
        }
    }
    Ok(())
}
