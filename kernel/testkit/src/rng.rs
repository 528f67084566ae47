//! Small random number generator for tests.

/// Random number generator SplitMix64 (Steele, Lea and Flood 2014), with equal numbers on every machine.
#[derive(Clone, Debug)]
pub struct Rng(u64);

impl Rng {
    /// Makes a generator whose sequence depends only on `seed`.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Uniform 64-bit integer.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform integer below `end`, which must not be 0.
    pub fn below(&mut self, end: usize) -> usize {
        ((u128::from(self.bits()) * end as u128) >> 64) as usize
    }

    /// Uniform number in `[0, 1)`.
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u32 << 24) as f32
    }

    /// Uniform number in `[from, to)`.
    pub fn range(&mut self, from: f32, to: f32) -> f32 {
        from + (to - from) * self.unit()
    }

    /// Uniform point in the cube of half-width `half` around 0.
    pub fn point(&mut self, half: f32) -> [f32; 3] {
        core::array::from_fn(|_| self.range(-half, half))
    }

    /// Vector of length about 1 in a uniform direction.
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
