//! Heat maps: scalar fields drawn in the colours of the [palette], with a legend.

use crate::{Error, Rgb8Image, digits, palette};

/// Values at the two ends of the colour map. Values beyond an end get its colour.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Range {
    /// From 0 to the largest finite value.
    #[default]
    Max,
    /// From 0 to a percentile of the finite values (nearest rank), given as a percentage from 0 to 100.
    ///
    /// A percentile below 100 keeps a few outliers from darkening the rest.
    Percentile(f64),
    /// From `min` to `max`. Both are finite, and `min < max`.
    Fixed {
        /// Value of the dark end.
        min: f32,
        /// Value of the light end.
        max: f32,
    },
}

/// Options for drawing a field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Values at the ends of the colour map.
    pub range: Range,
    /// True to add the legend below the picture.
    pub legend: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            range: Range::default(),
            legend: true,
        }
    }
}

/// Rows between the picture, the bar, the numbers and the edge.
const GAP: usize = 4;
/// Height of the bar of colours in the legend.
const BAR: usize = 8;
/// Columns that must stay free between two numbers.
const SPACE: usize = 8;

const BACKGROUND: [u8; 3] = [0; 3];
const TEXT: [u8; 3] = [255; 3];

/// Draws `field`, `[height, width]` values with the top row first.
///
/// The legend below the picture shows the colour map over the full width. Under it are the values at both ends and,
/// if there is room, in the middle. A picture that is too narrow for two numbers is widened with black on the right.
/// NaN is grey. Infinities get the colour of their end, as other values beyond the ends do.
///
/// # Errors
/// [`Error::BadSize`], [`Error::WrongCount`], [`Error::BadRange`] or [`Error::BadOption`].
pub fn render(
    field: &[f32],
    width: usize,
    height: usize,
    options: &Options,
) -> Result<Rgb8Image, Error> {
    let (min, max) = shared_range(&[field], options.range)?;
    // Computed in f64, because max - min may overflow f32.
    let (low, high) = (f64::from(min), f64::from(max));
    let colour = |&value: &f32| palette::colour(((f64::from(value) - low) / (high - low)) as f32);
    let picture = Rgb8Image::new(width, height, field.iter().map(colour).collect())?;
    Ok(if options.legend {
        with_legend(&picture, min, max)
    } else {
        picture
    })
}

/// Values `(min, max)` of `range` for several fields together.
///
/// Fields drawn with one [`Range::Fixed`] of these values can be compared by eye. If no value is finite and above 0,
/// automatic ranges are 0 to 1.
///
/// # Errors
/// [`Error::BadRange`] or [`Error::BadOption`].
pub fn shared_range(fields: &[&[f32]], range: Range) -> Result<(f32, f32), Error> {
    let finite = || {
        let values = fields.iter().copied().flatten().copied();
        values.filter(|value| value.is_finite())
    };
    let max = match range {
        Range::Fixed { min, max } => {
            let valid = min.is_finite() && max.is_finite() && min < max;
            return valid
                .then_some((min, max))
                .ok_or(Error::BadRange { min, max });
        }
        Range::Max => finite().fold(0.0, f32::max),
        Range::Percentile(percentage) => {
            if !(0.0..=100.0).contains(&percentage) {
                return Err(Error::BadOption {
                    name: "percentile",
                    value: percentage,
                    valid: "between 0 and 100",
                });
            }
            nearest_rank(finite().collect(), percentage)
        }
    };
    Ok((0.0, if max > 0.0 { max } else { 1.0 }))
}

/// Smallest value with at least `percentage` percent of all values at or below it; 0 without values.
fn nearest_rank(mut values: Vec<f32>, percentage: f64) -> f32 {
    if values.is_empty() {
        return 0.0;
    }
    let rank = (percentage / 100.0 * values.len() as f64).ceil() as usize;
    let index = rank.clamp(1, values.len()) - 1;
    *values.select_nth_unstable_by(index, f32::total_cmp).1
}

/// Adds the legend for `min` to `max` below the picture.
fn with_legend(picture: &Rgb8Image, min: f32, max: f32) -> Rgb8Image {
    let [left, middle, right] = [min, min / 2.0 + max / 2.0, max].map(digits::number);
    let (left_width, right_width) = (digits::width(&left), digits::width(&right));
    let width = picture.width().max(left_width + SPACE + right_width);
    let bar_top = picture.height() + GAP;
    let text_top = bar_top + BAR + GAP;
    let height = text_top + digits::HEIGHT + GAP;

    let mut pixels = vec![BACKGROUND; width * height];
    let rows = picture.pixels().chunks(picture.width());
    for (target, row) in pixels.chunks_mut(width).zip(rows) {
        target[..row.len()].copy_from_slice(row);
    }
    for (i, pixel) in pixels[bar_top * width..][..BAR * width]
        .iter_mut()
        .enumerate()
    {
        *pixel = palette::colour((i % width) as f32 / (width - 1) as f32);
    }
    let mut write = |text: &str, start: usize| {
        digits::draw(text, |x, y| {
            pixels[(text_top + y) * width + start + x] = TEXT
        });
    };
    write(&left, 0);
    write(&right, width - right_width);
    let middle_width = digits::width(&middle);
    let start = (width / 2).saturating_sub(middle_width / 2);
    let end = start + middle_width;
    if left_width + SPACE <= start && end + SPACE + right_width <= width {
        write(&middle, start);
    }
    Rgb8Image::covering(width, height, pixels)
}
