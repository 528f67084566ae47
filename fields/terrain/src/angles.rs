//! Angles in degrees.

use crate::Error;

/// Refuses azimuths that are not finite.
pub fn check_azimuths(azimuths: &[f64]) -> Result<(), Error> {
    let wanted = "a finite angle in degrees";
    let mut azimuths = azimuths.iter();
    azimuths.try_for_each(|&x| Error::check_range("azimuth", x, x.is_finite(), wanted))
}

/// Sine and cosine of an angle in degrees; exact at right angles.
pub fn sin_cos_degrees(angle: f64) -> (f64, f64) {
    match angle.rem_euclid(360.0) {
        0.0 => (0.0, 1.0),
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        // The system's own functions differ in their last bits.
        angle => libm::sincos(angle.to_radians()),
    }
}

/// Slope of an elevation in degrees, its tangent: infinite at the zenith, and NaN for what is no elevation from -90 to 90.
pub fn slope(elevation: f64) -> f64 {
    let (sin, cos) = sin_cos_degrees(elevation);
    match elevation.abs() <= 90.0 {
        true => sin / cos,
        false => f64::NAN,
    }
}

/// Elevation in degrees of a slope, rounded to single precision: -90 and 90 for infinite ones.
///
/// Without branches, so that compilers make vectors of it; with the same bits everywhere, as it is only sums, products and a quotient.
#[inline(always)]
pub fn degrees(slope: f64) -> f32 {
    /// `atan(x) / x` in degrees, as a polynomial of `x²` up to the tangent of 22.5 degrees: right to 3e-14.
    const SERIES: [f64; 9] = [
        57.29577951308083,
        -19.098593169615793,
        11.45915568083057,
        -8.185097899470762,
        6.365786541181623,
        -5.201595026435774,
        4.334090156682455,
        -3.367295362935665,
        1.7589310814485635,
    ];
    let tan = std::f64::consts::SQRT_2 - 1.0;
    let size = slope.abs();
    // Turned by 45 or 90 degrees where that brings it near 0.
    let (turn, above, below) = match (size > tan, size > 1.0 / tan) {
        (false, _) => (0.0, size, 1.0),
        (true, false) => (45.0, size - 1.0, size + 1.0),
        (true, true) => (90.0, -1.0, size),
    };
    let part = above / below;
    let square = part * part;
    let series = SERIES
        .iter()
        .rev()
        .fold(0.0, |sum, &term| sum * square + term);
    (turn + part * series).copysign(slope) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degrees_are_rounded_once() {
        let mut worst = 0;
        for exponent in -300..=300 {
            for step in 0..400 {
                let slope = 2_f64.powf(f64::from(exponent) / 10.0 + f64::from(step) / 4000.0);
                let wanted = slope.atan().to_degrees() as f32;
                worst = worst.max(degrees(slope).to_bits().abs_diff(wanted.to_bits()));
                assert_eq!(degrees(-slope), -degrees(slope));
            }
        }
        assert!(worst <= 1, "{worst}");
        let exact = [0.0, 1.0, -1.0, f64::INFINITY, f64::NEG_INFINITY].map(degrees);
        assert_eq!(exact, [0.0, 45.0, -45.0, 90.0, -90.0]);
        assert!(degrees(f64::NAN).is_nan());
        assert_eq!(
            [-90.0, 0.0, 90.0].map(slope),
            [f64::NEG_INFINITY, 0.0, f64::INFINITY]
        );
        assert!(
            [90.1, -91.0, f64::NAN]
                .map(slope)
                .iter()
                .all(|slope| slope.is_nan())
        );
    }
}
