//! From the skeleton of a wide tree to its nodes and leaf blocks in memory.

use alloc::borrow::Cow;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

use crate::collapse::skeleton::Skeleton;
use crate::geometry::BLOCK;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::primitives::kinds::for_each_kind;
use crate::geometry::primitives::{PrimKind, Primitives};
use crate::parallel;
use crate::tree::binary::{BinaryKind, BinaryTree};
use crate::tree::leaves::{LeafBlocks, first_block};
use crate::tree::node::{Child, Leaf, Node, NodeMut};
use crate::tree::nodes::Nodes;
use crate::tree::wide::{PlacedTree, Tree};
use crate::tree::width::Width;

/// Nodes or blocks that are written at one go, at least.
const MIN_CHUNK: usize = 256;
/// Pieces in which nodes or blocks are written, at most.
const MAX_CHUNKS: usize = 64;
/// Primitives are fetched from memory this many blocks before they are written.
const AHEAD: usize = 3;

/// The tree of the world or of an object, to be laid out. A part has at least one node.
pub(crate) struct Part<'a> {
    pub primitives: &'a Primitives,
    pub tree: Cow<'a, BinaryTree>,
    pub skeleton: Skeleton,
    /// How often each place of [`BinaryTree::prims`] was hit, if that is known.
    pub prim_hits: Option<Cow<'a, [f32]>>,
}

/// Writes the tree of the world and behind it the trees of the objects that exist. Slots are as the skeletons have
/// them. Primitives of a leaf are sorted by how often they were hit, if that is known. Nodes and blocks of each tree
/// are in visiting order, depth first.
///
/// # Panics
/// If there are more nodes or leaves than child references can name.
pub(crate) fn lay_out(top: &Part, objects: &[Option<Part>], width: Width) -> Tree {
    let plan = Plan::new(top, objects);
    let bounds = top.tree.nodes[0].bounds;
    let deepest = plan.parts[1..].iter().map(|part| part.skeleton.depth());
    let depth = top.skeleton.depth() + deepest.max().unwrap_or(0);
    Tree {
        nodes: plan.nodes(width),
        blocks: plan.all_blocks(),
        filters: Arc::clone(&top.primitives.filters),
        instances: plan.instances,
        roots: plan.roots,
        bounds,
        reach: bounds.reach(),
        depth,
        pick: None,
        motion: None,
    }
}

/// A node or a leaf to be written.
#[derive(Clone, Copy)]
struct Job {
    /// Index of the tree, see [`Plan::parts`].
    part: u32,
    /// The node of the skeleton, or the binary node that is the leaf.
    node: u32,
}

/// Places of everything that is to be written.
struct Plan<'a> {
    /// The tree of the world, then the trees of the objects that exist.
    parts: Vec<&'a Part<'a>>,
    /// The root of each object that exists.
    roots: Vec<u32>,
    /// The root of each object. Without meaning for objects that do not exist.
    object_roots: Vec<u32>,
    nodes: Vec<Job>,
    /// What the occupied slots of all nodes refer to, node after node.
    references: Vec<Child>,
    /// Per node, where its references begin.
    first_references: Vec<u32>,
    /// Leaves of each kind, in the order of [`PrimKind::ALL`]. Without the empty block of triangles.
    leaves: [Vec<Job>; PrimKind::COUNT],
    instances: Vec<PlacedTree>,
}

impl<'a> Plan<'a> {
    fn new(top: &'a Part<'a>, objects: &'a [Option<Part<'a>>]) -> Self {
        let mut plan = Self {
            parts: vec![top],
            roots: Vec::new(),
            object_roots: vec![u32::MAX; objects.len()],
            nodes: Vec::new(),
            references: Vec::new(),
            first_references: Vec::new(),
            leaves: Default::default(),
            instances: Vec::new(),
        };
        let count = plan.place_objects(objects);
        plan.nodes.reserve_exact(count);
        plan.first_references.reserve_exact(count);
        let parts = plan.parts.iter();
        let children = parts.map(|part| part.skeleton.all_children().len()).sum();
        plan.references.reserve_exact(children);
        for part in 0..plan.parts.len() {
            plan.add_part(part);
        }
        assert!(count <= Child::MAX_NODES, "{count} nodes");
        for &kind in PrimKind::ALL {
            let count = plan.leaves[kind as usize].len() + first_block(kind);
            assert!(count <= Child::capacity(kind), "{count} leaves: {kind:?}");
        }
        plan
    }

    /// Puts the trees of objects one behind the other and returns how many nodes there are in all.
    fn place_objects(&mut self, objects: &'a [Option<Part<'a>>]) -> usize {
        let mut end = self.parts[0].skeleton.nodes.len();
        for (object, root) in objects.iter().zip(&mut self.object_roots) {
            if let Some(object) = object {
                *root = end as u32;
                self.roots.push(end as u32);
                self.parts.push(object);
                end += object.skeleton.nodes.len();
            }
        }
        end
    }

    /// Adds the nodes and leaves of a tree.
    fn add_part(&mut self, part: usize) {
        let skeleton = &self.parts[part].skeleton;
        let first = self.nodes.len();
        let order = skeleton.visiting_order();
        let mut places = vec![0; order.len()];
        for (place, &index) in order.iter().enumerate() {
            places[index] = first + place;
        }
        for &index in &order {
            self.first_references.push(self.references.len() as u32);
            for child in skeleton.children(index) {
                let reference = match child.offset {
                    0 => self.add_leaf(part, child.binary),
                    offset => Child::inner(places[index + offset as usize]),
                };
                self.references.push(reference);
            }
            self.nodes.push(Job {
                part: part as u32,
                node: index as u32,
            });
        }
    }

    /// Adds a leaf, which may be an instance.
    fn add_leaf(&mut self, part: usize, leaf: u32) -> Child {
        let Part {
            primitives, tree, ..
        } = self.parts[part];
        let prim = leaf_range(tree, leaf).start;
        let prim = tree.prims[prim] as usize;
        if let Some(placed) = primitives.instance(prim) {
            self.instances.push(PlacedTree {
                placement: placed.placement,
                root: self.object_roots[placed.object as usize],
                object: placed.object,
                world_from_object: placed.world_from_object,
            });
            return Child::instance(self.instances.len() - 1);
        }
        let kind = primitives.kind(prim);
        let leaves = &mut self.leaves[kind as usize];
        leaves.push(Job {
            part: part as u32,
            node: leaf,
        });
        Child::leaf(Leaf {
            kind,
            index: first_block(kind) + leaves.len() - 1,
        })
    }

    /// Writes all nodes.
    fn nodes(&self, width: Width) -> Nodes {
        let count = self.nodes.len();
        macro_rules! write {
            ($Width:ident) => {
                Nodes::$Width(parallel::fill(count, chunk(count), |places, slots| {
                    for place in places {
                        self.write_node(place, slots.push(Node::EMPTY).any_mut());
                    }
                }))
            };
        }
        match width {
            Width::W4 => write!(W4),
            Width::W8 => write!(W8),
            Width::W16 => write!(W16),
        }
    }

    /// Writes a node.
    fn write_node(&self, place: usize, mut node: NodeMut<'_>) {
        let Job { part, node: index } = self.nodes[place];
        let Part { tree, skeleton, .. } = self.parts[part as usize];
        let references = &self.references[self.first_references[place] as usize..];
        let children = skeleton.children(index as usize).iter().zip(references);
        for (slot, (child, reference)) in children.enumerate() {
            node.set(slot, *reference, &tree.nodes[child.binary as usize].bounds);
        }
    }

    /// Writes all leaf blocks.
    fn all_blocks(&self) -> LeafBlocks {
        macro_rules! lists {
            ($(($Kind:ident, $list:ident, $Type:ty, $first:literal))*) => {
                LeafBlocks { $($list: self.blocks(),)* }
            };
        }
        for_each_kind!([lists])
    }

    /// Writes all leaf blocks of one kind.
    fn blocks<B: LeafBlock>(&self) -> Vec<B> {
        let leaves = &self.leaves[B::KIND as usize];
        let first = first_block(B::KIND);
        let count = first + leaves.len();
        parallel::fill(count, chunk(count), |places, slots| {
            for place in places {
                let block = slots.push(B::EMPTY);
                let Some(leaf) = place.checked_sub(first) else {
                    continue;
                };
                if let Some(later) = leaves.get(leaf + AHEAD) {
                    let Part {
                        primitives, tree, ..
                    } = self.parts[later.part as usize];
                    for &prim in &tree.prims[leaf_range(tree, later.node)] {
                        B::prefetch(primitives, prim);
                    }
                }
                let Job { part, node } = leaves[leaf];
                let part = self.parts[part as usize];
                let prims = LeafPrims::new(&part.tree, node, part.prim_hits.as_deref());
                block.fill(part.primitives, prims.as_slice());
            }
        })
    }
}

/// How many of `count` nodes or blocks are written at one go.
fn chunk(count: usize) -> usize {
    count.div_ceil(MAX_CHUNKS).max(MIN_CHUNK)
}

/// The places of [`BinaryTree::prims`] that a leaf owns.
fn leaf_range(tree: &BinaryTree, leaf: u32) -> Range<usize> {
    match tree.nodes[leaf as usize].kind {
        BinaryKind::Leaf { first, count } => first as usize..(first + count) as usize,
        BinaryKind::Inner { .. } => unreachable!("not a leaf"),
    }
}

/// The primitives of a leaf, in the order in which its lanes hold them.
struct LeafPrims {
    prims: [u32; BLOCK],
    len: usize,
}

impl LeafPrims {
    /// Primitives hit more often come first. Without counts of hits, they keep the order of the binary tree.
    fn new(tree: &BinaryTree, leaf: u32, prim_hits: Option<&[f32]>) -> Self {
        let range = leaf_range(tree, leaf);
        let (first, len) = (range.start, range.len());
        let mut prims = [0; BLOCK];
        prims[..len].copy_from_slice(&tree.prims[range.clone()]);
        let hits = |place: usize| prim_hits.map_or(0.0, |hits| hits[place]);
        // Most leaves are visited by no ray of the log.
        if range.into_iter().any(|place| hits(place) > 0.0) {
            let mut places: [usize; BLOCK] = core::array::from_fn(|lane| first + lane);
            places[..len].sort_by(|&a, &b| hits(b).total_cmp(&hits(a)));
            for (prim, place) in prims.iter_mut().zip(&places[..len]) {
                *prim = tree.prims[*place];
            }
        }
        Self { prims, len }
    }

    fn as_slice(&self) -> &[u32] {
        &self.prims[..self.len]
    }
}
