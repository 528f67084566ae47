//! The N-wide tree: nodes, leaf blocks, statistics and a check of every promise it makes.

use std::sync::Arc;

use crate::aabb::Aabb;
use crate::geometry::cutout::{CutoutBlock, Filters};
use crate::geometry::instance::Placement;
use crate::geometry::sphere::SphereBlock;
use crate::geometry::triangle::TriangleBlock;
use crate::node::{Child, ChildKind, Leaf, Node};
use crate::order::{CostModel, Shape, SlotOrder};
use crate::primitives::PrimKind;
use crate::trace::pick::Rule;

/// A tree of nodes with `N` children, or one tree over the world and one for each object that instances place
/// in it.
///
/// Node 0 is the root of the world's and always exists; the trees of objects stand behind it, one after the
/// other. Children follow their parents, also from an instance to the root of its object. Triangle block 0 is
/// empty: it is what empty slots refer to.
#[derive(Clone, Debug)]
pub(crate) struct Bvh<const N: usize> {
    pub nodes: Vec<Node<N>>,
    pub triangle_blocks: Vec<TriangleBlock>,
    pub sphere_blocks: Vec<SphereBlock>,
    pub cutout_blocks: Vec<CutoutBlock>,
    /// What decides about the hits of cut-out blocks.
    pub filters: Arc<Filters>,
    /// In visiting order.
    pub instances: Vec<PlacedTree>,
    /// The roots of the objects, ascending.
    pub roots: Vec<u32>,
    /// Of the world.
    pub bounds: Aabb,
    /// Largest absolute coordinate, see [`crate::trace::setup`].
    pub reach: f32,
    /// Levels of nodes, the root being one: those of the world's tree and of the deepest object together.
    pub depth: usize,
    /// How occlusion queries pick the next child.
    pub pick: Rule,
}

/// An instance in a tree.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct PlacedTree {
    pub placement: Placement,
    /// The root of its object.
    pub root: u32,
}

impl<const N: usize> Bvh<N> {
    /// Leaves of all kinds in one numbering: triangle blocks first, the empty one included.
    #[inline(always)]
    pub fn leaf_index(&self, leaf: Leaf) -> usize {
        match leaf {
            Leaf::Triangles(index) => index,
            Leaf::Spheres(index) => self.triangle_blocks.len() + index,
            Leaf::Cutouts(index) => self.triangle_blocks.len() + self.sphere_blocks.len() + index,
        }
    }

    /// Size of the numbering of [`Bvh::leaf_index`].
    pub fn leaf_count(&self) -> usize {
        self.triangle_blocks.len() + self.sphere_blocks.len() + self.cutout_blocks.len()
    }

    /// Instances are numbered behind the leaves, where both are counted.
    #[inline(always)]
    pub fn instance_index(&self, instance: usize) -> usize {
        self.leaf_count() + instance
    }

    /// How many of the nodes belong to the tree of the world; they come first.
    pub fn top_nodes(&self) -> usize {
        self.roots
            .first()
            .map_or(self.nodes.len(), |root| *root as usize)
    }

    /// What a log or order must have in common with it.
    pub fn shape(&self) -> Shape {
        Shape {
            width: N,
            nodes: self.nodes.len(),
            leaves: self.leaf_count(),
            instances: self.instances.len(),
            objects: self.roots.len(),
        }
    }

    /// Primitives in a leaf.
    pub fn leaf_len(&self, leaf: Leaf) -> usize {
        match leaf {
            Leaf::Triangles(index) => self.triangle_blocks[index].count(),
            Leaf::Spheres(index) => self.sphere_blocks[index].count,
            Leaf::Cutouts(index) => self.cutout_blocks[index].triangles.count(),
        }
    }

    /// `C_p N_p`: what testing the primitives of a leaf costs.
    pub fn leaf_cost(&self, leaf: Leaf, model: &CostModel) -> f64 {
        let kind = match leaf {
            Leaf::Triangles(_) => PrimKind::Triangle,
            Leaf::Cutouts(_) => PrimKind::Cutout,
            Leaf::Spheres(_) => PrimKind::Sphere,
        };
        f64::from(model.of(kind)) * self.leaf_len(leaf) as f64
    }

    /// Permutes slots and leaf lanes. The order was made for a tree of this shape.
    pub fn apply(&mut self, order: &SlotOrder) {
        if !order.slots.is_empty() {
            let (permutations, _) = order.slots.as_chunks::<N>();
            for (node, slots) in self.nodes.iter_mut().zip(permutations) {
                node.permute(slots);
            }
        }
        if !order.lanes.is_empty() {
            let (triangles, others) = order.lanes.split_at(self.triangle_blocks.len());
            let (spheres, cutouts) = others.split_at(self.sphere_blocks.len());
            for (block, lanes) in self.triangle_blocks.iter_mut().zip(triangles) {
                block.permute(lanes);
            }
            for (block, lanes) in self.sphere_blocks.iter_mut().zip(spheres) {
                block.permute(lanes);
            }
            for (block, lanes) in self.cutout_blocks.iter_mut().zip(cutouts) {
                block.permute(lanes);
            }
        }
        self.pick = order.pick.clone();
    }

    /// Bytes of nodes, leaf blocks, instances, maps of cut-outs, and orders that are looked up.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..])
            + size_of_val(&self.triangle_blocks[..])
            + size_of_val(&self.sphere_blocks[..])
            + size_of_val(&self.instances[..])
            + size_of_val(&self.cutout_blocks[..])
            + self.filters.bytes()
            + self.pick.bytes()
    }

    /// The surface area heuristic, see [`crate::BuildReport`].
    pub fn sah(&self, model: &CostModel) -> f64 {
        let mut objects = vec![0.0; self.roots.len()];
        for (object, &root) in self.roots.iter().enumerate() {
            let end = self.roots.get(object + 1);
            let nodes = root as usize..end.map_or(self.nodes.len(), |end| *end as usize);
            let bounds = self.nodes[root as usize].all_bounds();
            objects[object] = self.sah_of(nodes, &bounds, model, &[]);
        }
        self.sah_of(0..self.top_nodes(), &self.bounds, model, &objects)
    }

    /// The same for the tree of these nodes, which has this box, given what the objects below it cost.
    fn sah_of(
        &self,
        nodes: core::ops::Range<usize>,
        bounds: &Aabb,
        model: &CostModel,
        objects: &[f64],
    ) -> f64 {
        let root = f64::from(bounds.half_area());
        let mut sah = f64::from(model.node);
        for node in &self.nodes[nodes] {
            for slot in 0..node.len() {
                let cost = match node.child(slot).kind() {
                    ChildKind::Inner(_) => f64::from(model.node),
                    ChildKind::Leaf(leaf) => self.leaf_cost(leaf, model),
                    ChildKind::Instance(instance) => {
                        let root = self.instances[instance].root;
                        let object = self.roots.partition_point(|other| *other < root);
                        f64::from(model.entry) + objects[object]
                    }
                };
                let share = f64::from(node.bounds(slot).half_area()) / root;
                // 0 / 0 of a scene without area, ∞ / ∞ of one that overflows.
                sah += if share.is_finite() { share * cost } else { 0.0 };
            }
        }
        sah
    }

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
