//! Figures of one combination: a row of the results.

use antumbra_render::{Split, Stats};
use serde::{Deserialize, Serialize};

use super::kinds::{By, Kind, Part, Trained};
use super::plan::Combination;
use crate::{Compared, ComparedTree};

/// One tree of a picture, or one replay, summed up. Tests are means per occlusion ray.
///
/// Node tests are the paper's N_b, primitive tests its N_t. "Before" is measured over the training rays while they are
/// logged, "after" over the held-out rays, both as in the paper. "Unsorted" is measured over the held-out rays too, in
/// the tree before its children are ordered. All trees of a picture answer the same held-out rays.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
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
    /// Triangles of the scene; an object counts once for every instance.
    pub triangles: usize,
    /// Children per node.
    pub width: usize,
    /// Builder of the binary tree.
    pub tree: String,
    /// Collapse that made the tree wide.
    pub collapse: String,
    /// Child order.
    pub order: String,
    /// Cost of a primitive test by which the child order was learned: C_p, in node tests.
    pub prim_cost: f32,
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
    /// Share of the measured rays that hit something.
    pub occluded_share: f64,
    /// Node tests of the training rays while they were logged; null in a replay and without learning.
    pub node_tests_before: Option<f64>,
    /// Primitive tests of the training rays while they were logged.
    pub prim_tests_before: Option<f64>,
    /// Node tests of the held-out rays, in the tree before its children are ordered; null in a replay.
    pub node_tests_unsorted: Option<f64>,
    /// Primitive tests of the held-out rays, in the tree before its children are ordered; null in a replay.
    pub prim_tests_unsorted: Option<f64>,
    /// Node tests of the held-out rays.
    pub node_tests_after: Option<f64>,
    /// Primitive tests of the held-out rays.
    pub prim_tests_after: Option<f64>,
    /// Node tests of the training rays outside of instances while they were logged; null in a scene without any.
    pub top_node_tests_before: Option<f64>,
    /// Node tests of the held-out rays outside of instances, before the children are ordered; null in a scene without
    /// any.
    pub top_node_tests_unsorted: Option<f64>,
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
    /// Time to plan and apply the child order, without anything else.
    pub sort_seconds: f64,
    /// Time to build or collapse the tree again for the training rays; null in a replay.
    pub remake_seconds: Option<f64>,
    /// Time to build and collapse the tree.
    pub build_seconds: f64,
    /// Time of a whole picture; null in a replay.
    pub render_seconds: Option<f64>,
    /// How that time was found; null in a replay.
    pub render_time: Option<RenderTime>,
    /// Least and most of the times composed from each round; null in a replay.
    pub render_seconds_range: Option<[f64; 2]>,
    /// How often every timed batch of shadow rays was answered: rounds.
    pub timed_renderings: u32,
    /// Median time of whole pictures that were rendered apart; null if none was.
    pub measured_seconds: Option<f64>,
    /// Fastest and slowest of them.
    pub measured_seconds_range: Option<[f64; 2]>,
    /// How many whole pictures were rendered apart.
    pub measured_renderings: u32,
    /// Where the time of all threads went; null in a replay.
    pub busy_seconds: Option<Split>,
    /// Millions of rays per second on one thread, in batches; null in a rendering.
    pub mrays_per_s: Option<f64>,
    /// Speed relative to order `simple` on the default tree collapsed by area: median of interleaved rounds.
    pub speed: Option<f64>,
    /// Least and most of the speeds of the rounds.
    pub speed_range: Option<[f64; 2]>,
    /// Whether all answers equal the answers of that tree, or of the first tree of a picture, bit for bit.
    pub equal_answers: Option<bool>,
    /// Hash of the image, as 16 hexadecimal digits; null in a replay, and of a tree whose answers differ.
    pub image_hash: Option<String>,
}

/// How the time of a whole picture was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum RenderTime {
    /// Composed of the tree's own queries and learning, and of the shading and the film that all trees of the
    /// picture share. Times of threads, divided by their number.
    Composed,
    /// Measured by the clock, of a picture that was rendered with only this tree.
    Measured,
}

/// Facts that all rows of a scene share.
pub struct Common {
    pub scene: String,
    pub triangles: usize,
    pub two_levels: bool,
    pub level: String,
    pub threads: usize,
    pub spp: u32,
    /// Cost of a primitive test.
    pub prim_cost: f32,
}

impl Row {
    /// The row of a tree that was compared with others on a picture.
    pub fn of_picture(
        common: &Common,
        combination: &Combination,
        picture: &Compared,
        tree: &ComparedTree,
    ) -> Self {
        let of = |tests: Option<[f64; 3]>, place: usize| tests.map(|tests| tests[place]);
        let top = |tests| of(tests, 2).filter(|_| common.two_levels);
        let (render_seconds, render_seconds_range) = middle(tree.render_seconds.clone());
        let rays = picture.shadow_rays + picture.closest_rays;
        Self {
            test_rays: picture.held_out_rays,
            log_rays: tree.training_rays,
            shadow_rays: Some(picture.shadow_rays),
            shadow_share: Some(share(picture.shadow_rays, rays)),
            occluded_share: share(picture.occluded_rays, picture.shadow_rays),
            node_tests_before: of(tree.logging, 0),
            prim_tests_before: of(tree.logging, 1),
            node_tests_unsorted: of(tree.before, 0),
            prim_tests_unsorted: of(tree.before, 1),
            node_tests_after: of(tree.after, 0),
            prim_tests_after: of(tree.after, 1),
            top_node_tests_before: top(tree.logging),
            top_node_tests_unsorted: top(tree.before),
            top_node_tests_after: top(tree.after),
            predicted_cost_before: tree.predicted.map(|[before, _]| before),
            predicted_cost_after: tree.predicted.map(|[_, after]| after),
            log_seconds: tree.log_seconds,
            sort_seconds: tree.order_seconds,
            remake_seconds: Some((tree.sort_seconds - tree.order_seconds).max(0.0)),
            build_seconds: tree.build_seconds,
            render_seconds,
            render_time: Some(RenderTime::Composed),
            render_seconds_range,
            timed_renderings: tree.render_seconds.len() as u32,
            busy_seconds: Some(tree.split),
            equal_answers: Some(tree.agrees),
            image_hash: tree.agrees.then(|| hash(picture.image_hash)),
            ..Self::empty(common, combination, By::Render)
        }
    }

    /// The row of a whole picture that was rendered apart, for its time.
    pub fn of_rendering(common: &Common, combination: &Combination, stats: &Stats) -> Self {
        Self {
            render_seconds: Some(stats.render_seconds),
            render_time: Some(RenderTime::Measured),
            image_hash: Some(hash(stats.image_hash)),
            ..Self::empty(common, combination, By::Render)
        }
    }

    /// A row about a combination, without any figures.
    pub(super) fn empty(common: &Common, combination: &Combination, by: By) -> Self {
        Self {
            scene: common.scene.clone(),
            by,
            triangles: common.triangles,
            width: combination.width.lanes(),
            tree: combination.tree.name().to_owned(),
            collapse: combination.collapse.name().to_owned(),
            order: combination.order.name().to_owned(),
            prim_cost: combination.prim_cost.unwrap_or(common.prim_cost),
            level: common.level.clone(),
            threads: common.threads,
            spp: common.spp,
            ..Self::default()
        }
    }

    /// Takes over the times of whole pictures with this tree that were rendered apart. A picture of other bits
    /// counts as different answers: it fails the [verdict](super::Results::verdict).
    pub fn measured(&mut self, pictures: &[&Self]) {
        let times: Vec<f64> = (pictures.iter())
            .filter_map(|row| row.render_seconds)
            .collect();
        self.measured_renderings = times.len() as u32;
        (self.measured_seconds, self.measured_seconds_range) = middle(times);
        if pictures.iter().any(|row| row.image_hash != self.image_hash) {
            self.equal_answers = Some(false);
        }
    }

    /// Most over least of the composed times; `None` of a single round.
    pub fn spread(&self) -> Option<f64> {
        let [fastest, slowest] = self.render_seconds_range?;
        (self.timed_renderings > 1).then(|| slowest / fastest)
    }

    /// Cost of a held-out ray: node tests, and primitive tests at what they cost.
    pub fn cost(&self, costs: &antumbra::recipe::CostModel) -> Option<f64> {
        let tests = self.node_tests_after.zip(self.prim_tests_after);
        tests.map(|(nodes, prims)| f64::from(costs.node) * nodes + f64::from(costs.prim) * prims)
    }

    /// Whether it is of replayed rays of a kind, and of a part of the study.
    pub fn is_replay(&self, kind: Kind, part: Part) -> bool {
        self.by == By::Replay && self.rays == kind && self.part == part
    }

    /// Whether it is of a combination.
    pub fn is_of(&self, combination: &Combination) -> bool {
        self.width == combination.width.lanes()
            && self.is_on(combination.tree.name(), combination.collapse.name())
            && self.order == combination.order.name()
            && (combination.prim_cost).is_none_or(|cost| self.prim_cost == cost)
    }

    /// Whether this is about that tree and collapse.
    pub fn is_on(&self, tree: &str, collapse: &str) -> bool {
        self.tree == tree && self.collapse == collapse
    }
}

/// The middle of some times, and the least and the most.
fn middle(mut times: Vec<f64>) -> (Option<f64>, Option<[f64; 2]>) {
    times.sort_unstable_by(f64::total_cmp);
    let ends = times.first().zip(times.last());
    let ends = ends.map(|(least, most)| [*least, *most]);
    (times.get(times.len() / 2).copied(), ends)
}

/// A hash as results have it.
fn hash(hash: u64) -> String {
    format!("{hash:016x}")
}

/// `part` of `whole`; 0 of nothing.
pub fn share(part: u64, whole: u64) -> f64 {
    if whole == 0 {
        0.0
    } else {
        part as f64 / whole as f64
    }
}
