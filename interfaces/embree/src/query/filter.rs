//! Filters: functions of the client that accept or reject hits.

use crate::abi::{Context, FilterArguments, RtcHit, RtcRay, RtcRayHit};
use crate::geometry::Filters;
use crate::scene::Site;

/// Calls the filters of a geometry about a hit at distance `t`, and returns the hit as they leave it if they accept.
pub fn accept(
    filters: Filters<'_>,
    site: Site<'_>,
    ray: &RtcRay,
    (t, hit): (f32, RtcHit),
    context: *mut Context,
) -> Option<(f32, RtcHit)> {
    let mut functions = filters.of(site.state()).peekable();
    if functions.peek().is_none() {
        return Some((t, hit));
    }
    // In an instance, the ray is in the space of the object.
    let (org, dir) = site.in_object(ray);
    let mut rayhit = RtcRayHit {
        ray: RtcRay {
            org,
            dir,
            tfar: t,
            ..*ray
        },
        hit: RtcHit::MISS,
    };
    let mut entered = Entered::new(context, site);
    let mut hit = hit;
    let mut valid = -1;
    for function in functions {
        let arguments = FilterArguments {
            valid: &raw mut valid,
            user: site.placed.geometry.user(),
            context: entered.context(),
            ray: (&raw mut rayhit).cast(),
            hit: (&raw mut hit).cast(),
            n: 1,
        };
        // SAFETY: the client's function, with arguments as documented.
        unsafe { function(&raw const arguments) };
        if valid == 0 {
            return None;
        }
    }
    Some((rayhit.ray.tfar, hit))
}

/// A context inside an instance, put back at the end.
struct Entered {
    context: *mut Context,
    before: Option<Context>,
    own: Context,
}

impl Entered {
    fn new(context: *mut Context, site: Site<'_>) -> Self {
        let mut entered = Self {
            context,
            before: None,
            own: Context::WORLD,
        };
        let inside = site.instance.map(|instance| Context {
            inst_id: instance.geom_id,
            inst_prim_id: instance.prim_id,
        });
        // SAFETY: null or the context of the client, which only this thread uses during the query.
        match (unsafe { context.as_mut() }, inside) {
            (Some(context), Some(inside)) => {
                entered.before = Some(*context);
                *context = inside;
            }
            (None, Some(inside)) => entered.own = inside,
            _ => {}
        }
        entered
    }

    fn context(&mut self) -> *mut Context {
        if self.context.is_null() {
            &raw mut self.own
        } else {
            self.context
        }
    }
}

impl Drop for Entered {
    fn drop(&mut self) {
        if let Some(before) = self.before {
            // SAFETY: as in `new`; there is a context if there was one.
            unsafe { *self.context = before };
        }
    }
}
