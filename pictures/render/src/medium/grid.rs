//! Media whose density is given on a grid: delta tracking (Woodcock and others 1965) and ratio tracking (Novák,
//! Selle and Jarosz 2014).

use std::sync::Arc;

use antumbra_scene::DensityGrid;
use glam::{Mat4, Vec3};

use super::{Coefficients, Event, Random};

/// Transmittance below which ratio tracking plays roulette.
const FAINT: f32 = 0.1;

/// Density on a grid in the unit cube of its space.
#[derive(Clone, Debug)]
pub struct Grid {
    size: [u32; 3],
    values: Arc<[f32]>,
    grid_from_world: Mat4,
    /// Largest density of a cell, at least 0.
    largest: f32,
}

impl Grid {
    /// Prepares a grid of the scene.
    pub fn new(grid: &DensityGrid) -> Self {
        Self {
            size: grid.size,
            values: Arc::clone(&grid.values),
            grid_from_world: grid.world_from_grid.inverse(),
            largest: grid.values.iter().copied().fold(0.0, f32::max),
        }
    }

    /// Density at a point of grid space: trilinear between the middles of cells, as in pbrt-v3. Cells outside are empty.
    fn density(&self, point: Vec3) -> f32 {
        let size = Vec3::from(self.size.map(|count| count as f32));
        let place = point * size - 0.5;
        let cell = place.floor();
        let [x, y, z] = (place - cell).to_array();
        let corner = cell.to_array().map(|index| index as i64);
        let mut sum = 0.0;
        for bits in 0..8_u8 {
            let step = [bits & 1, bits >> 1 & 1, bits >> 2];
            let along = |axis: usize, share: f32| if step[axis] == 1 { share } else { 1.0 - share };
            let weight = along(0, x) * along(1, y) * along(2, z);
            let index = [0, 1, 2].map(|axis| corner[axis] + i64::from(step[axis]));
            sum += weight * self.value(index);
        }
        sum
    }

    fn value(&self, index: [i64; 3]) -> f32 {
        let size = self.size.map(i64::from);
        let is_inside = (0..3).all(|axis| (0..size[axis]).contains(&index[axis]));
        if !is_inside {
            return 0.0;
        }
        let place = (index[2] * size[1] + index[1]) * size[0] + index[0];
        self.values.get(place as usize).copied().unwrap_or(0.0)
    }

    /// Ray in grid space, and the interval of distances at which it is inside the unit cube.
    fn clip(&self, org: Vec3, dir: Vec3, end: f32) -> Option<(Vec3, Vec3, [f32; 2])> {
        let org = self.grid_from_world.transform_point3(org);
        let dir = self.grid_from_world.transform_vector3(dir);
        let mut interval = [0.0_f32, end];
        for axis in 0..3 {
            if dir[axis] == 0.0 {
                if !(0.0..=1.0).contains(&org[axis]) {
                    return None;
                }
                continue;
            }
            let [a, b] = [0.0, 1.0].map(|side| (side - org[axis]) / dir[axis]);
            interval = [interval[0].max(a.min(b)), interval[1].min(a.max(b))];
        }
        (interval[0] < interval[1]).then_some((org, dir, interval))
    }

    /// First event of a ray, by delta tracking for the colour `hero`, which is drawn with the probabilities `share`.
    ///
    /// Weights follow the balance heuristic over the colours (Wilkie and others 2014; Miller, Georgiev and Jarosz
    /// 2019). With equal attenuation coefficients they are the albedo, or 1.
    pub fn event(
        &self,
        coefficients: &Coefficients,
        [org, dir]: [Vec3; 2],
        end: f32,
        (hero, share): (usize, Vec3),
        random: &mut Random,
    ) -> Event {
        let passed = Event::Passed { weight: Vec3::ONE };
        let majorant = coefficients.attenuation.max_element() * self.largest;
        let Some((org, dir, [mut distance, end])) = self.clip(org, dir, end) else {
            return passed;
        };
        if majorant <= 0.0 {
            return passed;
        }
        // Probability of the null collisions so far, by colour and up to a common factor.
        let mut nulls = Vec3::ONE;
        loop {
            distance -= libm::logf(1.0 - random.next()) / majorant;
            // NaN ends the walk.
            if !(distance < end) {
                let weight = nulls / (share * nulls).element_sum();
                return Event::Passed { weight };
            }
            let relative = self.density(org + dir * distance) / majorant;
            let real = coefficients.attenuation * relative;
            if random.next() < real[hero] {
                let density = (share * real * nulls).element_sum();
                let weight = coefficients.scattering * relative * nulls / density;
                return Event::Scattered { distance, weight };
            }
            nulls *= (Vec3::ONE - real).max(Vec3::ZERO);
            // The hero's own probability is positive, so the largest is.
            nulls /= nulls.max_element();
        }
    }

    /// Estimate of the transmittance, by ratio tracking.
    pub fn transmittance(
        &self,
        coefficients: &Coefficients,
        org: Vec3,
        dir: Vec3,
        end: f32,
        random: &mut Random,
    ) -> Vec3 {
        let mut passed = Vec3::ONE;
        let majorant = coefficients.attenuation.max_element() * self.largest;
        let Some((org, dir, [mut distance, end])) = self.clip(org, dir, end) else {
            return passed;
        };
        if majorant <= 0.0 {
            return passed;
        }
        loop {
            distance -= libm::logf(1.0 - random.next()) / majorant;
            if !(distance < end) {
                return passed;
            }
            let density = self.density(org + dir * distance);
            passed *= (Vec3::ONE - coefficients.attenuation * (density / majorant)).max(Vec3::ZERO);
            let most = passed.max_element();
            if most < FAINT {
                let end = (1.0 - most).max(0.05);
                if random.next() < end {
                    return Vec3::ZERO;
                }
                passed /= 1.0 - end;
            }
        }
    }
}
