//! [`Rgb8Image`], 8-bit sRGB pixels for displays, and the sRGB curve.

use std::sync::LazyLock;

use crate::Error;

/// Picture of 8-bit sRGB pixels, row by row, top row first. There is at least one pixel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rgb8Image {
    width: usize,
    height: usize,
    pixels: Vec<[u8; 3]>,
}

impl Rgb8Image {
    /// Makes a picture of `width * height` pixels, row by row, top row first.
    ///
    /// # Errors
    /// [`Error::BadSize`] or [`Error::WrongCount`].
    pub fn new(width: usize, height: usize, pixels: Vec<[u8; 3]>) -> Result<Self, Error> {
        let valid = 1..=i32::MAX as usize;
        if !valid.contains(&width) || !valid.contains(&height) {
            return Err(Error::BadSize { width, height });
        }
        let expected = width.saturating_mul(height);
        if pixels.len() != expected {
            return Err(Error::WrongCount {
                expected,
                found: pixels.len(),
            });
        }
        Ok(Self::covering(width, height, pixels))
    }

    /// Makes a picture without checks. The caller guarantees a valid size and `width * height` pixels.
    pub(crate) fn covering(width: usize, height: usize, pixels: Vec<[u8; 3]>) -> Self {
        debug_assert_eq!(pixels.len(), width * height);
        Self {
            width,
            height,
            pixels,
        }
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Pixels, row by row, top row first.
    pub fn pixels(&self) -> &[[u8; 3]] {
        &self.pixels
    }
}

/// Least linear values of the bytes 1 to 255: the points where the sRGB curve passes the middle between two bytes.
///
/// Lookups in the table round correctly and need no power per pixel.
static THRESHOLDS: LazyLock<[f64; 255]> =
    LazyLock::new(|| std::array::from_fn(|i| linear_from_srgb((i as f64 + 0.5) / 255.0)));

/// Inverse of the sRGB transfer curve (IEC 61966-2-1), from 0..=1 to 0..=1.
fn linear_from_srgb(encoded: f64) -> f64 {
    if encoded <= 0.04045 {
        encoded / 12.92
    } else {
        ((encoded + 0.055) / 1.055).powf(2.4)
    }
}

/// sRGB byte of a linear channel value, by the transfer curve of IEC 61966-2-1, rounded to nearest.
///
/// Values below 0 and NaN give 0, and values above 1 give 255.
pub fn srgb8(linear: f32) -> u8 {
    // NaN passes no threshold and gives 0.
    THRESHOLDS.partition_point(|&threshold| f64::from(linear) >= threshold) as u8
}

/// 16-bit sRGB value of a linear channel value. Values below 0 and NaN give 0, and values above 1 give 65535.
pub(crate) fn srgb16(linear: f32) -> u16 {
    let linear = f64::from(linear);
    let encoded = if linear <= 0.003_130_8 {
        12.92 * linear
    } else {
        1.055 * linear.min(1.0).powf(1.0 / 2.4) - 0.055
    };
    // NaN becomes 0.
    (encoded * 65535.0).round() as u16
}

/// Linear value of an sRGB value from 0 to 1.
pub(crate) fn linear(encoded: f32) -> f32 {
    linear_from_srgb(f64::from(encoded)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Transfer curve as the standard prints it.
    fn encode(linear: f64) -> f64 {
        if linear <= 0.0031308 {
            12.92 * linear
        } else {
            1.055 * linear.powf(1.0 / 2.4) - 0.055
        }
    }

    #[test]
    fn srgb8_known_values() {
        let known = [
            (0.0, 0),
            (1.0, 255),
            (0.5, 188),
            (0.18, 118),
            (0.214_041_14, 128),
            (0.003_130_8, 10),
            (-0.0, 0),
            (-1.0, 0),
            (1.5, 255),
            (f32::INFINITY, 255),
            (f32::NEG_INFINITY, 0),
            (f32::NAN, 0),
            (f32::MIN_POSITIVE, 0),
        ];
        for (linear, byte) in known {
            assert_eq!(srgb8(linear), byte, "{linear}");
        }
    }

    #[test]
    fn srgb8_is_the_rounded_curve() {
        for i in 0..=1_000_000 {
            let linear = i as f32 / 1_000_000.0;
            let exact = encode(f64::from(linear)) * 255.0;
            let byte = f64::from(srgb8(linear));
            // The two branches of the standard meet only to about 1e-8.
            assert!(
                (byte - exact).abs() <= 0.5 + 1e-4,
                "{linear}: {byte} for {exact}"
            );
        }
    }

    #[test]
    fn every_byte_comes_back() {
        for byte in 0..=255u8 {
            let linear = linear_from_srgb(f64::from(byte) / 255.0) as f32;
            assert_eq!(srgb8(linear), byte);
        }
    }

    #[test]
    fn wrong_parts_are_errors() {
        assert!(matches!(
            Rgb8Image::new(0, 2, vec![]),
            Err(Error::BadSize {
                width: 0,
                height: 2
            })
        ));
        assert!(matches!(
            Rgb8Image::new(2, 2, vec![[0; 3]; 3]),
            Err(Error::WrongCount {
                expected: 4,
                found: 3
            })
        ));
    }
}
