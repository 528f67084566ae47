//! Numbers as pixels: a font of the characters of numbers, each 3 pixels wide and 5 high.

/// Distance between characters in columns, before scaling.
const ADVANCE: usize = 4;

/// Height of a character in rows, before scaling.
const ROWS: usize = 5;

/// Side of the square of pixels that a pixel of the font becomes.
const SCALE: usize = 2;

/// Height of a text in pixels.
pub(crate) const HEIGHT: usize = ROWS * SCALE;

/// Width of a text in pixels, without a gap after the last character.
pub(crate) fn width(text: &str) -> usize {
    (text.chars().count() * ADVANCE).saturating_sub(1) * SCALE
}

/// Calls `put(x, y)` for every set pixel, relative to the top left of the text. Unknown characters leave a gap.
pub(crate) fn draw(text: &str, mut put: impl FnMut(usize, usize)) {
    for (index, character) in text.chars().enumerate() {
        for (row, bits) in glyph(character).into_iter().enumerate() {
            for column in (0..3).filter(|column| bits >> (2 - column) & 1 == 1) {
                let (x, y) = (index * ADVANCE + column, row);
                for i in 0..SCALE * SCALE {
                    put(x * SCALE + i % SCALE, y * SCALE + i / SCALE);
                }
            }
        }
    }
}

/// Rows of a character from the top. The highest of the three bits is the left column.
#[rustfmt::skip]
fn glyph(character: char) -> [u8; ROWS] {
    match character {
        '0' => [0b111, 0b101, 0b101, 0b101, 0b111],
        '1' => [0b010, 0b110, 0b010, 0b010, 0b111],
        '2' => [0b111, 0b001, 0b111, 0b100, 0b111],
        '3' => [0b111, 0b001, 0b011, 0b001, 0b111],
        '4' => [0b101, 0b101, 0b111, 0b001, 0b001],
        '5' => [0b111, 0b100, 0b111, 0b001, 0b111],
        '6' => [0b111, 0b100, 0b111, 0b101, 0b111],
        '7' => [0b111, 0b001, 0b010, 0b010, 0b010],
        '8' => [0b111, 0b101, 0b111, 0b101, 0b111],
        '9' => [0b111, 0b101, 0b111, 0b001, 0b111],
        '.' => [0b000, 0b000, 0b000, 0b000, 0b010],
        '-' => [0b000, 0b000, 0b111, 0b000, 0b000],
        'e' => [0b000, 0b111, 0b111, 0b100, 0b111],
        _ => [0; ROWS],
    }
}

/// Formats a number with about four significant digits: plain from 0.001 to 99999, with an exponent otherwise.
pub(crate) fn number(value: f32) -> String {
    let magnitude = value.abs();
    if magnitude == 0.0 {
        return "0".into();
    }
    if !(1e-3..99_999.5).contains(&magnitude) {
        return format!("{value:.2e}");
    }
    let decimals = (3.0 - magnitude.log10().floor()).max(0.0) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').into()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers() {
        let known = [
            (0.0, "0"),
            (-0.0, "0"),
            (1.0, "1"),
            (0.5, "0.5"),
            (-12.25, "-12.25"),
            (9.99996, "10"),
            (100.0, "100"),
            (1234.56, "1235"),
            (99_999.0, "99999"),
            (100_000.0, "1.00e5"),
            (0.001, "0.001"),
            (0.000_123, "1.23e-4"),
            (f32::MAX, "3.40e38"),
            (-1e-45, "-1.40e-45"),
        ];
        for (value, text) in known {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn every_character_of_a_number_has_its_own_glyph() {
        let glyphs: Vec<_> = "0123456789.-e".chars().map(glyph).collect();
        for (i, a) in glyphs.iter().enumerate() {
            assert_ne!(*a, [0; ROWS]);
            assert!(!glyphs[..i].contains(a));
        }
    }

    #[test]
    fn drawing_stays_inside_its_box() {
        let text = "-3.40e38";
        let mut right = 0;
        draw(text, |x, y| {
            assert!(x < width(text) && y < HEIGHT);
            right = right.max(x);
        });
        assert_eq!(right, width(text) - 1);
        assert_eq!(width(""), 0);
    }
}
