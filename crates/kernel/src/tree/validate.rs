//! A check of every promise of a wide tree that traversal relies on.
//!
//! One function per promise, named for it. Each returns the first place where it finds the promise broken.

use alloc::format;
use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;

use super::node::{Child, ChildKind, Leaf};
use super::wide::WideTree;
use crate::aabb::Aabb;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::primitives::PrimKind;

/// Nothing, or which promise is broken where.
type Verdict = Result<(), String>;

/// Fails with a message unless the promise holds.
fn promise(holds: bool, broken: impl FnOnce() -> String) -> Verdict {
    if holds { Ok(()) } else { Err(broken()) }
}

impl<const N: usize> WideTree<N> {
    /// Walks the whole tree and checks every promise that traversal relies on. Returns how many primitives
    /// are in its leaves, those in several of them counted once.
    ///
    /// # Errors
    /// The first broken promise, in words.
    pub fn validate(&self) -> Result<usize, String> {
        self.block_of_empty_slots_is_empty()?;
        self.instances_place_objects()?;
        let mut found = Found::new(self);
        for index in 0..self.nodes.len() {
            for slot in 0..N {
                self.check_slot(index, slot, &mut found)?;
            }
        }
        self.everything_has_one_parent(&found)?;
        self.stack_is_deep_enough(&found)?;
        let count = found.primitives_are_whole()?;
        self.extent_holds_all_coordinates()?;
        Ok(count)
    }

    fn block_of_empty_slots_is_empty(&self) -> Verdict {
        let block = self.blocks.triangles.first();
        promise(block.is_some_and(|block| block.count() == 0), || {
            "triangle block 0 is not empty".into()
        })
    }

    fn instances_place_objects(&self) -> Verdict {
        promise(self.roots.is_sorted(), || "objects are not in order".into())?;
        for (index, instance) in self.instances.iter().enumerate() {
            promise(self.roots.binary_search(&instance.root).is_ok(), || {
                format!("instance {index} does not place an object")
            })?;
        }
        Ok(())
    }

    /// Checks one slot of a node and adds what it refers to to `found`.
    fn check_slot(&self, index: usize, slot: usize, found: &mut Found) -> Verdict {
        let at = Place {
            index,
            slot,
            tree: self.tree_of(index),
            bounds: self.nodes[index].bounds(slot),
        };
        let child = self.nodes[index].child(slot);
        if slot >= self.nodes[index].len() {
            return at.empty_slot_follows_occupied_ones(child);
        }
        let below = match child.kind() {
            ChildKind::Inner(child) => self.child_follows_in_the_same_tree(&at, child, found)?,
            ChildKind::Instance(instance) => {
                self.instance_lies_in_the_world(&at, instance, found)?
            }
            ChildKind::Leaf(leaf) => self.leaf_is_there_and_occupied(&at, leaf, found)?,
        };
        at.box_holds_what_is_below(&below)?;
        self.bounds_hold_the_world(&at)
    }

    /// Index of the tree that a node belongs to: 0 is the world, then come the objects.
    fn tree_of(&self, node: usize) -> usize {
        self.roots.partition_point(|root| *root as usize <= node)
    }

    /// Returns the box around all children of the child.
    fn child_follows_in_the_same_tree(
        &self,
        at: &Place,
        child: usize,
        found: &mut Found,
    ) -> Result<Aabb, String> {
        promise(child > at.index && child < self.nodes.len(), || {
            format!("{at}: child {child} does not follow its parent")
        })?;
        promise(at.tree == self.tree_of(child), || {
            format!("{at}: child {child} is in another tree")
        })?;
        found.node_parents[child] += 1;
        found.levels[child] = found.levels[at.index] + 1;
        Ok(self.nodes[child].all_bounds())
    }

    /// Returns the box of the instance.
    fn instance_lies_in_the_world(
        &self,
        at: &Place,
        instance: usize,
        found: &mut Found,
    ) -> Result<Aabb, String> {
        let placed = self.instances.get(instance);
        let placed = placed.ok_or_else(|| format!("{at}: instance {instance} is missing"))?;
        promise(at.tree == 0, || {
            format!("{at}: an instance below an instance")
        })?;
        let root = placed.root as usize;
        found.instance_parents[instance] += 1;
        found.levels[root] = found.levels[root].max(found.levels[at.index] + 1);
        let object = self.nodes[root].all_bounds();
        promise(placed.placement.reach >= object.reach(), || {
            format!("{at}: its object has a larger extent")
        })?;
        Ok(placed.placement.bounds())
    }

    /// Returns the box of the leaf itself: its primitives may be split, so they are checked when all leaves are known.
    fn leaf_is_there_and_occupied(
        &self,
        at: &Place,
        leaf: Leaf,
        found: &mut Found,
    ) -> Result<Aabb, String> {
        let index = self.leaf_index(leaf);
        promise(self.has_leaf(leaf) && self.leaf_len(leaf) > 0, || {
            format!("{at}: leaf {index} is missing or empty")
        })?;
        found.leaf_parents[index] += 1;
        let prims = self.leaf_prims(leaf).into_iter();
        found.shares.extend(prims.map(|prim| Share {
            prim: (at.tree, prim.id.geom_id, prim.id.prim_id),
            leaf: index,
            whole: prim.bounds,
            part: at.bounds,
        }));
        self.filters_are_there(at, leaf)?;
        Ok(at.bounds)
    }

    /// Every partly transparent triangle has a filter and an opacity micromap.
    fn filters_are_there(&self, at: &Place, leaf: Leaf) -> Verdict {
        if leaf.kind != PrimKind::Cutout {
            return Ok(());
        }
        let (block, filters) = (&self.blocks.cutouts[leaf.index], &*self.filters);
        let is_known = |lane: usize| {
            let asked = filters.representatives.get(block.patterns[lane] as usize);
            asked.is_some_and(|asked| (asked.filter as usize) < filters.opacities.len())
                && filters.maps.contains(block.maps[lane])
        };
        promise((0..block.count()).all(is_known), || {
            format!("{at}: a filter is missing")
        })
    }

    fn bounds_hold_the_world(&self, at: &Place) -> Verdict {
        promise(at.tree != 0 || self.bounds.contains(&at.bounds), || {
            format!("{at}: its box is not inside the bounds of the tree")
        })
    }

    /// Roots have no parent, and neither have the leaf block that empty slots refer to and nodes without children, which
    /// are room for others.
    fn everything_has_one_parent(&self, found: &Found) -> Verdict {
        for (node, &parents) in found.node_parents.iter().enumerate() {
            let is_root = node == 0 || self.roots.binary_search(&(node as u32)).is_ok();
            let is_room = self.nodes[node].len() == 0;
            promise(parents == u32::from(!is_root && !is_room), || {
                format!("node {node} has {parents} parents")
            })?;
        }
        for (instance, &parents) in found.instance_parents.iter().enumerate() {
            promise(parents == 1, || {
                format!("instance {instance} has {parents} parents")
            })?;
        }
        for (leaf, &parents) in found.leaf_parents.iter().enumerate().skip(1) {
            promise(parents == 1, || {
                format!("leaf {leaf} has {parents} parents")
            })?;
        }
        Ok(())
    }

    fn stack_is_deep_enough(&self, found: &Found) -> Verdict {
        let depth = found.levels.iter().copied().max().unwrap_or(0);
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
}

/// A slot of a node.
struct Place {
    index: usize,
    slot: usize,
    /// Tree of the node, as [`WideTree::tree_of`] counts them.
    tree: usize,
    /// Box of the slot.
    bounds: Aabb,
}

impl core::fmt::Display for Place {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "node {} slot {}", self.index, self.slot)
    }
}

impl Place {
    fn empty_slot_follows_occupied_ones(&self, child: Child) -> Verdict {
        promise(child == Child::EMPTY && self.bounds == Aabb::EMPTY, || {
            format!("{self}: an empty slot before an occupied one, or with a box")
        })
    }

    fn box_holds_what_is_below(&self, below: &Aabb) -> Verdict {
        promise(
            !self.bounds.is_empty() && self.bounds.contains(below),
            || format!("{self}: its box does not hold what is below it"),
        )
    }
}

/// Everything that the walk has met.
struct Found {
    /// How many slots refer to each node, leaf and instance.
    node_parents: Vec<u32>,
    leaf_parents: Vec<u32>,
    instance_parents: Vec<u32>,
    /// Levels of nodes down to each node, itself included.
    levels: Vec<usize>,
    shares: Vec<Share>,
}

impl Found {
    fn new<const N: usize>(bvh: &WideTree<N>) -> Self {
        Self {
            node_parents: vec![0; bvh.nodes.len()],
            leaf_parents: vec![0; bvh.leaf_count()],
            instance_parents: vec![0; bvh.instances.len()],
            levels: vec![1; bvh.nodes.len()],
            shares: Vec::new(),
        }
    }

    /// Returns how many different primitives there are.
    fn primitives_are_whole(mut self) -> Result<usize, String> {
        self.shares
            .sort_unstable_by_key(|share| (share.prim, share.leaf));
        let mut count = 0;
        for shares in self.shares.chunk_by(|a, b| a.prim == b.prim) {
            count += 1;
            Share::are_different_leaves(shares)?;
            Share::have_parts(shares)?;
            Share::hold_the_whole(shares)?;
        }
        Ok(count)
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
