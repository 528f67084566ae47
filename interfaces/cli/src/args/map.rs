//! Flags of maps.

use antumbra_image::heatmap;
use antumbra_map::{Map, Theme};
use clap::Args;

use super::heading;
use super::values::Resolution;
use crate::exit::Failure;

/// Flags of maps.
#[derive(Debug, Args)]
pub struct MapArgs {
    /// Title of a map [default: value and scene]
    #[arg(long, value_name = "TEXT", value_parser = title, help_heading = heading::OUTPUT)]
    pub title: Option<String>,
    /// Size of a map [default: by its shape, some 1600]
    ///
    /// In pixels, of which an .svg or .pdf has 96 to the inch: 1123x794 is A4.
    #[arg(long, value_name = "WxH", help_heading = heading::OUTPUT)]
    pub resolution: Option<Resolution>,
    /// Ends of the colours [default: round, by the values]
    ///
    /// Maps with the same ends can be compared. Triangles at the legend say that values lie beyond them. Also the ends of the
    /// colours of a .ply.
    #[arg(long, num_args = 2, value_names = ["MIN", "MAX"], allow_negative_numbers = true, help_heading = heading::OUTPUT)]
    pub range: Option<Vec<f64>>,
    /// Light text on a dark ground, for slides
    #[arg(long, help_heading = heading::OUTPUT)]
    pub dark: bool,
}

impl MapArgs {
    /// Checks what no single value shows.
    ///
    /// # Errors
    /// The ends of the colours are no range, or the size is none for a map.
    pub fn check(&self) -> Result<(), Failure> {
        if let Some(size) = self.resolution {
            let checked = Map::check_size(size.0);
            checked.map_err(|error| Failure::Usage(format!("--resolution: {error}")))?;
        }
        match self.ends() {
            Some([low, high]) if !(low < high && low.is_finite() && high.is_finite()) => {
                let reason = format!("--range {low} {high}: the smaller number comes first");
                Err(Failure::Usage(reason))
            }
            _ => Ok(()),
        }
    }

    /// Colours of paper and text.
    pub fn theme(&self) -> Theme {
        match self.dark {
            true => Theme::Dark,
            false => Theme::Light,
        }
    }

    /// Ends of the colours, if they are chosen.
    pub fn ends(&self) -> Option<[f64; 2]> {
        let ends = self.range.as_deref()?;
        <[f64; 2]>::try_from(ends).ok()
    }

    /// Ends of the colours of what has no legend.
    pub fn colours(&self) -> heatmap::Range {
        let ends = self.ends().map(|ends| ends.map(|x| x as f32));
        ends.map_or_else(Default::default, |[min, max]| heatmap::Range::Fixed {
            min,
            max,
        })
    }
}

/// Parses a title: text that the font of maps has.
fn title(text: &str) -> Result<String, String> {
    antumbra_map::check_text(text).map_err(|error| error.to_string())?;
    Ok(text.to_owned())
}
