//! A tree that many pictures of one world are traced in, and what it learns between them.

use std::sync::Arc;

use antumbra::{Build, Bvh, Recipe};

use super::Task;
use super::job::Job;
use super::learn::{prepass_samples, rays_worth_learning};
use super::monitor::Monitor;
use super::prepass;
use crate::Error;
use crate::clock::clock;
use crate::options::Options;
use crate::training::{Lesson, RaySample, TrainingSample};
use crate::world::World;

/// Tree for shadow rays, kept from one picture of a world to the next.
///
/// All trees of a world give the same bits. A rendering may therefore change from one to another at any time.
#[derive(Debug)]
pub struct KeptTree {
    pub(super) bvh: Bvh,
    learned: bool,
}

impl KeptTree {
    /// The tree of the world's own builder, collapsed by area, in the builder's child order. Nothing is learned.
    pub fn unlearned(world: &World, recipe: &Recipe) -> Self {
        Self {
            bvh: world.bvh(recipe.engine),
            learned: false,
        }
    }

    /// The tree of a recipe, learned from training rays as a rendering learns it.
    ///
    /// # Errors
    /// [`Error::Order`].
    pub fn learned(world: &World, recipe: &Recipe, lesson: &Lesson) -> Result<Self, Error> {
        let recipe = recipe.clock(Some(clock));
        let rays = lesson.rays();
        let stage = if recipe.builder.needs_rays() && !rays.is_empty() {
            let build = Build::new(&world.primitives).rays(rays).recipe(&recipe);
            Arc::new(build.stage().map_err(Error::of_build)?)
        } else {
            world.stage(recipe.builder)
        };
        let mut bvh = stage
            .collapse(rays, &recipe, &())
            .map_err(Error::of_build)?;
        bvh.relearn(rays, &recipe);
        Ok(Self { bvh, learned: true })
    }

    /// Whether the tree has learned.
    pub fn is_learned(&self) -> bool {
        self.learned
    }

    /// The tree itself, for queries of one's own.
    pub fn bvh(&self) -> &Bvh {
        &self.bvh
    }

    /// Place that the camera sees at a film point, in pixels from the top left corner. `None` if it sees no surface.
    pub fn seen(&self, world: &World, film: [f32; 2]) -> Option<Sight> {
        let ray = world.camera.ray(film, [0.5; 2]);
        let hit = self.bvh.intersect(&ray)?;
        let normal = self.bvh.normal(&ray, &hit)?;
        let along: f32 = normal.iter().zip(ray.dir).map(|(n, d)| n * d).sum();
        Some(Sight {
            point: ray.at(hit.t),
            normal: match along > 0.0 {
                true => normal.map(|n| -n),
                false => normal,
            },
        })
    }
}

/// Place on a surface that a camera sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// Position in the space of the scene.
    pub point: [f32; 3],
    /// Geometric normal of length 1, on the side of the camera.
    pub normal: [f32; 3],
}

/// Training rays of the world's camera, traced in a tree. A rendering with the same options has the same ones.
///
/// # Errors
/// As [`render`](super::render()).
pub fn training_rays(
    world: &World,
    tree: &KeptTree,
    options: &Options,
    monitor: &dyn Monitor,
) -> Result<Lesson, Error> {
    let (job, _, _) = Job::begin(world, options, Task::default(), monitor)?;
    let selection = prepass_samples(&job, options);
    let empty = TrainingSample::Rays {
        rays: RaySample::new(rays_worth_learning(&job)),
        counted: false,
    };
    let (_, sample) = prepass::run(&job, &tree.bvh, &empty, selection, None)?;
    let (TrainingSample::Rays { rays, .. } | TrainingSample::Log { rays, .. }) = sample;
    Ok(Lesson::from(rays.into_rays()))
}
