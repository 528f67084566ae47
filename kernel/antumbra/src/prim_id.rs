//! Names of primitives as users know them.

use crate::ray::{Hit, INVALID_ID};

/// Name of a primitive in the scene: the three ids of a [`Hit`].
///
/// 12 bytes: `inst_id`, `geom_id`, `prim_id`.
///
/// ```
/// # use antumbra::{Bvh, Geometry, Recipe};
/// use antumbra::{PrimId, Ray};
///
/// # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
/// # let bvh = Bvh::build(&geometry, &Recipe::default())?;
/// let ray = Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0]);
/// let hit = bvh.intersect(&ray).expect("a triangle above");
/// // Nothing else is there.
/// assert!(!bvh.query(&ray).except(PrimId::from(hit)).occluded());
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(C)]
pub struct PrimId {
    /// Index of the instance, or [`INVALID_ID`] if the primitive lies in the world itself.
    pub inst_id: u32,
    /// Index of the geometry in the list the tree was built from, or in the list of the instance's object.
    pub geom_id: u32,
    /// Index of the primitive in its geometry.
    pub prim_id: u32,
}

impl PrimId {
    /// Name of no primitive.
    pub const NONE: Self = Self {
        inst_id: INVALID_ID,
        geom_id: INVALID_ID,
        prim_id: INVALID_ID,
    };
}

impl From<&Hit> for PrimId {
    /// The primitive that was hit.
    fn from(hit: &Hit) -> Self {
        (*hit).into()
    }
}

impl From<Hit> for PrimId {
    /// The primitive that was hit.
    fn from(hit: Hit) -> Self {
        Self {
            inst_id: hit.inst_id,
            geom_id: hit.geom_id,
            prim_id: hit.prim_id,
        }
    }
}
