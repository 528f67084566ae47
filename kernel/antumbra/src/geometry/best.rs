//! The best hit so far of a closest-hit query, in the world and in instances.

use crate::geometry::instance_ray::Interval;
use crate::ray::{Hit, INVALID_ID};

/// The best hit so far, and what is to be known of where the ray is now.
///
/// In an instance, hits are reported at their distance clamped into the instance interval, see
/// [`crate::geometry::ray_setup`].
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub(crate) struct Best {
    hit: Hit,
    /// Distance beyond which nothing that the ray hits, in the space where it is now, can become a better hit.
    pub limit: f32,
    tfar: f32,
    interval: Interval,
    inst_id: u32,
}

impl Best {
    /// No hit yet on a ray that ends at `tfar`.
    pub const fn none(tfar: f32) -> Self {
        Self {
            hit: Hit::none(tfar),
            limit: tfar,
            tfar,
            interval: Interval::WORLD,
            inst_id: INVALID_ID,
        }
    }

    /// The best hit, if there is any.
    pub fn found(&self) -> Option<Hit> {
        self.hit.found()
    }

    /// The best hit with its ids as in the tree, if there is any.
    pub fn hit(&self) -> Option<Hit> {
        (self.hit.prim_id != INVALID_ID).then_some(self.hit)
    }

    /// The ray goes into an instance.
    #[inline(always)]
    pub fn enter(&mut self, interval: Interval, inst_id: u32) {
        self.interval = interval;
        self.inst_id = inst_id;
        self.limit = self.limit_now();
    }

    /// The ray comes back into the world.
    #[inline(always)]
    pub fn exit(&mut self) {
        self.enter(Interval::WORLD, INVALID_ID);
    }

    /// A hit in the object where the ray is now, or in the world, as it is reported, if it precedes the best so far.
    #[inline(always)]
    pub fn preceded_by(&self, hit: Hit) -> Option<Hit> {
        let hit = Hit {
            t: self.interval.clamp(hit.t),
            inst_id: self.inst_id,
            ..hit
        };
        hit.precedes(&self.hit).then_some(hit)
    }

    /// Takes a hit that precedes the best so far.
    #[inline(always)]
    pub fn take(&mut self, hit: Hit) {
        self.hit = hit;
        self.limit = self.limit_now();
    }

    /// Takes a hit in the object where the ray is now, or in the world, if it precedes the best so far and `counts`
    /// returns true. Returns whether it was taken. `counts` is called last, and only for hits that precede the best.
    #[inline(always)]
    pub fn offer_if(&mut self, hit: Hit, counts: impl FnOnce(&Hit) -> bool) -> bool {
        match self.preceded_by(hit) {
            Some(hit) if counts(&hit) => {
                self.take(hit);
                true
            }
            _ => false,
        }
    }

    /// [`Best::offer_if`] for a hit that counts.
    #[inline(always)]
    pub fn offer(&mut self, hit: Hit) -> bool {
        self.offer_if(hit, |_| true)
    }

    /// Limit for the best hit so far. As long as that hit is not nearer than the end of the instance interval, anything
    /// in the instance may be clamped there and be the better one.
    #[inline(always)]
    fn limit_now(&self) -> f32 {
        if self.hit.t < self.interval.leave {
            self.hit.t
        } else {
            self.tfar
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hit(t: f32) -> Hit {
        Hit {
            t,
            prim_id: 7,
            geom_id: 3,
            ..Hit::none(0.0)
        }
    }

    /// A hit clamped to the end of the interval must not hide others that are clamped there and have smaller ids: see
    /// [`crate::geometry::ray_setup`].
    #[test]
    fn nothing_is_left_out_before_the_best_hit_is_nearer_than_the_end_of_the_stay() {
        let interval = Interval {
            enter: 1.0,
            leave: 2.0,
        };
        let mut best = Best::none(10.0);
        best.enter(interval, 5);
        assert_eq!(best.limit, 10.0);
        assert!(best.offer(hit(4.0)));
        let found = best.found().expect("a hit");
        assert_eq!((found.t, found.inst_id), (2.0, 5));
        assert_eq!(best.limit, 10.0, "others beyond the interval are as near");
        assert!(best.offer(Hit {
            geom_id: 1,
            ..hit(9.0)
        }));
        assert!(best.offer(hit(1.5)));
        assert_eq!(best.limit, 1.5);
        assert!(best.offer(hit(0.5)));
        assert_eq!(best.found().map(|hit| hit.t), Some(1.0));
        best.exit();
        assert_eq!(best.limit, 1.0);
        assert!(!best.offer_if(hit(0.5), |_| false), "it does not count");
    }
}
