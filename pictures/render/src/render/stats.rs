//! Figures of a rendering: rays, tests, times.

use std::time::Duration;

use antumbra::{BuildReport, Bvh};
use antumbra_image::Image;
use serde::{Deserialize, Serialize};

use super::job::Job;
use super::learn::Learned;
use crate::integrator::Counts;
use crate::resume::{Effort, Snapshot};

/// Figures of a rendering. Times are wall-clock seconds unless their line says otherwise.
#[derive(Clone, Debug)]
pub struct Stats {
    /// Triangles of all meshes, light shapes included.
    pub triangles: usize,
    /// Samples per pixel.
    pub spp: u32,
    /// Threads that traced.
    pub threads: usize,
    /// Name of the generator of random values, see [`crate::Method`].
    pub sampler: &'static str,
    /// Number of closest-hit rays.
    pub closest_rays: u64,
    /// Number of shadow rays: occlusion queries, which find only whether anything is in the way.
    pub shadow_rays: u64,
    /// Number of shadow rays that are occluded.
    pub occluded_rays: u64,
    /// Training rays of the child order. With a learned collapse, a sample of the shadow rays of the pre-pass.
    pub logged_rays: u64,
    /// Node tests (all children of a node at once) per shadow ray in the first tree: mean over the rays of the
    /// pre-pass, or over all rays if nothing was learned. `None` if not counted, or without shadow rays.
    pub node_tests_before: Option<f64>,
    /// Primitive tests per shadow ray in the first tree, over the same rays.
    pub prim_tests_before: Option<f64>,
    /// Node tests per shadow ray in the final tree: mean over the rays of the main pass.
    pub node_tests_after: Option<f64>,
    /// Primitive tests per shadow ray in the final tree, over the same rays.
    pub prim_tests_after: Option<f64>,
    /// Node tests per shadow ray outside of instances, in the first and in the final tree.
    pub top_node_tests: [Option<f64>; 2],
    /// Predicted cost of a shadow ray in the final tree before it was ordered. `None` without a training log.
    pub predicted_cost_before: Option<f64>,
    /// Predicted cost of a shadow ray in the child order applied. `None` without a training log.
    pub predicted_cost_after: Option<f64>,
    /// Time of the binary tree, of the surface rays of a learned collapse, and of the first collapse. Work that an
    /// earlier rendering of the world did counts as if done now.
    pub build_seconds: f64,
    /// Time of the pre-pass. With a learned collapse, also of following the training rays through the binary tree
    /// and through the final one.
    pub log_seconds: f64,
    /// Time of ordering the tree. With a learned collapse, also of collapsing it again.
    pub sort_seconds: f64,
    /// Part of `sort_seconds` that plans and applies the order, on one thread.
    pub order_seconds: f64,
    /// Time from the first camera ray to the film, pre-pass and ordering included. Predicting costs is left out,
    /// since only these figures need it.
    pub render_seconds: f64,
    /// Shares of the phases in the time of all threads.
    pub split: Split,
    /// Samples that were negative or not finite. The picture is without them.
    pub dropped_samples: u64,
    /// Pixel of the first dropped sample, in the order of tiles and samples. (0, 0) is the top left of the full
    /// picture.
    pub dropped_at: Option<[i32; 2]>,
    /// [`image_hash`] of the picture.
    pub image_hash: u64,
    /// Figures of the final tree.
    pub build: BuildReport,
    /// Whether batches prefetched in the final tree, see [`BuildReport::prefetches`].
    pub prefetch: bool,
}

/// Seconds of every kind of work, summed over threads. No second counts twice. Building, following rays and
/// ordering count once, however many threads help.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Split {
    /// Building, as [`Stats::build_seconds`].
    pub build: f64,
    /// The whole pre-pass, and following the training rays.
    pub log: f64,
    /// Ordering, as [`Stats::sort_seconds`].
    pub sort: f64,
    /// Shadow queries of the main pass.
    pub shadow: f64,
    /// Closest-hit queries of the main pass.
    pub closest: f64,
    /// Camera rays, random values, materials and lights of the main pass.
    pub shading: f64,
    /// Adding samples to the film, and the film to the picture.
    pub film: f64,
}

impl Split {
    /// Sum of all kinds of work.
    pub fn busy(&self) -> f64 {
        self.named().into_iter().map(|(_, seconds)| seconds).sum()
    }

    /// Every kind of work with its name, in order.
    pub fn named(&self) -> [(&'static str, f64); 7] {
        [
            ("build", self.build),
            ("log", self.log),
            ("sort", self.sort),
            ("shadow", self.shadow),
            ("closest", self.closest),
            ("shading", self.shading),
            ("film", self.film),
        ]
    }
}

impl Stats {
    /// Shadow rays over all rays. 0 without rays.
    pub fn shadow_share(&self) -> f64 {
        let all = self.shadow_rays + self.closest_rays;
        if all == 0 {
            0.0
        } else {
            self.shadow_rays as f64 / all as f64
        }
    }
}

/// Wall-clock times of the phases of a rendering.
pub(super) struct Times {
    /// Building the tree, including a rebuild from scratch for a builder that needs rays.
    pub build: Duration,
    /// Making pixels of the film's sums.
    pub developing: Duration,
    /// First camera ray to film, without predictions and rebuilding.
    pub render: Duration,
}

/// A traced picture, with all that its figures are made of.
pub(super) struct Traced<'a> {
    pub job: &'a Job<'a>,
    pub learned: &'a Learned,
    pub bvh: &'a Bvh,
    pub image: &'a Image,
    /// Effort of the main pass.
    pub effort: Effort,
    pub times: Times,
}

impl Traced<'_> {
    /// Figures of the rendering, which `snapshot` is the state of. Tests are known if they were `counted`.
    pub fn stats(&self, snapshot: &Snapshot, counted: bool) -> Stats {
        let Self {
            job, learned, bvh, ..
        } = self;
        let figures = &learned.figures;
        let prepass = snapshot.earlier.prepass;
        let mut total = self.effort.counts;
        total.add(&prepass);
        let after = if counted {
            mean_tests(&self.effort.counts)
        } else {
            [None; 3]
        };
        let before = match &learned.prepass {
            Some(_) => mean_tests(&prepass),
            None => after,
        };
        Stats {
            triangles: job.world.triangle_count(),
            spp: job.spp,
            threads: rayon::current_num_threads(),
            sampler: job.method.name(),
            closest_rays: total.closest_rays,
            shadow_rays: total.shadow_rays,
            occluded_rays: total.occluded_rays,
            logged_rays: figures.logged_rays,
            node_tests_before: before[0],
            prim_tests_before: before[1],
            node_tests_after: after[0],
            prim_tests_after: after[1],
            top_node_tests: [before[2], after[2]],
            predicted_cost_before: figures.predicted.map(|[before, _]| before),
            predicted_cost_after: figures.predicted.map(|[_, after]| after),
            build_seconds: self.times.build.as_secs_f64(),
            log_seconds: learned.logging.as_secs_f64(),
            sort_seconds: figures.sorting.as_secs_f64(),
            order_seconds: figures.ordering.as_secs_f64(),
            render_seconds: self.times.render.as_secs_f64(),
            split: self.split(),
            dropped_samples: snapshot.dropped_samples(),
            dropped_at: snapshot.dropped_at(),
            image_hash: image_hash(self.image),
            build: bvh.report(),
            prefetch: bvh.report().prefetches,
        }
    }

    fn split(&self) -> Split {
        let Effort {
            counts,
            busy,
            filming,
        } = self.effort;
        let prepass = self.learned.prepass.as_ref();
        let logging =
            self.learned.figures.following + prepass.map_or(Duration::ZERO, |pass| pass.busy);
        let queries = counts.shadow + counts.closest;
        Split {
            build: self.times.build.as_secs_f64(),
            log: logging.as_secs_f64(),
            sort: self.learned.figures.sorting.as_secs_f64(),
            shadow: counts.shadow.as_secs_f64(),
            closest: counts.closest.as_secs_f64(),
            shading: busy.saturating_sub(filming + queries).as_secs_f64(),
            film: (filming + self.times.developing).as_secs_f64(),
        }
    }
}

/// Mean node tests, primitive tests and node tests outside of instances per shadow ray. `None` without rays.
fn mean_tests(counts: &Counts) -> [Option<f64>; 3] {
    // Every counted ray tests the root at least.
    let rays = if counts.node_tests > 0 {
        counts.shadow_rays
    } else {
        0
    };
    [counts.node_tests, counts.prim_tests, counts.top_node_tests]
        .map(|n| (rays > 0).then(|| n as f64 / rays as f64))
}

/// Hash of the bits of a picture: FNV-1a over size, window and pixels, little-endian.
pub fn image_hash(image: &Image) -> u64 {
    let window = image.window();
    let header = [
        image.width() as u32,
        image.height() as u32,
        window.x0 as u32,
        window.y0 as u32,
        window.x1 as u32,
        window.y1 as u32,
    ];
    let pixels = image.pixels().iter().flatten().map(|value| value.to_bits());
    let bytes = header.into_iter().chain(pixels).flat_map(u32::to_le_bytes);
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use antumbra_image::Window;

    #[test]
    fn hashes_tell_pictures_apart() {
        let image = |window, value| {
            Image::from_fn(4, 4, window, |_, _| [0.0, value, 1.0]).expect("a valid window")
        };
        let full = Window::full(4, 4);
        let moved = Window { x0: 1, ..full };
        let reference = image_hash(&image(full, 0.5));
        assert_eq!(reference, image_hash(&image(full, 0.5)));
        assert_ne!(reference, image_hash(&image(full, 0.5_f32.next_up())));
        assert_ne!(reference, image_hash(&image(moved, 0.5)));
        assert_ne!(
            image_hash(&image(full, 0.0)),
            image_hash(&image(full, -0.0))
        );
    }
}
