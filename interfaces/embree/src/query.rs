//! Queries of one ray: plain ones straight to the kernel, others with masks, filters and functions of the client.

use std::cell::RefCell;
use std::ptr;

use antumbra::{Hit, Ray, Visit};

use crate::abi::{Arguments, Context, RtcHit, RtcRay, RtcRayHit};
use crate::commit::{Committed, PlacedInstance};
use crate::curves;
use crate::failure::Outcome;
use crate::filter::{Filters, Query};
use crate::geometry::Kind;
use crate::normal::normal;
use crate::scene::{Scene, with};
use crate::transform;
use crate::user::{Current, with_current};

/// The near end of a ray, never before the origin.
#[inline]
fn near_end(ray: &RtcRay) -> f32 {
    if ray.tnear < 0.0 { 0.0 } else { ray.tnear }
}

/// A distance inside the interval of a ray, whose closed ends the kernel has widened by one number.
#[inline]
fn inside(ray: &RtcRay, t: f32) -> f32 {
    t.max(near_end(ray)).min(ray.tfar)
}

/// How a query must be answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Every hit counts.
    Plain,
    /// Only hits count whose masks share a bit with the mask of the ray, and on curves by Embree's rule.
    Masked,
    /// Functions of the client decide.
    Called,
}

impl Committed {
    /// A ray with the ends that Embree has in this scene: the far one closed, the near one closed or open.
    #[inline]
    pub fn kernel_ray(&self, ray: &RtcRay) -> Ray {
        let open = Ray {
            org: ray.org,
            tnear: near_end(ray),
            dir: ray.dir,
            tfar: ray.tfar,
        };
        let closed = open.closed();
        match self.traits.near_is_closed {
            true => closed,
            // Rays before the origin do not go in packets of the kernel.
            false => Ray {
                tnear: open.tnear,
                ..closed
            },
        }
    }

    /// How rays with this mask must be traced.
    #[inline]
    pub fn way(&self, query: Query, mask: u32, arguments: Option<&Arguments>) -> Way {
        let traits = &self.traits;
        let has_filter = match query {
            Query::Intersect => traits.has_intersect_filter,
            Query::Occluded => traits.has_occluded_filter,
        };
        let is_called = has_filter
            || traits.has_user_geometry
            || arguments.is_some_and(|arguments| {
                Filters::new(query, Some(arguments)).may_call_argument(traits.takes_argument_filter)
            });
        if is_called {
            Way::Called
        } else if mask & traits.common_mask == 0 || traits.has_curves {
            Way::Masked
        } else {
            Way::Plain
        }
    }

    /// The closest hit of a ray.
    pub fn intersect(&self, ray: &RtcRay, arguments: Option<&Arguments>) -> Option<(f32, RtcHit)> {
        match self.way(Query::Intersect, ray.mask, arguments) {
            Way::Plain => {
                let hit = self.bvh().intersect(&self.kernel_ray(ray))?;
                Some(self.found(ray, &hit, None))
            }
            Way::Masked => {
                let kernel = self.kernel_ray(ray);
                let hit = (self.bvh().query(&kernel))
                    .mask(ray.mask)
                    .filter(&|hit| self.counts(ray, hit))
                    .intersect()?;
                Some(self.found(ray, &hit, None))
            }
            Way::Called => self.called(Query::Intersect, ray, arguments),
        }
    }

    /// Whether a ray is occluded.
    pub fn occluded(&self, ray: &RtcRay, arguments: Option<&Arguments>) -> bool {
        match self.way(Query::Occluded, ray.mask, arguments) {
            Way::Plain => self.bvh().occluded(&self.kernel_ray(ray)),
            Way::Masked => {
                let kernel = self.kernel_ray(ray);
                (self.bvh().query(&kernel))
                    .mask(ray.mask)
                    .filter(&|hit| self.counts(ray, hit))
                    .occluded()
            }
            Way::Called => self.called(Query::Occluded, ray, arguments).is_some(),
        }
    }

    /// The first hit, from the front, that counts for masks and functions.
    #[cold]
    fn called(
        &self,
        query: Query,
        ray: &RtcRay,
        arguments: Option<&Arguments>,
    ) -> Option<(f32, RtcHit)> {
        let mut own = Context::WORLD;
        let given = arguments.map_or(ptr::null_mut(), |arguments| arguments.context);
        let context = if given.is_null() { &raw mut own } else { given };
        let current = Current {
            ray: *ray,
            context,
            function: arguments.and_then(|arguments| arguments.user),
            filters: Filters::new(query, arguments),
            hits: RefCell::default(),
        };
        let mut accepted = None;
        let mut behind = FarSides::default();
        let kernel = self.kernel_ray(ray);
        let decide = |hit: &Hit, accepted: &mut Option<(f32, RtcHit)>| {
            let place = self.find(hit.inst_id, hit.geom_id);
            let found = self.found(ray, hit, Some(&current));
            // Functions of user geometry call filters themselves.
            *accepted = match place.0.geometry.kind {
                Kind::User => Some(found),
                _ => current.filters.accept(place, ray, found, context),
            };
            accepted.is_some()
        };
        let visit = |hit: Hit| {
            while let Some(far) = behind.before(hit.t) {
                if decide(&far, &mut accepted) {
                    return Visit::Stop;
                }
            }
            if !self.counts(ray, &hit) {
                return Visit::Reject;
            }
            if decide(&hit, &mut accepted) {
                return Visit::Stop;
            }
            behind.add(self.far_side(&kernel, &hit));
            Visit::Reject
        };
        with_current(&current, || self.bvh().query(&kernel).visit_hits(visit));
        while accepted.is_none()
            && let Some(far) = behind.before(f32::INFINITY)
        {
            decide(&far, &mut accepted);
        }
        accepted
    }

    /// The point at which a ray leaves a sphere that it has entered at `hit`. The kernel reports each sphere once.
    fn far_side(&self, ray: &Ray, hit: &Hit) -> Option<Hit> {
        let (placed, instance) = self.find(hit.inst_id, hit.geom_id);
        if placed.geometry.kind != Kind::Spheres {
            return None;
        }
        let (org, dir) = in_object(instance, ray.org, ray.dir);
        let prim = hit.prim_id as usize;
        let view = (placed.state.vertices.as_ref()).filter(|view| prim < view.count)?;
        let [x, y, z, _] = view.read::<4, f32>(prim);
        let along = |to: [f32; 3]| -> f64 {
            (0..3)
                .map(|axis| f64::from(to[axis]) * f64::from(dir[axis]))
                .sum()
        };
        let to_center = [x - org[0], y - org[1], z - org[2]];
        let middle = along(to_center) / along(dir);
        let t = (2.0 * middle - f64::from(hit.t)) as f32;
        (hit.t < t && t < ray.tfar).then_some(Hit { t, ..*hit })
    }

    /// A hit as Embree writes it.
    pub fn found(&self, ray: &RtcRay, hit: &Hit, current: Option<&Current<'_>>) -> (f32, RtcHit) {
        let (placed, instance) = self.find(hit.inst_id, hit.geom_id);
        let reported = current.and_then(|current| {
            (placed.geometry.kind == Kind::User)
                .then(|| current.reported(&placed.geometry, hit.prim_id, hit.t))?
        });
        let on_curve = match placed.geometry.kind {
            Kind::Curves(basis) => curves::own_hit(basis, &placed.state, instance, ray, hit),
            _ => None,
        };
        let (prim_id, t, u, v) = match &on_curve {
            Some(own) => (own.prim, own.t, own.u, own.v),
            None => (hit.prim_id, hit.t, hit.u, hit.v),
        };
        let hit = &Hit {
            prim_id,
            t,
            u,
            v,
            ..*hit
        };
        let own = RtcHit {
            ng: match &reported {
                Some(reported) => reported.ng,
                None => normal(placed, instance, ray, hit),
            },
            u,
            v,
            prim_id,
            geom_id: placed.geom_id,
            ..RtcHit::MISS
        };
        let hit_written = match instance {
            Some(instance) => RtcHit {
                inst_id: instance.geom_id,
                inst_prim_id: instance.prim_id,
                ..own
            },
            // Functions may have followed the ray into another scene.
            None => reported.unwrap_or(own),
        };
        (inside(ray, hit.t), hit_written)
    }
}

/// Far sides of spheres whose near sides were rejected.
#[derive(Default)]
struct FarSides(Vec<Hit>);

impl FarSides {
    fn add(&mut self, hit: Option<Hit>) {
        self.0.extend(hit);
    }

    /// Takes the nearest one up to `t`.
    fn before(&mut self, t: f32) -> Option<Hit> {
        let near = (self.0.iter().enumerate()).filter(|(_, hit)| hit.t <= t);
        let (place, _) = near.min_by(|(_, a), (_, b)| a.t.total_cmp(&b.t))?;
        Some(self.0.swap_remove(place))
    }
}

/// A ray in the space of the object.
pub fn in_object(
    instance: Option<&PlacedInstance>,
    org: [f32; 3],
    dir: [f32; 3],
) -> ([f32; 3], [f32; 3]) {
    match instance.and_then(|instance| instance.from_world.as_ref()) {
        Some(rows) => (
            transform::apply(rows, org, 1.0),
            transform::apply(rows, dir, 0.0),
        ),
        None => (org, dir),
    }
}

/// The scene and the arguments of a query.
///
/// # Safety
/// Arguments as the caller documents, or null.
pub unsafe fn start(
    scene: &Scene,
    arguments: *const Arguments,
) -> Outcome<(&Committed, Option<&Arguments>)> {
    // SAFETY: the caller's arguments.
    Ok((scene.committed()?, unsafe { arguments.as_ref() }))
}

/// # Safety
/// A scene of this library, a ray and arguments, or null ones.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcIntersect1(
    scene: *const Scene,
    rayhit: *mut RtcRayHit,
    arguments: *const Arguments,
) {
    // SAFETY: the caller's handle and memory.
    unsafe {
        with(scene, (), |scene| {
            let (committed, arguments) = start(scene, arguments)?;
            let rayhit = crate::handle::look_mut(rayhit)?;
            if let Some((t, hit)) = committed.intersect(&rayhit.ray, arguments) {
                // Field by field: the end of the structure may belong to the client.
                let first = std::ptr::from_mut(rayhit).cast();
                crate::lanes::Lane { first, stride: 1 }.set_hit(t, &hit);
            }
            Ok(())
        })
    }
}

/// # Safety
/// A scene of this library, a ray and arguments, or null ones.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcOccluded1(
    scene: *const Scene,
    ray: *mut RtcRay,
    arguments: *const Arguments,
) {
    // SAFETY: the caller's handle and memory.
    unsafe {
        with(scene, (), |scene| {
            let (committed, arguments) = start(scene, arguments)?;
            let ray = crate::handle::look_mut(ray)?;
            if committed.occluded(ray, arguments) {
                ray.tfar = f32::NEG_INFINITY;
            }
            Ok(())
        })
    }
}

/// # Safety
/// As [`rtcIntersect1`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcTraversableIntersect1(
    scene: *const Scene,
    rayhit: *mut RtcRayHit,
    arguments: *const Arguments,
) {
    // SAFETY: as for the other.
    unsafe { rtcIntersect1(scene, rayhit, arguments) }
}

/// # Safety
/// As [`rtcOccluded1`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcTraversableOccluded1(
    scene: *const Scene,
    ray: *mut RtcRay,
    arguments: *const Arguments,
) {
    // SAFETY: as for the other.
    unsafe { rtcOccluded1(scene, ray, arguments) }
}
