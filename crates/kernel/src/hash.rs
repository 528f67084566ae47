//! Numbers that look random, made from numbers that do not: the same bits everywhere.

use crate::ray::Ray;

/// Growth of a state from one number to the next: 2⁶⁴ over the golden ratio, made odd.
pub(crate) const STEP: u64 = 0x9e37_79b9_7f4a_7c15;

/// A mix of the bits of `z`, each of which changes every bit of the result: the output function of SplitMix64 (Steele, Lea and Flood
/// 2014).
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
