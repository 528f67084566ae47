//! Worlds: objects that instances place, and that move.

use antumbra::{Bvh, INVALID_ID, Instance, Masks, Object, World};

use crate::arrays::{Handle, Items, MaybeSlot, Plain, Slot, handles};
use crate::build::OwnObject;
use crate::interface::{frees, functions};
use crate::scene::Scene;
use crate::status::{Failure, Outcome, if_no_memory};
use crate::threads::Place;

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

functions! {
    /// Makes a world. `ground` is an object that is part of the world itself, or NULL. Takes the masks of objects
    /// and instances. The place of an instance in the list is its inst_id. `threads` may be NULL.
    ///
    /// Errors: BAD_GEOMETRY if an instance names an object that is not there; OTHER_GEOMETRY if objects have different widths.
    fn antumbra_world_new(
        ground: Option<&OwnObject>,
        objects: *const *const OwnObject,
        object_count: usize,
        instances: *const Placed,
        instance_count: usize,
        threads: Place<'_>,
        world: Handle<OwnWorld>,
    ) {
        // SAFETY: the header says what is at these addresses.
        let (objects, instances) = unsafe {
            let objects = handles(objects, object_count, "objects")?;
            (objects, Items::new(instances, instance_count, 0, "instances")?)
        };
        let of_kernel: Vec<&Object> = objects.iter().map(|object| &object.object).collect();
        let (placed, instance_masks) = instances_of(&instances)?;
        let made = threads.run(|| match ground {
            Some(ground) => World::on_ground(&ground.object, &of_kernel, &placed),
            None => World::new(&of_kernel, &placed),
        })?;
        let mut made = OwnWorld::new(made);
        made.change_masks(|masks| {
            masks.world = ground.map(|ground| ground.masks.clone()).unwrap_or_default();
            masks.instances = instance_masks;
            for (index, object) in objects.iter().enumerate() {
                if !object.masks.is_empty() {
                    object_masks(masks, index).clone_from(&object.masks);
                }
            }
        });
        world.give(made);
        Ok(())
    }

    /// Lends the tree over everything, for queries. It lives as long as the world, also when instances change, and is not freed. No
    /// query may run while a function changes the world.
    fn antumbra_world_bvh(world: &OwnWorld, bvh: Slot<*const Bvh>) {
        bvh.put(std::ptr::from_ref::<Bvh>(&world.world));
        Ok(())
    }

    /// Replaces the list of instances: some may have moved, some be new, some be gone. Builds the nodes above the objects again.
    /// Instances that are as they were cost least. If it fails the world stays as it was.
    ///
    /// Errors: BAD_GEOMETRY if an instance names an object that is not there.
    fn antumbra_world_set_instances(
        world: &mut OwnWorld,
        instances: *const Placed,
        instance_count: usize,
        threads: Place<'_>,
    ) {
        // SAFETY: the header says what is at these addresses.
        let instances = unsafe { Items::new(instances, instance_count, 0, "instances") }?;
        change(world, &[], &instances, threads)
    }

    /// Moves the vertices of some objects, and replaces the list of instances. Object objects[i] takes the vertices of scenes[i], see
    /// antumbra_bvh_refit(). ANTUMBRA_INVALID_ID stands for the ground. If it fails the world stays as it was.
    ///
    /// Errors: as antumbra_bvh_refit() and antumbra_world_set_instances().
    fn antumbra_world_refit(
        world: &mut OwnWorld,
        objects: *const u32,
        scenes: *const *const Scene,
        object_count: usize,
        instances: *const Placed,
        instance_count: usize,
        threads: Place<'_>,
    ) {
        // SAFETY: the header says what is at these addresses.
        let (objects, scenes, instances) = unsafe {
            let objects = Items::new(objects, object_count, 0, "objects")?;
            let scenes = handles(scenes, object_count, "scenes")?;
            (objects, scenes, Items::new(instances, instance_count, 0, "instances")?)
        };
        let moved: Vec<_> = objects.iter().zip(scenes).collect();
        change(world, &moved, &instances, threads)
    }

    /// Adds an object, which no instance places yet, and returns its index. `index` may be NULL.
    fn antumbra_world_add_object(
        world: &mut OwnWorld,
        object: &OwnObject,
        index: MaybeSlot<u32>,
    ) {
        let number = world.world.add_object(&object.object)?;
        if !object.masks.is_empty() {
            world.change_masks(|masks| {
                object_masks(masks, number as usize).clone_from(&object.masks)
            });
        }
        index.put(number);
        Ok(())
    }

    /// Replaces the masks of the geometries of an object, or of the ground with ANTUMBRA_INVALID_ID: see antumbra_bvh_set_masks().
    fn antumbra_world_set_masks(
        world: &mut OwnWorld,
        object: u32,
        masks: *const u32,
        count: usize,
    ) {
        // SAFETY: the header says what is at these addresses.
        let masks = unsafe { Items::new(masks, count, 0, "masks") }?;
        if object != INVALID_ID {
            check_object(world, object)?;
        }
        world.change_masks(|all| match object {
            INVALID_ID => all.world = masks.to_vec(),
            object => *object_masks(all, object as usize) = masks.to_vec(),
        });
        Ok(())
    }

    /// antumbra_bvh_quality() of an object of a world.
    fn antumbra_world_quality(world: &OwnWorld, object: u32, quality: Slot<f64>) {
        check_object(world, object)?;
        quality.put(world.world.quality(object));
        Ok(())
    }
}

frees! {
    /// Frees a world.
    fn antumbra_world_free(world: OwnWorld);
}
