//! A check of every promise of a wide tree that traversal relies on.

use super::node::{Child, ChildKind, Leaf};
use super::wide::Bvh;
use crate::aabb::Aabb;
use crate::geometry::cutout::Filters;
use crate::geometry::triangle::TriangleBlock;

impl<const N: usize> Bvh<N> {
    /// Walks the whole tree and checks every promise that traversal relies on. Returns how many primitives
    /// are in its leaves, those in several of them counted once.
    ///
    /// # Errors
    /// The first broken promise, in words.
    pub fn validate(&self) -> Result<usize, String> {
        let fail = |message: String| Err(message);
        if self
            .triangle_blocks
            .first()
            .is_none_or(|block| block.count() != 0)
        {
            return fail("triangle block 0 is not empty".into());
        }
        let mut node_parents = vec![0u32; self.nodes.len()];
        let mut leaf_parents = vec![0u32; self.leaf_count()];
        let mut instance_parents = vec![0u32; self.instances.len()];
        if !self.roots.is_sorted() {
            return fail("objects are not in order".into());
        }
        for (index, instance) in self.instances.iter().enumerate() {
            if self.roots.binary_search(&instance.root).is_err() {
                return fail(format!("instance {index} does not place an object"));
            }
        }
        let mut levels = vec![1usize; self.nodes.len()];
        let mut prims = Vec::new();
        for (index, node) in self.nodes.iter().enumerate() {
            let len = node.len();
            // 0 is the world, then come the objects.
            let tree = self.roots.partition_point(|root| *root as usize <= index);
            for slot in 0..N {
                let (child, bounds) = (node.child(slot), node.bounds(slot));
                let place = format!("node {index} slot {slot}");
                if slot >= len {
                    if child != Child::EMPTY || bounds != Aabb::EMPTY {
                        return fail(format!(
                            "{place}: an empty slot before an occupied one, or with a box"
                        ));
                    }
                    continue;
                }
                let inner = match child.kind() {
                    ChildKind::Inner(child) => {
                        if child <= index || child >= self.nodes.len() {
                            return fail(format!(
                                "{place}: child {child} does not follow its parent"
                            ));
                        }
                        if tree != self.roots.partition_point(|root| *root as usize <= child) {
                            return fail(format!("{place}: child {child} is in another tree"));
                        }
                        node_parents[child] += 1;
                        levels[child] = levels[index] + 1;
                        self.nodes[child].all_bounds()
                    }
                    ChildKind::Instance(instance) => {
                        let Some(placed) = self.instances.get(instance) else {
                            return fail(format!("{place}: instance {instance} is missing"));
                        };
                        if tree != 0 {
                            return fail(format!("{place}: an instance below an instance"));
                        }
                        let root = placed.root as usize;
                        instance_parents[instance] += 1;
                        levels[root] = levels[root].max(levels[index] + 1);
                        if placed.placement.reach < self.nodes[root].all_bounds().reach() {
                            return fail(format!("{place}: its object reaches further"));
                        }
                        placed.placement.bounds()
                    }
                    ChildKind::Leaf(leaf) => {
                        let leaf_index = self.leaf_index(leaf);
                        if leaf_index >= self.leaf_count() || self.leaf_len(leaf) == 0 {
                            return fail(format!("{place}: leaf {leaf_index} is missing or empty"));
                        }
                        leaf_parents[leaf_index] += 1;
                        let mut add_triangles = |block: &TriangleBlock| {
                            prims.extend((0..block.count()).map(|lane| Share {
                                prim: (tree, block.geom_ids[lane], block.prim_ids[lane]),
                                leaf: leaf_index,
                                whole: Aabb::around(&block.triangle(lane)),
                                part: bounds,
                            }));
                        };
                        match leaf {
                            Leaf::Triangles(block) => add_triangles(&self.triangle_blocks[block]),
                            Leaf::Cutouts(block) => {
                                let block = &self.cutout_blocks[block];
                                add_triangles(&block.triangles);
                                let Filters {
                                    opacities,
                                    representatives,
                                    maps,
                                } = &*self.filters;
                                let known = |lane: usize| {
                                    let asked = representatives.get(block.patterns[lane] as usize);
                                    asked.is_some_and(|asked| {
                                        (asked.filter as usize) < opacities.len()
                                    }) && maps.contains(block.maps[lane])
                                };
                                if !(0..block.triangles.count()).all(known) {
                                    return fail(format!("{place}: a filter is missing"));
                                }
                            }
                            Leaf::Spheres(block) => {
                                let block = &self.sphere_blocks[block];
                                prims.extend((0..block.count).map(|lane| Share {
                                    prim: (
                                        tree,
                                        block.refs[lane].geom_id,
                                        block.refs[lane].prim_id,
                                    ),
                                    leaf: leaf_index,
                                    whole: block.spheres[lane].bounds(),
                                    part: bounds,
                                }));
                            }
                        }
                        // What it has to hold is seen when all leaves of its primitives are known.
                        bounds
                    }
                };
                if bounds.is_empty() || !bounds.contains(&inner) {
                    return fail(format!("{place}: its box does not hold what is below it"));
                }
                if tree == 0 && !self.bounds.contains(&bounds) {
                    return fail(format!(
                        "{place}: its box is not inside the bounds of the tree"
                    ));
                }
            }
        }
        for (node, parents) in node_parents.iter().enumerate() {
            let is_root = node == 0 || self.roots.binary_search(&(node as u32)).is_ok();
            if *parents != u32::from(!is_root) {
                return fail(format!("node {node} has {parents} parents"));
            }
        }
        if let Some(instance) = instance_parents.iter().position(|count| *count != 1) {
            return fail(format!(
                "instance {instance} has {} parents",
                instance_parents[instance]
            ));
        }
        if let Some(leaf) = leaf_parents.iter().skip(1).position(|count| *count != 1) {
            return fail(format!(
                "leaf {} has {} parents",
                leaf + 1,
                leaf_parents[leaf + 1]
            ));
        }
        let depth = levels.iter().copied().max().unwrap_or(0);
        if depth > self.depth {
            return fail(format!(
                "{depth} levels, but the stack is sized for {}",
                self.depth
            ));
        }
        prims.sort_unstable_by_key(|share| (share.prim, share.leaf));
        let mut count = 0;
        for shares in prims.chunk_by(|a, b| a.prim == b.prim) {
            count += 1;
            Share::check(shares)?;
        }
        if self.bounds.reach() > self.reach {
            return fail(format!(
                "coordinates reach {}, not {}",
                self.bounds.reach(),
                self.reach
            ));
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

impl Share {
    /// Checks the leaves of one primitive, sorted: no leaf has it twice, all have a part of it, and together they have it
    /// all, as far as boxes can tell.
    fn check(shares: &[Self]) -> Result<(), String> {
        let [first, others @ ..] = shares else {
            return Ok(());
        };
        let prim = first.prim;
        if shares.windows(2).any(|pair| pair[0].leaf == pair[1].leaf) {
            return Err(format!("primitive {prim:?} is twice in one leaf"));
        }
        let apart = |share: &Self| {
            (0..3).any(|axis| {
                share.part.max[axis] < share.whole.min[axis]
                    || share.whole.max[axis] < share.part.min[axis]
            })
        };
        if let Some(share) = shares.iter().find(|share| apart(share)) {
            return Err(format!(
                "leaf {} has nothing of primitive {prim:?}",
                share.leaf
            ));
        }
        let all = others
            .iter()
            .fold(first.part, |all, share| all.union(&share.part));
        if all.contains(&first.whole) {
            Ok(())
        } else {
            Err(format!(
                "primitive {prim:?} is not all in the boxes of its leaves"
            ))
        }
    }
}
