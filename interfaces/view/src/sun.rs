//! A day of sun on a scene: hours and shadows of what a camera sees, and the hours of a single point.

use std::sync::{Arc, LazyLock};

use antumbra::{Bvh, Ray};
use antumbra_image::{Image, Window, palette};
use antumbra_render::{KeptTree, Sight, World};
use rayon::prelude::*;
use serde::Serialize;

/// Course of the sun in one day at a place.
#[derive(Clone, Debug, PartialEq)]
pub struct SunDay {
    /// Date and place in words.
    pub caption: String,
    /// Suns in equal steps of time from midnight to midnight, each in the middle of its step.
    pub suns: Vec<Sun>,
    /// Direction that points up, of length 1.
    pub up: [f32; 3],
    /// Hours of a step for the diagram of a point. Painted hours take several of them together.
    pub step: f64,
}

/// Where the sun is at some time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sun {
    /// Hours since midnight on the clocks of the place.
    pub hour: f64,
    /// Degrees from north through east.
    pub azimuth: f64,
    /// Degrees above the horizon. Suns below it shine on nothing.
    pub elevation: f64,
    /// Direction to the sun in the scene, of length 1.
    pub direction: [f32; 3],
}

/// Steps that are painted as one.
const TOGETHER: usize = 3;

/// Colours of lit and shaded surfaces, of the night and of the background, in linear light.
const LIT: [f32; 3] = [0.86, 0.82, 0.72];
const SHADE: [f32; 3] = [0.10, 0.125, 0.18];
const NIGHT: [f32; 3] = [0.035, 0.045, 0.075];
const SKY: [f32; 3] = [0.60, 0.68, 0.76];

impl SunDay {
    /// Suns that painted hours are made of, and hours that each stands for.
    pub(crate) fn painted(&self) -> Vec<(Sun, f32)> {
        let weight = |suns: &[Sun]| (self.step * suns.len() as f64) as f32;
        let each = self.suns.chunks(TOGETHER);
        let each = each.map(|suns| (suns[suns.len() / 2], weight(suns)));
        each.filter(|(sun, _)| sun.elevation > 0.0).collect()
    }

    /// Longest time of sun that painted hours may have, rounded up to whole hours.
    pub fn longest(&self) -> f32 {
        let sum: f32 = self.painted().iter().map(|(_, hours)| hours).sum();
        sum.ceil().max(1.0)
    }

    /// The sun that is nearest to a time.
    pub fn at(&self, hour: f64) -> Option<&Sun> {
        let apart = |sun: &&Sun| (sun.hour - hour).abs();
        self.suns
            .iter()
            .min_by(|a, b| apart(a).total_cmp(&apart(b)))
    }
}

/// What a camera sees, pixel by pixel.
#[derive(Debug)]
pub struct Sights {
    size: [usize; 2],
    window: Window,
    pixels: Vec<Option<Sight>>,
}

impl Sights {
    /// Looks through the middle of all pixels of a world's camera.
    pub fn new(world: &World, tree: &KeptTree, (size, window): ([u32; 2], Window)) -> Self {
        let columns = window.width().max(1);
        let see = |index: usize| {
            let x = window.x0 as f32 + (index % columns) as f32;
            let y = window.y0 as f32 + (index / columns) as f32;
            tree.seen(world, [x + 0.5, y + 0.5])
        };
        Self {
            size: size.map(|side| side as usize),
            window,
            pixels: (0..window.area()).into_par_iter().map(see).collect(),
        }
    }

    /// Adds `weight` to the values of all pixels that see a sun.
    pub fn add(&self, bvh: &Bvh, sun: &Sun, weight: f32, values: &mut [f32]) {
        let faces = |sight: &Option<Sight>| sight.and_then(|sight| ray(bvh, &sight, sun));
        let rays: Vec<Option<Ray>> = self.pixels.par_iter().map(faces).collect();
        let known: Vec<Ray> = rays.iter().copied().flatten().collect();
        let occluded = bvh.batch(&known).occluded();
        let mut answers = occluded.iter();
        for (value, ray) in values.iter_mut().zip(&rays) {
            if ray.is_some() && answers.next() == Some(&false) {
                *value += weight;
            }
        }
    }

    /// The picture of hours of sun: colours of the palette from 0 to `most`.
    pub fn hours(&self, up: [f32; 3], values: &[f32], most: f32) -> Option<Image> {
        self.image(|pixel, sight| {
            let colour = palette_of(values[pixel] / most);
            let factor = 0.72 + 0.28 * dot(sight.normal, up).max(0.0);
            colour.map(|x| x * factor)
        })
    }

    /// The picture of light and shadow, where `lit` is above 0 for pixels in the sun.
    pub fn shadows(&self, up: [f32; 3], lit: &[f32], sun: &Sun) -> Option<Image> {
        self.image(|pixel, sight| {
            let sky = 0.6 + 0.4 * dot(sight.normal, up).max(0.0);
            if sun.elevation <= 0.0 {
                return NIGHT.map(|x| x * sky);
            }
            let cosine = dot(sight.normal, sun.direction).max(0.0);
            let light = if lit[pixel] > 0.0 {
                0.25 + 0.75 * cosine
            } else {
                0.0
            };
            [0, 1, 2].map(|i| SHADE[i] * sky + (LIT[i] - SHADE[i]) * light)
        })
    }

    fn image(&self, paint: impl Fn(usize, &Sight) -> [f32; 3] + Sync) -> Option<Image> {
        let colour = |(pixel, sight): (usize, &Option<Sight>)| {
            sight.as_ref().map_or(SKY, |sight| paint(pixel, sight))
        };
        let pixels = self.pixels.par_iter().enumerate().map(colour).collect();
        Image::new(self.size[0], self.size[1], self.window, pixels).ok()
    }

    /// Number of pixels.
    pub fn count(&self) -> usize {
        self.pixels.len()
    }
}

/// What the last camera sees, for clicks.
#[derive(Clone, Debug)]
pub struct Probe {
    pub world: Arc<World>,
    pub tree: Arc<KeptTree>,
    pub day: Arc<SunDay>,
    /// Size of the picture in pixels.
    pub resolution: [u32; 2],
    /// Origin of the scene in the world.
    pub origin: [f64; 3],
}

/// Direct sun at a point in the course of a day.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PointDay {
    /// Place in the world.
    pub point: [f64; 3],
    /// Normal of the surface there.
    pub normal: [f32; 3],
    /// Hours of direct sun.
    pub hours: f64,
    /// Whether the sun is seen, for each sun of the day.
    pub seen: Vec<bool>,
}

impl Probe {
    /// The day of the point that is seen at a place of the picture, in fractions of its size. `None` if no surface is seen.
    pub fn point(&self, at: [f32; 2]) -> Option<PointDay> {
        let film = [0, 1].map(|i| at[i] * self.resolution[i] as f32);
        let sight = self.tree.seen(&self.world, film)?;
        let bvh = self.tree.bvh();
        let sees = |sun: &Sun| ray(bvh, &sight, sun).is_some_and(|ray| !bvh.occluded(&ray));
        let seen: Vec<bool> = self.day.suns.iter().map(sees).collect();
        let count = seen.iter().filter(|&&seen| seen).count();
        Some(PointDay {
            point: [0, 1, 2].map(|i| f64::from(sight.point[i]) + self.origin[i]),
            normal: sight.normal,
            hours: count as f64 * self.day.step,
            seen,
        })
    }
}

/// Ray from a point to a sun; `None` if the sun is below the horizon or behind the surface. Rays start at the origin offset
/// above their surface.
fn ray(bvh: &Bvh, sight: &Sight, sun: &Sun) -> Option<Ray> {
    let is_day = sun.elevation > 0.0 && dot(sight.normal, sun.direction) > 0.0;
    is_day.then(|| {
        let offset = bvh.origin_offset(sight.point);
        let start = [0, 1, 2].map(|i| sight.point[i] + offset * sight.normal[i]);
        Ray::new(start, sun.direction)
    })
}

/// Linear light of the palette.
fn palette_of(t: f32) -> [f32; 3] {
    static COLOURS: LazyLock<Vec<[f32; 3]>> = LazyLock::new(|| {
        let linear = |x: u8| {
            let x = f32::from(x) / 255.0;
            match x <= 0.04045 {
                true => x / 12.92,
                false => ((x + 0.055) / 1.055).powf(2.4),
            }
        };
        let colours = (0..=255).map(|i| palette::colour(i as f32 / 255.0).map(linear));
        colours.collect()
    });
    COLOURS[(t.clamp(0.0, 1.0) * 255.0).round() as usize]
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
