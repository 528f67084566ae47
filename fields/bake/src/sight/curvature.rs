//! Curvature of the earth and refraction of the air for lines of sight.
//!
//! # Why one bent scene serves all observers
//!
//! Seen from an observer at `o`, a place `p` in plan lies lower by `c |p - o|²` with `c = (1 - k) / (2 R)`: `R` is the radius of the
//! earth and `k` the coefficient of refraction. With these heights lines of sight are straight. This is the usual formula of
//! viewsheds, as of ESRI's and GDAL's, and is right to 1e-5 of the drop within 100 km.
//!
//! Now `c |p - o|² = c |p|² + (c |o|² - 2 c p·o)`. The part in brackets is linear in `p`, and adding it to heights maps straight
//! lines to straight lines. So whether a line is free does not depend on it, and the drop `c |p|²` from any one place is right for all
//! observers. The scene is bent once, and has one tree.

use crate::vector::dot;
use crate::{Error, Orientation};

/// Mean radius of the earth in metres (IUGG).
pub const EARTH_RADIUS: f64 = 6_371_008.8;

/// Coefficient of refraction of light in standard conditions, after Gauss.
pub const REFRACTION: f64 = 0.13;

/// Bends scenes so that lines of sight over a round earth are straight: see the [formula](Curvature::drop).
///
/// ```
/// use antumbra_bake::{Curvature, EARTH_RADIUS, Orientation, REFRACTION};
///
/// let earth = Curvature::new(EARTH_RADIUS, REFRACTION, [0.0; 3], Orientation::default())?;
/// assert!((earth.drop([10_000.0, 0.0, 0.0]) - 6.828).abs() < 1e-3, "metres in 10 km");
/// # Ok::<(), antumbra_bake::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Curvature {
    /// Drop per squared distance.
    factor: f64,
    centre: [f64; 3],
    orientation: Orientation,
}

impl Curvature {
    /// An earth of this radius, in units of the scene, that touches a level plane at `centre`. `refraction` is 0 without air and
    /// [`REFRACTION`] usually.
    ///
    /// # Errors
    /// [`Error::Range`] if the radius is not above 0 and finite, or the coefficient not in -10 to 1.
    pub fn new(
        radius: f64,
        refraction: f64,
        centre: [f64; 3],
        orientation: Orientation,
    ) -> Result<Self, Error> {
        let (is_length, what) = (radius > 0.0 && radius.is_finite(), "radius of the earth");
        Error::check_range(what, radius, is_length, "a length above 0")?;
        let (is_in, wanted) = (
            (-10.0..1.0).contains(&refraction),
            "a number from -10 to below 1",
        );
        Error::check_range("refraction", refraction, is_in, wanted)?;
        Ok(Self {
            factor: (1.0 - refraction) / (2.0 * radius),
            centre,
            orientation,
        })
    }

    /// Height that a place of the scene loses: `(1 - k) d² / (2 R)` with the distance `d` from the centre in plan.
    pub fn drop(&self, point: [f64; 3]) -> f64 {
        let [east, north] = self.plan(point);
        self.factor * (east * east + north * north)
    }

    /// Height that is lost per squared distance: `(1 - k) / (2 R)`.
    pub fn factor(&self) -> f64 {
        self.factor
    }

    /// Distances from the centre to the east and north.
    fn plan(&self, point: [f64; 3]) -> [f64; 2] {
        let apart = [0, 1, 2].map(|axis| point[axis] - self.centre[axis]);
        [self.orientation.east, self.orientation.north].map(|axis| dot(axis, apart))
    }

    /// The place in the bent scene.
    pub fn bend(&self, point: [f32; 3]) -> [f32; 3] {
        self.moved(point, -1.0)
    }

    /// The place that was bent, but for rounding.
    pub fn unbend(&self, point: [f32; 3]) -> [f32; 3] {
        self.moved(point, 1.0)
    }

    fn moved(&self, point: [f32; 3], sign: f64) -> [f32; 3] {
        let wide = point.map(f64::from);
        let rise = sign * self.drop(wide);
        [0, 1, 2].map(|axis| (wide[axis] + rise * self.orientation.up[axis]) as f32)
    }

    /// Normal of the bent surface at a place of the scene, of the length of `normal`.
    pub fn bend_normal(&self, point: [f32; 3], normal: [f32; 3]) -> [f32; 3] {
        let wide = normal.map(f64::from);
        let [east, north] = self.plan(point.map(f64::from));
        let up = dot(wide, self.orientation.up);
        let tilt = |axis: usize| {
            let Orientation {
                east: e, north: n, ..
            } = self.orientation;
            2.0 * self.factor * up * (east * e[axis] + north * n[axis])
        };
        let bent: [f64; 3] = [0, 1, 2].map(|axis| wide[axis] + tilt(axis));
        let scale = (dot(wide, wide) / dot(bent, bent)).sqrt();
        match scale.is_finite() {
            true => bent.map(|x| (scale * x) as f32),
            false => normal,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::UpAxis;

    #[test]
    fn one_centre_serves_all_observers() {
        let at = |centre| {
            let orientation = Orientation::new(UpAxis::Y, 20.0).expect("axes");
            Curvature::new(6000.0, 0.1, centre, orientation).expect("an earth")
        };
        let [one, other] = [at([0.0; 3]), at([700.0, 3.0, -200.0])];
        // Heights of three places on a line, over the line through the outer ones.
        let over = |earth: &Curvature, points: [[f64; 3]; 3]| {
            let [a, b, c] = points.map(|point| point[1] - earth.drop(point));
            b - 0.5 * (a + c)
        };
        let points = [[-100.0, 5.0, 40.0], [100.0, 9.0, 60.0], [300.0, 2.0, 80.0]];
        assert!((over(&one, points) - over(&other, points)).abs() < 1e-9);
    }

    #[test]
    fn places_and_normals_bend() {
        let plan = Orientation::default();
        let earth = Curvature::new(5000.0, 0.0, [0.0; 3], plan).expect("an earth");
        assert_eq!(earth.bend([100.0, 0.0, 7.0]), [100.0, 0.0, 6.0]);
        assert_eq!(earth.unbend([100.0, 0.0, 6.0]), [100.0, 0.0, 7.0]);
        let normal = earth.bend_normal([100.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
        // The slope of -x² / 10000 at 100 is -1/50.
        assert!((normal[0] / normal[2] - 0.02).abs() < 1e-7);
        assert_eq!(earth.bend_normal([1.0; 3], [0.0; 3]), [0.0; 3]);
        assert!(Curvature::new(0.0, 0.0, [0.0; 3], plan).is_err());
        assert!(Curvature::new(1.0, 1.0, [0.0; 3], plan).is_err());
    }
}
