//! Queries of one ray without conditions: nothing but the query.

use antumbra::{Bvh, Hit, INVALID_ID, PrimId, Ray};

use crate::arrays::Slot;
use crate::interface::functions;

/// A closest hit with position and normal, `antumbra_surface`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Surface {
    pub hit: Hit,
    pub position: [f32; 3],
    pub normal: [f32; 3],
}

/// What the structure of a hit holds after a miss.
pub const MISS: Hit = Hit {
    t: f32::INFINITY,
    u: 0.0,
    v: 0.0,
    prim_id: INVALID_ID,
    geom_id: INVALID_ID,
    inst_id: INVALID_ID,
};

/// A hit for C.
#[inline]
pub fn hit(found: Option<Hit>) -> Hit {
    found.unwrap_or(MISS)
}

/// A surface for C.
#[inline]
pub fn surface(found: Option<antumbra::Surface>) -> Surface {
    match found {
        Some(found) => Surface {
            hit: found.hit,
            position: found.position,
            normal: found.normal,
        },
        None => Surface {
            hit: MISS,
            position: [f32::INFINITY; 3],
            normal: [0.0; 3],
        },
    }
}

/// An occluder for C.
#[inline]
pub fn occluder(found: Option<PrimId>) -> PrimId {
    found.unwrap_or(PrimId::NONE)
}

functions! {
    /// Returns whether anything is in the interval of a ray.
    fn antumbra_occluded1(bvh: &Bvh, ray: &Ray, occluded: Slot<bool>) {
        occluded.put(bvh.occluded(ray));
        Ok(())
    }

    /// Returns the closest hit of a ray.
    fn antumbra_intersect1(bvh: &Bvh, ray: &Ray, hit: Slot<Hit>) {
        hit.put(self::hit(bvh.intersect(ray)));
        Ok(())
    }

    /// Returns the closest hit of a ray with position and normal.
    fn antumbra_surface1(bvh: &Bvh, ray: &Ray, surface: Slot<Surface>) {
        surface.put(self::surface(bvh.surface(ray)));
        Ok(())
    }

    /// Returns any primitive in the interval of a ray, not the closest one; all ids are ANTUMBRA_INVALID_ID if there is none. Which
    /// primitive it is depends on the tree, whether there is one does not.
    fn antumbra_occluder1(bvh: &Bvh, ray: &Ray, occluder: Slot<PrimId>) {
        occluder.put(self::occluder(bvh.query(ray).occluder()));
        Ok(())
    }
}
