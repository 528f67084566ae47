//! Queries of one ray without conditions: nothing but the query.

use antumbra::{Bvh, Hit, INVALID_ID, PrimId, Ray};

use crate::arrays::{Slot, shared};
use crate::status::{Status, guarded};

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

/// A query of one ray. The query is a part of the function, not a call through a pointer.
macro_rules! single {
    ($name:ident, $doc:literal, $place:literal: $Answer:ty, |$bvh:ident, $ray:ident| $query:expr) => {
        #[doc = $doc]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(
            bvh: *const Bvh,
            ray: *const Ray,
            answer: *mut $Answer,
        ) -> Status {
            guarded(|| {
                // SAFETY: the header says what is at these addresses.
                let ($bvh, $ray, slot) = unsafe {
                    let slot = Slot::new(answer, $place)?;
                    (shared(bvh, "bvh")?, shared(ray, "ray")?, slot)
                };
                slot.put($query);
                Ok(())
            })
        }
    };
}

single!(
    antumbra_occluded1,
    "Returns whether anything lies in the interval of a ray.",
    "occluded": bool,
    |bvh, ray| bvh.occluded(ray)
);
single!(
    antumbra_intersect1,
    "Finds the closest hit of a ray.",
    "hit": Hit,
    |bvh, ray| hit(bvh.intersect(ray))
);
single!(
    antumbra_surface1,
    "Finds the closest hit of a ray, with position and normal.",
    "surface": Surface,
    |bvh, ray| surface(bvh.surface(ray))
);
single!(
    antumbra_occluder1,
    "Finds any occluder of a ray.",
    "occluder": PrimId,
    |bvh, ray| occluder(bvh.query(ray).occluder())
);
