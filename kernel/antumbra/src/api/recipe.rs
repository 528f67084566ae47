//! The recipe: every choice that makes a tree, with its default.

use antumbra_simd::Isa;

use super::times::Clock;
use crate::builder::Builder;
use crate::collapse::Collapse;
use crate::order::Order;
use crate::trace::engine::Engine;
use crate::tree::costs::CostModel;
use antumbra_simd::named_list;

/// Every choice that makes a tree, from builder to child order.
///
/// `Recipe::default()` is what Antumbra recommends and what its program uses. Other choices are set by name:
///
/// ```
/// use antumbra::recipe::{Builder, Order};
/// use antumbra::Recipe;
///
/// let recipe = Recipe::default().builder(Builder::BinnedSah).order(Order::SortPlus);
/// assert_eq!(recipe.order, Order::SortPlus);
/// ```
///
/// No choice changes an answer; all of them change what an answer costs.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Recipe {
    /// How the binary tree is built. Default: [`Builder::Reinsertion`].
    pub builder: Builder,
    /// How the binary tree is made wide. Default: [`Collapse::Learned`].
    pub collapse: Collapse,
    /// In which order occlusion rays visit children. Default: [`Order::Joint`].
    pub order: Order,
    /// What answers queries: an instruction set, and the number of children per node. Default: the best of this CPU.
    pub engine: Engine,
    /// Costs of the steps of a traversal, in units of the caller's choice. Default: [`CostModel::default`].
    pub costs: CostModel,
    /// Which rays are learned from, how many surface rays are made, and the seed of learning.
    pub training: Training,
    /// Whether batches prefetch nodes and leaves. With `None` they do unless the tree fits the first cache of a CPU.
    pub prefetch: Option<bool>,
    /// Clock by which the steps are timed for [`BuildReport`](crate::BuildReport); the kernel has none of its own.
    pub clock: Option<Clock>,
}

/// Which rays a tree learns from, how many surface rays are made, and the seed of learning.
///
/// ```
/// use antumbra::Recipe;
///
/// let training = Recipe::default().surface_rays(Some(1000)).seed(7).training;
/// assert_eq!((training.surface_rays, training.seed), (Some(1000), 7));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Training {
    /// Which rays are learned from.
    pub rays: TrainingRays,
    /// Number of surface rays, synthetic rays between surfaces. `None` is a number that suits the size of the scene, 0
    /// learns only from areas.
    pub surface_rays: Option<usize>,
    /// Seed of everything random in learning.
    pub seed: u64,
}

/// Which rays a tree learns from.
///
/// ```
/// use antumbra::Recipe;
/// use antumbra::recipe::TrainingRays;
///
/// // For rays of one kind only: the tree may be slow for others.
/// let recipe = Recipe::default().training_rays(TrainingRays::Given);
/// assert_eq!(recipe.training.rays, TrainingRays::Given);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum TrainingRays {
    /// Only the rays given. A tree for one kind of rays can be slow for others.
    Given,
    /// Only surface rays: synthetic rays between surfaces.
    Surface,
    /// Both, so that no kind of rays loses much. For the nodes, the rays given weigh at least as much as all surface
    /// rays. The child order learns from one surface ray for four rays given. Only surface rays where none are given.
    #[default]
    Both,
}

named_list! {
    /// Named recipes.
    ///
    /// ```
    /// use antumbra::recipe::{Builder, Preset};
    ///
    /// let preset: Preset = "fast".parse()?;
    /// assert_eq!(preset.recipe().builder, Builder::BinnedSah);
    /// # Ok::<(), antumbra::recipe::UnknownName>(())
    /// ```
    #[derive(Default)]
    pub enum Preset("preset"): fn() -> Recipe {
        #[default]
        Default = "default",
            "Builder reinsertion, learned collapse, order joint, learned from training and surface rays",
            None, Recipe::default;
        Fast = "fast",
            "Builder binned-sah, collapse by area, no surface rays: the shortest build, and slower queries",
            None, Recipe::fast;
        Paper = "paper",
            "Builder binned-sah, collapse by area, order sort+, learned from the rays given alone",
            Some("Ogaki and Derouet-Jourdan 2016"), Recipe::paper;
    }
}

impl Preset {
    /// Returns the recipe that this preset names.
    pub fn recipe(self) -> Recipe {
        self.properties()()
    }
}

impl Default for Training {
    /// From surface rays and the rays given, seed 0.
    fn default() -> Self {
        Self {
            rays: TrainingRays::default(),
            surface_rays: None,
            seed: 0,
        }
    }
}

impl Default for Recipe {
    /// The recommended tree for the best instruction set of this CPU.
    fn default() -> Self {
        Self {
            builder: Builder::default(),
            collapse: Collapse::default(),
            order: Order::default(),
            engine: Engine::default(),
            costs: CostModel::default(),
            training: Training::default(),
            prefetch: None,
            clock: None,
        }
    }
}

impl Recipe {
    /// [`Preset::Fast`]: the shortest build, for trees that are soon built again. Children are in the order of their
    /// areas, unless rays are given to learn from. Occlusion queries run at 0.80 to 0.89 of the rate of the default's
    /// (sponza and a city).
    pub fn fast() -> Self {
        Self::default()
            .builder(Builder::BinnedSah)
            .collapse(Collapse::Area)
            .surface_rays(Some(0))
    }

    /// [`Preset::Paper`]: the trees of Ogaki and Derouet-Jourdan (2016).
    pub fn paper() -> Self {
        Self::fast()
            .surface_rays(None)
            .order(Order::SortPlus)
            .training_rays(TrainingRays::Given)
    }

    /// Sets the builder of the binary tree. Default: [`Builder::Reinsertion`].
    pub fn builder(self, builder: Builder) -> Self {
        Self { builder, ..self }
    }

    /// Sets the collapse. Default: [`Collapse::Learned`].
    pub fn collapse(self, collapse: Collapse) -> Self {
        Self { collapse, ..self }
    }

    /// Sets the child order. Default: [`Order::Joint`].
    pub fn order(self, order: Order) -> Self {
        Self { order, ..self }
    }

    /// Sets what answers queries. Default: the best of this CPU.
    pub fn engine(self, engine: Engine) -> Self {
        Self { engine, ..self }
    }

    /// Sets the instruction set, with the width that suits it.
    pub fn isa(self, isa: Isa) -> Self {
        self.engine(Engine::of(isa))
    }

    /// Sets the costs of the steps of a traversal. Default: [`CostModel::default`].
    pub fn costs(self, costs: CostModel) -> Self {
        Self { costs, ..self }
    }

    /// Sets which rays are learned from. Default: [`TrainingRays::Both`].
    pub fn training_rays(mut self, rays: TrainingRays) -> Self {
        self.training.rays = rays;
        self
    }

    /// Sets the number of surface rays, at most 2²⁴. `None`, the default, is a number that suits the size of the scene.
    pub fn surface_rays(mut self, count: Option<usize>) -> Self {
        self.training.surface_rays = count;
        self
    }

    /// Sets the seed of all random choices in learning, by default 0.
    pub fn seed(mut self, seed: u64) -> Self {
        self.training.seed = seed;
        self
    }

    /// Sets whether batches prefetch. With `None`, the default, the size of the tree decides.
    pub fn prefetch(self, prefetch: Option<bool>) -> Self {
        Self { prefetch, ..self }
    }

    /// Sets the clock that times the steps of the build. Default: `None`, and the steps are not timed.
    pub fn clock(self, clock: Option<Clock>) -> Self {
        Self { clock, ..self }
    }
}
