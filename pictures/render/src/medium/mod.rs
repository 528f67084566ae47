//! Participating media: distances at which light is scattered, and the light that passes.
//!
//! - [`Medium`]: a medium ready for sampling
//! - `grid.rs`: density by a grid
//! - `phase.rs`: directions after scattering
//! - `random.rs`: as many random numbers as a walk needs

mod grid;
pub mod phase;
mod random;

use glam::Vec3;

use grid::Grid;
pub use random::Random;

/// A participating medium, ready for sampling. All coefficients are per unit of length in the world.
#[derive(Clone, Debug)]
pub struct Medium {
    /// Coefficients at density 1.
    coefficients: Coefficients,
    /// Mean cosine of the scattering angle.
    pub asymmetry: f32,
    grid: Option<Grid>,
}

/// Coefficients of a homogeneous medium.
#[derive(Clone, Copy, Debug)]
pub struct Coefficients {
    scattering: Vec3,
    /// Absorption plus scattering.
    attenuation: Vec3,
}

/// First event of a ray in a medium.
#[derive(Clone, Copy, Debug)]
pub enum Event {
    /// Light is scattered at this distance.
    Scattered {
        /// Distance from the beginning of the ray.
        distance: f32,
        /// Transmittance times scattering coefficient, over the density of the distance.
        weight: Vec3,
    },
    /// The ray reaches its end.
    Passed {
        /// Transmittance over the probability of the event.
        weight: Vec3,
    },
}

impl Medium {
    /// Prepares a medium of the scene.
    pub fn new(medium: &antumbra_scene::Medium) -> Self {
        Self {
            coefficients: Coefficients::new(medium.absorption, medium.scattering),
            asymmetry: medium.asymmetry,
            grid: medium.density.as_ref().map(Grid::new),
        }
    }

    /// Draws the first event of a ray along the unit vector `dir` that ends at `end`, which may be infinite.
    ///
    /// The distance is drawn for one of the colours, chosen in proportion to the `throughput` of the path. Weights
    /// follow the balance heuristic over the colours (Pharr, Jakob and Humphreys 2016, section 15.2.1).
    pub fn event(
        &self,
        org: Vec3,
        dir: Vec3,
        end: f32,
        throughput: Vec3,
        random: &mut Random,
    ) -> Event {
        let choice = hero(throughput, random);
        match &self.grid {
            Some(grid) => grid.event(&self.coefficients, [org, dir], end, choice, random),
            None => self.coefficients.event_of(end, choice, random),
        }
    }

    /// Transmittance between `org` and the point at distance `end` along the unit vector `dir`: exact for a homogeneous
    /// medium, and an unbiased estimate for a grid.
    pub fn transmittance(&self, org: Vec3, dir: Vec3, end: f32, random: &mut Random) -> Vec3 {
        match &self.grid {
            Some(grid) => grid.transmittance(&self.coefficients, org, dir, end, random),
            None => self.coefficients.transmittance(end),
        }
    }
}

impl Coefficients {
    /// Coefficients of absorption and scattering.
    pub fn new(absorption: Vec3, scattering: Vec3) -> Self {
        Self {
            scattering,
            attenuation: absorption + scattering,
        }
    }

    /// [`Medium::event`] of a homogeneous medium.
    pub fn event(&self, end: f32, throughput: Vec3, random: &mut Random) -> Event {
        let choice = hero(throughput, random);
        self.event_of(end, choice, random)
    }

    fn event_of(&self, end: f32, (hero, share): (usize, Vec3), random: &mut Random) -> Event {
        let rate = self.attenuation[hero];
        let distance = -libm::logf(1.0 - random.next()) / rate;
        if distance < end {
            let passed = exp(-self.attenuation * distance);
            let density = (share * self.attenuation * passed).element_sum();
            let weight = if density > 0.0 {
                self.scattering * passed / density
            } else {
                Vec3::ZERO
            };
            return Event::Scattered { distance, weight };
        }
        let passed = self.transmittance(end);
        let probability = (share * passed).element_sum();
        let weight = if probability > 0.0 {
            passed / probability
        } else {
            Vec3::ZERO
        };
        Event::Passed { weight }
    }

    fn transmittance(&self, end: f32) -> Vec3 {
        // No attenuation over an infinite distance is none.
        exp(-self.attenuation * end.min(f32::MAX))
    }
}

/// A colour drawn in proportion to the throughput, with the probabilities of all colours.
fn hero(throughput: Vec3, random: &mut Random) -> (usize, Vec3) {
    let throughput = throughput.max(Vec3::ZERO);
    let total = throughput.element_sum();
    let share = if total > 0.0 && total.is_finite() {
        throughput / total
    } else {
        Vec3::splat(1.0 / 3.0)
    };
    let choice = random.next();
    let hero = if choice < share.x {
        0
    } else if choice < share.x + share.y || share.z == 0.0 {
        1
    } else {
        2
    };
    (hero, share)
}

fn exp(exponent: Vec3) -> Vec3 {
    Vec3::from(exponent.to_array().map(libm::expf))
}

#[cfg(test)]
mod tests;
