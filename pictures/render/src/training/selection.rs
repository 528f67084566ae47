//! The samples of the pre-pass.

use crate::film::Sample;
use crate::sampler::mix;

/// Samples of the pre-pass: a share of all, spread evenly over pixels and sample numbers.
///
/// The samples of a pixel walk round a circle, each `step` further than the last, from a start of the pixel's own.
/// Samples that land in the first `step` of the circle are taken: one in `1 / share`, as evenly as whole numbers
/// allow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Selection {
    /// Length of a step in parts of the circle. The whole circle takes every sample.
    step: u64,
    seed: u64,
}

/// Parts of the circle: a power of two, for arithmetic modulo 2^64, and as many as an `f64` holds exactly.
const CIRCLE: u64 = 1 << 53;

/// Number of training rays that is enough for a picture of any size.
const ENOUGH_RAYS: f64 = 16384.0;

/// Least and largest number of samples that is enough, however many rays each has. They have to cover the picture.
const ENOUGH_SAMPLES: (f64, f64) = (1024.0, 4096.0);

/// Largest share of a small picture that is taken to reach these numbers. The rest is left to profit.
const ENOUGH_SHARE: f64 = 0.25;

/// Most samples of a pre-pass, whose work an interruption may cost: a second of a processor or two, and many times as many as
/// there is to learn from.
const MOST: f64 = (1 << 18) as f64;

impl Selection {
    /// A `share` in 0..=1 of `pixels * spp` samples of about `rays` shadow rays each. `None` if the share is 0.
    ///
    /// A small share is raised to a few thousand samples or to a quarter of the picture, whichever is less. A large
    /// share is lowered to 2¹⁸ samples.
    pub fn new(share: f64, rays: f64, pixels: usize, spp: u32, seed: u64) -> Option<Self> {
        let samples = pixels as f64 * f64::from(spp);
        let enough = (ENOUGH_RAYS / rays).clamp(ENOUGH_SAMPLES.0, ENOUGH_SAMPLES.1);
        let least = (enough / samples).min(ENOUGH_SHARE);
        (share > 0.0).then_some(Self {
            step: (share.max(least).min(MOST / samples).min(1.0) * CIRCLE as f64) as u64,
            seed: mix(seed),
        })
    }

    /// Share of the samples that is taken.
    pub fn share(&self) -> f64 {
        self.step as f64 / CIRCLE as f64
    }

    /// Whether a sample is taken.
    pub fn takes(&self, sample: Sample) -> bool {
        let [x, y] = sample.pixel.map(|v| u64::from(v as u32));
        // Random starts thin out evenly even with a single sample per pixel.
        let start = mix(self.seed ^ (x | y << 32));
        let walked = self.step.wrapping_mul(u64::from(sample.index));
        start.wrapping_add(walked) % CIRCLE < self.step
    }
}

#[cfg(test)]
mod tests {
    use antumbra_image::Window;

    use super::*;
    use crate::film::batches;

    #[test]
    fn selections_take_their_share() {
        // Share, rays per sample, samples per pixel, edge of the picture, share that is to be taken.
        let cases = [
            (0.01, 4.0, 64, 200, 0.01),
            (0.01, 4.0, 1, 200, 4096.0 / 40_000.0),
            (0.01, 1.0, 1, 200, 4096.0 / 40_000.0),
            (0.01, 8.0, 1, 200, 2048.0 / 40_000.0),
            (0.01, 64.0, 1, 200, 1024.0 / 40_000.0),
            (0.03, 4.0, 100, 200, 0.03),
            (0.5, 4.0, 16, 20, 0.5),
            (0.3, 4.0, 16, 20, 0.3),
            (0.9, 4.0, 7, 40, 0.9),
            (1e-9, 4.0, 16, 20, 0.25),
            (0.1, 4.0, 4, 8, 0.25),
            (1.0, 4.0, 1 << 11, 16, 0.5),
        ];
        for (share, rays, spp, size, expected) in cases {
            let window = Window::full(size, size);
            let selection = Selection::new(share, rays, window.area(), spp, 5).expect("a share");
            assert!((selection.share() - expected).abs() < 1e-12);
            let taken = batches(window, spp)
                .flatten()
                .filter(|&s| selection.takes(s))
                .count() as f64;
            let expected = expected * (window.area() * spp as usize) as f64;
            // A pixel takes its share rounded down or up at random: a deviation of half a sample at most.
            let deviation = 0.5 * (window.area() as f64).sqrt();
            assert!(
                (taken - expected).abs() < 4.0 * deviation,
                "{share} {spp} {size}: {taken} {expected}"
            );
        }
        assert_eq!(Selection::new(0.0, 4.0, 100, 1, 0), None);
    }

    #[test]
    fn a_pixel_takes_its_share_as_evenly_as_whole_numbers_allow() {
        for share in [0.26, 1.0 / 3.0, 0.5, 0.75, 0.999, 1.0] {
            let selection = Selection::new(share, 4.0, 100, 1000, 9).expect("a share");
            for x in 0..50 {
                let mut taken = 0_u32;
                for index in 0..2000 {
                    let pixel = [x, -x];
                    taken += u32::from(selection.takes(Sample { pixel, index }));
                    let expected = share * f64::from(index + 1);
                    let off = (f64::from(taken) - expected).abs();
                    assert!(off < 1.0 + 1e-9, "{share}: {taken} of {}", index + 1);
                    assert!(share < 1.0 || taken == index + 1);
                }
            }
        }
    }
}
