//! All lights of a scene, and the choice of one of them.
//!
//! One light is chosen in proportion to a cheap estimate of the irradiance it would give the point if
//! nothing were in the way: strength over squared distance for what is near, strength alone for what is
//! infinitely far. A tenth of the choice is uniform, so that no light is ever neglected by more than its
//! number. Scenes with more than [`MANY`] lights use one estimate for the whole scene instead.

use antumbra::Aabb;
use antumbra_scene::Scene;
use glam::Vec3;

use crate::color::luminance;
use crate::light::{Emitter, Light};
use crate::surface::Surface;

/// Above this number the estimate is made once, not for every point.
const MANY: usize = 64;

/// Share of the choice that ignores the estimate.
const UNIFORM_SHARE: f32 = 0.1;

/// The lights of a scene.
#[derive(Clone, Debug)]
pub struct Lights {
    lights: Vec<Light>,
    sources: Vec<Source>,
    /// For every shape its light, if it is one.
    of_shape: Vec<Option<u32>>,
    /// With many lights: probabilities 0..=i added up.
    fixed: Option<Vec<f32>>,
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
        let mut lights: Vec<Light> = scene.lights.iter().cloned().map(Light::Plain).collect();
        let mut of_shape = vec![None; scene.shapes.len()];
        for (shape, slot) in scene.shapes.iter().zip(&mut of_shape) {
            if let Some(emitter) = Emitter::new(shape) {
                *slot = Some(lights.len() as u32);
                lights.push(Light::Area(emitter));
            }
        }
        let sources: Vec<Source> = lights.iter().map(Source::new).collect();
        let mut all = Self {
            lights,
            sources,
            of_shape,
            fixed: None,
        };
        if all.lights.len() > MANY {
            all.fixed = Some(all.fixed_choice(bounds));
        }
        all
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
            Light::Plain(_) => None,
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

    /// Radiance that a ray brings from outside the scene.
    pub fn escaped(&self) -> Vec3 {
        self.lights.iter().map(Light::escaped_radiance).sum()
    }

    /// A light for the point `at`, with its probability, by `u` in `[0, 1)`. `None` if there are no lights.
    #[inline]
    pub fn choose(&self, at: Vec3, u: f32) -> Option<(usize, f32)> {
        let last = self.lights.len().checked_sub(1)?;
        if let Some(cumulative) = &self.fixed {
            let light = cumulative.partition_point(|&sum| sum <= u).min(last);
            return Some((light, self.probability(at, light)));
        }
        // No more than `MANY`: every estimate is made once.
        let mut estimates = [0.0; MANY];
        for (estimate, source) in estimates.iter_mut().zip(&self.sources) {
            *estimate = source.irradiance(at);
        }
        let estimates = &estimates[..=last];
        let total = estimates.iter().sum();
        let mut sum = 0.0;
        for (light, &estimate) in estimates[..last].iter().enumerate() {
            let probability = self.share(estimate, total);
            sum += probability;
            if u < sum {
                return Some((light, probability));
            }
        }
        Some((last, self.share(estimates[last], total)))
    }

    /// Probability with which [`Self::choose`] returns `light`.
    #[inline]
    pub fn probability(&self, at: Vec3, light: usize) -> f32 {
        match &self.fixed {
            Some(cumulative) if light == 0 => cumulative[0],
            Some(cumulative) => cumulative[light] - cumulative[light - 1],
            None => self.share(self.sources[light].irradiance(at), self.total(at)),
        }
    }

    #[inline]
    fn total(&self, at: Vec3) -> f32 {
        self.sources
            .iter()
            .map(|source| source.irradiance(at))
            .sum()
    }

    #[inline]
    fn share(&self, estimate: f32, total: f32) -> f32 {
        let uniform = 1.0 / self.sources.len() as f32;
        let share = estimate / total;
        // No light at all, or numbers beyond f32: choose blindly.
        if total > 0.0 && total.is_finite() {
            UNIFORM_SHARE * uniform + (1.0 - UNIFORM_SHARE) * share
        } else {
            uniform
        }
    }

    /// Estimates made at the centre of the scene, for lights no nearer than its radius.
    fn fixed_choice(&self, bounds: &Aabb) -> Vec<f32> {
        let (low, high) = (Vec3::from(bounds.min), Vec3::from(bounds.max));
        let (center, radius) = ((low + high) * 0.5, (high - low).length() * 0.5);
        let weight = |source: &Source| match source.place {
            Some((place, floor)) => {
                f64::from(source.strength)
                    / f64::from(
                        place
                            .distance_squared(center)
                            .max(floor)
                            .max(radius * radius),
                    )
            }
            None => f64::from(source.strength),
        };
        let usable = |w: f64| if w.is_finite() { w } else { 0.0 };
        let weights: Vec<f64> = self.sources.iter().map(|s| usable(weight(s))).collect();
        let total: f64 = weights.iter().sum();
        let uniform = 1.0 / weights.len() as f64;
        let mut sum = 0.0;
        weights
            .iter()
            .map(|weight| {
                let share = if total > 0.0 { weight / total } else { uniform };
                let mixed = f64::from(UNIFORM_SHARE);
                sum += mixed * uniform + (1.0 - mixed) * share;
                sum as f32
            })
            .collect()
    }
}

impl Source {
    fn new(light: &Light) -> Self {
        use antumbra_scene::Light as Plain;
        let near = |strength, center, radius: f32| Self {
            strength: luminance(strength).max(0.0),
            place: Some((center, (radius * radius).max(f32::MIN_POSITIVE))),
        };
        let far = |strength| Self {
            strength: luminance(strength).max(0.0),
            place: None,
        };
        match light {
            Light::Area(emitter) => {
                let (center, radius) = emitter.ball();
                near(emitter.strength(), center, radius)
            }
            Light::Plain(Plain::Point {
                position,
                intensity,
            })
            | Light::Plain(Plain::Spot {
                position,
                intensity,
                ..
            }) => near(*intensity, *position, 0.0),
            Light::Plain(Plain::Goniometric { .. } | Plain::Projection { .. }) => far(Vec3::ZERO),
            Light::Plain(Plain::Distant { radiance, .. }) => far(*radiance),
            Light::Plain(Plain::Infinite { radiance, .. }) => far(*radiance * std::f32::consts::PI),
        }
    }

    #[inline]
    fn irradiance(&self, at: Vec3) -> f32 {
        match self.place {
            Some((center, floor)) => self.strength / at.distance_squared(center).max(floor),
            None => self.strength,
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
        assert_eq!(lights.escaped(), Vec3::ZERO);
    }
}
