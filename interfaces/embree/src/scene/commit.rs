//! A commit: from the geometries of a scene to trees of the kernel.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use antumbra::{Build, BuildMonitor, Instance, Masks, Object, Recipe, World};

use super::Scene;
use super::committed::{Committed, Placed, PlacedInstance, Traits};
use super::shapes::kernel_geometry;
use crate::abi::{ErrorCode, ProgressFunction, SCENE_DYNAMIC, SCENE_ROBUST};
use crate::device::{Callback, Device, Failure, Outcome, lock};
use crate::geometry::{Geometry, Kind, transform};

impl Scene {
    /// Commits, if anything has changed. Another thread that commits is waited for.
    pub fn commit(&self) -> Outcome {
        let _held = lock(&self.commit);
        let (plan, was_modified) = {
            let mut state = lock(&self.state);
            let plan = Plan {
                device: Arc::clone(&self.device),
                geometries: state.geometries.clone().into_iter().collect(),
                flags: state.flags,
                quality: state.quality,
                progress: state.progress,
            };
            (plan, std::mem::take(&mut state.is_modified))
        };
        // SAFETY: as in `committed`; the lock of commits is held.
        let now = unsafe { self.committed.load(Ordering::Acquire).as_ref() };
        if !was_modified && now.is_some_and(|now| now.is_current()) {
            return Ok(());
        }
        match plan.commit(self) {
            Ok(committed) => {
                let new = Arc::into_raw(Arc::new(committed)).cast_mut();
                let mut retired = lock(&self.retired);
                let old = self.committed.swap(new, Ordering::AcqRel);
                // SAFETY: the pointer came from `into_raw` here.
                let old = (!old.is_null()).then(|| unsafe { Arc::from_raw(old) });
                let last = std::mem::replace(&mut *retired, old);
                // What is dropped may call the monitor of memory, and may be the last holder of other scenes.
                drop(retired);
                drop(last);
                Ok(())
            }
            Err(failure) => {
                lock(&self.state).is_modified = true;
                Err(failure)
            }
        }
    }
}

/// What a scene has when it is committed.
struct Plan {
    device: Arc<Device>,
    geometries: Vec<(u32, Arc<Geometry>)>,
    flags: u32,
    quality: u32,
    progress: Option<Callback<ProgressFunction>>,
}

impl Plan {
    /// Builds the trees.
    fn commit(self, scene: &Scene) -> Outcome<Committed> {
        let seen = self.geometries.iter();
        let seen = seen.map(|(_, geometry)| (Arc::clone(geometry), geometry.version()));
        let seen = seen.collect();
        let (instances, ground) = self.placed();
        let monitor = Monitor {
            callback: self.progress,
            is_cancelled: AtomicBool::new(false),
        };
        let geometries: Vec<_> = ground.iter().map(kernel_geometry).collect();
        let recipe = self.recipe(&ground);
        let build = Build::new(&geometries[..])
            .recipe(&recipe)
            .monitor(&monitor);
        monitor.progress(0.0);
        let object = self.device.install(|| build.object())?;
        drop(geometries);
        let mut all = Instances::default();
        for placed in &instances {
            all.add(placed, scene)?;
        }
        let Instances { placed, objects } = all;
        let world = match placed.is_empty() {
            true => None,
            false => Some(self.world(&object, &placed, &objects, &ground)?),
        };
        monitor.progress(1.0);
        if monitor.cancelled() {
            return Err(antumbra::Error::Cancelled.into());
        }
        let is_robust = self.flags & SCENE_ROBUST != 0;
        let own = Traits::new(u32::MAX, &[(Traits::NEAR_IS_CLOSED, is_robust)]);
        let traits = (ground.iter().map(Traits::of))
            .chain(objects.iter().map(|object| object.traits))
            .chain((placed.iter()).map(|instance| Traits::new(instance.mask, &[])))
            .fold(own, Traits::and);
        let world_bytes = world.as_ref().map_or(0, |world| world.report().bytes);
        let bytes = (object.report().bytes + world_bytes) as isize;
        self.device.count_memory(bytes)?;
        Ok(Committed {
            device: self.device,
            object,
            world,
            ground,
            instances: placed,
            objects,
            seen,
            traits,
            bytes,
        })
    }

    /// What is enabled: instances, and the others.
    fn placed(&self) -> (Vec<Placed>, Vec<Placed>) {
        let placed = (self.geometries.iter()).map(|(geom_id, geometry)| Placed {
            geom_id: *geom_id,
            geometry: Arc::clone(geometry),
            state: geometry.state(),
        });
        let enabled = placed.filter(|placed| placed.state.is_enabled);
        enabled.partition(|placed| placed.geometry.kind.is_instance())
    }

    /// How trees are built. Answers are the same by every recipe.
    fn recipe(&self, ground: &[Placed]) -> Recipe {
        let is_quick = self.quality == 0 || self.flags & SCENE_DYNAMIC != 0;
        // Training rays would call functions of the client outside of any query.
        let has_functions = ground
            .iter()
            .any(|placed| placed.geometry.kind == Kind::User);
        let recipe = match is_quick || has_functions {
            true => Recipe::fast(),
            false => Recipe::default(),
        };
        match self.device.isa() {
            Some(isa) => recipe.isa(isa),
            None => recipe,
        }
    }

    /// A world of the scene and its instances, with all masks.
    fn world(
        &self,
        object: &Object,
        placed: &[PlacedInstance],
        objects: &[Arc<Committed>],
        ground: &[Placed],
    ) -> Outcome<World> {
        let trees: Vec<&Object> = objects.iter().map(|object| &object.object).collect();
        let instances: Vec<Instance> = (placed.iter())
            .map(|instance| Instance::new(instance.object as u32, instance.to_world))
            .collect();
        let mut world = (self.device).install(|| World::on_ground(object, &trees, &instances))?;
        let masks = |ground: &[Placed]| ground.iter().map(|placed| placed.state.mask).collect();
        world.set_masks(
            Masks::new()
                .world(masks(ground))
                .objects(objects.iter().map(|object| masks(&object.ground)).collect())
                .instances(placed.iter().map(|instance| instance.mask).collect()),
        );
        Ok(world)
    }
}

/// Instances, and the scenes that they place, each once.
#[derive(Default)]
struct Instances {
    placed: Vec<PlacedInstance>,
    objects: Vec<Arc<Committed>>,
}

impl Instances {
    fn add(&mut self, placed: &Placed, own: &Scene) -> Outcome {
        let state = &placed.state;
        let is_array = placed.geometry.kind == Kind::InstanceArray;
        let count = match is_array {
            true => state.transforms.as_ref().map_or(0, |view| view.count),
            false => 1,
        };
        let object = |scene: &Option<Arc<Scene>>| {
            let scene = scene.as_ref();
            scene.map(|scene| self.object(scene, own)).transpose()
        };
        let scenes = (state.scenes.iter().map(object)).collect::<Outcome<Vec<_>>>()?;
        if self.placed.try_reserve(count).is_err() {
            let text = format!("not enough memory for {count} instances");
            return Err(Failure::new(ErrorCode::OutOfMemory, text));
        }
        for prim in 0..count {
            let which = match (&state.index, is_array) {
                (Some(index), true) if prim < index.count => index.read::<1, u32>(prim)[0] as usize,
                (Some(_), true) => continue,
                _ => 0,
            };
            // Places without a scene are empty.
            let Some(&Some(object)) = scenes.get(which) else {
                continue;
            };
            let to_world = placed.geometry.transform_at(state, prim)?;
            self.placed.push(PlacedInstance {
                geom_id: placed.geom_id,
                prim_id: prim as u32,
                mask: state.mask,
                object,
                to_world,
                from_world: transform::inverse(&to_world),
            });
        }
        Ok(())
    }

    /// Place of a scene in the list.
    fn object(&mut self, scene: &Arc<Scene>, own: &Scene) -> Outcome<usize> {
        if std::ptr::eq(Arc::as_ptr(scene), own) {
            return Err(Failure::operation(
                "a scene cannot be an instance of itself",
            ));
        }
        let committed = (scene.committed_arc())
            .ok_or_else(|| Failure::operation("an instanced scene is not committed"))?;
        if committed.world.is_some() {
            return Err(Failure::operation(
                "instances in instanced scenes are not supported: there is one level",
            ));
        }
        let is_it = |object: &Arc<Committed>| Arc::ptr_eq(object, &committed);
        if let Some(place) = self.objects.iter().position(is_it) {
            return Ok(place);
        }
        self.objects.push(committed);
        Ok(self.objects.len() - 1)
    }
}

/// Calls the progress function of a scene.
struct Monitor {
    callback: Option<Callback<ProgressFunction>>,
    is_cancelled: AtomicBool,
}

impl BuildMonitor for Monitor {
    fn progress(&self, done: f32) {
        if let Some(Callback { function, user }) = self.callback {
            // SAFETY: the client gave the function with this pointer, for any thread.
            if !unsafe { function(user, f64::from(done)) } {
                self.is_cancelled.store(true, Ordering::Relaxed);
            }
        }
    }

    fn cancelled(&self) -> bool {
        self.is_cancelled.load(Ordering::Relaxed)
    }
}
