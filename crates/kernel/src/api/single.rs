//! Queries of one ray on a shared tree, from any thread, and what there is to know of a hit.

use antumbra_simd::Dispatch;
use antumbra_simd::scratch::{Bits, with_scratch};

use super::bvh::Bvh;
use crate::geometry::instance::{cross, dot};
use crate::geometry::leaf_block::Normal;
use crate::math;
use crate::ray::{Hit, Ray};
use crate::trace::locate::locate;
use crate::trace::memory::{Memory, Stored};
use crate::trace::query::{Closest, Occlusion, Query};
use crate::trace::single::Single;
use crate::trace::stack::stack_size;
use crate::tree::any::on_tree;
use crate::tree::rule::Rule;

/// Items of a stack on the program stack: enough for 32 levels of 16 children, 71 of 8 and 167 of 4. Nobody writes to
/// what a tree does not need. Deeper trees take their stack from the pool.
const ITEMS: usize = 512;

impl Bvh {
    /// Whether anything lies in the ray's interval. May be called from any number of threads at once; the traversal stack
    /// lies on the program stack of the caller.
    #[must_use]
    pub fn occluded(&self, ray: &Ray) -> bool {
        if self.rule() == &Rule::Slots {
            return self.one::<Occlusion>(ray);
        }
        let mut answer = [false];
        let rays = core::slice::from_ref(ray);
        self.pool
            .with(|memory| self.occluded_each(memory, rays, &mut answer));
        answer[0]
    }

    /// The closest hit in the ray's interval; at equal distances the smallest (inst_id, geom_id, prim_id). May be called
    /// from any number of threads at once, as [`Bvh::occluded`].
    #[must_use]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.one::<Closest>(ray)
    }

    /// Geometric normal at a hit, in the world and of length 1. `ray` is the ray that was asked, and `hit` its hit.
    ///
    /// A triangle's corners turn counter-clockwise if the normal points at the viewer; a mirroring instance turns it around
    /// as it does the corners. A sphere's normal points outwards. The normal of either does not depend on the side that was
    /// hit. User geometry tells its own: [`UserGeometry::normal`](crate::UserGeometry::normal).
    ///
    /// Finds the primitive by its ids along the ray, which takes about as long as a query of one ray. `None` if the ray comes by
    /// no such primitive, if the three corners lie on a line, or if user
    /// geometry tells none.
    #[must_use]
    pub fn normal(&self, ray: &Ray, hit: &Hit) -> Option<[f32; 3]> {
        let located = self.with_stack(
            |stack: &mut [u32]| on_tree!(&self.tree, tree => locate(tree, stack, ray, hit)),
        )?;
        let normal = located.normal?;
        let normal = match located.instance {
            None => normal.direction,
            Some(index) => {
                let columns = on_tree!(&self.tree, tree => {
                    tree.instances[index].placement.object_from_world
                });
                world_normal(&normal, &columns)
            }
        };
        let length = math::sqrt(dot(normal, normal));
        // Not if it is NaN.
        (length > 0.0 && length < f64::INFINITY).then(|| normal.map(|x| (x / length) as f32))
    }

    pub(super) fn one<Q: Query<Item: Stored + Bits>>(&self, ray: &Ray) -> Q::Answer {
        let mut answer = [Q::miss()];
        self.with_stack(|stack: &mut [Q::Item]| {
            let (rays, answers) = (core::slice::from_ref(ray), &mut answer[..]);
            on_tree!(&self.tree, bvh => {
                self.isa().dispatch(Single::<Q, _> { bvh, stack, rays, answers });
            });
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

/// Takes a normal from an object to the world, given the columns of the map from the world to the object: normals go by
/// its transpose.
fn world_normal(normal: &Normal, columns: &[[f32; 4]; 4]) -> [f64; 3] {
    let [x, y, z, _] = columns.map(|[x, y, z, _]| [x, y, z].map(f64::from));
    let turned = [x, y, z].map(|column| dot(column, normal.direction));
    if normal.mirrors_turn && dot(x, cross(y, z)) < 0.0 {
        turned.map(|x| -x)
    } else {
        turned
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
        on_tree!(&mut deep.tree, tree => tree.depth = 10_000);
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
