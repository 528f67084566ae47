//! Training sample: shadow rays of the pre-pass, or their log, as threads keep them for a child order, a collapse or
//! a builder to learn from.

use antumbra::parts::{Cost, Log, Steps};
use antumbra::{Bvh, Ray};

use crate::sampler::mix;

/// Shadow rays of the pre-pass, as far as they are kept.
#[derive(Clone, Debug)]
pub enum TrainingSample {
    /// Training log of every ray, for an order of the tree that was traced.
    Log {
        /// Training log of all rays so far.
        log: Box<Log>,
        /// Some of the rays, for later trees.
        rays: RaySample,
    },
    /// Some of the rays, for another tree than the one that was traced.
    Rays {
        /// The rays.
        rays: RaySample,
        /// Whether the tests of all rays are counted. If not, rays are traced as a ray stream.
        counted: bool,
    },
}

impl TrainingSample {
    /// Whether [`TrainingSample::occluded`] counts tests.
    pub fn counts(&self) -> bool {
        match self {
            Self::Log { .. } => true,
            Self::Rays { counted, .. } => *counted,
        }
    }

    /// Answers `rays` by `bvh` and keeps them. `costs` has room for all rays if
    /// [`TrainingSample::counts`], and is empty otherwise.
    pub fn occluded(&mut self, bvh: &Bvh, rays: &[Ray], occluded: &mut [bool], costs: &mut [Cost]) {
        match self {
            Self::Log { log, rays: sample } => {
                bvh.occluded_batch_logged(rays, occluded, costs, log);
                sample.extend(rays);
            }
            Self::Rays {
                rays: sample,
                counted,
            } => {
                if *counted {
                    bvh.occluded_batch_counted(rays, occluded, costs);
                } else {
                    bvh.batch(rays).on_this_thread().occluded_into(occluded);
                }
                sample.extend(rays);
            }
        }
    }

    /// Keeps rays whose answers are not needed.
    pub fn add(&mut self, bvh: &Bvh, rays: &[Ray]) {
        let mut occluded = vec![false; rays.len()];
        let costs = if self.counts() { rays.len() } else { 0 };
        let mut costs = vec![Cost::default(); costs];
        self.occluded(bvh, rays, &mut occluded, &mut costs);
    }

    /// Adds the sample of another thread. The sum does not depend on which thread traced which rays.
    ///
    /// # Panics
    /// If the two samples are of different kinds, or of different trees.
    pub fn merge(&mut self, other: Self) {
        match (self, other) {
            (Self::Log { log: sum, rays }, Self::Log { log, rays: others }) => {
                sum.merge(&log);
                rays.merge(others);
            }
            (Self::Rays { rays: sum, .. }, Self::Rays { rays, .. }) => sum.merge(rays),
            _ => panic!("training samples of different kinds"),
        }
    }
}

/// A sample of bounded size of any number of rays: the rays whose bits have the least hash.
///
/// The sample depends neither on the order in which rays come nor on how they are divided among threads.
#[derive(Clone, Debug)]
pub struct RaySample {
    /// Largest number of rays.
    size: usize,
    /// Candidates: up to twice `size`, not sorted.
    kept: Vec<(Key, Ray)>,
    /// Bound of the keys, once the sample was full.
    limit: Option<Key>,
}

/// Hash and bits of a ray. Rays with equal keys are equal.
type Key = (u64, [u32; 8]);

impl RaySample {
    /// An empty sample, to hold at most `size` rays.
    pub fn new(size: usize) -> Self {
        Self {
            size,
            kept: Vec::new(),
            limit: None,
        }
    }

    /// Adds rays.
    pub fn extend(&mut self, rays: &[Ray]) {
        for ray in rays {
            let key = key(ray);
            if self.limit.is_none_or(|limit| key < limit) {
                self.kept.push((key, *ray));
                if self.kept.len() >= 2 * self.size {
                    self.shrink();
                }
            }
        }
    }

    fn merge(&mut self, other: Self) {
        self.kept.extend(other.kept);
        self.shrink();
    }

    fn shrink(&mut self) {
        self.kept.sort_unstable_by_key(|(key, _)| *key);
        self.kept.truncate(self.size);
        if self.kept.len() == self.size {
            self.limit = self.kept.last().map(|(key, _)| *key);
        }
    }

    /// Rays of the sample, sorted by their hashes.
    pub fn into_rays(mut self) -> Vec<Ray> {
        self.shrink();
        self.kept.into_iter().map(|(_, ray)| ray).collect()
    }
}

fn key(ray: &Ray) -> Key {
    let ([ox, oy, oz], [dx, dy, dz]) = (ray.org, ray.dir);
    let bits = [ox, oy, oz, dx, dy, dz, ray.tnear, ray.tfar].map(f32::to_bits);
    let hash = bits.chunks_exact(2).fold(0, |hash, pair| {
        mix(hash ^ (u64::from(pair[0]) | u64::from(pair[1]) << 32))
    });
    (hash, bits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::{Method, Sampler};

    const SIZE: usize = 1 << 13;

    fn rays(count: usize) -> Vec<Ray> {
        let sampler = Sampler::new(Method::Independent, 21);
        let ray = |index: usize| {
            let stream = sampler.stream(0, 0, index as u32);
            let [x, y] = stream.pair(0);
            // Every third ray comes twice.
            let [u, v] = sampler
                .stream(0, 1, (index - usize::from(index % 3 == 1)) as u32)
                .pair(1);
            if index % 3 < 2 {
                Ray::new([0.0; 3], [u, v, 1.0])
            } else {
                Ray::new([x, y, 0.0], [u, v, 1.0])
            }
        };
        (0..count).map(ray).collect()
    }

    #[test]
    fn samples_do_not_depend_on_the_division_of_work() {
        for count in [0, 5, SIZE, 5 * SIZE + 7] {
            let rays = rays(count);
            let mut whole = RaySample::new(SIZE);
            whole.extend(&rays);
            let whole = whole.into_rays();
            assert_eq!(whole.len(), count.min(SIZE));
            for workers in [1, 2, 7] {
                let mut samples = vec![RaySample::new(SIZE); workers];
                // From the end, in shares of different sizes.
                for (turn, rays) in rays.rchunks(1000).enumerate() {
                    samples[turn * turn % workers].extend(rays);
                }
                let mut sum = RaySample::new(SIZE);
                samples.into_iter().for_each(|sample| sum.merge(sample));
                assert!(sum.into_rays() == whole, "{count} rays, {workers} workers");
            }
        }
    }

    /// A full sample is spread evenly over the rays: its mean is near the mean of all.
    #[test]
    fn samples_are_fair() {
        let rays = rays(8 * SIZE);
        let mut sample = RaySample::new(SIZE);
        sample.extend(&rays);
        let mean = |rays: &[Ray]| {
            rays.iter().map(|ray| f64::from(ray.dir[0])).sum::<f64>() / rays.len() as f64
        };
        let (all, some) = (mean(&rays), mean(&sample.into_rays()));
        assert!((all - some).abs() < 0.01, "{all} {some}");
    }
}
