//! A commit: from the geometries of a scene to trees of the kernel, and back from its numbers to Embree's.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use antumbra::shapes::{Disk, Sphere};
use antumbra::{
    Build, BuildMonitor, Bvh, Geometry as Kernel, Hit, Instance, Masks, Object, Recipe, World,
};

use crate::abi::{
    Bounds, ErrorCode, INVALID, ProgressFunction, RtcRay, SCENE_DYNAMIC, SCENE_ROBUST,
};
use crate::buffer::View;
use crate::curves;
use crate::device::{Callback, Device};
use crate::failure::{Failure, Outcome};
use crate::geometry::{Geometry, Kind, State};
use crate::scene::Scene;
use crate::transform::{self, Rows};
use crate::user::UserShape;

/// What queries of a scene use.
pub struct Committed {
    device: Arc<Device>,
    trees: Trees,
    /// Geometry of the scene itself, by `geom_id` of the kernel.
    ground: Vec<Placed>,
    /// By `inst_id` of the kernel.
    instances: Vec<PlacedInstance>,
    /// Scenes that are instanced.
    objects: Vec<Arc<Committed>>,
    /// Geometries and their versions, disabled ones and instances included.
    seen: Vec<(Arc<Geometry>, u64)>,
    pub traits: Traits,
    bytes: isize,
}

/// The tree of geometry in the scene itself, and one over it and the instances.
struct Trees {
    ground: Object,
    world: Option<World>,
}

/// What geometries of a scene have in common, or at least one of them has.
#[derive(Clone, Copy, Debug)]
pub struct Traits {
    /// Bits that are in the masks of all geometries and instances.
    pub common_mask: u32,
    pub has_intersect_filter: bool,
    pub has_occluded_filter: bool,
    pub takes_argument_filter: bool,
    pub has_user_geometry: bool,
    pub has_curves: bool,
    /// Whether hits at the near end of a ray count: in robust scenes, and on everything but triangles and quads.
    pub near_is_closed: bool,
}

impl Traits {
    /// Of an empty scene.
    const NONE: Self = Self {
        common_mask: u32::MAX,
        has_intersect_filter: false,
        has_occluded_filter: false,
        takes_argument_filter: false,
        has_user_geometry: false,
        has_curves: false,
        near_is_closed: false,
    };

    fn of(placed: &Placed) -> Self {
        let state = &placed.state;
        Self {
            common_mask: state.mask,
            has_intersect_filter: state.intersect_filter.is_some(),
            has_occluded_filter: state.occluded_filter.is_some(),
            takes_argument_filter: state.takes_argument_filter,
            has_user_geometry: placed.geometry.kind == Kind::User,
            has_curves: matches!(placed.geometry.kind, Kind::Curves(_)),
            near_is_closed: !matches!(placed.geometry.kind, Kind::Triangles | Kind::Quads),
        }
    }

    fn and(self, other: Self) -> Self {
        Self {
            common_mask: self.common_mask & other.common_mask,
            has_intersect_filter: self.has_intersect_filter | other.has_intersect_filter,
            has_occluded_filter: self.has_occluded_filter | other.has_occluded_filter,
            takes_argument_filter: self.takes_argument_filter | other.takes_argument_filter,
            has_user_geometry: self.has_user_geometry | other.has_user_geometry,
            has_curves: self.has_curves | other.has_curves,
            near_is_closed: self.near_is_closed | other.near_is_closed,
        }
    }
}

/// A geometry as it was when the scene was committed.
pub struct Placed {
    pub geom_id: u32,
    pub geometry: Arc<Geometry>,
    pub state: State,
}

/// An instance as it was when the scene was committed.
pub struct PlacedInstance {
    /// `geomID` of the instance, which is the `instID` of its hits.
    pub geom_id: u32,
    /// Place in the instance array, and 0 of a single instance.
    pub prim_id: u32,
    pub mask: u32,
    object: usize,
    pub to_world: Rows,
    pub from_world: Option<Rows>,
}

impl Committed {
    #[inline]
    pub fn bvh(&self) -> &Bvh {
        match &self.trees.world {
            Some(world) => world,
            None => &self.trees.ground,
        }
    }

    pub fn bounds(&self) -> Bounds {
        let bounds = self.bvh().bounds();
        Bounds {
            lower: bounds.min,
            align0: 0.0,
            upper: bounds.max,
            align1: 0.0,
        }
    }

    /// Geometry and instance of these numbers of the kernel.
    #[inline]
    pub fn find(&self, inst_id: u32, geom_id: u32) -> (&Placed, Option<&PlacedInstance>) {
        if inst_id == INVALID {
            return (&self.ground[geom_id as usize], None);
        }
        let instance = &self.instances[inst_id as usize];
        let object = &self.objects[instance.object];
        (&object.ground[geom_id as usize], Some(instance))
    }

    /// Whether a hit counts for the mask of a ray and, on curves, by Embree's rule.
    pub fn counts(&self, ray: &RtcRay, hit: &Hit) -> bool {
        let mask = ray.mask;
        let (placed, instance) = self.find(hit.inst_id, hit.geom_id);
        placed.state.mask & mask != 0
            && instance.is_none_or(|instance| instance.mask & mask != 0)
            && curves::counts(placed, instance, ray, hit)
    }

    /// Whether a commit would find what the last one found.
    pub fn is_current(&self) -> bool {
        (self.seen.iter()).all(|(geometry, version)| geometry.version() == *version)
            && self.objects_are_current()
    }

    /// Whether instanced scenes have not been committed again.
    fn objects_are_current(&self) -> bool {
        let instanced = self.seen.iter().filter(|(geometry, _)| {
            matches!(geometry.kind, Kind::Instance | Kind::InstanceArray) && geometry.is_enabled()
        });
        for (geometry, _) in instanced {
            for scene in geometry.state().scenes.iter().flatten() {
                let now = scene.committed_address();
                let is_known = |object: &Arc<Self>| Arc::as_ptr(object) == now;
                if !now.is_null() && !self.objects.iter().any(is_known) {
                    return false;
                }
            }
        }
        true
    }
}

impl Drop for Committed {
    fn drop(&mut self) {
        // A monitor cannot refuse what goes.
        let _ = self.device.count_memory(-self.bytes);
    }
}

/// What a scene has when it is committed.
pub struct Plan {
    pub device: Arc<Device>,
    pub geometries: Vec<(u32, Arc<Geometry>)>,
    pub flags: u32,
    pub quality: u32,
    pub progress: Option<Callback<ProgressFunction>>,
}

impl Plan {
    /// Builds the trees.
    pub fn commit(self, scene: &Scene) -> Outcome<Committed> {
        let mut ground = Vec::new();
        let mut instances = Vec::new();
        let mut seen = Vec::new();
        for (geom_id, geometry) in &self.geometries {
            let state = geometry.state();
            seen.push((Arc::clone(geometry), geometry.version()));
            if !state.is_enabled {
                continue;
            }
            let placed = Placed {
                geom_id: *geom_id,
                geometry: Arc::clone(geometry),
                state,
            };
            match geometry.kind {
                Kind::Instance | Kind::InstanceArray => instances.push(placed),
                _ => ground.push(placed),
            }
        }
        let monitor = Monitor::new(self.progress);
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
        let traits = (ground.iter().map(Traits::of))
            .chain(objects.iter().map(|object| object.traits))
            .chain(placed.iter().map(|instance| Traits {
                common_mask: instance.mask,
                ..Traits::NONE
            }))
            .chain(std::iter::once(Traits {
                near_is_closed: self.flags & SCENE_ROBUST != 0,
                ..Traits::NONE
            }))
            .fold(Traits::NONE, Traits::and);
        let report = object.report();
        let world_bytes = world.as_ref().map_or(0, |world| world.report().bytes);
        let bytes = (report.bytes + world_bytes) as isize;
        self.device.count_memory(bytes)?;
        Ok(Committed {
            device: self.device,
            trees: Trees {
                ground: object,
                world,
            },
            ground,
            instances: placed,
            objects,
            seen,
            traits,
            bytes,
        })
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
        let trees: Vec<&Object> = objects.iter().map(|object| &object.trees.ground).collect();
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
        let count = if is_array {
            state.transforms.as_ref().map_or(0, |view| view.count)
        } else {
            1
        };
        let mut scenes = Vec::new();
        for scene in &state.scenes {
            scenes.push(match scene {
                Some(scene) => Some(self.object(scene, own)?),
                None => None,
            });
        }
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
        if committed.trees.world.is_some() {
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

/// A geometry as the kernel takes it.
fn kernel_geometry(placed: &Placed) -> Kernel<'static> {
    let state = &placed.state;
    match placed.geometry.kind {
        Kind::Triangles => {
            let (positions, indices) = mesh::<3>(state);
            Kernel::triangles(positions, indices)
        }
        Kind::Quads => {
            let (positions, indices) = mesh::<4>(state);
            Kernel::quads(positions, indices)
        }
        Kind::Spheres => {
            let sphere = |[x, y, z, radius]: [f32; 4]| Sphere {
                center: [x, y, z],
                radius,
            };
            let items = state.vertices.iter().flat_map(items);
            Kernel::spheres(items.map(sphere).collect::<Vec<_>>())
        }
        Kind::Disks => {
            let count = state.vertices.as_ref().map_or(0, |view| view.count);
            let disk = |index: usize| {
                let [x, y, z, radius] = state
                    .vertices
                    .as_ref()
                    .map_or([f32::NAN; 4], |v| v.read(index));
                let normal = match &state.normals {
                    Some(normals) if index < normals.count => normals.read(index),
                    _ => [0.0; 3],
                };
                Disk {
                    center: [x, y, z],
                    normal,
                    radius,
                }
            };
            Kernel::disks((0..count).map(disk).collect::<Vec<_>>())
        }
        Kind::Curves(basis) => curves::kernel_curves(basis, state),
        Kind::User => {
            let count = if state.bounds.is_some() {
                state.user_count
            } else {
                0
            };
            Kernel::user(count, Arc::new(UserShape::new(placed)))
        }
        Kind::Instance | Kind::InstanceArray => Kernel::spheres(Vec::new()),
    }
}

/// Items of four numbers.
fn items(view: &View) -> impl Iterator<Item = [f32; 4]> + '_ {
    (0..view.count).map(|index| view.read(index))
}

/// A mesh. Primitives with an index out of range are dropped, as by Embree: their corners are not numbers.
fn mesh<const N: usize>(state: &State) -> (Vec<[f32; 3]>, Vec<[u32; N]>) {
    let vertices = state.vertices.as_ref();
    let count = vertices.map_or(0, |view| view.count);
    let mut positions: Vec<[f32; 3]> = vertices.map_or(Vec::new(), |view| {
        (0..count).map(|index| view.read(index)).collect()
    });
    let nowhere = positions.len() as u32;
    positions.push([f32::NAN; 3]);
    let corners = |index: &View| {
        let all = (0..index.count).map(|prim| index.read::<N, u32>(prim));
        let checked = all.map(|corners| {
            if corners.iter().all(|corner| (*corner as usize) < count) {
                corners
            } else {
                [nowhere; N]
            }
        });
        checked.collect()
    };
    let indices = state.index.as_ref().map_or(Vec::new(), corners);
    (positions, indices)
}

/// Calls the progress function of a scene.
struct Monitor {
    callback: Option<Callback<ProgressFunction>>,
    is_cancelled: AtomicBool,
}

impl Monitor {
    fn new(callback: Option<Callback<ProgressFunction>>) -> Self {
        Self {
            callback,
            is_cancelled: AtomicBool::new(false),
        }
    }
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
