//! The sky over models without lights of their own: brighter at the horizon, blue above, and a duller ground below.
//!
//! With `h` as the sine of the elevation, the radiance is
//!
//! - above: `ZENITH + (HORIZON - ZENITH) (1 - h)⁴`
//! - below: `GROUND + (HAZE - GROUND) (1 + h)¹⁶`
//!
//! The formula is an image of one column, so lights treat it as any other image of a sky.

use std::sync::Arc;

use antumbra_scene::{Image, Pixels, Rgb};

const ZENITH: Rgb = Rgb::new(0.17, 0.29, 0.50);
const HORIZON: Rgb = Rgb::new(0.66, 0.71, 0.76);
/// About the radiance of [`crate::set_ground`]'s plane under this sky and its sun.
const GROUND: Rgb = Rgb::new(0.30, 0.30, 0.30);
/// Ground at the horizon. Darker than the sky there, so that the horizon is a line.
const HAZE: Rgb = Rgb::new(0.42, 0.43, 0.44);
/// Rows from the zenith to the nadir. Images begin again beyond an edge, so half a row at the poles is a mixture of both.
const ROWS: u32 = 1024;

/// Radiance by the sine of the elevation.
fn radiance(h: f32) -> Rgb {
    if h >= 0.0 {
        ZENITH + (HORIZON - ZENITH) * (1.0 - h).powi(4)
    } else {
        GROUND + (HAZE - GROUND) * (1.0 + h).powi(16)
    }
}

/// The sky as an image by longitude and latitude.
pub(crate) fn image() -> Arc<Image> {
    let row = |row: u32| {
        let polar = (row as f32 + 0.5) * std::f32::consts::PI / ROWS as f32;
        radiance(libm::cosf(polar)).into()
    };
    Arc::new(Image {
        name: "clear sky".into(),
        width: 1,
        height: ROWS,
        pixels: Pixels::Rgb32((0..ROWS).map(row).collect()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn luminance(color: Rgb) -> f32 {
        color.dot(Rgb::new(0.2126, 0.7152, 0.0722))
    }

    #[test]
    fn the_sky_is_bright_at_the_horizon_blue_above_and_dull_below() {
        let image = image();
        let Pixels::Rgb32(rows) = &image.pixels else {
            panic!("no floats");
        };
        let rows: Vec<Rgb> = rows.iter().map(|&row| row.into()).collect();
        let (above, below) = rows.split_at(ROWS as usize / 2);
        assert!(above.is_sorted_by_key(|&row| luminance(row)));
        assert!(below.is_sorted_by_key(|&row| -luminance(row)));
        assert!(luminance(above[above.len() - 1]) > 1.3 * luminance(below[0]));
        let [zenith, horizon, nadir] = [rows[0], above[above.len() - 1], below[below.len() - 1]];
        assert!(
            zenith.z > 2.0 * zenith.x && horizon.z < 1.2 * horizon.x,
            "{zenith} {horizon}"
        );
        assert!((nadir - GROUND).length() < 1e-3);
    }
}
