//! Drawings as pixels.

use antumbra_image::Rgb8Image;
use tiny_skia::{
    Color, FillRule, FilterQuality, IntSize, Paint, Path, PathBuilder, Pixmap, PixmapPaint, Stroke,
    Transform,
};

use crate::drawing::{Colour, Drawing, Item, Text};
use crate::{Error, font};

/// Draws everything on white.
pub(crate) fn draw(drawing: &Drawing) -> Result<Rgb8Image, Error> {
    let (width, height) = (drawing.width, drawing.height);
    let mut canvas = Pixmap::new(width, height).ok_or(Error::Size {
        width,
        height,
        least: 1,
        most: u64::from(u32::MAX),
    })?;
    canvas.fill(Color::WHITE);
    for item in &drawing.items {
        match item {
            Item::Polygon { corners, fill } => {
                if let Some(path) = polygon(corners) {
                    fill_path(&mut canvas, &path, *fill);
                }
            }
            Item::Outline {
                corners,
                colour,
                width,
            } => {
                if let Some(path) = polygon(corners) {
                    let stroke = Stroke {
                        width: *width,
                        ..Stroke::default()
                    };
                    let identity = Transform::identity();
                    canvas.stroke_path(&path, &paint(*colour), &stroke, identity, None);
                }
            }
            Item::Text(text) => {
                if let Some(path) = outline(text) {
                    fill_path(&mut canvas, &path, text.colour);
                }
            }
            Item::Picture { image, at, size } => picture(&mut canvas, image, *at, *size),
        }
    }
    let pixels = canvas.data().chunks_exact(4).map(|p| [p[0], p[1], p[2]]);
    Ok(Rgb8Image::new(
        width as usize,
        height as usize,
        pixels.collect(),
    )?)
}

fn paint(colour: Colour) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color_rgba8(colour[0], colour[1], colour[2], 255);
    paint
}

fn fill_path(canvas: &mut Pixmap, path: &Path, colour: Colour) {
    let paint = paint(colour);
    canvas.fill_path(path, &paint, FillRule::Winding, Transform::identity(), None);
}

fn polygon(corners: &[[f32; 2]]) -> Option<Path> {
    let mut path = PathBuilder::new();
    let (first, rest) = corners.split_first()?;
    path.move_to(first[0], first[1]);
    for corner in rest {
        path.line_to(corner[0], corner[1]);
    }
    path.close();
    path.finish()
}

fn outline(text: &Text) -> Option<Path> {
    let before = text.anchor.share() * font::width(&text.text, text.size, text.weight);
    let start = [text.at[0] - before, text.at[1]];
    let mut path = PathBuilder::new();
    font::outline(&text.text, start, text.size, text.weight, &mut path);
    path.finish()
}

/// Draws a picture over a rectangle. Two of its pixels to a pixel of the canvas give their mean.
fn picture(canvas: &mut Pixmap, image: &Rgb8Image, at: [f32; 2], size: [f32; 2]) {
    let (columns, rows) = (image.width(), image.height());
    let pixels = image.pixels().iter();
    let rgba: Vec<u8> = pixels.flat_map(|&[r, g, b]| [r, g, b, 255]).collect();
    let whole = IntSize::from_wh(columns as u32, rows as u32);
    let Some(source) = whole.and_then(|whole| Pixmap::from_vec(rgba, whole)) else {
        return;
    };
    let scale = [size[0] / columns as f32, size[1] / rows as f32];
    let transform = Transform::from_row(scale[0], 0.0, 0.0, scale[1], at[0], at[1]);
    let paint = PixmapPaint {
        quality: FilterQuality::Bilinear,
        ..PixmapPaint::default()
    };
    canvas.draw_pixmap(0, 0, source.as_ref(), &paint, transform, None);
}
