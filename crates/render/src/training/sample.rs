//! What the pre-pass keeps of its shadow rays for an order, and perhaps a collapse, to be learned from.

use antumbra::{AnyBvh, Cost, Log, Ray, Tracer};

use crate::sampler::mix;

/// What is kept.
#[derive(Clone, Debug)]
pub enum Evidence {
    /// What every ray met in the tree, for an order of that tree.
    Log {
        /// That.
        log: Box<Log>,
        /// Some of the rays, for other trees yet to come.
        rays: RaySample,
    },
    /// Some of the rays, for another tree.
    Sample {
        /// Those rays.
        rays: RaySample,
        /// Whether the tests of all rays are counted, too; if not, they are traced in waves.
        counted: bool,
    },
}

impl Evidence {
    /// Whether [`Evidence::occluded`] tells what rays cost.
    pub fn counts(&self) -> bool {
        match self {
            Self::Log { .. } => true,
            Self::Sample { counted, .. } => *counted,
        }
    }

    /// Answers `rays` by `bvh`, to which `tracer` belongs, and takes note of them. There are costs for all rays
    /// or, unless [`Evidence::counts`], none.
    pub fn occluded(
        &mut self,
        bvh: &AnyBvh,
        tracer: &mut Tracer<'_>,
        rays: &[Ray],
        occluded: &mut [bool],
        costs: &mut [Cost],
    ) {
        match self {
            Self::Log { log, rays: sample } => {
                bvh.occluded_batch_logged(rays, occluded, costs, log);
                sample.extend(rays);
            }
            Self::Sample {
                rays: sample,
                counted,
            } => {
                if *counted {
                    bvh.occluded_batch_counted(rays, occluded, costs);
                } else {
                    tracer.occluded_batch(rays, occluded);
                }
                sample.extend(rays);
            }
        }
    }

    /// Takes note of rays whose answers nobody needs.
    pub fn add(&mut self, bvh: &AnyBvh, rays: &[Ray]) {
        let mut occluded = vec![false; rays.len()];
        let costs = if self.counts() { rays.len() } else { 0 };
        let mut costs = vec![Cost::default(); costs];
        self.occluded(bvh, &mut bvh.tracer(), rays, &mut occluded, &mut costs);
    }

    /// Adds what another worker has kept. The sum does not depend on who traced what.
    ///
    /// # Panics
    /// If the two are of different kinds, or logs of different trees.
    pub fn merge(&mut self, other: Self) {
        match (self, other) {
            (Self::Log { log: sum, rays }, Self::Log { log, rays: others }) => {
                sum.merge(&log);
                rays.merge(others);
            }
            (Self::Sample { rays: sum, .. }, Self::Sample { rays, .. }) => sum.merge(rays),
            _ => panic!("evidence of different kinds"),
        }
    }
}

/// A sample of bounded size of any number of rays: those with the least hash of their bits. Which these are
/// depends neither on the order in which rays come nor on how they are divided among workers.
#[derive(Clone, Debug)]
pub struct RaySample {
    /// How many there are at most.
    size: usize,
    /// Sorted up to some moment, in any order and too many after it.
    kept: Vec<(Key, Ray)>,
    /// Once the sample was full, keys from this one on are not in it.
    limit: Option<Key>,
}

/// Hash and bits of a ray; rays with equal keys are equal.
type Key = (u64, [u32; 8]);

impl RaySample {
    /// An empty one, to be of at most `size` rays.
    pub fn new(size: usize) -> Self {
        Self {
            size,
            kept: Vec::new(),
            limit: None,
        }
    }

    fn extend(&mut self, rays: &[Ray]) {
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

    /// The rays of the sample, sorted by their hashes.
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

    /// A full sample is spread evenly over the rays: its mean is that of all.
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
