//! A light, or a group of lights, as seen from afar.

use glam::Vec3;

use crate::light::Extent;

/// Source of a cheap estimate of irradiance.
#[derive(Clone, Copy, Debug)]
pub struct Source {
    /// Luminance of the irradiance: at distance 1 for a source with a place, everywhere for others.
    strength: f32,
    /// Centre, and squared radius below which distance no longer counts. `None` if infinitely far away.
    place: Option<(Vec3, f32)>,
}

impl Source {
    /// Source of a light of this extent.
    pub fn new(extent: Extent) -> Self {
        Self {
            strength: extent.strength.max(0.0),
            place: extent
                .ball
                .map(|(center, radius)| (center, (radius * radius).max(f32::MIN_POSITIVE))),
        }
    }

    /// Source of all `parts` together. If only some are infinitely far away, the source is large from everywhere.
    pub fn sum(parts: &[Self]) -> Self {
        let balls: Vec<_> = parts.iter().filter_map(|part| part.place).collect();
        let place = (!balls.is_empty()).then(|| {
            if balls.len() < parts.len() {
                return (Vec3::ZERO, f32::INFINITY);
            }
            let edge = |sign: f32| balls.iter().map(move |(c, r)| c + sign * r.sqrt());
            let low = edge(-1.0).fold(Vec3::INFINITY, Vec3::min);
            let high = edge(1.0).fold(Vec3::NEG_INFINITY, Vec3::max);
            let radius2 = 0.25 * low.distance_squared(high);
            ((low + high) * 0.5, radius2.max(f32::MIN_POSITIVE))
        });
        Self {
            strength: parts.iter().map(|part| part.strength).sum(),
            place,
        }
    }

    /// Luminance of the irradiance: at distance 1 for a source with a place, everywhere for others.
    pub fn strength(&self) -> f32 {
        self.strength
    }

    /// Whether all parts are about equally far from a point: at least twice the radius.
    #[inline]
    pub fn is_small_from(&self, at: Vec3) -> bool {
        self.place
            .is_none_or(|(center, radius2)| at.distance_squared(center) > 4.0 * radius2)
    }

    /// Centre. `None` if infinitely far away.
    pub fn center(&self) -> Option<Vec3> {
        self.place.map(|(center, _)| center)
    }

    /// Estimate of the unoccluded irradiance at a point.
    #[inline]
    pub fn irradiance(&self, at: Vec3) -> f32 {
        match self.place {
            Some((center, floor)) => self.strength / at.distance_squared(center).max(floor),
            None => self.strength,
        }
    }
}
