//! Numbers of primitives, kind after kind, and what each kind has: the only list of kinds that primitives have.

use super::Primitives;
use crate::aabb::Aabb;
use crate::geometry::cutout::micromap::Cutout;
use crate::geometry::cutout::opacity::accepts;
use crate::geometry::instance::PlacedObject;
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::triangle::TriangleBlock;
use crate::geometry::user::UserPrim;
use crate::geometry::{PrimRef, QueryKind, Sphere, triangle};
use crate::ray::{Hit, INVALID_ID};

/// Kind of the primitives of a leaf. Primitives are numbered kind after kind, in this order, and instances after
/// them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PrimKind {
    Triangle,
    /// A partly transparent triangle.
    Cutout,
    Sphere,
    /// User geometry.
    User,
}

impl PrimKind {
    /// How many kinds there are.
    pub const COUNT: usize = 4;

    /// Every kind, in the order of numbers.
    pub const ALL: [Self; Self::COUNT] = [Self::Triangle, Self::Cutout, Self::Sphere, Self::User];
}

/// Shape of a primitive.
pub(crate) enum Prim<'a> {
    /// Opaque or partly transparent: the corners.
    Triangle(&'a [[f32; 3]; 3]),
    Sphere(&'a Sphere),
    User(&'a UserPrim),
}

impl Primitives {
    /// Where the second and each later kind of primitives begins in the numbering.
    pub(crate) fn kind_starts(&self) -> [usize; PrimKind::COUNT - 1] {
        let triangles = self.triangles.len();
        let users = triangles + self.spheres.len();
        [triangles - self.cutouts.len(), triangles, users]
    }

    /// Kind of a primitive, which is no instance.
    pub(crate) fn kind(&self, index: usize) -> PrimKind {
        let starts = self.kind_starts().into_iter();
        PrimKind::ALL[starts.filter(|start| *start <= index).count()]
    }

    /// Shape of a primitive, which is no instance.
    #[inline(always)]
    pub(crate) fn prim(&self, index: usize) -> Prim<'_> {
        match self.triangles.get(index) {
            Some(corners) => Prim::Triangle(corners),
            None => self.other_prim(index - self.triangles.len()),
        }
    }

    /// Shape of a primitive that is no triangle; numbered without triangles.
    fn other_prim(&self, index: usize) -> Prim<'_> {
        match self.spheres.get(index) {
            Some(sphere) => Prim::Sphere(sphere),
            None => Prim::User(&self.users[index - self.spheres.len()]),
        }
    }

    /// The instance of this number; `None` if that is a primitive.
    pub(crate) fn instance(&self, index: usize) -> Option<&PlacedObject> {
        self.instances.get(index.checked_sub(self.len())?)
    }

    /// Bounds of a primitive or an instance.
    pub(crate) fn bounds_of(&self, index: usize) -> Aabb {
        match index.checked_sub(self.len()) {
            None => match self.prim(index) {
                Prim::Triangle(corners) => Aabb::around(corners),
                Prim::Sphere(sphere) => sphere.bounds(),
                Prim::User(prim) => prim.bounds,
            },
            Some(instance) => self.instances[instance].placement.bounds(),
        }
    }

    /// A sphere and its name.
    pub(crate) fn sphere(&self, index: usize) -> (Sphere, PrimRef) {
        let index = index - self.triangles.len();
        (self.spheres[index], self.sphere_refs[index])
    }

    /// A primitive of user geometry and its name.
    pub(crate) fn user(&self, index: usize) -> (&UserPrim, PrimRef) {
        let index = index - self.triangles.len() - self.spheres.len();
        (&self.users[index], self.user_refs[index])
    }

    /// Knowledge of a partly transparent triangle without asking its filter.
    pub(crate) fn cutout(&self, index: usize) -> Cutout {
        self.own_cutout(index).known
    }

    fn own_cutout(&self, index: usize) -> &OwnCutout {
        &self.cutouts[index + self.cutouts.len() - self.triangles.len()]
    }

    /// Writes triangles, by their numbers, into the first lanes of a block.
    pub(crate) fn set_triangles(&self, block: &mut TriangleBlock, prims: &[u32]) {
        for (lane, &prim) in prims.iter().enumerate() {
            let index = prim as usize;
            block.set(lane, &self.triangles[index], self.triangle_refs[index]);
        }
    }

    /// The exact test of one primitive, in plain scalar code, and its own filter. User geometry that occludes a ray does not
    /// tell where, so that distance means nothing.
    pub(crate) fn hit(&self, index: usize, ray: &RaySetup, query: QueryKind) -> Option<Hit> {
        let (id, t, u, v) = match self.prim(index) {
            Prim::Triangle(corners) => {
                let (t, u, v) = triangle::hit(corners, ray)?;
                (self.triangle_refs[index], t, u, v)
            }
            Prim::Sphere(sphere) => (self.sphere(index).1, sphere.hit(ray)?, 0.0, 0.0),
            Prim::User(prim) => {
                let id = self.user(index).1;
                match query {
                    QueryKind::Intersect => {
                        let hit = prim.hit(id, ray)?;
                        (id, hit.t, hit.u, hit.v)
                    }
                    QueryKind::Occluded if prim.occludes(id, ray) => (id, 0.0, 0.0, 0.0),
                    QueryKind::Occluded => return None,
                }
            }
        };
        let counts = self.kind(index) != PrimKind::Cutout || {
            let filter = self.own_cutout(index).filter;
            let filter = &*self.filters.opacities[filter as usize];
            accepts(filter, id, [u, v], ray, id, query)
        };
        counts.then_some(Hit {
            t,
            u,
            v,
            prim_id: id.prim_id,
            geom_id: id.geom_id,
            inst_id: INVALID_ID,
        })
    }
}

/// A partly transparent triangle, apart from its corners.
#[derive(Clone, Copy, Debug)]
pub(super) struct OwnCutout {
    /// Its own filter, one of [`crate::geometry::cutout::Filters::opacities`]: asked where no tree is used.
    pub filter: u32,
    pub known: Cutout,
}
