//! Embree 4 as its users call it: one ray, or packets of 4, 8 and 16. Loaded at run time; see `bench/get-embree`.

use std::ffi::{CString, c_char, c_int, c_uint, c_void};
use std::ptr::null_mut;

use libloading::Library;

use crate::input::Mesh;
use antumbra::Ray;

/// Device, geometry or scene.
pub type Handle = *mut c_void;

/// `RTCFormat` and the numbers of an item.
type Format = (c_uint, usize);
const UINT: Format = (0x5001, 1);
const UINT3: Format = (0x5003, 3);
const FLOAT3: Format = (0x9003, 3);
const FLOAT4: Format = (0x9004, 4);

/// `RTCGeometryType`.
const TRIANGLES: c_uint = 0;
const FLAT_LINEAR_CURVES: c_uint = 17;

/// `RTCBufferType`.
const INDICES: c_uint = 0;
const VERTICES: c_uint = 1;

/// `RTCRay`.
#[repr(C, align(16))]
#[derive(Clone, Copy, Default)]
pub struct Ray1 {
    pub org: [f32; 3],
    pub tnear: f32,
    pub dir: [f32; 3],
    pub time: f32,
    pub tfar: f32,
    pub mask: u32,
    pub id: u32,
    pub flags: u32,
}

/// `RTCRay4`, `RTCRay8` and `RTCRay16`.
#[repr(C, align(64))]
#[derive(Clone, Copy)]
pub struct Rays<const N: usize> {
    pub org: [[f32; N]; 3],
    pub tnear: [f32; N],
    pub dir: [[f32; N]; 3],
    pub time: [f32; N],
    pub tfar: [f32; N],
    pub mask: [u32; N],
    pub id: [u32; N],
    pub flags: [u32; N],
}

/// Which lanes of a packet have a ray: -1, or 0.
#[repr(align(64))]
pub struct Valid<const N: usize>(pub [c_int; N]);

/// `RTCRayHit`.
#[repr(C, align(16))]
#[derive(Clone, Copy, Default)]
struct RayHit {
    ray: Ray1,
    normal: [f32; 3],
    uv: [f32; 2],
    prim_id: u32,
    geom_id: u32,
    inst_id: [u32; 2],
}

type Occluded<R> = unsafe extern "C" fn(*const c_int, Handle, *mut R, Handle);

/// A scene of one mesh, and the functions that ask about it.
pub struct Embree {
    /// Null before the first build.
    pub scene: Handle,
    /// `RTCSceneFlags` of the scenes that are built.
    pub scene_flags: c_uint,
    occluded1: unsafe extern "C" fn(Handle, *mut Ray1, Handle),
    intersect1: unsafe extern "C" fn(Handle, *mut RayHit, Handle),
    occluded4: Occluded<Rays<4>>,
    occluded8: Occluded<Rays<8>>,
    occluded16: Occluded<Rays<16>>,
    /// Never unloaded: its scheduler may still have threads.
    pub library: &'static Library,
    device: Handle,
}

macro_rules! function {
    ($library:expr, $name:literal, $type:ty) => {{
        // SAFETY: Embree 4 exports a function of this type by this name.
        let symbol = unsafe { $library.get::<$type>(concat!($name, "\0").as_bytes()) };
        *symbol.expect($name)
    }};
}

impl Embree {
    /// Loads the library and makes its device, of one thread.
    pub fn load(path: &str) -> Self {
        // SAFETY: the user names the library of Embree.
        let library = unsafe { Library::new(path) }.expect("Embree's library");
        let library: &'static Library = Box::leak(Box::new(library));
        let new_device = function!(
            library,
            "rtcNewDevice",
            unsafe extern "C" fn(*const c_char) -> Handle
        );
        let config = CString::new("threads=1").expect("no zero");
        // SAFETY: a text that ends with zero.
        let device = unsafe { new_device(config.as_ptr()) };
        Self {
            scene: null_mut(),
            scene_flags: 0,
            occluded1: function!(
                library,
                "rtcOccluded1",
                unsafe extern "C" fn(Handle, *mut Ray1, Handle)
            ),
            intersect1: function!(
                library,
                "rtcIntersect1",
                unsafe extern "C" fn(Handle, *mut RayHit, Handle)
            ),
            occluded4: function!(library, "rtcOccluded4", Occluded<Rays<4>>),
            occluded8: function!(library, "rtcOccluded8", Occluded<Rays<8>>),
            occluded16: function!(library, "rtcOccluded16", Occluded<Rays<16>>),
            library,
            device,
        }
    }

    /// Builds a scene of quality MEDIUM, the default.
    pub fn build(&mut self, mesh: &Mesh) {
        self.build_of(
            TRIANGLES,
            (mesh.positions.as_flattened(), FLOAT3),
            (mesh.indices.as_flattened(), UINT3),
        );
    }

    /// Builds a scene of flat linear curves: x, y, z, radius of each point, the first point of each segment.
    pub fn build_curves(&mut self, points: &[[f32; 4]], segments: &[u32]) {
        self.build_of(
            FLAT_LINEAR_CURVES,
            (points.as_flattened(), FLOAT4),
            (segments, UINT),
        );
    }

    /// Builds a scene of a geometry of this type, of its vertices and indices with their formats.
    fn build_of(
        &mut self,
        kind: c_uint,
        (vertices, vertex): (&[f32], Format),
        (indices, index): (&[u32], Format),
    ) {
        type New = unsafe extern "C" fn(Handle) -> Handle;
        type Do = unsafe extern "C" fn(Handle);
        let library = self.library;
        let new_scene = function!(library, "rtcNewScene", New);
        let new_geometry = function!(
            library,
            "rtcNewGeometry",
            unsafe extern "C" fn(Handle, c_uint) -> Handle
        );
        let new_buffer = function!(
            library,
            "rtcSetNewGeometryBuffer",
            unsafe extern "C" fn(Handle, c_uint, c_uint, c_uint, usize, usize) -> *mut c_void
        );
        let commit_geometry = function!(library, "rtcCommitGeometry", Do);
        let attach = function!(
            library,
            "rtcAttachGeometry",
            unsafe extern "C" fn(Handle, Handle) -> c_uint
        );
        let release_geometry = function!(library, "rtcReleaseGeometry", Do);
        let set_flags = function!(
            library,
            "rtcSetSceneFlags",
            unsafe extern "C" fn(Handle, c_uint)
        );
        let commit_scene = function!(library, "rtcCommitScene", Do);
        let release_scene = function!(library, "rtcReleaseScene", Do);
        // SAFETY: handles are alive; buffers have room for as many items as are copied.
        unsafe {
            if !self.scene.is_null() {
                release_scene(self.scene);
            }
            let scene = new_scene(self.device);
            set_flags(scene, self.scene_flags);
            let geometry = new_geometry(self.device, kind);
            let (format, numbers) = vertex;
            let count = vertices.len() / numbers;
            let to = new_buffer(geometry, VERTICES, 0, format, 4 * numbers, count).cast();
            std::ptr::copy_nonoverlapping(vertices.as_ptr(), to, vertices.len());
            let (format, numbers) = index;
            let count = indices.len() / numbers;
            let to = new_buffer(geometry, INDICES, 0, format, 4 * numbers, count).cast();
            std::ptr::copy_nonoverlapping(indices.as_ptr(), to, indices.len());
            commit_geometry(geometry);
            attach(scene, geometry);
            release_geometry(geometry);
            commit_scene(scene);
            self.scene = scene;
        }
    }

    /// `rtcOccluded1` for every ray.
    pub fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        for (ray, occluded) in rays.iter().zip(occluded) {
            let mut asked = single(ray);
            // SAFETY: the scene is committed, and the ray laid out as an `RTCRay`.
            unsafe { (self.occluded1)(self.scene, &mut asked, null_mut()) };
            *occluded = asked.tfar == f32::NEG_INFINITY;
        }
    }

    /// `rtcIntersect1` for every ray: distances, infinite for a miss.
    pub fn intersect(&self, rays: &[Ray], distances: &mut [f32]) {
        for (ray, distance) in rays.iter().zip(distances) {
            let mut asked = RayHit {
                ray: single(ray),
                geom_id: u32::MAX,
                ..RayHit::default()
            };
            // SAFETY: the scene is committed, and the ray laid out as an `RTCRayHit`.
            unsafe { (self.intersect1)(self.scene, &mut asked, null_mut()) };
            *distance = match asked.geom_id {
                u32::MAX => f32::INFINITY,
                _ => asked.ray.tfar,
            };
        }
    }

    /// `rtcOccluded4`, `8` or `16` for every packet; what is left over goes one by one.
    pub fn occluded_packets(&self, size: usize, rays: &[Ray], occluded: &mut [bool]) {
        match size {
            4 => self.packets(self.occluded4, rays, occluded),
            8 => self.packets(self.occluded8, rays, occluded),
            _ => self.packets(self.occluded16, rays, occluded),
        }
    }

    fn packets<const N: usize>(&self, ask: Occluded<Rays<N>>, rays: &[Ray], occluded: &mut [bool]) {
        let valid = Valid([-1; N]);
        let (packets, rest) = rays.as_chunks::<N>();
        let (answers, last) = occluded.as_chunks_mut::<N>();
        for (rays, answers) in packets.iter().zip(answers) {
            let mut asked = Rays {
                org: [0, 1, 2].map(|axis| rays.map(|ray| ray.org[axis])),
                tnear: rays.map(|ray| ray.tnear),
                dir: [0, 1, 2].map(|axis| rays.map(|ray| ray.dir[axis])),
                time: [0.0; N],
                tfar: rays.map(|ray| ray.tfar),
                mask: [u32::MAX; N],
                id: [0; N],
                flags: [0; N],
            };
            // SAFETY: the scene is committed, and the rays laid out as those of a packet.
            unsafe { ask(valid.0.as_ptr(), self.scene, &mut asked, null_mut()) };
            *answers = asked.tfar.map(|tfar| tfar == f32::NEG_INFINITY);
        }
        self.occluded(rest, last);
    }
}

fn single(ray: &Ray) -> Ray1 {
    Ray1 {
        org: ray.org,
        tnear: ray.tnear,
        dir: ray.dir,
        tfar: ray.tfar,
        mask: u32::MAX,
        ..Ray1::default()
    }
}
