//! Worlds in files: their tree, where its parts are, and the instances.

use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

use super::ground::{self, Ground};
use super::{Joined, World};
use crate::api::bvh::Bvh;
use crate::api::child_order::Ranks;
use crate::api::save::Contents;
use crate::builder::top_level::TopItem;
use crate::error::Error;
use crate::geometry::instance::ObjectShape;
use crate::geometry::primitives::PrimKind;
use crate::geometry::{Functions, Instance};
use crate::tree::node::{Child, ChildKind, Leaf};
use crate::tree::refit::TreePlaces;
use crate::tree::validate::Walked;
use crate::tree::wide::Tree;
use crate::words::{Kind, Sink, Words};

impl Contents for World {
    const KIND: Kind = Kind::World;

    fn tree(&self) -> &Bvh {
        &self.bvh
    }

    fn write_words(&self, sink: &mut Sink<'_>) {
        self.bvh.write_words(sink);
        sink.word(self.top_nodes as u32);
        sink.word(u32::try_from(self.dropped_before).unwrap_or(u32::MAX));
        let all = self.bvh.tree.all_places();
        let first = self.objects.first().map(|object| &object.places);
        let of_ground = all.blocks.iter().enumerate();
        for (kind, blocks) in of_ground {
            let end = first.map_or(blocks.end, |places| places.blocks[kind].start);
            sink.word(end as u32);
        }
        for object in &self.objects {
            for blocks in &object.places.blocks {
                sink.word(blocks.end as u32);
            }
            sink.word(u32::try_from(object.kept).unwrap_or(u32::MAX));
            sink.floats([object.weight]);
            sink.double(object.built_sah);
            object.shape.write(sink);
        }
        sink.word(self.instances.len() as u32);
        for instance in &self.instances {
            sink.word(instance.object);
            for row in instance.transform {
                sink.floats(row);
            }
        }
    }

    fn read_words(words: &mut Words<'_>, functions: &Functions) -> Result<Self, Error> {
        let (bvh, walked) = Bvh::read_tree(words, functions)?;
        let [top_nodes, dropped_before] = words.words()?.map(|count| count as usize);
        let mut ground = read_ground(words, &bvh.tree, top_nodes, &walked)?;
        let ends = core::array::from_fn(|kind| ground.places.blocks[kind].end);
        let objects = read_objects(words, &bvh.tree, ends, &walked)?;
        let all = bvh.primitives + bvh.transparent;
        let of_ground =
            (objects.iter()).try_fold(all, |rest, object| rest.checked_sub(object.kept));
        ground.kept =
            of_ground.ok_or_else(|| words.error("objects have more primitives than the world"))?;
        let count = words.count()?;
        let instances = words.list([], count, |words| {
            let object = words.word()?;
            let transform = [words.floats()?, words.floats()?, words.floats()?];
            if object as usize >= objects.len() {
                return Err(words.error("an instance has no object"));
            }
            Ok(Instance::new(object, transform))
        })?;
        let mut placements = vec![None; instances.len()];
        for placed in &bvh.tree.instances {
            let index = placed.placement.inst_id as usize;
            let object = instances.get(index).map(|instance| instance.object);
            let is_own = |object: u32| objects[object as usize].root() == placed.root;
            if !object.is_some_and(is_own)
                || object != Some(placed.object)
                || placements[index].is_some()
            {
                return Err(words.error("an instance is not where it belongs"));
            }
            placements[index] = Some(placed.placement);
        }
        let world = Self {
            bvh,
            objects,
            top_room: ground.places.nodes.start,
            ground,
            instances,
            placements,
            top_nodes,
            // The top level in the file has this order until instances are set.
            ranks: Ranks::default(),
            dropped_before,
        };
        world.of_own_width()
    }
}

impl World {
    /// The world in the width that suits this CPU: see [`Bvh::read`]. The top level is made again.
    fn of_own_width(mut self) -> Result<Self, Error> {
        let Some(engine) = self.bvh.other_engine() else {
            return Ok(self);
        };
        let subtrees = self.ground.items.iter_mut().filter_map(TopItem::node);
        let mut subtrees: Vec<_> = subtrees.collect();
        let of_ground = subtrees.iter().map(|(index, _)| *index);
        let of_objects = self.objects.iter().map(|object| object.places.nodes.start);
        let roots: Vec<_> = of_ground.chain(of_objects).collect();
        let recollapsed = self.bvh.tree.recollapse(engine.width(), 1, &roots);
        let (of_ground, of_objects) = recollapsed.roots.split_at(subtrees.len());
        for ((_, child), (root, _)) in subtrees.iter_mut().zip(of_ground) {
            **child = Child::inner(*root as usize);
        }
        self.ground.depth = of_ground.iter().map(|(_, depth)| *depth).max().unwrap_or(0);
        let costs: Vec<_> = (self.objects.iter())
            .map(|object| self.bvh.tree.sah_at(&object.places))
            .collect();
        let starts = of_objects.iter().map(|(root, _)| *root as usize);
        let ends = starts.clone().skip(1).chain([recollapsed.nodes.len()]);
        self.ground.places.nodes = 1..starts.clone().next().unwrap_or(recollapsed.nodes.len());
        for ((object, range), (_, depth)) in self
            .objects
            .iter_mut()
            .zip(starts.zip(ends))
            .zip(of_objects)
        {
            object.places.nodes = range.0..range.1;
            object.depth = *depth;
        }
        let others = subtrees.len();
        self.bvh.adopt_nodes(recollapsed, engine, others);
        for (object, before) in self.objects.iter_mut().zip(costs) {
            let now = self.bvh.tree.sah_at(&object.places);
            object.built_sah = object.built_sah.map(|built| built * now / before);
        }
        (self.top_nodes, self.top_room) = (1, 1);
        let instances = self.instances.clone();
        self.place(&instances)?;
        Ok(self)
    }
}

/// The ground is what the top level refers to, but for instances. How many primitives it has is left to the caller.
fn read_ground(
    words: &mut Words<'_>,
    tree: &Tree,
    top_nodes: usize,
    walked: &Walked,
) -> Result<Ground, Error> {
    let end = tree.top_nodes();
    if !(1..=end).contains(&top_nodes) {
        return Err(words.error("the top level is not where it belongs"));
    }
    let start = tree.all_places().blocks.map(|blocks| blocks.start);
    let mut ground = Ground {
        places: read_places(words, tree, 0..end, start)?,
        ..Ground::default()
    };
    let mut first = end;
    for (index, node) in tree.nodes.iter().take(end).enumerate() {
        let is_top = index < top_nodes;
        for slot in 0..node.len() {
            let child = node.child(slot);
            match child.kind() {
                ChildKind::Inner(below) if is_top && below >= top_nodes => {
                    first = first.min(below);
                    ground.depth = ground.depth.max(walked.levels(below));
                }
                ChildKind::Leaf(_) if is_top => {}
                ChildKind::Instance(_) if !is_top => {
                    return Err(words.error("an instance is below the top level"));
                }
                _ => continue,
            }
            ground.items.push(ground::item(child, node.bounds(slot)));
        }
    }
    ground.places.nodes = first..end;
    Ok(ground)
}

/// Places of a tree with these nodes. Its blocks begin where the blocks of the tree before end. Its leaves are among
/// its blocks.
fn read_places(
    words: &mut Words<'_>,
    tree: &Tree,
    nodes: Range<usize>,
    start: [usize; PrimKind::COUNT],
) -> Result<TreePlaces, Error> {
    let end = words.words::<{ PrimKind::COUNT }>()?;
    let end = end.map(|end| end as usize);
    let places = TreePlaces {
        blocks: core::array::from_fn(|kind| start[kind]..end[kind]),
        nodes,
    };
    let all = tree.all_places().blocks;
    let ends = places.blocks.iter().zip(all);
    let mut is_own = ends
        .clone()
        .all(|(own, all)| own.start <= own.end && own.end <= all.end);
    for node in places.nodes.clone().map(|index| tree.nodes.get(index)) {
        for slot in 0..node.len() {
            if let ChildKind::Leaf(Leaf { kind, index }) = node.child(slot).kind() {
                is_own &= places.blocks[kind as usize].contains(&index);
            }
        }
    }
    if is_own {
        Ok(places)
    } else {
        Err(words.error("a leaf belongs to another object"))
    }
}

/// The objects of a world, whose blocks begin where the blocks of the ground end.
fn read_objects(
    words: &mut Words<'_>,
    tree: &Tree,
    mut start: [usize; PrimKind::COUNT],
    walked: &Walked,
) -> Result<Vec<Joined>, Error> {
    let ends = tree.roots.iter().skip(1).map(|root| *root as usize);
    let ends = ends.chain([tree.nodes.len()]);
    let mut objects = Vec::with_capacity(tree.roots.len());
    for (&root, end) in tree.roots.iter().zip(ends) {
        let root = root as usize;
        let places = read_places(words, tree, root..end, start)?;
        start = core::array::from_fn(|kind| places.blocks[kind].end);
        let kept = words.count()?;
        let [weight] = words.floats()?;
        if !(weight > 0.0 && weight.is_finite()) {
            return Err(words.error("an object has no weight"));
        }
        objects.push(Joined {
            kept,
            weight,
            built_sah: words.double()?,
            shape: ObjectShape::read(words, tree.nodes.get(root).all_bounds().reach())?,
            places,
            depth: walked.levels(root),
        });
    }
    Ok(objects)
}
