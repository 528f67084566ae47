//! Random values of many samples at once, in columns.

use antumbra_simd::Isa;

use super::{Method, Stream, mix, owen, unit};
use crate::columns::{BLOCK, Column, Stage, run};

/// Streams of a block of samples, all by one method.
#[derive(Clone, Debug)]
pub struct StreamBlock {
    method: Method,
    key: [u64; BLOCK],
    index: [u32; BLOCK],
}

impl Default for StreamBlock {
    fn default() -> Self {
        Self {
            method: Method::Independent,
            key: [0; BLOCK],
            index: [0; BLOCK],
        }
    }
}

impl StreamBlock {
    /// Sets the stream of a lane.
    #[inline]
    pub fn set(&mut self, lane: usize, stream: &Stream) {
        self.method = stream.method;
        self.key[lane] = stream.key;
        self.index[lane] = stream.index;
    }

    /// The stream of a lane.
    #[inline]
    fn stream(&self, lane: usize) -> Stream {
        Stream {
            method: self.method,
            key: self.key[lane],
            index: self.index[lane],
        }
    }

    /// [`Stream::pair`] of every lane. The first of a pair is [`Stream::uniform`].
    pub fn pairs(&self, isa: Isa, dimension: u32, out: &mut [Column; 2]) {
        match self.method {
            Method::Independent => {
                let streams = self;
                run(isa, Independent { streams, dimension }, out);
            }
            Method::OwenSobol => {
                let streams = self;
                run(isa, OwenSobol { streams, dimension }, out);
            }
            _ => {
                for lane in 0..BLOCK {
                    [out[0][lane], out[1][lane]] = self.stream(lane).pair(dimension);
                }
            }
        }
    }

    /// [`Stream::uniform`] of every lane.
    pub fn uniforms(&self, isa: Isa, dimension: u32, out: &mut [Column; 2]) {
        match self.method {
            Method::Independent | Method::OwenSobol => self.pairs(isa, dimension, out),
            _ => {
                for lane in 0..BLOCK {
                    out[0][lane] = self.stream(lane).uniform(dimension);
                }
            }
        }
    }
}

struct Independent<'a> {
    streams: &'a StreamBlock,
    dimension: u32,
}

impl Stage for Independent<'_> {
    type Out = [Column; 2];

    #[inline(always)]
    fn run(self, [x, y]: &mut [Column; 2]) {
        let StreamBlock { key, index, .. } = self.streams;
        for lane in 0..BLOCK {
            let key = mix(key[lane] ^ u64::from(self.dimension));
            let bits = mix(key ^ u64::from(index[lane]));
            x[lane] = unit(bits as u32);
            y[lane] = unit((bits >> 32) as u32);
        }
    }
}

struct OwenSobol<'a> {
    streams: &'a StreamBlock,
    dimension: u32,
}

impl Stage for OwenSobol<'_> {
    type Out = [Column; 2];

    #[inline(always)]
    fn run(self, [x, y]: &mut [Column; 2]) {
        let StreamBlock { key, index, .. } = self.streams;
        for lane in 0..BLOCK {
            let key = mix(key[lane] ^ u64::from(self.dimension));
            [x[lane], y[lane]] = owen::pair(index[lane], key);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::{Grid, Sampler};

    #[test]
    fn values_are_those_of_the_streams() {
        let grid = Grid {
            cells: [4, 4],
            jitter: true,
        };
        for method in [
            Method::Independent,
            Method::OwenSobol,
            Method::Stratified(grid),
            Method::Halton,
            Method::Sobol,
            Method::MaxMinDist { log2_points: 4 },
        ] {
            let sampler = Sampler::new(method, 7);
            let streams =
                |lane: usize| sampler.stream(lane as i32 - 9, 1_000_000, lane as u32 * 77);
            let mut block = StreamBlock::default();
            for lane in 0..BLOCK {
                block.set(lane, &streams(lane));
            }
            for isa in Isa::available() {
                for dimension in [0, 1, 6, 4000] {
                    let (mut pairs, mut single) = ([[0.0; BLOCK]; 2], [[0.0; BLOCK]; 2]);
                    block.pairs(isa, dimension, &mut pairs);
                    block.uniforms(isa, dimension, &mut single);
                    for lane in 0..BLOCK {
                        let stream = streams(lane);
                        assert_eq!([pairs[0][lane], pairs[1][lane]], stream.pair(dimension));
                        assert_eq!(single[0][lane], stream.uniform(dimension));
                    }
                }
            }
        }
    }
}
