//! A sheet of paper: what all drawings are made on.

use crate::drawing::{Anchor, Colour, Drawing, Item, Text, Weight, rectangle};
use crate::{Theme, font};

/// Radii in em and colours of the discs of a symbol. Viridis has no red.
const SYMBOL: [(f32, Colour); 3] = [
    (0.48, [28, 30, 34]),
    (0.43, [255, 255, 255]),
    (0.3, [206, 17, 38]),
];

/// A drawing that is being made.
pub(crate) struct Sheet {
    /// Height of an em of ordinary text, in pixels.
    pub em: f32,
    pub theme: Theme,
    pub items: Vec<Item>,
}

impl Sheet {
    /// An empty sheet of this size.
    pub fn new([width, height]: [u32; 2], em: f32, theme: Theme) -> Self {
        let mut sheet = Self {
            em,
            theme,
            items: Vec::new(),
        };
        let paper = rectangle([0.0; 2], [width as f32, height as f32]);
        sheet.fill(paper, theme.paper());
        sheet
    }

    /// The finished drawing.
    pub fn drawing(self, [width, height]: [u32; 2], title: &str) -> Drawing {
        Drawing {
            width,
            height,
            title: font::shown(title),
            items: self.items,
        }
    }

    pub fn fill(&mut self, corners: Vec<[f32; 2]>, fill: Colour) {
        self.items.push(Item::Polygon { corners, fill });
    }

    /// Adds a thin outline.
    pub fn outline(&mut self, corners: Vec<[f32; 2]>) {
        self.items.push(Item::Outline {
            corners,
            colour: self.theme.soft(),
            width: (0.06 * self.em).max(0.75),
        });
    }

    /// Adds a line of text, whose size is in em. Small text is soft.
    pub fn text(&mut self, text: &str, at: [f32; 2], size: f32, weight: Weight, anchor: Anchor) {
        let is_soft = size < 0.9;
        let theme = self.theme;
        self.items.push(Item::Text(Text {
            text: font::shown(text),
            at,
            size: size * self.em,
            weight,
            anchor,
            colour: if is_soft { theme.soft() } else { theme.text() },
        }));
    }

    /// Adds a symbol of a place: a disc with a light and a dark rim, one of which shows on any colour.
    pub fn symbol(&mut self, [x, y]: [f32; 2]) {
        for (radius, fill) in SYMBOL {
            let corner = |i: u8| {
                let (sin, cos) = (f32::from(i) / 32.0 * std::f32::consts::TAU).sin_cos();
                [x + radius * self.em * cos, y + radius * self.em * sin]
            };
            self.fill((0..32).map(corner).collect(), fill);
        }
    }
}
