//! All lights of a scene, and the choice of one of them.
//!
//! With the strategy *spatial* one light is chosen in proportion to a cheap estimate of the irradiance it would
//! give the point if nothing were in the way: strength over squared distance for what is near, strength alone
//! for what is infinitely far. A tenth of the choice is uniform, so that no light is ever neglected by more
//! than its number. It is exact for every point, where pbrt-v3's strategy of that name averages over the cells
//! of a grid. Scenes with more than [`MANY`] lights use one estimate for the whole scene instead.
//!
//! *Uniform* and *power* are the same for all points, as in pbrt-v3; only, a mesh is one light, not one for
//! every triangle.

use antumbra::Aabb;
use antumbra_scene::{Integrator, LightStrategy, Scene};
use glam::Vec3;

use crate::light::{Emitter, Extent, Light, Receiver};
use crate::surface::Surface;

/// Above this number the estimate is made once, not for every point.
const MANY: usize = 64;

/// Share of the choice that ignores the estimate.
const UNIFORM_SHARE: f32 = 0.1;

/// The lights of a scene.
#[derive(Clone, Debug)]
pub struct Lights {
    lights: Vec<Light>,
    /// Those that rays which leave the scene find.
    outside: Vec<usize>,
    /// For every shape its light, if it is one.
    of_shape: Vec<Option<u32>>,
    choice: Choice,
}

/// How a light is chosen.
#[derive(Clone, Debug)]
enum Choice {
    /// The same everywhere: probabilities 0..=i added up.
    Fixed(Vec<f32>),
    /// For every point by what the sources amount to there.
    Spatial(Vec<Source>),
}

/// A light as seen from afar.
#[derive(Clone, Copy, Debug)]
struct Source {
    strength: f32,
    /// Centre and squared radius below which distance counts no more; `None` if infinitely far.
    place: Option<(Vec3, f32)>,
}

impl Lights {
    /// Collects the lights of a scene whose geometry fills `bounds`. Emitting shapes come after the others.
    pub fn new(scene: &Scene, bounds: &Aabb) -> Self {
        let mut lights: Vec<Light> = scene.lights.iter().map(Light::new).collect();
        let mut of_shape = vec![None; scene.shapes.len()];
        for (shape, slot) in scene.shapes.iter().zip(&mut of_shape) {
            if let Some(emitter) = Emitter::new(shape) {
                *slot = Some(lights.len() as u32);
                lights.push(Light::Area(emitter));
            }
        }
        let strategy = match scene.integrator {
            Integrator::Path { light_strategy, .. } => light_strategy,
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

    /// The lights themselves.
    #[inline]
    pub fn all(&self) -> &[Light] {
        &self.lights
    }

    /// Index and emitter of the light that a shape is.
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
            .map_or(Vec3::ZERO, |(_, emitter)| {
                emitter.radiance(surface.normal, surface.wo)
            })
    }

    /// Radiance that a ray along the unit vector `dir` brings from outside the scene.
    #[inline]
    pub fn escaped(&self, dir: Vec3) -> Vec3 {
        self.outside
            .iter()
            .map(|&light| self.lights[light].escaped_radiance(dir))
            .sum()
    }

    /// The same light by light, where the ray comes from `at`: index, radiance, and the density with which a
    /// sample of the light chooses the direction.
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

    /// A light for the point `at`, with its probability, by `u` in `[0, 1)`. `None` if there are no lights.
    #[inline]
    pub fn choose(&self, at: Vec3, u: f32) -> Option<(usize, f32)> {
        let last = self.lights.len().checked_sub(1)?;
        let sources = match &self.choice {
            Choice::Fixed(cumulative) => {
                let light = cumulative.partition_point(|&sum| sum <= u).min(last);
                return Some((light, self.probability(at, light)));
            }
            Choice::Spatial(sources) => sources,
        };
        // No more than `MANY`: every estimate is made once.
        let mut estimates = [0.0; MANY];
        for (estimate, source) in estimates.iter_mut().zip(sources) {
            *estimate = source.irradiance(at);
        }
        let estimates = &estimates[..=last];
        let total = estimates.iter().sum();
        let mut sum = 0.0;
        for (light, &estimate) in estimates[..last].iter().enumerate() {
            let probability = share(estimate, total, last + 1);
            sum += probability;
            if u < sum {
                return Some((light, probability));
            }
        }
        Some((last, share(estimates[last], total, last + 1)))
    }

    /// Probability with which [`Self::choose`] returns `light`.
    #[inline]
    pub fn probability(&self, at: Vec3, light: usize) -> f32 {
        match &self.choice {
            Choice::Fixed(cumulative) if light == 0 => cumulative[0],
            Choice::Fixed(cumulative) => cumulative[light] - cumulative[light - 1],
            Choice::Spatial(sources) => {
                let total = sources.iter().map(|source| source.irradiance(at)).sum();
                share(sources[light].irradiance(at), total, sources.len())
            }
        }
    }
}

/// Probability of a light of this estimate among `count` lights.
#[inline]
fn share(estimate: f32, total: f32, count: usize) -> f32 {
    let uniform = 1.0 / count as f32;
    // No light at all, or numbers beyond f32: choose blindly.
    if total > 0.0 && total.is_finite() {
        UNIFORM_SHARE * uniform + (1.0 - UNIFORM_SHARE) * (estimate / total)
    } else {
        uniform
    }
}

impl Choice {
    fn new(strategy: LightStrategy, lights: &[Light], bounds: &Aabb) -> Self {
        let (low, high) = (Vec3::from(bounds.min), Vec3::from(bounds.max));
        let (center, radius) = ((low + high) * 0.5, (high - low).length() * 0.5);
        match strategy {
            LightStrategy::Uniform => Self::fixed(lights.iter().map(|_| 1.0), 0.0),
            LightStrategy::Power => {
                let powers = lights.iter().map(|light| f64::from(light.power(radius)));
                Self::fixed(powers, 0.0)
            }
            LightStrategy::Spatial => {
                let sources: Vec<Source> = lights
                    .iter()
                    .map(|light| Source::new(light.extent()))
                    .collect();
                if sources.len() <= MANY {
                    return Self::Spatial(sources);
                }
                // Estimates made at the centre of the scene, for lights no nearer than its radius.
                let weights = sources
                    .iter()
                    .map(|source| source.seen_from(center, radius));
                Self::fixed(weights, f64::from(UNIFORM_SHARE))
            }
        }
    }

    /// By `weights`, all the same if none is positive, with a share that ignores them.
    fn fixed(weights: impl Iterator<Item = f64>, uniform_share: f64) -> Self {
        let usable = |w: f64| if w.is_finite() { w.max(0.0) } else { 0.0 };
        let weights: Vec<f64> = weights.map(usable).collect();
        let total: f64 = weights.iter().sum();
        let uniform = 1.0 / weights.len() as f64;
        let mut sum = 0.0;
        let cumulative = weights.iter().map(|weight| {
            let share = if total > 0.0 { weight / total } else { uniform };
            sum += uniform_share * uniform + (1.0 - uniform_share) * share;
            sum as f32
        });
        Self::Fixed(cumulative.collect())
    }
}

impl Source {
    fn new(extent: Extent) -> Self {
        Self {
            strength: extent.strength.max(0.0),
            place: extent
                .ball
                .map(|(center, radius)| (center, (radius * radius).max(f32::MIN_POSITIVE))),
        }
    }

    #[inline]
    fn irradiance(&self, at: Vec3) -> f32 {
        match self.place {
            Some((center, floor)) => self.strength / at.distance_squared(center).max(floor),
            None => self.strength,
        }
    }

    fn seen_from(&self, center: Vec3, radius: f32) -> f64 {
        let strength = f64::from(self.strength);
        match self.place {
            Some((place, floor)) => {
                let distance2 = place.distance_squared(center).max(floor);
                strength / f64::from(distance2.max(radius * radius))
            }
            None => strength,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(lights: usize) -> Scene {
        let light = |i: usize| antumbra_scene::Light::Point {
            position: Vec3::new(i as f32, 2.0, 0.0),
            intensity: Vec3::splat((i % 7) as f32),
        };
        Scene {
            name: String::new(),
            shapes: Vec::new(),
            objects: Vec::new(),
            instances: Vec::new(),
            materials: Vec::new(),
            lights: (0..lights).map(light).collect(),
            camera: Default::default(),
            film: Default::default(),
            sampler: Default::default(),
            integrator: Default::default(),
            accelerator: Default::default(),
        }
    }

    const BOUNDS: Aabb = Aabb {
        min: [0.0; 3],
        max: [100.0; 3],
    };

    #[test]
    fn probabilities_add_up_and_are_those_of_the_choice() {
        for count in [1, 2, 7, MANY, MANY + 1, 500] {
            let lights = Lights::new(&scene(count), &BOUNDS);
            for at in [Vec3::ZERO, Vec3::new(3.0, 2.0, 0.0), Vec3::splat(1e30)] {
                let sum: f32 = (0..count).map(|i| lights.probability(at, i)).sum();
                assert!((sum - 1.0).abs() < 1e-4, "{count} lights at {at}: {sum}");
                let steps = 20_000;
                let mut drawn = vec![0_u32; count];
                for step in 0..steps {
                    let u = (step as f32 + 0.5) / steps as f32;
                    let (light, probability) = lights.choose(at, u).expect("there are lights");
                    assert_eq!(probability, lights.probability(at, light));
                    assert!(probability > 0.0);
                    drawn[light] += 1;
                }
                for (light, &n) in drawn.iter().enumerate() {
                    let expected = lights.probability(at, light);
                    assert!((n as f32 / steps as f32 - expected).abs() < 1e-3);
                }
            }
        }
    }

    #[test]
    fn no_lights_no_choice() {
        let lights = Lights::new(&scene(0), &BOUNDS);
        assert!(lights.choose(Vec3::ZERO, 0.5).is_none());
        assert_eq!(lights.escaped(Vec3::Z), Vec3::ZERO);
    }
}
