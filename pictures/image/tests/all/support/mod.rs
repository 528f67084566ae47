//! Seeded random numbers and special values for several test files.

use antumbra_image::{Image, Window};

/// SplitMix64 (Steele, Lea and Flood 2014).
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform number in 0..1, never 0.
    pub fn uniform(&mut self) -> f64 {
        ((self.bits() >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }

    /// Uniform integer in 0..end.
    pub fn below(&mut self, end: usize) -> usize {
        (self.bits() % end as u64) as usize
    }

    /// Standard normal number (Box and Muller 1958).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * self.uniform().ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }

    /// Special value such as NaN, infinity or a subnormal, or any bit pattern.
    pub fn hostile(&mut self) -> f32 {
        const SEEDS: [f32; 14] = [
            0.0,
            -0.0,
            1.0,
            -1.0,
            1e-45,
            -1e-45,
            f32::MIN_POSITIVE,
            f32::MAX,
            f32::MIN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::NAN,
            65_505.0,
            0.1,
        ];
        let any = f32::from_bits(self.bits() as u32);
        SEEDS
            .get(self.below(2 * SEEDS.len()))
            .copied()
            .unwrap_or(any)
    }
}

/// Image of a whole picture, filled by pixel.
pub fn image(width: usize, height: usize, pixel: impl FnMut(i32, i32) -> [f32; 3]) -> Image {
    Image::from_fn(width, height, Window::full(width, height), pixel).unwrap()
}

/// Asserts equal bits, so that NaN equals NaN and -0 differs from 0.
pub fn assert_same_bits(a: &Image, b: &Image) {
    let parts = |image: &Image| (image.width(), image.height(), image.window());
    assert_eq!(parts(a), parts(b));
    let bits = |image: &Image| -> Vec<[u32; 3]> {
        let pixels = image.pixels().iter();
        pixels.map(|pixel| pixel.map(f32::to_bits)).collect()
    };
    assert!(bits(a) == bits(b), "pixels differ");
}
