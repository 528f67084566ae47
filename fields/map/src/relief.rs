//! What is beneath the values: the model in grey, shaded as a relief, with its edges.

use crate::Error;

/// The model as it is seen from above, in square pixels, row by row from north to south.
///
/// Pixels without a surface have the height NaN.
#[derive(Clone, Debug)]
pub struct Relief {
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Edge of a pixel, in the unit of the model.
    pub pixel: f64,
    /// Heights, `[height, width]`, in the unit of the model.
    pub heights: Vec<f32>,
    /// Normals of length 1, turned upwards, as east, north and up, `[height, width, 3]`.
    pub normals: Vec<[f32; 3]>,
    /// Whether edges are lines, as a map of buildings has them.
    pub has_edges: bool,
}

/// How a pixel of a relief is painted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Shade {
    /// There is no surface.
    Nothing,
    /// Brightness of a surface without a value, and factor on the colour of one with a value, both from 0 to 1. `edge` is the
    /// part of the colour that an edge leaves, 1 where there is none.
    Surface { grey: f32, factor: f32, edge: f32 },
}

/// Least luminance, of 255, of colours that an edge darkens. It brightens darker ones, on which a dark line would be lost.
const DIM: f32 = 80.0;

impl Shade {
    /// Colour of a pixel: with this colour for its value, if it has one, on a surface that is `bare` without a value.
    pub fn paint(self, value: Option<[u8; 3]>, bare: [f32; 3], paper: [u8; 3]) -> [u8; 3] {
        let (colour, edge) = match (self, value) {
            (Self::Nothing, value) => return value.unwrap_or(paper),
            (Self::Surface { grey, edge, .. }, None) => (bare.map(|x| x * grey), edge),
            (Self::Surface { factor, edge, .. }, Some(colour)) => {
                (colour.map(|x| f32::from(x) * factor), edge)
            }
        };
        // Rec. 709.
        let luminance = 0.2126 * colour[0] + 0.7152 * colour[1] + 0.0722 * colour[2];
        let line = if luminance < DIM { 150.0 } else { 0.0 };
        colour.map(|x| (line + (x - line) * edge).round() as u8)
    }
}

/// Where the light of a relief comes from: north-west, 45 degrees high, as maps have it.
const LIGHT: [f32; 3] = [-0.5, 0.5, std::f32::consts::FRAC_1_SQRT_2];
/// Cosine between normals of neighbours at an edge of the model.
const CREASE: f32 = 0.85;
/// Share of the brightness that is left at an edge where the surface breaks off, and at one where it only turns.
const BREAK: f32 = 0.35;
const TURN: f32 = 0.7;

impl Relief {
    /// A surface of heights of square pixels in rows of this width, `[n, width]`. NaN is a hole.
    ///
    /// Normals come from central differences, and beside a hole or the border from the difference to the other side.
    ///
    /// # Example
    ///
    /// ```
    /// // Climbs by 1 from one pixel to the next in the east.
    /// let relief = antumbra_map::Relief::of_heights(vec![0.0, 1.0, 2.0], 3, 1.0);
    /// assert_eq!(relief.normals[1], [-0.5_f32.sqrt(), 0.0, 0.5_f32.sqrt()]);
    /// ```
    pub fn of_heights(heights: Vec<f32>, width: usize, pixel: f64) -> Self {
        let height = heights.len() / width.max(1);
        Self {
            normals: normals(&heights, [width, height], pixel, [1; 2]),
            width,
            height,
            pixel,
            heights,
            has_edges: true,
        }
    }

    /// Terrain of the heights of `[columns, rows]` cells, whose edges have these lengths, in pixels of another size and without
    /// edges. Heights that are not finite are holes.
    ///
    /// A pixel that is larger than a cell has the mean of cells around its middle. Smaller ones lie between the middles of
    /// cells, with normals from differences over the length of a cell, so that no cell is a facet.
    ///
    /// # Errors
    /// [`Error::Length`] if there are more or fewer heights than cells.
    pub fn of_cells(
        heights: &[f64],
        [columns, rows]: [usize; 2],
        cell: [f64; 2],
        pixel: f64,
    ) -> Result<Self, Error> {
        if heights.len() != columns * rows {
            return Err(Error::Length {
                what: "heights",
                found: heights.len(),
                wanted: columns * rows,
            });
        }
        // Single precision is fine as seen from one of the heights.
        let base = heights.iter().find(|height| height.is_finite());
        let base = base.copied().unwrap_or_default();
        let across = boxes(columns, cell[0], pixel);
        let along = boxes(rows, cell[1], pixel);
        let mut means = Vec::with_capacity(across.len() * along.len());
        for (top, weights) in &along {
            for (left, parts) in &across {
                let (mut sum, mut whole, mut most) = (0.0, 0.0, (0.0, f64::NAN));
                for (row, weight) in weights.iter().enumerate() {
                    let start = (top + row) * columns + left;
                    for (height, part) in heights[start..].iter().zip(parts) {
                        let weight = weight * part;
                        if weight > most.0 {
                            most = (weight, *height);
                        }
                        if height.is_finite() {
                            (sum, whole) = (sum + weight * (height - base), whole + weight);
                        }
                    }
                }
                // A pixel between cells belongs to the nearest one. Among many, none decides.
                let is_hole = pixel < cell[0].min(cell[1]) && !most.1.is_finite();
                means.push(if is_hole {
                    f32::NAN
                } else {
                    (sum / whole) as f32
                });
            }
        }
        let reach = cell.map(|edge| (edge / pixel).round().max(1.0) as usize);
        let (width, height) = (across.len(), along.len());
        Ok(Self {
            width,
            height,
            pixel,
            normals: normals(&means, [width, height], pixel, reach),
            heights: means,
            has_edges: false,
        })
    }
    /// Checks lengths.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let wanted = self.width * self.height;
        for (what, found) in [
            ("heights", self.heights.len()),
            ("normals", self.normals.len()),
        ] {
            if found != wanted {
                return Err(Error::Length {
                    what,
                    found,
                    wanted,
                });
            }
        }
        Ok(())
    }

    /// Shade of the pixel in a column and row.
    ///
    /// Level surfaces keep the colours of the legend. Slopes that turn away from the light are darker. Slopes that face the light are not brightened, since light colours are large values.
    pub(crate) fn shade(&self, column: usize, row: usize) -> Shade {
        let index = row * self.width + column;
        let height = self.heights[index];
        if height.is_nan() {
            return Shade::Nothing;
        }
        let normal = self.normals[index];
        let light: f32 = (0..3).map(|i| normal[i] * LIGHT[i]).sum();
        let relative = light.max(0.0) / LIGHT[2];
        let edge = match self.has_edges {
            true => self.edge(column, row),
            false => 1.0,
        };
        Shade::Surface {
            grey: (0.45 + 0.42 * relative).min(1.0),
            factor: (0.62 + 0.38 * relative).min(1.0),
            edge,
        }
    }

    /// Factor of the edge between a pixel and its neighbours to the east and south: 1 where there is none.
    fn edge(&self, column: usize, row: usize) -> f32 {
        let index = row * self.width + column;
        let mut factor = 1.0_f32;
        if column + 1 < self.width {
            factor = factor.min(self.between(index, index + 1, [1.0, 0.0]));
        }
        if row + 1 < self.height {
            factor = factor.min(self.between(index, index + self.width, [0.0, -1.0]));
        }
        factor
    }

    /// Factor of the edge between two neighbours, the second one in a direction (east, north) from the first one.
    fn between(&self, a: usize, b: usize, direction: [f32; 2]) -> f32 {
        let [low, high] = [self.heights[a], self.heights[b]];
        if high.is_nan() {
            return BREAK;
        }
        let [na, nb] = [self.normals[a], self.normals[b]];
        // How far the planes of both pixels climb on the way. Steep ones may climb by any height.
        let climb = |n: [f32; 3]| {
            -(n[0] * direction[0] + n[1] * direction[1]) / n[2].max(0.05) * self.pixel as f32
        };
        let unexplained = (high - low - 0.5 * (climb(na) + climb(nb))).abs();
        let steep = climb(na).abs().max(climb(nb).abs());
        if unexplained > (2.0 * self.pixel as f32).max(steep) {
            return BREAK;
        }
        let cosine: f32 = (0..3).map(|i| na[i] * nb[i]).sum();
        if cosine < CREASE { TURN } else { 1.0 }
    }
}

/// Of each pixel along a side: the first cell of the box around its middle, and the parts of the cells in the box. Its length
/// is a whole number of cells, so that even slopes keep their heights.
fn boxes(count: usize, cell: f64, pixel: f64) -> Vec<(usize, Vec<f64>)> {
    let pixels = (count as f64 * cell / pixel - 1e-6).ceil().max(1.0) as usize;
    let half = (pixel / cell).round().max(1.0) / 2.0;
    let parts = |index: usize| {
        let middle = (index as f64 + 0.5) * pixel / cell;
        let middle = middle.clamp(0.5, count as f64 - 0.5);
        let [low, high] = [(middle - half).max(0.0), middle + half];
        let cells = low as usize..(high.ceil() as usize).min(count);
        let part = |cell: usize| high.min(cell as f64 + 1.0) - low.max(cell as f64);
        (cells.start, cells.map(part).collect())
    };
    (0..pixels).map(parts).collect()
}

/// Normals of heights from differences over so many pixels to both sides.
fn normals(
    heights: &[f32],
    [width, height]: [usize; 2],
    pixel: f64,
    reach: [usize; 2],
) -> Vec<[f32; 3]> {
    // Slope between two places; where one is absent, from the other one to the place itself.
    let slope = |[before, here, after]: [f32; 3], reach: usize| {
        let known = [before, after].map(|x| if x.is_nan() { here } else { x });
        let steps = 2.0 - f32::from(before.is_nan()) - f32::from(after.is_nan());
        (known[1] - known[0]) / (steps.max(1.0) * reach as f32 * pixel as f32)
    };
    let normal = |index: usize| {
        let (column, row) = (index % width, index / width);
        let at = |column: Option<usize>, row: Option<usize>| match (column, row) {
            (Some(column), Some(row)) if column < width && row < height => {
                heights[row * width + column]
            }
            _ => f32::NAN,
        };
        let here = heights[index];
        let [west, north] = [column.checked_sub(reach[0]), row.checked_sub(reach[1])];
        let [east, south] = [column + reach[0], row + reach[1]];
        let across = [at(west, Some(row)), here, at(Some(east), Some(row))];
        let along = [at(Some(column), Some(south)), here, at(Some(column), north)];
        let [x, y] = [slope(across, reach[0]), slope(along, reach[1])];
        let length = (x * x + y * y + 1.0).sqrt();
        [-x / length, -y / length, 1.0 / length]
    };
    (0..heights.len()).map(normal).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const UP: [f32; 3] = [0.0, 0.0, 1.0];

    fn factors(heights: &[f32], normals: &[[f32; 3]]) -> Vec<f32> {
        let relief = Relief {
            width: heights.len(),
            height: 1,
            pixel: 1.0,
            heights: heights.to_vec(),
            normals: normals.to_vec(),
            has_edges: true,
        };
        let shade = |column| match relief.shade(column, 0) {
            Shade::Surface { factor, edge, .. } => factor * edge,
            Shade::Nothing => f32::NAN,
        };
        (0..heights.len()).map(shade).collect()
    }

    #[test]
    fn level_ground_keeps_its_colour_and_a_wall_is_an_edge() {
        let found = factors(&[0.0, 0.0, 9.0, 9.0], &[UP; 4]);
        assert_eq!(found, [1.0, BREAK, 1.0, 1.0]);
        let found = factors(&[0.0, 0.0, f32::NAN], &[UP; 3]);
        assert_eq!((found[0], found[1]), (1.0, BREAK));
        assert!(found[2].is_nan());
    }

    #[test]
    fn slopes_have_no_edges_inside() {
        let half = std::f32::consts::FRAC_1_SQRT_2;
        // Climbs to the east and faces west, to the light.
        let west = [-half, 0.0, half];
        assert_eq!(factors(&[0.0, 1.0, 2.0], &[west; 3]), [1.0; 3]);
        // A ridge: the other side is dark, with one edge between.
        let east = [half, 0.0, half];
        let found = factors(&[0.0, 1.0, 1.0, 0.0], &[west, west, east, east]);
        assert_eq!((found[0], found[1]), (1.0, TURN));
        assert!(found[2] < 0.9 && found[2] == found[3], "{found:?}");
    }

    #[test]
    fn edges_are_seen_on_dark_and_on_light_colours() {
        let shade = |edge| Shade::Surface {
            grey: 0.5,
            factor: 1.0,
            edge,
        };
        let paint = |edge, value| shade(edge).paint(value, [240.0; 3], [255; 3]);
        let (dark, light) = ([68, 1, 84], [253, 231, 37]);
        for value in [dark, light] {
            assert_eq!(paint(1.0, Some(value)), value);
        }
        assert!(paint(BREAK, Some(dark))[1] > 60);
        assert!(paint(BREAK, Some(light))[1] < 100);
        assert_eq!(paint(1.0, None), [120; 3]);
        assert_eq!(Shade::Nothing.paint(None, [240.0; 3], [255; 3]), [255; 3]);
    }

    #[test]
    fn lists_have_the_length_of_the_grid() {
        let relief = Relief {
            width: 2,
            height: 2,
            pixel: 1.0,
            heights: vec![0.0; 4],
            normals: vec![UP; 3],
            has_edges: true,
        };
        assert!(matches!(
            relief.check(),
            Err(Error::Length {
                what: "normals",
                found: 3,
                wanted: 4
            })
        ));
    }

    #[test]
    fn cells_of_a_plane_have_its_normals_in_pixels_of_any_size() {
        let ([columns, rows], cell, [x, y]) = ([60, 40], [2.0, 5.0], [0.4, -0.7]);
        // Rows run from north to south.
        let height = |east: f64, south: f64| 2000.0 + x * east - y * south;
        let of = |i: usize| {
            let [east, south] = [i % columns, i / columns].map(|i| i as f64 + 0.5);
            height(cell[0] * east, cell[1] * south)
        };
        let heights: Vec<f64> = (0..columns * rows).map(of).collect();
        let length = (x * x + y * y + 1.0_f64).sqrt();
        let wanted = [-x / length, -y / length, 1.0 / length];
        for pixel in [0.3, 1.0, 1.9, 2.6, 5.0, 7.7, 13.0] {
            let relief = Relief::of_cells(&heights, [columns, rows], cell, pixel).expect("a plane");
            let middle = [relief.width / 2, relief.height / 2];
            let index = |c: usize, r: usize| r * relief.width + c;
            for step in 0..3 {
                let (c, r) = (middle[0] + step, middle[1] + step);
                let normal = relief.normals[index(c, r)];
                for axis in 0..3 {
                    let apart = f64::from(normal[axis]) - wanted[axis];
                    assert!(apart.abs() < 1e-3, "{pixel}: {normal:?}, not {wanted:?}");
                }
                // As seen from the first height.
                let at = [c, r].map(|i| (i as f64 + 0.5) * pixel);
                let wanted = height(at[0], at[1]) - heights[0];
                let found = f64::from(relief.heights[index(c, r)]);
                assert!(
                    (found - wanted).abs() < 1e-3,
                    "{pixel}: {found}, not {wanted}"
                );
            }
            let covered = [relief.width, relief.height].map(|n| n as f64 * pixel);
            assert!(covered[0] >= 120.0 && covered[1] >= 200.0, "{covered:?}");
            assert!(relief.heights.iter().all(|height| height.is_finite()));
        }
        assert!(Relief::of_cells(&heights, [columns, rows - 1], cell, 1.0).is_err());
    }

    #[test]
    fn holes_are_as_large_as_their_cells_and_have_no_edges() {
        let mut heights = vec![5.0; 36];
        heights[2 * 6 + 3] = f64::NAN;
        let relief = Relief::of_cells(&heights, [6, 6], [4.0; 2], 1.0).expect("cells");
        for (index, height) in relief.heights.iter().enumerate() {
            let (column, row) = (index % 24, index / 24);
            let is_hole = column / 4 == 3 && row / 4 == 2;
            assert_eq!(height.is_nan(), is_hole, "{column}, {row}");
            let level = Shade::Surface {
                grey: 0.87,
                factor: 1.0,
                edge: 1.0,
            };
            let wanted = if is_hole { Shade::Nothing } else { level };
            assert_eq!(relief.shade(column, row), wanted, "{column}, {row}");
        }
        // A pixel of many cells has the mean of those that are there.
        let relief = Relief::of_cells(&heights, [6, 6], [4.0; 2], 8.0).expect("cells");
        assert_eq!(relief.heights, [0.0; 9]);
    }
}
