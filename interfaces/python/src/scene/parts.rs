//! What a scene is made of: kept beside its tree, to learn again, to be saved, and to know the corners of what was hit.

use std::sync::Arc;

use antumbra::cutout::Opacity;
use antumbra::shapes::Sphere;
use antumbra::{Geometry, INVALID_ID, Instance, LocalOrigin, Masks, Primitives};

use super::curves::Segments;

/// One mesh, or what else has an index of its own.
#[derive(Clone)]
pub enum Part {
    Mesh {
        positions: Vec<[f32; 3]>,
        indices: Vec<[u32; 3]>,
        /// Filter of a mesh that is partly transparent.
        opacity: Option<Arc<dyn Opacity>>,
    },
    Spheres(Vec<Sphere>),
    Curves(Segments),
}

/// Vertices and triangles.
pub type Triangles<'a> = (&'a [[f32; 3]], &'a [[u32; 3]]);

/// Meshes and where they are placed.
#[derive(Clone, Default)]
pub struct Parts {
    pub parts: Vec<Arc<Part>>,
    /// Parts that are in the world without an instance: a place in this list is the kernel's `geom_id`.
    pub world: Vec<u32>,
    /// Parts of every object.
    pub objects: Vec<Vec<u32>>,
    pub instances: Vec<Instance>,
    /// How each instance is reached, if instances are in assemblies: as many places for each, -1 behind the last one.
    pub paths: Vec<i32>,
    pub local: LocalOrigin,
    /// Origins that the objects of a world have, seen from the meshes as they were given.
    pub origins: Vec<[f64; 3]>,
    /// Masks of parts; all bits for those that the list does not reach.
    pub masks: Vec<u32>,
    /// Masks of instances, likewise.
    pub instance_masks: Vec<u32>,
}

impl Part {
    pub fn geometry(&self) -> Geometry<'_> {
        match self {
            Self::Mesh {
                positions,
                indices,
                opacity,
            } => match opacity {
                Some(opacity) => {
                    Geometry::cutouts(&positions[..], &indices[..], Arc::clone(opacity))
                }
                None => Geometry::triangles(&positions[..], &indices[..]),
            },
            Self::Spheres(spheres) => Geometry::spheres(&spheres[..]),
            Self::Curves(segments) => Geometry::curves(segments.geometry()),
        }
    }

    /// Vertices and triangles; `None` for spheres and curves.
    pub fn triangles(&self) -> Option<Triangles<'_>> {
        match self {
            Self::Mesh {
                positions, indices, ..
            } => Some((positions, indices)),
            Self::Spheres(_) | Self::Curves(_) => None,
        }
    }

    /// Triangles, spheres or segments.
    pub fn len(&self) -> usize {
        match self {
            Self::Mesh { indices, .. } => indices.len(),
            Self::Spheres(spheres) => spheres.len(),
            Self::Curves(segments) => segments.firsts.len(),
        }
    }
}

impl From<&Geometry<'_>> for Part {
    /// A copy. Other kinds of geometry are in no scene of a file, and become empty meshes.
    fn from(geometry: &Geometry<'_>) -> Self {
        match geometry {
            Geometry::Triangles(mesh) => Self::Mesh {
                positions: mesh.positions.to_vec(),
                indices: mesh.indices.to_vec(),
                opacity: mesh.opacity.clone(),
            },
            Geometry::Spheres(spheres) => Self::Spheres(spheres.to_vec()),
            Geometry::Curves(curves) => Self::Curves(Segments::from(curves)),
            _ => Self::Spheres(Vec::new()),
        }
    }
}

impl Parts {
    pub fn primitives(&self) -> Result<Primitives, antumbra::Error> {
        let objects = self.objects.iter().map(|object| self.geometries(object));
        let objects: Vec<_> = objects.collect();
        Primitives::with_instances(&self.geometries(&self.world), &objects, &self.instances)
    }

    /// Some parts as the kernel takes them.
    pub fn geometries(&self, list: &[u32]) -> Vec<Geometry<'_>> {
        let list = list.iter().map(|&part| &self.parts[part as usize]);
        list.map(|part| part.geometry()).collect()
    }

    /// Whether a kernel's `geom_id` is the number of the mesh.
    pub fn is_plain(&self) -> bool {
        self.instances.is_empty() && (0..).zip(&self.world).all(|(index, &part)| index == part)
    }

    /// Whether there is anything but triangles.
    pub fn has_others(&self) -> bool {
        self.parts.iter().any(|part| part.triangles().is_none())
    }

    pub fn has_curves(&self) -> bool {
        let is_it = |part: &Arc<Part>| matches!(**part, Part::Curves(_));
        self.parts.iter().any(is_it)
    }

    /// Number of a curve, and how far along it a hit is; `None` for what is no curve.
    pub fn along_curve(&self, ids: Ids, u: f32) -> Option<(i32, f32)> {
        let Part::Curves(segments) = &**self.parts.get(usize::try_from(ids.mesh).ok()?)? else {
            return None;
        };
        let place = segments.places.get(usize::try_from(ids.triangle).ok()?)?;
        let [from, to] = place.along;
        Some((place.curve as i32, from + u * (to - from)))
    }

    /// Number of the mesh that a hit names; `u32::MAX` if there is none.
    pub fn part_of(&self, geom_id: u32, inst_id: u32) -> u32 {
        let list = match inst_id {
            INVALID_ID => Some(&self.world),
            _ => (self.instances.get(inst_id as usize))
                .and_then(|instance| self.objects.get(instance.object as usize)),
        };
        let part = list.and_then(|list| list.get(geom_id as usize));
        part.copied().unwrap_or(u32::MAX)
    }

    /// Where each part is: the object, `None` for the world, and the place in its list, which is the kernel's `geom_id`.
    pub fn places(&self) -> Vec<(Option<u32>, u32)> {
        let mut places = vec![(None, u32::MAX); self.parts.len()];
        for (geom, &part) in (0..).zip(&self.world) {
            places[part as usize] = (None, geom);
        }
        for (object, list) in (0..).zip(&self.objects) {
            for (geom, &part) in (0..).zip(list) {
                places[part as usize] = (Some(object), geom);
            }
        }
        places
    }

    /// The masks as the kernel takes them; `None` where nothing has one.
    pub fn kernel_masks(&self) -> Option<Masks> {
        if self.masks.is_empty() && self.instance_masks.is_empty() {
            return None;
        }
        let of = |list: &Vec<u32>| -> Vec<u32> {
            let masks = list.iter().map(|&part| self.masks.get(part as usize));
            masks
                .map(|mask| mask.copied().unwrap_or(u32::MAX))
                .collect()
        };
        let masks = Masks::new().world(of(&self.world));
        let masks = masks.objects(self.objects.iter().map(of).collect());
        Some(masks.instances(self.instance_masks.clone()))
    }

    /// Meshes as they are placed in the world, as calls of `mesh`: their vertices before they are placed, their triangles, and
    /// the instance. Meshes of the world come first, then the meshes of every instance. Spheres and curves have no triangles.
    pub fn placed<'a>(
        &'a self,
        mut mesh: impl FnMut(&'a [[f32; 3]], &'a [[u32; 3]], Option<&'a Instance>),
    ) {
        let mut call = |part: u32, transform| {
            if let Some((positions, indices)) = self.parts[part as usize].triangles() {
                mesh(positions, indices, transform);
            }
        };
        for &part in &self.world {
            call(part, None);
        }
        for instance in &self.instances {
            for &part in &self.objects[instance.object as usize] {
                call(part, Some(instance));
            }
        }
    }

    /// A point of a mesh in the world.
    pub fn world_point(&self, point: [f32; 3], instance: Option<&Instance>) -> [f64; 3] {
        let placed = placed(instance, point.map(f64::from));
        [0, 1, 2].map(|axis| placed[axis] + self.local.origin[axis])
    }

    /// Bytes of all lists.
    pub fn bytes(&self) -> usize {
        let parts = self.parts.iter().map(|part| match &**part {
            Part::Mesh {
                positions, indices, ..
            } => size_of_val(&positions[..]) + size_of_val(&indices[..]),
            Part::Spheres(spheres) => size_of_val(&spheres[..]),
            Part::Curves(segments) => segments.bytes(),
        });
        parts.sum::<usize>() + size_of_val(&self.instances[..]) + size_of_val(&self.paths[..])
    }

    /// The kernel's `geom_id` and `inst_id` of a mesh.
    pub fn kernel_ids(&self, ids: Ids) -> Option<[u32; 2]> {
        let (list, inst_id) = match u32::try_from(ids.instance) {
            Err(_) => (&self.world, INVALID_ID),
            Ok(inst_id) => {
                let instance = self.instances.get(inst_id as usize)?;
                (self.objects.get(instance.object as usize)?, inst_id)
            }
        };
        let mesh = u32::try_from(ids.mesh).ok()?;
        let geom_id = list.iter().position(|&part| part == mesh)?;
        Some([geom_id as u32, inst_id])
    }

    /// Corners of a triangle in the world, as double precision has them of what the tree has; `None` for spheres and curves.
    pub fn corners(&self, ids: Ids) -> Option<[[f64; 3]; 3]> {
        let part = self.parts.get(usize::try_from(ids.mesh).ok()?)?;
        let (positions, indices) = part.triangles()?;
        let corners = *indices.get(usize::try_from(ids.triangle).ok()?)?;
        let instance = match usize::try_from(ids.instance) {
            Ok(instance) => Some(self.instances.get(instance)?),
            Err(_) => None,
        };
        let mut world = [[0.0; 3]; 3];
        for (to, corner) in world.iter_mut().zip(corners) {
            *to = self.world_point(*positions.get(corner as usize)?, instance);
        }
        Some(world)
    }
}

/// Ids that users see.
#[derive(Clone, Copy)]
pub struct Ids {
    pub triangle: i32,
    pub mesh: i32,
    pub instance: i32,
}

/// Vector from a point to another one.
pub fn between(from: [f64; 3], to: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|axis| to[axis] - from[axis])
}

/// Cross product.
#[inline(always)]
pub fn cross([a, b, c]: [f64; 3], [d, e, f]: [f64; 3]) -> [f64; 3] {
    [b * f - c * e, c * d - a * f, a * e - b * d]
}

/// A point of an object in the world.
#[inline(always)]
pub fn placed(instance: Option<&Instance>, [x, y, z]: [f64; 3]) -> [f64; 3] {
    instance.map_or([x, y, z], |instance| {
        instance.transform.map(|row| {
            let [a, b, c, d] = row.map(f64::from);
            a * x + b * y + c * z + d
        })
    })
}
