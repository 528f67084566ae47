//! Embree's calls for rays, points and filters, one ray or 16 at a time.

use std::cell::{Cell, RefCell};
use std::ffi::{c_int, c_uint, c_void};
use std::ptr::null_mut;

use antumbra::Ray;
use libloading::Library;

use crate::embree::{Embree, Handle, Ray1, Rays, Valid};
use crate::input::Mesh;

/// How rays are handed over.
#[derive(Clone, Copy, PartialEq)]
pub enum Call {
    /// `rtcOccluded1`, `rtcIntersect1`.
    Single,
    /// `rtcOccluded16`, `rtcIntersect16`.
    Packets,
    /// Packets with `RTC_RAY_QUERY_FLAG_COHERENT`.
    Coherent,
}

/// Ways to call Embree that most jobs try.
pub const CALLS: [(&str, Call); 3] = [
    ("single", Call::Single),
    ("packets", Call::Packets),
    ("coherent packets", Call::Coherent),
];

/// `RTCOccludedArguments` and `RTCIntersectArguments`.
#[repr(C)]
struct Arguments {
    flags: c_uint,
    features: c_uint,
    context: *mut Tinting,
    filter: Option<unsafe extern "C" fn(*const FilterArguments)>,
    function: Handle,
}

const COHERENT: c_uint = 1 << 16;
const INVOKE_ARGUMENT_FILTER: c_uint = 1 << 1;
const SCENE_FLAG_FILTER_IN_ARGUMENTS: c_uint = 1 << 3;

impl Arguments {
    const fn new(flags: c_uint) -> Self {
        Self {
            flags,
            features: u32::MAX,
            context: null_mut(),
            filter: None,
            function: null_mut(),
        }
    }
}

/// `RTCHit`, and `RTCHit16`.
#[repr(C)]
#[derive(Clone, Copy)]
struct Hits<const N: usize> {
    normal: [[f32; N]; 3],
    uv: [[f32; N]; 2],
    prim_id: [u32; N],
    geom_id: [u32; N],
    inst_ids: [[u32; N]; 2],
}

#[repr(C, align(16))]
struct RayHit1 {
    ray: Ray1,
    hit: Hits<1>,
}

#[repr(C, align(64))]
struct RayHits {
    rays: Rays<16>,
    hits: Hits<16>,
}

type Each<R> = unsafe extern "C" fn(Handle, *mut R, *mut Arguments);
type Many<R> = unsafe extern "C" fn(*const c_int, Handle, *mut R, *mut Arguments);

/// Embree with the functions that jobs call.
pub struct Rtc {
    embree: RefCell<Embree>,
    scene: Cell<Handle>,
    occluded1: Each<Ray1>,
    occluded16: Many<Rays<16>>,
    intersect1: Each<RayHit1>,
    intersect16: Many<RayHits>,
    point_query: PointQueryFunction,
}

impl Rtc {
    pub fn load(path: &str) -> Self {
        let embree = Embree::load(path);
        let library = embree.library;
        // SAFETY: Embree 4 exports functions of these types by these names.
        unsafe {
            Self {
                scene: Cell::new(null_mut()),
                occluded1: find(library, "rtcOccluded1"),
                occluded16: find(library, "rtcOccluded16"),
                intersect1: find(library, "rtcIntersect1"),
                intersect16: find(library, "rtcIntersect16"),
                point_query: find(library, "rtcPointQuery"),
                embree: RefCell::new(embree),
            }
        }
    }

    /// Builds a scene of quality MEDIUM, the default.
    pub fn build(&self, mesh: &Mesh) {
        let mut embree = self.embree.borrow_mut();
        embree.build(mesh);
        self.scene.set(embree.scene);
    }

    /// Scenes that are built from now on call filters of arguments, or not.
    pub fn set_filters(&self, has_filters: bool) {
        self.embree.borrow_mut().scene_flags = match has_filters {
            true => SCENE_FLAG_FILTER_IN_ARGUMENTS,
            false => 0,
        };
    }

    /// Whether each of `count` rays is occluded.
    #[inline]
    pub fn occluded(
        &self,
        call: Call,
        count: usize,
        ray: impl Fn(usize) -> Ray,
        mut found: impl FnMut(usize, bool),
    ) {
        self.occluded_by(Arguments::new(0), call, count, ray, &mut found);
    }

    #[inline]
    fn occluded_by(
        &self,
        mut arguments: Arguments,
        call: Call,
        count: usize,
        ray: impl Fn(usize) -> Ray,
        found: &mut impl FnMut(usize, bool),
    ) {
        if call == Call::Single {
            for index in 0..count {
                let mut asked = single(&ray(index), index);
                // SAFETY: the scene is committed, and the ray is an `RTCRay`.
                unsafe { (self.occluded1)(self.scene.get(), &mut asked, &mut arguments) };
                found(index, asked.tfar == f32::NEG_INFINITY);
            }
            return;
        }
        if call == Call::Coherent {
            arguments.flags |= COHERENT;
        }
        for first in (0..count).step_by(16) {
            let (mut asked, valid) = packet(first, count, &ray);
            // SAFETY: the scene is committed, and the rays are an `RTCRay16`.
            unsafe {
                (self.occluded16)(
                    valid.0.as_ptr(),
                    self.scene.get(),
                    &mut asked,
                    &mut arguments,
                )
            };
            for index in first..count.min(first + 16) {
                found(index, asked.tfar[index - first] == f32::NEG_INFINITY);
            }
        }
    }

    /// Distance of the closest hit of each of `count` rays, infinite for none, and the triangle.
    #[inline]
    pub fn intersect(
        &self,
        call: Call,
        count: usize,
        ray: impl Fn(usize) -> Ray,
        mut found: impl FnMut(usize, f32, u32),
    ) {
        const NONE: u32 = u32::MAX;
        let mut arguments = Arguments::new(if call == Call::Coherent { COHERENT } else { 0 });
        if call == Call::Single {
            for index in 0..count {
                let ray = single(&ray(index), index);
                let mut asked = RayHit1 {
                    ray,
                    hit: no_hits(),
                };
                // SAFETY: the scene is committed, and the ray is an `RTCRayHit`.
                unsafe { (self.intersect1)(self.scene.get(), &mut asked, &mut arguments) };
                let is_hit = asked.hit.geom_id[0] != NONE;
                found(
                    index,
                    if is_hit {
                        asked.ray.tfar
                    } else {
                        f32::INFINITY
                    },
                    asked.hit.prim_id[0],
                );
            }
            return;
        }
        for first in (0..count).step_by(16) {
            let (rays, valid) = packet(first, count, &ray);
            let mut asked = RayHits {
                rays,
                hits: no_hits(),
            };
            // SAFETY: the scene is committed, and the rays are an `RTCRayHit16`.
            unsafe {
                (self.intersect16)(
                    valid.0.as_ptr(),
                    self.scene.get(),
                    &mut asked,
                    &mut arguments,
                )
            };
            for index in first..count.min(first + 16) {
                let lane = index - first;
                let is_hit = asked.hits.geom_id[lane] != NONE;
                let t = if is_hit {
                    asked.rays.tfar[lane]
                } else {
                    f32::INFINITY
                };
                found(index, t, asked.hits.prim_id[lane]);
            }
        }
    }

    /// Multiplies the light of each ray by the tints of all quads on its way, in a filter function that rejects every hit.
    pub fn tinted(&self, call: Call, rays: &[Ray], tints: &[[f32; 3]], lights: &mut [[f32; 3]]) {
        let mut tinting = Tinting {
            inst_ids: [u32::MAX; 2],
            tints: tints.as_ptr(),
            lights: lights.as_mut_ptr(),
        };
        let arguments = Arguments {
            context: &mut tinting,
            filter: Some(tint),
            ..Arguments::new(INVOKE_ARGUMENT_FILTER)
        };
        self.occluded_by(
            arguments,
            call,
            rays.len(),
            |index| rays[index],
            &mut |_, _| {},
        );
    }

    /// Distance of the nearest triangle from each point. `is_bounded`: searches no farther than the nearest triangle of the point
    /// before can be.
    pub fn distances(&self, mesh: &Mesh, points: &[[f32; 3]], is_bounded: bool) -> Vec<f32> {
        let mut last: Option<([f32; 3], f32)> = None;
        let mut distances = Vec::with_capacity(points.len());
        for &position in points {
            let radius = match last {
                Some((before, distance)) if is_bounded => {
                    let step = crate::input::less(position, before);
                    1.0001 * (distance + crate::input::dot(step, step).sqrt())
                }
                _ => f32::INFINITY,
            };
            let mut query = PointQuery {
                position,
                time: 0.0,
                radius,
            };
            let mut context = PointContext([0; 40]);
            let mut nearest = Nearest {
                mesh,
                distance2: f32::INFINITY,
            };
            // SAFETY: the scene is committed, query and context have their layouts, and the function gets what it expects.
            unsafe {
                let user = (&raw mut nearest).cast();
                (self.point_query)(
                    self.scene.get(),
                    &mut query,
                    &mut context,
                    Some(closer),
                    user,
                );
            }
            let distance = nearest.distance2.sqrt();
            distances.push(distance);
            last = Some((position, distance));
        }
        distances
    }
}

/// # Safety
/// The library has a symbol of this type by this name.
unsafe fn find<T: Copy>(library: &Library, name: &str) -> T {
    // SAFETY: the caller's duty.
    *unsafe { library.get::<T>(name.as_bytes()) }.expect(name)
}

#[inline]
fn single(ray: &Ray, index: usize) -> Ray1 {
    Ray1 {
        org: ray.org,
        tnear: ray.tnear,
        dir: ray.dir,
        tfar: ray.tfar,
        mask: u32::MAX,
        id: index as u32,
        ..Ray1::default()
    }
}

/// Rays from `first` on, as far as there are any.
#[inline]
fn packet(first: usize, count: usize, ray: &impl Fn(usize) -> Ray) -> (Rays<16>, Valid<16>) {
    let lanes: [usize; 16] = std::array::from_fn(|lane| first + lane);
    let rays = lanes.map(|index| ray(index.min(count - 1)));
    let packet = Rays {
        org: [0, 1, 2].map(|axis| rays.map(|ray| ray.org[axis])),
        tnear: rays.map(|ray| ray.tnear),
        dir: [0, 1, 2].map(|axis| rays.map(|ray| ray.dir[axis])),
        time: [0.0; 16],
        tfar: rays.map(|ray| ray.tfar),
        mask: [u32::MAX; 16],
        id: lanes.map(|index| index as u32),
        flags: [0; 16],
    };
    (
        packet,
        Valid(lanes.map(|index| if index < count { -1 } else { 0 })),
    )
}

fn no_hits<const N: usize>() -> Hits<N> {
    Hits {
        normal: [[0.0; N]; 3],
        uv: [[0.0; N]; 2],
        prim_id: [u32::MAX; N],
        geom_id: [u32::MAX; N],
        inst_ids: [[u32::MAX; N]; 2],
    }
}

/// `RTCRayQueryContext`, with what the filter needs behind it.
#[repr(C)]
struct Tinting {
    inst_ids: [u32; 2],
    tints: *const [f32; 3],
    lights: *mut [f32; 3],
}

/// `RTCFilterFunctionNArguments`.
#[repr(C)]
struct FilterArguments {
    valid: *mut c_int,
    user: Handle,
    context: *mut Tinting,
    ray: *const u32,
    hit: *const u32,
    lanes: c_uint,
}

/// Tints the light of rays at a quad, which is two triangles, and lets them through.
unsafe extern "C" fn tint(arguments: *const FilterArguments) {
    /// Properties of `RTCRayN` and `RTCHitN`, by position.
    const ID: usize = 10;
    const PRIM_ID: usize = 5;
    // SAFETY: Embree passes its arguments with the context of the call; rays are numbered by their lights, quads by their tints.
    unsafe {
        let arguments = &*arguments;
        let lanes = arguments.lanes as usize;
        for lane in 0..lanes {
            if *arguments.valid.add(lane) != 0 {
                let ray = *arguments.ray.add(ID * lanes + lane) as usize;
                let quad = *arguments.hit.add(PRIM_ID * lanes + lane) as usize / 2;
                let context = &*arguments.context;
                let (light, tint) = (&mut *context.lights.add(ray), &*context.tints.add(quad));
                for (light, tint) in light.iter_mut().zip(tint) {
                    *light *= tint;
                }
                *arguments.valid.add(lane) = 0;
            }
        }
    }
}

/// `RTCPointQuery`.
#[repr(C, align(16))]
struct PointQuery {
    position: [f32; 3],
    time: f32,
    radius: f32,
}

/// `RTCPointQueryContext`, of no instance, with room to spare.
#[repr(C, align(16))]
struct PointContext([u32; 40]);

/// `RTCPointQueryFunctionArguments`.
#[repr(C, align(16))]
struct PointArguments {
    query: *mut PointQuery,
    user: *mut c_void,
    prim_id: c_uint,
    geom_id: c_uint,
    context: *mut PointContext,
    similarity: f32,
}

type PointQueryFunction = unsafe extern "C" fn(
    Handle,
    *mut PointQuery,
    *mut PointContext,
    Option<unsafe extern "C" fn(*mut PointArguments) -> bool>,
    *mut c_void,
) -> bool;

struct Nearest<'m> {
    mesh: &'m Mesh,
    distance2: f32,
}

/// Shrinks a query to the distance of a triangle that is nearer than those before.
unsafe extern "C" fn closer(arguments: *mut PointArguments) -> bool {
    // SAFETY: Embree passes its arguments, with the query and the user data of the call.
    let (query, nearest, triangle) = unsafe {
        let arguments = &*arguments;
        let nearest = &mut *arguments.user.cast::<Nearest<'_>>();
        (&mut *arguments.query, nearest, arguments.prim_id)
    };
    let corners = nearest.mesh.indices[triangle as usize];
    let corners = corners.map(|corner| nearest.mesh.positions[corner as usize]);
    let distance2 = crate::closest::distance2(query.position, corners);
    if distance2 < nearest.distance2 {
        nearest.distance2 = distance2;
        query.radius = distance2.sqrt();
        return true;
    }
    false
}
