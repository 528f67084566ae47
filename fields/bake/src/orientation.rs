//! Where up and north are in a scene.

use antumbra_terrain::angles::sin_cos_degrees;

use crate::Error;
use crate::vector::{cross, dot, unit};

/// Axis of a scene that points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum UpAxis {
    /// The y axis points up, and -z north, as in glTF.
    Y,
    /// The z axis points up, and y north, as in maps and most models of cities.
    #[default]
    Z,
}

/// East, north and up in a scene, as vectors of length 1 that are at right angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orientation {
    /// Unit vector to the east in coordinates of the scene.
    pub east: [f64; 3],
    /// Unit vector to the north in coordinates of the scene.
    pub north: [f64; 3],
    /// Unit vector upwards in coordinates of the scene.
    pub up: [f64; 3],
}

impl Default for Orientation {
    /// x is east, y north and z up.
    fn default() -> Self {
        Self {
            east: [1.0, 0.0, 0.0],
            north: [0.0, 1.0, 0.0],
            up: [0.0, 0.0, 1.0],
        }
    }
}

impl Orientation {
    /// Orientation of a scene whose up axis is known. `north` is the angle in degrees from the scene's own north (see
    /// [`UpAxis`]) to true north, clockwise as seen from above: 90 where the x axis points north.
    ///
    /// # Errors
    /// [`Error::Range`] if the angle is not finite.
    pub fn new(up: UpAxis, north: f64) -> Result<Self, Error> {
        let wanted = "a finite angle in degrees";
        Error::check_range("north", north, north.is_finite(), wanted)?;
        let (up, own_north) = match up {
            UpAxis::Y => ([0.0, 1.0, 0.0], [0.0, 0.0, -1.0]),
            UpAxis::Z => ([0.0, 0.0, 1.0], [0.0, 1.0, 0.0]),
        };
        let own_east = cross(own_north, up);
        let (sin, cos) = sin_cos_degrees(north);
        let mix = |a: f64, b: f64| [0, 1, 2].map(|axis| a * own_east[axis] + b * own_north[axis]);
        Ok(Self {
            east: mix(cos, -sin),
            north: mix(sin, cos),
            up,
        })
    }

    /// Orientation from two vectors: `up`, and the direction in the horizontal plane that is nearest to `north`.
    ///
    /// # Errors
    /// [`Error::Range`] if a vector is 0 or not finite, or if both are parallel.
    pub fn from_vectors(up: [f64; 3], north: [f64; 3]) -> Result<Self, Error> {
        let bad = |what, vector: [f64; 3]| Error::Range {
            what,
            found: vector[0],
            wanted: "a finite vector, not 0, and up not along north",
        };
        let up = unit(up).ok_or(bad("up", up))?;
        let east = unit(north).and_then(|north| {
            let across = cross(north, up);
            let is_wide = across.iter().map(|x| x * x).sum::<f64>() > 1e-24;
            unit(across).filter(|_| is_wide)
        });
        let east = east.ok_or(bad("north", north))?;
        Ok(Self {
            east,
            north: cross(up, east),
            up,
        })
    }

    /// Direction in the scene of a place in the sky, of length 1: `azimuth` in degrees from north through east, `elevation` in
    /// degrees above the horizon.
    pub fn direction(&self, azimuth: f64, elevation: f64) -> [f64; 3] {
        let (sin, cos) = sin_cos_degrees(azimuth);
        let (height, width) = sin_cos_degrees(elevation);
        self.scene([width * sin, width * cos, height])
    }

    /// Vector in the scene of one in terms of east, north and up.
    pub fn scene(&self, [e, n, u]: [f64; 3]) -> [f64; 3] {
        let Self { east, north, up } = self;
        [0, 1, 2].map(|axis| e * east[axis] + n * north[axis] + u * up[axis])
    }

    /// Vector in terms of east, north and up of one in the scene.
    pub fn local(&self, vector: [f64; 3]) -> [f64; 3] {
        [self.east, self.north, self.up].map(|axis| dot(axis, vector))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_of_the_compass_are_exact() {
        let z = Orientation::default();
        assert_eq!(z, Orientation::new(UpAxis::Z, 0.0).expect("axes"));
        assert_eq!(z.direction(0.0, 0.0), [0.0, 1.0, 0.0]);
        assert_eq!(z.direction(90.0, 0.0), [1.0, 0.0, 0.0]);
        assert_eq!(z.direction(180.0, 0.0), [0.0, -1.0, 0.0]);
        assert_eq!(z.direction(-90.0, 0.0), [-1.0, 0.0, 0.0]);
        assert_eq!(z.direction(77.0, 90.0), [0.0, 0.0, 1.0]);
        let y = Orientation::new(UpAxis::Y, 0.0).expect("axes");
        assert_eq!(y.direction(0.0, 0.0), [0.0, 0.0, -1.0]);
        assert_eq!(y.direction(90.0, 0.0), [1.0, 0.0, 0.0]);
        assert_eq!(y.direction(0.0, 90.0), [0.0, 1.0, 0.0]);
        let turned = Orientation::new(UpAxis::Z, 90.0).expect("axes");
        assert_eq!(turned.direction(0.0, 0.0), [1.0, 0.0, 0.0], "x is north");
        assert_eq!(turned.direction(90.0, 0.0), [0.0, -1.0, 0.0]);
    }

    #[test]
    fn vectors_come_back_and_bad_ones_are_refused() {
        for up in [UpAxis::Y, UpAxis::Z] {
            let axes = Orientation::new(up, 33.0).expect("axes");
            let again = Orientation::from_vectors(axes.up, axes.north).expect("axes");
            for (a, b) in [(axes.east, again.east), (axes.north, again.north)] {
                assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12));
            }
            let vector = [1.0, -2.0, 0.5];
            let back = axes.local(axes.scene(vector));
            assert!(vector.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-12));
        }
        let up = [0.0, 0.0, 2.0];
        for north in [[0.0; 3], [0.0, 0.0, 3.0], [f64::NAN, 1.0, 0.0]] {
            assert!(Orientation::from_vectors(up, north).is_err(), "{north:?}");
        }
        assert!(Orientation::new(UpAxis::Y, f64::INFINITY).is_err());
    }
}
