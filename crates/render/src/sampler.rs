//! Random numbers without state: every value is a function of seed, pixel, sample and dimension.
//!
//! Nothing depends on who asks, when, or in what order; this is what makes a picture the same for any
//! number of threads and any schedule. Two generators share the interface:
//!
//! - [`Method::Independent`]: hashed, uncorrelated values (pbrt's `random`)
//! - [`Method::OwenSobol`]: the (0, 2)-sequence of the first two Sobol' dimensions, shuffled and
//!   Owen-scrambled anew for every dimension by hashing (Burley 2020, *Practical Hash-based Owen
//!   Scrambling*). Stratified in every dimension and every pair, hence less noise at equal cost.

use antumbra_scene::SamplerKind;

/// How samples are generated; which one a scene gets is [`Method::of`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Independent uniform values.
    Independent,
    /// Shuffled and Owen-scrambled (0, 2)-sequences.
    OwenSobol,
}

impl Method {
    /// The generator used for a scene's sampler: `random` is taken literally, every low-discrepancy kind
    /// of pbrt becomes [`Method::OwenSobol`].
    pub fn of(kind: SamplerKind) -> Self {
        match kind {
            SamplerKind::Random => Self::Independent,
            SamplerKind::Stratified
            | SamplerKind::Halton
            | SamplerKind::Sobol
            | SamplerKind::ZeroTwoSequence
            | SamplerKind::MaxMinDist => Self::OwenSobol,
        }
    }

    /// What people call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Independent => "independent",
            Self::OwenSobol => "owen-sobol",
        }
    }
}

/// Makes the [`Stream`] of every sample of every pixel.
#[derive(Clone, Copy, Debug)]
pub struct Sampler {
    method: Method,
    seed: u64,
}

impl Sampler {
    /// A sampler; equal seeds give equal values.
    pub fn new(method: Method, seed: u64) -> Self {
        Self {
            method,
            seed: mix(seed ^ 0x5bd1_e995_97f4_a7c5),
        }
    }

    /// The values of sample `index` of pixel (x, y).
    #[inline]
    pub fn stream(&self, x: i32, y: i32, index: u32) -> Stream {
        let pixel = u64::from(x as u32) | u64::from(y as u32) << 32;
        Stream {
            method: self.method,
            key: mix(self.seed ^ mix(pixel)),
            index,
        }
    }
}

/// All random values of one sample of one pixel, addressed by dimension.
#[derive(Clone, Copy, Debug)]
pub struct Stream {
    method: Method,
    key: u64,
    index: u32,
}

impl Stream {
    /// A value in `[0, 1)`.
    #[inline]
    pub fn uniform(&self, dimension: u32) -> f32 {
        self.pair(dimension)[0]
    }

    /// A point in `[0, 1)²`.
    #[inline]
    pub fn pair(&self, dimension: u32) -> [f32; 2] {
        self.pair_of(dimension, 0, 1)
    }

    /// Point `part` of the `parts` that this sample takes in one dimension.
    ///
    /// The parts of all samples of a pixel form one sequence, so they are stratified together.
    #[inline]
    pub fn pair_of(&self, dimension: u32, part: u32, parts: u32) -> [f32; 2] {
        let index = u64::from(self.index) * u64::from(parts) + u64::from(part);
        match self.method {
            Method::Independent => {
                let bits = mix(mix(self.key ^ u64::from(dimension)) ^ index);
                [unit(bits as u32), unit((bits >> 32) as u32)]
            }
            Method::OwenSobol => {
                let key = mix(self.key ^ u64::from(dimension));
                let scrambles = mix(key);
                let index = scramble(index as u32, key as u32);
                [
                    unit(scramble(index.reverse_bits(), scrambles as u32)),
                    unit(scramble(
                        second_sobol_dimension(index),
                        (scrambles >> 32) as u32,
                    )),
                ]
            }
        }
    }
}

/// The 24 high bits as a fraction, so that 1 is never reached.
#[inline]
fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// A bijection of 64 bits in which every output bit depends on every input bit (the finaliser of
/// SplitMix64: Steele, Lea and Flood 2014).
#[inline]
pub(crate) fn mix(value: u64) -> u64 {
    let mut bits = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}

/// Owen's nested uniform scramble of a 32-bit fraction: bit k is flipped depending on the bits above it.
///
/// On reversed bits this is any hash in which a bit is influenced by lower bits only (Laine and Karras
/// 2011); the multipliers are those of Burley 2020.
#[inline]
fn scramble(bits: u32, seed: u32) -> u32 {
    let mut x = bits.reverse_bits();
    x = x.wrapping_add(seed);
    for multiplier in [0x6c50_b47c_u32, 0xb82f_1e52, 0xc7af_e638, 0x8d22_f6e6] {
        x ^= x.wrapping_mul(multiplier);
    }
    x.reverse_bits()
}

/// The second Sobol' coordinate of `index`.
///
/// Its generator matrix is Pascal's triangle modulo 2, where `binomial(j, i)` is odd iff the bits of i
/// are among those of j (Lucas). The product with it is therefore a sum over supersets, done one bit of
/// the positions at a time.
#[inline]
fn second_sobol_dimension(index: u32) -> u32 {
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

    /// In every elementary interval of area 2^-k lies exactly one of 2^k points.
    #[test]
    fn owen_sobol_is_a_zero_two_sequence() {
        let sampler = Sampler::new(Method::OwenSobol, 7);
        for dimension in [0, 3, 1000] {
            for k in 0..=8_u32 {
                for columns in 0..=k {
                    let (across, down) = (1_u32 << columns, 1_u32 << (k - columns));
                    let mut seen = vec![0; 1 << k];
                    for index in 0..1_u32 << k {
                        let [x, y] = sampler.stream(5, -9, index).pair(dimension);
                        let cell = (y * down as f32) as u32 * across + (x * across as f32) as u32;
                        seen[cell as usize] += 1;
                    }
                    assert!(
                        seen.iter().all(|&n| n == 1),
                        "2^{k} points, {across} columns"
                    );
                }
            }
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

    #[test]
    fn parts_are_stratified_together() {
        let sampler = Sampler::new(Method::OwenSobol, 3);
        let mut seen = [0; 64];
        for index in 0..16 {
            for part in 0..4 {
                let [x, _] = sampler.stream(0, 0, index).pair_of(2, part, 4);
                seen[(x * 64.0) as usize] += 1;
            }
        }
        assert_eq!(seen, [1; 64]);
    }

    /// Moments and the correlation between neighbouring dimensions, samples, pixels and seeds.
    #[test]
    fn independent_values_look_independent() {
        let sampler = Sampler::new(Method::Independent, 1);
        let count = 20_000;
        let value = |i: u32, d: u32| f64::from(sampler.stream(i as i32 % 50, 3, i).uniform(d));
        let mean: f64 = (0..count).map(|i| value(i, 4)).sum::<f64>() / f64::from(count);
        assert!((mean - 0.5).abs() < 0.01, "mean {mean}");
        let other = Sampler::new(Method::Independent, 2);
        type Pair<'a> = (&'a str, Box<dyn Fn(u32) -> (f64, f64) + 'a>);
        let pairs: Vec<Pair> = vec![
            ("dimension", Box::new(|i| (value(i, 4), value(i, 5)))),
            ("sample", Box::new(|i| (value(i, 4), value(i + 1, 4)))),
            (
                "seed",
                Box::new(|i| {
                    let theirs = other.stream(i as i32 % 50, 3, i).uniform(4);
                    (value(i, 4), f64::from(theirs))
                }),
            ),
        ];
        for (what, pair) in pairs {
            let covariance: f64 = (0..count)
                .map(pair)
                .map(|(a, b)| (a - 0.5) * (b - 0.5))
                .sum::<f64>()
                / f64::from(count);
            assert!(covariance.abs() < 0.003, "{what}: {covariance}");
        }
    }

    #[test]
    fn every_value_is_below_one() {
        assert!(unit(u32::MAX) < 1.0);
        assert_eq!(unit(0), 0.0);
    }
}
