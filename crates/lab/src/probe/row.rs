//! Figures of a probe.

use antumbra::lab::Cost;
use antumbra::{Bvh, Ray};
use serde::Serialize;

use super::turns::Speed;
use super::{Part, Subject, check_equal};
use crate::Error;
use crate::study::Kind;

pub use crate::counted::counted;

/// One technique on one tree, for one kind of rays. Tests are means per held-out ray. A figure that a part does not
/// have is null.
#[derive(Clone, Debug, Default, Serialize)]
#[non_exhaustive]
pub struct Row {
    /// Name of the scene.
    pub scene: String,
    /// Name of the experiment.
    pub part: &'static str,
    /// Kind of the rays.
    pub rays: &'static str,
    /// Builder of the binary tree.
    pub tree: &'static str,
    /// Collapse.
    pub collapse: &'static str,
    /// Children per node.
    pub width: usize,
    /// Name of the technique.
    pub technique: String,
    /// Frame of a moving camera.
    pub frame: Option<usize>,
    /// Number of training rays.
    pub log_rays: usize,
    /// Number of held-out rays.
    pub test_rays: usize,
    /// Share of the held-out rays that hit something.
    pub occluded_share: f64,
    /// Node tests.
    pub node_tests: f64,
    /// Primitive tests.
    pub prim_tests: f64,
    /// Node tests, and primitive tests at what they cost.
    pub cost: f64,
    /// Fewest node tests by any order of this tree, chosen for each ray.
    pub oracle: Option<f64>,
    /// Share of the nodes that pick near first.
    pub near_share: Option<f64>,
    /// Share of the nodes that pick far first.
    pub far_share: Option<f64>,
    /// Cost by equation 1.
    pub independent: Option<f64>,
    /// Cost by the model of exclusive events.
    pub exclusive: Option<f64>,
    /// Cost by the model of overlapping events.
    pub overlapping: Option<f64>,
    /// Cost by the model of pairs.
    pub paired: Option<f64>,
    /// Speed in batches, relative to the first technique of the tree: median over the rounds.
    pub batch_speed: Option<f64>,
    /// Its lower quartile.
    pub batch_low: Option<f64>,
    /// Its upper quartile.
    pub batch_high: Option<f64>,
    /// Speed ray by ray, relative to the first technique of the tree: median over the rounds.
    pub single_speed: Option<f64>,
    /// Its lower quartile.
    pub single_low: Option<f64>,
    /// Its upper quartile.
    pub single_high: Option<f64>,
    /// Million rays per second in batches.
    pub mrays_per_s: Option<f64>,
    /// Bytes of the tree.
    pub bytes: Option<usize>,
    /// Milliseconds of learning.
    pub learn_ms: Option<f64>,
}

impl Row {
    /// A row without figures.
    pub(super) fn new(
        subject: &Subject<'_>,
        part: Part,
        kind: Kind,
        technique: impl Into<String>,
    ) -> Self {
        Self {
            scene: subject.scene.name.clone(),
            part: part.name(),
            rays: kind.name(),
            width: subject.recipe.width.lanes(),
            technique: technique.into(),
            log_rays: subject.lots.train(kind).len(),
            test_rays: subject.lots.test(kind).len(),
            ..Self::default()
        }
    }

    /// A row with the counts of `rays` in a tree, whose answers must be those `expected`, if any are. They are expected from
    /// then on.
    ///
    /// # Errors
    /// [`Error::Differ`].
    pub(super) fn counted(
        self,
        bvh: &Bvh,
        rays: &[Ray],
        prim_cost: f32,
        expected: &mut Option<Vec<bool>>,
    ) -> Result<Self, Error> {
        let (answers, costs) = counted(bvh, rays);
        let mut row = self;
        row.count(&costs, &answers, f64::from(prim_cost));
        let expected = expected.get_or_insert_with(|| answers.clone());
        check_equal(&row.scene, &row.technique, &answers, expected)?;
        Ok(row)
    }

    /// Takes over what rays cost in the mean.
    pub fn count(&mut self, costs: &[Cost], answers: &[bool], prim_cost: f64) {
        let rays = costs.len().max(1) as f64;
        let sum = |of: fn(&Cost) -> u32| costs.iter().map(|c| f64::from(of(c))).sum::<f64>() / rays;
        self.node_tests = sum(|cost| cost.node_tests);
        self.prim_tests = sum(|cost| cost.prim_tests);
        self.cost = self.node_tests + prim_cost * self.prim_tests;
        self.occluded_share = answers.iter().filter(|one| **one).count() as f64 / rays;
    }

    /// Takes over the speed in batches, or ray by ray.
    pub(super) fn time(&mut self, speed: Speed, batch: bool) {
        let figures = [speed.median, speed.low, speed.high].map(Some);
        if batch {
            [self.batch_speed, self.batch_low, self.batch_high] = figures;
            self.mrays_per_s = Some(1e-6 * self.test_rays as f64 / speed.seconds);
        } else {
            [self.single_speed, self.single_low, self.single_high] = figures;
        }
    }
}

/// The rows as comma-separated values, with a line of names.
///
/// # Errors
/// [`Error::Report`] if they cannot be written.
pub fn csv(rows: &[Row]) -> Result<Vec<u8>, Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in rows {
        writer.serialize(row).map_err(Error::report)?;
    }
    writer.into_inner().map_err(Error::report)
}
