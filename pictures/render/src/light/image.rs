//! Images as lights read them.
//!
//! As in pbrt-v3, images are interpolated bilinearly between the centres of texels, and begin again beyond an edge.
//! Values are used as the file has them, linear or not. 8-bit values are fractions of 255. (pbrt first enlarges
//! images to powers of two. Here they keep their size.)

use std::f32::consts::{FRAC_1_PI, PI, TAU};

use antumbra_scene::{Image, Pixels};
use glam::Vec3;

/// Colour of a texel. Black outside the image.
#[inline]
pub fn texel(image: &Image, x: u32, y: u32) -> Vec3 {
    let index = y as usize * image.width as usize + x as usize;
    let byte = |value: u8| f32::from(value) * (1.0 / 255.0);
    let found = match &image.pixels {
        Pixels::Grey8(values) => values.get(index).map(|&grey| Vec3::splat(byte(grey))),
        Pixels::Rgb8(values) => values.get(index).map(|&rgb| Vec3::from(rgb.map(byte))),
        Pixels::Rgb32(values) => values.get(index).map(|&rgb| Vec3::from(rgb)),
    };
    found.unwrap_or(Vec3::ZERO)
}

/// Colour at a point. (0, 0) is the outer corner of the first texel, (1, 1) of the last.
#[inline]
pub fn lookup(image: &Image, [s, t]: [f32; 2]) -> Vec3 {
    let (columns, x) = neighbours(s, image.width);
    let (rows, y) = neighbours(t, image.height);
    let [upper, lower] = rows.map(|row| {
        let [left, right] = columns.map(|column| texel(image, column, row));
        left * (1.0 - x) + right * x
    });
    upper * (1.0 - y) + lower * y
}

/// Two of `count` texels, between whose centres `place` in [0, 1] lies, and the share of the second.
#[inline]
fn neighbours(place: f32, count: u32) -> ([u32; 2], f32) {
    let scaled = place * count as f32 - 0.5;
    let floor = scaled.floor();
    let last = count.saturating_sub(1);
    // NaN becomes 0.
    let first = floor as i64;
    let wrap = |index: i64| {
        if index < 0 {
            last
        } else if index > i64::from(last) {
            0
        } else {
            index as u32
        }
    };
    ([wrap(first), wrap(first + 1)], scaled - floor)
}

/// Place of a direction of any length in an image by longitude and latitude: (azimuth over 2π, polar angle over π).
/// The pole is z.
#[inline]
pub fn longitude_latitude(w: Vec3) -> [f32; 2] {
    let azimuth = libm::atan2f(w.y, w.x) * (0.5 * FRAC_1_PI);
    let azimuth = if azimuth < 0.0 {
        azimuth + 1.0
    } else {
        azimuth
    };
    // Exact at the poles, too, unlike the arc cosine.
    let polar = libm::atan2f(w.truncate().length(), w.z) * FRAC_1_PI;
    [azimuth, polar]
}

/// Solid angle of a texel of row `row` of an image by longitude and latitude.
pub fn texel_solid_angle(image: &Image, row: u32) -> f64 {
    let edge = |row: u32| libm::cos(f64::from(row) * f64::from(PI) / f64::from(image.height));
    (edge(row) - edge(row + 1)) * f64::from(TAU) / f64::from(image.width)
}
