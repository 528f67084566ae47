//! Trees: what they are, masks, and vertices that change.

use antumbra::{Bvh, Masks};

use crate::arrays::{Items, Slot, Versioned, exclusive, shared};
use crate::functions::Box3;
use crate::scene::Scene;
use crate::status::{Failure, Status, guarded};
use crate::threads::{Place, Threads};

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

/// Returns what was built.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_bvh_report(bvh: *const Bvh, report: *mut Report) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (bvh, slot) = unsafe { (shared(bvh, "bvh")?, Slot::new(report, "report")?) };
        let built = bvh.report();
        let mut level = [0; 16];
        for (to, from) in level[..15].iter_mut().zip(bvh.isa().level().name().bytes()) {
            *to = from;
        }
        slot.put(Report {
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
    })
}

/// Returns the smallest box around everything, and the origin offset.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_bvh_bounds(
    bvh: *const Bvh,
    bounds: *mut Box3,
    origin_offset: *mut f32,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (bvh, bounds, offset) = unsafe {
            let offset = Slot::optional(origin_offset, "origin_offset")?;
            (
                shared(bvh, "bvh")?,
                Slot::optional(bounds, "bounds")?,
                offset,
            )
        };
        let found = bvh.bounds();
        if let Some(bounds) = bounds {
            let (min, max) = (found.min, found.max);
            bounds.put(Box3 { min, max });
        }
        if let Some(offset) = offset {
            offset.put(found.origin_offset());
        }
        Ok(())
    })
}

/// Replaces the masks of all geometries.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_bvh_set_masks(
    bvh: *mut Bvh,
    masks: *const u32,
    count: usize,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (bvh, masks) = unsafe {
            let masks = Items::new(masks, count, 0, "masks")?;
            (exclusive(bvh, "bvh")?, masks)
        };
        if bvh.report().instances > 0 {
            let text = "a tree with instances takes its masks from scenes and instances";
            return Err(Failure::new(Status::Unsupported, text));
        }
        bvh.set_masks(Masks::new().world(masks.to_vec()));
        Ok(())
    })
}

/// Moves the primitives of a tree.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_bvh_refit(
    bvh: *mut Bvh,
    scene: *const Scene,
    threads: *const Threads,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (bvh, scene, place) = unsafe {
            let place = Place::of(threads)?;
            (exclusive(bvh, "bvh")?, shared(scene, "scene")?, place)
        };
        let geometries = scene.geometries();
        Ok(place.run(|| bvh.refit(&geometries))?)
    })
}

/// Returns what a ray costs now over what it cost when the tree was built.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_bvh_quality(bvh: *const Bvh, quality: *mut f64) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (bvh, slot) = unsafe { (shared(bvh, "bvh")?, Slot::new(quality, "quality")?) };
        slot.put(bvh.report().quality);
        Ok(())
    })
}
