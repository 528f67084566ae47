//! Masks of geometries and instances, which queries compare with the masks of rays.

use alloc::vec::Vec;

use crate::ray::INVALID_ID;

/// Masks of the geometries and instances of a scene, 32 bits each. Queries that give a mask see only what has a bit in
/// common with it: the geometry and, if it lies in one, the instance.
///
/// Geometries and instances beyond the end of a list have all bits set. Numbers behind the last geometry or instance
/// have no meaning. Queries without a mask see everything, and masks cost them nothing. Queries about points see
/// everything.
///
/// Masks are no part of a tree: they may change at any time and cost no build. See [`Bvh::set_masks`](crate::Bvh::set_masks).
///
/// ```
/// # use antumbra::{Bvh, Geometry, Recipe};
/// use antumbra::{Masks, Ray};
///
/// # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
/// # let mut bvh = Bvh::build(&geometry, &Recipe::default())?;
/// bvh.set_masks(Masks::new().world(vec![0b01]));
/// let ray = Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0]);
/// assert!(bvh.query(&ray).mask(0b01).occluded());
/// assert!(!bvh.query(&ray).mask(0b10).occluded());
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Masks {
    /// Masks of the geometries that lie in the world itself, by `geom_id`.
    pub world: Vec<u32>,
    /// Masks of the geometries of objects, by object and `geom_id`. All instances of an object share them.
    pub objects: Vec<Vec<u32>>,
    /// Masks of the instances, by `inst_id`.
    pub instances: Vec<u32>,
}

impl Masks {
    /// Masks with all bits set for every geometry and instance.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the masks of the geometries outside of objects, indexed by `geom_id`.
    #[must_use]
    pub fn world(self, world: Vec<u32>) -> Self {
        Self { world, ..self }
    }

    /// With these masks of geometries of objects, by object and `geom_id`.
    #[must_use]
    pub fn objects(self, objects: Vec<Vec<u32>>) -> Self {
        Self { objects, ..self }
    }

    /// With these masks of instances, by `inst_id`.
    #[must_use]
    pub fn instances(self, instances: Vec<u32>) -> Self {
        Self { instances, ..self }
    }
}

/// Masks of a scene, and which object each instance places.
#[derive(Clone, Debug)]
pub(crate) struct SceneMasks {
    pub masks: Masks,
    /// By `inst_id`; of no meaning where no instance has this number.
    pub objects: Vec<u32>,
}

impl SceneMasks {
    /// Masks of a scene with these instances, each given by its number and its object.
    pub fn new(masks: Masks, instances: impl Iterator<Item = (u32, u32)>) -> Self {
        let mut all = Self {
            masks,
            objects: Vec::new(),
        };
        all.place(instances);
        all
    }

    /// Replaces the instances, given as pairs of `inst_id` and object.
    pub fn place(&mut self, instances: impl Iterator<Item = (u32, u32)>) {
        self.objects.clear();
        for (inst_id, object) in instances {
            let inst_id = inst_id as usize;
            if self.objects.len() <= inst_id {
                self.objects.resize(inst_id + 1, u32::MAX);
            }
            self.objects[inst_id] = object;
        }
    }

    /// Whether rays of this mask see an instance.
    pub fn shows_instance(&self, mask: u32, inst_id: u32) -> bool {
        of(&self.masks.instances, inst_id) & mask != 0
    }

    /// Whether rays of this mask see a geometry in an instance, or in the world itself.
    pub fn shows(&self, mask: u32, inst_id: u32, geom_id: u32) -> bool {
        if inst_id == INVALID_ID {
            return of(&self.masks.world, geom_id) & mask != 0;
        }
        let object = self.objects.get(inst_id as usize);
        let list = object.and_then(|object| self.masks.objects.get(*object as usize));
        self.shows_instance(mask, inst_id)
            && list.map_or(u32::MAX, |list| of(list, geom_id)) & mask != 0
    }
}

/// Mask at an index of a list; all bits beyond its end.
fn of(list: &[u32], index: u32) -> u32 {
    list.get(index as usize).copied().unwrap_or(u32::MAX)
}
