//! Legends: what colours mean.

use antumbra_image::{Rgb8Image, palette};

use crate::drawing::{Anchor, Item, Weight, rectangle};
use crate::sheet::Sheet;
use crate::steps::Class;
use crate::{Error, Steps, font};

/// Colours in the bar.
const COLOURS: usize = 256;

/// Height in em of a line below or beside the bar.
const LINE: f32 = 1.6;

/// A bar of colours with numbers.
pub(crate) struct Legend<'a> {
    pub quantity: &'a str,
    pub unit: &'a str,
    pub steps: &'a Steps,
    /// Whether values lie below and above the bar.
    pub beyond: [bool; 2],
    /// Name of the symbols on the map, if there are any.
    pub symbol: Option<&'a str>,
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
        // A class has as much room as two lines of text, or as the longest one beside others.
        let classes = self.steps.classes.iter();
        let widths = classes.map(|class| font::width(&class.name, 0.95 * em, Weight::Regular));
        let part = match direction {
            Direction::Upright => 2.6 * em,
            Direction::Across => widths.fold(2.6 * em, |most, width| most.max(width + 0.8 * em)),
        };
        let lines = usize::from(self.steps.zero.is_some()) + usize::from(self.symbol.is_some());
        let length = match (self.steps.classes.len(), direction) {
            (0, Direction::Across) => length,
            (0, Direction::Upright) => {
                (length - LINE * em * lines as f32).max(2.0 * tip + 2.0 * em)
            }
            (classes, _) => length.min(2.0 * tip + part * classes as f32),
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
        let lines = match direction {
            Direction::Upright => [x, below_name + length + 0.4 * em],
            Direction::Across => [x + length + 1.6 * em, below_name - 0.2 * em],
        };
        self.draw_lines(sheet, lines);
        Ok(())
    }

    /// Draws what is not on the bar: the class of the value 0, and the symbol.
    fn draw_lines(&self, sheet: &mut Sheet, [x, mut y]: [f32; 2]) {
        let em = sheet.em;
        if let Some(Class {
            name,
            colour,
            share,
        }) = &self.steps.zero
        {
            let swatch = rectangle([x, y + 0.3 * em], [1.3 * em, 0.9 * em]);
            sheet.fill(swatch.clone(), *colour);
            sheet.outline(swatch);
            let share = share.map_or_else(String::new, |share| format!(", {}", percent(share)));
            let at = [x + 1.9 * em, y + 1.1 * em];
            let label = format!("{name}{share}");
            sheet.text(&label, at, 0.95, Weight::Regular, Anchor::Start);
            y += LINE * em;
        }
        if let Some(name) = self.symbol {
            sheet.symbol([x + 0.65 * em, y + 0.75 * em]);
            let at = [x + 1.9 * em, y + 1.1 * em];
            sheet.text(name, at, 0.95, Weight::Regular, Anchor::Start);
        }
    }

    /// Draws the colours of the bar: all of them, or one for each class.
    fn draw_colours(&self, sheet: &mut Sheet, bar: &Bar) -> Result<(), Error> {
        let &Bar { at, size, .. } = bar;
        let classes = &self.steps.classes;
        if classes.is_empty() {
            let image = bar.direction.colours()?;
            sheet.items.push(Item::Picture { image, at, size });
        }
        for (class, Class { colour, .. }) in classes.iter().enumerate() {
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
                Some(class) => {
                    let place = (index as f32 + 0.5) / classes.len() as f32;
                    (place, class.name.clone())
                }
                None => (self.steps.place(mark) as f32, self.steps.label(mark)),
            };
            // A share is below its name, if there is room.
            let room = size[0].max(size[1]) / classes.len().max(1) as f32;
            let share = classes.get(index).and_then(|class| class.share);
            let share = share.filter(|_| room >= 2.2 * em).map(percent);
            let (mark, [x, y], anchor) = match bar.direction {
                Direction::Upright => {
                    let y = y1 - place * size[1];
                    let mark = rectangle([x1, y - line / 2.0], [tick, line]);
                    let up = if share.is_some() { -0.12 } else { 0.36 };
                    (mark, [x1 + tick + 0.3 * em, y + up * em], Anchor::Start)
                }
                Direction::Across => {
                    let x = x0 + place * size[0];
                    let mark = rectangle([x - line / 2.0, y1], [line, tick]);
                    (mark, [x, y1 + tick + 1.05 * em], Anchor::Middle)
                }
            };
            sheet.fill(mark, ink);
            sheet.text(&label, [x, y], 0.95, Weight::Regular, anchor);
            if let Some(share) = share {
                sheet.text(&share, [x, y + em], 0.78, Weight::Regular, anchor);
            }
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

/// A share as it is written. Few are not none.
fn percent(share: f64) -> String {
    match share > 0.0 && share < 0.0005 {
        true => "< 0.1 %".to_owned(),
        false => format!("{:.1} %", 100.0 * share),
    }
}
