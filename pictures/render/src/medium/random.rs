//! As many random numbers as a walk needs, which nobody knows before.

use crate::sampler::mix;

/// Independent random numbers from a seed (SplitMix64: Steele, Lea and Flood 2014).
#[derive(Clone, Copy, Debug)]
pub struct Random {
    state: u64,
}

impl Random {
    /// Numbers of this seed.
    pub fn new(seed: u64) -> Self {
        Self { state: mix(seed) }
    }

    /// Next number in `[0, 1)`.
    #[inline]
    pub fn next(&mut self) -> f32 {
        let bits = mix(self.state);
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        (bits >> 40) as f32 * (1.0 / 16_777_216.0)
    }

    /// Goes on to other numbers, so that a copy and the original differ.
    #[inline]
    pub fn skip(&mut self) {
        self.state = mix(self.state);
    }

    /// Next pair of numbers in `[0, 1)²`.
    #[inline]
    pub fn pair(&mut self) -> [f32; 2] {
        [self.next(), self.next()]
    }
}
