//! Building: from geometry, a recipe and training rays to a tree that is ready.

use alloc::sync::Arc;
use alloc::vec::Vec;

use super::bvh::Bvh;
use super::object::Object;
use super::recipe::Recipe;
use super::stage::{BinaryStage, Stage, reached};
use super::times::Stopwatch;
use crate::error::Error;
use crate::geometry::Geometry;
use crate::geometry::motion::locate;
use crate::geometry::primitives::Primitives;
use crate::monitor::{BuildMonitor, Latched};
use crate::ray::Ray;

/// What a tree is built over, how, for which rays, and who watches.
///
/// Nothing happens before the last call, which names what is to be built: a [`Bvh`], an [`Object`] for worlds, or a
/// [`Stage`] for several trees.
///
/// ```
/// use antumbra::{Build, Geometry, Ray, Recipe};
///
/// let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
/// let rays = [Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0])];
/// let bvh = Build::new(&geometry).recipe(&Recipe::fast()).rays(&rays).bvh()?;
/// assert!(bvh.occluded(&rays[0]));
/// # Ok::<(), antumbra::Error>(())
/// ```
///
/// Builds use the rayon pool that is current, if the `parallel` feature is on. A tree depends neither on the number of
/// threads nor on the monitor.
#[derive(Clone, Copy)]
#[must_use = "a build does nothing until its last call"]
pub struct Build<'a> {
    source: Source<'a>,
    recipe: Recipe,
    rays: &'a [Ray],
    times: &'a [f32],
    monitor: &'a dyn BuildMonitor,
}

/// Geometry of a build: a list of geometries, whose place in the list is their `geom_id`, or primitives that are checked
/// already.
///
/// ```
/// use antumbra::{Bvh, Geometry, Primitives, Recipe};
///
/// let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
/// let checked = Primitives::new(&geometry)?;
/// // Several trees over primitives that were checked once.
/// let (fast, best) = (Bvh::build(&checked, &Recipe::fast())?, Bvh::build(&checked, &Recipe::default())?);
/// assert_eq!(fast.bounds(), best.bounds());
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Source<'a> {
    /// Geometries, which the build checks and copies.
    Geometries(&'a [Geometry<'a>]),
    /// Primitives, with [instances](Primitives::with_instances) if there are any.
    Primitives(&'a Primitives),
    /// Primitives that stages share.
    Shared(&'a Arc<Primitives>),
}

impl<'a> Build<'a> {
    /// A build over geometries or primitives, by the default recipe, for surface rays.
    pub fn new(source: impl Into<Source<'a>>) -> Self {
        Self {
            source: source.into(),
            recipe: Recipe::default(),
            rays: &[],
            times: &[],
            monitor: &(),
        }
    }

    /// Sets the recipe: builder, collapse, order, width, instruction set and costs. Default: [`Recipe::default`].
    pub fn recipe(self, recipe: &Recipe) -> Self {
        Self {
            recipe: *recipe,
            ..self
        }
    }

    /// Learns from `rays`: a few thousand rays like those to come, in the space of the geometry.
    ///
    /// Rays that cannot hit anything are left out. Learning pays where rays differ from surface rays, synthetic rays
    /// between surfaces, from which every tree learns by default. Answers stay the same.
    pub fn rays(self, rays: &'a [Ray]) -> Self {
        Self { rays, ..self }
    }

    /// Learns from each ray at a time of its own, where something moves. Without a call all rays are of time 0. A ray is
    /// followed through the middle of the span that its time is in.
    ///
    /// # Panics
    /// The build, if there are not as many times as rays.
    pub fn times(self, times: &'a [f32]) -> Self {
        Self { times, ..self }
    }

    /// With a monitor, which receives the progress of the build and may stop it. It is queried every few milliseconds while the
    /// first tree grows and rays are followed. Copying primitives, a round of the collapse and writing nodes are not
    /// interrupted, and take one or two tenths of a second each for a million triangles.
    pub fn monitor(self, monitor: &'a dyn BuildMonitor) -> Self {
        Self { monitor, ..self }
    }

    /// Builds the tree and learns it.
    ///
    /// # Errors
    /// A vertex index out of range; more primitives than can be numbered; [`Error::Cancelled`] if the monitor stopped the
    /// build before it was done.
    pub fn bvh(self) -> Result<Bvh, Error> {
        let mut stopwatch = Stopwatch::new(self.recipe.clock);
        match self.source {
            Source::Geometries(geometries) => {
                let primitives = Primitives::new(geometries)?;
                let checked = stopwatch.lap();
                reached(0.05, self.monitor)?;
                let mut bvh = self.learned(&primitives)?;
                if let Some(times) = &mut bvh.times {
                    times.primitives = checked;
                }
                Ok(bvh)
            }
            Source::Primitives(primitives) => self.learned(primitives),
            Source::Shared(primitives) => self.learned(primitives),
        }
    }

    /// Builds an object, to be placed in [worlds](crate::World). Rays are rays in its own space.
    ///
    /// # Errors
    /// As [`Build::bvh`]; [`Error::HasInstances`] if the primitives have instances: worlds have one level of them;
    /// [`Error::Moves`] if something moves.
    pub fn object(self) -> Result<Object, Error> {
        let primitives = self.primitives()?;
        let why = "an object cannot move inside, but its instances can";
        Error::if_moves(primitives.moves(), why)?;
        if !primitives.instances.is_empty() {
            return Err(Error::HasInstances);
        }
        Ok(Object::new(self.learned(&primitives)?, &primitives))
    }

    /// Builds only the binary tree, from which trees are made for several recipes or lists of rays. Of the recipe only
    /// builder, training and clock count here.
    ///
    /// # Errors
    /// As [`Build::bvh`]; [`Error::Moves`] if something moves: [`Bvh::moving`] takes trees over
    /// [`Primitives::middle`] of every span.
    pub fn stage(self) -> Result<Stage, Error> {
        let primitives = self.primitives()?;
        Error::if_moves(
            primitives.moves(),
            "a stage makes trees of what stands still",
        )?;
        let monitor = &Latched::new(self.monitor);
        let binary = BinaryStage::new(&primitives, self.rays, &self.recipe, monitor)?;
        Ok(Stage::new(primitives, binary))
    }

    fn primitives(&self) -> Result<Arc<Primitives>, Error> {
        Ok(match self.source {
            Source::Geometries(geometries) => Arc::new(Primitives::new(geometries)?),
            Source::Primitives(primitives) => Arc::new(primitives.clone()),
            Source::Shared(primitives) => Arc::clone(primitives),
        })
    }

    fn learned(&self, primitives: &Primitives) -> Result<Bvh, Error> {
        let Self {
            recipe,
            rays,
            times,
            monitor,
            ..
        } = self;
        let monitor = &Latched::new(*monitor);
        let learned = |primitives: &Primitives, rays: &[Ray]| {
            let stage = BinaryStage::new(primitives, rays, recipe, monitor)?;
            stage.learn(primitives, rays, recipe, monitor)
        };
        if !primitives.moves() {
            return learned(primitives, rays);
        }
        assert!(
            times.is_empty() || times.len() == rays.len(),
            "one time per ray"
        );
        let spans = primitives.spans();
        let trees = (0..spans).map(|span| {
            let times = times.iter().copied().chain(core::iter::repeat(0.0));
            let timed = rays.iter().zip(times);
            let own = timed.filter(|(_, time)| locate(*time, spans).0 == span);
            learned(
                &primitives.middle(span),
                &own.map(|(ray, _)| *ray).collect::<Vec<_>>(),
            )
        });
        Bvh::moving(primitives, trees.collect::<Result<_, _>>()?)
    }
}

impl core::fmt::Debug for Build<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Build")
            .field("recipe", &self.recipe)
            .field("rays", &self.rays.len())
            .finish_non_exhaustive()
    }
}

impl<'a> From<&'a [Geometry<'a>]> for Source<'a> {
    fn from(geometries: &'a [Geometry<'a>]) -> Self {
        Self::Geometries(geometries)
    }
}

impl<'a, const COUNT: usize> From<&'a [Geometry<'a>; COUNT]> for Source<'a> {
    fn from(geometries: &'a [Geometry<'a>; COUNT]) -> Self {
        Self::Geometries(geometries)
    }
}

impl<'a> From<&'a Vec<Geometry<'a>>> for Source<'a> {
    fn from(geometries: &'a Vec<Geometry<'a>>) -> Self {
        Self::Geometries(geometries)
    }
}

impl<'a> From<&'a Primitives> for Source<'a> {
    fn from(primitives: &'a Primitives) -> Self {
        Self::Primitives(primitives)
    }
}

impl<'a> From<&'a Arc<Primitives>> for Source<'a> {
    fn from(primitives: &'a Arc<Primitives>) -> Self {
        Self::Shared(primitives)
    }
}

impl Bvh {
    /// Builds a tree over geometries and learns it from surface rays: short for
    /// `Build::new(geometries).recipe(recipe).bvh()`. The place of a geometry in the list is its `geom_id`.
    ///
    /// ```
    /// use antumbra::{Bvh, Geometry, Recipe};
    ///
    /// let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
    /// let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
    /// let bvh = Bvh::build(&geometry, &Recipe::default())?;
    /// assert_eq!(bvh.report().primitives, 1);
    /// # Ok::<(), antumbra::Error>(())
    /// ```
    ///
    /// # Errors
    /// A vertex index out of range; more primitives than can be numbered.
    pub fn build<'a>(source: impl Into<Source<'a>>, recipe: &Recipe) -> Result<Self, Error> {
        Build::new(source).recipe(recipe).bvh()
    }

    /// Builds a tree over geometries and learns it from `rays`, a few thousand rays like those to come: short for
    /// `Build::new(geometries).rays(rays).recipe(recipe).bvh()`.
    ///
    /// ```
    /// # use antumbra::{Bvh, Geometry, Ray, Recipe};
    /// # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
    /// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
    /// let sample = [Ray::between([0.2, 0.2, 0.0], [0.2, 0.2, 2.0])];
    /// let bvh = Bvh::learn(&geometry, &sample, &Recipe::default())?;
    /// assert!(bvh.occluded(&sample[0]));
    /// # Ok::<(), antumbra::Error>(())
    /// ```
    ///
    /// # Errors
    /// A vertex index out of range; more primitives than can be numbered.
    pub fn learn<'a>(
        source: impl Into<Source<'a>>,
        rays: &'a [Ray],
        recipe: &Recipe,
    ) -> Result<Self, Error> {
        Build::new(source).rays(rays).recipe(recipe).bvh()
    }
}
