//! Queries of one ray on a shared tree, from any thread, and what there is to know of a hit.

use core::cell::Cell;

use antumbra_simd::scratch::{Bits, with_scratch};

use super::bvh::Bvh;
use crate::ray::{Hit, Ray};
use crate::trace::engine::{Each, Table};
use crate::trace::memory::{Memory, Stored};
use crate::trace::query::{Closest, Occlusion, Query};
use crate::trace::ray_batch::{LocatedHit, RayBatch, Report};
use crate::trace::stack::stack_size;
use crate::trace::surface::{Surface, surface, unit};
use crate::trace::view::on_view;

/// Items of a stack on the program stack: enough for 32 levels of 16 children, 71 of 8 and 167 of 4. Items that a tree
/// does not need are not written. Deeper trees take their stack from the pool.
const ITEMS: usize = 512;

impl Bvh {
    /// Whether anything lies in the ray's interval. May be called from any number of threads at once; the traversal stack
    /// lies on the program stack of the caller.
    ///
    /// ```
    /// # use antumbra::{Bvh, Geometry, Ray, Recipe};
    /// # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
    /// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
    /// # let bvh = Bvh::build(&geometry, &Recipe::default())?;
    /// assert!(bvh.occluded(&Ray::between([0.2, 0.2, 0.0], [0.2, 0.2, 2.0])));
    /// // The interval is open: the triangle is at its end.
    /// assert!(!bvh.occluded(&Ray::between([0.2, 0.2, 0.0], [0.2, 0.2, 1.0])));
    /// # Ok::<(), antumbra::Error>(())
    /// ```
    #[must_use]
    pub fn occluded(&self, ray: &Ray) -> bool {
        if self.tree.pick.is_none() {
            return self.one::<Occlusion>(ray, None);
        }
        let mut answer = [false];
        let batch = RayBatch::new(core::slice::from_ref(ray), 0);
        self.pool
            .with(|memory| self.occluded_each(memory, &batch, &mut answer));
        answer[0]
    }

    /// The closest hit in the ray's interval; at equal distances the smallest (inst_id, geom_id, prim_id). May be called
    /// from any number of threads at once, as [`Bvh::occluded`].
    ///
    /// ```
    /// # use antumbra::{Bvh, Geometry, Ray, Recipe};
    /// # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
    /// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
    /// # let bvh = Bvh::build(&geometry, &Recipe::default())?;
    /// let ray = Ray::new([0.25, 0.25, 0.0], [0.0, 0.0, 2.0]);
    /// let hit = bvh.intersect(&ray).expect("a triangle above");
    /// assert_eq!((hit.t, ray.at(hit.t)), (0.5, [0.25, 0.25, 1.0]));
    /// # Ok::<(), antumbra::Error>(())
    /// ```
    #[must_use]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.one::<Closest>(ray, None)
    }

    /// Geometric normal at a hit, in the world and of length 1. `ray` is the ray of the query, and `hit` its hit.
    ///
    /// A triangle's corners turn counter-clockwise if the normal points at the viewer; a mirroring instance turns it around
    /// as it does the corners. A sphere's normal points outwards. The normal of either does not depend on the side that
    /// was hit. User geometry computes its own: [`UserGeometry::normal`](crate::shapes::UserGeometry::normal).
    ///
    /// Finds the primitive by its ids along the ray, which takes about as long as a query of one ray. `None` if the ray
    /// comes by no such primitive, if the three corners lie on a line, or if user geometry returns none. Where something moves,
    /// the normal is at time 0: for other times see [`Batch::surfaces`](crate::Batch::surfaces).
    ///
    /// ```
    /// # use antumbra::{Bvh, Geometry, Ray, Recipe};
    /// # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
    /// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
    /// # let bvh = Bvh::build(&geometry, &Recipe::default())?;
    /// let ray = Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0]);
    /// let hit = bvh.intersect(&ray).expect("a triangle above");
    /// assert_eq!(bvh.normal(&ray, &hit), Some([0.0, 0.0, 1.0]));
    /// # Ok::<(), antumbra::Error>(())
    /// ```
    #[must_use]
    pub fn normal(&self, ray: &Ray, hit: &Hit) -> Option<[f32; 3]> {
        let locate = |stack: &mut [u32]| (self.engine.0).locate(&self.tree, stack, ray, hit);
        let located = self.with_stack(locate)?;
        let normal = located.normal?;
        match located.instance {
            None => unit(&normal, None),
            Some(index) => {
                let columns = self.tree.instances[index].placement.object_from_world;
                unit(&normal, Some(&columns))
            }
        }
    }

    /// The closest hit with its position and normal. Costs about as much as [`Bvh::intersect`]; for many rays see
    /// [`Batch::surfaces`](crate::Batch::surfaces).
    ///
    /// ```
    /// # use antumbra::{Bvh, Geometry, Ray, Recipe};
    /// # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
    /// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
    /// # let bvh = Bvh::build(&geometry, &Recipe::default())?;
    /// let ray = Ray::new([0.25, 0.5, 0.0], [0.0, 0.0, 2.0]);
    /// let surface = bvh.surface(&ray).expect("a hit");
    /// assert_eq!(surface.hit.t, 0.5);
    /// assert_eq!(surface.position, [0.25, 0.5, 1.0]);
    /// assert_eq!(surface.normal, [0.0, 0.0, 1.0]);
    /// # Ok::<(), antumbra::Error>(())
    /// ```
    #[must_use]
    pub fn surface(&self, ray: &Ray) -> Option<Surface> {
        let mut surfaces = [None];
        let batch = RayBatch::new(core::slice::from_ref(ray), 0);
        (self.pool).with(|memory| self.surfaces(memory, &batch, &mut surfaces));
        surfaces[0]
    }

    /// Surfaces of many rays.
    pub(super) fn surfaces(
        &self,
        memory: &mut Memory,
        batch: &RayBatch<'_>,
        surfaces: &mut [Option<Surface>],
    ) {
        surfaces.fill(None);
        let mut hits = core::mem::take(&mut memory.hits);
        hits.clear();
        hits.resize(surfaces.len(), None);
        let cells = Cell::from_mut(surfaces).as_slice_of_cells();
        let report = |index: usize, ray: &Ray, found: &LocatedHit| {
            let surface =
                on_view!(batch.share(index), view => surface(&self.tree, view, ray, found));
            cells[index].set(Some(surface));
        };
        self.intersect_many(
            memory,
            &batch.reporting(Report::Surface(&report)),
            &mut hits,
        );
        memory.hits = hits;
    }

    /// A query of one ray, under the condition of its batch if it has one.
    pub(super) fn one<Q: Query<Item: Stored + Bits>>(
        &self,
        ray: &Ray,
        batch: Option<&RayBatch<'_>>,
    ) -> Q::Answer
    where
        dyn Table: Each<Q>,
    {
        let mut answer = [Q::miss()];
        self.with_stack(|stack: &mut [Q::Item]| {
            let rays = core::slice::from_ref(ray);
            (self.engine.0).each(&self.tree, stack, rays, batch, &mut answer);
        });
        let [answer] = answer;
        answer
    }

    /// Runs `work` with memory of a stack for this tree.
    #[inline(always)]
    pub(super) fn with_stack<T: Stored + Bits, R>(&self, work: impl FnOnce(&mut [T]) -> R) -> R {
        let len = stack_size(self.width().lanes(), self.depth());
        if len <= ITEMS {
            with_scratch::<T, ITEMS, R>(|items| work(items))
        } else {
            self.pool
                .with(|memory: &mut Memory| work(T::at_least(memory, len)))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::api::recipe::Recipe;
    use crate::geometry::Geometry;
    use antumbra_testkit::{Rng, mesh};

    /// A tree that says it is deeper than the array on the program stack is long.
    #[test]
    fn deep_trees_take_their_stack_from_the_pool() {
        let mut rng = Rng::new(5);
        let mesh = mesh::soup(&mut rng, 300);
        let geometries = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
        let bvh = Bvh::build(&geometries, &Recipe::default()).expect("in range");
        let mut deep = bvh.clone();
        deep.tree.depth = 10_000;
        for _ in 0..500 {
            let ray = Ray::between(rng.point(1.0), rng.point(1.0));
            assert_eq!(deep.occluded(&ray), bvh.occluded(&ray));
            let hit = bvh.intersect(&ray);
            assert_eq!(deep.intersect(&ray), hit);
            if let Some(hit) = hit {
                assert_eq!(deep.normal(&ray, &hit), bvh.normal(&ray, &hit));
            }
        }
    }
}
