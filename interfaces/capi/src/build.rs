//! Builds: from scenes to trees and objects, with progress, cancelling and threads.

use std::borrow::Cow;
use std::ffi::c_void;

use antumbra::inputs::Source;
use antumbra::{Build, BuildMonitor, Bvh, Error, Masks, Object, Primitives, Ray, Recipe};

use crate::arrays::{Items, Slot, Versioned, handles, optional, shared, sized, take_back};
use crate::recipe::RecipeChoices;
use crate::scene::Scene;
use crate::status::{Outcome, Status, guarded};
use crate::threads::{Place, Threads};
use crate::world::{Placed, has_masks, instances_of};

type Progress = extern "C" fn(*mut c_void, f32);
type Cancelled = extern "C" fn(*mut c_void) -> i32;

/// Options of a build, `antumbra_build`.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct BuildOptions {
    pub size: usize,
    pub recipe: *const RecipeChoices,
    pub rays: *const Ray,
    pub ray_count: usize,
    pub ray_stride: usize,
    pub data: *mut c_void,
    pub progress: Option<Progress>,
    pub cancelled: Option<Cancelled>,
    pub threads: *const Threads,
}

// SAFETY: `repr(C)`, the size first, and then numbers and pointers, which are only used as the header says.
unsafe impl Versioned for BuildOptions {
    const NAME: &'static str = "antumbra_build";
}

/// Options of a build that nobody chose.
const NOTHING_SAID: BuildOptions = BuildOptions {
    size: size_of::<BuildOptions>(),
    recipe: std::ptr::null(),
    rays: std::ptr::null(),
    ray_count: 0,
    ray_stride: 0,
    data: std::ptr::null_mut(),
    progress: None,
    cancelled: None,
    threads: std::ptr::null(),
};

/// Callbacks of a build.
struct Monitor {
    data: *mut c_void,
    progress: Option<Progress>,
    cancelled: Option<Cancelled>,
}

// SAFETY: the library never looks at what `data` points to. The header says that callbacks are called from any thread.
unsafe impl Sync for Monitor {}

impl BuildMonitor for Monitor {
    fn progress(&self, done: f32) {
        if let Some(progress) = self.progress {
            progress(self.data, done);
        }
    }

    fn cancelled(&self) -> bool {
        self.cancelled
            .is_some_and(|cancelled| cancelled(self.data) != 0)
    }
}

/// Rays of the caller as a list: where they are, or copied.
pub fn list<'a>(rays: &Items<'a, Ray>) -> Cow<'a, [Ray]> {
    (rays.as_slice()).map_or_else(|| Cow::Owned(rays.to_vec()), Cow::Borrowed)
}

/// Options of a build, checked.
struct Prepared<'a> {
    recipe: Recipe,
    rays: Cow<'a, [Ray]>,
    monitor: Monitor,
    place: Place<'a>,
}

impl<'a> Prepared<'a> {
    /// Checks options; null is for the default.
    ///
    /// # Safety
    /// If the pointer is not null, it is of a structure as the header says.
    unsafe fn new(options: *const BuildOptions) -> Outcome<Self> {
        let options = match options.is_null() {
            true => NOTHING_SAID,
            // SAFETY: the caller's promise.
            false => unsafe { sized(options, "options") }?,
        };
        let (count, stride) = (options.ray_count, options.ray_stride);
        // SAFETY: as above, for what the options point to.
        let (recipe, rays, place) = unsafe {
            let rays = Items::new(options.rays, count, stride, "rays")?;
            let recipe = RecipeChoices::recipe(options.recipe)?;
            (recipe, rays, Place::of(options.threads)?)
        };
        let monitor = Monitor {
            data: options.data,
            progress: options.progress,
            cancelled: options.cancelled,
        };
        Ok(Self {
            recipe,
            rays: list(&rays),
            monitor,
            place,
        })
    }

    /// Runs a build over a source.
    fn run<'s, T: Send>(
        &'s self,
        source: Source<'s>,
        build: impl FnOnce(Build<'s>) -> Result<T, Error> + Send,
    ) -> Outcome<T> {
        let options = Build::new(source)
            .recipe(&self.recipe)
            .rays(&self.rays)
            .monitor(&self.monitor);
        Ok(self.place.run(|| build(options))?)
    }
}

/// Builds a tree over a scene.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_bvh_build(
    scene: *const Scene,
    options: *const BuildOptions,
    bvh: *mut *mut Bvh,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (scene, options, slot) = unsafe {
            let slot = Slot::handle(bvh, "bvh")?;
            (shared(scene, "scene")?, Prepared::new(options)?, slot)
        };
        let geometries = scene.geometries();
        let mut bvh = options.run((&geometries).into(), Build::bvh)?;
        let masks = scene.masks();
        if !masks.is_empty() {
            bvh.set_masks(Masks::new().world(masks));
        }
        slot.give(bvh);
        Ok(())
    })
}

/// Builds a tree over a ground, objects and their instances, none of which moves.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_bvh_build_instances(
    ground: *const Scene,
    objects: *const *const Scene,
    object_count: usize,
    instances: *const Placed,
    instance_count: usize,
    options: *const BuildOptions,
    bvh: *mut *mut Bvh,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (slot, ground, objects, instances, options) = unsafe {
            let slot = Slot::handle(bvh, "bvh")?;
            let instances = Items::new(instances, instance_count, 0, "instances")?;
            let objects = handles(objects, object_count, "objects")?;
            let ground = optional(ground, "ground")?;
            (slot, ground, objects, instances, Prepared::new(options)?)
        };
        let geometries = ground.map(Scene::geometries).unwrap_or_default();
        let of_objects: Vec<_> = objects.iter().map(|scene| scene.geometries()).collect();
        let (placed, instance_masks) = instances_of(&instances)?;
        let primitives = Primitives::with_instances(&geometries, &of_objects, &placed)?;
        let mut bvh = options.run((&primitives).into(), Build::bvh)?;
        let masks = Masks::new()
            .world(ground.map(Scene::masks).unwrap_or_default())
            .objects(objects.iter().map(|scene| scene.masks()).collect())
            .instances(instance_masks);
        if has_masks(&masks) {
            bvh.set_masks(masks);
        }
        slot.give(bvh);
        Ok(())
    })
}

/// An object and the masks of its geometries, `antumbra_object`.
pub struct OwnObject {
    pub object: Object,
    pub masks: Vec<u32>,
}

/// Builds an object over a scene.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_object_build(
    scene: *const Scene,
    options: *const BuildOptions,
    object: *mut *mut OwnObject,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (scene, options, slot) = unsafe {
            let slot = Slot::handle(object, "object")?;
            (shared(scene, "scene")?, Prepared::new(options)?, slot)
        };
        let geometries = scene.geometries();
        let object = options.run((&geometries).into(), Build::object)?;
        let masks = scene.masks();
        slot.give(OwnObject { object, masks });
        Ok(())
    })
}

/// Frees a tree.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_bvh_free(bvh: *mut Bvh) {
    // SAFETY: the header says that a handle is freed once.
    unsafe { take_back(bvh) }
}

/// Frees an object.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_object_free(object: *mut OwnObject) {
    // SAFETY: the header says that a handle is freed once.
    unsafe { take_back(object) }
}

/// The tree of an object.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_object_bvh(
    object: *const OwnObject,
    bvh: *mut *const Bvh,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (object, slot) = unsafe { (shared(object, "object")?, Slot::new(bvh, "bvh")?) };
        slot.put(std::ptr::from_ref::<Bvh>(&object.object));
        Ok(())
    })
}
