//! Figures of one combination: a row of the results.

use antumbra_render::{Split, Stats};
use serde::{Deserialize, Serialize};

use super::kinds::{By, Kind, Part, Trained};
use super::plan::{Combination, Replay};

/// One rendering or replay, summed up. Tests are means per occlusion ray.
///
/// In a rendering, "before" is measured over the training rays, "after" over all other shadow rays.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Row {
    /// Name of the scene.
    pub scene: String,
    /// How the row was measured.
    pub by: By,
    /// The question of the study that the row belongs to.
    pub part: Part,
    /// Kind of the rays that were measured.
    pub rays: Kind,
    /// Triangles of the scene, those of an object once for every instance.
    pub triangles: usize,
    /// Children per node.
    pub width: usize,
    /// Builder of the binary tree.
    pub tree: String,
    /// Collapse that made the tree wide.
    pub collapse: String,
    /// Child order.
    pub order: String,
    /// Instruction set.
    pub level: String,
    /// Threads of the process.
    pub threads: usize,
    /// Samples per pixel.
    pub spp: u32,
    /// Origin of the training rays.
    pub learned_from: Trained,
    /// Number of training rays.
    pub log_rays: u64,
    /// Number of held-out rays, which were measured.
    pub test_rays: u64,
    /// Shadow rays of the whole rendering; null in a replay.
    pub shadow_rays: Option<u64>,
    /// Share of shadow rays among all rays; null in a replay.
    pub shadow_share: Option<f64>,
    /// Share of the measured rays that meet something.
    pub occluded_share: f64,
    /// Node tests of the training rays, in the tree before its children are ordered.
    pub node_tests_before: Option<f64>,
    /// Primitive tests of the training rays, in the tree before its children are ordered.
    pub prim_tests_before: Option<f64>,
    /// Node tests of the held-out rays.
    pub node_tests_after: Option<f64>,
    /// Primitive tests of the held-out rays.
    pub prim_tests_after: Option<f64>,
    /// Node tests of the training rays outside of instances; null in a scene without any.
    pub top_node_tests_before: Option<f64>,
    /// Node tests of the held-out rays outside of instances; null in a scene without any.
    pub top_node_tests_after: Option<f64>,
    /// Node tests of the occluded rays; null in a rendering.
    pub node_tests_occluded: Option<f64>,
    /// Node tests of the rays that are not occluded; null in a rendering.
    pub node_tests_unoccluded: Option<f64>,
    /// Fewest node tests of the occluded rays in any child order of this tree, chosen for each ray.
    pub oracle_occluded: Option<f64>,
    /// Node tests of the rays that are not occluded, which no child order changes.
    pub oracle_unoccluded: Option<f64>,
    /// Cost that the cost model predicts before the children are ordered.
    pub predicted_cost_before: Option<f64>,
    /// Cost that the cost model predicts for the child order.
    pub predicted_cost_after: Option<f64>,
    /// Time to trace and log the training rays.
    pub log_seconds: f64,
    /// Time to order the children.
    pub sort_seconds: f64,
    /// Part of it that plans and applies the order: sorting alone, as the paper has it.
    #[serde(default)]
    pub order_seconds: f64,
    /// Time to build and collapse the tree.
    pub build_seconds: f64,
    /// Time of the rendering; null in a replay.
    pub render_seconds: Option<f64>,
    /// Fastest and slowest of the timed renderings; null in a replay.
    #[serde(default)]
    pub render_seconds_range: Option<[f64; 2]>,
    /// How many renderings were timed; the other times are those of the one that is median.
    #[serde(default)]
    pub timed_renderings: u32,
    /// Where the time of all threads went; null in a replay.
    pub busy_seconds: Option<Split>,
    /// Millions of rays per second on one thread, in batches; null in a rendering.
    pub mrays_per_s: Option<f64>,
    /// Speed relative to order `simple` on the default tree collapsed by area, timed in turn with it.
    pub speed: Option<f64>,
    /// Whether the answers of a replay were those of that tree, bit for bit; null in a rendering.
    pub equal_answers: Option<bool>,
    /// Hash of the image, as 16 hexadecimal digits; null in a replay.
    pub image_hash: Option<String>,
}

/// Facts that all rows of a scene share.
pub struct Common {
    pub scene: String,
    pub triangles: usize,
    pub two_levels: bool,
    pub level: String,
    pub threads: usize,
    pub spp: u32,
}

/// Figures of a replay.
pub struct Replayed {
    pub log_rays: u64,
    pub test_rays: u64,
    pub occluded_share: f64,
    pub node_tests: f64,
    pub top_node_tests: f64,
    pub prim_tests: f64,
    pub node_tests_occluded: Option<f64>,
    pub node_tests_unoccluded: Option<f64>,
    pub oracle: [Option<f64>; 2],
    pub predicted: Option<[f64; 2]>,
    pub log_seconds: f64,
    pub sort_seconds: f64,
    pub build_seconds: f64,
    pub mrays_per_s: f64,
    pub speed: f64,
    pub equal_answers: bool,
}

impl Row {
    /// The row of a rendering that counted; its times include that.
    pub fn of_rendering(common: &Common, combination: &Combination, stats: &Stats) -> Self {
        let test_rays = stats.shadow_rays.saturating_sub(stats.logged_rays);
        Self {
            test_rays,
            log_rays: stats.logged_rays,
            shadow_rays: Some(stats.shadow_rays),
            shadow_share: Some(stats.shadow_share()),
            occluded_share: share(stats.occluded_rays, stats.shadow_rays),
            node_tests_before: stats.node_tests_before,
            prim_tests_before: stats.prim_tests_before,
            node_tests_after: stats.node_tests_after,
            prim_tests_after: stats.prim_tests_after,
            top_node_tests_before: stats.top_node_tests[0].filter(|_| common.two_levels),
            top_node_tests_after: stats.top_node_tests[1].filter(|_| common.two_levels),
            predicted_cost_before: stats.predicted_cost_before,
            predicted_cost_after: stats.predicted_cost_after,
            log_seconds: stats.log_seconds,
            sort_seconds: stats.sort_seconds,
            order_seconds: stats.order_seconds,
            build_seconds: stats.build_seconds,
            render_seconds: Some(stats.render_seconds),
            render_seconds_range: Some([stats.render_seconds; 2]),
            timed_renderings: 1,
            busy_seconds: Some(stats.split),
            image_hash: Some(format!("{:016x}", stats.image_hash)),
            ..Self::empty(common, combination, By::Render)
        }
    }

    /// The row of a replay.
    pub fn of_replay(common: &Common, replay: &Replay, found: &Replayed) -> Self {
        Self {
            part: replay.part,
            rays: replay.kind,
            learned_from: replay.trained,
            log_rays: found.log_rays,
            test_rays: found.test_rays,
            occluded_share: found.occluded_share,
            node_tests_after: Some(found.node_tests),
            prim_tests_after: Some(found.prim_tests),
            top_node_tests_after: Some(found.top_node_tests).filter(|_| common.two_levels),
            node_tests_occluded: found.node_tests_occluded,
            node_tests_unoccluded: found.node_tests_unoccluded,
            oracle_occluded: found.oracle[0],
            oracle_unoccluded: found.oracle[1],
            predicted_cost_before: found.predicted.map(|[before, _]| before),
            predicted_cost_after: found.predicted.map(|[_, after]| after),
            log_seconds: found.log_seconds,
            sort_seconds: found.sort_seconds,
            order_seconds: found.sort_seconds,
            build_seconds: found.build_seconds,
            mrays_per_s: Some(found.mrays_per_s),
            speed: Some(found.speed),
            equal_answers: Some(found.equal_answers),
            ..Self::empty(common, &replay.combination, By::Replay)
        }
    }

    /// A row about a combination, without any figures.
    fn empty(common: &Common, combination: &Combination, by: By) -> Self {
        Self {
            scene: common.scene.clone(),
            by,
            part: Part::Techniques,
            rays: Kind::Shadow,
            triangles: common.triangles,
            width: combination.width.lanes(),
            tree: combination.tree.name().to_owned(),
            collapse: combination.collapse.name().to_owned(),
            order: combination.order.name().to_owned(),
            level: common.level.clone(),
            threads: common.threads,
            spp: common.spp,
            learned_from: Trained::TestCamera,
            log_rays: 0,
            test_rays: 0,
            shadow_rays: None,
            shadow_share: None,
            occluded_share: 0.0,
            node_tests_before: None,
            prim_tests_before: None,
            node_tests_after: None,
            prim_tests_after: None,
            top_node_tests_before: None,
            top_node_tests_after: None,
            node_tests_occluded: None,
            node_tests_unoccluded: None,
            oracle_occluded: None,
            oracle_unoccluded: None,
            predicted_cost_before: None,
            predicted_cost_after: None,
            log_seconds: 0.0,
            sort_seconds: 0.0,
            order_seconds: 0.0,
            build_seconds: 0.0,
            render_seconds: None,
            render_seconds_range: None,
            timed_renderings: 0,
            busy_seconds: None,
            mrays_per_s: None,
            speed: None,
            equal_answers: None,
            image_hash: None,
        }
    }

    /// Takes over the times of other renderings of the same: those of the median one, and how far they are spread.
    pub fn time(&mut self, mut others: Vec<&Self>) {
        let seconds = |row: &Self| row.render_seconds.unwrap_or(f64::INFINITY);
        others.sort_by(|a, b| seconds(a).total_cmp(&seconds(b)));
        let Some(other) = others.get(others.len() / 2) else {
            return;
        };
        self.timed_renderings = others.len() as u32;
        let ends = others.first().zip(others.last());
        self.render_seconds_range = ends.map(|(first, last)| [seconds(first), seconds(last)]);
        self.order_seconds = other.order_seconds;
        self.log_seconds = other.log_seconds;
        self.sort_seconds = other.sort_seconds;
        self.build_seconds = other.build_seconds;
        self.render_seconds = other.render_seconds;
        self.busy_seconds = other.busy_seconds;
    }

    /// Slowest over fastest of the timed renderings; `None` if only one was timed.
    pub fn spread(&self) -> Option<f64> {
        let [fastest, slowest] = self.render_seconds_range?;
        (self.timed_renderings > 1).then(|| slowest / fastest)
    }

    /// Cost of a held-out ray: node tests, and primitive tests at what they cost.
    pub fn cost(&self, costs: &antumbra::CostModel) -> Option<f64> {
        let tests = self.node_tests_after.zip(self.prim_tests_after);
        tests.map(|(nodes, prims)| f64::from(costs.node) * nodes + f64::from(costs.prim) * prims)
    }

    /// Whether this is about that tree and collapse.
    pub fn is_on(&self, tree: &str, collapse: &str) -> bool {
        self.tree == tree && self.collapse == collapse
    }
}

/// `part` of `whole`; 0 of nothing.
pub fn share(part: u64, whole: u64) -> f64 {
    if whole == 0 {
        0.0
    } else {
        part as f64 / whole as f64
    }
}
