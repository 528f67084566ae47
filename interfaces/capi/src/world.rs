//! Worlds: objects that instances place, and that move.

use antumbra::{Bvh, INVALID_ID, Instance, Masks, Object, World};

use crate::arrays::{Items, Plain, Slot, exclusive, handles, optional, shared, take_back};
use crate::build::OwnObject;
use crate::scene::Scene;
use crate::status::{Failure, Outcome, Status, guarded, if_no_memory};
use crate::threads::{Place, Threads};

/// An instance of the caller, `antumbra_instance`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Placed {
    pub object: u32,
    pub mask: u32,
    pub transform: [f32; 12],
}

// SAFETY: made only of integers and floats.
unsafe impl Plain for Placed {}

/// A world with the masks of its parts, `antumbra_world`.
#[derive(Clone)]
pub struct OwnWorld {
    pub world: World,
    masks: Masks,
}

/// Instances for the kernel, and their masks; no masks if all have all bits.
pub fn instances_of(placed: &Items<'_, Placed>) -> Outcome<(Vec<Instance>, Vec<u32>)> {
    if_no_memory(placed.iter().len(), 2 * size_of::<Instance>(), "instances")?;
    let instances = placed.iter().map(|placed| {
        let [a, b, c, d, e, f, g, h, i, j, k, l] = placed.transform;
        Instance::new(placed.object, [[a, b, c, d], [e, f, g, h], [i, j, k, l]])
    });
    let masks = match placed.iter().all(|placed| placed.mask == u32::MAX) {
        true => Vec::new(),
        false => placed.iter().map(|placed| placed.mask).collect(),
    };
    Ok((instances.collect(), masks))
}

/// Whether anything has a mask.
pub fn has_masks(masks: &Masks) -> bool {
    let has_objects = masks.objects.iter().any(|masks| !masks.is_empty());
    has_objects || !masks.world.is_empty() || !masks.instances.is_empty()
}

impl OwnWorld {
    pub fn new(world: World) -> Self {
        let masks = Masks::new();
        Self { world, masks }
    }

    /// Hands the masks to the world, if they are others than before.
    fn change_masks(&mut self, change: impl FnOnce(&mut Masks)) {
        let before = self.masks.clone();
        change(&mut self.masks);
        if self.masks != before {
            self.world.set_masks(self.masks.clone());
        }
    }
}

/// Masks of an object in a list of masks.
fn object_masks(masks: &mut Masks, object: usize) -> &mut Vec<u32> {
    if masks.objects.len() <= object {
        masks.objects.resize(object + 1, Vec::new());
    }
    &mut masks.objects[object]
}

/// Makes a world.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_world_new(
    ground: *const OwnObject,
    objects: *const *const OwnObject,
    object_count: usize,
    instances: *const Placed,
    instance_count: usize,
    threads: *const Threads,
    world: *mut *mut OwnWorld,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (slot, ground, objects, instances, place) = unsafe {
            let slot = Slot::handle(world, "world")?;
            let instances = Items::new(instances, instance_count, 0, "instances")?;
            let objects = handles(objects, object_count, "objects")?;
            let ground = optional(ground, "ground")?;
            (slot, ground, objects, instances, Place::of(threads)?)
        };
        let kernel_objects: Vec<&Object> = objects.iter().map(|object| &object.object).collect();
        let (placed, instance_masks) = instances_of(&instances)?;
        let world = place.run(|| match ground {
            Some(ground) => World::on_ground(&ground.object, &kernel_objects, &placed),
            None => World::new(&kernel_objects, &placed),
        })?;
        let mut world = OwnWorld::new(world);
        world.change_masks(|masks| {
            masks.world = ground
                .map(|ground| ground.masks.clone())
                .unwrap_or_default();
            masks.instances = instance_masks;
            for (index, object) in objects.iter().enumerate() {
                if !object.masks.is_empty() {
                    object_masks(masks, index).clone_from(&object.masks);
                }
            }
        });
        slot.give(world);
        Ok(())
    })
}

/// Frees a world.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_world_free(world: *mut OwnWorld) {
    // SAFETY: the header says that a handle is freed once.
    unsafe { take_back(world) }
}

/// The tree of a world.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_world_bvh(
    world: *const OwnWorld,
    bvh: *mut *const Bvh,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (world, slot) = unsafe { (shared(world, "world")?, Slot::new(bvh, "bvh")?) };
        slot.put(std::ptr::from_ref::<Bvh>(&world.world));
        Ok(())
    })
}

/// Replaces the list of instances.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_world_set_instances(
    world: *mut OwnWorld,
    instances: *const Placed,
    instance_count: usize,
    threads: *const Threads,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (world, instances, place) = unsafe {
            let instances = Items::new(instances, instance_count, 0, "instances")?;
            (exclusive(world, "world")?, instances, Place::of(threads)?)
        };
        change(world, &[], &instances, place)
    })
}

/// Moves the vertices of objects and replaces the list of instances.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_world_refit(
    world: *mut OwnWorld,
    objects: *const u32,
    scenes: *const *const Scene,
    object_count: usize,
    instances: *const Placed,
    instance_count: usize,
    threads: *const Threads,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (world, objects, scenes, instances, place) = unsafe {
            let objects = Items::new(objects, object_count, 0, "objects")?;
            let scenes = handles(scenes, object_count, "scenes")?;
            let instances = Items::new(instances, instance_count, 0, "instances")?;
            (
                exclusive(world, "world")?,
                objects,
                scenes,
                instances,
                Place::of(threads)?,
            )
        };
        let moved: Vec<_> = objects.iter().zip(scenes).collect();
        change(world, &moved, &instances, place)
    })
}

/// Other vertices of objects, and other instances.
fn change(
    world: &mut OwnWorld,
    moved: &[(u32, &Scene)],
    instances: &Items<'_, Placed>,
    place: Place<'_>,
) -> Outcome {
    let (placed, masks) = instances_of(instances)?;
    let geometries: Vec<_> = moved.iter().map(|(_, scene)| scene.geometries()).collect();
    let moved: Vec<_> = (moved.iter().zip(&geometries))
        .map(|((object, _), geometries)| (*object, &geometries[..]))
        .collect();
    place.run(|| world.world.refit(&moved, &placed))?;
    world.change_masks(|all| all.instances = masks);
    Ok(())
}

/// Adds an object.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_world_add_object(
    world: *mut OwnWorld,
    object: *const OwnObject,
    index: *mut u32,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (world, object, slot) = unsafe {
            let slot = Slot::optional(index, "index")?;
            (exclusive(world, "world")?, shared(object, "object")?, slot)
        };
        let index = world.world.add_object(&object.object)?;
        if !object.masks.is_empty() {
            world.change_masks(|masks| {
                object_masks(masks, index as usize).clone_from(&object.masks)
            });
        }
        if let Some(slot) = slot {
            slot.put(index);
        }
        Ok(())
    })
}

/// Sets the masks of the geometries of an object or of the ground.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_world_set_masks(
    world: *mut OwnWorld,
    object: u32,
    masks: *const u32,
    count: usize,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (world, masks) = unsafe {
            let masks = Items::new(masks, count, 0, "masks")?;
            (exclusive(world, "world")?, masks)
        };
        if object != INVALID_ID {
            check_object(world, object)?;
        }
        world.change_masks(|all| match object {
            INVALID_ID => all.world = masks.to_vec(),
            object => *object_masks(all, object as usize) = masks.to_vec(),
        });
        Ok(())
    })
}

/// Fails unless a world has an object of this number.
fn check_object(world: &OwnWorld, object: u32) -> Outcome {
    let count = world.world.report().objects;
    match (object as usize) < count {
        true => Ok(()),
        false => Err(Failure::argument(format_args!(
            "there is no object {object} among {count}"
        ))),
    }
}

/// Returns what a ray in an object costs now over what it cost when the object was built.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_world_quality(
    world: *const OwnWorld,
    object: u32,
    quality: *mut f64,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (world, slot) = unsafe { (shared(world, "world")?, Slot::new(quality, "quality")?) };
        check_object(world, object)?;
        slot.put(world.world.quality(object));
        Ok(())
    })
}
