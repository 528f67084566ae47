//! The palette of all maps: viridis, from dark violet over green to light yellow.
//!
//! Viridis (Stéfan van der Walt, Nathaniel Smith and Eric Firing, 2015, made for matplotlib and released as CC0) rises evenly
//! in lightness. It therefore reads the same in grey print and with all common kinds of colour blindness.

/// Every fifth of the 256 published colours, as 0xRRGGBB. Between them, colours are interpolated. They deviate from the
/// published ones by 1 in a channel of 8 bits at most.
const COLOURS: [u32; 52] = [
    0x440154, 0x46085c, 0x471063, 0x481769, 0x481d6f, 0x482475, 0x472a7a, 0x46307e, 0x453781,
    0x433d84, 0x414287, 0x3f4889, 0x3d4e8a, 0x3a538b, 0x38598c, 0x355e8d, 0x33638d, 0x31688e,
    0x2e6d8e, 0x2c718e, 0x2a768e, 0x297b8e, 0x27808e, 0x25848e, 0x23898e, 0x218e8d, 0x20928c,
    0x1f978b, 0x1e9c89, 0x1fa188, 0x21a585, 0x24aa83, 0x28ae80, 0x2eb37c, 0x35b779, 0x3dbc74,
    0x46c06f, 0x50c46a, 0x5ac864, 0x65cb5e, 0x70cf57, 0x7cd250, 0x89d548, 0x95d840, 0xa2da37,
    0xb0dd2f, 0xbddf26, 0xcae11f, 0xd8e219, 0xe5e419, 0xf1e51d, 0xfde725,
];

/// Colour of NaN: a middle grey, which the palette does not contain.
pub const NO_VALUE: [u8; 3] = [128; 3];

/// sRGB colour at `t`: 0 is the dark end, 1 the light end. Values outside, and infinities, get the colour of their end.
/// NaN is [`NO_VALUE`].
///
/// # Example
///
/// ```
/// use antumbra_image::palette;
///
/// assert_eq!(palette::colour(0.0), [68, 1, 84]);
/// assert_eq!(palette::colour(1.0), [253, 231, 37]);
/// assert_eq!(palette::colour(f32::NAN), palette::NO_VALUE);
/// ```
pub fn colour(t: f32) -> [u8; 3] {
    if t.is_nan() {
        return NO_VALUE;
    }
    let last = COLOURS.len() - 1;
    let place = t.clamp(0.0, 1.0) * last as f32;
    let index = (place as usize).min(last - 1);
    let share = place - index as f32;
    [16, 8, 0].map(|shift| {
        let [a, b] = [COLOURS[index], COLOURS[index + 1]].map(|c| (c >> shift & 0xff) as f32);
        (a + (b - a) * share).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_and_what_lies_beyond() {
        assert_eq!(colour(-3.0), colour(0.0));
        assert_eq!(colour(7.0), colour(1.0));
        assert_eq!(colour(f32::INFINITY), colour(1.0));
        assert_eq!(colour(f32::NEG_INFINITY), colour(0.0));
    }

    #[test]
    fn colours_are_the_published_ones() {
        let published = [
            (0, [68, 1, 84]),
            (64, [59, 82, 139]),
            (128, [33, 145, 140]),
            (192, [94, 201, 98]),
            (255, [253, 231, 37]),
        ];
        for (index, wanted) in published {
            let found = colour(index as f32 / 255.0);
            let apart = (0..3).map(|i| found[i].abs_diff(wanted[i])).max();
            assert!(apart <= Some(1), "{index}: {found:?}, not {wanted:?}");
        }
    }

    /// Relative luminance (IEC 61966-2-1).
    fn luminance(colour: [u8; 3]) -> f64 {
        let linear = |x: u8| f64::from(crate::rgb8::linear(f32::from(x) / 255.0));
        let [r, g, b] = colour.map(linear);
        0.2126 * r + 0.7152 * g + 0.0722 * b
    }

    #[test]
    fn lightness_rises_everywhere() {
        for i in 0..64 {
            let [a, b] = [i, i + 1].map(|i| luminance(colour(i as f32 / 64.0)));
            assert!(b > a, "{i}: {a} to {b}");
        }
    }
}
