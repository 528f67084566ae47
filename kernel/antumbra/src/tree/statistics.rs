//! Figures of a wide tree: its bytes and its cost by the surface area heuristic.

use alloc::vec;
use core::ops::Range;

use super::node::ChildKind;
use super::wide::Tree;
use crate::aabb::Aabb;
use crate::tree::costs::CostModel;

impl Tree {
    /// Bytes of nodes, leaf blocks, instances and opacity micromaps.
    pub(crate) fn bytes(&self) -> usize {
        self.nodes.bytes()
            + self.leaf_bytes()
            + size_of_val(&self.instances[..])
            + self.filters.bytes()
    }

    /// Cost of a random line by the surface area heuristic, see [`crate::BuildReport`].
    pub(crate) fn sah(&self, model: &CostModel) -> f64 {
        let mut objects = vec![0.0; self.roots.len()];
        for (object, &root) in self.roots.iter().enumerate() {
            let end = self.roots.get(object + 1);
            let nodes = root as usize..end.map_or(self.nodes.len(), |end| *end as usize);
            let bounds = self.nodes.get(root as usize).all_bounds();
            objects[object] = self.sah_of(nodes, &bounds, model, &[]);
        }
        self.sah_of(0..self.top_nodes(), &self.bounds, model, &objects)
    }

    /// Cost of the tree of these nodes, which has these bounds. `objects` are the costs of the objects that it places.
    pub(super) fn sah_of(
        &self,
        nodes: Range<usize>,
        bounds: &Aabb,
        model: &CostModel,
        objects: &[f64],
    ) -> f64 {
        let root = f64::from(bounds.half_area());
        let mut sah = f64::from(model.node);
        for index in nodes {
            for (child, bounds) in self.nodes.get(index).children() {
                let cost = match child.kind() {
                    ChildKind::Inner(_) => f64::from(model.node),
                    ChildKind::Leaf(leaf) => self.leaf_cost(leaf, model),
                    ChildKind::Instance(instance) => {
                        let root = self.instances[instance].root;
                        let object = self.roots.partition_point(|other| *other < root);
                        f64::from(model.entry) + objects[object]
                    }
                };
                let share = f64::from(bounds.half_area()) / root;
                // 0 / 0 of a scene without area, ∞ / ∞ of one that overflows.
                sah += if share.is_finite() { share * cost } else { 0.0 };
            }
        }
        sah
    }
}
