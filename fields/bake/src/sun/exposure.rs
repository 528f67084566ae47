//! How much of the sky and of the sun points get.

use antumbra::Bvh;

use crate::memory;
use crate::sight::bits::ones;
use crate::sight::visibility::{DirectionRows, fold_directions};
use crate::sun::sky::SkyPatches;
use crate::vector::dot;
use crate::{Error, Monitor, Orientation, Weighting};

/// Sky view factor of each point, or its sky exposure.
///
/// | weighting | value | open level ground | open wall |
/// |---|---|---|---|
/// | [`Cosine`](Weighting::Cosine) | light of an even sky on the surface, over that on open level ground | 1 | about 1/2 |
/// | [`Uniform`](Weighting::Uniform) | part of the sky's solid angle that is seen | 1 | about 1/2 |
///
/// Points, normals and visibility are as in [`sees_directions`](crate::sees_directions): one ray goes to the centre of each
/// patch. Points in free space, with `normals` empty, weigh by the cosine to the vertical. A point or normal that is not finite,
/// and a normal of length 0, have the value NaN.
///
/// # Errors
/// As [`sees_directions`](crate::sees_directions).
pub fn sky_view(
    bvh: &Bvh,
    points: &[[f32; 3]],
    normals: &[[f32; 3]],
    (patches, orientation): (&SkyPatches, &Orientation),
    weighting: Weighting,
    monitor: &dyn Monitor,
) -> Result<Vec<f32>, Error> {
    let directions = patches.directions(orientation);
    let rows = DirectionRows::new(bvh, points, normals, &directions, f32::INFINITY)?;
    let is_free = normals.is_empty();
    let mut values = memory::filled("values", points.len(), f32::NAN)?;
    fold_directions(&rows, monitor, (1, &mut values), &|normal, seen, value| {
        let local = match is_free {
            true => [0.0, 0.0, 1.0],
            false => orientation.local(normal),
        };
        value[0] = patches.view(local, weighting, seen) as f32;
    })?;
    Ok(values)
}

impl SkyPatches {
    /// [`sky_view`] of a surface with this normal (of length 1, in terms of east, north and up) that sees these patches: a row of
    /// a [`BitMatrix`](crate::BitMatrix).
    pub fn view(&self, normal: [f64; 3], weighting: Weighting, seen: &[u64]) -> f64 {
        let sum = |patches: &mut dyn Iterator<Item = usize>, normal| {
            patches.fold(0.0, |sum, patch| {
                sum + self.weight(patch, normal, weighting)
            })
        };
        let all = sum(&mut (0..self.len()), [0.0, 0.0, 1.0]);
        sum(&mut ones(seen), normal) / all
    }

    /// Weight of a patch for a surface with this normal.
    pub(crate) fn weight(&self, patch: usize, normal: [f64; 3], weighting: Weighting) -> f64 {
        let cosine = match weighting {
            Weighting::Cosine => dot(self.centres[patch], normal).max(0.0),
            Weighting::Uniform => 1.0,
        };
        self.solid_angles[patch] * cosine
    }

    /// Light in W/m² on a surface with this normal (of length 1, in terms of east, north and up) from the patches that it sees.
    /// Radiances are values of [`perez_sky`](crate::perez_sky), or their sums over time.
    ///
    /// # Panics
    /// If there are fewer radiances than patches.
    pub fn irradiance(&self, normal: [f64; 3], radiances: &[f64], seen: &[u64]) -> f64 {
        ones(seen).fold(0.0, |sum, patch| {
            let cosine = dot(self.centres[patch], normal).max(0.0);
            sum + radiances[patch] * self.solid_angles[patch] * cosine
        })
    }
}

/// Sum of the weights of the directions that each point sees, such as hours of direct sun: `[n]`.
///
/// Give the direction to the sun in the middle of each step of time, and the length of the step as its weight. Points, normals
/// and visibility are as in [`sees_directions`](crate::sees_directions). Suns below the horizon count like others: leave
/// them out. Weights are added in the order of directions, in double precision. A point or normal that is not finite, and a
/// normal of length 0, have the value NaN.
///
/// # Errors
/// As [`sees_directions`](crate::sees_directions), and [`Error::Length`] if there is not one weight for each direction.
pub fn sun_hours(
    bvh: &Bvh,
    points: &[[f32; 3]],
    normals: &[[f32; 3]],
    directions: &[[f32; 3]],
    weights: &[f64],
    monitor: &dyn Monitor,
) -> Result<Vec<f64>, Error> {
    Error::check_length("weights", weights.len(), directions.len())?;
    let rows = DirectionRows::new(bvh, points, normals, directions, f32::INFINITY)?;
    let mut values = memory::filled("values", points.len(), f64::NAN)?;
    fold_directions(&rows, monitor, (1, &mut values), &|_, seen, value| {
        value[0] = ones(seen).fold(0.0, |sum, direction| sum + weights[direction]);
    })?;
    Ok(values)
}
