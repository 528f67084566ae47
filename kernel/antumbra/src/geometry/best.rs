//! Hits as traversals have them, and the best one so far of a closest-hit query, in the world and in instances.

use crate::geometry::instance_ray::Interval;
use crate::ray::{Hit, INVALID_ID};

/// A hit with ids as in the tree, whose `t` decides which hit comes first, and the distance that is reported. They differ only
/// on triangles, see [`crate::geometry::triangle_hit`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct TreeHit {
    pub hit: Hit,
    pub t: f32,
}

impl From<Hit> for TreeHit {
    #[inline(always)]
    fn from(hit: Hit) -> Self {
        Self { hit, t: hit.t }
    }
}

impl TreeHit {
    /// With these `t`, `u` and `v` to be reported.
    #[inline(always)]
    pub fn refined(self, [t, u, v]: [f32; 3]) -> Self {
        let hit = Hit { u, v, ..self.hit };
        Self { hit, t }
    }

    /// The hit where the ray is in an instance, or in the world. A refined distance stays what it is: where the ray is in the
    /// box of an instance decides about nothing but the order of hits.
    #[inline(always)]
    pub fn placed(self, interval: Interval, inst_id: u32) -> Self {
        let t = interval.clamp(self.hit.t);
        Self {
            hit: Hit {
                t,
                inst_id,
                ..self.hit
            },
            t: if self.t == self.hit.t { t } else { self.t },
        }
    }
}

/// The best hit so far, and what is to be known of where the ray is now.
///
/// In an instance, hits are ranked by their distance clamped into the instance interval, see
/// [`crate::geometry::ray_setup`].
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub(crate) struct Best {
    found: TreeHit,
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
            found: TreeHit {
                hit: Hit::none(tfar),
                t: tfar,
            },
            limit: tfar,
            tfar,
            interval: Interval::WORLD,
            inst_id: INVALID_ID,
        }
    }

    /// The best hit, if there is any.
    pub fn found(&self) -> Option<Hit> {
        self.found.reported()
    }

    /// The best hit with its ids as in the tree, if there is any.
    pub fn hit(&self) -> Option<TreeHit> {
        (self.found.hit.prim_id != INVALID_ID).then_some(self.found)
    }

    /// Gives the best hit, which was found where the ray is now, the `t`, `u` and `v` that are to be reported.
    #[inline(always)]
    pub fn refine(&mut self, [t, u, v]: [f32; 3]) {
        self.found = self.found.refined([t, u, v]);
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
    pub fn preceded_by(&self, found: TreeHit) -> Option<TreeHit> {
        let found = found.placed(self.interval, self.inst_id);
        (found.hit.precedes(&self.found.hit)).then_some(found)
    }

    /// Takes a hit that precedes the best so far.
    #[inline(always)]
    pub fn take(&mut self, found: TreeHit) {
        self.found = found;
        self.limit = self.limit_now();
    }

    /// Takes a hit in the object where the ray is now, or in the world, if it precedes the best so far and `counts`
    /// returns true. Returns whether it was taken. `counts` is called last, and only for hits that precede the best.
    #[inline(always)]
    pub fn offer_if(&mut self, found: TreeHit, counts: impl FnOnce(&TreeHit) -> bool) -> bool {
        match self.preceded_by(found) {
            Some(found) if counts(&found) => {
                self.take(found);
                true
            }
            _ => false,
        }
    }

    /// [`Best::offer_if`] for a hit that counts.
    #[inline(always)]
    pub fn offer(&mut self, found: TreeHit) -> bool {
        self.offer_if(found, |_| true)
    }

    /// Limit for the best hit so far. As long as that hit is not nearer than the end of the instance interval, anything
    /// in the instance may be clamped there and be the better one.
    #[inline(always)]
    fn limit_now(&self) -> f32 {
        if self.found.hit.t < self.interval.leave {
            self.found.hit.t
        } else {
            self.tfar
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hit(t: f32) -> TreeHit {
        TreeHit::from(Hit {
            t,
            prim_id: 7,
            geom_id: 3,
            ..Hit::none(0.0)
        })
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
        let mut other = hit(9.0);
        other.hit.geom_id = 1;
        assert!(best.offer(other));
        assert!(best.offer(hit(1.5)));
        assert_eq!(best.limit, 1.5);
        assert!(best.offer(hit(0.5)));
        assert_eq!(best.found().map(|hit| hit.t), Some(1.0));
        best.exit();
        assert_eq!(best.limit, 1.0);
        assert!(!best.offer_if(hit(0.5), |_| false), "it does not count");
    }
}
