//! Turbo, the colour map of heat maps.
//!
//! Turbo (Anton Mikhailov, "Turbo, An Improved Rainbow Colormap for Visualization", Google AI Blog, 2019) runs from
//! dark blue over green and yellow to dark red. Lightness rises, then falls, without false edges. Colours come from
//! the fifth-degree polynomials that the author published beside the table. The polynomials deviate from the table by
//! a few percent, and by up to an eighth at the two dark ends.

/// Coefficients of red, green and blue. The index is the power of `t`.
const COEFFICIENTS: [[f32; 6]; 3] = [
    [
        0.135_721_38,
        4.615_392_6,
        -42.660_32,
        132.131_08,
        -152.942_4,
        59.286_38,
    ],
    [
        0.091_402_61,
        2.194_188_4,
        4.842_966_6,
        -14.185_033,
        4.277_298_6,
        2.829_566,
    ],
    [
        0.106_673_3,
        12.641_946,
        -60.582_05,
        110.362_77,
        -89.903_11,
        27.348_25,
    ],
];

/// sRGB colour at `t`: 0 is the cold end, 1 the hot end. Values outside are clamped.
///
/// NaN is mid-grey, which the map does not contain.
pub(crate) fn turbo(t: f32) -> [u8; 3] {
    if t.is_nan() {
        return [128; 3];
    }
    let t = t.clamp(0.0, 1.0);
    COEFFICIENTS.map(|channel| {
        let value = channel.iter().rev().fold(0.0, |sum, c| sum * t + c);
        // The cast saturates, as the slightly negative blue of the hot end needs.
        (value * 255.0).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest difference between two colours in a channel.
    fn distance(a: [u8; 3], b: [u8; 3]) -> u8 {
        (0..3).map(|i| a[i].abs_diff(b[i])).max().unwrap()
    }

    #[test]
    fn ends() {
        assert_eq!(turbo(0.0), [35, 23, 27]);
        assert_eq!(turbo(1.0), [144, 13, 0]);
        assert_eq!(turbo(-3.0), turbo(0.0));
        assert_eq!(turbo(7.0), turbo(1.0));
        assert_eq!(turbo(f32::INFINITY), turbo(1.0));
        assert_eq!(turbo(f32::NEG_INFINITY), turbo(0.0));
        assert_eq!(turbo(f32::NAN), [128; 3]);
    }

    #[test]
    fn cold_is_blue_middle_green_hot_red() {
        let [r, g, b] = turbo(0.15);
        assert!(b > g && g > r);
        let [r, g, b] = turbo(0.5);
        assert!(g > r && g > b);
        let [r, g, b] = turbo(0.9);
        assert!(r > g && g > b);
    }

    #[test]
    fn smooth_and_never_grey() {
        for i in 0..=1000 {
            let colour = turbo(i as f32 / 1000.0);
            assert!(distance(colour, turbo((i + 1) as f32 / 1000.0)) <= 4, "{i}");
            assert!(distance(colour, turbo(f32::NAN)) >= 50, "{i}");
        }
    }
}
