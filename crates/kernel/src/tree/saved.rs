//! Trees and child orders as words of a file: see [`super::words`].
//!
//! Only what is there is written: occupied slots and lanes. Blocks and nodes are then made as a collapse makes them, so that
//! their empty lanes keep their promises whatever a file says. [`WideTree::validate`] checks the rest.

use alloc::format;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use antumbra_simd::memory::vec_in_huge_pages;

use super::leaves::LeafBlocks;
use super::node::{Child, ChildKind, Node};
use super::rule::Rule;
use super::wide::{PlacedTree, WideTree};
use super::words::{Sink, Words};
use crate::aabb::Aabb;
use crate::error::Error;
use crate::geometry::cutout::Filters;
use crate::geometry::instance::Placement;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::primitives::kinds::for_each_scalar_kind;
use crate::geometry::scalar::{ScalarBlock, ScalarPrim};
use crate::geometry::triangle::TriangleBlock;
use crate::geometry::{BLOCK, PrimRef};

fn write_box(sink: &mut dyn Sink, bounds: &Aabb) {
    sink.floats(&bounds.min);
    sink.floats(&bounds.max);
}

fn read_box(words: &mut Words<'_>) -> Result<Aabb, Error> {
    Ok(Aabb {
        min: words.floats()?,
        max: words.floats()?,
    })
}

fn write_id(sink: &mut dyn Sink, id: PrimRef) {
    sink.word(id.geom_id);
    sink.word(id.prim_id);
}

fn read_id(words: &mut Words<'_>) -> Result<PrimRef, Error> {
    let id = PrimRef {
        geom_id: words.word()?,
        prim_id: words.word()?,
    };
    // Empty lanes have this number.
    if id.prim_id == u32::MAX {
        return Err(words.error("a primitive has no number"));
    }
    Ok(id)
}

/// How many of `most` places are occupied: at least one.
fn read_occupied(words: &mut Words<'_>, most: usize) -> Result<usize, Error> {
    let count = words.word()? as usize;
    if (1..=most).contains(&count) {
        Ok(count)
    } else {
        Err(words.error(format!("a node or leaf has {count} entries")))
    }
}

impl<const N: usize> WideTree<N> {
    /// Writes everything but cut-outs and user geometry.
    pub fn write(&self, sink: &mut dyn Sink) {
        write_box(sink, &self.bounds);
        sink.float(self.reach);
        sink.word(self.roots.len() as u32);
        for &root in &self.roots {
            sink.word(root);
        }
        sink.word(self.nodes.len() as u32);
        for node in &self.nodes {
            sink.word(node.len() as u32);
            for slot in 0..node.len() {
                sink.word(node.child(slot).0);
                write_box(sink, &node.bounds(slot));
            }
            if node.len() == 0 && self.nodes.len() > 1 {
                (0..EMPTY_NODE).for_each(|_| sink.word(0));
            }
        }
        // The first one is empty in every tree.
        let triangles = &self.blocks.triangles[1..];
        write_blocks(sink, triangles, |sink, block, lane| {
            sink.floats(block.triangle(lane).as_flattened());
        });
        macro_rules! write_all {
            ($(($Kind:ident, $list:ident, $Type:ty, $first:literal))*) => {
                $(write_scalars(sink, &self.blocks.$list);)*
            };
        }
        for_each_scalar_kind!([write_all]);
        sink.word(self.instances.len() as u32);
        for placed in &self.instances {
            let place = &placed.placement;
            sink.word(place.inst_id);
            sink.word(placed.root);
            sink.float(place.reach);
            for column in place.object_from_world.iter().chain(&place.planes) {
                sink.floats(&column[..3]);
            }
            sink.floats(placed.world_from_object.as_flattened());
        }
        self.pick.write(sink);
    }

    /// A tree as [`WideTree::write`] wrote it. Its promises remain to be checked by [`WideTree::validate`].
    pub fn read(words: &mut Words<'_>) -> Result<Self, Error> {
        let bounds = read_box(words)?;
        let reach = words.float()?;
        let roots = (0..words.count(1)?)
            .map(|_| words.word())
            .collect::<Result<Vec<_>, _>>()?;
        let mut tree = Self {
            nodes: read_nodes(words)?,
            blocks: read_all_blocks(words)?,
            filters: Arc::new(Filters::default()),
            instances: read_instances(words, &roots)?,
            roots,
            bounds,
            reach,
            depth: 0,
            pick: Rule::Slots,
        };
        tree.pick = Rule::read(words, tree.nodes.len(), N)?;
        tree.depth = (tree.levels()).ok_or_else(|| words.error("a child is missing"))?;
        Ok(tree)
    }

    /// Levels of nodes; `None` if a child does not follow its parent, or an instance has no object.
    pub(crate) fn levels(&self) -> Option<usize> {
        let nodes = self.nodes.len();
        let is_root = |root: &u32| (1..nodes).contains(&(*root as usize));
        if !self.roots.is_sorted_by(|a, b| a < b) || !self.roots.iter().all(is_root) {
            return None;
        }
        let mut levels = vec![1; nodes];
        for (index, node) in self.nodes.iter().enumerate() {
            for slot in 0..node.len() {
                let below = match node.child(slot).kind() {
                    ChildKind::Inner(child) => child,
                    ChildKind::Instance(instance) => {
                        let root = self.instances.get(instance)?.root;
                        self.roots.binary_search(&root).ok()?;
                        root as usize
                    }
                    ChildKind::Leaf(_) => continue,
                };
                if below <= index || below >= nodes {
                    return None;
                }
                levels[below] = levels[below].max(levels[index] + 1);
            }
        }
        levels.into_iter().max()
    }
}

fn read_nodes<const N: usize>(words: &mut Words<'_>) -> Result<Vec<Node<N>>, Error> {
    let count = words.word()? as usize;
    // The root of an empty tree is a word long.
    if count == 1 {
        let mut node = Node::EMPTY;
        read_node(words, &mut node)?;
        return Ok(vec![node]);
    }
    words.check(count, 8)?;
    if count == 0 {
        return Err(words.error("a tree without a root"));
    }
    let mut nodes = vec_in_huge_pages(count);
    for _ in 0..count {
        let mut node = Node::EMPTY;
        read_node(words, &mut node)?;
        if node.len() == 0 {
            for _ in 0..EMPTY_NODE {
                words.word()?;
            }
        }
        nodes.push(node);
    }
    Ok(nodes)
}

/// Words behind a node without children, which is room for others: so that a file is never much smaller than its tree.
const EMPTY_NODE: usize = 7;

fn read_node<const N: usize>(words: &mut Words<'_>, node: &mut Node<N>) -> Result<(), Error> {
    let count = words.word()? as usize;
    if count > N {
        return Err(words.error(format!("a node has {count} children")));
    }
    for slot in 0..count {
        let child = Child(words.word()?);
        if child == Child::EMPTY {
            return Err(words.error("a child is empty"));
        }
        node.set(slot, child, &read_box(words)?);
    }
    Ok(())
}

/// Writes leaf blocks of one kind: per lane the name and then, by `write`, the shape.
fn write_blocks<B: LeafBlock>(
    sink: &mut dyn Sink,
    blocks: &[B],
    write: impl Fn(&mut dyn Sink, &B, usize),
) {
    sink.word(blocks.len() as u32);
    for block in blocks {
        sink.word(block.count() as u32);
        for lane in 0..block.count() {
            write_id(sink, block.id(lane));
            write(sink, block, lane);
        }
    }
}

fn write_scalars<P: ScalarPrim>(sink: &mut dyn Sink, blocks: &[ScalarBlock<P>]) {
    if P::NUMBERS > 0 {
        write_blocks(sink, blocks, |sink, block, lane| {
            sink.floats(&block.prim(lane).numbers()[..P::NUMBERS]);
        });
    }
}

fn read_all_blocks(words: &mut Words<'_>) -> Result<LeafBlocks, Error> {
    macro_rules! read_all {
        ($(($Kind:ident, $list:ident, $Type:ty, $first:literal))*) => {
            LeafBlocks {
                triangles: read_triangles(words)?,
                $($list: read_scalars(words)?,)*
                cutouts: Vec::new(),
            }
        };
    }
    Ok(for_each_scalar_kind!([read_all]))
}

fn read_triangles(words: &mut Words<'_>) -> Result<Vec<TriangleBlock>, Error> {
    let count = words.count(12)?;
    let mut blocks = vec_in_huge_pages(count + 1);
    blocks.push(TriangleBlock::EMPTY);
    for _ in 0..count {
        let mut block = TriangleBlock::EMPTY;
        for lane in 0..read_occupied(words, BLOCK)? {
            let id = read_id(words)?;
            let corners: [[f32; 3]; 3] = [words.floats()?, words.floats()?, words.floats()?];
            if !corners.as_flattened().iter().all(|x| x.is_finite()) {
                return Err(words.error("a triangle is not finite"));
            }
            block.set(lane, &corners, id);
        }
        blocks.push(block);
    }
    Ok(blocks)
}

fn read_scalars<P: ScalarPrim>(words: &mut Words<'_>) -> Result<Vec<ScalarBlock<P>>, Error> {
    if P::NUMBERS == 0 {
        return Ok(Vec::new());
    }
    let count = words.count(3 + P::NUMBERS)?;
    let mut blocks = vec_in_huge_pages(count);
    for _ in 0..count {
        let mut block = ScalarBlock::EMPTY;
        for _ in 0..read_occupied(words, BLOCK)? {
            let id = read_id(words)?;
            let mut numbers = [0.0; 8];
            for number in &mut numbers[..P::NUMBERS] {
                *number = words.float()?;
            }
            let prim = P::from_numbers(numbers);
            block.push(
                prim.map_err(|why| words.error(format!("a primitive is unsound: {why}")))?,
                id,
            );
        }
        blocks.push(block);
    }
    Ok(blocks)
}

fn read_instances(words: &mut Words<'_>, roots: &[u32]) -> Result<Vec<PlacedTree>, Error> {
    let count = words.count(33)?;
    let mut instances = vec_in_huge_pages(count);
    for _ in 0..count {
        let (inst_id, root, reach) = (words.word()?, words.word()?, words.float()?);
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
        let [x, y, z, moved, low, high] = columns;
        instances.push(PlacedTree {
            placement: Placement {
                object_from_world: [x, y, z, moved],
                reach,
                planes: [low, high],
                inst_id,
            },
            root,
            object: roots.partition_point(|before| *before < root) as u32,
            world_from_object,
        });
    }
    Ok(instances)
}
