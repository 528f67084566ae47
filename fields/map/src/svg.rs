//! Drawings as SVG files.

use std::fmt::Write as _;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use crate::Error;
use crate::drawing::{Anchor, Drawing, Item, Text, Weight};

/// Fonts of text: the one that widths are measured in, and what resembles it.
const FONTS: &str =
    "'Noto Sans', 'Open Sans', 'Segoe UI', 'DejaVu Sans', Helvetica, Arial, sans-serif";

/// The text of a file.
pub(crate) fn write(drawing: &Drawing) -> Result<String, Error> {
    let (width, height) = (drawing.width, drawing.height);
    let mut file = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
         font-family=\"{FONTS}\">\n<title>{}</title>\n",
        escaped(&drawing.title)
    );
    for item in &drawing.items {
        // Writing to a string cannot fail.
        let _ = match item {
            Item::Polygon { corners, fill } => writeln!(
                file,
                "<polygon points=\"{}\" fill=\"{}\"/>",
                points(corners),
                colour(*fill)
            ),
            Item::Outline {
                corners,
                colour: line,
                width,
            } => writeln!(
                file,
                "<polygon points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\"/>",
                points(corners),
                colour(*line),
                number(*width)
            ),
            Item::Text(text) => writeln!(file, "{}", self::text(text)),
            Item::Picture { image, at, size } => writeln!(
                file,
                "<image x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" preserveAspectRatio=\"none\" \
                 href=\"data:image/png;base64,{}\"/>",
                number(at[0]),
                number(at[1]),
                number(size[0]),
                number(size[1]),
                STANDARD.encode(image.to_png()?)
            ),
        };
    }
    file.push_str("</svg>\n");
    Ok(file)
}

fn text(text: &Text) -> String {
    let anchor = match text.anchor {
        Anchor::Start => "",
        Anchor::Middle => " text-anchor=\"middle\"",
        Anchor::End => " text-anchor=\"end\"",
    };
    let weight = match text.weight {
        Weight::Regular => "",
        Weight::Bold => " font-weight=\"bold\"",
    };
    format!(
        "<text x=\"{}\" y=\"{}\" font-size=\"{}\" fill=\"{}\"{anchor}{weight}>{}</text>",
        number(text.at[0]),
        number(text.at[1]),
        number(text.size),
        colour(text.colour),
        escaped(&text.text)
    )
}

fn points(corners: &[[f32; 2]]) -> String {
    let each = corners
        .iter()
        .map(|&[x, y]| format!("{},{}", number(x), number(y)));
    each.collect::<Vec<_>>().join(" ")
}

fn colour([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// A length with two decimals at most.
fn number(x: f32) -> f32 {
    (x * 100.0).round() / 100.0
}

fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            c => escaped.push(c),
        }
    }
    escaped
}
