//! The demonstration: `antumbra` without a command. A city three times: in sunlight, by its sky, by its sun.

use std::path::Path;

use antumbra::recipe::Builder;
use antumbra::{Ray, Recipe};
use antumbra_bake::{
    AmbientOcclusion, Moment, Orientation, Place, Refraction, ambient_occlusion, sun_hours,
    sun_positions,
};
use antumbra_image::{Image, Rgb8Image, Window, heatmap};
use antumbra_lab::{Gain, collect_rays, gain, make_directory, write_json};
use antumbra_load::MemorySize;
use antumbra_map::{Panel, PanelLegend, Steps, Theme, panels};
use antumbra_render::{KeptTree, Options, Rendering, Sight, World, render, training_rays};
use antumbra_scene::Scene;
use rayon::prelude::*;
use serde::Serialize;

use crate::exit::{Failure, tell};
use crate::output::Files;
use crate::progress::Progress;
use crate::{args, interrupt, scenes, version};

const SCENE: &str = "builtin:city";
const DIRECTORY: &str = "antumbra-out";
/// Small enough for half a minute on two cores.
const RESOLUTION: [u32; 2] = [480, 270];
const SPP: u32 = 24;
/// Places per pixel side of the two baked pictures.
const GRID: u32 = 2;
/// Rays to the sky from every place.
const SKY: u32 = 32;
/// Time between two positions of the sun, in hours.
const STEP: f64 = 0.25;
/// Rays of each kind, and turns, by which the trees are timed.
const RAYS: usize = 100_000;
const TURNS: usize = 15;

/// Figures, as JSON.
#[derive(Serialize)]
struct Document {
    schema: &'static str,
    #[serde(flatten)]
    machine: antumbra_lab::Machine,
    scene: &'static str,
    triangles: usize,
    resolution: [u32; 2],
    spp: u32,
    render_seconds: f64,
    /// Rays per place and seconds of the two baked pictures.
    sky_rays: u32,
    sky_seconds: f64,
    sun_rays: usize,
    sun_seconds: f64,
    /// Speedup of the learned tree over the baseline: median, quartiles, turns, rays.
    shadow_gain: f64,
    shadow_quartiles: [f64; 2],
    sky_gain: f64,
    sky_quartiles: [f64; 2],
    turns: usize,
    rays: usize,
}

/// Runs the demonstration.
pub fn run(memory: MemorySize) -> Result<(), Failure> {
    args::start_threads(None)?;
    let out = Path::new(DIRECTORY);
    let mut files = Files::default();
    files.writes("the picture", &out.join("city.png"))?;
    let [width, height] = RESOLUTION;
    tell(format_args!(
        "A city of half a million triangles, three times {width} x {height} pixels. This takes less than a minute, and \
         writes only to {DIRECTORY}/.\n"
    ));
    let (scene, world) = city(memory)?;
    let options = Options {
        spp: Some(SPP),
        ..Options::default()
    };
    let rendering = rendered(&world, &options)?;
    interrupt::check()?;

    let [plain, tree] = trees(&world, &options)?;
    let places = Places::seen(&world, &tree);
    let (points, normals) = (&places.points, &places.normals);
    let (open, sky_seconds) = open_sky(&tree, &places)?;
    let suns = suns()?;
    let (hours, sun_seconds) = timed("by the sun", |progress| {
        let weights = vec![STEP; suns.len()];
        sun_hours(tree.bvh(), points, normals, &suns, &weights, progress)
    })?;

    let [shadow, sky] = gains(&world, &plain, &tree)?;
    interrupt::check()?;

    let _writing = interrupt::writing();
    make_directory(out)?;
    let light = rendering.image.to_srgb8();
    let hours = (&*hours, suns.len() as f64 * STEP);
    write_pictures(out, &light, &places, &open, hours)?;
    let document = Document {
        schema: "antumbra.demonstration/1",
        machine: version::machine(options.recipe.engine.isa()),
        scene: SCENE,
        triangles: scene.triangle_count(),
        resolution: RESOLUTION,
        spp: SPP,
        render_seconds: rendering.stats.render_seconds,
        sky_rays: SKY,
        sky_seconds,
        sun_rays: suns.len(),
        sun_seconds,
        shadow_gain: shadow.median,
        shadow_quartiles: shadow.quartiles,
        sky_gain: sky.median,
        sky_quartiles: sky.quartiles,
        turns: TURNS,
        rays: RAYS,
    };
    write_json(&document, &out.join("results.json"))?;
    summarise(&document, points.len());
    tell(format_args!("{}", conclusion(&sky, &shadow)));
    Ok(())
}

/// Says what was done for so many places.
fn summarise(document: &Document, places: usize) {
    let rays = places as f64;
    tell(format_args!(
        "rendered in {:.1} s; {:.0} million rays to the sky in {:.1} s; {:.0} million to the sun in {:.1} s\n\
         Look around in it: antumbra view {SCENE}\n",
        document.render_seconds,
        rays * f64::from(SKY) / 1e6,
        document.sky_seconds,
        rays * document.sun_rays as f64 / 1e6,
        document.sun_seconds,
    ));
}

/// The paper's baseline (binned SAH, collapsed by area, in the order of the builder), and a tree that has learned.
fn trees(world: &World, options: &Options) -> Result<[KeptTree; 2], Failure> {
    let plain = KeptTree::unlearned(world, &Recipe::default());
    let lesson = training_rays(world, &plain, options, &())?;
    let tree = KeptTree::learned(world, &options.recipe, &lesson)?;
    Ok([plain, tree])
}

/// How much of the sky each place sees, and the seconds of the rays.
fn open_sky(tree: &KeptTree, places: &Places) -> Result<(Vec<f32>, f64), Failure> {
    let options = AmbientOcclusion {
        samples: SKY,
        ..AmbientOcclusion::default()
    };
    let (points, normals) = (&places.points, &places.normals);
    timed("by the sky", |progress| {
        ambient_occlusion(tree.bvh(), points, normals, &options, progress)
    })
}

/// The path traced picture.
fn rendered(world: &World, options: &Options) -> Result<Rendering, Failure> {
    let pixels = RESOLUTION.map(u64::from);
    let samples = pixels[0] * pixels[1] * u64::from(SPP);
    let progress = Progress::of_picture("in sunlight", samples);
    let rendering = render(world, options, &progress)?;
    progress.finish();
    Ok(rendering)
}

/// The city, and its tree.
fn city(memory: MemorySize) -> Result<(Scene, World), Failure> {
    let mut scene = scenes::load(Path::new(SCENE), memory)?.scene;
    scene.film.resolution = RESOLUTION;
    let world = scenes::world(&scene, Builder::BinnedSah)?;
    Ok((scene, world))
}

/// Speedups of the learned tree, for shadow rays and for rays to the sky.
fn gains(world: &World, plain: &KeptTree, tree: &KeptTree) -> Result<[Gain; 2], Failure> {
    let _timing = crate::progress::doing("", "timing the trees");
    let rays = collect_rays(world, plain.bvh(), RAYS, 1);
    let compare = |rays: &[Ray]| {
        gain(plain.bvh(), tree.bvh(), rays, TURNS)
            .ok_or_else(|| Failure::work("two trees give different answers"))
    };
    Ok([compare(&rays.shadow)?, compare(&rays.diffuse)?])
}

/// Work with a line about its progress, and its seconds.
fn timed<T>(
    title: &str,
    work: impl FnOnce(&Progress) -> Result<T, antumbra_bake::Error>,
) -> Result<(T, f64), Failure> {
    let progress = Progress::new(title);
    let start = std::time::Instant::now();
    let done = work(&progress)?;
    let seconds = start.elapsed().as_secs_f64();
    progress.finish();
    Ok((done, seconds))
}

/// Writes the three pictures, and all beside each other.
fn write_pictures(
    out: &Path,
    light: &Rgb8Image,
    places: &Places,
    open: &[f32],
    (hours, longest): (&[f64], f64),
) -> Result<(), Failure> {
    let [width, height] = RESOLUTION.map(|size| size as usize);
    let open = places.picture(|place| f64::from(open[place]), 1.0);
    let open: Vec<[f32; 3]> = open.iter().map(|&open| [open; 3]).collect();
    let window = Window::full(width, height);
    let sky = Image::new(width, height, window, open)?.to_srgb8();
    let hours = places.picture(|place| hours[place], f64::NAN);
    let steps = Steps::between(0.0, longest, false);
    let options = heatmap::Options {
        range: heatmap::Range::Fixed {
            min: 0.0,
            max: longest as f32,
        },
        legend: false,
    };
    let drawn = heatmap::render(&hours, width, height, &options)?;
    let panel = |title, subtitle, image| Panel {
        image,
        title,
        subtitle,
        legend: None,
    };
    let sun = Panel {
        legend: Some(PanelLegend {
            quantity: "Direct sun",
            unit: "h",
            steps: &steps,
            values: &hours,
        }),
        ..panel("By the sun", "21 June at 48.2° N, 16.4° E", &drawn)
    };
    let all = [
        panel("In sunlight", "path traced", light),
        panel(
            "By the sky",
            "white sees all of the sky, black nothing",
            &sky,
        ),
        sun,
    ];
    let write = |name: &str, parts: &[Panel<'_>]| {
        let drawing = panels(parts, Theme::Light).map_err(Failure::work)?;
        let picture = drawing.pixels().map_err(Failure::work)?;
        picture.write(out.join(name)).map_err(Failure::from)
    };
    write("city.png", &all)?;
    light.write(out.join("city-sunlight.png"))?;
    sky.write(out.join("city-ambient-occlusion.png"))?;
    write("city-sun-hours.png", &[sun])?;
    Ok(())
}

/// Some sentences for a newcomer.
fn conclusion(sky: &Gain, shadow: &Gain) -> String {
    format!(
        "{DIRECTORY}/city.png shows the city three times: in sunlight, by how much of the sky each place sees, and by \
         its hours of sun on 21 June.\nA tree that learned from a few of these rays answers others {:.2} times as fast \
         as a tree that learned nothing. Rays to lights: {:.2}.\nEvery answer is the same. Medians of {} interleaved \
         rounds on one thread.",
        sky.median, shadow.median, sky.turns,
    )
}

/// Directions of the sun on the longest day at 48 degrees north, in a scene whose z axis points up and whose y axis
/// points north.
fn suns() -> Result<Vec<[f32; 3]>, Failure> {
    let place = Place {
        latitude: 48.2,
        longitude: 16.4,
        height: 170.0,
    };
    let midnight = Moment::midnight(2024, 6, 21).ok_or_else(|| Failure::work("no such day"))?;
    let steps = (24.0 / STEP) as u32;
    let times: Vec<f64> = (0..steps)
        .map(|step| midnight.unix(1.0) + 3600.0 * STEP * (f64::from(step) + 0.5))
        .collect();
    let positions = sun_positions(&place, Refraction::Standard, &times)?;
    let up = positions.iter().filter(|sun| sun.elevation > 0.0);
    let direction = |azimuth, elevation| Orientation::default().direction(azimuth, elevation);
    Ok(up
        .map(|sun| direction(sun.azimuth, sun.elevation).map(|x| x as f32))
        .collect())
}

/// Places that a camera sees, on a grid in every pixel.
struct Places {
    points: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    /// Pixel and number of the place, for those that see a surface.
    pixels: Vec<Option<usize>>,
}

impl Places {
    fn seen(world: &World, tree: &KeptTree) -> Self {
        let [width, height] = RESOLUTION.map(|side| side * GRID);
        let at = |place: u32| (place as f32 + 0.5) / GRID as f32;
        let row = |y: u32| -> Vec<Option<Sight>> {
            let sights = (0..width).map(|x| tree.seen(world, [at(x), at(y)]));
            sights.collect()
        };
        let rows: Vec<_> = (0..height).into_par_iter().map(row).collect();
        let (mut points, mut normals, mut pixels) = (Vec::new(), Vec::new(), Vec::new());
        for sight in rows.into_iter().flatten() {
            pixels.push(sight.map(|_| points.len()));
            if let Some(sight) = sight {
                points.push(sight.point);
                normals.push(sight.normal);
            }
        }
        Self {
            points,
            normals,
            pixels,
        }
    }

    /// Mean value of every pixel. `empty` is the value where no surface is seen.
    fn picture(&self, value: impl Fn(usize) -> f64, empty: f64) -> Vec<f32> {
        let [width, height] = RESOLUTION;
        let across = (width * GRID) as usize;
        let mean = |x: u32, y: u32| {
            let places = (0..GRID).flat_map(|j| (0..GRID).map(move |i| (i, j)));
            let values = places.map(|(i, j)| {
                let place = (y * GRID + j) as usize * across + (x * GRID + i) as usize;
                self.pixels[place].map_or(empty, &value)
            });
            let known: Vec<f64> = values.filter(|value| !value.is_nan()).collect();
            match known.len() {
                0 => f32::NAN,
                count => (known.iter().sum::<f64>() / count as f64) as f32,
            }
        };
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        pixels.map(|(x, y)| mean(x, y)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_day_has_sixteen_hours() {
        let suns = suns().expect("a day");
        let hours = suns.len() as f64 * STEP;
        assert!((15.75..=16.5).contains(&hours), "{hours}");
        // From the north-east over the south to the north-west.
        let (first, last) = (suns[0], suns[suns.len() - 1]);
        assert!(
            first[0] > 0.5 && first[1] > 0.3 && first[2] < 0.1,
            "{first:?}"
        );
        assert!(last[0] < -0.5 && last[1] > 0.3, "{last:?}");
        assert!(suns.iter().all(|sun| sun[2] > 0.0));
    }
}
