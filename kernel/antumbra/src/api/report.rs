//! What was built.

use super::bvh::Bvh;
use super::times::BuildTimes;
use crate::tree::costs::CostModel;
use crate::tree::width::Width;

/// Size, cost and build times of a tree, returned by [`Bvh::report`].
///
/// ```
/// # use antumbra::{Bvh, Geometry, Recipe};
/// use antumbra::BuildReport;
///
/// # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
/// # let bvh = Bvh::build(&geometry, &Recipe::default())?;
/// let report: BuildReport = bvh.report();
/// assert_eq!((report.primitives, report.dropped, report.depth), (1, 0, 1));
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct BuildReport {
    /// Primitives in the tree. Primitives of an object count once, however often it is placed.
    pub primitives: usize,
    /// Partly transparent triangles among them: see [`crate::cutout::Opacity`].
    pub cutouts: usize,
    /// Instances in the tree.
    pub instances: usize,
    /// Objects that they place.
    pub objects: usize,
    /// Primitives and instances left out: listed by
    /// [`Primitives::dropped_list`](crate::Primitives::dropped_list).
    pub dropped: usize,
    /// Triangles left out because they are clear: see [`crate::cutout::Coverage`].
    pub transparent: usize,
    /// Nodes of up to [`Bvh::width`] children each.
    pub nodes: usize,
    /// Leaf blocks, without the empty one that empty slots refer to.
    pub leaves: usize,
    /// Levels of nodes; the root is one. With instances, levels of the world's tree and of the deepest object together.
    pub depth: usize,
    /// Bytes of nodes, leaf blocks and instances.
    pub bytes: usize,
    /// Cost of a random line that hits the box of the root, by the surface area heuristic: what nodes and primitives
    /// cost in the default [`crate::recipe::CostModel`], times their area relative to the root's. Only the cost of the
    /// root if the root has no area.
    pub sah: f64,
    /// This cost over the cost when the tree was built: 1 before any [refit](Bvh::refit), and more the worse the nodes suit
    /// what has moved. From about 1.5 on, a build soon pays.
    pub quality: f64,
    /// Mean cost of an occlusion query by the paper's equation (1), estimated from the training log in units of the
    /// recipe's costs. `None` without a log, and for an order that picks by ray.
    pub predicted_cost: Option<f64>,
    /// Predicted cost before the child order was applied.
    pub predicted_cost_before: Option<f64>,
    /// Rays that the child order was learned from.
    pub training_rays: u64,
    /// Whether anything moves while rays are traced.
    pub moves: bool,
    /// Whether batches prefetch nodes and leaves: see [`Recipe::prefetch`](crate::Recipe::prefetch).
    pub prefetches: bool,
    /// The width that the tree has in the file it was read from, if that is not [`Bvh::width`]: the tree was collapsed again.
    pub file_width: Option<Width>,
    /// Times of the steps; `None` without a [clock](crate::Recipe::clock).
    pub times: Option<BuildTimes>,
}

impl Bvh {
    /// Returns size, cost and build times of this tree.
    #[must_use]
    pub fn report(&self) -> BuildReport {
        let tree = &self.tree;
        let sah = tree.sah(&CostModel::default());
        BuildReport {
            primitives: self.primitives,
            cutouts: self.cutouts,
            instances: tree.instances.len(),
            objects: tree.roots.len(),
            dropped: self.dropped,
            transparent: self.transparent,
            nodes: tree.nodes.len() - tree.room(),
            // Without the empty block that empty slots refer to.
            leaves: tree.leaf_count() - 1,
            depth: tree.depth,
            bytes: tree.bytes(),
            sah,
            quality: self.built_sah.map_or(1.0, |built| sah / built),
            predicted_cost: self.predicted_cost,
            predicted_cost_before: self.predicted_before,
            training_rays: self.training_rays,
            moves: self.moves(),
            prefetches: self.prefetches(),
            file_width: self.file_width,
            times: self.times,
        }
    }
}
