//! A sample of the rays that a tree answers, to learn from while running.

use alloc::vec::Vec;

use crate::hash;
use crate::ray::Ray;

/// A uniform sample of the rays of many batches: each ray that was shown is in it with the same chance.
///
/// Keeps at most so many rays, 32 bytes each. The sample depends on the rays, on their order and on nothing else.
///
/// ```
/// use antumbra::{Ray, RayMemory};
///
/// let mut sample = RayMemory::new(100);
/// for frame in 0..50 {
///     let rays: Vec<Ray> = (0..1000).map(|i| Ray::new([i as f32, frame as f32, 0.0], [0.0, 0.0, 1.0])).collect();
///     sample.show(&rays);
/// }
/// assert_eq!(sample.rays().len(), 100);
/// ```
#[derive(Clone, Debug)]
pub struct RayMemory {
    rays: Vec<Ray>,
    most: usize,
    shown: u64,
    state: u64,
}

impl RayMemory {
    /// An empty sample of at most `most` rays; a few thousand are enough to learn an order from.
    pub fn new(most: usize) -> Self {
        Self {
            rays: Vec::with_capacity(most),
            most,
            shown: 0,
            state: 0,
        }
    }

    /// Shows rays to the sample. Once it is full, the time that this takes grows with the number of rays kept, not of
    /// those shown.
    pub fn show(&mut self, rays: &[Ray]) {
        let mut rest = rays;
        while self.rays.len() < self.most {
            let Some((ray, others)) = rest.split_first() else {
                return;
            };
            self.rays.push(*ray);
            self.shown += 1;
            rest = others;
        }
        if self.most == 0 {
            return;
        }
        // A ray number n is kept with the chance most / n: the next one kept is skipped to (Vitter 1985, algorithm R,
        // with the chances of a whole batch taken as equal).
        let total = self.shown + rest.len() as u64;
        let expected = self.most as f64 * rest.len() as f64 / total as f64;
        let whole = expected as usize;
        let count = whole + usize::from(self.unit() < expected - whole as f64);
        for _ in 0..count {
            let from = (self.unit() * rest.len() as f64) as usize;
            let to = (self.unit() * self.most as f64) as usize;
            self.rays[to.min(self.most - 1)] = rest[from.min(rest.len() - 1)];
        }
        self.shown = total;
    }

    /// Returns the rays of the sample.
    pub fn rays(&self) -> &[Ray] {
        &self.rays
    }

    /// Forgets half of what it was shown, so that rays to come count more than rays of the past.
    pub fn fade(&mut self) {
        self.shown /= 2;
        self.shown = self.shown.max(self.rays.len() as u64);
    }

    /// The next random number in [0, 1).
    fn unit(&mut self) -> f64 {
        self.state = self.state.wrapping_add(hash::STEP);
        (hash::mixed(self.state) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_is_fair() {
        let ray = |x: usize| Ray::new([x as f32, 0.0, 0.0], [0.0, 0.0, 1.0]);
        let mut memory = RayMemory::new(1000);
        for batch in 0..100 {
            let rays: Vec<_> = (0..500).map(|index| ray(500 * batch + index)).collect();
            memory.show(&rays);
        }
        assert_eq!(memory.rays().len(), 1000);
        let sum: f64 = memory.rays().iter().map(|ray| f64::from(ray.org[0])).sum();
        // The mean of a fair sample of 0..50000; its deviation is 456.
        assert!((sum / 1000.0 - 25_000.0).abs() < 2000.0, "{}", sum / 1000.0);
        RayMemory::new(0).show(&[ray(1)]);
    }
}
