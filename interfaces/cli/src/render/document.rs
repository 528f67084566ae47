//! Figures about a rendering: the JSON document, and the lines on the terminal.

use antumbra_lab::{Machine, count};
use antumbra_load::IntegratorKind;
use antumbra_render::{Split, World};
use serde::Serialize;

use super::start::Picture;
use super::until::{Grown, noise};
use crate::args::RenderArgs;
use crate::exit::{detail, say, tell};
use crate::output::text;
use crate::version;

/// The JSON document.
#[derive(Serialize)]
pub struct Document<'a> {
    pub schema: &'static str,
    #[serde(flatten)]
    pub machine: Machine,
    pub seed: u64,
    pub scene: &'a str,
    pub output: String,
    pub stderr_image: Option<String>,
    /// Shard as `I/N`; `null` for the whole picture.
    pub shard: Option<String>,
    /// Tiles that were finished before, and all tiles, if it was resumed.
    pub resumed_tiles: Option<[usize; 2]>,
    /// Size of the full picture.
    pub resolution: [u32; 2],
    /// Pixels that the image covers: `[x0, x1, y0, y1]`, half-open.
    pub pixel_bounds: [u32; 4],
    pub spp: u32,
    pub sampler: &'static str,
    pub integrator: &'static str,
    pub order: &'static str,
    pub builder: &'static str,
    pub collapse: &'static str,
    pub width: usize,
    /// Whether nodes and leaves were fetched before their turn.
    pub prefetch: bool,
    pub triangles: usize,
    pub primitives: usize,
    pub dropped_primitives: usize,
    pub nodes: usize,
    pub leaves: usize,
    pub depth: usize,
    pub tree_bytes: usize,
    pub closest_rays: u64,
    pub shadow_rays: u64,
    pub occluded_rays: u64,
    pub logged_rays: u64,
    pub shadow_share: f64,
    pub node_tests_before: Option<f64>,
    pub prim_tests_before: Option<f64>,
    pub predicted_cost_before: Option<f64>,
    pub predicted_cost_after: Option<f64>,
    pub load_seconds: f64,
    pub lower_seconds: f64,
    pub build_seconds: f64,
    pub log_seconds: f64,
    pub sort_seconds: f64,
    /// Seconds of all steps, and of earlier runs that it goes on from, as the rays are.
    pub render_seconds: f64,
    pub busy_seconds: BusySeconds,
    /// Mean standard error of a pixel over the mean of the picture, if standard errors were computed.
    pub noise: Option<f64>,
    pub dropped_samples: u64,
    /// Pixel of the first of them.
    pub dropped_at: Option<[i32; 2]>,
    pub image_hash: String,
}

/// Seconds by what they went into, summed over the threads. The parts share nothing and add up to `total`.
#[derive(Serialize)]
pub struct BusySeconds {
    #[serde(flatten)]
    pub parts: Split,
    pub total: f64,
}

impl<'a> Document<'a> {
    /// A document of a picture; `resumed_tiles` were there before.
    pub fn new(
        args: &RenderArgs,
        (picture, world): (&'a Picture, &World),
        grown: &Grown,
        resumed_tiles: Option<[usize; 2]>,
    ) -> Self {
        let (scene, options) = (&picture.scene, &picture.options);
        let stats = &grown.rendering.stats;
        Self {
            schema: "antumbra.render/1",
            machine: version::machine(options.recipe.engine.isa()),
            seed: options.seed,
            scene: &scene.name,
            output: text(&picture.file),
            stderr_image: args.stderr_image.as_deref().map(text),
            shard: args.shard.map(|shard| shard.to_string()),
            resumed_tiles,
            resolution: scene.film.resolution,
            pixel_bounds: scene.film.pixel_bounds(),
            spp: stats.spp,
            sampler: scene.sampler.kind.name(),
            integrator: IntegratorKind::of(&scene.integrator).name(),
            order: options.recipe.order.name(),
            builder: options.recipe.builder.name(),
            collapse: options.recipe.collapse.name(),
            width: options.recipe.engine.width().lanes(),
            prefetch: stats.prefetch,
            triangles: stats.triangles,
            primitives: stats.build.primitives,
            dropped_primitives: stats.build.dropped,
            nodes: stats.build.nodes,
            leaves: stats.build.leaves,
            depth: stats.build.depth,
            tree_bytes: stats.build.bytes,
            closest_rays: stats.closest_rays,
            shadow_rays: stats.shadow_rays,
            occluded_rays: stats.occluded_rays,
            logged_rays: stats.logged_rays,
            shadow_share: stats.shadow_share(),
            node_tests_before: stats.node_tests_before,
            prim_tests_before: stats.prim_tests_before,
            predicted_cost_before: stats.predicted_cost_before,
            predicted_cost_after: stats.predicted_cost_after,
            load_seconds: picture.load_seconds,
            lower_seconds: world.lower_seconds(),
            build_seconds: stats.build_seconds,
            log_seconds: stats.log_seconds,
            sort_seconds: stats.sort_seconds,
            render_seconds: grown.seconds,
            busy_seconds: BusySeconds {
                parts: stats.split,
                total: stats.split.busy(),
            },
            noise: noise(&grown.rendering),
            dropped_samples: stats.dropped_samples,
            dropped_at: stats.dropped_at,
            image_hash: hash_text(stats.image_hash),
        }
    }
}

/// An image's hash as 16 hexadecimal digits.
pub fn hash_text(hash: u64) -> String {
    format!("{hash:016x}")
}

/// Prints counts, times and files of the rendering.
pub fn summarise(document: &Document, split: &Split) {
    let shapes = match document.triangles {
        0 => format!("{} spheres", count(document.primitives as u64)),
        triangles => format!("{} triangles", count(triangles as u64)),
    };
    tell(format_args!(
        "{}: {shapes}, loaded in {:.2} s, tree built in {:.2} s",
        document.scene, document.load_seconds, document.build_seconds,
    ));
    if document.dropped_primitives > 0 {
        let dropped = count(document.dropped_primitives as u64);
        tell(format_args!(
            "{dropped} degenerate primitives were left out"
        ));
    }
    let [x, y] = document.resolution;
    tell(format_args!(
        "{x} x {y} pixels, {} samples per pixel ({}), {}",
        document.spp, document.sampler, document.integrator,
    ));
    detail(format_args!(
        "tree: order {}, builder {}, collapse {}, width {}; {} nodes, {:.1} MB",
        document.order,
        document.builder,
        document.collapse,
        document.width,
        count(document.nodes as u64),
        document.tree_bytes as f64 / 1e6,
    ));
    detail(format_args!("{}", document.machine.describe()));
    tell_work(document, split);
    if let Some([x, y]) = document.dropped_at {
        let dropped = count(document.dropped_samples);
        say(format_args!(
            "warning: {dropped} samples were negative or not finite and were left out, the first in pixel ({x}, {y})"
        ));
    }
    if let Some(noise) = document.noise {
        tell(format_args!("noise {:.2} % of the mean", 100.0 * noise));
    }
    tell(format_args!("wrote {}", document.output));
    if let Some(path) = &document.stderr_image {
        tell(format_args!("wrote {path}"));
    }
}

/// Rays, and the time that they and the rest took.
fn tell_work(document: &Document, split: &Split) {
    let rays = document.closest_rays + document.shadow_rays;
    tell(format_args!(
        "{} rays, {:.1} % of them shadow rays",
        count(rays),
        100.0 * document.shadow_share,
    ));
    if let Some([finished, all]) = document.resumed_tiles {
        tell(format_args!("went on from {finished} of {all} tiles"));
    }
    if document.logged_rays > 0 {
        tell(format_args!(
            "learned from {} shadow rays in {:.2} s",
            count(document.logged_rays),
            document.log_seconds + document.sort_seconds,
        ));
    }
    let busy = split.busy();
    let seconds = document.render_seconds.max(1e-9);
    tell(format_args!(
        "rendered in {:.2} s, {:.2} Mray/s",
        document.render_seconds,
        rays as f64 / 1e6 / seconds,
    ));
    let parts = split.named().map(|(name, seconds)| {
        let share = if busy > 0.0 { seconds / busy } else { 0.0 };
        format!("{name} {:.1} %", 100.0 * share)
    });
    detail(format_args!(
        "of {busy:.2} s of all threads: {}",
        parts.join(", ")
    ));
}
