//! The sky in patches.

use antumbra_terrain::angles::sin_cos_degrees;

use crate::Error;
use crate::orientation::Orientation;
use crate::vector::dot;

/// How the sky above the horizon is divided.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SkyDivision {
    /// 145 patches in seven rows of 12 degrees and a cap (Tregenza 1987, "Subdivision of the sky hemisphere for luminance
    /// measurements").
    Tregenza,
    /// Rows and patches of Tregenza's division, each cut into this many by this many: 577 patches for 2, 2305 for 4 (Reinhart
    /// 2001; rows have equal height, as in Radiance). 1 is [`Tregenza`](Self::Tregenza).
    Reinhart(u32),
    /// So many patches of the same solid angle along a spiral.
    Uniform(u32),
}

/// Patches of the sky, from the horizon up, in each row clockwise from north. The first patch of a row is centred at north,
/// the last patch of all at the zenith. (Patches of [`SkyDivision::Uniform`] run along a spiral from the horizon.)
#[derive(Clone, Debug, PartialEq)]
pub struct SkyPatches {
    /// Centres, of length 1, in terms of east, north and up: `[n, 3]`.
    pub centres: Vec<[f64; 3]>,
    /// Solid angles, `[n]`. Their sum is 2π.
    pub solid_angles: Vec<f64>,
}

/// Patches of the rows of Tregenza's division, from the horizon.
const TREGENZA: [u32; 7] = [30, 30, 24, 24, 18, 12, 6];

/// Most patches.
const MOST: u32 = 1 << 20;

impl SkyDivision {
    /// The patches.
    ///
    /// # Errors
    /// [`Error::Range`] if a division has no patch, or more than a million.
    pub fn patches(self) -> Result<SkyPatches, Error> {
        let (found, most) = match self {
            Self::Tregenza => return Ok(rows(1)),
            Self::Reinhart(parts) => (parts, 80),
            Self::Uniform(count) => (count, MOST),
        };
        let is_in = (1..=most).contains(&found);
        let wanted = "1 to 80 parts of each patch, or 1 to 1048576 patches";
        Error::check_range("patches", found.into(), is_in, wanted)?;
        Ok(match self {
            Self::Reinhart(parts) => rows(parts),
            _ => spiral(found),
        })
    }
}

/// Rows of Tregenza's division, each cut into some of the same height.
fn rows(parts: u32) -> SkyPatches {
    let height = 90.0 / (7.0 * f64::from(parts) + 0.5);
    let mut patches = SkyPatches {
        centres: Vec::new(),
        solid_angles: Vec::new(),
    };
    let sin = |degrees: f64| sin_cos_degrees(degrees).0;
    for row in 0..7 * parts {
        let count = TREGENZA[(row / parts) as usize] * parts;
        let [bottom, middle, top] = [0.0, 0.5, 1.0].map(|part| height * (f64::from(row) + part));
        let solid_angle = std::f64::consts::TAU * (sin(top) - sin(bottom)) / f64::from(count);
        for index in 0..count {
            let azimuth = 360.0 * f64::from(index) / f64::from(count);
            patches.push(azimuth, middle, solid_angle);
        }
    }
    let cap = std::f64::consts::TAU * (1.0 - sin(90.0 - 0.5 * height));
    patches.push(0.0, 90.0, cap);
    patches
}

/// Patches of equal solid angle along a spiral by the golden angle.
fn spiral(count: u32) -> SkyPatches {
    let golden = 180.0 * (3.0 - 5.0_f64.sqrt());
    let solid_angle = std::f64::consts::TAU / f64::from(count);
    let centre = |index: u32| {
        let z = (f64::from(index) + 0.5) / f64::from(count);
        let r = (1.0 - z * z).sqrt();
        let (sin, cos) = sin_cos_degrees(f64::from(index) * golden);
        [r * sin, r * cos, z]
    };
    SkyPatches {
        centres: (0..count).map(centre).collect(),
        solid_angles: vec![solid_angle; count as usize],
    }
}

impl SkyPatches {
    fn push(&mut self, azimuth: f64, elevation: f64, solid_angle: f64) {
        let centre = Orientation::default().direction(azimuth, elevation);
        self.centres.push(centre);
        self.solid_angles.push(solid_angle);
    }

    /// Number of patches.
    pub fn len(&self) -> usize {
        self.centres.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.centres.is_empty()
    }

    /// Centres as directions in a scene, `[n, 3]`: what [`sees_directions`](crate::sees_directions) takes.
    pub fn directions(&self, orientation: &Orientation) -> Vec<[f32; 3]> {
        let scene = |&centre: &[f64; 3]| orientation.scene(centre).map(|x| x as f32);
        self.centres.iter().map(scene).collect()
    }

    /// Light that a surface with this normal of length 1 (in terms of east, north and up) receives from each patch of an even
    /// sky: solid angle times the cosine of the angle to the normal, 0 below the plane of the surface.
    pub fn cosine_weights(&self, normal: [f64; 3]) -> Vec<f64> {
        let weight = |(centre, solid_angle): (&[f64; 3], &f64)| {
            let cosine = dot(*centre, normal);
            solid_angle * if cosine > 0.0 { cosine } else { 0.0 }
        };
        self.centres
            .iter()
            .zip(&self.solid_angles)
            .map(weight)
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_are_as_many_as_published_and_fill_the_sky() {
        let divisions = [
            (SkyDivision::Tregenza, 145),
            (SkyDivision::Reinhart(1), 145),
            (SkyDivision::Reinhart(2), 577),
            (SkyDivision::Reinhart(4), 2305),
            (SkyDivision::Uniform(1), 1),
            (SkyDivision::Uniform(1000), 1000),
        ];
        for (division, count) in divisions {
            let patches = division.patches().expect("patches");
            assert_eq!(patches.len(), count);
            let all: f64 = patches.solid_angles.iter().sum();
            assert!((all - std::f64::consts::TAU).abs() < 1e-12, "{all}");
            for centre in &patches.centres {
                assert!((dot(*centre, *centre) - 1.0).abs() < 1e-12);
                assert!(centre[2] > 0.0);
            }
            if count < 100 {
                continue;
            }
            // An even sky of radiance 1 lights the ground with π, and a wall with half of it.
            let light = |normal| patches.cosine_weights(normal).iter().sum::<f64>();
            let ground = light([0.0, 0.0, 1.0]) / std::f64::consts::PI;
            assert!((ground - 1.0).abs() < 0.01, "{division:?} {ground}");
            let wall = light([0.6, 0.8, 0.0]) / std::f64::consts::PI;
            assert!((wall - 0.5).abs() < 0.01, "{division:?} {wall}");
        }
        for bad in [
            SkyDivision::Reinhart(0),
            SkyDivision::Reinhart(99),
            SkyDivision::Uniform(0),
        ] {
            assert!(bad.patches().is_err());
        }
    }

    #[test]
    fn rows_of_tregenza_are_where_he_puts_them() {
        let patches = SkyDivision::Tregenza.patches().expect("patches");
        let elevation = |index: usize| patches.centres[index][2].asin().to_degrees();
        for (index, expected) in [(0, 6.0), (29, 6.0), (30, 18.0), (60, 30.0), (144, 90.0)] {
            assert!((elevation(index) - expected).abs() < 1e-9, "{index}");
        }
        // The first patch is centred at north, the next one lies to the east of it.
        assert_eq!(patches.centres[0][0], 0.0);
        assert!(patches.centres[1][0] > 0.0 && patches.centres[1][1] > 0.0);
    }
}
