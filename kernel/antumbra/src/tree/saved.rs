//! Trees as words of a file: see [`crate::words`].
//!
//! Only what is there is written: occupied slots and lanes. Blocks and nodes are then made as a collapse makes them, so
//! that their empty lanes keep their promises whatever a file says. [`Tree::walk`] checks the rest, with boxes
//! around leaves that are made while their primitives are available.

use alloc::format;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use super::leaves::LeafBlocks;
use super::node::{Child, ChildKind, Leaf, Node, NodeMut};
use super::nodes::Nodes;
use super::validate::{LeafBoxes, Walked, block_box};
use super::wide::{PlacedTree, Tree};
use super::width::Width;
use crate::aabb::Aabb;
use crate::error::Error;
use crate::geometry::cutout::micromap::MapRef;
use crate::geometry::cutout::saved::{read_names, write_names};
use crate::geometry::cutout::{CutoutBlock, Filters};
use crate::geometry::functions::{Functions, GeometryId};
use crate::geometry::instance::Placement;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::primitives::kinds::for_each_scalar_kind;
use crate::geometry::primitives::{MAX_INSTANCES, PrimKind};
use crate::geometry::scalar::{ScalarBlock, ScalarPrim};
use crate::geometry::triangle::TriangleBlock;
use crate::geometry::user::UserPrim;
use crate::geometry::{BLOCK, PrimRef};
use crate::words::{Sink, Words};

/// Words behind a node without children, which is room for others: so that a file is never much smaller than its tree.
const EMPTY_NODE: usize = 7;

/// Number of a primitive of user geometry that nothing hits, among the shapes of a file.
const NO_SHAPE: u32 = u32::MAX;

impl Tree {
    /// Bytes of memory that a file of the tree takes, at most, without the bytes of shapes and filters.
    pub(crate) fn file_bytes(&self) -> usize {
        self.nodes.len() * 28 * self.width().lanes() / 2
            + self.blocks.triangles.len() * (4 + 44 * BLOCK)
    }

    /// Writes everything but functions.
    pub(crate) fn write(&self, sink: &mut Sink<'_>) {
        write_box(sink, &self.bounds);
        sink.floats([self.reach]);
        sink.word(self.roots.len() as u32);
        for &root in &self.roots {
            sink.word(root);
        }
        sink.word(self.nodes.len() as u32);
        for node in self.nodes.iter() {
            let count = node.len();
            sink.word(count as u32);
            for slot in 0..count {
                let Aabb { min, max } = node.bounds(slot);
                let child = [node.child(slot).0];
                let [[a, b, c], [d, e, f]] = [min, max].map(|corner| corner.map(f32::to_bits));
                sink.words([child[0], a, b, c, d, e, f]);
            }
            if count == 0 && self.nodes.len() > 1 {
                sink.words([0; EMPTY_NODE]);
            }
        }
        // The first one is empty in every tree.
        write_blocks(sink, &self.blocks.triangles[1..], write_triangle);
        macro_rules! write_all {
            ($(($Kind:ident, $list:ident, $Type:ty, $first:literal))*) => {
                $(write_scalars(sink, &self.blocks.$list);)*
            };
        }
        for_each_scalar_kind!([write_all]);
        self.filters.write(sink);
        write_blocks(sink, &self.blocks.cutouts, |sink, block, lane| {
            write_triangle(sink, &block.triangles, lane);
            sink.words([block.maps[lane].number(), block.patterns[lane]]);
        });
        self.write_users(sink);
        sink.word(self.instances.len() as u32);
        for placed in &self.instances {
            let place = &placed.placement;
            sink.words([place.inst_id, placed.root, placed.object]);
            sink.floats([place.reach]);
            for &[x, y, z, _] in place.object_from_world.iter().chain(&place.planes) {
                sink.floats([x, y, z]);
            }
            for row in placed.world_from_object {
                sink.floats(row);
            }
        }
        // Once the number of a rule of picking: orders that look at the ray are not saved.
        sink.word(0);
    }

    /// A tree as [`Tree::write`] wrote it, with these functions, and what was found when it was checked.
    pub(crate) fn read(
        words: &mut Words<'_>,
        width: Width,
        functions: &Functions,
    ) -> Result<(Self, Walked), Error> {
        let bounds = read_box(words)?;
        let [reach] = words.floats()?;
        let count = words.count()?;
        let roots = words.list([], count, Words::word)?;
        let nodes = read_nodes(words, width)?;
        let mut boxes = LeafBoxes::default();
        let mut blocks = read_triangles_and_scalars(words, &mut boxes)?;
        let filters = Filters::read(words, functions)?;
        blocks.cutouts = read_cutouts(words, &filters, &mut boxes)?;
        blocks.users = read_users(words, functions, &mut boxes)?;
        let mut tree = Self {
            nodes,
            blocks,
            filters: Arc::new(filters),
            instances: read_instances(words, &roots)?,
            roots,
            bounds,
            reach,
            depth: 0,
            pick: None,
            motion: None,
        };
        if words.word()? != 0 {
            return Err(words.error("its order looks at the ray"));
        }
        let walked = tree.walk(&boxes).map_err(|broken| words.error(broken))?;
        tree.depth = walked.levels(0);
        Ok((tree, walked))
    }

    /// Writes the names of geometries that have shapes, and primitives, which refer to those by number.
    fn write_users(&self, sink: &mut Sink<'_>) {
        let blocks = &self.blocks.users;
        let objects = self.object_of_users();
        let names = || {
            let lanes = blocks.iter().zip(&objects).flat_map(|(block, &object)| {
                let shapes = (0..block.count()).filter(|&lane| block.prim(lane).has_shape());
                shapes.map(move |lane| GeometryId {
                    object,
                    geom_id: block.id(lane).geom_id,
                })
            });
            let mut names: Vec<_> = lanes.collect();
            names.sort_unstable();
            names.dedup();
            names
        };
        let names = names();
        write_names(sink, names.iter().copied());
        sink.word(blocks.len() as u32);
        for (block, &object) in blocks.iter().zip(&objects) {
            sink.word(block.count() as u32);
            for lane in 0..block.count() {
                let PrimRef { geom_id, prim_id } = block.id(lane);
                let shape = names.binary_search(&GeometryId { object, geom_id });
                let shape = match shape {
                    Ok(shape) if block.prim(lane).has_shape() => shape as u32,
                    _ => NO_SHAPE,
                };
                sink.words([geom_id, prim_id, shape]);
                write_box(sink, &block.bounds(lane));
            }
        }
    }

    /// The object that has a block of user geometry, as users number them; `None` in the world itself.
    fn object_of_users(&self) -> Vec<Option<u32>> {
        let mut objects = vec![None; self.blocks.users.len()];
        if objects.is_empty() || self.roots.is_empty() {
            return objects;
        }
        let mut numbers: Vec<_> = (0..self.roots.len() as u32).collect();
        for placed in &self.instances {
            if let Ok(object) = self.roots.binary_search(&placed.root) {
                numbers[object] = placed.object;
            }
        }
        for (index, node) in self.nodes.iter().enumerate() {
            let tree = self.roots.partition_point(|root| *root as usize <= index);
            for slot in 0..node.len() {
                if let ChildKind::Leaf(Leaf { kind, index }) = node.child(slot).kind()
                    && kind == PrimKind::User
                {
                    objects[index] = tree.checked_sub(1).map(|object| numbers[object]);
                }
            }
        }
        objects
    }
}

fn write_box(sink: &mut Sink<'_>, bounds: &Aabb) {
    sink.floats(bounds.min);
    sink.floats(bounds.max);
}

fn read_box(words: &mut Words<'_>) -> Result<Aabb, Error> {
    let [a, b, c, d, e, f] = words.floats()?;
    Ok(Aabb {
        min: [a, b, c],
        max: [d, e, f],
    })
}

fn read_nodes(words: &mut Words<'_>, width: Width) -> Result<Nodes, Error> {
    Ok(match width {
        Width::W4 => Nodes::W4(read_list(words, Node::EMPTY, Node::any_mut)?),
        Width::W8 => Nodes::W8(read_list(words, Node::EMPTY, Node::any_mut)?),
        Width::W16 => Nodes::W16(read_list(words, Node::EMPTY, Node::any_mut)?),
    })
}

/// Reads nodes of one width, which are `empty` at first.
fn read_list<T: Clone>(
    words: &mut Words<'_>,
    empty: T,
    any: impl Fn(&mut T) -> NodeMut<'_>,
) -> Result<Vec<T>, Error> {
    let all = words.count()?;
    if all == 0 {
        return Err(words.error("a tree without a root"));
    }
    words.list([], all, |words| {
        let mut node = empty.clone();
        read_node(words, any(&mut node), all)?;
        Ok(node)
    })
}

/// Reads one of `all` nodes.
fn read_node(words: &mut Words<'_>, mut node: NodeMut<'_>, all: usize) -> Result<(), Error> {
    let count = words.count()?;
    if count > node.any().width() {
        return Err(words.error(format!("a node has {count} children")));
    }
    for slot in 0..count {
        let [child, planes @ ..] = words.words::<7>()?;
        if Child(child) == Child::EMPTY {
            return Err(words.error("a child is empty"));
        }
        let [a, b, c, d, e, f] = planes.map(f32::from_bits);
        let bounds = Aabb {
            min: [a, b, c],
            max: [d, e, f],
        };
        node.set(slot, Child(child), &bounds);
    }
    // The root of an empty tree is a word long.
    if count == 0 && all > 1 {
        words.words::<EMPTY_NODE>()?;
    }
    Ok(())
}

/// Writes leaf blocks of one kind, lane by lane.
fn write_blocks<B: LeafBlock>(
    sink: &mut Sink<'_>,
    blocks: &[B],
    write: impl Fn(&mut Sink<'_>, &B, usize),
) {
    sink.word(blocks.len() as u32);
    for block in blocks {
        let count = block.count();
        sink.word(count as u32);
        for lane in 0..count {
            write(sink, block, lane);
        }
    }
}

/// Reads leaf blocks of one kind, lane by lane, behind these that are no leaves. Notes the boxes around them.
#[inline(always)]
fn read_blocks<B: LeafBlock>(
    words: &mut Words<'_>,
    first: Option<B>,
    boxes: &mut LeafBoxes,
    read: impl Fn(&mut Words<'_>, &mut B, usize) -> Result<(), Error>,
) -> Result<Vec<B>, Error> {
    let count = words.count()?;
    let boxes = &mut boxes[B::KIND as usize];
    *boxes = words.memory(count.saturating_add(1));
    boxes.extend(first.iter().map(|_| Aabb::EMPTY));
    words.list(first, count, |words| {
        let mut block = B::EMPTY;
        let count = words.count()?;
        if !(1..=BLOCK).contains(&count) {
            return Err(words.error(format!("a leaf has {count} primitives")));
        }
        for lane in 0..count {
            read(words, &mut block, lane)?;
        }
        boxes.push(block_box(&block));
        Ok(block)
    })
}

fn write_triangle(sink: &mut Sink<'_>, block: &TriangleBlock, lane: usize) {
    let PrimRef { geom_id, prim_id } = block.id(lane);
    let [[a, b, c], [d, e, f], [g, h, i]] =
        (block.triangle(lane)).map(|corner| corner.map(f32::to_bits));
    sink.words([geom_id, prim_id, a, b, c, d, e, f, g, h, i]);
}

#[inline(always)]
fn read_triangle(
    words: &mut Words<'_>,
    block: &mut TriangleBlock,
    lane: usize,
) -> Result<(), Error> {
    /// The exponent of what is infinite or NaN.
    const NOT_FINITE: u32 = 0x7f80_0000;
    let [geom_id, prim_id, corners @ ..] = words.words::<11>()?;
    // Without an early end the compiler tests several at a time.
    let is_not_finite = |bits: &u32| bits & NOT_FINITE == NOT_FINITE;
    if corners
        .iter()
        .fold(false, |any, bits| any | is_not_finite(bits))
    {
        return Err(words.error("a triangle is not finite"));
    }
    let [a, b, c, d, e, f, g, h, i] = corners.map(f32::from_bits);
    let id = checked_id(words, geom_id, prim_id)?;
    block.set(lane, &[[a, b, c], [d, e, f], [g, h, i]], id);
    Ok(())
}

#[inline(always)]
fn checked_id(words: &Words<'_>, geom_id: u32, prim_id: u32) -> Result<PrimRef, Error> {
    // Empty lanes have this number.
    if prim_id == u32::MAX {
        return Err(words.error("a primitive has no number"));
    }
    Ok(PrimRef { geom_id, prim_id })
}

fn read_triangles_and_scalars(
    words: &mut Words<'_>,
    boxes: &mut LeafBoxes,
) -> Result<LeafBlocks, Error> {
    let first = Some(TriangleBlock::EMPTY);
    let triangles = read_blocks(words, first, boxes, read_triangle)?;
    macro_rules! read_all {
        ($(($Kind:ident, $list:ident, $Type:ty, $first:literal))*) => {
            LeafBlocks {
                triangles,
                $($list: read_scalars(words, boxes)?,)*
                cutouts: Vec::new(),
            }
        };
    }
    Ok(for_each_scalar_kind!([read_all]))
}

fn write_scalars<P: ScalarPrim>(sink: &mut Sink<'_>, blocks: &[ScalarBlock<P>]) {
    if P::NUMBERS > 0 {
        write_blocks(sink, blocks, |sink, block, lane| {
            let PrimRef { geom_id, prim_id } = block.id(lane);
            sink.words([geom_id, prim_id]);
            for &number in &block.prim(lane).numbers()[..P::NUMBERS] {
                sink.floats([number]);
            }
        });
    }
}

fn read_scalars<P: ScalarPrim>(
    words: &mut Words<'_>,
    boxes: &mut LeafBoxes,
) -> Result<Vec<ScalarBlock<P>>, Error> {
    if P::NUMBERS == 0 {
        return Ok(Vec::new());
    }
    read_blocks(
        words,
        None,
        boxes,
        |words, block: &mut ScalarBlock<P>, _| {
            let [geom_id, prim_id] = words.words()?;
            let id = checked_id(words, geom_id, prim_id)?;
            let mut numbers = [0.0; 8];
            for number in &mut numbers[..P::NUMBERS] {
                [*number] = words.floats()?;
            }
            let prim = P::from_numbers(numbers);
            let prim = prim.map_err(|why| words.error(format!("a primitive is unsound: {why}")))?;
            block.push(prim, id);
            Ok(())
        },
    )
}

fn read_cutouts(
    words: &mut Words<'_>,
    filters: &Filters,
    boxes: &mut LeafBoxes,
) -> Result<Vec<CutoutBlock>, Error> {
    read_blocks(
        words,
        None,
        boxes,
        |words, block: &mut CutoutBlock, lane| {
            read_triangle(words, &mut block.triangles, lane)?;
            let [map, pattern] = words.words()?;
            let map = MapRef::of_number(map);
            if !filters.knows(map, pattern) {
                return Err(words.error("a filter is missing"));
            }
            block.maps[lane] = map;
            block.patterns[lane] = pattern;
            Ok(())
        },
    )
}

fn read_users(
    words: &mut Words<'_>,
    functions: &Functions,
    boxes: &mut LeafBoxes,
) -> Result<Vec<ScalarBlock<UserPrim>>, Error> {
    let names = read_names(words)?;
    let shapes = functions.shapes_of(&names)?;
    read_blocks(
        words,
        None,
        boxes,
        |words, block: &mut ScalarBlock<_>, _| {
            let [geom_id, prim_id, shape] = words.words()?;
            let id = checked_id(words, geom_id, prim_id)?;
            let bounds = read_box(words)?;
            let found = shapes.get(shape as usize);
            let prim = UserPrim::saved(found.cloned(), bounds);
            match prim.filter(|_| found.is_some() || shape == NO_SHAPE) {
                Some(prim) => block.push(prim, id),
                None => return Err(words.error("a primitive of user geometry is unsound")),
            }
            Ok(())
        },
    )
}

fn read_instances(words: &mut Words<'_>, roots: &[u32]) -> Result<Vec<PlacedTree>, Error> {
    let count = words.count()?;
    words.list([], count, |words| {
        let [inst_id, root, object] = words.words()?;
        let [reach] = words.floats()?;
        let mut columns = [[0.0; 4]; 6];
        for column in &mut columns {
            let [x, y, z] = words.floats()?;
            *column = [x, y, z, 0.0];
        }
        let world_from_object = [words.floats()?, words.floats()?, words.floats()?];
        let placing = columns.as_flattened().iter();
        let numbers = placing.chain(world_from_object.as_flattened());
        if !numbers.chain([&reach]).all(|x| x.is_finite()) {
            return Err(words.error("an instance is not finite"));
        }
        if inst_id as usize >= MAX_INSTANCES || roots.binary_search(&root).is_err() {
            return Err(words.error("an instance has no number or no object"));
        }
        let [x, y, z, moved, low, high] = columns;
        Ok(PlacedTree {
            placement: Placement {
                object_from_world: [x, y, z, moved],
                reach,
                planes: [low, high],
                inst_id,
            },
            root,
            object,
            world_from_object,
        })
    })
}
