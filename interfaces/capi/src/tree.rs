//! Trees: what they are, masks, and vertices that change.

use antumbra::{Bvh, Masks};

use crate::arrays::{Items, MaybeSlot, Slot, Versioned};
use crate::functions::Box3;
use crate::interface::functions;
use crate::scene::Scene;
use crate::status::{Failure, Status};
use crate::threads::Place;

/// What was built, `antumbra_report`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Report {
    pub size: usize,
    pub primitives: usize,
    pub cutouts: usize,
    pub instances: usize,
    pub objects: usize,
    pub dropped: usize,
    pub transparent: usize,
    pub nodes: usize,
    pub leaves: usize,
    pub depth: usize,
    pub bytes: usize,
    pub training_rays: u64,
    pub sah: f64,
    pub width: u32,
    pub prefetches: u32,
    pub level: [u8; 16],
}

// SAFETY: `repr(C)`, the size first, and then numbers.
unsafe impl Versioned for Report {
    const NAME: &'static str = "antumbra_report";
}

functions! {
    /// Returns what was built.
    fn antumbra_bvh_report(bvh: &Bvh, report: Slot<Report>) {
        let built = bvh.report();
        let mut level = [0; 16];
        for (to, from) in level[..15].iter_mut().zip(bvh.isa().level().name().bytes()) {
            *to = from;
        }
        report.put(Report {
            size: size_of::<Report>(),
            primitives: built.primitives,
            cutouts: built.cutouts,
            instances: built.instances,
            objects: built.objects,
            dropped: built.dropped,
            transparent: built.transparent,
            nodes: built.nodes,
            leaves: built.leaves,
            depth: built.depth,
            bytes: built.bytes,
            training_rays: built.training_rays,
            sah: built.sah,
            width: bvh.width().lanes() as u32,
            prefetches: built.prefetches.into(),
            level,
        });
        Ok(())
    }

    /// Returns the smallest box around everything, empty for an empty tree, and the distance from a surface at which rays that
    /// leave it should begin. Rays that begin nearer have exact answers too, but take longer. Both may be NULL.
    fn antumbra_bvh_bounds(bvh: &Bvh, bounds: MaybeSlot<Box3>, origin_offset: MaybeSlot<f32>) {
        let found = bvh.bounds();
        let (min, max) = (found.min, found.max);
        bounds.put(Box3 { min, max });
        origin_offset.put(found.origin_offset());
        Ok(())
    }

    /// Replaces the masks of all geometries of a tree: mask i belongs to geometry i. Geometries behind the last mask have all bits.
    /// Files do not hold masks, so loaded trees need them again.
    ///
    /// Errors: UNSUPPORTED if the tree has instances.
    fn antumbra_bvh_set_masks(bvh: &mut Bvh, masks: *const u32, count: usize) {
        // SAFETY: the header says what is at these addresses.
        let masks = unsafe { Items::new(masks, count, 0, "masks") }?;
        if bvh.report().instances > 0 {
            let text = "a tree with instances takes its masks from scenes and instances";
            return Err(Failure::new(Status::Unsupported, text));
        }
        bvh.set_masks(Masks::new().world(masks.to_vec()));
        Ok(())
    }

    /// Moves the primitives of a tree. `scene` has the geometries of the build with other vertices: see
    /// antumbra_scene_set_positions(). Far cheaper than a build. Answers equal the answers of a new tree, bit for bit. A refit keeps the
    /// nodes, so queries become slower the more the primitives move: see antumbra_bvh_quality(). Masks stay.
    ///
    /// Errors: OTHER_GEOMETRY if other primitives can be hit than at the build; UNSUPPORTED if the tree has instances.
    fn antumbra_bvh_refit(bvh: &mut Bvh, scene: &Scene, threads: Place<'_>) {
        let geometries = scene.geometries();
        Ok(threads.run(|| bvh.refit(&geometries))?)
    }

    /// Returns the expected cost of a ray now over that before the first refit. Build again from about 1.5 on.
    fn antumbra_bvh_quality(bvh: &Bvh, quality: Slot<f64>) {
        quality.put(bvh.report().quality);
        Ok(())
    }
}
