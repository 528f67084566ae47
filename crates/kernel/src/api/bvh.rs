//! The one switch between widths: what users hold.

use antumbra_simd::Isa;

use crate::aabb::Aabb;
use crate::api::build::BuildReport;
use crate::api::times::BuildTimes;
use crate::collapse;
use crate::collapse::Learning;
use crate::error::Error;
use crate::geometry::primitives::Primitives;
use crate::learn::log::{Log, LogKind};
use crate::learn::tree_log::TreeLog;
use crate::order;
use crate::order::Order;
use crate::shape::Shape;
use crate::trace::memory::Pool;
use crate::tree::any::{Tree, on_tree};
use crate::tree::binary::BinaryTree;
use crate::tree::costs::CostModel;
use crate::tree::slot_order::SlotOrder;
use crate::tree::width::Width;

/// A tree of any width, with the instruction set it is traced by.
///
/// Every query returns the same bits for every width, order, level and builder. The tree can be shared among
/// any number of threads. Queries one by one go through a [`Tracer`](crate::Tracer).
#[derive(Clone, Debug)]
pub struct AnyBvh {
    pub(crate) tree: Tree,
    isa: Isa,
    /// Stored ones, see [`Primitives::stored`].
    primitives: usize,
    cutouts: usize,
    dropped: usize,
    transparent: usize,
    pub(crate) pool: Pool,
    /// See [`AnyBvh::prefetches`].
    pub(crate) prefetch: bool,
    /// See [`BuildReport`].
    pub(crate) predicted_cost: Option<f64>,
    pub(crate) times: Option<BuildTimes>,
}

impl AnyBvh {
    /// Collapses a binary tree over `primitives` to nodes of `width` children, by area; slots in the
    /// depth-first order of the binary tree. Needs no rays and learns nothing: where comparisons of orders
    /// start.
    pub fn collapse(primitives: &Primitives, tree: &BinaryTree, width: Width, isa: Isa) -> Self {
        let tree = match width {
            Width::W4 => Tree::W4(collapse::by_area(primitives, tree)),
            Width::W8 => Tree::W8(collapse::by_area(primitives, tree)),
            Width::W16 => Tree::W16(collapse::by_area(primitives, tree)),
        };
        Self {
            tree,
            isa,
            primitives: primitives.stored(),
            cutouts: primitives.cutouts(),
            dropped: primitives.dropped(),
            transparent: primitives.transparent(),
            predicted_cost: None,
            pool: Pool::default(),
            prefetch: true,
            times: None,
        }
    }

    /// Collapses a binary tree over `primitives` as is best for the rays in `log`: by default both the
    /// nodes that stay and the order of children and primitives are learned. An empty log gives the
    /// collapse of least surface area.
    ///
    /// # Panics
    /// If the log was made for another tree.
    pub fn collapse_logged(
        primitives: &Primitives,
        tree: &BinaryTree,
        log: &TreeLog,
        learning: &Learning,
        width: Width,
        isa: Isa,
    ) -> Self {
        log.assert_fits(tree);
        let (tree, cost) = match width {
            Width::W4 => {
                let (tree, cost) = collapse::by_log(primitives, tree, log, learning);
                (Tree::W4(tree), cost)
            }
            Width::W8 => {
                let (tree, cost) = collapse::by_log(primitives, tree, log, learning);
                (Tree::W8(tree), cost)
            }
            Width::W16 => {
                let (tree, cost) = collapse::by_log(primitives, tree, log, learning);
                (Tree::W16(tree), cost)
            }
        };
        Self {
            tree,
            isa,
            primitives: primitives.stored(),
            cutouts: primitives.cutouts(),
            dropped: primitives.dropped(),
            transparent: primitives.transparent(),
            predicted_cost: Some(cost),
            pool: Pool::default(),
            prefetch: true,
            times: None,
        }
    }

    /// Children per node.
    pub fn width(&self) -> Width {
        match &self.tree {
            Tree::W4(_) => Width::W4,
            Tree::W8(_) => Width::W8,
            Tree::W16(_) => Width::W16,
        }
    }

    /// The instruction set that queries run on.
    pub fn isa(&self) -> Isa {
        self.isa
    }

    /// Runs queries on another instruction set from now on.
    pub fn set_isa(&mut self, isa: Isa) {
        self.isa = isa;
    }

    /// The smallest box around everything; empty for an empty scene.
    pub fn bounds(&self) -> Aabb {
        on_tree!(&self.tree, tree => tree.bounds)
    }

    /// What was built.
    pub fn build_report(&self) -> BuildReport {
        on_tree!(&self.tree, tree => BuildReport {
            primitives: self.primitives,
            cutouts: self.cutouts,
            instances: tree.instances.len(),
            objects: tree.roots.len(),
            dropped: self.dropped,
            transparent: self.transparent,
            nodes: tree.nodes.len(),
            // Without the empty block that empty slots refer to.
            leaves: tree.leaf_count() - 1,
            depth: tree.depth,
            bytes: tree.bytes(),
            sah: tree.sah(&CostModel::default()),
            predicted_cost: self.predicted_cost,
            times: self.times,
        })
    }

    /// Checks every promise of the tree that traversal relies on; for tests and bug reports.
    ///
    /// # Errors
    /// The first broken promise, in words.
    pub fn validate(&self) -> Result<(), String> {
        let found = on_tree!(&self.tree, tree => tree.validate())?;
        if found == self.primitives {
            Ok(())
        } else {
            Err(format!(
                "{found} primitives in the leaves, not {}",
                self.primitives
            ))
        }
    }

    /// An empty log for this tree. `seed` starts the shuffling, if the kind asks for it.
    pub fn new_log(&self, kind: LogKind, seed: u64) -> Log {
        on_tree!(&self.tree, tree => Log::new(tree, kind, seed))
    }

    /// Works out an order for a tree fresh from a collapse. [`Order::Simple`] leaves it as it is: in the
    /// depth-first order of the binary tree, or in the order that the collapse learned.
    ///
    /// # Errors
    /// [`Error::NeedsLog`] or [`Error::NeedsBoxes`] when the order learns from what is not there,
    /// [`Error::OtherTree`] when the log is of a tree of another shape.
    pub fn plan(
        &self,
        order: Order,
        log: Option<&Log>,
        model: &CostModel,
    ) -> Result<SlotOrder, Error> {
        on_tree!(&self.tree, tree => order::plan(tree, order, log, model))
    }

    /// The mean cost of an occlusion query by the paper's equation (1), with chances estimated from
    /// `log`: `C_any` of the root, for the slots as they stand or as `order` would put them.
    ///
    /// # Errors
    /// [`Error::OtherTree`] when the log or the order is of a tree of another shape.
    pub fn predicted_cost(
        &self,
        log: &Log,
        model: &CostModel,
        order: Option<&SlotOrder>,
    ) -> Result<f64, Error> {
        on_tree!(&self.tree, tree => order::ratio::predicted_cost(tree, log, model, order))
    }

    /// Puts children and primitives where `order` wants them. A log made before counts the old slots:
    /// it is of no more use with this tree.
    ///
    /// # Panics
    /// If the order was planned for a tree of another shape.
    pub fn apply(&mut self, order: &SlotOrder) {
        if let Err(error) = Error::unless_fits(order.shape, self.shape()) {
            panic!("{error}");
        }
        on_tree!(&mut self.tree, tree => tree.apply(order));
        self.predicted_cost = None;
    }

    pub(crate) fn shape(&self) -> Shape {
        on_tree!(&self.tree, tree => tree.shape())
    }
}
