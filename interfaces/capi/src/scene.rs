//! Scenes: lists of geometries, copied from arrays of the caller. Meshes are in `meshes`.

use std::sync::Arc;

use antumbra::cutout::Opacity;
use antumbra::shapes::{Curves, Disk, Sphere, TriangleMesh, UserGeometry};
use antumbra::{Geometry, LocalOrigin};

use crate::arrays::{Handle, Items, MaybeSlot, Slot};
use crate::functions::{OpacityFunction, UserFunctions};
use crate::interface::{frees, functions};
use crate::status::{Failure, Outcome, Status};

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
    /// Opaque triangles.
    pub fn triangles(positions: Vec<[f32; 3]>, indices: Vec<[u32; 3]>) -> Self {
        Self::Triangles {
            positions,
            indices,
            opacity: None,
        }
    }

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

    pub fn add(&mut self, part: Part, geom_id: &MaybeSlot<u32>) -> Outcome {
        let Ok(number) = u32::try_from(self.parts.len()) else {
            return Err(Failure::new(Status::TooMany, "more than 2^32 geometries"));
        };
        self.parts.push(part);
        self.masks.push(u32::MAX);
        geom_id.put(number);
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

functions! {
    /// Makes an empty scene.
    fn antumbra_scene_new(scene: Handle<Scene>) {
        scene.give(Scene::default());
        Ok(())
    }

    /// Returns the number of geometries.
    fn antumbra_scene_geometry_count(scene: &Scene, count: Slot<usize>) {
        count.put(scene.parts.len());
        Ok(())
    }

    /// Sets the origin of points in double precision: 3 finite numbers. It is subtracted from them before they are rounded to
    /// single precision. The default is 0. Hits, rays and points of queries are seen from the same origin. All scenes of one tree
    /// need one origin; the middle of the coordinates is the best one.
    ///
    /// Errors: INVALID_ARGUMENT if the scene has a geometry already, or a number is not finite.
    fn antumbra_scene_set_origin(scene: &mut Scene, origin: *const f64) {
        // SAFETY: the header says that `origin` is null or has three numbers.
        let origin = unsafe { Items::<[f64; 3]>::new(origin.cast(), 1, 0, "origin") }?.get(0);
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
    }

    /// Adds spheres: `count` centres of 3 floats and radii of 1 float. For an array of (x, y, z, radius) give the address of the
    /// first x and the address of the first radius, both with a stride of 16. One radius may serve all: ANTUMBRA_SAME_FOR_ALL.
    /// Rays that start inside of a sphere hit it from within.
    fn antumbra_scene_add_spheres(
        scene: &mut Scene,
        centers: *const f32,
        center_stride: usize,
        radii: *const f32,
        radius_stride: usize,
        count: usize,
        geom_id: MaybeSlot<u32>,
    ) {
        // SAFETY: the header says what is at these addresses.
        let (centers, radii) = unsafe {
            let centers = Items::<[f32; 3]>::new(centers.cast(), count, center_stride, "centers")?;
            (centers, Items::or_same(radii, count, radius_stride, "radii")?)
        };
        let spheres = (0..count).map(|index| Sphere {
            center: centers.get(index),
            radius: radii.get(index),
        });
        scene.add(Part::Spheres(spheres.collect()), &geom_id)
    }

    /// Adds flat disks, which are hit from both sides: `count` centres and normals of 3 floats and radii of 1 float. Normals may
    /// have any length but zero. One normal and one radius may serve all: ANTUMBRA_SAME_FOR_ALL.
    fn antumbra_scene_add_disks(
        scene: &mut Scene,
        centers: *const f32,
        center_stride: usize,
        normals: *const f32,
        normal_stride: usize,
        radii: *const f32,
        radius_stride: usize,
        count: usize,
        geom_id: MaybeSlot<u32>,
    ) {
        // SAFETY: the header says what is at these addresses.
        let (centers, normals, radii) = unsafe {
            let centers = Items::<[f32; 3]>::new(centers.cast(), count, center_stride, "centers")?;
            let normals = Items::or_same(normals.cast(), count, normal_stride, "normals")?;
            (centers, normals, Items::or_same(radii, count, radius_stride, "radii")?)
        };
        let disks = (0..count).map(|index| Disk {
            center: centers.get(index),
            normal: normals.get(index),
            radius: radii.get(index),
        });
        scene.add(Part::Disks(disks.collect()), &geom_id)
    }

    /// Adds thin curves: hair, fur, grass. `points` are x, y, z and radius. Segment i is straight, goes from point `segments[i]`
    /// to the next one, and has the prim_id i. One that begins where the one before it in the list ends goes on there without a
    /// gap. Without `segments` (NULL) all points are one curve, of one segment less. Segments are flat and face every ray, as
    /// Embree's flat curves; rays hit what is within the radius of the axis. `u` of a hit goes along the segment, `v` across it,
    /// with 1/2 on the axis.
    fn antumbra_scene_add_curves(
        scene: &mut Scene,
        points: *const f32,
        point_count: usize,
        point_stride: usize,
        segments: *const u32,
        segment_count: usize,
        segment_stride: usize,
        geom_id: MaybeSlot<u32>,
    ) {
        // SAFETY: the header says what is at these addresses.
        let points = unsafe { Items::new(points.cast(), point_count, point_stride, "points") }?;
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
        let points = points.to_vec();
        scene.add(Part::Curves { points, segments }, &geom_id)
    }

    /// Adds user geometry of `count` primitives. The structure is copied; what `data` points to is not.
    ///
    /// Errors: INVALID_ARGUMENT if `bounds` or `intersect` is missing.
    fn antumbra_scene_add_user(
        scene: &mut Scene,
        count: u32,
        functions: *const UserFunctions,
        geom_id: MaybeSlot<u32>,
    ) {
        // SAFETY: the header says what the functions do.
        let (shape, data) = unsafe { UserFunctions::shape(functions, "functions") }?;
        scene.add(Part::User(count, shape), &geom_id)?;
        data.keep();
        Ok(())
    }

    /// Makes a triangle mesh partly transparent. The structure is copied; what `data` points to is not.
    ///
    /// Errors: INVALID_ARGUMENT; UNSUPPORTED if the geometry has no triangles.
    fn antumbra_scene_set_opacity(
        scene: &mut Scene,
        geom_id: u32,
        opacity: *const OpacityFunction,
    ) {
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
    }

    /// Sets the mask of a geometry. Rays with a mask hit only geometries that have a bit in common with it. All bits are set
    /// unless this function is called. Rays without a mask hit everything, also a geometry with the mask 0. Trees and objects take
    /// the masks of their scenes when they are built.
    fn antumbra_scene_set_mask(scene: &mut Scene, geom_id: u32, mask: u32) {
        scene.part(geom_id)?;
        scene.masks[geom_id as usize] = mask;
        Ok(())
    }
}

frees! {
    /// Frees a scene.
    fn antumbra_scene_free(scene: Scene);
}
