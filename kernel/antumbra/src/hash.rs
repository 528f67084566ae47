//! Numbers that look random, made from numbers that do not: the same bits everywhere.

use crate::math;
use crate::ray::Ray;

/// Growth of a state from one number to the next: 2⁶⁴ over the golden ratio, made odd.
pub(crate) const STEP: u64 = 0x9e37_79b9_7f4a_7c15;

/// A mix of the bits of `z`, each of which changes every bit of the result: the output function of SplitMix64 (Steele,
/// Lea and Flood 2014).
#[inline(always)]
pub(crate) fn mixed(z: u64) -> u64 {
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Hash of the origin and the direction of a ray.
#[inline(always)]
pub(crate) fn of_ray(seed: u64, ray: &Ray) -> u64 {
    let mut state = seed;
    for x in ray.org.iter().chain(&ray.dir) {
        state = mixed((state ^ u64::from(x.to_bits())).wrapping_add(STEP));
    }
    state
}

/// SplitMix64 (Steele, Lea and Flood 2014).
pub struct Random(u64);

impl Random {
    /// The numbers of one ray.
    pub fn new(seed: u64, index: usize) -> Self {
        Self(Self(seed ^ Self(index as u64).bits()).bits())
    }

    /// The next number.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(STEP);
        mixed(self.0)
    }

    /// A number in `[0, 1)`.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A point on the unit sphere, none preferred.
    pub fn direction(&mut self) -> [f64; 3] {
        loop {
            // Rejection instead of sines: the same bits on every platform.
            let point: [f64; 3] = core::array::from_fn(|_| 2.0 * self.unit() - 1.0);
            let length2: f64 = point[0] * point[0] + point[1] * point[1] + point[2] * point[2];
            if length2 > 1e-6 && length2 <= 1.0 {
                let length = math::sqrt(length2);
                return point.map(|x| x / length);
            }
        }
    }
}
