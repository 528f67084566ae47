//! What is shown, as files.

use std::fmt::Display;

use antumbra_image::{Rgb8Image, heatmap};
use antumbra_map::{Panel, PanelLegend, Steps, Theme, panels};
use antumbra_render::Seen;

use crate::state::{Frame, Mode};
use crate::sun::SunDay;

/// An error in words for the viewer.
fn words(error: impl Display) -> String {
    error.to_string()
}

/// The bytes of a picture file. Errors are words for the viewer.
pub fn encoded(frame: &Frame, extension: &str, exposure: f32) -> Result<Vec<u8>, String> {
    let folder = tempfile::tempdir().map_err(words)?;
    let path = folder.path().join("picture").with_extension(extension);
    if frame.mode.is_map() {
        if extension != "png" {
            return Err("a map is saved as PNG".into());
        }
        map(frame)?.write(&path).map_err(words)?;
    } else {
        let mut image = frame.tiles.image().map_err(words)?;
        if exposure.is_finite() && exposure != 0.0 {
            let factor = exposure.clamp(-32.0, 32.0).exp2();
            for value in image.pixels_mut().iter_mut().flatten() {
                *value *= factor;
            }
        }
        image.write(&path).map_err(words)?;
    }
    std::fs::read(&path).map_err(words)
}

/// A picture of the sun of a day with its words, and the legend of hours, as PNG.
pub fn captioned(frame: &Frame, day: &SunDay, hour: f64) -> Result<Vec<u8>, String> {
    let image = frame.tiles.image().map_err(words)?;
    let minutes = (60.0 * hour).round() as u32;
    let title = match frame.mode {
        Mode::Hours => "Hours of direct sun".to_owned(),
        _ => format!("Shadows at {:02}:{:02}", minutes / 60, minutes % 60),
    };
    let steps = Steps::between(0.0, f64::from(day.longest()), false);
    let legend = PanelLegend {
        quantity: "Direct sun",
        unit: "h",
        steps: &steps,
        // No hours are beyond the longest ones.
        values: &[],
    };
    let panel = Panel {
        image: &image.to_srgb8(),
        title: &title,
        subtitle: &day.caption,
        legend: (frame.mode == Mode::Hours).then_some(legend),
    };
    let drawing = panels(&[panel], Theme::Light).map_err(words)?;
    let pixels = drawing.pixels().map_err(words)?;
    pixels.to_png().map_err(words)
}

/// A map of tests with its legend.
fn map(frame: &Frame) -> Result<Rgb8Image, String> {
    let window = frame.tiles.window();
    let mut field = vec![0.0; window.area()];
    for tile in frame.tiles.changed(&mut Seen::default()) {
        let tests = tile.tests.as_deref().unwrap_or_default();
        for (row, tests) in tests.chunks_exact(tile.window.width()).enumerate() {
            let down = (tile.window.y0 - window.y0) as usize + row;
            let start = down * window.width() + (tile.window.x0 - window.x0) as usize;
            field[start..start + tests.len()].copy_from_slice(tests);
        }
    }
    let options = heatmap::Options {
        range: heatmap::Range::Percentile(99.5),
        ..heatmap::Options::default()
    };
    heatmap::render(&field, window.width(), window.height(), &options).map_err(words)
}
