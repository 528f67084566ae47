//! All lights of a scene, and the choice of one of them.
//!
//! - *Spatial* chooses a light in proportion to an estimate of its unoccluded irradiance at the point: strength over
//!   squared distance, or only strength for lights infinitely far away (`source.rs`). A tenth of the choice is
//!   uniform, so that no light is neglected. More than [`MANY`] lights are in a tree (`tree.rs`), where groups of
//!   distant lights are estimated together. pbrt-v3's strategy of that name averages over the cells of a grid.
//! - *Uniform* and *power* choose alike at all points, as in pbrt-v3. Here a mesh is one light, there every triangle.

mod source;
mod tree;

use antumbra::{Aabb, Isa};
use antumbra_scene::{Integrator, LightStrategy, Scene};
use glam::Vec3;

use super::block::{Asked, Chosen};
use super::{Emitter, Light, Receiver};
use crate::columns::{BLOCK, Stage, run};
use crate::surface::Surface;
use crate::texture::Textures;
use source::Source;
use tree::Tree;

/// Largest number of lights that are all estimated at every point.
const MANY: usize = 64;

/// Largest number of lights with the shorter loop.
const FEW: usize = 8;

/// Share of the choice that ignores the estimate.
const UNIFORM_SHARE: f32 = 0.1;

/// The lights of a scene.
#[derive(Clone, Debug)]
pub struct Lights {
    lights: Vec<Light>,
    /// Lights that rays find by leaving the scene.
    outside: Vec<usize>,
    /// Light of every shape, if there is one.
    of_shape: Vec<Option<u32>>,
    choice: Choice,
}

/// Rule by which a light is chosen.
#[derive(Clone, Debug)]
enum Choice {
    /// One choice for all points: cumulative probabilities.
    Fixed(Vec<f32>),
    /// By the irradiance at the point, of one source per light.
    Few(Vec<Source>),
    /// By the irradiance at the point, estimated group by group.
    Many(Tree),
}

impl Lights {
    /// Collects the lights of a scene whose geometry fills `bounds`. Emitting shapes come last.
    pub fn new(scene: &Scene, bounds: &Aabb, textures: &mut Textures) -> Self {
        let mut lights: Vec<Light> = scene.lights.iter().map(Light::new).collect();
        let mut of_shape = vec![None; scene.shapes.len()];
        for (shape, slot) in scene.shapes.iter().zip(&mut of_shape) {
            if let Some(emitter) = Emitter::new(shape, textures) {
                *slot = Some(lights.len() as u32);
                lights.push(Light::Area(emitter));
            }
        }
        let strategy = match scene.integrator {
            Integrator::Path { light_strategy, .. }
            | Integrator::VolumePath { light_strategy, .. } => light_strategy,
            _ => LightStrategy::Spatial,
        };
        let outside = (0..lights.len()).filter(|&i| lights[i].is_outside());
        Self {
            outside: outside.collect(),
            choice: Choice::new(strategy, &lights, bounds),
            lights,
            of_shape,
        }
    }

    /// All lights, in the order of their indices.
    #[inline]
    pub fn all(&self) -> &[Light] {
        &self.lights
    }

    /// Index and emitter of an emitting shape.
    #[inline]
    pub fn emitter(&self, shape: usize) -> Option<(usize, &Emitter)> {
        let index = self.of_shape.get(shape).copied().flatten()? as usize;
        match &self.lights[index] {
            Light::Area(emitter) => Some((index, emitter)),
            _ => None,
        }
    }

    /// Radiance emitted by a surface towards where the ray came from.
    #[inline]
    pub fn emitted(&self, surface: &Surface) -> Vec3 {
        self.emitter(surface.shape)
            .map_or(Vec3::ZERO, |(_, emitter)| emitter.radiance_of(surface))
    }

    /// Radiance that a ray along the unit vector `dir` brings from outside the scene.
    #[inline]
    pub fn escaped(&self, dir: Vec3) -> Vec3 {
        self.outside
            .iter()
            .map(|&light| self.lights[light].escaped_radiance(dir))
            .sum()
    }

    /// Index, radiance and density of every light outside the scene, for a ray from `at` along `dir`. The density is
    /// the density of the light's samples.
    #[inline]
    pub fn escaped_from(
        &self,
        at: &Receiver,
        dir: Vec3,
    ) -> impl Iterator<Item = (usize, Vec3, f32)> {
        self.outside.iter().map(move |&light| {
            let (radiance, density) = self.lights[light].escaped(at, dir);
            (light, radiance, density)
        })
    }

    /// Light for the point `at` by `u` in `[0, 1)`, with its probability. `None` if there are no lights.
    #[inline]
    pub fn choose(&self, at: Vec3, u: f32) -> Option<(usize, f32)> {
        let last = self.lights.len().checked_sub(1)?;
        let sources = match &self.choice {
            Choice::Few(sources) => sources,
            Choice::Fixed(cumulative) => {
                let light = cumulative.partition_point(|&sum| sum <= u).min(last);
                return Some((light, self.probability(at, light)));
            }
            Choice::Many(tree) => {
                let uniform = UNIFORM_SHARE / (last + 1) as f32;
                let (light, probability) = if u < UNIFORM_SHARE {
                    let light = ((u / uniform) as usize).min(last);
                    (light, tree.probability(at, light))
                } else {
                    tree.choose(at, (u - UNIFORM_SHARE) / (1.0 - UNIFORM_SHARE))
                };
                return Some((light, uniform + (1.0 - UNIFORM_SHARE) * probability));
            }
        };
        Some(if last < FEW {
            choose_among::<FEW>(sources, at, u)
        } else {
            choose_among::<MANY>(sources, at, u)
        })
    }

    /// [`Self::choose`] for each of the first `count` lanes.
    pub(super) fn choose_block(&self, isa: Isa, asked: &Asked, count: usize, out: &mut Chosen) {
        out.any = !self.lights.is_empty();
        if !out.any {
            return;
        }
        match &self.choice {
            Choice::Few(sources) if sources.len() <= FEW => {
                let stage = ChooseFew { sources, asked };
                run(isa, stage, out);
            }
            _ => {
                for lane in 0..count {
                    let choice = self.choose(asked.point.get(lane), asked.choice[0][lane]);
                    let (light, probability) = choice.unwrap_or_default();
                    (out.light[lane], out.probability[lane]) = (light as u32, probability);
                }
            }
        }
    }

    /// Probability with which [`Self::choose`] returns `light`.
    #[inline]
    pub fn probability(&self, at: Vec3, light: usize) -> f32 {
        match &self.choice {
            Choice::Fixed(cumulative) if light == 0 => cumulative[0],
            Choice::Fixed(cumulative) => cumulative[light] - cumulative[light - 1],
            Choice::Many(tree) => {
                let uniform = UNIFORM_SHARE / self.lights.len() as f32;
                uniform + (1.0 - UNIFORM_SHARE) * tree.probability(at, light)
            }
            Choice::Few(sources) => {
                let total = sources.iter().map(|source| source.irradiance(at)).sum();
                share(sources[light].irradiance(at), total, sources.len())
            }
        }
    }
}

/// Source among at most `N`, and its probability. Every estimate is computed once.
#[inline]
fn choose_among<const N: usize>(sources: &[Source], at: Vec3, u: f32) -> (usize, f32) {
    let mut estimates = [0.0; N];
    for (estimate, source) in estimates.iter_mut().zip(sources) {
        *estimate = source.irradiance(at);
    }
    let last = sources.len() - 1;
    let total = estimates[..=last].iter().sum();
    let mut sum = 0.0;
    for (light, &estimate) in estimates[..last].iter().enumerate() {
        let probability = share(estimate, total, last + 1);
        sum += probability;
        if u < sum {
            return (light, probability);
        }
    }
    (last, share(estimates[last], total, last + 1))
}

/// [`choose_among`] a few sources.
struct ChooseFew<'a> {
    sources: &'a [Source],
    asked: &'a Asked,
}

impl Stage for ChooseFew<'_> {
    type Out = Chosen;

    #[inline(always)]
    fn run(self, out: &mut Chosen) {
        let Self { sources, asked } = self;
        let mut estimates = [[0.0; BLOCK]; FEW];
        let mut total = [0.0; BLOCK];
        let count = sources.len().min(FEW);
        for (source, estimates) in sources.iter().zip(&mut estimates) {
            for lane in 0..BLOCK {
                let estimate = source.irradiance(asked.point.get(lane));
                estimates[lane] = estimate;
                total[lane] += estimate;
            }
        }
        let mut sum = [0.0; BLOCK];
        let mut open = [1_u32; BLOCK];
        for (light, estimates) in estimates[..count].iter().enumerate() {
            // The last light takes what rounding leaves over.
            let is_last = light + 1 == count;
            for lane in 0..BLOCK {
                let probability = share(estimates[lane], total[lane], count);
                sum[lane] += probability;
                let reached = is_last | (asked.choice[0][lane] < sum[lane]);
                let takes = (open[lane] != 0) & reached;
                let (kept_light, kept) = (out.light[lane], out.probability[lane]);
                out.light[lane] = if takes { light as u32 } else { kept_light };
                out.probability[lane] = if takes { probability } else { kept };
                open[lane] = if takes { 0 } else { open[lane] };
            }
        }
    }
}

/// Probability of a light of this estimate among `count` lights.
#[inline]
fn share(estimate: f32, total: f32, count: usize) -> f32 {
    let uniform = 1.0 / count as f32;
    // All dark, or numbers beyond f32: choose uniformly.
    if total > 0.0 && total.is_finite() {
        UNIFORM_SHARE * uniform + (1.0 - UNIFORM_SHARE) * (estimate / total)
    } else {
        uniform
    }
}

impl Choice {
    fn new(strategy: LightStrategy, lights: &[Light], bounds: &Aabb) -> Self {
        match strategy {
            LightStrategy::Uniform => Self::fixed(lights.iter().map(|_| 1.0)),
            LightStrategy::Power => {
                let radius = Vec3::from(bounds.min).distance(bounds.max.into()) * 0.5;
                Self::fixed(lights.iter().map(|light| f64::from(light.power(radius))))
            }
            LightStrategy::Spatial => {
                let sources = lights.iter().map(|light| Source::new(light.extent()));
                let sources: Vec<Source> = sources.collect();
                if sources.len() <= MANY {
                    Self::Few(sources)
                } else {
                    Self::Many(Tree::new(&sources))
                }
            }
        }
    }

    /// In proportion to `weights`, uniform if none is positive.
    fn fixed(weights: impl Iterator<Item = f64>) -> Self {
        let usable = |w: f64| if w.is_finite() { w.max(0.0) } else { 0.0 };
        let weights: Vec<f64> = weights.map(usable).collect();
        let total: f64 = weights.iter().sum();
        let uniform = 1.0 / weights.len() as f64;
        let mut sum = 0.0;
        let cumulative = weights.iter().map(|weight| {
            sum += if total > 0.0 { weight / total } else { uniform };
            sum as f32
        });
        Self::Fixed(cumulative.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lamps along a line, one in seven dark, and a few that are infinitely far away.
    fn scene(lights: usize) -> Scene {
        let light = |i: usize| match i % 50 {
            3 => antumbra_scene::Light::Distant {
                to_light: Vec3::Y,
                radiance: Vec3::splat(0.01),
            },
            _ => antumbra_scene::Light::Point {
                position: Vec3::new(i as f32, 2.0, 0.0),
                intensity: Vec3::splat((i % 7) as f32),
            },
        };
        Scene {
            name: String::new(),
            shapes: Vec::new(),
            objects: Vec::new(),
            instances: Vec::new(),
            materials: Vec::new(),
            media: Vec::new(),
            lights: (0..lights).map(light).collect(),
            camera: Default::default(),
            film: Default::default(),
            sampler: Default::default(),
            integrator: Default::default(),
            accelerator: Default::default(),
            origin: Default::default(),
        }
    }

    const BOUNDS: Aabb = Aabb {
        min: [0.0; 3],
        max: [100.0; 3],
    };

    #[test]
    fn probabilities_add_up_and_are_those_of_the_choice() {
        for (count, light_strategy) in [1, 2, 7, MANY, MANY + 1, 500]
            .into_iter()
            .flat_map(|count| STRATEGIES.map(|strategy| (count, strategy)))
        {
            let mut scene = scene(count);
            scene.integrator = Integrator::Path {
                max_depth: 5,
                rr_threshold: 1.0,
                light_strategy,
            };
            let lights = Lights::new(&scene, &BOUNDS, &mut Textures::default());
            for at in [Vec3::ZERO, Vec3::new(3.0, 2.0, 0.0), Vec3::splat(1e30)] {
                let sum: f32 = (0..count).map(|i| lights.probability(at, i)).sum();
                assert!((sum - 1.0).abs() < 1e-4, "{count} lights at {at}: {sum}");
                let steps = 20_000;
                let mut drawn = vec![0_u32; count];
                for step in 0..steps {
                    let u = (step as f32 + 0.5) / steps as f32;
                    let (light, probability) = lights.choose(at, u).expect("there are lights");
                    let expected = lights.probability(at, light);
                    assert!((probability - expected).abs() <= 1e-5 * expected);
                    assert!(probability > 0.0);
                    drawn[light] += 1;
                }
                for (light, &n) in drawn.iter().enumerate() {
                    let expected = lights.probability(at, light);
                    assert!((n as f32 / steps as f32 - expected).abs() < 1e-3);
                    let dark = matches!(light % 7, 0) && light % 50 != 3;
                    let neglected = light_strategy == LightStrategy::Power && dark && count > 1;
                    assert_eq!(expected == 0.0, neglected, "{light_strategy:?} {light}");
                }
            }
        }
    }

    const STRATEGIES: [LightStrategy; 3] = [
        LightStrategy::Uniform,
        LightStrategy::Power,
        LightStrategy::Spatial,
    ];

    /// Second moment of irradiance over probability, over the square of the mean: 1 is perfect.
    fn spread(lights: &Lights, at: Vec3) -> f64 {
        let (mut mean, mut square) = (0.0, 0.0);
        for (index, light) in lights.all().iter().enumerate() {
            let irradiance = f64::from(Source::new(light.extent()).irradiance(at));
            mean += irradiance;
            if irradiance > 0.0 {
                square += irradiance * irradiance / f64::from(lights.probability(at, index));
            }
        }
        square / (mean * mean)
    }

    /// Near one of many lights, *spatial* samples that light most. *Power* needs many times as many samples.
    #[test]
    fn many_lights_are_chosen_from_by_place() {
        let mut scene = scene(2000);
        let spatial = Lights::new(&scene, &BOUNDS, &mut Textures::default());
        scene.integrator = Integrator::Path {
            max_depth: 5,
            rr_threshold: 1.0,
            light_strategy: LightStrategy::Power,
        };
        let power = Lights::new(&scene, &BOUNDS, &mut Textures::default());
        for i in (20..1980).step_by(49) {
            let at = Vec3::new(i as f32 + 0.3, 1.5, 0.2);
            let [spatial, power] = [&spatial, &power].map(|lights| spread(lights, at));
            assert!(spatial < 1.6, "{at}: {spatial}");
            assert!(power > 20.0 * spatial, "{at}: {power} {spatial}");
        }
    }

    #[test]
    fn no_lights_no_choice() {
        let lights = Lights::new(&scene(0), &BOUNDS, &mut Textures::default());
        assert!(lights.choose(Vec3::ZERO, 0.5).is_none());
        assert_eq!(lights.escaped(Vec3::Z), Vec3::ZERO);
    }
}
