//! Pictures beside each other, each with its title and perhaps a legend.

use antumbra_image::Rgb8Image;

use crate::drawing::{Anchor, Drawing, Item, Weight};
use crate::legend::{Direction, Legend};
use crate::sheet::Sheet;
use crate::{Error, Steps, Theme, font};

/// A picture with its words.
#[derive(Clone, Copy, Debug)]
pub struct Panel<'a> {
    /// The picture, drawn pixel by pixel.
    pub image: &'a Rgb8Image,
    /// Title above it.
    pub title: &'a str,
    /// Small line below the title, or empty.
    pub subtitle: &'a str,
    /// What its colours mean, if they come from the palette.
    pub legend: Option<PanelLegend<'a>>,
}

/// The legend of a [`Panel`].
#[derive(Clone, Copy, Debug)]
pub struct PanelLegend<'a> {
    /// Name of the values.
    pub quantity: &'a str,
    /// Unit of the values, or empty.
    pub unit: &'a str,
    /// Numbers of the legend.
    pub steps: &'a Steps,
    /// Values of the picture, which say whether some lie beyond the legend.
    pub values: &'a [f32],
}

/// Lengths in em: edge of the sheet, gap between pictures, title with its small line, and a legend below.
const EDGE: f32 = 1.2;
const GAP: f32 = 1.2;
const HEAD: f32 = 1.9;
const SUBTITLE: f32 = 1.3;
const BELOW: f32 = 5.2;

/// Draws pictures beside each other, their upper edges in a line.
///
/// # Errors
/// [`Error::Size`] if there is no picture, or the sheet would have more than 100 million pixels.
///
/// # Example
///
/// ```
/// use antumbra_image::Rgb8Image;
/// use antumbra_map::{Panel, Theme, panels};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let image = Rgb8Image::new(200, 100, vec![[128; 3]; 20_000])?;
/// let panel = Panel { image: &image, title: "Before", subtitle: "", legend: None };
/// let both = panels(&[panel, Panel { title: "After", ..panel }], Theme::Light)?;
/// assert!(both.size()[0] > 400 && both.size()[1] > 100);
/// # Ok(())
/// # }
/// ```
pub fn panels(panels: &[Panel<'_>], theme: Theme) -> Result<Drawing, Error> {
    let tallest = panels.iter().map(|panel| panel.image.height()).max();
    let tallest = tallest.unwrap_or_default() as f32;
    let em = (tallest / 30.0).clamp(11.0, 40.0);
    let has = |any: &dyn Fn(&Panel<'_>) -> bool| panels.iter().any(any);
    let head = em
        * (HEAD
            + if has(&|panel| !panel.subtitle.is_empty()) {
                SUBTITLE
            } else {
                0.0
            });
    let below = if has(&|panel| panel.legend.is_some()) {
        BELOW * em
    } else {
        0.0
    };
    let widths = panels.iter().map(|panel| panel.image.width() as f32);
    let gaps = GAP * em * panels.len().saturating_sub(1) as f32;
    // Whole pixels, so that pictures stay as they are.
    let edge = (EDGE * em).round();
    let width = (widths.sum::<f32>() + gaps + 2.0 * edge).ceil() as u32;
    let height = (tallest + head + below + 2.0 * edge).ceil() as u32;
    let most = crate::map::MOST;
    if panels.is_empty() || u64::from(width) * u64::from(height) > most {
        return Err(Error::Size {
            width,
            height,
            least: 1,
            most,
        });
    }
    let mut sheet = Sheet::new([width, height], em, theme);
    let mut left = edge;
    let top = (edge + head).round();
    for panel in panels {
        let size = [panel.image.width() as f32, panel.image.height() as f32];
        let title = font::cut(panel.title, 1.15 * em, Weight::Bold, size[0]);
        let base = edge + 1.05 * em;
        sheet.text(&title, [left, base], 1.15, Weight::Bold, Anchor::Start);
        let subtitle = font::cut(panel.subtitle, 0.85 * em, Weight::Regular, size[0]);
        let base = base + SUBTITLE * em;
        sheet.text(
            &subtitle,
            [left, base],
            0.85,
            Weight::Regular,
            Anchor::Start,
        );
        sheet.items.push(Item::Picture {
            image: panel.image.clone(),
            at: [left, top],
            size,
        });
        if let Some(legend) = &panel.legend {
            let drawn = Legend {
                quantity: legend.quantity,
                unit: legend.unit,
                steps: legend.steps,
                beyond: legend.steps.beyond(legend.values),
                symbol: None,
            };
            let at = [left, top + size[1] + 0.7 * em];
            let length = size[0].min(28.0 * em);
            drawn.draw(&mut sheet, at, [length, size[0]], Direction::Across)?;
        }
        left = (left + size[0] + GAP * em).round();
    }
    let titles: Vec<&str> = panels.iter().map(|panel| panel.title).collect();
    Ok(sheet.drawing([width, height], &titles.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_keep_their_pixels() {
        let colours = (0..60_000).map(|i| [(i % 251) as u8, (i % 241) as u8, (i % 239) as u8]);
        let image = Rgb8Image::new(300, 200, colours.collect()).expect("a picture");
        let values = [0.0, 2.0];
        let steps = Steps::between(0.0, 1.0, false);
        let panel = Panel {
            image: &image,
            title: "One",
            subtitle: "of two",
            legend: Some(PanelLegend {
                quantity: "Value",
                unit: "h",
                steps: &steps,
                values: &values,
            }),
        };
        let plain = Panel {
            legend: None,
            ..panel
        };
        let drawing = panels(&[plain, panel], Theme::Dark).expect("a drawing");
        let sheet = drawing.pixels().expect("pixels");
        let em = 11.0;
        let top = ((EDGE * em).round() + em * (HEAD + SUBTITLE)).round() as usize;
        for left in [
            (EDGE * em).round(),
            ((EDGE * em).round() + 300.0 + GAP * em).round(),
        ] {
            for (row, pixels) in image.pixels().chunks_exact(300).enumerate() {
                let start = (top + row) * sheet.width() + left as usize;
                assert_eq!(
                    &sheet.pixels()[start..start + 300],
                    pixels,
                    "row {row} at {left}"
                );
            }
        }
        // The triangle of values above the legend.
        assert!(drawing.svg().expect("text").contains("fill=\"#fde725\""));
        assert!(panels(&[], Theme::Light).is_err());
    }
}
