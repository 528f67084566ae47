//! Queries of one ray: plain ones straight to the kernel, others with masks, filters and functions of the client.

use std::cell::RefCell;
use std::ptr;

use antumbra::{Hit, Ray, Visit};

use crate::abi::{Arguments, Context, RtcHit, RtcRay, RtcRayHit};
use crate::commit::Committed;
use crate::failure::Outcome;
use crate::filter::{Filters, Query};
use crate::normal::normal;
use crate::scene::{Scene, with};
use crate::user::{Current, with_current};

/// A ray as the kernel takes it: closed at both ends, and never before the origin, as with Embree.
#[inline]
pub fn kernel_ray(ray: &RtcRay) -> Ray {
    let mut kernel = Ray::new(ray.org, ray.dir);
    kernel.tnear = if ray.tnear < 0.0 { 0.0 } else { ray.tnear };
    kernel.tfar = ray.tfar;
    kernel.closed()
}

/// A distance inside the interval of a ray, which the kernel has widened by one number at each end.
#[inline]
fn inside(ray: &RtcRay, t: f32) -> f32 {
    t.max(if ray.tnear < 0.0 { 0.0 } else { ray.tnear })
        .min(ray.tfar)
}

/// How a query must be answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Every hit counts.
    Plain,
    /// Only hits count whose masks share a bit with that of the ray.
    Masked,
    /// Functions of the client decide.
    Called,
}

impl Committed {
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
        } else if mask & traits.common_mask == 0 {
            Way::Masked
        } else {
            Way::Plain
        }
    }

    /// The closest hit of a ray.
    pub fn intersect(&self, ray: &RtcRay, arguments: Option<&Arguments>) -> Option<(f32, RtcHit)> {
        match self.way(Query::Intersect, ray.mask, arguments) {
            Way::Plain => {
                let hit = self.bvh().intersect(&kernel_ray(ray))?;
                Some(self.found(ray, &hit, None))
            }
            Way::Masked => {
                let kernel = kernel_ray(ray);
                let hit = (self.bvh().query(&kernel))
                    .mask(ray.mask)
                    .filter(&|hit| self.counts(ray.mask, hit))
                    .intersect()?;
                Some(self.found(ray, &hit, None))
            }
            Way::Called => self.called(Query::Intersect, ray, arguments),
        }
    }

    /// Whether a ray is occluded.
    pub fn occluded(&self, ray: &RtcRay, arguments: Option<&Arguments>) -> bool {
        match self.way(Query::Occluded, ray.mask, arguments) {
            Way::Plain => self.bvh().occluded(&kernel_ray(ray)),
            Way::Masked => {
                let kernel = kernel_ray(ray);
                (self.bvh().query(&kernel))
                    .mask(ray.mask)
                    .filter(&|hit| self.counts(ray.mask, hit))
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
        let kernel = kernel_ray(ray);
        let visit = |hit: Hit| {
            if !self.counts(ray.mask, &hit) {
                return Visit::Reject;
            }
            let place = self.find(hit.inst_id, hit.geom_id);
            let found = self.found(ray, &hit, Some(&current));
            // Functions of user geometry call filters themselves.
            accepted = match place.0.geometry.kind {
                crate::geometry::Kind::User => Some(found),
                _ => current.filters.accept(place, ray, found, context),
            };
            match accepted {
                Some(_) => Visit::Accept,
                None => Visit::Reject,
            }
        };
        with_current(&current, || self.bvh().query(&kernel).visit_hits(visit));
        accepted
    }

    /// A hit as Embree writes it.
    pub fn found(&self, ray: &RtcRay, hit: &Hit, current: Option<&Current<'_>>) -> (f32, RtcHit) {
        let (placed, instance) = self.find(hit.inst_id, hit.geom_id);
        let reported = current.and_then(|current| {
            (placed.geometry.kind == crate::geometry::Kind::User)
                .then(|| current.reported(&placed.geometry, hit.prim_id, hit.t))?
        });
        let own = RtcHit {
            ng: match &reported {
                Some(reported) => reported.ng,
                None => normal(placed, instance, ray, hit),
            },
            u: hit.u,
            v: hit.v,
            prim_id: hit.prim_id,
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

/// The scene and the arguments of a query.
///
/// # Safety
/// Arguments as the caller documents, or null.
pub unsafe fn start<'a>(
    scene: &'a Scene,
    arguments: *const Arguments,
) -> Outcome<(&'a Committed, Option<&'a Arguments>)> {
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
                rayhit.ray.tfar = t;
                rayhit.hit = hit;
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
