//! Building a tree in one call.

use antumbra_simd::Isa;

use super::bvh::AnyBvh;
use super::times::{BuildTimes, Clock, Stopwatch};
use crate::builder::Builder;
use crate::collapse::{Collapse, Learning};
use crate::error::Error;
use crate::geometry::Geometry;
use crate::geometry::primitives::Primitives;
use crate::learn::TreeLog;
use crate::tree::binary::BinaryTree;
use crate::tree::width::Width;

/// What to build.
#[derive(Clone, Copy, Debug)]
pub struct BuildOptions {
    /// How the binary tree is built. For a builder that [needs rays](Builder::needs_rays), these are surface
    /// rays: see [`BinaryTree::build`].
    pub builder: Builder,
    /// How it is collapsed. If that [needs a log](Collapse::needs_log), the order of children and primitives is
    /// learned, too.
    pub collapse: Collapse,
    /// How many [`surface_rays`](crate::surface_rays) a learned collapse learns from; `None` for a number that suits the size
    /// of the scene, 0 to learn from areas alone.
    pub sample_rays: Option<usize>,
    /// Children per node.
    pub width: Width,
    /// The instruction set that queries run on.
    pub isa: Isa,
    /// What to take the times of [`BuildReport::times`] by, if anybody wants them.
    pub clock: Option<Clock>,
}

impl Default for BuildOptions {
    /// A tree learned from sample rays, the best instruction set of this CPU, and the width of its
    /// registers.
    fn default() -> Self {
        let isa = Isa::best();
        Self {
            builder: Builder::default(),
            collapse: Collapse::default(),
            sample_rays: None,
            width: Width::auto(isa.level()),
            isa,
            clock: None,
        }
    }
}

/// What was built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BuildReport {
    /// Primitives in the tree; those of an object once, however often it is placed.
    pub primitives: usize,
    /// Those of them that are partly transparent triangles: see [`crate::Opacity`].
    pub cutouts: usize,
    /// Instances in the tree.
    pub instances: usize,
    /// Objects that they place.
    pub objects: usize,
    /// Primitives and instances left out: see [`Primitives`].
    pub dropped: usize,
    /// Triangles left out because they are clear: see [`crate::Coverage`].
    pub transparent: usize,
    /// N-wide nodes.
    pub nodes: usize,
    /// Leaf blocks.
    pub leaves: usize,
    /// Levels of nodes; the root is one. With instances, those of the world's tree and of the deepest object
    /// together.
    pub depth: usize,
    /// Bytes of nodes, leaf blocks and instances.
    pub bytes: usize,
    /// Cost of a random line that hits the box of the root, by the surface area heuristic: what nodes and
    /// primitives cost in the default [`crate::CostModel`], times their area relative to the root's. The cost of
    /// the root alone if that has no area.
    pub sah: f64,
    /// Mean cost of an occlusion query by the paper's equation (1), as the log that the tree was collapsed
    /// by has it, in units of that collapse's cost model. `None` if it was collapsed without a log, or
    /// another order has been applied since.
    pub predicted_cost: Option<f64>,
    /// How long the steps took. `None` unless built by [`AnyBvh::build`] or [`AnyBvh::build_over`] with a
    /// [clock](BuildOptions::clock).
    pub times: Option<BuildTimes>,
}

impl AnyBvh {
    /// Builds a tree over geometries, the place of each in the list being its `geom_id`.
    ///
    /// By default the collapse and the order are learned from [`surface_rays`](crate::surface_rays). To learn from the rays to
    /// come, see [`TreeLog`] and [`AnyBvh::collapse_logged`].
    ///
    /// Uses the rayon pool that is current, if the `parallel` feature is on; the tree does not depend on
    /// the number of threads.
    ///
    /// # Errors
    /// A vertex index out of range; more primitives than can be numbered.
    pub fn build(geometries: &[Geometry<'_>], options: &BuildOptions) -> Result<Self, Error> {
        let mut stopwatch = Stopwatch::new(options.clock);
        let primitives = Primitives::new(geometries)?;
        let checked = stopwatch.lap();
        let mut bvh = Self::build_over(&primitives, options);
        if let Some(times) = &mut bvh.times {
            times.primitives = checked;
        }
        Ok(bvh)
    }

    /// [`AnyBvh::build`] for primitives that are checked already; with instances, if there are any: see
    /// [`Primitives::with_instances`].
    pub fn build_over(primitives: &Primitives, options: &BuildOptions) -> Self {
        let BuildOptions {
            builder,
            collapse,
            sample_rays,
            width,
            isa,
            clock,
        } = *options;
        let mut stopwatch = Stopwatch::new(clock);
        let mut times = BuildTimes::default();
        let tree = BinaryTree::build(primitives, builder);
        times.tree = stopwatch.lap();
        let log = collapse
            .needs_log()
            .then(|| TreeLog::of_surfaces(primitives, &tree, sample_rays));
        times.log = stopwatch.lap();
        let mut bvh = match &log {
            None => Self::collapse_unlogged(primitives, &tree, collapse, width, isa),
            Some(log) => {
                let learning = Learning {
                    collapse,
                    ..Default::default()
                };
                Self::collapse_logged(primitives, &tree, log, &learning, width, isa)
            }
        };
        times.collapse = stopwatch.lap();
        bvh.times = clock.map(|_| times);
        bvh
    }

    /// Collapses a binary tree without rays; slots in the depth-first order of the binary tree. A collapse
    /// that [needs a log](Collapse::needs_log) goes by areas in place of visits.
    pub fn collapse_unlogged(
        primitives: &Primitives,
        tree: &BinaryTree,
        collapse: Collapse,
        width: Width,
        isa: Isa,
    ) -> Self {
        if collapse == Collapse::Area {
            return Self::collapse(primitives, tree, width, isa);
        }
        let learning = Learning {
            collapse,
            sort: false,
            ..Default::default()
        };
        let log = TreeLog::new(tree);
        let mut bvh = Self::collapse_logged(primitives, tree, &log, &learning, width, isa);
        bvh.predicted_cost = None;
        bvh
    }
}
