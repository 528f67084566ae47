//! Legends: what colours mean.

use antumbra_image::{Rgb8Image, palette};

use crate::drawing::{Anchor, Item, Weight, rectangle};
use crate::sheet::Sheet;
use crate::{Error, Steps, font};

/// Colours in the bar.
const COLOURS: usize = 256;

/// A bar of colours with numbers.
pub(crate) struct Legend<'a> {
    pub quantity: &'a str,
    pub unit: &'a str,
    pub steps: &'a Steps,
    /// Whether values lie below and above the bar.
    pub beyond: [bool; 2],
}

/// Where large values are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Direction {
    /// At the top.
    Upright,
    /// On the right.
    Across,
}

impl Legend<'_> {
    /// Draws the legend from a corner on. The bar with both tips has a length, and the name above it has so much room.
    pub fn draw(
        &self,
        sheet: &mut Sheet,
        [x, y]: [f32; 2],
        [length, room]: [f32; 2],
        direction: Direction,
    ) -> Result<(), Error> {
        let em = sheet.em;
        let name = match self.unit {
            "" => self.quantity.to_owned(),
            unit => format!("{} in {unit}", self.quantity),
        };
        let lines = font::lines(&name, em, Weight::Bold, room);
        for (index, line) in lines.iter().enumerate() {
            let base = y + em * (0.95 + 1.25 * index as f32);
            sheet.text(line, [x, base], 1.0, Weight::Bold, Anchor::Start);
        }
        let below_name = y + em * (1.25 * lines.len() as f32 + 0.35);
        let (thick, tip) = (1.3 * em, 0.9 * em);
        // A class has as much room as two lines of text.
        let length = match self.steps.classes.len() {
            0 => length,
            classes => length.min(2.0 * tip + 2.6 * em * classes as f32),
        };
        // Room for both tips, whether there are any or not.
        let (at, size) = match direction {
            Direction::Upright => ([x, below_name + tip], [thick, length - 2.0 * tip]),
            Direction::Across => ([x + tip, below_name], [length - 2.0 * tip, thick]),
        };
        let bar = Bar {
            at,
            size,
            direction,
        };
        self.draw_colours(sheet, &bar)?;
        self.draw_tips(sheet, &bar, tip);
        self.draw_marks(sheet, &bar);
        Ok(())
    }

    /// Draws the colours of the bar: all of them, or one for each class.
    fn draw_colours(&self, sheet: &mut Sheet, bar: &Bar) -> Result<(), Error> {
        let &Bar { at, size, .. } = bar;
        let classes = &self.steps.classes;
        if classes.is_empty() {
            let image = bar.direction.colours()?;
            sheet.items.push(Item::Picture { image, at, size });
        }
        for (class, (_, colour)) in classes.iter().enumerate() {
            let (from, part) = (
                class as f32 / classes.len() as f32,
                1.0 / classes.len() as f32,
            );
            let (at, size) = match bar.direction {
                Direction::Upright => (
                    [at[0], at[1] + (1.0 - from - part) * size[1]],
                    [size[0], part * size[1]],
                ),
                Direction::Across => ([at[0] + from * size[0], at[1]], [part * size[0], size[1]]),
            };
            sheet.fill(rectangle(at, size), *colour);
        }
        sheet.outline(rectangle(at, size));
        Ok(())
    }

    /// Draws the triangles that say that values lie beyond the ends.
    fn draw_tips(&self, sheet: &mut Sheet, bar: &Bar, tip: f32) {
        let [[x0, y0], [x1, y1]] = bar.corners();
        let tips = match bar.direction {
            Direction::Upright => [
                [[x0, y1], [x1, y1], [(x0 + x1) / 2.0, y1 + tip]],
                [[x0, y0], [x1, y0], [(x0 + x1) / 2.0, y0 - tip]],
            ],
            Direction::Across => [
                [[x0, y0], [x0, y1], [x0 - tip, (y0 + y1) / 2.0]],
                [[x1, y0], [x1, y1], [x1 + tip, (y0 + y1) / 2.0]],
            ],
        };
        for ((tip, is_drawn), end) in tips.into_iter().zip(self.beyond).zip([0.0, 1.0]) {
            if is_drawn {
                sheet.fill(tip.to_vec(), palette::colour(end));
                sheet.outline(tip.to_vec());
            }
        }
    }

    /// Draws marks with their numbers, or the names of classes.
    fn draw_marks(&self, sheet: &mut Sheet, bar: &Bar) {
        let em = sheet.em;
        let (size, [[x0, _], [x1, y1]]) = (bar.size, bar.corners());
        let (tick, line) = (0.3 * em, (0.08 * em).max(1.0));
        let ink = sheet.theme.text();
        let classes = &self.steps.classes;
        for (index, &mark) in self.steps.marks.iter().enumerate() {
            let (place, label) = match classes.get(index) {
                Some((name, _)) => ((index as f32 + 0.5) / classes.len() as f32, name.clone()),
                None => (self.steps.place(mark) as f32, self.steps.label(mark)),
            };
            let (mark, at, anchor) = match bar.direction {
                Direction::Upright => {
                    let y = y1 - place * size[1];
                    let mark = rectangle([x1, y - line / 2.0], [tick, line]);
                    (mark, [x1 + tick + 0.3 * em, y + 0.36 * em], Anchor::Start)
                }
                Direction::Across => {
                    let x = x0 + place * size[0];
                    let mark = rectangle([x - line / 2.0, y1], [line, tick]);
                    (mark, [x, y1 + tick + 1.05 * em], Anchor::Middle)
                }
            };
            sheet.fill(mark, ink);
            sheet.text(&label, at, 0.95, Weight::Regular, anchor);
        }
    }
}

/// The bar of colours, without tips.
struct Bar {
    at: [f32; 2],
    size: [f32; 2],
    direction: Direction,
}

impl Bar {
    /// Corners with the least and the largest coordinates.
    fn corners(&self) -> [[f32; 2]; 2] {
        let Self { at, size, .. } = self;
        [*at, [at[0] + size[0], at[1] + size[1]]]
    }
}

impl Direction {
    /// All colours, with one for each pixel.
    fn colours(self) -> Result<Rgb8Image, Error> {
        let colour = |i: usize| palette::colour(i as f32 / (COLOURS - 1) as f32);
        Ok(match self {
            Self::Upright => Rgb8Image::new(1, COLOURS, (0..COLOURS).rev().map(colour).collect())?,
            Self::Across => Rgb8Image::new(COLOURS, 1, (0..COLOURS).map(colour).collect())?,
        })
    }
}
