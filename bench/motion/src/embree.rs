//! Embree 4 with two keys per geometry. Loaded at run time; see `bench/get-embree`.

use std::ffi::{CString, c_char, c_int, c_uint, c_void};
use std::ptr::null_mut;

use antumbra::Ray;
use libloading::Library;

use crate::scenes::{Key, Mesh};

type Handle = *mut c_void;
type New = unsafe extern "C" fn(Handle) -> Handle;
type NewGeometry = unsafe extern "C" fn(Handle, c_uint) -> Handle;
type Do = unsafe extern "C" fn(Handle);
type Set = unsafe extern "C" fn(Handle, c_uint);
type Attach = unsafe extern "C" fn(Handle, Handle) -> c_uint;
type NewBuffer = unsafe extern "C" fn(Handle, c_uint, c_uint, c_uint, usize, usize) -> *mut c_void;
type SetTransform = unsafe extern "C" fn(Handle, c_uint, *const Decomposition);

const UINT3: c_uint = 0x5003;
const FLOAT3: c_uint = 0x9003;
const TRIANGLES: c_uint = 0;
const INSTANCE: c_uint = 121;
const INDICES: c_uint = 0;
const VERTICES: c_uint = 1;

/// `RTCQuaternionDecomposition`.
#[repr(C, align(16))]
struct Decomposition {
    scale: [f32; 3],
    skew: [f32; 3],
    shift: [f32; 3],
    quaternion: [f32; 4],
    translation: [f32; 3],
}

/// `RTCRay`.
#[repr(C, align(16))]
#[derive(Clone, Copy, Default)]
struct Ray1 {
    org: [f32; 3],
    tnear: f32,
    dir: [f32; 3],
    time: f32,
    tfar: f32,
    mask: u32,
    id: u32,
    flags: u32,
}

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

/// `RTCRay16`.
#[repr(C, align(64))]
struct Ray16 {
    org: [[f32; 16]; 3],
    tnear: [f32; 16],
    dir: [[f32; 16]; 3],
    time: [f32; 16],
    tfar: [f32; 16],
    mask: [u32; 16],
    id: [u32; 16],
    flags: [u32; 16],
}

#[repr(align(64))]
struct Valid([c_int; 16]);

/// A device of one thread, and a scene.
pub struct Embree {
    library: &'static Library,
    device: Handle,
    scene: Handle,
    occluded1: unsafe extern "C" fn(Handle, *mut Ray1, Handle),
    intersect1: unsafe extern "C" fn(Handle, *mut RayHit, Handle),
    occluded16: unsafe extern "C" fn(*const c_int, Handle, *mut Ray16, Handle),
}

macro_rules! function {
    ($library:expr, $name:literal, $type:ty) => {{
        // SAFETY: Embree 4 exports a function of this type by this name.
        #[allow(unused_unsafe)]
        let symbol = unsafe { $library.get::<$type>(concat!($name, "\0").as_bytes()) };
        *symbol.expect($name)
    }};
}

impl Embree {
    pub fn load(path: &str) -> Self {
        // SAFETY: the user names the library of Embree.
        let library = unsafe { Library::new(path) }.expect("Embree's library");
        let library: &'static Library = Box::leak(Box::new(library));
        type NewDevice = unsafe extern "C" fn(*const c_char) -> Handle;
        let new_device = function!(library, "rtcNewDevice", NewDevice);
        let config = CString::new("threads=1").expect("no zero");
        // SAFETY: a text that ends with zero.
        let device = unsafe { new_device(config.as_ptr()) };
        Self {
            library,
            device,
            scene: null_mut(),
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
            occluded16: function!(
                library,
                "rtcOccluded16",
                unsafe extern "C" fn(*const c_int, Handle, *mut Ray16, Handle)
            ),
        }
    }

    /// A scene of one mesh with a list of positions for each key.
    pub fn build_mesh(&mut self, keys: &[&[[f32; 3]]], indices: &[[u32; 3]]) {
        self.scene = self.mesh_scene(keys, indices);
    }

    /// A scene of instances of a mesh that does not move.
    pub fn build_instances(&mut self, mesh: &Mesh, instances: &[[Key; 2]]) {
        let library = self.library;
        let object = self.mesh_scene(&[&mesh.positions], &mesh.indices);
        let new_geometry = function!(library, "rtcNewGeometry", NewGeometry);
        let set_scene = function!(
            library,
            "rtcSetGeometryInstancedScene",
            unsafe extern "C" fn(Handle, Handle)
        );
        let set_steps = function!(library, "rtcSetGeometryTimeStepCount", Set);
        let set_transform = function!(library, "rtcSetGeometryTransformQuaternion", SetTransform);
        let commit = function!(library, "rtcCommitGeometry", Do);
        let attach = function!(library, "rtcAttachGeometry", Attach);
        let release = function!(library, "rtcReleaseGeometry", Do);
        // SAFETY: handles are alive, and transforms are copied.
        unsafe {
            let scene = function!(library, "rtcNewScene", New)(self.device);
            for keys in instances {
                let geometry = new_geometry(self.device, INSTANCE);
                set_scene(geometry, object);
                set_steps(geometry, 2);
                for (step, key) in keys.iter().enumerate() {
                    let decomposition = Decomposition {
                        scale: [1.0; 3],
                        skew: [0.0; 3],
                        shift: [0.0; 3],
                        quaternion: key.quaternion,
                        translation: key.translation,
                    };
                    set_transform(geometry, step as c_uint, &decomposition);
                }
                commit(geometry);
                attach(scene, geometry);
                release(geometry);
            }
            function!(library, "rtcCommitScene", Do)(scene);
            self.scene = scene;
        }
    }

    fn mesh_scene(&self, keys: &[&[[f32; 3]]], indices: &[[u32; 3]]) -> Handle {
        let library = self.library;
        let new_buffer = function!(library, "rtcSetNewGeometryBuffer", NewBuffer);
        // SAFETY: handles are alive, and buffers have room for as many items as are copied.
        unsafe {
            let scene = function!(library, "rtcNewScene", New)(self.device);
            let geometry =
                function!(library, "rtcNewGeometry", NewGeometry)(self.device, TRIANGLES);
            function!(library, "rtcSetGeometryTimeStepCount", Set)(geometry, keys.len() as c_uint);
            for (slot, positions) in keys.iter().enumerate() {
                let count = positions.len();
                let to = new_buffer(geometry, VERTICES, slot as c_uint, FLOAT3, 12, count).cast();
                std::ptr::copy_nonoverlapping(positions.as_ptr(), to, count);
            }
            let to = new_buffer(geometry, INDICES, 0, UINT3, 12, indices.len()).cast();
            std::ptr::copy_nonoverlapping(indices.as_ptr(), to, indices.len());
            function!(library, "rtcCommitGeometry", Do)(geometry);
            function!(library, "rtcAttachGeometry", Attach)(scene, geometry);
            function!(library, "rtcReleaseGeometry", Do)(geometry);
            function!(library, "rtcCommitScene", Do)(scene);
            scene
        }
    }

    /// `rtcOccluded1` for every ray.
    pub fn occluded(&self, rays: &[Ray], times: &[f32], occluded: &mut [bool]) {
        for ((ray, time), occluded) in rays.iter().zip(times).zip(occluded) {
            let mut asked = single(ray, *time);
            // SAFETY: the scene is committed, and the ray laid out as an `RTCRay`.
            unsafe { (self.occluded1)(self.scene, &mut asked, null_mut()) };
            *occluded = asked.tfar == f32::NEG_INFINITY;
        }
    }

    /// `rtcIntersect1` for every ray: distances, infinite for a miss.
    pub fn intersect(&self, rays: &[Ray], times: &[f32], distances: &mut [f32]) {
        for ((ray, time), distance) in rays.iter().zip(times).zip(distances) {
            let mut asked = RayHit {
                ray: single(ray, *time),
                geom_id: u32::MAX,
                inst_id: [u32::MAX; 2],
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

    /// `rtcOccluded16` for every packet; what is left over goes one by one.
    pub fn occluded_packets(&self, rays: &[Ray], times: &[f32], occluded: &mut [bool]) {
        let valid = Valid([-1; 16]);
        let (packets, rest) = rays.as_chunks::<16>();
        let (packet_times, last_times) = times.as_chunks::<16>();
        let (answers, last) = occluded.as_chunks_mut::<16>();
        for ((rays, times), answers) in packets.iter().zip(packet_times).zip(answers) {
            let mut asked = Ray16 {
                org: [0, 1, 2].map(|axis| rays.map(|ray| ray.org[axis])),
                tnear: rays.map(|ray| ray.tnear),
                dir: [0, 1, 2].map(|axis| rays.map(|ray| ray.dir[axis])),
                time: *times,
                tfar: rays.map(|ray| ray.tfar),
                mask: [u32::MAX; 16],
                id: [0; 16],
                flags: [0; 16],
            };
            // SAFETY: the scene is committed, and the rays laid out as an `RTCRay16`.
            unsafe { (self.occluded16)(valid.0.as_ptr(), self.scene, &mut asked, null_mut()) };
            *answers = asked.tfar.map(|tfar| tfar == f32::NEG_INFINITY);
        }
        self.occluded(rest, last_times, last);
    }
}

fn single(ray: &Ray, time: f32) -> Ray1 {
    Ray1 {
        org: ray.org,
        tnear: ray.tnear,
        dir: ray.dir,
        time,
        tfar: ray.tfar,
        mask: u32::MAX,
        ..Ray1::default()
    }
}
