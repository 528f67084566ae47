//! Comparison of an image with a reference: error measures, and a test whether chance explains the difference.
//!
//! [`compare`] computes the usual error measures. If the standard error of the image or the reference is known, every
//! pixel is tested as well, by z = difference / sqrt(error of the image² + error of the reference²). z is about
//! normally distributed if both images estimate the same picture, so |z| > 4 is rare. A few pixels may exceed the
//! limit even so, because samples of a path tracer have heavy tails. A wrong image has many such pixels.

use crate::{Error, Image};

/// Summand of the squared reference in the relative squared error. Without it, black pixels would dominate.
pub const RELATIVE_MSE_EPSILON: f64 = 0.01;

/// Signal of the peak signal-to-noise ratio: linear 1, display white.
///
/// A fixed signal makes the ratios of different images comparable.
pub const PSNR_PEAK: f64 = 1.0;

/// Standard errors per pixel and channel, as images of equal size. `None` means that the values are exact.
#[derive(Clone, Copy, Debug, Default)]
pub struct StandardErrors<'a> {
    /// Standard error of the image.
    pub image: Option<&'a Image>,
    /// Standard error of the reference.
    pub reference: Option<&'a Image>,
}

/// Limits of the z test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Largest |z| of a channel that passes; at least 0.
    pub limit: f64,
    /// Largest share of pixels beyond `limit` with which the test passes; 0 to 1.
    pub limit_share: f64,
    /// Largest relative difference that counts as rounding; at least 0, and 0 by default.
    ///
    /// z is 0 where |image - reference| is at most `rounding` times the larger of the two values. 1e-5 suits pictures
    /// of a light with constant radiance: its samples have no spread, so the last bit of a sum would decide.
    pub rounding: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            limit: 4.0,
            limit_share: 0.01,
            rounding: 0.0,
        }
    }
}

/// Result of [`compare`].
///
/// Measures other than the counts and the z test are taken over the pixels that are finite in both images. Without
/// such a pixel they are NaN.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Comparison {
    /// Number of pixels of the data window.
    pub pixels: usize,
    /// Number of pixels of the image with a NaN or infinity.
    pub non_finite_image: usize,
    /// Number of pixels of the reference with a NaN or infinity.
    pub non_finite_reference: usize,
    /// Mean squared error: the mean over pixels and channels of (image - reference)².
    pub mse: f64,
    /// Relative mean squared error: the mean of (image - reference)² / (reference² + [`RELATIVE_MSE_EPSILON`]).
    pub relative_mse: f64,
    /// Peak signal-to-noise ratio, 10 log10([`PSNR_PEAK`]² / mse), in decibels; infinite for equal images.
    pub psnr: f64,
    /// Largest |image - reference| of any channel.
    pub max_difference: f64,
    /// Mean of each channel of the image.
    pub mean_image: [f64; 3],
    /// Mean of each channel of the reference.
    pub mean_reference: [f64; 3],
    /// Relative difference of the means per channel: (image - reference) / |reference|.
    ///
    /// 0 where both means are 0, infinite where only the reference's mean is 0.
    pub mean_difference: [f64; 3],
    /// Result of the z test; `None` without standard errors.
    pub z: Option<ZTest>,
}

/// Result of the z test.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ZTest {
    /// Limits of the test.
    pub options: Options,
    /// Number of pixels with |z| above the limit in any channel.
    pub beyond: usize,
    /// Share of the pixels of the data window that are beyond the limit, 0 to 1.
    pub share: f64,
    /// Place with the largest |z|, the first in storage order.
    pub worst: Worst,
    /// True if the share is within its limit.
    pub pass: bool,
}

/// Channel of a pixel, and its z.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Worst {
    /// Column in the full picture.
    pub x: i32,
    /// Row in the full picture.
    pub y: i32,
    /// Channel: 0 red, 1 green, 2 blue.
    pub channel: usize,
    /// Signed z: positive where the image is brighter than the reference.
    pub z: f64,
}

/// Compares an image with a reference that covers the same pixels.
///
/// Where both standard errors are 0, z is 0 for values that are equal up to [`Options::rounding`], and infinite
/// otherwise. z is also infinite where a value is not finite, or where a standard error is negative or not finite.
///
/// # Errors
/// [`Error::SizeMismatch`] if any two of the images differ in size or data window,
/// [`Error::BadOption`] for limits out of range.
pub fn compare(
    image: &Image,
    reference: &Image,
    errors: StandardErrors<'_>,
    options: &Options,
) -> Result<Comparison, Error> {
    check_options(options)?;
    check_sizes(image, reference, errors)?;
    let tested = errors.image.is_some() || errors.reference.is_some();
    let mut comparison = measure(image, reference);
    comparison.z = tested.then(|| z_test(image, reference, errors, options));
    Ok(comparison)
}

/// Largest |image - reference| of the channels of each pixel, in storage order, for a heat map.
///
/// NaN where a value is not finite.
///
/// # Errors
/// [`Error::SizeMismatch`] if the images differ in size or data window.
pub fn difference_field(image: &Image, reference: &Image) -> Result<Vec<f32>, Error> {
    check_sizes(image, reference, StandardErrors::default())?;
    let pairs = image.pixels().iter().zip(reference.pixels());
    Ok(pairs
        .map(|(a, b)| {
            if finite(a) && finite(b) {
                difference(a, b)
                    .into_iter()
                    .map(f64::abs)
                    .fold(0.0, f64::max) as f32
            } else {
                f32::NAN
            }
        })
        .collect())
}

/// Largest |z| of the channels of each pixel, in storage order, for a heat map.
///
/// z is defined as in [`compare`], with `rounding` as in [`Options`].
///
/// # Errors
/// [`Error::SizeMismatch`], or [`Error::BadOption`] for a negative or NaN `rounding`.
pub fn z_field(
    image: &Image,
    reference: &Image,
    errors: StandardErrors<'_>,
    rounding: f64,
) -> Result<Vec<f32>, Error> {
    check_at_least_zero("rounding", rounding)?;
    check_sizes(image, reference, errors)?;
    let largest = |z: [f64; 3]| z.into_iter().map(f64::abs).fold(0.0, f64::max) as f32;
    let z = z_values(image, reference, errors, rounding);
    Ok(z.map(largest).collect())
}

fn check_options(options: &Options) -> Result<(), Error> {
    let Options {
        limit,
        limit_share,
        rounding,
    } = *options;
    check_at_least_zero("limit", limit)?;
    check_at_least_zero("rounding", rounding)?;
    if !(0.0..=1.0).contains(&limit_share) {
        return Err(Error::BadOption {
            name: "limit_share",
            value: limit_share,
            valid: "between 0 and 1",
        });
    }
    Ok(())
}

fn check_at_least_zero(name: &'static str, value: f64) -> Result<(), Error> {
    if value >= 0.0 {
        return Ok(());
    }
    Err(Error::BadOption {
        name,
        value,
        valid: "at least 0",
    })
}

fn check_sizes(image: &Image, reference: &Image, errors: StandardErrors<'_>) -> Result<(), Error> {
    let others = [
        ("the reference", Some(reference)),
        ("the standard error of the image", errors.image),
        ("the standard error of the reference", errors.reference),
    ];
    let size = |image: &Image| (image.width(), image.height(), image.window());
    for (name, other) in others {
        if let Some(other) = other.filter(|other| size(other) != size(image)) {
            return Err(Error::SizeMismatch {
                first: "the image",
                first_size: image.describe_size(),
                second: name,
                second_size: other.describe_size(),
            });
        }
    }
    Ok(())
}

/// Computes all measures except the z test.
fn measure(image: &Image, reference: &Image) -> Comparison {
    let mut finite_pixels = 0.0;
    let (mut squares, mut relative_squares, mut max_difference) = (0.0, 0.0, f64::NAN);
    let (mut sum_image, mut sum_reference) = ([0.0; 3], [0.0; 3]);
    for (a, b) in image.pixels().iter().zip(reference.pixels()) {
        if !finite(a) || !finite(b) {
            continue;
        }
        finite_pixels += 1.0;
        for (channel, difference) in difference(a, b).into_iter().enumerate() {
            let value = f64::from(b[channel]);
            let square = difference * difference;
            squares += square;
            relative_squares += square / (value * value + RELATIVE_MSE_EPSILON);
            max_difference = difference.abs().max(max_difference);
            sum_image[channel] += f64::from(a[channel]);
            sum_reference[channel] += value;
        }
    }
    // Without a finite pixel the means are 0/0, which is NaN as documented.
    let mse = squares / (3.0 * finite_pixels);
    let mean_image = sum_image.map(|sum| sum / finite_pixels);
    let mean_reference = sum_reference.map(|sum| sum / finite_pixels);
    Comparison {
        pixels: image.pixels().len(),
        non_finite_image: image.non_finite(),
        non_finite_reference: reference.non_finite(),
        mse,
        relative_mse: relative_squares / (3.0 * finite_pixels),
        psnr: 10.0 * (PSNR_PEAK * PSNR_PEAK / mse).log10(),
        max_difference,
        mean_image,
        mean_reference,
        mean_difference: std::array::from_fn(|c| {
            ratio(mean_image[c] - mean_reference[c], mean_reference[c].abs())
        }),
        z: None,
    }
}

fn z_test(
    image: &Image,
    reference: &Image,
    errors: StandardErrors<'_>,
    options: &Options,
) -> ZTest {
    let mut beyond = 0;
    let (mut worst_index, mut worst_channel, mut worst_z) = (0, 0, 0.0_f64);
    for (index, z) in z_values(image, reference, errors, options.rounding).enumerate() {
        beyond += usize::from(z.iter().any(|z| z.abs() > options.limit));
        for (channel, z) in z.into_iter().enumerate() {
            if z.abs() > worst_z.abs() {
                (worst_index, worst_channel, worst_z) = (index, channel, z);
            }
        }
    }
    let window = image.window();
    let share = beyond as f64 / image.pixels().len() as f64;
    ZTest {
        options: *options,
        beyond,
        share,
        worst: Worst {
            x: window.x0 + (worst_index % window.width()) as i32,
            y: window.y0 + (worst_index / window.width()) as i32,
            channel: worst_channel,
            z: worst_z,
        },
        pass: share <= options.limit_share,
    }
}

/// Values of z for each channel of each pixel, in storage order.
fn z_values<'a>(
    image: &'a Image,
    reference: &'a Image,
    errors: StandardErrors<'a>,
    rounding: f64,
) -> impl Iterator<Item = [f64; 3]> + 'a {
    let error = |image: Option<&'a Image>, index: usize, channel: usize| {
        f64::from(image.map_or(0.0, |image| image.pixels()[index][channel]))
    };
    let pairs = image.pixels().iter().zip(reference.pixels());
    pairs.enumerate().map(move |(index, (a, b))| {
        let difference = difference(a, b);
        std::array::from_fn(|c| {
            let error_image = error(errors.image, index, c);
            let error_reference = error(errors.reference, index, c);
            let usable = |error: f64| error >= 0.0 && error.is_finite();
            let larger = f64::from(a[c].abs().max(b[c].abs()));
            if !difference[c].is_finite() || !usable(error_image) || !usable(error_reference) {
                f64::INFINITY
            } else if difference[c].abs() <= rounding * larger {
                0.0
            } else {
                ratio(difference[c], error_image.hypot(error_reference))
            }
        })
    })
}

fn finite(pixel: &[f32; 3]) -> bool {
    pixel.iter().all(|value| value.is_finite())
}

/// Difference `a - b`. Finite `f32` values cannot overflow in `f64`.
fn difference(a: &[f32; 3], b: &[f32; 3]) -> [f64; 3] {
    std::array::from_fn(|channel| f64::from(a[channel]) - f64::from(b[channel]))
}

/// Quotient `numerator / denominator`, with 0 for 0 / 0.
fn ratio(numerator: f64, denominator: f64) -> f64 {
    if numerator == 0.0 && denominator == 0.0 {
        0.0
    } else {
        numerator / denominator
    }
}
