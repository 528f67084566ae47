//! Objects that are placed, and move.

mod ground;
mod learned;
mod saved;

use alloc::vec;
use alloc::vec::Vec;
use core::fmt;
use core::ops::Deref;

use self::ground::Ground;
use super::bvh::Bvh;
use super::child_order::Ranks;
use super::object::Object;
use crate::INVALID_ID;
use crate::builder::top_level::{TopChild, TopItem, TopLevel, instance_weight};
use crate::error::Error;
use crate::geometry::instance::{ObjectShape, Placement};
use crate::geometry::masks::Masks;
use crate::geometry::moved::Moved;
use crate::geometry::primitives::{INSTANCE_BYTES, MAX_INSTANCES, Primitives};
use crate::geometry::{Geometry, Instance};
use crate::parallel::map;
use crate::trace::engine::Engine;
use crate::tree::node::Child;
use crate::tree::refit::TreePlaces;
use crate::tree::wide::{PlacedTree, Tree};

/// From this many instances on it pays to prepare an object for them.
const MANY: usize = 32;

/// Instances that one thread places at a time, at least.
const CHUNK: usize = 256;

/// A scene of objects placed by [`Instance`]s, which may move. Of a scene in which nothing moves [`Bvh::build`] makes a
/// tree, from [`Primitives::with_instances`](crate::Primitives::with_instances).
///
/// Moving, adding and removing instances builds the top level from scratch, which is the nodes above the objects, and
/// nothing else. So does [refitting](World::refit) objects, beside the objects themselves. Answers equal the answers of
/// such a tree, bit for bit.
///
/// A world keeps copies of the trees of its objects: they are built once for all worlds, and copied once for each.
/// Wherever it takes an object, `Object`, `&Object` and `Arc<Object>` are alike. A world is used as the [`Bvh`] over
/// everything, which answers queries.
///
/// ```
/// use antumbra::{Geometry, Instance, Object, Ray, Recipe, World};
///
/// let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
/// let leaf = Object::build(&geometry, &Recipe::default())?;
///
/// let place = |x| Instance::new(0, [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);
/// let mut world = World::new(&[&leaf], &[place(0.0), place(5.0)])?;
/// let ray = Ray::new([7.2, 0.2, 0.0], [0.0, 0.0, 1.0]);
/// assert_eq!(world.intersect(&ray), None);
///
/// world.set_instances(&[place(0.0), place(7.0), place(9.0)])?;
/// let hit = world.intersect(&ray).expect("it moved there");
/// assert_eq!(hit.inst_id, 1);
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone)]
pub struct World {
    bvh: Bvh,
    objects: Vec<Joined>,
    ground: Ground,
    instances: Vec<Instance>,
    /// Per instance; `None` if it is dropped.
    placements: Vec<Option<Placement>>,
    /// Nodes of the top level.
    top_nodes: usize,
    /// Number of nodes that the top level has room for, before the nodes of the ground and the objects.
    top_room: usize,
    /// What the top level learned.
    ranks: Ranks,
    /// Primitives that were dropped when objects were built.
    dropped_before: usize,
}

/// An object whose tree was copied into the world's.
#[derive(Clone, Debug)]
struct Joined {
    places: TreePlaces,
    shape: ObjectShape,
    /// Primitives that a refit must find sound.
    kept: usize,
    /// Weight of an instance of the object in the top level.
    weight: f32,
    depth: usize,
    /// Expected cost before the first refit.
    built_sah: Option<f64>,
}

impl World {
    /// Stands for the ground where [`World::refit`] wants the index of an object.
    pub const GROUND: u32 = INVALID_ID;

    /// Places objects. An instance names its object by the place in `objects`.
    ///
    /// Queries run on the instruction set of the first object.
    ///
    /// # Errors
    /// An index of an object out of range; more instances, nodes or leaves than can be numbered; objects of different
    /// [widths](crate::recipe::Engine::width); [`Error::Moves`] for an instance that moves while rays are traced.
    pub fn new(objects: &[impl AsRef<Object>], instances: &[Instance]) -> Result<Self, Error> {
        Self::put_together(None, objects, instances)
    }

    /// Places objects on a ground: geometry that lies in the world itself. Hits of the ground have the `inst_id`
    /// [`INVALID_ID`].
    ///
    /// # Errors
    /// As [`World::new`].
    pub fn on_ground(
        ground: impl AsRef<Object>,
        objects: &[impl AsRef<Object>],
        instances: &[Instance],
    ) -> Result<Self, Error> {
        Self::put_together(Some(ground.as_ref()), objects, instances)
    }

    /// The instances as they were given last.
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }

    /// Replaces the list of instances: some may have moved, some be new, some be gone. The place in the list is the
    /// `inst_id`. Instances that are as they were at the same place cost least.
    ///
    /// ```
    /// # use std::sync::Arc;
    /// # use antumbra::{Geometry, Instance, Object, Ray, Recipe, World};
    /// # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
    /// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
    /// # let object = Arc::new(Object::build(&geometry, &Recipe::default())?);
    /// let at = |x| Instance::new(0, [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);
    /// let mut world = World::new(&[object], &[at(0.0)])?;
    /// world.set_instances(&[at(5.0), at(9.0)])?;
    /// let hit = world.intersect(&Ray::new([9.2, 0.2, 0.0], [0.0, 0.0, 1.0]));
    /// assert_eq!(hit.map(|hit| hit.inst_id), Some(1));
    /// # Ok::<(), antumbra::Error>(())
    /// ```
    ///
    /// # Errors
    /// An index of an object out of range; more instances or nodes than can be numbered; an instance that moves while rays
    /// are traced. All stays as it is then.
    pub fn set_instances(&mut self, instances: &[Instance]) -> Result<(), Error> {
        self.refit(&[], instances)
    }

    /// Moves the vertices of some objects, each given by its index and by the geometries that it was built over with
    /// other vertices, and replaces the list of instances. See [`Bvh::refit`]. The index of the ground is [`World::GROUND`];
    /// without a ground, it has no primitives. If an object is given twice, the last one counts.
    ///
    /// # Errors
    /// As [`Bvh::refit`] and [`World::set_instances`], and [`Error::ObjectOutOfRange`] for an index of an object that
    /// is out of range. All stays as it is then.
    pub fn refit(
        &mut self,
        objects: &[(u32, &[Geometry<'_>])],
        instances: &[Instance],
    ) -> Result<(), Error> {
        self.check_instances(instances)?;
        let moved = self.check_moved(objects)?;
        self.refit_objects(&moved);
        self.place(instances)
    }

    /// Adds an object, which no instance places yet, and returns its index.
    ///
    /// # Errors
    /// More nodes or leaves than can be numbered; an object of another width. All stays as it is then.
    pub fn add_object(&mut self, object: impl AsRef<Object>) -> Result<u32, Error> {
        self.join(object.as_ref(), Some(self.objects.len() as u32))
    }

    /// Adds an object, or the ground, which has no number.
    fn join(&mut self, object: &Object, number: Option<u32>) -> Result<u32, Error> {
        let places = self.bvh.tree.join(&object.tree, number)?;
        self.bvh.tree.roots.push(places.nodes.start as u32);
        self.count(object);
        self.objects.push(Joined::new(object, places));
        Ok(self.objects.len() as u32 - 1)
    }

    /// Gives masks to the ground (`world`), to objects in the order in which they joined, and to instances: see
    /// [`Bvh::set_masks`]. They stay when instances change, and go by their numbers.
    pub fn set_masks(&mut self, masks: Masks) {
        self.bvh.set_masks(masks);
    }

    /// [Quality](crate::BuildReport::quality) of an object: its expected cost now over its expected cost when it was built.
    ///
    /// # Panics
    /// If there is no such object.
    pub fn quality(&self, object: u32) -> f64 {
        let object = &self.objects[object as usize];
        let now = |places| self.bvh.tree.sah_at(places);
        object
            .built_sah
            .map_or(1.0, |built| now(&object.places) / built)
    }

    fn put_together(
        ground: Option<&Object>,
        objects: &[impl AsRef<Object>],
        instances: &[Instance],
    ) -> Result<Self, Error> {
        let objects = || objects.iter().map(AsRef::as_ref);
        let first = ground.or(objects().next());
        let engine = first.map_or_else(Engine::default, |object| object.engine);
        let trees = ground.into_iter().chain(objects());
        let trees: Vec<_> = trees.map(|object| &object.tree).collect();
        let tree = Tree::with_room_for(engine.width(), &trees);
        let mut world = Self {
            bvh: Bvh::fresh(tree, engine, &Primitives::default()),
            objects: Vec::new(),
            ground: Ground::default(),
            instances: Vec::new(),
            placements: Vec::new(),
            top_nodes: 1,
            top_room: 1,
            ranks: Ranks::default(),
            dropped_before: 0,
        };
        if let Some(ground) = ground {
            world.add_ground(ground, instances.len())?;
        }
        for object in objects() {
            world.add_object(object)?;
        }
        world.set_instances(instances)?;
        Ok(world)
    }

    /// Adds the ground, for this number of instances.
    fn add_ground(&mut self, ground: &Object, instances: usize) -> Result<(), Error> {
        self.join(ground, None)?;
        // No object after all: it lies in the world itself.
        let joined = self.objects.pop().expect("it has just joined");
        self.bvh.tree.roots.clear();
        self.ground = Ground::new(&mut self.bvh.tree, joined, instances);
        Ok(())
    }

    /// Counts an object that joins.
    fn count(&mut self, object: &Object) {
        let (own, other) = (&mut self.bvh, object);
        own.primitives += other.primitives;
        own.cutouts += other.cutouts;
        own.transparent += other.transparent;
        self.dropped_before += other.dropped;
        own.dropped += other.dropped;
    }

    fn check_instances(&self, instances: &[Instance]) -> Result<(), Error> {
        if instances.len() > MAX_INSTANCES {
            return Err(Error::TooMany {
                what: "instances",
                found: instances.len(),
                limit: MAX_INSTANCES,
            });
        }
        Error::if_no_memory("instances", instances.len(), INSTANCE_BYTES)?;
        let why = "an instance in a world of objects cannot move while rays are traced";
        (instances.iter()).try_for_each(|instance| instance.stands_still(why))?;
        let named = instances.iter().map(|instance| instance.object);
        (0u32..)
            .zip(named)
            .try_for_each(|(inst_id, object)| self.check_object(inst_id, object))
    }

    fn check_object(&self, inst_id: u32, object: u32) -> Result<(), Error> {
        if (object as usize) < self.objects.len() {
            return Ok(());
        }
        Err(Error::ObjectOutOfRange {
            inst_id,
            object,
            objects: self.objects.len(),
        })
    }

    /// What moves, once each, in the order of the tree.
    fn check_moved<'a>(
        &self,
        objects: &[(u32, &'a [Geometry<'a>])],
    ) -> Result<Vec<(u32, Moved<'a>)>, Error> {
        let mut moved: Vec<_> = objects.to_vec();
        moved.reverse();
        // The ground comes before all objects.
        moved.sort_by_key(|(object, _)| object.wrapping_add(1));
        moved.dedup_by_key(|(object, _)| *object);
        for (object, _) in &moved {
            if *object != Self::GROUND {
                self.check_object(INVALID_ID, *object)?;
            }
        }
        let checked = map(moved.len(), 1, |index| {
            let (object, geometries) = moved[index];
            let (places, kept) = self.places_of(object);
            let moved = Moved::new(geometries, kept)?;
            self.bvh.tree.check_moved(places, &moved)?;
            Ok((object, moved))
        });
        checked.into_iter().collect()
    }

    /// Places of an object or of the ground in the tree, and how many sound primitives it has.
    fn places_of(&self, object: u32) -> (&TreePlaces, usize) {
        match object {
            Self::GROUND => (&self.ground.places, self.ground.kept),
            _ => {
                let joined = &self.objects[object as usize];
                (&joined.places, joined.kept)
            }
        }
    }

    fn refit_objects(&mut self, moved: &[(u32, Moved<'_>)]) {
        if moved.is_empty() {
            return;
        }
        let jobs = (moved.iter())
            .map(|(object, moved)| (self.places_of(*object).0.clone(), *moved))
            .collect::<Vec<_>>();
        let (objects, ground) = (&mut self.objects, &mut self.ground);
        let moved: Vec<_> = moved.iter().map(|(object, _)| *object).collect();
        let tree = &mut self.bvh.tree;
        for &object in moved.iter().filter(|object| **object != Self::GROUND) {
            let Joined {
                places, built_sah, ..
            } = &mut objects[object as usize];
            built_sah.get_or_insert_with(|| tree.sah_at(places));
        }
        tree.refit(&jobs);
        let shapes = map(moved.len(), 1, |index| {
            let joined = objects.get(moved[index] as usize)?;
            let bounds = tree.nodes.get(joined.places.nodes.start).all_bounds();
            Some(ObjectShape::around(
                &bounds,
                tree.prim_bounds(&joined.places),
            ))
        });
        for (object, shape) in moved.iter().zip(shapes) {
            match shape {
                Some(shape) => objects[*object as usize].shape = shape,
                None => ground.measure(tree),
            }
        }
        for (instance, placement) in self.instances.iter().zip(&mut self.placements) {
            let place = instance.object.wrapping_add(1);
            let found = moved.binary_search_by_key(&place, |object| object.wrapping_add(1));
            if found.is_ok() {
                *placement = None;
            }
        }
    }

    /// Prepares objects that are placed many times.
    fn expect(&mut self, instances: &[Instance]) {
        let mut counts = vec![0; self.objects.len()];
        for instance in instances {
            counts[instance.object as usize] += 1;
        }
        for (object, count) in self.objects.iter_mut().zip(counts) {
            if count >= MANY {
                object.shape.expect_many();
            }
        }
    }

    /// Makes the top level for instances that have been checked.
    fn place(&mut self, instances: &[Instance]) -> Result<(), Error> {
        self.expect(instances);
        let placements = map(instances.len(), CHUNK, |index| {
            let instance = &instances[index];
            if let Some(Some(placement)) = self.placements.get(index)
                && self.instances[index] == *instance
            {
                return Some(*placement);
            }
            let shape = &self.objects[instance.object as usize].shape;
            Placement::new(&instance.transform, shape, index as u32)
        });
        let mut items = self.ground.items.clone();
        items.reserve(instances.len());
        for (index, placement) in placements.iter().enumerate() {
            if let Some(placement) = placement {
                items.push(TopItem {
                    bounds: placement.bounds(),
                    weight: self.objects[instances[index].object as usize].weight,
                    child: TopChild::Instance(index as u32),
                });
            }
        }
        let ranks = (self.ranks).of(self.ground.items.len(), instances.len());
        let tree = &mut self.bvh.tree;
        let top = TopLevel::new(&items, &ranks, tree.width());
        if top.nodes.len() > self.top_room {
            let room = TopLevel::most_nodes(items.len()).min(2 * top.nodes.len());
            let by = room - self.top_room;
            let found = tree.nodes.len() + by;
            if found > Child::MAX_NODES {
                return Err(Error::TooMany {
                    what: "nodes",
                    found,
                    limit: Child::MAX_NODES,
                });
            }
            tree.make_room(self.top_room, by);
            self.top_room = room;
            for object in &mut self.objects {
                let nodes = &mut object.places.nodes;
                *nodes = nodes.start + by..nodes.end + by;
            }
            self.ground.move_back(by);
            return self.place(instances);
        }
        let placed = top.instances.iter().map(|&index| PlacedTree {
            placement: placements[index as usize].expect("dropped ones are no items"),
            root: self.objects[instances[index as usize].object as usize].root(),
            object: instances[index as usize].object,
            world_from_object: instances[index as usize].transform,
        });
        tree.set_top(&top.nodes, self.top_nodes, placed);
        self.top_nodes = top.nodes.len();
        tree.bounds = top.bounds;
        tree.reach = top.bounds.reach();
        let deepest = self.objects.iter().map(|object| object.depth);
        tree.depth = top.depth + deepest.max().unwrap_or(0).max(self.ground.depth);
        // An order that is looked up by node knows nothing of the new ones.
        tree.pick = None;
        let dropped = placements.iter().filter(|placement| placement.is_none());
        self.bvh.dropped = self.dropped_before + dropped.count();
        self.bvh.renew_masks();
        self.placements = placements;
        self.instances.clear();
        self.instances.extend_from_slice(instances);
        Ok(())
    }
}

impl Deref for World {
    type Target = Bvh;

    fn deref(&self) -> &Bvh {
        &self.bvh
    }
}

impl Joined {
    fn new(object: &Object, places: TreePlaces) -> Self {
        Self {
            places,
            shape: object.shape().clone(),
            kept: object.primitives + object.transparent,
            weight: instance_weight(object.primitives),
            depth: object.tree.depth,
            built_sah: object.built_sah,
        }
    }

    fn root(&self) -> u32 {
        self.places.nodes.start as u32
    }
}

/// Copies an object into a tree.
impl fmt::Debug for World {
    /// Counts, not contents.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("World")
            .field("objects", &self.objects.len())
            .field("instances", &self.instances.len())
            .field("bvh", &self.bvh)
            .finish_non_exhaustive()
    }
}
