//! Scenes: lists of geometries, copied from arrays of the caller. Meshes are in `meshes`.

use std::sync::Arc;

use antumbra::cutout::Opacity;
use antumbra::shapes::{Curves, Disk, Sphere, TriangleMesh, UserGeometry};
use antumbra::{Geometry, LocalOrigin};

use crate::arrays::{Items, Slot, exclusive, shared, take_back};
use crate::functions::{OpacityFunction, UserFunctions};
use crate::status::{Failure, Outcome, Status, guarded};

/// A list of geometries, `antumbra_scene`.
#[derive(Default)]
pub struct Scene {
    origin: LocalOrigin,
    parts: Vec<Part>,
    /// Masks of the geometries.
    masks: Vec<u32>,
}

/// A geometry with its arrays.
pub enum Part {
    Triangles {
        positions: Vec<[f32; 3]>,
        indices: Vec<[u32; 3]>,
        opacity: Option<Arc<dyn Opacity>>,
    },
    Quads {
        positions: Vec<[f32; 3]>,
        indices: Vec<[u32; 4]>,
    },
    Spheres(Vec<Sphere>),
    Disks(Vec<Disk>),
    Curves {
        points: Vec<[f32; 4]>,
        segments: Vec<u32>,
    },
    User(u32, Arc<dyn UserGeometry>),
}

impl Part {
    /// The geometry for the kernel.
    fn geometry(&self) -> Geometry<'_> {
        match self {
            Self::Triangles {
                positions,
                indices,
                opacity,
            } => {
                let mut mesh = TriangleMesh::new(&positions[..], &indices[..]);
                mesh.opacity = opacity.clone();
                Geometry::Triangles(mesh)
            }
            Self::Quads { positions, indices } => Geometry::quads(&positions[..], &indices[..]),
            Self::Spheres(spheres) => Geometry::spheres(&spheres[..]),
            Self::Disks(disks) => Geometry::disks(&disks[..]),
            Self::Curves { points, segments } => {
                Geometry::curves(Curves::new(&points[..], &segments[..]))
            }
            Self::User(count, shape) => Geometry::user(*count, Arc::clone(shape)),
        }
    }
}

impl Scene {
    /// The geometries for the kernel.
    pub fn geometries(&self) -> Vec<Geometry<'_>> {
        self.parts.iter().map(Part::geometry).collect()
    }

    /// Masks of the geometries; empty if all of them have all bits.
    pub fn masks(&self) -> Vec<u32> {
        match self.masks.iter().all(|mask| *mask == u32::MAX) {
            true => Vec::new(),
            false => self.masks.clone(),
        }
    }

    pub fn add(&mut self, part: Part, geom_id: Option<Slot<u32>>) -> Outcome {
        let Ok(number) = u32::try_from(self.parts.len()) else {
            return Err(Failure::new(Status::TooMany, "more than 2^32 geometries"));
        };
        self.parts.push(part);
        self.masks.push(u32::MAX);
        if let Some(geom_id) = geom_id {
            geom_id.put(number);
        }
        Ok(())
    }

    fn part(&mut self, geom_id: u32) -> Outcome<&mut Part> {
        let count = self.parts.len();
        (self.parts.get_mut(geom_id as usize)).ok_or_else(|| {
            Failure::argument(format_args!("there is no geometry {geom_id} among {count}"))
        })
    }

    pub fn local(&self, points: &Items<'_, [f64; 3]>) -> Vec<[f32; 3]> {
        points
            .iter()
            .map(|point| self.origin.local(point))
            .collect()
    }

    /// Replaces the positions of a mesh.
    pub fn set_positions(&mut self, geom_id: u32, moved: Vec<[f32; 3]>) -> Outcome {
        let (Part::Triangles { positions, .. } | Part::Quads { positions, .. }) =
            self.part(geom_id)?
        else {
            return Err(Failure::new(
                Status::Unsupported,
                format_args!("geometry {geom_id} has no vertices"),
            ));
        };
        if positions.len() != moved.len() {
            return Err(Failure::argument(format_args!(
                "geometry {geom_id} has {} vertices, and {} were given",
                positions.len(),
                moved.len()
            )));
        }
        *positions = moved;
        Ok(())
    }
}

/// Makes an empty scene.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_scene_new(scene: *mut *mut Scene) -> Status {
    guarded(|| {
        // SAFETY: the header says that `scene` is null or a place for a handle.
        unsafe { Slot::handle(scene, "scene") }?.give(Scene::default());
        Ok(())
    })
}

/// Frees a scene.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_scene_free(scene: *mut Scene) {
    // SAFETY: the header says that a handle is freed once.
    unsafe { take_back(scene) }
}

/// Sets the origin of points in double precision.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_scene_set_origin(
    scene: *mut Scene,
    origin: *const f64,
) -> Status {
    guarded(|| {
        // SAFETY: the header says that `origin` is null or has three numbers.
        let (scene, origin) = unsafe {
            let origin = Items::<[f64; 3]>::new(origin.cast(), 1, 0, "origin")?;
            (exclusive(scene, "scene")?, origin.get(0))
        };
        if !scene.parts.is_empty() {
            let text = "the origin must be set before the first geometry is added";
            return Err(Failure::argument(text));
        }
        if !origin.iter().all(|x| x.is_finite()) {
            return Err(Failure::argument(format_args!(
                "the origin {origin:?} is not finite"
            )));
        }
        scene.origin = LocalOrigin { origin };
        Ok(())
    })
}

/// Adds spheres.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_scene_add_spheres(
    scene: *mut Scene,
    centers: *const f32,
    center_stride: usize,
    radii: *const f32,
    radius_stride: usize,
    count: usize,
    geom_id: *mut u32,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (scene, centers, radii, geom_id) = unsafe {
            let centers = Items::<[f32; 3]>::new(centers.cast(), count, center_stride, "centers")?;
            let radii = Items::<f32>::or_same(radii, count, radius_stride, "radii")?;
            (
                exclusive(scene, "scene")?,
                centers,
                radii,
                Slot::optional(geom_id, "geom_id")?,
            )
        };
        let spheres = (0..count).map(|index| Sphere {
            center: centers.get(index),
            radius: radii.get(index),
        });
        scene.add(Part::Spheres(spheres.collect()), geom_id)
    })
}

/// Adds flat disks.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_scene_add_disks(
    scene: *mut Scene,
    centers: *const f32,
    center_stride: usize,
    normals: *const f32,
    normal_stride: usize,
    radii: *const f32,
    radius_stride: usize,
    count: usize,
    geom_id: *mut u32,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (scene, centers, normals, radii) = unsafe {
            let centers = Items::<[f32; 3]>::new(centers.cast(), count, center_stride, "centers")?;
            let normals =
                Items::<[f32; 3]>::or_same(normals.cast(), count, normal_stride, "normals")?;
            let radii = Items::<f32>::or_same(radii, count, radius_stride, "radii")?;
            (exclusive(scene, "scene")?, centers, normals, radii)
        };
        // SAFETY: as above.
        let geom_id = unsafe { Slot::optional(geom_id, "geom_id") }?;
        let disks = (0..count).map(|index| Disk {
            center: centers.get(index),
            normal: normals.get(index),
            radius: radii.get(index),
        });
        scene.add(Part::Disks(disks.collect()), geom_id)
    })
}

/// Adds thin curves.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_scene_add_curves(
    scene: *mut Scene,
    points: *const f32,
    point_count: usize,
    point_stride: usize,
    segments: *const u32,
    segment_count: usize,
    segment_stride: usize,
    geom_id: *mut u32,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (scene, points, geom_id) = unsafe {
            let points =
                Items::<[f32; 4]>::new(points.cast(), point_count, point_stride, "points")?;
            let geom_id = Slot::optional(geom_id, "geom_id")?;
            (exclusive(scene, "scene")?, points.to_vec(), geom_id)
        };
        let whole = point_count.saturating_sub(1);
        let segments = if !segments.is_null() {
            // SAFETY: as above.
            unsafe { Items::new(segments, segment_count, segment_stride, "segments") }?.to_vec()
        } else if segment_count != whole {
            return Err(Failure::argument(format_args!(
                "without `segments`, {point_count} points are one curve of {whole} segments, not {segment_count}"
            )));
        } else {
            match u32::try_from(whole) {
                Ok(count) => (0..count).collect(),
                Err(_) => return Err(Failure::new(Status::TooMany, "more than 2^32 segments")),
            }
        };
        scene.add(Part::Curves { points, segments }, geom_id)
    })
}

/// Adds user geometry.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_scene_add_user(
    scene: *mut Scene,
    count: u32,
    functions: *const UserFunctions,
    geom_id: *mut u32,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (scene, geom_id) = unsafe {
            (
                exclusive(scene, "scene")?,
                Slot::optional(geom_id, "geom_id")?,
            )
        };
        // SAFETY: the header says what the functions do.
        let (shape, data) = unsafe { UserFunctions::shape(functions, "functions") }?;
        scene.add(Part::User(count, shape), geom_id)?;
        data.keep();
        Ok(())
    })
}

/// Makes the triangles of a mesh partly transparent.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_scene_set_opacity(
    scene: *mut Scene,
    geom_id: u32,
    opacity: *const OpacityFunction,
) -> Status {
    guarded(|| {
        // SAFETY: the header says that the handle is null or valid.
        let scene = unsafe { exclusive(scene, "scene") }?;
        let Part::Triangles { opacity: own, .. } = scene.part(geom_id)? else {
            return Err(Failure::new(
                Status::Unsupported,
                format_args!("geometry {geom_id} has no triangles: only these can be transparent"),
            ));
        };
        // SAFETY: the header says what the function does.
        let (filter, data) = unsafe { OpacityFunction::filter(opacity, "opacity") }?;
        *own = Some(filter);
        data.keep();
        Ok(())
    })
}

/// Sets the mask of a geometry.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_scene_set_mask(
    scene: *mut Scene,
    geom_id: u32,
    mask: u32,
) -> Status {
    guarded(|| {
        // SAFETY: the header says that the handle is null or valid.
        let scene = unsafe { exclusive(scene, "scene") }?;
        scene.part(geom_id)?;
        scene.masks[geom_id as usize] = mask;
        Ok(())
    })
}

/// Number of geometries.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_scene_geometry_count(
    scene: *const Scene,
    count: *mut usize,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (scene, count) = unsafe { (shared(scene, "scene")?, Slot::new(count, "count")?) };
        count.put(scene.parts.len());
        Ok(())
    })
}
