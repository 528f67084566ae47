//! Heat maps of the tests per shadow ray, in the same colours for all renderings of a scene, and what has changed
//! between two of them.

use std::path::Path;

use antumbra_image::heatmap::{self, Range};
use antumbra_image::{Image, Rgb8Image};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::Serialize;

use crate::Error;
use crate::study::{Combination, Files, Plan, Subject, exr, png};

/// Percentile of the pixels above which all values share the hottest colour.
const HOTTEST: f64 = 99.5;
/// Steps of a scale of colours.
const STEPS: usize = 256;

/// The maps of all renderings of a scene by one width.
pub struct Maps {
    fields: Vec<(Combination, Vec<f32>)>,
    size: (usize, usize),
    options: heatmap::Options,
    picture: Image,
}

/// A picture as the page has it.
#[derive(Serialize)]
pub struct Embedded {
    /// Picture as a `data:` address.
    pub address: String,
    pub width: usize,
    pub height: usize,
}

/// Two maps and their difference for the page.
#[derive(Serialize)]
pub struct Comparison {
    pub picture: Embedded,
    pub before: Embedded,
    pub after: Embedded,
    pub difference: Embedded,
    pub scale: Embedded,
    pub difference_scale: Embedded,
    /// Tests that have the hottest colour.
    pub hottest: String,
    /// The difference that has the strongest colour.
    pub strongest: String,
}

impl Maps {
    /// Reads what the renderings have left in the folder, and draws a heat map of each there. `None` if there is
    /// nothing.
    pub fn draw(
        plan: &Plan,
        subject: &Subject,
        combinations: &[Combination],
        folder: &Path,
    ) -> Result<Option<Self>, Error> {
        let mut fields = Vec::new();
        let mut picture = None;
        let mut size = (0, 0);
        for combination in combinations {
            let files = Files::new(plan, subject, combination);
            let map = Image::read(exr(folder, &files.tests))?;
            size = (map.window().width(), map.window().height());
            let field: Vec<f32> = map.pixels().iter().map(|pixel| pixel[0]).collect();
            fields.push((*combination, field));
            if picture.is_none() {
                picture = Some(Image::read(exr(folder, &files.picture))?);
            }
        }
        let Some(picture) = picture else {
            return Ok(None);
        };
        let all: Vec<&[f32]> = fields.iter().map(|(_, field)| field.as_slice()).collect();
        let (min, max) = heatmap::shared_range(&all, Range::Percentile(HOTTEST))?;
        let maps = Self {
            fields,
            size,
            options: heatmap::Options {
                range: Range::Fixed { min, max },
                legend: true,
            },
            picture,
        };
        for (combination, field) in &maps.fields {
            let files = Files::new(plan, subject, combination);
            let map = heatmap::render(field, size.0, size.1, &maps.options)?;
            map.write(png(folder, &files.tests))?;
        }
        Ok(Some(maps))
    }

    fn field(&self, combination: &Combination) -> Option<&[f32]> {
        let mut fields = self.fields.iter();
        let found = fields.find(|(other, _)| other == combination);
        found.map(|(_, field)| field.as_slice())
    }

    /// Sets two of the maps beside each other; `None` unless both were rendered. Also writes their difference to
    /// the folder, under this name.
    pub fn compare(
        &self,
        [before, after]: [&Combination; 2],
        folder: &Path,
        name: &str,
    ) -> Result<Option<Comparison>, Error> {
        let (Some(before), Some(after)) = (self.field(before), self.field(after)) else {
            return Ok(None);
        };
        let (width, height) = self.size;
        let options = heatmap::Options {
            legend: false,
            ..self.options
        };
        let map = |field: &[f32]| embed(&heatmap::render(field, width, height, &options)?);
        let differences: Vec<f32> = before.iter().zip(after).map(|(b, a)| a - b).collect();
        let sizes: Vec<f32> = differences.iter().map(|value| value.abs()).collect();
        let (_, strongest) = heatmap::shared_range(&[&sizes], Range::Percentile(HOTTEST))?;
        let colours = differences.iter().map(|value| diverging(value / strongest));
        let difference = Rgb8Image::new(width, height, colours.collect())?;
        difference.write(png(folder, name))?;
        let grey = differences.iter().map(|&value| [value; 3]).collect();
        let window = self.picture.window();
        Image::new(self.picture.width(), self.picture.height(), window, grey)?
            .write(exr(folder, name))?;
        let (min, max) = match options.range {
            Range::Fixed { min, max } => (min, max),
            _ => (0.0, 1.0),
        };
        let steps = |step: usize| step as f32 / (STEPS - 1) as f32;
        let ramp: Vec<f32> = (0..STEPS)
            .map(|step| min + (max - min) * steps(step))
            .collect();
        let ends = (0..STEPS).map(|step| diverging(2.0 * steps(step) - 1.0));
        Ok(Some(Comparison {
            picture: embed(&self.picture.to_srgb8())?,
            before: map(before)?,
            after: map(after)?,
            difference: embed(&difference)?,
            scale: embed(&heatmap::render(&ramp, STEPS, 1, &options)?)?,
            difference_scale: embed(&Rgb8Image::new(STEPS, 1, ends.collect())?)?,
            hottest: format!("{max:.0}"),
            strongest: format!("{strongest:.0}"),
        }))
    }
}

fn embed(picture: &Rgb8Image) -> Result<Embedded, Error> {
    Ok(Embedded {
        address: format!(
            "data:image/png;base64,{}",
            STANDARD.encode(picture.to_png()?)
        ),
        width: picture.width(),
        height: picture.height(),
    })
}

/// Blue for -1, white for 0, orange for 1; what is beyond has the colour of the end, and what is no number is grey.
fn diverging(value: f32) -> [u8; 3] {
    const LESS: [f32; 3] = [20.0, 92.0, 175.0];
    const MORE: [f32; 3] = [200.0, 80.0, 10.0];
    if value.is_nan() {
        return [128; 3];
    }
    let end = if value < 0.0 { LESS } else { MORE };
    let strength = value.abs().min(1.0);
    end.map(|channel| (250.0 + (channel - 250.0) * strength).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn less_is_blue_and_more_is_orange() {
        assert_eq!(diverging(0.0), [250; 3]);
        assert_eq!(diverging(-1.0), [20, 92, 175]);
        assert_eq!(diverging(9.0), [200, 80, 10]);
        assert_eq!(diverging(f32::NAN), [128; 3]);
        let [r, g, b] = diverging(-0.5);
        assert!(b > g && g > r);
    }
}
