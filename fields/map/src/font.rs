//! Noto Sans: widths and outlines of text.

use std::sync::LazyLock;

use tiny_skia::PathBuilder;
use ttf_parser::{Face, GlyphId, OutlineBuilder};

use crate::Error;
use crate::drawing::Weight;

/// Shown in place of characters that the font lacks.
const MISSING: char = '\u{fffd}';

/// Bytes of the font file of a weight.
pub(crate) fn bytes(weight: Weight) -> &'static [u8] {
    match weight {
        Weight::Regular => notosans::REGULAR_TTF,
        Weight::Bold => notosans::BOLD_TTF,
    }
}

/// The font of a weight.
pub(crate) fn face(weight: Weight) -> &'static Face<'static> {
    static FACES: LazyLock<[Face<'static>; 2]> = LazyLock::new(|| {
        [Weight::Regular, Weight::Bold].map(|weight| {
            Face::parse(bytes(weight), 0).expect("the files that the crate contains are fonts")
        })
    });
    match weight {
        Weight::Regular => &FACES[0],
        Weight::Bold => &FACES[1],
    }
}

/// Whether text can be shown.
///
/// # Errors
/// [`Error::Character`] with the first character that the font lacks.
pub fn check(text: &str) -> Result<(), Error> {
    let missing = |c: &char| face(Weight::Regular).glyph_index(*c).is_none();
    text.chars()
        .find(missing)
        .map_or(Ok(()), |c| Err(Error::Character(c)))
}

/// Text with a sign in place of each character that the font lacks.
pub(crate) fn shown(text: &str) -> String {
    let has = |c: char| !c.is_control() && face(Weight::Regular).glyph_index(c).is_some();
    text.chars()
        .map(|c| if has(c) { c } else { MISSING })
        .collect()
}

/// Glyph of a character; number 0, a box, where the font lacks it.
pub(crate) fn glyph(face: &Face<'_>, c: char) -> GlyphId {
    face.glyph_index(c).unwrap_or_default()
}

/// Width of text in the unit of `size`, which is the height of an em.
pub(crate) fn width(text: &str, size: f32, weight: Weight) -> f32 {
    let face = face(weight);
    let advance = |c| f32::from(face.glyph_hor_advance(glyph(face, c)).unwrap_or(0));
    text.chars().map(advance).sum::<f32>() * size / f32::from(face.units_per_em())
}

/// Lines of text that are no wider than `room`, broken at spaces. A longer word has a line of its own.
pub(crate) fn lines(text: &str, size: f32, weight: Weight, room: f32) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if width(&format!("{line} {word}"), size, weight) <= room => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// Text that is no wider than `room`: its end is replaced by an ellipsis if needed.
pub(crate) fn cut(text: &str, size: f32, weight: Weight, room: f32) -> String {
    if width(text, size, weight) <= room {
        return text.to_owned();
    }
    let mut kept = text.to_owned();
    while kept.pop().is_some() {
        let shorter = format!("{}…", kept.trim_end());
        if width(&shorter, size, weight) <= room {
            return shorter;
        }
    }
    String::new()
}

/// Adds the outlines of text that starts at `at`, on the base line, to a path.
pub(crate) fn outline(text: &str, at: [f32; 2], size: f32, weight: Weight, path: &mut PathBuilder) {
    let face = face(weight);
    let scale = size / f32::from(face.units_per_em());
    let mut pen = Pen { path, at, scale };
    for c in text.chars() {
        let glyph = glyph(face, c);
        face.outline_glyph(glyph, &mut pen);
        pen.at[0] += scale * f32::from(face.glyph_hor_advance(glyph).unwrap_or(0));
    }
}

/// Draws glyphs, whose y axis points up.
struct Pen<'a> {
    path: &'a mut PathBuilder,
    at: [f32; 2],
    scale: f32,
}

impl Pen<'_> {
    fn place(&self, x: f32, y: f32) -> [f32; 2] {
        [self.at[0] + self.scale * x, self.at[1] - self.scale * y]
    }
}

impl OutlineBuilder for Pen<'_> {
    fn move_to(&mut self, x: f32, y: f32) {
        let [x, y] = self.place(x, y);
        self.path.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let [x, y] = self.place(x, y);
        self.path.line_to(x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let ([x1, y1], [x, y]) = (self.place(x1, y1), self.place(x, y));
        self.path.quad_to(x1, y1, x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let [first, second, end] = [(x1, y1), (x2, y2), (x, y)].map(|(x, y)| self.place(x, y));
        self.path
            .cubic_to(first[0], first[1], second[0], second[1], end[0], end[1]);
    }

    fn close(&mut self) {
        self.path.close();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bold_is_wider_and_widths_add_up() {
        let regular = width("Hours of sun", 20.0, Weight::Regular);
        assert!(width("Hours of sun", 20.0, Weight::Bold) > regular);
        let parts = width("Hours", 20.0, Weight::Regular) + width(" of sun", 20.0, Weight::Regular);
        assert!((regular - parts).abs() < 1e-3, "{regular} and {parts}");
        assert_eq!(width("", 20.0, Weight::Bold), 0.0);
    }

    #[test]
    fn lines_and_cuts_fit() {
        let text = "Direct and diffuse irradiation of the year";
        let found = lines(text, 10.0, Weight::Regular, 90.0);
        assert_eq!(found.join(" "), text);
        assert!(found.len() > 1);
        assert!(
            found
                .iter()
                .all(|line| width(line, 10.0, Weight::Regular) <= 90.0)
        );
        let short = cut(text, 10.0, Weight::Regular, 90.0);
        assert!(short.ends_with('…') && width(&short, 10.0, Weight::Regular) <= 90.0);
        assert_eq!(cut("sun", 10.0, Weight::Regular, 90.0), "sun");
    }

    #[test]
    fn missing_characters_are_named() {
        assert!(check("Größe in kWh/m², 48.2° N · Αθήνα, Москва").is_ok());
        assert!(matches!(check("a 日"), Err(Error::Character('日'))));
        assert_eq!(shown("a\n日b"), "a\u{fffd}\u{fffd}b");
    }
}
