//! All hits of a ray, and queries that leave out the primitive a ray starts on.

use alloc::vec::Vec;

use antumbra_simd::Dispatch;

use super::bvh::Bvh;
use crate::prim_id::PrimId;
use crate::ray::{Hit, Ray};
use crate::trace::visit::{Ahead, Visit, Visiting};
use crate::tree::any::on_tree;

impl Bvh {
    /// Tells `visit` of every hit in the ray's interval, front to back, until it accepts one or stops. Returns the hit that
    /// was accepted.
    ///
    /// | answer | meaning |
    /// |---|---|
    /// | [`Visit::Accept`] | this is the hit: the visit ends and returns it |
    /// | [`Visit::Reject`] | goes on, as if the primitive was not there |
    /// | [`Visit::Stop`] | the visit ends and returns `None` |
    ///
    /// So the first hit that is accepted is the closest one that counts. Nothing behind the end of the visit is looked at.
    ///
    /// Hits come by ascending (t, inst_id, geom_id, prim_id), whatever the tree, and each primitive comes once for every
    /// instance of it. Of a sphere that is the nearer of its two points inside the interval. Each triangle of a quad comes by
    /// itself. Filters of cut-outs are asked
    /// first, as by [`Bvh::intersect`], and `visit` hears of hits that count only. They may be asked about hits that
    /// `visit` then does not come to.
    ///
    /// May be called from any number of threads at once, and from within `visit`. Memory comes from a pool of the tree.
    ///
    /// ```
    /// use antumbra::{Bvh, Geometry, Ray, Recipe, Visit};
    ///
    /// let triangle = |z| vec![[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]];
    /// let panes = [1.0, 2.0, 3.0].map(|z| Geometry::triangles(triangle(z), vec![[0, 1, 2]]));
    /// let bvh = Bvh::build(&panes, &Recipe::default())?;
    /// let ray = Ray::between([0.2, 0.2, 0.0], [0.2, 0.2, 4.0]);
    ///
    /// // What is left of the light behind panes of tinted glass; the last one is opaque.
    /// let passes = [0.5, 0.25, 0.0];
    /// let mut light = 1.0;
    /// let occluder = bvh.visit_hits(&ray, |hit| {
    ///     light *= passes[hit.geom_id as usize];
    ///     if light == 0.0 { Visit::Accept } else { Visit::Reject }
    /// });
    /// assert_eq!(occluder.map(|hit| hit.geom_id), Some(2));
    /// # Ok::<(), antumbra::Error>(())
    /// ```
    pub fn visit_hits(&self, ray: &Ray, mut visit: impl FnMut(Hit) -> Visit) -> Option<Hit> {
        self.visit_dyn(ray, &mut visit)
    }

    /// Compiled once.
    fn visit_dyn(&self, ray: &Ray, visit: &mut dyn FnMut(Hit) -> Visit) -> Option<Hit> {
        self.pool
            .with(|memory| self.visit_ahead(&mut memory.ahead, ray, visit))
    }

    /// [`Bvh::visit_hits`] in the memory given.
    pub(super) fn visit_ahead(
        &self,
        ahead: &mut Ahead,
        ray: &Ray,
        visit: &mut dyn FnMut(Hit) -> Visit,
    ) -> Option<Hit> {
        on_tree!(&self.tree, bvh => {
            self.isa().dispatch(Visiting { bvh, ahead, ray, condition: None, visit })
        })
    }

    /// All hits in the ray's interval, in the order of [`Bvh::visit_hits`]. [`Batch::all_hits`](crate::Batch::all_hits) asks
    /// about many rays.
    pub fn all_hits(&self, ray: &Ray) -> Vec<Hit> {
        let mut hits = Vec::new();
        self.visit_hits(ray, |hit| {
            hits.push(hit);
            Visit::Reject
        });
        hits
    }

    /// Number of hits in the ray's interval: the length of [`Bvh::all_hits`]. A sphere counts once.
    pub fn count_hits(&self, ray: &Ray) -> usize {
        let mut count = 0;
        self.visit_hits(ray, |_| {
            count += 1;
            Visit::Reject
        });
        count
    }

    /// Whether anything but the primitive `excluded` lies in the ray's interval. For rays that start on a surface: the
    /// primitive they start on does not occlude them, however the origin was rounded.
    ///
    /// Neighbours are not left out: a ray that starts on an edge may be stopped by the triangle on the other side. A sphere
    /// is left out whole, also its far side, and so is a quad. [`PrimId::NONE`] leaves out nothing.
    pub fn occluded_except(&self, ray: &Ray, excluded: PrimId) -> bool {
        self.query(ray).except(excluded).occluded()
    }

    /// The closest hit in the ray's interval on anything but the primitive `excluded`, as in [`Bvh::occluded_except`].
    ///
    /// Costs as much as [`Bvh::intersect`], and a visit of the hits on top if the excluded primitive is the closest.
    pub fn intersect_except(&self, ray: &Ray, excluded: PrimId) -> Option<Hit> {
        self.query(ray).except(excluded).intersect()
    }
}
