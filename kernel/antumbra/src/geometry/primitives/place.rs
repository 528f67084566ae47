//! Third stage: objects are placed in the world.

use alloc::vec;
use alloc::vec::Vec;

use super::Primitives;
use super::copy::limit;
use super::dropped::{DropReason, Dropped};
use crate::error::Error;
use crate::geometry::instance::{Instance, ObjectShape, PlacedObject, Placement};
use crate::parallel::map;

/// Instances that leaf references can name: two of their 2²⁹ values have another meaning.
pub(crate) const MAX_INSTANCES: usize = (1 << 29) - 2;

/// Bytes that a build takes for each instance, as measured, and some more.
pub(crate) const INSTANCE_BYTES: usize = 1000;

/// Which of `objects` objects some instance places.
///
/// # Errors
/// Too many instances; an index of an object out of range.
pub(super) fn asked_for(instances: &[Instance], objects: usize) -> Result<Vec<bool>, Error> {
    limit("instances", instances.len(), MAX_INSTANCES)?;
    Error::if_no_memory("instances", instances.len(), INSTANCE_BYTES)?;
    for (instance, inst_id) in instances.iter().zip(0u32..) {
        if instance.object as usize >= objects {
            return Err(Error::ObjectOutOfRange {
                inst_id,
                object: instance.object,
                objects,
            });
        }
    }
    Ok(named(instances.iter().map(|one| one.object), objects))
}

/// Which of `objects` objects occur among `names`.
fn named(names: impl Iterator<Item = u32>, objects: usize) -> Vec<bool> {
    let mut is_named = vec![false; objects];
    for object in names {
        is_named[object as usize] = true;
    }
    is_named
}

impl Primitives {
    /// Places objects in this world, as the instances say, and counts what is dropped.
    pub(super) fn place(&mut self, objects: Vec<Self>, instances: &[Instance]) {
        let shapes = map(objects.len(), 1, |object| {
            ObjectShape::new(&objects[object])
        });
        for (instance, inst_id) in instances.iter().zip(0u32..) {
            let shape = &shapes[instance.object as usize];
            match Placement::new(&instance.transform, shape, inst_id) {
                Some(placement) => self.instances.push(PlacedObject {
                    placement,
                    object: instance.object,
                    world_from_object: instance.transform,
                }),
                None => {
                    let is_empty = objects[instance.object as usize].is_empty();
                    let reason = if is_empty {
                        DropReason::EmptyObject
                    } else {
                        DropReason::Transform
                    };
                    self.dropped.push(Dropped::Instance { inst_id, reason });
                }
            }
        }
        for object in &objects {
            self.dropped.extend_from_slice(&object.dropped);
        }
        self.objects = objects;
        self.forget_objects_without_instances();
    }

    fn forget_objects_without_instances(&mut self) {
        let names = self.instances.iter().map(|placed| placed.object);
        let is_placed = named(names, self.objects.len());
        for (object, is_placed) in self.objects.iter_mut().zip(is_placed) {
            if !is_placed {
                *object = Self::default();
            }
        }
    }
}
