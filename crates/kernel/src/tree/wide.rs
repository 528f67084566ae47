//! The N-wide tree: nodes, leaf blocks, statistics and a check of every promise it makes.

use std::sync::Arc;

use crate::aabb::Aabb;
use crate::geometry::cutout::{CutoutBlock, Filters};
use crate::geometry::instance::Placement;
use crate::geometry::primitives::PrimKind;
use crate::geometry::sphere::SphereBlock;
use crate::geometry::triangle::TriangleBlock;
use crate::shape::Shape;
use crate::tree::costs::CostModel;
use crate::tree::directed::Rule;
use crate::tree::node::{ChildKind, Leaf, Node};
use crate::tree::slot_order::SlotOrder;

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
    /// Largest absolute coordinate, see [`crate::geometry::ray_setup`].
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
}
