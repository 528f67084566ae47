//! Builds: from scenes to trees and objects, with progress, cancelling and threads.

use std::borrow::Cow;
use std::ffi::c_void;

use antumbra::inputs::Source;
use antumbra::{Build, BuildMonitor, Bvh, Error, Masks, Object, Primitives, Ray, Recipe};

use crate::arrays::{Handle, Items, Slot, Versioned, handles, sized};
use crate::interface::{frees, functions};
use crate::recipe::RecipeChoices;
use crate::scene::Scene;
use crate::status::Outcome;
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

/// Options of a build, checked.
pub struct Prepared<'a> {
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
    pub unsafe fn new(options: *const BuildOptions) -> Outcome<Self> {
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
            rays: rays.all(),
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

/// An object and the masks of its geometries, `antumbra_object`.
pub struct OwnObject {
    pub object: Object,
    pub masks: Vec<u32>,
}

impl OwnObject {
    /// An object whose geometries have all bits.
    pub fn new(object: Object) -> Self {
        let masks = Vec::new();
        Self { object, masks }
    }
}

functions! {
    /// Builds a tree over a scene. An empty scene is fine. `options` may be NULL.
    ///
    /// Errors: INVALID_ARGUMENT, BAD_GEOMETRY, TOO_MANY, NO_MEMORY, CANCELLED.
    fn antumbra_bvh_build(scene: &Scene, options: Prepared<'_>, bvh: Handle<Bvh>) {
        let geometries = scene.geometries();
        let mut built = options.run((&geometries).into(), Build::bvh)?;
        let masks = scene.masks();
        if !masks.is_empty() {
            built.set_masks(Masks::new().world(masks));
        }
        bvh.give(built);
        Ok(())
    }

    /// Builds one tree over a ground, objects and their instances, none of which will move. Learns all levels together, so it
    /// answers faster than a world, and takes longer to build. `ground` may be NULL. Hits of instance i have the inst_id i.
    ///
    /// Errors: as antumbra_bvh_build(); BAD_GEOMETRY if an instance names an object that is not there.
    fn antumbra_bvh_build_instances(
        ground: Option<&Scene>,
        objects: *const *const Scene,
        object_count: usize,
        instances: *const Placed,
        instance_count: usize,
        options: Prepared<'_>,
        bvh: Handle<Bvh>,
    ) {
        // SAFETY: the header says what is at these addresses.
        let (objects, instances) = unsafe {
            let objects = handles(objects, object_count, "objects")?;
            (objects, Items::new(instances, instance_count, 0, "instances")?)
        };
        let geometries = ground.map(Scene::geometries).unwrap_or_default();
        let of_objects: Vec<_> = objects.iter().map(|scene| scene.geometries()).collect();
        let (placed, instance_masks) = instances_of(&instances)?;
        let primitives = Primitives::with_instances(&geometries, &of_objects, &placed)?;
        let mut built = options.run((&primitives).into(), Build::bvh)?;
        let masks = Masks::new()
            .world(ground.map(Scene::masks).unwrap_or_default())
            .objects(objects.iter().map(|scene| scene.masks()).collect())
            .instances(instance_masks);
        if has_masks(&masks) {
            built.set_masks(masks);
        }
        bvh.give(built);
        Ok(())
    }

    /// Builds an object. `options` may be NULL. Errors: as antumbra_bvh_build().
    fn antumbra_object_build(scene: &Scene, options: Prepared<'_>, object: Handle<OwnObject>) {
        let geometries = scene.geometries();
        let (built, masks) = (options.run((&geometries).into(), Build::object)?, scene.masks());
        object.give(OwnObject {
            object: built,
            masks,
        });
        Ok(())
    }

    /// Lends the tree of an object, in its own space and without masks. It lives as long as the object, and is not freed.
    fn antumbra_object_bvh(object: &OwnObject, bvh: Slot<*const Bvh>) {
        bvh.put(std::ptr::from_ref::<Bvh>(&object.object));
        Ok(())
    }
}

frees! {
    /// Frees a tree. Not for trees that antumbra_world_bvh() or antumbra_object_bvh() lent.
    fn antumbra_bvh_free(bvh: Bvh);
    /// Frees an object. Worlds that it joined keep what they have.
    fn antumbra_object_free(object: OwnObject);
}
