//! A check of every promise of a wide tree that traversal relies on.
//!
//! One function per promise, named for it. Each returns the first place where it finds the promise broken.
//!
//! [`Tree::walk`] is one pass over the nodes, which also files are worth. It checks all that queries, refits and learning
//! rely on to end without a panic: with it, boxes hold what is below them, so rays find what is there. [`Tree::validate`]
//! checks as well what needs every primitive to be looked up among all others.

use alloc::format;
use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;

use super::leaves::on_each_kind;
use super::node::{Child, ChildKind, Leaf};
use super::wide::Tree;
use crate::aabb::Aabb;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::primitives::PrimKind;

/// Nothing, or which promise is broken where.
type Verdict = Result<(), String>;

/// Fails with a message unless the promise holds.
#[inline(always)]
fn promise(holds: bool, broken: impl FnOnce() -> String) -> Verdict {
    if holds { Ok(()) } else { Err(broken()) }
}

/// Boxes around all leaf blocks, by kind and index.
pub(crate) type LeafBoxes = [Vec<Aabb>; PrimKind::COUNT];

/// The box around all primitives of a block.
#[inline(always)]
pub(crate) fn block_box<B: LeafBlock>(block: &B) -> Aabb {
    let mut bounds = Aabb::EMPTY;
    for (axis, [low, high]) in block.planes().iter_mut().enumerate() {
        // Empty lanes are NaN and come last, so the first one of a pair stays.
        for half in [4, 2, 1] {
            for lane in 0..half {
                let [first, other] = [low[lane], low[lane + half]];
                low[lane] = if other < first { other } else { first };
                let [first, other] = [high[lane], high[lane + half]];
                high[lane] = if other > first { other } else { first };
            }
        }
        bounds.min[axis] = low[0];
        bounds.max[axis] = high[0];
    }
    bounds
}

impl Tree {
    /// Checks every promise that traversal relies on. Returns how many primitives are in leaves, those in several of them
    /// counted once.
    ///
    /// # Errors
    /// The first broken promise, in words.
    pub(crate) fn validate(&self) -> Result<usize, String> {
        self.block_of_empty_slots_is_empty()?;
        self.empty_slots_follow_occupied_ones()?;
        let mut boxes = LeafBoxes::default();
        on_each_kind!(self, blocks => note_boxes(blocks, &mut boxes));
        let walked = self.walk(&boxes)?;
        self.stack_is_deep_enough(&walked)?;
        self.filters_are_there()?;
        self.primitives_are_whole()
    }

    /// Walks all nodes and checks every promise that keeps queries from panicking or running for ever, and boxes. Takes boxes
    /// around leaf blocks. Whether the parts of primitives that are in several leaves make a whole is left to
    /// [`Tree::primitives_are_whole`].
    ///
    /// # Errors
    /// The first broken promise, in words.
    pub(crate) fn walk(&self, leaves: &LeafBoxes) -> Result<Walked, String> {
        self.objects_have_roots()?;
        self.extent_holds_all_coordinates()?;
        let mut walk = Walk::new(self, leaves);
        // Children follow their parents, so they come first.
        for tree in (0..=self.roots.len()).rev() {
            let start = match tree {
                0 => 0,
                object => self.roots[object - 1] as usize,
            };
            let end = self
                .roots
                .get(tree)
                .map_or(self.nodes.len(), |root| *root as usize);
            for index in (start..end).rev() {
                walk.check_node(index, tree, end)?;
            }
        }
        walk.everything_has_one_parent()?;
        Ok(walk.walked)
    }

    /// How many primitives are in leaves, those in several of them counted once, of a tree that was walked.
    ///
    /// # Errors
    /// As [`Tree::primitives_are_whole`], if any primitive sticks out of the box of its leaf.
    pub(crate) fn count_primitives(&self, walked: &Walked) -> Result<usize, String> {
        if walked.some_stick_out {
            return self.primitives_are_whole();
        }
        let mut count = 0;
        on_each_kind!(self, blocks => count += blocks.iter().map(LeafBlock::count).sum::<usize>());
        Ok(count)
    }

    fn block_of_empty_slots_is_empty(&self) -> Verdict {
        let block = self.blocks.triangles.first();
        promise(block.is_some_and(|block| block.count() == 0), || {
            "triangle block 0 is not empty".into()
        })
    }

    fn empty_slots_follow_occupied_ones(&self) -> Verdict {
        for (index, node) in self.nodes.iter().enumerate() {
            for slot in node.len()..node.width() {
                let is_empty = node.child(slot) == Child::EMPTY && node.bounds(slot) == Aabb::EMPTY;
                promise(is_empty, || {
                    format!(
                        "{}: an empty slot before an occupied one, or with a box",
                        Place { index, slot }
                    )
                })?;
            }
        }
        Ok(())
    }

    fn objects_have_roots(&self) -> Verdict {
        let is_there = |root: &u32| (1..self.nodes.len()).contains(&(*root as usize));
        promise(
            self.roots.is_sorted_by(|a, b| a < b) && self.roots.iter().all(is_there),
            || "objects are not in order".into(),
        )?;
        for (index, instance) in self.instances.iter().enumerate() {
            promise(self.roots.binary_search(&instance.root).is_ok(), || {
                format!("instance {index} does not place an object")
            })?;
        }
        Ok(())
    }

    fn stack_is_deep_enough(&self, walked: &Walked) -> Verdict {
        let depth = walked.levels(0);
        promise(depth <= self.depth, || {
            format!("{depth} levels, but the stack is sized for {}", self.depth)
        })
    }

    fn extent_holds_all_coordinates(&self) -> Verdict {
        let extent = self.bounds.reach();
        promise(extent <= self.reach, || {
            format!("the scene extent is {extent}, not {}", self.reach)
        })
    }

    /// Every partly transparent triangle has a filter and an opacity micromap.
    fn filters_are_there(&self) -> Verdict {
        for (index, block) in self.blocks.cutouts.iter().enumerate() {
            let is_known = |lane: usize| self.filters.knows(block.maps[lane], block.patterns[lane]);
            promise((0..block.count()).all(is_known), || {
                format!("leaf {index} of cut-outs: a filter is missing")
            })?;
        }
        Ok(())
    }

    /// All primitives are in the boxes of their leaves, and never twice in one. Returns how many there are.
    ///
    /// # Errors
    /// The first broken promise, in words.
    fn primitives_are_whole(&self) -> Result<usize, String> {
        let mut shares = Vec::new();
        for (index, node) in self.nodes.iter().enumerate() {
            let tree = self.roots.partition_point(|root| *root as usize <= index);
            for slot in 0..node.len() {
                if let ChildKind::Leaf(leaf) = node.child(slot).kind() {
                    let prims = self.leaf_prims(leaf);
                    promise(!prims.is_empty(), || {
                        format!("{}: an empty leaf", Place { index, slot })
                    })?;
                    let prims = prims.into_iter();
                    shares.extend(prims.map(|prim| Share {
                        prim: (tree, prim.id.geom_id, prim.id.prim_id),
                        leaf: self.leaf_index(leaf),
                        whole: prim.bounds,
                        part: node.bounds(slot),
                    }));
                }
            }
        }
        shares.sort_unstable_by_key(|share| (share.prim, share.leaf));
        let mut count = 0;
        for shares in shares.chunk_by(|a, b| a.prim == b.prim) {
            count += 1;
            Share::are_different_leaves(shares)?;
            Share::have_parts(shares)?;
            Share::hold_the_whole(shares)?;
        }
        Ok(count)
    }
}

/// Notes the boxes around the blocks of one kind.
fn note_boxes<B: LeafBlock>(blocks: &[B], boxes: &mut LeafBoxes) {
    boxes[B::KIND as usize] = blocks.iter().map(block_box).collect();
}

/// A slot of a node.
#[derive(Clone, Copy)]
struct Place {
    index: usize,
    slot: usize,
}

impl core::fmt::Display for Place {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "node {} slot {}", self.index, self.slot)
    }
}

/// Findings of a walk.
pub(crate) struct Walked {
    /// Levels of nodes below each node, itself included, and below instances.
    levels: Vec<u32>,
    /// Whether a primitive sticks out of the box of its leaf.
    some_stick_out: bool,
}

impl Walked {
    /// Levels of nodes from a node down, itself included.
    pub fn levels(&self, node: usize) -> usize {
        self.levels[node] as usize
    }
}

/// A walk over all nodes, the last one first.
struct Walk<'a> {
    tree: &'a Tree,
    leaves: &'a LeafBoxes,
    /// Whether a slot refers to each node, leaf and instance.
    node_has_parent: Vec<bool>,
    leaf_has_parent: [Vec<bool>; PrimKind::COUNT],
    instance_has_parent: Vec<bool>,
    /// The box around all children of each node.
    boxes: Vec<Aabb>,
    walked: Walked,
}

impl<'a> Walk<'a> {
    fn new(tree: &'a Tree, leaves: &'a LeafBoxes) -> Self {
        let nodes = tree.nodes.len();
        Self {
            tree,
            leaves,
            node_has_parent: vec![false; nodes],
            leaf_has_parent: core::array::from_fn(|kind| vec![false; leaves[kind].len()]),
            instance_has_parent: vec![false; tree.instances.len()],
            boxes: vec![Aabb::EMPTY; nodes],
            walked: Walked {
                levels: vec![1; nodes],
                some_stick_out: false,
            },
        }
    }

    /// Checks a node of a tree, 0 being the world and objects following, whose nodes end at `end`. All nodes behind it have
    /// been checked.
    fn check_node(&mut self, index: usize, tree: usize, end: usize) -> Verdict {
        let node = self.tree.nodes.get(index);
        let mut all = Aabb::EMPTY;
        for slot in 0..node.len() {
            let at = Place { index, slot };
            let bounds = node.bounds(slot);
            let below = match node.child(slot).kind() {
                ChildKind::Inner(child) => self.child_follows_in_the_same_tree(at, child, end)?,
                ChildKind::Instance(instance) => {
                    self.instance_is_in_the_world(at, instance, tree)?
                }
                ChildKind::Leaf(leaf) => self.leaf_is_there(at, leaf, &bounds)?,
            };
            promise(!bounds.is_empty() && bounds.contains(&below), || {
                format!("{at}: its box does not hold what is below it")
            })?;
            all = joined(&all, &bounds);
        }
        promise(tree != 0 || self.tree.bounds.contains(&all), || {
            format!("node {index}: its box is not inside the bounds of the tree")
        })?;
        self.boxes[index] = all;
        Ok(())
    }

    /// Returns the box around all children of the child.
    fn child_follows_in_the_same_tree(
        &mut self,
        at: Place,
        child: usize,
        end: usize,
    ) -> Result<Aabb, String> {
        promise(child > at.index && child < end, || {
            format!("{at}: child {child} does not follow its parent in the same tree")
        })?;
        has_no_other_parent(&mut self.node_has_parent[child], || format!("node {child}"))?;
        self.has_levels(at.index, self.walked.levels[child]);
        Ok(self.boxes[child])
    }

    /// Returns the box of the instance.
    fn instance_is_in_the_world(
        &mut self,
        at: Place,
        instance: usize,
        tree: usize,
    ) -> Result<Aabb, String> {
        let placed = self.tree.instances.get(instance);
        let placed = placed.ok_or_else(|| format!("{at}: instance {instance} is missing"))?;
        promise(tree == 0, || format!("{at}: an instance below an instance"))?;
        has_no_other_parent(&mut self.instance_has_parent[instance], || {
            format!("instance {instance}")
        })?;
        let root = placed.root as usize;
        promise(placed.placement.reach >= self.boxes[root].reach(), || {
            format!("{at}: its object has a larger extent")
        })?;
        self.has_levels(at.index, self.walked.levels[root]);
        Ok(placed.placement.bounds())
    }

    /// Returns the box of the leaf itself, which may be around parts of primitives.
    fn leaf_is_there(&mut self, at: Place, leaf: Leaf, bounds: &Aabb) -> Result<Aabb, String> {
        let kind = leaf.kind as usize;
        let found = self.leaves[kind].get(leaf.index);
        let whole = found.ok_or_else(|| format!("{at}: leaf {} is missing", leaf.index))?;
        let parent = &mut self.leaf_has_parent[kind][leaf.index];
        has_no_other_parent(parent, || format!("leaf {}", leaf.index))?;
        self.walked.some_stick_out |= !bounds.contains(whole);
        Ok(*bounds)
    }

    /// A node has one level more than a child that has so many.
    fn has_levels(&mut self, node: usize, of_child: u32) {
        let levels = &mut self.walked.levels[node];
        *levels = (*levels).max(of_child.saturating_add(1));
    }

    /// Roots have no parent, and neither have the leaf block that empty slots refer to and nodes without children, which
    /// are room for others.
    fn everything_has_one_parent(&self) -> Verdict {
        for (index, &has_parent) in self.node_has_parent.iter().enumerate() {
            let is_root = || index == 0 || self.tree.roots.binary_search(&(index as u32)).is_ok();
            let is_room = || self.tree.nodes.get(index).len() == 0;
            promise(has_parent || is_root() || is_room(), || {
                format!("node {index} has no parent")
            })?;
        }
        for (kind, have_parents) in self.leaf_has_parent.iter().enumerate() {
            let first = super::leaves::first_block(PrimKind::ALL[kind]);
            let mut leaves = have_parents.iter().skip(first);
            promise(leaves.all(|has_parent| *has_parent), || {
                "a leaf has no parent".into()
            })?;
        }
        promise(self.instance_has_parent.iter().all(|has| *has), || {
            "an instance has no parent".into()
        })
    }
}

/// Notes that something has a parent, which it had not.
#[inline(always)]
fn has_no_other_parent(has_parent: &mut bool, what: impl FnOnce() -> String) -> Verdict {
    promise(!core::mem::replace(has_parent, true), || {
        format!("{} has two parents", what())
    })
}

/// The box around both, without NaN.
#[inline(always)]
fn joined(a: &Aabb, b: &Aabb) -> Aabb {
    let less = |a: f32, b: f32| if a < b { a } else { b };
    let more = |a: f32, b: f32| if a > b { a } else { b };
    Aabb {
        min: core::array::from_fn(|axis| less(a.min[axis], b.min[axis])),
        max: core::array::from_fn(|axis| more(a.max[axis], b.max[axis])),
    }
}

/// A primitive in a leaf.
struct Share {
    /// Tree, geometry and primitive.
    prim: (usize, u32, u32),
    leaf: usize,
    /// The box around the primitive.
    whole: Aabb,
    /// The box of the leaf.
    part: Aabb,
}

/// Promises about the leaves of one primitive, sorted by leaf.
impl Share {
    fn are_different_leaves(shares: &[Self]) -> Verdict {
        for pair in shares.windows(2) {
            promise(pair[0].leaf != pair[1].leaf, || {
                format!("primitive {:?} is twice in one leaf", pair[0].prim)
            })?;
        }
        Ok(())
    }

    fn have_parts(shares: &[Self]) -> Verdict {
        for share in shares {
            let Self { part, whole, .. } = share;
            let meet = |axis: usize| {
                part.max[axis] >= whole.min[axis] && whole.max[axis] >= part.min[axis]
            };
            promise((0..3).all(meet), || {
                format!(
                    "leaf {} has nothing of primitive {:?}",
                    share.leaf, share.prim
                )
            })?;
        }
        Ok(())
    }

    /// All boxes of the leaves together hold the box of the primitive.
    fn hold_the_whole(shares: &[Self]) -> Verdict {
        let all = shares
            .iter()
            .fold(Aabb::EMPTY, |all, share| all.union(&share.part));
        promise(
            shares.iter().all(|share| all.contains(&share.whole)),
            || {
                format!(
                    "primitive {:?} is not all in the boxes of its leaves",
                    shares[0].prim
                )
            },
        )
    }
}
