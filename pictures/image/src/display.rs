//! From linear light to the values of a display: exposure and tone curves.

use std::str::FromStr;

/// Tone curve of a picture for displays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tonemap {
    /// Values above 1 are cut off.
    #[default]
    None,
    /// The curve of film as the ACES reference has it, fitted by a quotient (Narkowicz 2015).
    Filmic,
    /// AgX (Sobotka 2022), its curve fitted by a polynomial (Wrensch 2023). Bright colours fade to white.
    AgX,
}

impl Tonemap {
    /// Every curve.
    pub const ALL: [Self; 3] = [Self::None, Self::Filmic, Self::AgX];

    /// The name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Filmic => "filmic",
            Self::AgX => "agx",
        }
    }
}

impl FromStr for Tonemap {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|curve| curve.name() == text);
        found.ok_or_else(|| {
            let known = Self::ALL.map(Self::name).join(", ");
            format!("unknown tone curve `{text}`; known are {known}")
        })
    }
}

/// Maps linear values to display values.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Display {
    /// Exposure in stops: 1 is twice as bright.
    pub exposure: f32,
    /// Tone curve.
    pub tonemap: Tonemap,
}

impl Display {
    /// Whether values stay as they are.
    pub fn is_plain(&self) -> bool {
        *self == Self::default()
    }

    /// Linear value of a display for a linear value of the scene. NaN gives 0.
    pub fn apply(&self, pixel: [f32; 3]) -> [f32; 3] {
        let factor = self.exposure.exp2();
        let pixel = pixel.map(|value| value * factor);
        match self.tonemap {
            Tonemap::None => pixel,
            Tonemap::Filmic => pixel.map(filmic),
            Tonemap::AgX => agx(pixel),
        }
    }
}

fn filmic(value: f32) -> f32 {
    // Beyond this value the curve is flat, and infinities would divide each other.
    let x = value.clamp(0.0, 1e4);
    (x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)).clamp(0.0, 1.0)
}

type Matrix = [[f32; 3]; 3];

/// Rows of the matrix from linear sRGB to the space of the curve, and back.
const INSET: Matrix = [
    [0.842_479_06, 0.078_433_6, 0.079_223_745],
    [0.042_328_242, 0.878_468_6, 0.079_166_13],
    [0.042_375_655, 0.078_433_6, 0.879_143],
];
const OUTSET: Matrix = [
    [1.196_879, -0.098_020_88, -0.099_029_75],
    [-0.052_896_85, 1.151_903_1, -0.098_961_18],
    [-0.052_971_635, -0.098_043_45, 1.151_073_7],
];
/// Stops around middle grey that the curve covers.
const STOPS: [f32; 2] = [-12.473_93, 4.026_069];

fn times(matrix: &Matrix, v: [f32; 3]) -> [f32; 3] {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn agx(pixel: [f32; 3]) -> [f32; 3] {
    let pixel = pixel.map(|value| value.clamp(0.0, 1e6));
    let curved = times(&INSET, pixel).map(|value| {
        let stops = value.max(1e-10).log2();
        let x = ((stops - STOPS[0]) / (STOPS[1] - STOPS[0])).clamp(0.0, 1.0);
        let terms = [-0.002_32, 0.119_1, 0.429_8, -6.868, 31.96, -40.14, 15.5];
        terms.iter().rev().fold(0.0, |sum, term| sum * x + term)
    });
    times(&OUTSET, curved).map(|value| value.max(0.0).powf(2.2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read() {
        for curve in Tonemap::ALL {
            assert_eq!(curve.name().parse(), Ok(curve));
        }
        assert!("aces".parse::<Tonemap>().is_err());
    }

    #[test]
    fn exposure_doubles_per_stop() {
        let display = Display {
            exposure: 2.0,
            tonemap: Tonemap::None,
        };
        assert_eq!(display.apply([0.1, 0.2, -1.0]), [0.4, 0.8, -4.0]);
        assert!(Display::default().is_plain() && !display.is_plain());
    }

    /// Curves rise, stay within 0 and 1, keep greys grey, and bring nothing from what is no number.
    #[test]
    fn curves_rise_from_black_to_white() {
        for tonemap in [Tonemap::Filmic, Tonemap::AgX] {
            let display = Display {
                exposure: 0.0,
                tonemap,
            };
            let grey = |value: f32| {
                let [r, g, b] = display.apply([value; 3]);
                assert!(
                    (r - g).abs() < 2e-3 && (g - b).abs() < 2e-3,
                    "{tonemap:?} {value}"
                );
                g
            };
            let mut last = grey(0.0);
            assert!(last < 2e-3, "{tonemap:?} {last}");
            for step in -60..60 {
                let value = grey((step as f32 / 5.0).exp2());
                assert!(
                    value >= last - 1e-4 && value < 1.01,
                    "{tonemap:?} {step}: {value}"
                );
                last = value;
            }
            assert!(last > 0.95, "{tonemap:?} {last}");
            assert!(grey(f32::INFINITY) > 0.95);
            let bad = display.apply([f32::NAN; 3]);
            assert!(bad.iter().all(|value| !(*value > 0.01)), "{bad:?}");
        }
        // Middle grey stays close to itself under AgX.
        let [_, grey, _] = Display {
            exposure: 0.0,
            tonemap: Tonemap::AgX,
        }
        .apply([0.18; 3]);
        assert!((0.15..0.25).contains(&grey), "{grey}");
    }
}
