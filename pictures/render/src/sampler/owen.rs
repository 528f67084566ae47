//! Owen scrambling by hashing, and the (0, 2)-sequence.

use super::{mix, unit};

/// Point `index` of a (0, 2)-sequence, the first two Sobol' dimensions, shuffled and scrambled by `key`.
#[inline]
pub fn pair(index: u32, key: u64) -> [f32; 2] {
    let scrambles = mix(key);
    let index = scramble(index, key as u32);
    [
        unit(scramble(index.reverse_bits(), scrambles as u32)),
        unit(scramble(
            second_sobol_dimension(index),
            (scrambles >> 32) as u32,
        )),
    ]
}

/// First coordinate of [`pair`].
#[inline]
pub fn single(index: u32, key: u64) -> f32 {
    let index = scramble(index, key as u32);
    unit(scramble(index.reverse_bits(), mix(key) as u32))
}

/// Owen's nested uniform scramble of a 32-bit fraction: bit k is flipped depending on the bits above it.
///
/// On reversed bits, any hash serves in which only lower bits influence a bit (Laine and Karras 2011). The
/// multipliers are from Burley 2020.
#[inline]
pub fn scramble(bits: u32, seed: u32) -> u32 {
    let mut x = bits.reverse_bits();
    x = x.wrapping_add(seed);
    for multiplier in [0x6c50_b47c_u32, 0xb82f_1e52, 0xc7af_e638, 0x8d22_f6e6] {
        x ^= x.wrapping_mul(multiplier);
    }
    x.reverse_bits()
}

/// Second Sobol' coordinate of `index`.
///
/// The generator matrix is Pascal's triangle modulo 2, where `binomial(j, i)` is odd iff the bits of i are among the
/// bits of j (Lucas). The product with the matrix is therefore a sum over supersets, done one bit of the positions at
/// a time.
#[inline]
pub fn second_sobol_dimension(index: u32) -> u32 {
    let mut digits = index;
    for (shift, low) in [
        (1, 0x5555_5555_u32),
        (2, 0x3333_3333),
        (4, 0x0f0f_0f0f),
        (8, 0x00ff_00ff),
        (16, 0x0000_ffff),
    ] {
        digits ^= (digits >> shift) & low;
    }
    digits.reverse_bits()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_single_value_is_the_first_of_the_pair() {
        for index in 0..1000 {
            let key = mix(u64::from(index));
            assert_eq!(single(index, key), pair(index, key)[0]);
        }
    }

    #[test]
    fn the_second_dimension_agrees_with_its_direction_numbers() {
        for index in (0..100_000_u32).chain([u32::MAX, 1 << 31]) {
            let (mut direction, mut sum, mut rest) = (1_u32 << 31, 0, index);
            while rest != 0 {
                if rest & 1 == 1 {
                    sum ^= direction;
                }
                direction ^= direction >> 1;
                rest >>= 1;
            }
            assert_eq!(second_sobol_dimension(index), sum, "index {index}");
        }
    }
}
