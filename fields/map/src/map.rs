//! Maps: values on a grid, and everything that a reader needs beside them.

use antumbra_image::Rgb8Image;

use crate::drawing::{Anchor, Drawing, Item, Weight, rectangle};
use crate::layout::Layout;
use crate::legend::{Direction, Legend};
use crate::relief::Shade;
use crate::sheet::Sheet;
use crate::steps::below;
use crate::{Error, Relief, Steps, Theme, font};

/// Least width and height of a map.
pub(crate) const LEAST: u32 = 320;
/// Most pixels of a map.
pub(crate) const MOST: u64 = 100_000_000;
/// Pixels of the picture inside for each pixel of the map, in both directions. Edges are smooth, and print is sharp.
const FINE: u32 = 2;

/// Places of a kind on a map, such as observers.
#[derive(Clone, Copy, Debug)]
pub struct Symbols<'a> {
    /// Name of one of them, in the legend.
    pub name: &'a str,
    /// Columns and rows from the north-western corner, `[n, 2]`: `[0.5, 0.5]` is the middle of the first cell. A place that is
    /// not on the map has no symbol.
    pub places: &'a [[f64; 2]],
}

/// A map: values in cells as they are seen from above, each with its true shape. The model's north is at the top, unless the
/// cells are turned.
#[derive(Clone, Debug)]
pub struct Map<'a> {
    /// Values, `[height, width]`, row by row from north to south. NaN is no value.
    pub values: &'a [f32],
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Edges of a cell along rows and along columns, in the unit of the model.
    pub cell: [f64; 2],
    /// Metres in a unit of the model; `None` if nobody knows: the scale bar then counts units.
    pub metres: Option<f64>,
    /// Degrees from the top of the map to true north, clockwise. NaN for no arrow, as where the map is an elevation.
    pub north: f64,
    /// Title above the map.
    pub title: &'a str,
    /// Line below the title: date, place, and what else belongs to the values.
    pub subtitle: &'a str,
    /// Name of the values, above the legend.
    pub quantity: &'a str,
    /// Unit of the values, or empty.
    pub unit: &'a str,
    /// Numbers of the legend.
    pub steps: Steps,
    /// Small line at the bottom: files, program and version.
    pub source: &'a str,
    /// The model beneath the values.
    pub relief: Option<&'a Relief>,
    /// Places on the map, with a symbol each.
    pub symbols: Option<Symbols<'a>>,
    /// Colours of paper and text.
    pub theme: Theme,
}

impl Map<'_> {
    /// A size in pixels that suits the shape of the grid: about 1600 pixels wide or high.
    pub fn usual_size(&self) -> [u32; 2] {
        self.check_grid()
            .map_or([1600, 1200], |()| Layout::usual_size(self.aspect()))
    }

    /// Columns and rows of the picture inside a map of this size. A [`Relief`] of as many pixels is sharp; its pixels have
    /// the edge [`Map::relief_pixel`].
    ///
    /// # Errors
    /// [`Error::Size`], [`Error::Grid`].
    pub fn relief_size(&self, size: [u32; 2]) -> Result<[usize; 2], Error> {
        let layout = self.layout(size)?;
        Ok(layout.map_size.map(|side| (side * FINE as f32) as usize))
    }

    /// Edge of a pixel of the relief of a map of this size, in the unit of the model.
    ///
    /// # Errors
    /// [`Error::Size`], [`Error::Grid`].
    pub fn relief_pixel(&self, size: [u32; 2]) -> Result<f64, Error> {
        let [columns, rows] = self.relief_size(size)?;
        let [east, north] = self.extent();
        // The larger one of both: as many pixels cover the grid.
        Ok((east / columns as f64).max(north / rows as f64))
    }

    /// Draws the map.
    ///
    /// # Errors
    /// [`Error::Size`], [`Error::Grid`], [`Error::Range`], or [`Error::Length`] if a list has another length than its grid.
    pub fn draw(&self, size: [u32; 2]) -> Result<Drawing, Error> {
        let layout = self.layout(size)?;
        if self.values.len() != self.width * self.height {
            return Err(Error::Length {
                what: "values",
                found: self.values.len(),
                wanted: self.width * self.height,
            });
        }
        let Steps { low, high, .. } = self.steps;
        if !(low < high && low.is_finite() && high.is_finite()) {
            return Err(Error::Range(low, high));
        }
        if let Some(relief) = self.relief {
            relief.check()?;
        }
        let mut parts = Parts {
            map: self,
            layout: &layout,
            sheet: Sheet::new(size, layout.em, self.theme),
        };
        parts.head();
        parts.map()?;
        parts.symbols();
        parts.legend()?;
        parts.scale_bar();
        parts.north_arrow();
        parts.source();
        Ok(parts.sheet.drawing(size, self.title))
    }

    /// Lines of a world file, by which GIS programs place the pixels of a PNG of this size.
    ///
    /// The `transform` has the place of the corner of column `c` and row `r` in the order of GDAL: `x = t[0] + c t[1] + r t[2]`
    /// and `y = t[3] + c t[4] + r t[5]`.
    ///
    /// # Errors
    /// [`Error::Size`], [`Error::Grid`].
    pub fn world_file(&self, size: [u32; 2], transform: [f64; 6]) -> Result<String, Error> {
        let layout = self.layout(size)?;
        let [x, a, b, y, d, e] = transform;
        // Cells in a pixel, and the middle of the first pixel of the file in columns and rows.
        let of = |cells: usize, axis: usize| {
            let part = cells as f64 / f64::from(layout.map_size[axis]);
            (part, part * (0.5 - f64::from(layout.map_at[axis])))
        };
        let ((wide, c), (high, r)) = (of(self.width, 0), of(self.height, 1));
        // A, D, B, E, C, F of the format.
        let lines = [
            wide * a,
            wide * d,
            high * b,
            high * e,
            x + c * a + r * b,
            y + c * d + r * e,
        ];
        // No minus zeros.
        Ok(lines.map(|x| format!("{:.10}\n", x + 0.0)).concat())
    }

    /// Lengths of the grid to the east and north, in the unit of the model.
    fn extent(&self) -> [f64; 2] {
        [
            self.width as f64 * self.cell[0],
            self.height as f64 * self.cell[1],
        ]
    }

    fn aspect(&self) -> f32 {
        let [east, north] = self.extent();
        (east / north) as f32
    }

    /// Whether a map can have this size in pixels.
    ///
    /// # Errors
    /// [`Error::Size`].
    pub fn check_size([width, height]: [u32; 2]) -> Result<(), Error> {
        if width < LEAST || height < LEAST || u64::from(width) * u64::from(height) > MOST {
            return Err(Error::Size {
                width,
                height,
                least: LEAST,
                most: MOST,
            });
        }
        Ok(())
    }

    fn check_grid(&self) -> Result<(), Error> {
        let is_length = |x: f64| x > 0.0 && x.is_finite();
        match self.extent().into_iter().all(is_length) {
            true => Ok(()),
            false => Err(Error::Grid {
                width: self.width,
                height: self.height,
                cell: self.cell,
            }),
        }
    }

    fn layout(&self, size: [u32; 2]) -> Result<Layout, Error> {
        self.check_grid()?;
        Self::check_size(size)?;
        Ok(Layout::new(size, self.aspect()))
    }

    /// The picture inside: values in colours over the relief.
    fn picture(&self, [columns, rows]: [usize; 2]) -> Result<Rgb8Image, Error> {
        let means = Means::new(self, [columns, rows]);
        let paper = self.theme.paper();
        let mut pixels = Vec::with_capacity(columns * rows);
        for row in 0..rows {
            for column in 0..columns {
                let colour = means.colour(column, row);
                let shade = self.relief.map(|relief| {
                    let x =
                        (column as f64 + 0.5) / columns as f64 * self.extent()[0] / relief.pixel;
                    let y = (row as f64 + 0.5) / rows as f64 * self.extent()[1] / relief.pixel;
                    match (x as usize, y as usize) {
                        (x, y) if x < relief.width && y < relief.height => relief.shade(x, y),
                        _ => Shade::Nothing,
                    }
                });
                let shade = shade.unwrap_or(Shade::Nothing);
                pixels.push(shade.paint(colour, self.theme.surface(), paper));
            }
        }
        Ok(Rgb8Image::new(columns, rows, pixels)?)
    }
}

/// Values of pixels: the cell that a pixel is in, or the mean of all cells whose middle is in the pixel.
struct Means<'a> {
    map: &'a Map<'a>,
    /// Cells in a pixel, along both sides.
    cells: [f64; 2],
}

impl<'a> Means<'a> {
    fn new(map: &'a Map<'a>, [columns, rows]: [usize; 2]) -> Self {
        Self {
            map,
            cells: [
                map.width as f64 / columns as f64,
                map.height as f64 / rows as f64,
            ],
        }
    }

    /// Colour of a pixel, if a cell has a value: the one of the mean. Where colours are classes, between which there are no
    /// values, it is the mean of the colours.
    fn colour(&self, column: usize, row: usize) -> Option<[u8; 3]> {
        let steps = &self.map.steps;
        if !steps.has_classes() {
            let value = self.at(column, row);
            return (!value.is_nan()).then(|| steps.colour(value));
        }
        let (mut sum, mut count) = ([0.0; 3], 0.0);
        for value in self.known(column, row) {
            let colour = steps.colour(value);
            sum = [0, 1, 2].map(|i| sum[i] + f64::from(colour[i]));
            count += 1.0;
        }
        (count > 0.0).then(|| sum.map(|x| (x / count).round() as u8))
    }

    /// Value of a pixel, or NaN.
    fn at(&self, column: usize, row: usize) -> f64 {
        let add = |(sum, count), value: f64| (sum + value, count + 1.0);
        let (sum, count) = self.known(column, row).fold((0.0, 0.0), add);
        sum / count
    }

    /// Values of the cells of a pixel, row by row, but for absent ones.
    fn known(&self, column: usize, row: usize) -> impl Iterator<Item = f64> + '_ {
        let range = |pixel: usize, cells: f64, count: usize| {
            let [start, end] = [0.0, 1.0].map(|i| (pixel as f64 + i) * cells);
            let [first, last] = [(start - 0.5).ceil() as usize, (end - 0.5).ceil() as usize];
            match first < last.min(count) {
                true => first..last.min(count),
                false => {
                    let middle = (((start + end) / 2.0) as usize).min(count - 1);
                    middle..middle + 1
                }
            }
        };
        let (columns, rows) = (
            range(column, self.cells[0], self.map.width),
            range(row, self.cells[1], self.map.height),
        );
        let values = rows.flat_map(move |row| {
            let start = row * self.map.width;
            &self.map.values[start + columns.start..start + columns.end]
        });
        values
            .filter(|value| !value.is_nan())
            .map(|&value| f64::from(value))
    }
}

/// A map that is being drawn.
struct Parts<'a> {
    map: &'a Map<'a>,
    layout: &'a Layout,
    sheet: Sheet,
}

impl Parts<'_> {
    fn head(&mut self) {
        let Layout {
            em, left, right, ..
        } = *self.layout;
        let room = right - left;
        let title = font::cut(self.map.title, Layout::TITLE * em, Weight::Bold, room);
        let base = self.layout.title_base;
        self.sheet.text(
            &title,
            [left, base],
            Layout::TITLE,
            Weight::Bold,
            Anchor::Start,
        );
        let line = font::cut(self.map.subtitle, em, Weight::Regular, room);
        let base = self.layout.subtitle_base;
        self.sheet
            .text(&line, [left, base], 1.0, Weight::Regular, Anchor::Start);
    }

    fn map(&mut self) -> Result<(), Error> {
        let Layout {
            map_at: at,
            map_size: size,
            ..
        } = *self.layout;
        let image = self
            .map
            .picture(size.map(|side| (side * FINE as f32) as usize))?;
        self.sheet.items.push(Item::Picture { image, at, size });
        self.sheet.outline(rectangle(at, size));
        Ok(())
    }

    fn symbols(&mut self) {
        let places = self.map.symbols.map_or(&[][..], |symbols| symbols.places);
        for &[column, row] in places {
            let at = [column / self.map.width as f64, row / self.map.height as f64];
            if at.iter().all(|part| (0.0..=1.0).contains(part)) {
                let Layout {
                    map_at, map_size, ..
                } = self.layout;
                let at = [0, 1].map(|axis| map_at[axis] + at[axis] as f32 * map_size[axis]);
                self.sheet.symbol(at);
            }
        }
    }

    fn legend(&mut self) -> Result<(), Error> {
        let legend = Legend {
            quantity: self.map.quantity,
            unit: self.map.unit,
            steps: &self.map.steps,
            beyond: self.map.steps.beyond(self.map.values),
            symbol: self.map.symbols.map(|symbols| symbols.name),
        };
        let layout = self.layout;
        let direction = match layout.is_upright {
            true => Direction::Upright,
            false => Direction::Across,
        };
        let room = [layout.legend_length, layout.legend_room];
        legend.draw(&mut self.sheet, layout.legend_at, room, direction)
    }

    /// Bar of a round length, about a third as long as the room for it at least.
    fn scale_bar(&mut self) {
        let em = self.layout.em;
        let pixels = f64::from(self.layout.map_size[0]) / self.map.extent()[0];
        let [x, y] = self.layout.scale_at;
        let metres = self.map.metres.unwrap_or(1.0);
        let room = f64::from(self.layout.scale_room) / pixels * metres;
        let length = below(room);
        let (number, unit) = match self.map.metres {
            Some(_) if length >= 1000.0 => (length / 1000.0, "km"),
            Some(_) if length >= 1.0 => (length, "m"),
            Some(_) if length >= 0.01 => (length * 100.0, "cm"),
            Some(_) => (length * 1000.0, "mm"),
            None => (length, "units"),
        };
        let wide = (length / metres * pixels) as f32;
        let high = (0.34 * em).max(2.0);
        let (text, paper) = (self.map.theme.text(), self.map.theme.paper());
        let half = wide / 2.0;
        self.sheet.fill(rectangle([x, y], [half, high]), text);
        self.sheet
            .fill(rectangle([x + half, y], [half, high]), paper);
        self.sheet.outline(rectangle([x, y], [wide, high]));
        let number = (number * 1e9).round() / 1e9;
        let base = y + high + 1.1 * em;
        let label = format!("{number} {unit}");
        self.sheet
            .text("0", [x, base], 0.95, Weight::Regular, Anchor::Start);
        let end = [x + wide, base];
        let anchor = match wide > font::width(&label, em, Weight::Regular) + em {
            true => Anchor::End,
            false => Anchor::Start,
        };
        self.sheet.text(&label, end, 0.95, Weight::Regular, anchor);
    }

    fn north_arrow(&mut self) {
        if self.map.north.is_nan() {
            return;
        }
        let em = self.layout.em;
        let [x, y] = self.layout.arrow_at;
        let middle = [x, y + 1.9 * em];
        let (sin, cos) = (self.map.north.to_radians() as f32).sin_cos();
        // From the middle: to the right and towards north, in em.
        let at = |right: f32, north: f32| {
            [
                middle[0] + em * (right * cos + north * sin),
                middle[1] + em * (right * sin - north * cos),
            ]
        };
        let (tip, notch) = (at(0.0, 0.75), at(0.0, -0.9));
        let text = self.map.theme.text();
        self.sheet.fill(vec![tip, notch, at(-0.62, -1.4)], text);
        self.sheet.outline(vec![tip, at(0.62, -1.4), notch]);
        let [x, y] = at(0.0, 1.35);
        self.sheet
            .text("N", [x, y + 0.36 * em], 1.0, Weight::Bold, Anchor::Middle);
    }

    fn source(&mut self) {
        let Layout {
            em, left, right, ..
        } = *self.layout;
        let size = Layout::SOURCE;
        let line = font::cut(self.map.source, size * em, Weight::Regular, right - left);
        let base = self.layout.source_base;
        self.sheet
            .text(&line, [left, base], size, Weight::Regular, Anchor::Start);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(values: &[f32], width: usize) -> Map<'_> {
        Map {
            values,
            width,
            height: values.len() / width,
            cell: [1.0; 2],
            metres: Some(1.0),
            north: 0.0,
            title: "Map",
            subtitle: "",
            quantity: "Value",
            unit: "",
            steps: Steps::between(0.0, 1.0, false),
            source: "",
            relief: None,
            symbols: None,
            theme: Theme::Light,
        }
    }

    #[test]
    fn pixels_show_their_cell_or_the_mean_of_their_cells() {
        let values: Vec<f32> = (0..16).map(|i| i as f32).collect();
        let map = map(&values, 4);
        let means = Means::new(&map, [8, 8]);
        for row in 0..8 {
            for column in 0..8 {
                let wanted = f64::from(values[row / 2 * 4 + column / 2]);
                assert_eq!(means.at(column, row), wanted, "{column}, {row}");
            }
        }
        let means = Means::new(&map, [2, 2]);
        assert_eq!(means.at(0, 0), (0.0 + 1.0 + 4.0 + 5.0) / 4.0);
        assert_eq!(means.at(1, 1), (10.0 + 11.0 + 14.0 + 15.0) / 4.0);
        let mut holes = values.clone();
        holes[0] = f32::NAN;
        let map = self::map(&holes, 4);
        assert_eq!(Means::new(&map, [2, 2]).at(0, 0), (1.0 + 4.0 + 5.0) / 3.0);
        assert!(Means::new(&map, [4, 4]).at(0, 0).is_nan());
    }

    #[test]
    fn pixels_of_many_classes_have_the_mean_of_colours() {
        // 0, 1 and 2, of which no pixel is in the class between the others.
        let values = [0.0, 2.0, 0.0, 2.0, f32::NAN, 2.0, f32::NAN, f32::NAN];
        let mut map = map(&values, 4);
        map.steps = Steps::classes(&[("a", [0; 3]), ("b", [250, 0, 0]), ("c", [100; 3])]);
        let means = Means::new(&map, [2, 1]);
        assert_eq!(means.colour(0, 0), Some([67; 3]));
        assert_eq!(means.colour(1, 0), Some([50; 3]));
        assert_eq!(Means::new(&map, [4, 2]).colour(2, 1), None);
    }
}
