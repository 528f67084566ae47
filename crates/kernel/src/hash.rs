//! Numbers that look random, made from numbers that do not: the same bits everywhere.

/// What a state grows by from one number to the next: 2⁶⁴ over the golden ratio, made odd.
pub(crate) const STEP: u64 = 0x9e37_79b9_7f4a_7c15;

/// Every bit of the result depends on every bit of `z`: the output function of SplitMix64 (Steele, Lea and Flood
/// 2014).
#[inline(always)]
pub(crate) fn mixed(z: u64) -> u64 {
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
