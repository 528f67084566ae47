//! Queries: plain ones straight to the kernel, others with masks, filters and functions of the client.
//!
//! `lanes` has packets and streams, `points` point queries; `normal` and `curves` what Embree's hits say more.

mod curves;
mod filter;
mod lanes;
mod normal;
mod points;

use std::cell::RefCell;
use std::ptr;

use antumbra::{Hit, Ray, Visit};

use crate::abi::{Arguments, Context, RtcHit, RtcRay, RtcRayHit};
use crate::device::look_mut;
use crate::geometry::{Filters, Kind, Query};
use crate::scene::{Committed, Current, Scene, Traits, with_current};
use lanes::Lane;

/// What an occluded ray finds: what `tfar` becomes, and no hit.
const OCCLUDED: (f32, RtcHit) = (f32::NEG_INFINITY, RtcHit::MISS);

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
enum Way {
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
    fn kernel_ray(&self, ray: &RtcRay) -> Ray {
        let open = Ray {
            org: ray.org,
            tnear: near_end(ray),
            dir: ray.dir,
            tfar: ray.tfar,
        };
        let closed = open.closed();
        match self.traits.has(Traits::NEAR_IS_CLOSED) {
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
    fn way(&self, query: Query, mask: u32, arguments: Option<&Arguments>) -> Way {
        let traits = &self.traits;
        let filter = match query {
            Query::Intersect => Traits::INTERSECT_FILTER,
            Query::Occluded => Traits::OCCLUDED_FILTER,
        };
        let is_called = traits.has(filter | Traits::USER_GEOMETRY)
            || arguments.is_some_and(|arguments| {
                let filters = Filters::new(query, Some(arguments));
                (filters.of_arguments(traits.has(Traits::TAKES_ARGUMENT_FILTER))).is_some()
            });
        if is_called {
            Way::Called
        } else if mask & traits.common_mask == 0 || traits.has(Traits::CURVES) {
            Way::Masked
        } else {
            Way::Plain
        }
    }

    /// Whether a hit counts for the mask of a ray and, on curves, by Embree's rule.
    fn counts(&self, ray: &RtcRay, hit: &Hit) -> bool {
        let site = self.find(hit.inst_id, hit.geom_id);
        site.state().mask & ray.mask != 0
            && (site.instance).is_none_or(|instance| instance.mask & ray.mask != 0)
            && curves::counts(site, ray, hit)
    }

    /// What a ray finds: the closest hit, or that it is occluded.
    #[inline(always)]
    fn answer(
        &self,
        query: Query,
        ray: &RtcRay,
        arguments: Option<&Arguments>,
    ) -> Option<(f32, RtcHit)> {
        let way = self.way(query, ray.mask, arguments);
        if way == Way::Called {
            let found = self.called(query, ray, arguments)?;
            return Some(match query {
                Query::Intersect => found,
                Query::Occluded => OCCLUDED,
            });
        }
        let kernel = self.kernel_ray(ray);
        let counts = |hit: &Hit| self.counts(ray, hit);
        let masked = || self.bvh().query(&kernel).mask(ray.mask).filter(&counts);
        let hit = match (query, way) {
            (Query::Intersect, Way::Plain) => self.bvh().intersect(&kernel)?,
            (Query::Intersect, _) => masked().intersect()?,
            (Query::Occluded, Way::Plain) => {
                return self.bvh().occluded(&kernel).then_some(OCCLUDED);
            }
            (Query::Occluded, _) => return masked().occluded().then_some(OCCLUDED),
        };
        Some(self.found(ray, &hit, None))
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
            let site = self.find(hit.inst_id, hit.geom_id);
            let found = self.found(ray, hit, Some(&current));
            // Functions of user geometry call filters themselves.
            *accepted = match site.kind() {
                Kind::User => Some(found),
                _ => filter::accept(current.filters, site, ray, found, context),
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
            behind.0.extend(self.far_side(ray, kernel.tfar, &hit));
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
    fn far_side(&self, ray: &RtcRay, tfar: f32, hit: &Hit) -> Option<Hit> {
        let site = self.find(hit.inst_id, hit.geom_id);
        if site.kind() != Kind::Spheres {
            return None;
        }
        let (org, dir) = site.in_object(ray);
        let [x, y, z, _]: [f32; 4] = normal::item(site.state().vertices.as_ref(), hit.prim_id)?;
        let along = |to: [f32; 3]| -> f64 {
            (0..3)
                .map(|axis| f64::from(to[axis]) * f64::from(dir[axis]))
                .sum()
        };
        let to_center = [x - org[0], y - org[1], z - org[2]];
        let middle = along(to_center) / along(dir);
        let t = (2.0 * middle - f64::from(hit.t)) as f32;
        (hit.t < t && t < tfar).then_some(Hit { t, ..*hit })
    }

    /// A hit as Embree writes it.
    fn found(&self, ray: &RtcRay, hit: &Hit, current: Option<&Current<'_>>) -> (f32, RtcHit) {
        let site = self.find(hit.inst_id, hit.geom_id);
        let reported = (current.filter(|_| site.kind() == Kind::User))
            .and_then(|current| current.reported(&site.placed.geometry, hit.prim_id, hit.t));
        let hit = match site.kind() {
            Kind::Curves(basis) => {
                &curves::own_hit(basis, site, ray, hit).map_or(*hit, |own| own.hit)
            }
            _ => hit,
        };
        let own = RtcHit {
            ng: match &reported {
                Some(reported) => reported.ng,
                None => normal::normal(site, ray, hit),
            },
            u: hit.u,
            v: hit.v,
            prim_id: hit.prim_id,
            geom_id: site.placed.geom_id,
            ..RtcHit::MISS
        };
        let hit_written = match site.instance {
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
    /// Takes the nearest one up to `t`.
    fn before(&mut self, t: f32) -> Option<Hit> {
        let near = (self.0.iter().enumerate()).filter(|(_, hit)| hit.t <= t);
        let (place, _) = near.min_by(|(_, a), (_, b)| a.t.total_cmp(&b.t))?;
        Some(self.0.swap_remove(place))
    }
}

exports! {
    fn rtcIntersect1 | rtcTraversableIntersect1(
        scene: Scene,
        rayhit: *mut RtcRayHit,
        arguments: *const Arguments,
    ) {
        let committed = scene.committed()?;
        let rayhit = look_mut(rayhit)?;
        if let Some(found) = committed.answer(Query::Intersect, &rayhit.ray, arguments.as_ref()) {
            // Field by field: the end of the structure may belong to the client.
            let first = std::ptr::from_mut(rayhit).cast();
            Lane { first, stride: 1 }.write(Query::Intersect, &found);
        }
        Ok(())
    }

    fn rtcOccluded1 | rtcTraversableOccluded1(
        scene: Scene,
        ray: *mut RtcRay,
        arguments: *const Arguments,
    ) {
        let committed = scene.committed()?;
        let ray = look_mut(ray)?;
        if let Some((t, _)) = committed.answer(Query::Occluded, ray, arguments.as_ref()) {
            ray.tfar = t;
        }
        Ok(())
    }
}
