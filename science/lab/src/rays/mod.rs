//! Rays of a scene's camera paths.
//!
//! - `purposes.rs`: rays by purpose, for benchmarks
//! - `sampled.rs`: groups of occlusion rays that share no sample: training rays and held-out rays

mod purposes;
mod sampled;

pub use purposes::{Rays, collect_rays};
pub use sampled::{Lot, SampledRays};

/// Step that visits each of `total` places once, and any number of them evenly: near the golden section of `total`, and
/// without a common divisor.
fn stride(total: u64) -> u64 {
    let divides = |a: u64, b: u64| {
        let (mut a, mut b) = (a, b);
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a == 1
    };
    let golden = (total as f64 * 0.618_033_988_749_895) as u64;
    (golden.max(1)..=total)
        .find(|&step| divides(step, total))
        .unwrap_or(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stride_visits_every_place_once() {
        for total in 1..500 {
            let step = stride(total);
            let mut seen = vec![false; total as usize];
            for turn in 0..total {
                seen[(turn * step % total) as usize] = true;
            }
            assert!(seen.iter().all(|&seen| seen), "{total} by {step}");
        }
    }
}
