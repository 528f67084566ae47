//! The list of all kinds of primitives, and their numbers, kind after kind.

use alloc::vec::Vec;

use super::Primitives;
use super::dropped::DropReason;
use crate::aabb::Aabb;
use crate::geometry::best::TreeHit;
use crate::geometry::cutout::micromap::Cutout;
use crate::geometry::cutout::opacity::accepts;
use crate::geometry::instance::PlacedObject;
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::scalar::{ScalarPrim, ScalarShape};
use crate::geometry::triangle::TriangleBlock;
use crate::geometry::{Geometry, PrimRef, QueryKind, triangle};
use crate::ray::{Hit, INVALID_ID};

/// Hands the kinds that are tested one by one to a macro, whose path is in brackets, behind what comes before. A row is
/// the kind, the name of its lists, its type and the first of its 2²⁸ child references.
macro_rules! for_each_scalar_kind {
    ([$($apply:tt)+] $($before:tt)*) => {
        $($apply)+! {
            $($before)*
            (Sphere, spheres, $crate::geometry::Sphere, 0x6000_0000)
            (User, users, $crate::geometry::user::UserPrim, 0x7000_0000)
            (Disk, disks, $crate::geometry::Disk, 0x8000_0000)
            (Curve, curves, $crate::geometry::curve::CurveSegment, 0x9000_0000)
        }
    };
}
pub(crate) use for_each_scalar_kind;

/// Hands all kinds to a macro, in the order of numbers of primitives and of leaves: the only list of kinds that there is.
/// Rows are as in [`for_each_scalar_kind`]; triangles have their blocks for a type, and 2²⁹ child
/// references.
macro_rules! for_each_kind {
    ([$($apply:tt)+] $($before:tt)*) => {
        $crate::geometry::primitives::kinds::for_each_scalar_kind! {
            [$($apply)+]
            $($before)*
            (Triangle, triangles, $crate::geometry::triangle::TriangleBlock, 0x4000_0000)
            (Cutout, cutouts, $crate::geometry::cutout::CutoutBlock, 0xc000_0000)
        }
    };
}
pub(crate) use for_each_kind;

macro_rules! define_kinds {
    ($(($Kind:ident, $list:ident, $Type:ty, $first:literal))*) => {
        /// Kind of the primitives of a leaf. Primitives are numbered kind after kind, in this order, and instances after
        /// them. A cut-out is a partly transparent triangle.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum PrimKind {
            $(
                #[doc = concat!("Primitives of the kind `", stringify!($Kind), "`.")]
                $Kind,
            )*
        }

        impl PrimKind {
            /// How many kinds there are.
            pub const COUNT: usize = Self::ALL.len();

            /// Every kind, in the order of numbers.
            pub const ALL: &[Self] = &[$(Self::$Kind),*];

            const FIRST_CHILDREN: [u32; Self::COUNT] = [$($first),*];
        }
    };
}
for_each_kind!([define_kinds]);

impl PrimKind {
    /// The smallest child reference to a leaf of this kind.
    #[inline(always)]
    pub const fn first_child(self) -> u32 {
        Self::FIRST_CHILDREN[self as usize]
    }

    /// Whether primitives have three corners.
    pub fn is_triangle(self) -> bool {
        matches!(self, Self::Triangle | Self::Cutout)
    }
}

/// Primitives of one kind with their names.
#[derive(Clone, Debug)]
pub(crate) struct List<P> {
    prims: Vec<P>,
    /// Names of the primitives, as long as `prims`.
    refs: Vec<PrimRef>,
}

impl<P> Default for List<P> {
    fn default() -> Self {
        Self {
            prims: Vec::new(),
            refs: Vec::new(),
        }
    }
}

impl<P: ScalarPrim> List<P> {
    /// Copies the primitives of this kind in a geometry, and lists those that are unsound.
    fn add(
        &mut self,
        geometry: &Geometry<'_>,
        geom_id: u32,
        unsound: &mut Vec<(PrimRef, DropReason)>,
    ) {
        let prims = (0..).map_while(|prim_id| Some((P::of(geometry, prim_id)?, prim_id)));
        for (prim, prim_id) in prims {
            let id = PrimRef { geom_id, prim_id };
            match prim {
                Ok(prim) => {
                    self.prims.push(prim);
                    self.refs.push(id);
                }
                Err(reason) => unsound.push((id, reason)),
            }
        }
    }

    pub fn len(&self) -> usize {
        self.prims.len()
    }

    pub fn at(&self, index: usize) -> (&P, PrimRef) {
        (&self.prims[index], self.refs[index])
    }
}

/// A kind knows where its primitives are.
pub(crate) trait Listed: Sized {
    const KIND: PrimKind;

    fn list(lists: &ScalarLists) -> &List<Self>;
}

macro_rules! define_lists {
    ($(($Kind:ident, $list:ident, $Type:ty, $first:literal))*) => {
        /// The primitives of every kind that is tested one by one.
        #[derive(Clone, Debug, Default)]
        pub(crate) struct ScalarLists {
            $(pub $list: List<$Type>,)*
        }

        impl ScalarLists {
            /// Copies the primitives of a geometry. Returns those that are unsound.
            pub fn add(
                &mut self,
                geometry: &Geometry<'_>,
                geom_id: u32,
            ) -> Vec<(PrimRef, DropReason)> {
                let mut unsound = Vec::new();
                $(self.$list.add(geometry, geom_id, &mut unsound);)*
                unsound
            }

            /// How many primitives there are of each kind.
            pub fn lens(&self) -> [usize; PrimKind::COUNT - 2] {
                [$(self.$list.len()),*]
            }

            /// A primitive and its name.
            fn get(&self, mut index: usize) -> (&dyn ScalarShape, PrimRef) {
                $(
                    if index < self.$list.len() {
                        let (prim, id) = self.$list.at(index);
                        return (prim, id);
                    }
                    index -= self.$list.len();
                )*
                unreachable!("primitive {index} behind the last one")
            }

            /// How many primitives of each kind geometries have, and what a kind is called.
            pub fn counts(geometries: &[Geometry<'_>]) -> [(&'static str, usize); PrimKind::COUNT - 2] {
                [$((
                    <$Type>::NAME,
                    geometries.iter().map(<$Type as ScalarPrim>::count).sum(),
                )),*]
            }

            /// Whether a geometry has such a primitive, and it is sound.
            pub fn is_sound(geometry: &Geometry<'_>, prim_id: u32) -> bool {
                $(<$Type>::of(geometry, prim_id).is_some_and(|prim| prim.is_ok()))||*
            }
        }

        $(
            impl Listed for $Type {
                const KIND: PrimKind = PrimKind::$Kind;

                fn list(lists: &ScalarLists) -> &List<Self> {
                    &lists.$list
                }
            }
        )*
    };
}
for_each_scalar_kind!([define_lists]);

/// Shape and name of a primitive.
pub(crate) enum Prim<'a> {
    /// Opaque or partly transparent: the corners.
    Triangle(&'a [[f32; 3]; 3], PrimRef),
    Scalar(&'a dyn ScalarShape, PrimRef),
}

impl Primitives {
    /// How many primitives there are of each kind.
    fn kind_lens(&self) -> [usize; PrimKind::COUNT] {
        let mut lens = [0; PrimKind::COUNT];
        lens[PrimKind::Triangle as usize] = self.triangles.len() - self.cutouts.len();
        lens[PrimKind::Cutout as usize] = self.cutouts.len();
        lens[2..].copy_from_slice(&self.scalars.lens());
        lens
    }

    /// Number of the first primitive of a kind: primitives are numbered kind after kind.
    pub(crate) fn start_of(&self, kind: PrimKind) -> usize {
        self.kind_lens()[..kind as usize].iter().sum()
    }

    /// Number of the first primitive of the second and each later kind.
    pub(crate) fn kind_starts(&self) -> [usize; PrimKind::COUNT - 1] {
        let lens = self.kind_lens();
        let mut start = 0;
        core::array::from_fn(|kind| {
            start += lens[kind];
            start
        })
    }

    /// Kind of a primitive of the world itself.
    ///
    /// # Panics
    /// If there is no such primitive.
    pub fn kind(&self, index: usize) -> PrimKind {
        let starts = self.kind_starts().into_iter();
        PrimKind::ALL[starts.filter(|start| *start <= index).count()]
    }

    /// Shape and name of a primitive, which is no instance.
    #[inline(always)]
    pub(crate) fn prim(&self, index: usize) -> Prim<'_> {
        match self.triangles.get(index) {
            Some(corners) => Prim::Triangle(corners, self.triangle_refs[index]),
            None => {
                let (shape, id) = self.scalars.get(index - self.triangles.len());
                Prim::Scalar(shape, id)
            }
        }
    }

    /// The instance of this number; `None` if that is a primitive.
    pub(crate) fn instance(&self, index: usize) -> Option<&PlacedObject> {
        self.instances.get(index.checked_sub(self.len())?)
    }

    /// Bounds of a primitive of the world itself; of an instance behind them.
    ///
    /// # Panics
    /// If there is no such primitive or instance.
    pub fn bounds_of(&self, index: usize) -> Aabb {
        match index.checked_sub(self.len()) {
            None => match self.prim(index) {
                Prim::Triangle(corners, _) => Aabb::around(corners),
                Prim::Scalar(shape, _) => shape.bounds(),
            },
            Some(instance) => self.instances[instance].placement.bounds(),
        }
    }

    /// Knowledge of a partly transparent triangle that needs no call of its filter.
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

    /// The exact test of one primitive, in plain scalar code, and its own filter.
    pub(crate) fn hit(&self, index: usize, ray: &RaySetup, query: QueryKind) -> Option<TreeHit> {
        let (id, [[t, u, v], reported]) = match self.prim(index) {
            Prim::Triangle(corners, id) => (id, triangle::hit(corners, ray)?),
            Prim::Scalar(shape, id) => (id, [shape.hit(id.prim_id, ray, ray.tfar)?; 2]),
        };
        let counts = self.kind(index) != PrimKind::Cutout || {
            let filter = self.own_cutout(index).filter;
            let filter = &*self.filters.opacities[filter as usize].opacity;
            accepts(filter, id, [u, v], ray, id, query)
        };
        let hit = Hit {
            t,
            u,
            v,
            prim_id: id.prim_id,
            geom_id: id.geom_id,
            inst_id: INVALID_ID,
        };
        counts.then(|| TreeHit::from(hit).refined(reported))
    }

    /// The name of a primitive, if an occlusion query hits it.
    pub(crate) fn occluder(&self, index: usize, ray: &RaySetup) -> Option<PrimRef> {
        match self.prim(index) {
            Prim::Triangle(_, id) => self.hit(index, ray, QueryKind::Occluded).map(|_| id),
            Prim::Scalar(shape, id) => shape.occludes(id.prim_id, ray).then_some(id),
        }
    }
}

/// A partly transparent triangle, without its corners.
#[derive(Clone, Copy, Debug)]
pub(super) struct OwnCutout {
    /// Index of its own filter in [`crate::geometry::cutout::Filters::opacities`], which is called where no tree is used.
    pub filter: u32,
    pub known: Cutout,
}
