//! The one switch between widths: what users hold.

use antumbra_simd::{Dispatch, Isa, Level};

use crate::aabb::Aabb;
use crate::build::{BinaryTree, BuildReport, Learning, collapse};
use crate::bvh::Bvh;
use crate::error::Error;
use crate::order::{self, CostModel, Log, LogKind, Order, Shape, SlotOrder, TreeLog};
use crate::primitives::Primitives;
use crate::ray::{Hit, Ray};
use crate::trace::observe::{Cost, Counting, Logging, Nothing, Observer};
use crate::trace::pick::{FrontToBack, InOrder, Shuffled};
use crate::trace::query::{Closest, Occlusion, Query};
use crate::trace::single::Single;
use crate::trace::stack::{Entry, Item, stack_size};
use crate::trace::wave::Wave;
use crate::width::Width;

#[derive(Clone, Debug)]
enum Tree {
    W4(Bvh<4>),
    W8(Bvh<8>),
    W16(Bvh<16>),
}

/// Runs the same code on whichever tree it is.
macro_rules! on_tree {
    ($any:expr, $tree:ident => $body:expr) => {
        match $any {
            Tree::W4($tree) => $body,
            Tree::W8($tree) => $body,
            Tree::W16($tree) => $body,
        }
    };
}

/// A tree of any width, with the instruction set it is traced by.
///
/// Every query returns the same bits for every width, order, level and builder. Queries run on the
/// calling thread; the tree can be shared among any number of threads. Queries one by one go through a
/// [`Tracer`].
#[derive(Clone, Debug)]
pub struct AnyBvh {
    tree: Tree,
    isa: Isa,
    dropped: usize,
    primitives: usize,
    /// See [`BuildReport`].
    predicted_cost: Option<f64>,
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
            dropped: primitives.dropped(),
            primitives: primitives.len(),
            predicted_cost: None,
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
            dropped: primitives.dropped(),
            primitives: primitives.len(),
            predicted_cost: Some(cost),
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
        let (primitives, dropped) = (self.primitives, self.dropped);
        on_tree!(&self.tree, tree => BuildReport {
            primitives,
            dropped,
            nodes: tree.nodes.len(),
            // Without the empty block that empty slots refer to.
            leaves: tree.leaf_count() - 1,
            depth: tree.depth,
            bytes: tree.bytes(),
            sah: tree.sah(&CostModel::default()),
            predicted_cost: self.predicted_cost,
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

    /// A tracer for single rays: it owns the traversal stack, so that no query allocates.
    pub fn tracer(&self) -> Tracer<'_> {
        Tracer {
            bvh: self,
            children: self.stack(),
            entries: self.stack(),
        }
    }

    /// Whether anything lies in the interval of each ray: `occluded[i]` answers `rays[i]`.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        if self.front_to_back() {
            // Picking by distance needs stacks with distances; it is here to be compared, not to be fast.
            self.occluded_observed(rays, occluded, Nothing);
        } else {
            self.wave(
                Occlusion {
                    pick: InOrder,
                    observer: Nothing,
                },
                rays,
                occluded,
            );
        }
    }

    /// [`AnyBvh::occluded_batch`], and what each ray cost.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn occluded_batch_counted(&self, rays: &[Ray], occluded: &mut [bool], costs: &mut [Cost]) {
        assert_eq!(rays.len(), costs.len(), "one cost per ray");
        self.occluded_observed(rays, occluded, Counting::new(costs));
    }

    /// [`AnyBvh::occluded_batch_counted`], and the rays are written to `log`, in whose shuffled mode
    /// children are visited in random order.
    ///
    /// # Panics
    /// If the slices differ in length, or the log was made for a tree of another shape.
    pub fn occluded_batch_logged(
        &self,
        rays: &[Ray],
        occluded: &mut [bool],
        costs: &mut [Cost],
        log: &mut Log,
    ) {
        assert_eq!(rays.len(), costs.len(), "one cost per ray");
        if let Err(error) = log.shape().check(self.shape()) {
            panic!("{error}");
        }
        let (shuffled, seed) = (log.kind().shuffled, log.seed());
        let observer = Logging {
            counting: Counting::new(costs),
            log,
        };
        if shuffled {
            let query = Occlusion {
                pick: Shuffled::new(seed),
                observer,
            };
            self.single(&mut self.stack(), query, rays, occluded);
        } else {
            self.occluded_observed(rays, occluded, observer);
        }
    }

    /// The closest hit of each ray: `hits[i]` answers `rays[i]`. At equal distances the smallest
    /// (geom_id, prim_id) wins.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn intersect_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        self.wave(Closest, rays, hits);
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
        on_tree!(&self.tree, tree => order::learned::predicted_cost(tree, log, model, order))
    }

    /// Puts children and primitives where `order` wants them. A log made before counts the old slots:
    /// it is of no more use with this tree.
    ///
    /// # Panics
    /// If the order was planned for a tree of another shape.
    pub fn apply(&mut self, order: &SlotOrder) {
        if let Err(error) = order.shape.check(self.shape()) {
            panic!("{error}");
        }
        on_tree!(&mut self.tree, tree => tree.apply(order));
        self.predicted_cost = None;
    }

    fn shape(&self) -> Shape {
        on_tree!(&self.tree, tree => tree.shape())
    }

    fn front_to_back(&self) -> bool {
        on_tree!(&self.tree, tree => tree.front_to_back)
    }

    fn stack<T: Item>(&self) -> Vec<T> {
        let depth = on_tree!(&self.tree, tree => tree.depth);
        vec![T::BOTTOM; stack_size(self.width().lanes(), depth)]
    }

    /// An occlusion batch, ray by ray, with an observer.
    fn occluded_observed(&self, rays: &[Ray], occluded: &mut [bool], observer: impl Observer) {
        if self.front_to_back() {
            self.single(
                &mut self.stack(),
                Occlusion {
                    pick: FrontToBack,
                    observer,
                },
                rays,
                occluded,
            );
        } else {
            self.single(
                &mut self.stack(),
                Occlusion {
                    pick: InOrder,
                    observer,
                },
                rays,
                occluded,
            );
        }
    }

    fn single<Q: Query>(
        &self,
        stack: &mut [Q::Item],
        query: Q,
        rays: &[Ray],
        answers: &mut [Q::Answer],
    ) {
        assert_eq!(rays.len(), answers.len(), "one answer per ray");
        on_tree!(&self.tree, bvh => self.isa.dispatch(Single { bvh, stack, query, rays, answers }));
    }

    fn wave<Q: Query>(&self, query: Q, rays: &[Ray], answers: &mut [Q::Answer]) {
        if self.isa.level() == Level::Scalar {
            // Without vectors a step is long enough to fill the CPU on its own: ray by ray is 1.3 times
            // as fast (sponza, 4 wide).
            return self.single(&mut self.stack(), query, rays, answers);
        }
        assert_eq!(rays.len(), answers.len(), "one answer per ray");
        on_tree!(&self.tree, bvh => {
            self.isa.dispatch(Wave { bvh, query, rays, answers });
        });
    }
}

/// Queries one ray at a time, reusing its traversal stacks. Make one per thread.
#[derive(Debug)]
pub struct Tracer<'a> {
    bvh: &'a AnyBvh,
    /// For children in a static order.
    children: Vec<u32>,
    /// For children by distance.
    entries: Vec<Entry>,
}

impl Tracer<'_> {
    /// Whether anything lies in the ray's interval.
    pub fn occluded(&mut self, ray: &Ray) -> bool {
        let (bvh, rays) = (self.bvh, core::slice::from_ref(ray));
        let mut answer = [false];
        if bvh.front_to_back() {
            let query = Occlusion {
                pick: FrontToBack,
                observer: Nothing,
            };
            bvh.single(&mut self.entries, query, rays, &mut answer);
        } else {
            let query = Occlusion {
                pick: InOrder,
                observer: Nothing,
            };
            bvh.single(&mut self.children, query, rays, &mut answer);
        }
        answer[0]
    }

    /// The closest hit in the ray's interval; at equal distances the smallest (geom_id, prim_id).
    pub fn intersect(&mut self, ray: &Ray) -> Option<Hit> {
        let mut answer = [None];
        let rays = core::slice::from_ref(ray);
        self.bvh
            .single(&mut self.entries, Closest, rays, &mut answer);
        answer[0]
    }
}
