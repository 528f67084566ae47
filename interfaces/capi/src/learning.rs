//! Learning while trees are in use: orders of children that one copy learns and others adopt.

use antumbra::{Bvh, ChildOrder, Ray};

use crate::arrays::{Items, Slot, exclusive, shared, take_back};
use crate::build::list;
use crate::recipe::RecipeChoices;
use crate::status::{Outcome, Status, guarded};
use crate::world::OwnWorld;

/// A place for the order that was learned, if the caller wants it.
///
/// # Safety
/// As [`Slot::handle`].
unsafe fn order_slot(learned: *mut *mut ChildOrder) -> Outcome<Option<Slot<*mut ChildOrder>>> {
    match learned.is_null() {
        true => Ok(None),
        // SAFETY: the caller's promise.
        false => unsafe { Slot::handle(learned, "learned") }.map(Some),
    }
}

/// Learns the child order of a tree again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_bvh_relearn(
    bvh: *mut Bvh,
    rays: *const Ray,
    ray_count: usize,
    ray_stride: usize,
    recipe: *const RecipeChoices,
    learned: *mut *mut ChildOrder,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (slot, bvh, rays, recipe) = unsafe {
            let slot = order_slot(learned)?;
            let rays = Items::new(rays, ray_count, ray_stride, "rays")?;
            let recipe = RecipeChoices::recipe(recipe)?;
            (slot, exclusive(bvh, "bvh")?, rays, recipe)
        };
        let order = bvh.relearn(&list(&rays), &recipe);
        if let Some(slot) = slot {
            slot.give(order);
        }
        Ok(())
    })
}

/// Learns the child order of a world again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_world_relearn(
    world: *mut OwnWorld,
    rays: *const Ray,
    ray_count: usize,
    ray_stride: usize,
    recipe: *const RecipeChoices,
    learned: *mut *mut ChildOrder,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (slot, world, rays, recipe) = unsafe {
            let slot = order_slot(learned)?;
            let rays = Items::new(rays, ray_count, ray_stride, "rays")?;
            let recipe = RecipeChoices::recipe(recipe)?;
            (slot, exclusive(world, "world")?, rays, recipe)
        };
        let order = world.world.relearn(&list(&rays), &recipe);
        if let Some(slot) = slot {
            slot.give(order);
        }
        Ok(())
    })
}

/// Puts a tree in the order that a copy learned.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_bvh_adopt(bvh: *mut Bvh, order: *const ChildOrder) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (bvh, order) = unsafe { (exclusive(bvh, "bvh")?, shared(order, "order")?) };
        bvh.adopt(order);
        Ok(())
    })
}

/// Puts a world in the order that a copy learned.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_world_adopt(
    world: *mut OwnWorld,
    order: *const ChildOrder,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (world, order) = unsafe { (exclusive(world, "world")?, shared(order, "order")?) };
        world.world.adopt(order);
        Ok(())
    })
}

/// Frees an order.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_child_order_free(order: *mut ChildOrder) {
    // SAFETY: the header says what this address is.
    unsafe { take_back(order) }
}

/// Copies a tree.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_bvh_copy(bvh: *const Bvh, copy: *mut *mut Bvh) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (slot, bvh) = unsafe { (Slot::handle(copy, "copy")?, shared(bvh, "bvh")?) };
        slot.give(bvh.clone());
        Ok(())
    })
}

/// Copies a world.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_world_copy(
    world: *const OwnWorld,
    copy: *mut *mut OwnWorld,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (slot, world) = unsafe { (Slot::handle(copy, "copy")?, shared(world, "world")?) };
        slot.give(world.clone());
        Ok(())
    })
}
