//! What is beneath the values: the model in grey, shaded as a relief, with its edges.

use crate::Error;

/// The model as it is seen from above, in square pixels, row by row from north to south.
///
/// Pixels without a surface have the height NaN.
#[derive(Clone, Copy, Debug)]
pub struct Relief<'a> {
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Edge of a pixel, in the unit of the model.
    pub pixel: f64,
    /// Heights, `[height, width]`, in the unit of the model.
    pub heights: &'a [f32],
    /// Normals of length 1, turned upwards, as east, north and up, `[height, width, 3]`.
    pub normals: &'a [[f32; 3]],
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

impl Relief<'_> {
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
        let edge = self.edge(column, row);
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

#[cfg(test)]
mod tests {
    use super::*;

    const UP: [f32; 3] = [0.0, 0.0, 1.0];

    fn factors(heights: &[f32], normals: &[[f32; 3]]) -> Vec<f32> {
        let relief = Relief {
            width: heights.len(),
            height: 1,
            pixel: 1.0,
            heights,
            normals,
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
            heights: &[0.0; 4],
            normals: &[UP; 3],
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
}
