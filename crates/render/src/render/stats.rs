//! What a rendering did and how long it took.

use antumbra::BuildReport;
use antumbra_image::Image;
use serde::{Deserialize, Serialize};

use crate::integrator::tracer::Counts;

/// Figures of a rendering. Times are wall-clock seconds unless they say otherwise.
#[derive(Clone, Debug)]
pub struct Stats {
    /// Triangles of all meshes, those of light shapes included.
    pub triangles: usize,
    /// Samples per pixel.
    pub spp: u32,
    /// Threads that traced.
    pub threads: usize,
    /// Name of the generator of random values; see [`crate::Method`].
    pub sampler: &'static str,
    /// Closest-hit rays.
    pub closest_rays: u64,
    /// Shadow rays (rays that asked only whether anything is in the way).
    pub shadow_rays: u64,
    /// Shadow rays that met something.
    pub occluded_rays: u64,
    /// Shadow rays that an order was learned from. With a learned collapse they are a sample of those of the
    /// pre-pass.
    pub logged_rays: u64,
    /// Box tests (of all children of a node at once) per shadow ray in the tree to begin with: mean over the rays
    /// of the samples that were learned from, or over all if nothing was learned. `None` when not counted or without shadow rays.
    pub node_tests_before: Option<f64>,
    /// Primitive tests per shadow ray, likewise.
    pub prim_tests_before: Option<f64>,
    /// Box tests per shadow ray in the final tree: mean over the rays of the other samples.
    pub node_tests_after: Option<f64>,
    /// Primitive tests per shadow ray, likewise.
    pub prim_tests_after: Option<f64>,
    /// Those of the box tests that were made outside of instances, before and after likewise.
    pub top_node_tests: [Option<f64>; 2],
    /// Cost of a shadow ray by the model and the log, in the final tree before it was ordered; `None`
    /// without a log.
    pub predicted_cost_before: Option<f64>,
    /// The same for the order applied.
    pub predicted_cost_after: Option<f64>,
    /// Time of the binary tree, of the surface rays that a learned collapse begins with (also if they were followed
    /// for an earlier rendering of the same world), and of the first collapse.
    pub build_seconds: f64,
    /// Time of tracing the samples that were learned from; with a learned collapse, of following their
    /// shadow rays through the binary tree and the final one, too.
    pub log_seconds: f64,
    /// Time of ordering the tree and of trying whether to prefetch; with a learned collapse, of making it anew, too.
    pub sort_seconds: f64,
    /// Time from the first camera ray to the film, logging and ordering included. The time to predict costs
    /// is left out: it serves these figures, not the picture.
    pub render_seconds: f64,
    /// What all of the time went into.
    pub split: Split,
    /// Samples that were not finite or negative; they are left out of the picture.
    pub dropped_samples: u64,
    /// Pixel of the first of them, in the order of tiles and samples; (0, 0) is the top left of the full picture.
    pub dropped_at: Option<[i32; 2]>,
    /// [`image_hash`] of the picture.
    pub image_hash: u64,
    /// The tree.
    pub build: BuildReport,
    /// Whether batches prefetched in it, see [`antumbra::AnyBvh::prefetches`].
    pub prefetch: bool,
}

/// Where the time went: seconds that share nothing, summed over threads. Work between the phases (building,
/// following rays, ordering) counts once however many threads help with it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Split {
    /// As [`Stats::build_seconds`].
    pub build: f64,
    /// Samples that were learned from, whatever the time in them went into, and following their shadow rays
    /// for a learned collapse.
    pub log: f64,
    /// As [`Stats::sort_seconds`].
    pub sort: f64,
    /// Shadow queries of the other samples.
    pub shadow: f64,
    /// Closest-hit queries of the other samples.
    pub closest: f64,
    /// Camera rays, random values, materials and lights of the other samples.
    pub shading: f64,
    /// Adding samples to the film, and the film to the picture.
    pub film: f64,
}

impl Split {
    /// All of it.
    pub fn busy(&self) -> f64 {
        self.named().into_iter().map(|(_, seconds)| seconds).sum()
    }

    /// Every part with its name, in the order of the work.
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
    /// Shadow rays over all rays; 0 if there were none.
    pub fn shadow_share(&self) -> f64 {
        let all = self.shadow_rays + self.closest_rays;
        if all == 0 {
            0.0
        } else {
            self.shadow_rays as f64 / all as f64
        }
    }
}

/// Mean box tests, primitive tests and box tests outside of instances per shadow ray; `None` without rays.
pub(crate) fn mean_tests(counts: &Counts) -> [Option<f64>; 3] {
    // Every ray that was counted tested the root at least.
    let rays = if counts.node_tests > 0 {
        counts.shadow_rays
    } else {
        0
    };
    [counts.node_tests, counts.prim_tests, counts.top_node_tests]
        .map(|n| (rays > 0).then(|| n as f64 / rays as f64))
}

/// A fingerprint of the bits of a picture: FNV-1a over its size, window and pixels, little-endian.
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
