//! The tree that users hold.

use alloc::format;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt;

use antumbra_simd::Isa;

use super::times::BuildTimes;
use crate::aabb::Aabb;
use crate::error::Error;
use crate::geometry::masks::SceneMasks;
use crate::geometry::primitives::Primitives;
use crate::shape::Shape;
use crate::trace::engine::Engine;
use crate::trace::memory::Pool;
use crate::tree::wide::Tree;
use crate::tree::width::Width;

/// A bounding volume hierarchy that answers occlusion and closest-hit queries.
///
/// | to | call |
/// |---|---|
/// | build | [`Bvh::build`], [`Bvh::learn`], and [`Build`](crate::Build) for every choice |
/// | trace one ray | [`Bvh::occluded`], [`Bvh::intersect`], and [`Bvh::query`] for conditions and all hits |
/// | trace many rays | [`Bvh::batch`], and [`Bvh::group`] for many points in the same directions |
/// | look around points | [`Bvh::closest`], [`Bvh::within`], [`Bvh::contains`], [`Bvh::signed_distance`], [`Bvh::winding_number`], and [`Bvh::points`] for many |
/// | follow what moves | [`Bvh::refit`], [`Bvh::relearn`], and [`World`](crate::World) for instances |
/// | motion blur | [`Geometry::moving`](crate::Geometry::moving), [`RayQuery::at`](crate::RayQuery::at), [`Batch::at`](crate::Batch::at) |
/// | save and load | [`Bvh::write`], [`Bvh::read`], [`Bvh::to_bytes`], [`Bvh::from_bytes`] |
///
/// Every query returns the same bits for every width, order, level and builder. The tree can be shared among
/// any number of threads, by reference or in an [`Arc`](std::sync::Arc).
///
/// ```
/// use antumbra::{Bvh, Geometry, Ray, Recipe};
///
/// let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// let bvh = Bvh::build(&[Geometry::triangles(&positions[..], vec![[0, 1, 2]])], &Recipe::default())?;
/// let ray = Ray::between([0.2, 0.2, 0.0], [0.2, 0.2, 2.0]);
/// assert!(bvh.occluded(&ray));
/// assert_eq!(bvh.intersect(&ray).map(|hit| hit.t), Some(0.5));
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone)]
pub struct Bvh {
    pub(crate) tree: Tree,
    /// What answers queries: of the width of the tree.
    pub(crate) engine: Engine,
    /// Stored ones, see [`Primitives::stored`].
    pub(crate) primitives: usize,
    pub(crate) cutouts: usize,
    pub(crate) dropped: usize,
    pub(crate) transparent: usize,
    pub(crate) pool: Pool,
    /// What a recipe says of prefetching, see [`Bvh::prefetches`].
    pub(crate) prefetch: Option<bool>,
    /// Fields of the [report](super::report::BuildReport).
    pub(crate) predicted_cost: Option<f64>,
    pub(crate) predicted_before: Option<f64>,
    pub(crate) training_rays: u64,
    pub(crate) times: Option<BuildTimes>,
    /// Expected cost before the first refit.
    pub(crate) built_sah: Option<f64>,
    /// Masks of geometries and instances, if any were given.
    pub(crate) masks: Option<Arc<SceneMasks>>,
    /// The trees of later spans of a scene that moves.
    pub(crate) later: Vec<Bvh>,
    /// The width in the file that the tree was read from, if it is another.
    pub(crate) file_width: Option<Width>,
}

impl Bvh {
    /// A tree over these primitives, fresh from its collapse.
    pub(crate) fn fresh(tree: Tree, engine: Engine, primitives: &Primitives) -> Self {
        Self {
            tree,
            engine,
            primitives: primitives.stored(),
            cutouts: primitives.cutouts(),
            dropped: primitives.dropped(),
            transparent: primitives.transparent(),
            pool: Pool::default(),
            prefetch: None,
            predicted_cost: None,
            predicted_before: None,
            training_rays: 0,
            times: None,
            built_sah: None,
            masks: None,
            later: Vec::new(),
            file_width: None,
        }
    }

    /// Largest number of children of a node: 4, 8 or 16.
    #[must_use]
    pub fn width(&self) -> Width {
        self.tree.width()
    }

    /// The instruction set that queries run on.
    #[must_use]
    pub fn isa(&self) -> Isa {
        self.engine.isa()
    }

    /// The smallest box around everything; empty for an empty scene. Where something moves, around everything at all times;
    /// boxes of moving instances are a little larger than needed.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        let bounds = self.spans().map(|bvh| bvh.tree.bounds);
        bounds.fold(Aabb::EMPTY, |all, bounds| all.union(&bounds))
    }

    /// Checks every promise of the tree that traversal relies on; for tests and bug reports.
    ///
    /// # Errors
    /// The first broken promise, in words.
    pub fn validate(&self) -> Result<(), String> {
        for bvh in self.spans() {
            bvh.tree.check_motion()?;
        }
        let found = self.tree.validate()?;
        if found == self.primitives {
            Ok(())
        } else {
            Err(format!(
                "{found} primitives in the leaves, not {}",
                self.primitives
            ))
        }
    }

    pub(crate) fn shape(&self) -> Shape {
        self.tree.shape()
    }
}

impl Engine {
    /// Has a tree answer by this engine from now on.
    ///
    /// # Errors
    /// [`Error::OtherWidth`] if the tree has another width.
    pub fn run(self, bvh: &mut Bvh) -> Result<(), Error> {
        let [expected, found] = [self.width(), bvh.width()].map(Width::lanes);
        if expected != found {
            return Err(Error::OtherWidth { expected, found });
        }
        bvh.engine = self;
        bvh.later.iter_mut().try_for_each(|bvh| self.run(bvh))
    }
}

impl fmt::Debug for Bvh {
    /// Counts, not contents.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let report = self.report();
        f.debug_struct("Bvh")
            .field("primitives", &report.primitives)
            .field("instances", &report.instances)
            .field("nodes", &report.nodes)
            .field("width", &self.width())
            .field("isa", &self.isa().level())
            .finish_non_exhaustive()
    }
}
