//! A cone of light with a smooth edge.

use glam::Vec3;

/// Intensity of a spot by direction.
#[derive(Clone, Copy, Debug)]
pub struct Spot {
    /// Unit vector along the axis of the cone, away from the light.
    pub axis: Vec3,
    /// Radiant intensity on the axis.
    pub intensity: Vec3,
    /// Cosine of the angle at which the light ends.
    pub cos_total_width: f32,
    /// Cosine of the angle at which the falloff begins.
    pub cos_falloff_start: f32,
}

impl Spot {
    /// Intensity towards the unit vector `w`.
    #[inline]
    pub fn intensity(&self, w: Vec3) -> Vec3 {
        self.intensity * self.falloff(w.dot(self.axis))
    }

    /// Falloff: 1 inside the inner cone, 0 outside the outer one, a quartic between.
    #[inline]
    fn falloff(&self, cos: f32) -> f32 {
        if cos < self.cos_total_width {
            0.0
        } else if cos >= self.cos_falloff_start {
            1.0
        } else {
            let width = self.cos_falloff_start - self.cos_total_width;
            let share = (cos - self.cos_total_width) / width;
            share * share * share * share
        }
    }

    /// Mean intensity over all directions. The mean of the quartic is one fifth.
    pub fn mean_intensity(&self) -> Vec3 {
        let falloff = self.cos_falloff_start - self.cos_total_width;
        self.intensity * (0.5 * (1.0 - self.cos_falloff_start + falloff / 5.0))
    }
}
