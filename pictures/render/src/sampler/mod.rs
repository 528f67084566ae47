//! Random numbers without state: every value is a function of seed, pixel, sample and dimension.
//!
//! A value depends neither on the thread nor on the order of queries, so a picture is the same for any number of
//! threads. Every sampler of pbrt-v3 has a generator with the stratification of pbrt's own:
//!
//! | in the scene | generator | stratified, in every pixel |
//! |---|---|---|
//! | `random` | [`Method::Independent`] | nothing |
//! | `stratified` | [`Method::Stratified`]: `stratified.rs` | every dimension, every pair in a grid |
//! | `02sequence`, `lowdiscrepancy` | [`Method::OwenSobol`]: `owen.rs` | every dimension, every pair in all elementary intervals |
//! | `maxmindist` | [`Method::MaxMinDist`]: `max_min_dist.rs` | as `02sequence`, but on the film as far apart as can be |
//! | `halton` | [`Method::Halton`]: `halton.rs` | many dimensions together, best the first ones |
//! | `sobol` | [`Method::Sobol`]: `sobol.rs` | many dimensions together |
//!
//! An integrator uses a *pair* of dimensions for one purpose. Pairs beyond the tables of `halton` and `sobol` come
//! from `02sequence`. `warp.rs` turns pairs into points of disks, spheres and triangles.
//! `block.rs` makes the values of many samples at once.

mod block;
mod halton;
mod max_min_dist;
mod owen;
mod sobol;
mod stratified;
pub mod warp;

use antumbra_scene::SamplerKind;

pub use block::StreamBlock;
pub use stratified::Grid;

/// Generator of random values. [`Method::of`] returns the generator of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Independent uniform values.
    Independent,
    /// Jittered grids, shuffled independently for every pair of dimensions.
    Stratified(Grid),
    /// The (0, 2)-sequence of the first two Sobol' dimensions, shuffled and Owen-scrambled independently for every pair
    /// of dimensions by hashing (Burley 2020, *Practical Hash-based Owen Scrambling*).
    OwenSobol,
    /// Points of maximal distance on the film, randomly shifted. Other dimensions as [`Method::OwenSobol`].
    MaxMinDist {
        /// Binary logarithm of the number of points.
        log2_points: u32,
    },
    /// The Halton sequence with nested digit permutations.
    Halton,
    /// The Sobol' sequence, Owen-scrambled.
    Sobol,
}

impl Method {
    /// Generator for a scene's sampler and `samples` per pixel.
    pub fn of(kind: SamplerKind, samples: u32) -> Self {
        match kind {
            SamplerKind::Random => Self::Independent,
            SamplerKind::Stratified { x, y, jitter } => Self::Stratified(Grid {
                cells: [x.max(1), y.max(1)],
                jitter,
            }),
            SamplerKind::ZeroTwoSequence => Self::OwenSobol,
            SamplerKind::MaxMinDist => Self::MaxMinDist {
                log2_points: max_min_dist::log2_points(samples),
            },
            SamplerKind::Halton => Self::Halton,
            SamplerKind::Sobol => Self::Sobol,
        }
    }

    /// Name in results.
    pub fn name(self) -> &'static str {
        match self {
            Self::Independent => "random",
            Self::Stratified(_) => "stratified",
            Self::OwenSobol => "owen-sobol",
            Self::MaxMinDist { .. } => "maxmindist",
            Self::Halton => "halton",
            Self::Sobol => "sobol",
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
    /// A sampler. Equal seeds give equal values.
    pub fn new(method: Method, seed: u64) -> Self {
        Self {
            method,
            seed: mix(seed ^ 0x5bd1_e995_97f4_a7c5),
        }
    }

    /// Values of sample `index` of pixel (x, y).
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
    #[inline(always)]
    pub fn uniform(&self, dimension: u32) -> f32 {
        match self.method {
            Method::Independent => self.pair(dimension)[0],
            _ => self.even(dimension),
        }
    }

    /// A seed of other random values, which differs by sample and dimension.
    pub fn seed(&self, dimension: u32) -> u64 {
        mix(self.key_of(dimension) ^ u64::from(self.index))
    }

    /// A point in `[0, 1)²`.
    #[inline(always)]
    pub fn pair(&self, dimension: u32) -> [f32; 2] {
        self.pair_of(dimension, 0, 1)
    }

    /// Point `part` of the `parts` that this sample takes in one dimension.
    ///
    /// The parts of all samples of a pixel form one sequence, so they are stratified together.
    #[inline(always)]
    pub fn pair_of(&self, dimension: u32, part: u32, parts: u32) -> [f32; 2] {
        let index = u64::from(self.index) * u64::from(parts) + u64::from(part);
        match self.method {
            // Inlined, since the code is hardly longer than a call.
            Method::Independent => {
                let bits = mix(self.key_of(dimension) ^ index);
                [unit(bits as u32), unit((bits >> 32) as u32)]
            }
            _ => self.even_pair(dimension, part, parts, index as u32),
        }
    }

    /// Value of a stratified method.
    fn even(&self, dimension: u32) -> f32 {
        match self.method {
            Method::Stratified(grid) => grid.single(self.index, self.key_of(dimension)),
            Method::OwenSobol => owen::single(self.index, self.key_of(dimension)),
            _ => self.even_pair(dimension, 0, 1, self.index)[0],
        }
    }

    /// Point of a stratified method.
    fn even_pair(&self, dimension: u32, part: u32, parts: u32, index: u32) -> [f32; 2] {
        match self.method {
            Method::Stratified(grid) if parts == 1 => grid.pair(self.index, self.key_of(dimension)),
            Method::Stratified(grid) => grid.part(self.index, part, parts, self.key_of(dimension)),
            Method::MaxMinDist { log2_points } if dimension == 0 => {
                max_min_dist::point(index, log2_points, self.key_of(dimension))
            }
            Method::Halton if dimension < halton::PAIRS => halton::pair(index, dimension, self.key),
            Method::Sobol if dimension < sobol::PAIRS => sobol::pair(index, dimension, self.key),
            _ => owen::pair(index, self.key_of(dimension)),
        }
    }

    #[inline]
    fn key_of(&self, dimension: u32) -> u64 {
        mix(self.key ^ u64::from(dimension))
    }
}

/// Fraction of the 24 high bits, always below 1.
#[inline]
fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// A value in [0, 1) that rounding might make 1.
#[inline]
fn below_one(value: f64) -> f32 {
    (value as f32).min(1.0 - f32::EPSILON * 0.5)
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

#[cfg(test)]
mod tests;
