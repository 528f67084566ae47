//! Learning while trees are in use: orders of children that one copy learns and others adopt.

use antumbra::{Bvh, ChildOrder, Ray, Recipe};

use crate::arrays::{Handle, Items};
use crate::interface::{frees, functions};
use crate::world::OwnWorld;

functions! {
    /// Learns the child order again, for the rays of today, on the calling thread. Answers stay. Takes some ten milliseconds for a
    /// few thousand rays. Of the recipe, which may be NULL, the order and the seed count. `learned` may be NULL; otherwise it takes
    /// the order, which belongs to the caller.
    ///
    /// To learn beside frames, give antumbra_bvh_copy() to a thread of its own, and adopt what it learned between two frames.
    fn antumbra_bvh_relearn(
        bvh: &mut Bvh,
        rays: *const Ray,
        ray_count: usize,
        ray_stride: usize,
        recipe: Recipe,
        learned: Option<Handle<ChildOrder>>,
    ) {
        // SAFETY: the header says what is at these addresses.
        let rays = unsafe { Items::new(rays, ray_count, ray_stride, "rays") }?;
        let order = bvh.relearn(&rays.all(), &recipe);
        if let Some(learned) = learned {
            learned.give(order);
        }
        Ok(())
    }

    /// Puts children in the order that a copy of this tree learned, in about a tenth of a millisecond. Answers stay. Both may have
    /// been refitted since they were copied. The order of another tree changes nothing that matters.
    fn antumbra_bvh_adopt(bvh: &mut Bvh, order: &ChildOrder) {
        bvh.adopt(order);
        Ok(())
    }

    /// Copies a tree. User geometry and opacities are shared by the copies: what `release` of them frees lives as long as the last.
    fn antumbra_bvh_copy(bvh: &Bvh, copy: Handle<Bvh>) {
        copy.give(bvh.clone());
        Ok(())
    }

    /// antumbra_bvh_relearn() for a world. Where instances change, the nodes above objects keep the order by the places of instances
    /// in the list.
    fn antumbra_world_relearn(
        world: &mut OwnWorld,
        rays: *const Ray,
        ray_count: usize,
        ray_stride: usize,
        recipe: Recipe,
        learned: Option<Handle<ChildOrder>>,
    ) {
        // SAFETY: the header says what is at these addresses.
        let rays = unsafe { Items::new(rays, ray_count, ray_stride, "rays") }?;
        let order = world.world.relearn(&rays.all(), &recipe);
        if let Some(learned) = learned {
            learned.give(order);
        }
        Ok(())
    }

    /// antumbra_bvh_adopt() for a world. The nodes above objects take the order when instances are set next.
    fn antumbra_world_adopt(world: &mut OwnWorld, order: &ChildOrder) {
        world.world.adopt(order);
        Ok(())
    }

    /// Copies a world, with its masks.
    fn antumbra_world_copy(world: &OwnWorld, copy: Handle<OwnWorld>) {
        copy.give(world.clone());
        Ok(())
    }
}

frees! {
    /// Frees an order.
    fn antumbra_child_order_free(order: ChildOrder);
}
