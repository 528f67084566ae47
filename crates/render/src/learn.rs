//! The tree that shadow rays visit: which nodes it has and in which order they stand.
//!
//! A learned collapse is made twice. The first tree, good for any rays, is learned from synthetic surface
//! rays alone; with it the pre-pass is traced. The second is learned from a blend of those and of the
//! pre-pass's shadow rays, half and half: what the camera sees decides, and what it does not see is not
//! forgotten. Its order is then learned as an order of any tree is, from a log of the same shadow rays.

use std::time::{Duration, Instant};

use antumbra::{AnyBvh, Collapse, Cost, Learning, Log, LogKind, Ray};
use antumbra_scene::Integrator;

use crate::Error;
use crate::evidence::{Evidence, RaySample};
use crate::monitor::Phase;
use crate::options::Options;
use crate::prepass::{self, Prepass};
use crate::render::Job;
use crate::tile::Selection;
use crate::world::World;

/// What came of learning.
#[derive(Default)]
pub struct Learned {
    /// The samples traced so far.
    pub prepass: Option<Prepass>,
    /// Which they are.
    pub selection: Option<Selection>,
    /// Rays that were learned from.
    pub logged_rays: u64,
    /// Cost of a shadow ray in the tree before and after its order was applied.
    pub predicted: Option<[f64; 2]>,
    /// Time that went into `predicted`.
    pub predicting: Duration,
    /// Time from the first sample of the pre-pass to a full log, wall-clock.
    pub logging: Duration,
    /// The part of it without the pre-pass's own threads: following its rays once more.
    pub following: Duration,
    /// Time of the second collapse, and of planning and applying the order.
    pub sorting: Duration,
}

/// The tree to begin with: for any rays.
pub fn first_tree(world: &World, options: &Options) -> AnyBvh {
    match options.collapse {
        Collapse::Area => world.bvh(options.width, options.isa),
        _ => world.bvh_logged(
            world.surface_log(),
            &learning(options),
            options.width,
            options.isa,
        ),
    }
}

/// About how many shadow rays a sample has.
fn shadow_rays_per_sample(integrator: &Integrator) -> f64 {
    match integrator {
        Integrator::AmbientOcclusion { samples, .. } => f64::from(*samples),
        Integrator::Path { .. } | Integrator::DirectLighting { .. } => 4.0,
    }
}

fn learning(options: &Options) -> Learning {
    Learning {
        collapse: options.collapse,
        model: options.model,
        ..Learning::default()
    }
}

/// Orders the tree, by a sample of shadow rays if the order learns; then a learned collapse is made anew, too.
/// The logs end here: they grow with the tree, and nothing asks for them again.
pub fn learn(job: &Job, options: &Options, bvh: &mut AnyBvh) -> Result<Learned, Error> {
    let mut learned = Learned::default();
    let mut log = None;
    if let Some(kind) = options.order.log_kind() {
        let start = Instant::now();
        let pixels = job.sampled().area();
        let rays = shadow_rays_per_sample(&job.world.integrator);
        let selection = Selection::new(options.log_share, rays, pixels, job.spp, job.seed);
        let empty = match options.collapse {
            Collapse::Area => Evidence::Log(bvh.new_log(kind, job.seed)),
            _ => Evidence::Sample {
                rays: RaySample::default(),
                counted: options.counts(),
            },
        };
        let (prepass, evidence) = prepass::run(job, bvh, &empty, selection)?;
        learned.prepass = Some(prepass);
        learned.selection = selection;
        learned.logging = start.elapsed();
        log = match evidence {
            Evidence::Log(log) => Some(log),
            Evidence::Sample { rays, .. } => {
                let rays = rays.into_rays();
                learned.collapse(job, options, bvh, &rays, kind)
            }
        };
    }
    job.monitor.progress(Phase::Sort, 0, 1);
    learned.sort(options, bvh, log.as_ref())?;
    job.monitor.progress(Phase::Sort, 1, 1);
    Ok(learned)
}

impl Learned {
    /// Makes the tree anew as suits `rays`, and logs them in it; without any, leaves it as it is.
    fn collapse(
        &mut self,
        job: &Job,
        options: &Options,
        bvh: &mut AnyBvh,
        rays: &[Ray],
        kind: LogKind,
    ) -> Option<Log> {
        if rays.is_empty() {
            return None;
        }
        let start = Instant::now();
        let mut tree_log = job.world.surface_log().clone();
        // Without surfaces to start from, rays weigh as they come.
        let weight = match tree_log.weight() {
            0.0 => rays.len() as f32,
            surfaces => surfaces,
        };
        job.world.follow(&mut tree_log, rays, weight);
        self.following += start.elapsed();
        let start = Instant::now();
        let world = job.world;
        *bvh = world.bvh_logged(&tree_log, &learning(options), options.width, options.isa);
        self.sorting += start.elapsed();
        let start = Instant::now();
        let mut log = bvh.new_log(kind, job.seed);
        let mut occluded = vec![false; rays.len()];
        let mut costs = vec![Cost::default(); rays.len()];
        bvh.occluded_batch_logged(rays, &mut occluded, &mut costs, &mut log);
        self.following += start.elapsed();
        self.logging += self.following;
        Some(log)
    }

    /// Puts the tree into the order asked for.
    fn sort(
        &mut self,
        options: &Options,
        bvh: &mut AnyBvh,
        log: Option<&Log>,
    ) -> Result<(), Error> {
        if log.is_none() && options.order.log_kind().is_some() {
            // There were no rays to learn from, and the tree has the order of the synthetic ones already.
            return Ok(());
        }
        let start = Instant::now();
        let plan = bvh
            .plan(options.order, log, &options.model)
            .map_err(Error::Order)?;
        self.sorting += start.elapsed();
        if let Some(log) = log {
            let start = Instant::now();
            let cost = |plan| bvh.predicted_cost(log, &options.model, plan);
            let [before, after] = [cost(None), cost(Some(&plan))];
            self.predicted = Some([before.map_err(Error::Order)?, after.map_err(Error::Order)?]);
            self.logged_rays = log.rays();
            self.predicting = start.elapsed();
        }
        let start = Instant::now();
        bvh.apply(&plan);
        self.sorting += start.elapsed();
        Ok(())
    }
}
