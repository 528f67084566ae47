//! A small random number generator.

/// SplitMix64 (Steele, Lea and Flood 2014): good enough for tests, the same everywhere.
#[derive(Clone, Debug)]
pub struct Rng(u64);

impl Rng {
    /// A generator whose whole sequence follows from `seed`.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A whole number below `end`, which is not 0.
    pub fn below(&mut self, end: usize) -> usize {
        ((u128::from(self.bits()) * end as u128) >> 64) as usize
    }

    /// A number in `[0, 1)`.
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u32 << 24) as f32
    }

    /// A number in `[from, to)`.
    pub fn range(&mut self, from: f32, to: f32) -> f32 {
        from + (to - from) * self.unit()
    }

    /// A point in the cube of this half-width around 0.
    pub fn point(&mut self, half: f32) -> [f32; 3] {
        core::array::from_fn(|_| self.range(-half, half))
    }

    /// A vector of length about 1 in a direction without preference.
    pub fn direction(&mut self) -> [f32; 3] {
        loop {
            let point = self.point(1.0);
            let length = point.iter().map(|x| x * x).sum::<f32>().sqrt();
            if length > 0.1 && length <= 1.0 {
                return point.map(|x| x / length);
            }
        }
    }
}
