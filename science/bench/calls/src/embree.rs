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
const INSTANCE: c_uint = 121;

/// `RTCBufferType`.
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

/// A rotation, `[w, x, y, z]`, and a translation.
#[derive(Clone, Copy)]
pub struct Key {
    pub quaternion: [f32; 4],
    pub translation: [f32; 3],
}

impl Key {
    /// The transform row by row.
    pub fn rows(&self) -> [[f32; 4]; 3] {
        let [w, x, y, z] = self.quaternion;
        let [a, b, c] = self.translation;
        [
            [
                1.0 - 2.0 * (y * y + z * z),
                2.0 * (x * y - w * z),
                2.0 * (x * z + w * y),
                a,
            ],
            [
                2.0 * (x * y + w * z),
                1.0 - 2.0 * (x * x + z * z),
                2.0 * (y * z - w * x),
                b,
            ],
            [
                2.0 * (x * z - w * y),
                2.0 * (y * z + w * x),
                1.0 - 2.0 * (x * x + y * y),
                c,
            ],
        ]
    }
}

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

type New = unsafe extern "C" fn(Handle) -> Handle;
type NewGeometry = unsafe extern "C" fn(Handle, c_uint) -> Handle;
type Set = unsafe extern "C" fn(Handle, c_uint);
type Do = unsafe extern "C" fn(Handle);
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
        self.build_moving(&[&mesh.positions], &mesh.indices);
    }

    /// Builds a scene of a mesh with positions for each key.
    pub fn build_moving(&mut self, keys: &[&[[f32; 3]]], indices: &[[u32; 3]]) {
        let keys: Vec<&[f32]> = keys
            .iter()
            .map(|positions| positions.as_flattened())
            .collect();
        let scene = self.scene_of(TRIANGLES, (&keys, FLOAT3), (indices.as_flattened(), UINT3));
        self.replace(scene);
    }

    /// Builds a scene of flat linear curves: x, y, z, radius of each point, the first point of each segment.
    pub fn build_curves(&mut self, points: &[[f32; 4]], segments: &[u32]) {
        let points = [points.as_flattened()];
        let scene = self.scene_of(FLAT_LINEAR_CURVES, (&points, FLOAT4), (segments, UINT));
        self.replace(scene);
    }

    /// Builds a scene of instances of a mesh, which move between two keys.
    pub fn build_instances(&mut self, mesh: &Mesh, instances: &[[Key; 2]]) {
        let positions = [mesh.positions.as_flattened()];
        let indices = mesh.indices.as_flattened();
        let object = self.scene_of(TRIANGLES, (&positions, FLOAT3), (indices, UINT3));
        let library = self.library;
        let new_geometry = function!(library, "rtcNewGeometry", NewGeometry);
        type SetScene = unsafe extern "C" fn(Handle, Handle);
        let set_scene = function!(library, "rtcSetGeometryInstancedScene", SetScene);
        let set_steps = function!(library, "rtcSetGeometryTimeStepCount", Set);
        type SetTransform = unsafe extern "C" fn(Handle, c_uint, *const Decomposition);
        let set_transform = function!(library, "rtcSetGeometryTransformQuaternion", SetTransform);
        let new_scene = function!(library, "rtcNewScene", New);
        let release_scene = function!(library, "rtcReleaseScene", Do);
        let commit_scene = function!(library, "rtcCommitScene", Do);
        // SAFETY: handles are alive, and transforms are copied.
        unsafe {
            let scene = new_scene(self.device);
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
                self.attach(scene, geometry);
            }
            release_scene(object);
            commit_scene(scene);
            self.replace(scene);
        }
    }

    /// A scene of a geometry of this type, of its vertices at each key and its indices, with their formats.
    fn scene_of(
        &self,
        kind: c_uint,
        (keys, vertex): (&[&[f32]], Format),
        (indices, index): (&[u32], Format),
    ) -> Handle {
        let library = self.library;
        type NewBuffer =
            unsafe extern "C" fn(Handle, c_uint, c_uint, c_uint, usize, usize) -> *mut c_void;
        let new_buffer = function!(library, "rtcSetNewGeometryBuffer", NewBuffer);
        let new_scene = function!(library, "rtcNewScene", New);
        let set_scene_flags = function!(library, "rtcSetSceneFlags", Set);
        let new_geometry = function!(library, "rtcNewGeometry", NewGeometry);
        let set_geometry_time_step_count = function!(library, "rtcSetGeometryTimeStepCount", Set);
        let commit_scene = function!(library, "rtcCommitScene", Do);
        // SAFETY: handles are alive; buffers have room for as many items as are copied.
        unsafe {
            let scene = new_scene(self.device);
            set_scene_flags(scene, self.scene_flags);
            let geometry = new_geometry(self.device, kind);
            set_geometry_time_step_count(geometry, keys.len() as c_uint);
            for (slot, vertices) in keys.iter().enumerate() {
                let (format, numbers) = vertex;
                let count = vertices.len() / numbers;
                let slot = slot as c_uint;
                let to = new_buffer(geometry, VERTICES, slot, format, 4 * numbers, count).cast();
                std::ptr::copy_nonoverlapping(vertices.as_ptr(), to, vertices.len());
            }
            let (format, numbers) = index;
            let count = indices.len() / numbers;
            let to = new_buffer(geometry, INDICES, 0, format, 4 * numbers, count).cast();
            std::ptr::copy_nonoverlapping(indices.as_ptr(), to, indices.len());
            self.attach(scene, geometry);
            commit_scene(scene);
            scene
        }
    }

    /// Commits a geometry and gives it to a scene.
    fn attach(&self, scene: Handle, geometry: Handle) {
        let library = self.library;
        type Attach = unsafe extern "C" fn(Handle, Handle) -> c_uint;
        let commit_geometry = function!(library, "rtcCommitGeometry", Do);
        let attach_geometry = function!(library, "rtcAttachGeometry", Attach);
        let release_geometry = function!(library, "rtcReleaseGeometry", Do);
        // SAFETY: handles are alive.
        unsafe {
            commit_geometry(geometry);
            attach_geometry(scene, geometry);
            release_geometry(geometry);
        }
    }

    fn replace(&mut self, scene: Handle) {
        if !self.scene.is_null() {
            let release = function!(self.library, "rtcReleaseScene", Do);
            // SAFETY: the handle is alive, and nobody else has it.
            unsafe { release(self.scene) };
        }
        self.scene = scene;
    }

    /// `rtcOccluded1` for every ray.
    pub fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.occluded_at(rays, |_| 0.0, occluded);
    }

    /// The same query with the time of each ray, by its index.
    pub fn occluded_at(&self, rays: &[Ray], time: impl Fn(usize) -> f32, occluded: &mut [bool]) {
        for (index, (ray, occluded)) in rays.iter().zip(occluded).enumerate() {
            let mut asked = single(ray, time(index));
            // SAFETY: the scene is committed, and the ray laid out as an `RTCRay`.
            unsafe { (self.occluded1)(self.scene, &mut asked, null_mut()) };
            *occluded = asked.tfar == f32::NEG_INFINITY;
        }
    }

    /// `rtcIntersect1` for every ray: distances, infinite for a miss.
    pub fn intersect(&self, rays: &[Ray], distances: &mut [f32]) {
        self.intersect_at(rays, |_| 0.0, distances);
    }

    /// The same query with the time of each ray, by its index.
    pub fn intersect_at(&self, rays: &[Ray], time: impl Fn(usize) -> f32, distances: &mut [f32]) {
        for (index, (ray, distance)) in rays.iter().zip(distances).enumerate() {
            let mut asked = RayHit {
                ray: single(ray, time(index)),
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

    /// `rtcOccluded4`, `8` or `16` for every packet; what is left over goes one by one.
    pub fn occluded_packets(&self, size: usize, rays: &[Ray], occluded: &mut [bool]) {
        self.occluded_packets_at(size, rays, |_| 0.0, occluded);
    }

    /// The same query with the time of each ray, by its index.
    pub fn occluded_packets_at(
        &self,
        size: usize,
        rays: &[Ray],
        time: impl Fn(usize) -> f32,
        occluded: &mut [bool],
    ) {
        match size {
            4 => self.packets(self.occluded4, rays, time, occluded),
            8 => self.packets(self.occluded8, rays, time, occluded),
            _ => self.packets(self.occluded16, rays, time, occluded),
        }
    }

    fn packets<const N: usize>(
        &self,
        ask: Occluded<Rays<N>>,
        rays: &[Ray],
        time: impl Fn(usize) -> f32,
        occluded: &mut [bool],
    ) {
        let valid = Valid([-1; N]);
        let (packets, rest) = rays.as_chunks::<N>();
        let (answers, last) = occluded.as_chunks_mut::<N>();
        for (index, (rays, answers)) in packets.iter().zip(answers).enumerate() {
            let mut asked = Rays {
                org: [0, 1, 2].map(|axis| rays.map(|ray| ray.org[axis])),
                tnear: rays.map(|ray| ray.tnear),
                dir: [0, 1, 2].map(|axis| rays.map(|ray| ray.dir[axis])),
                time: std::array::from_fn(|lane| time(N * index + lane)),
                tfar: rays.map(|ray| ray.tfar),
                mask: [u32::MAX; N],
                id: [0; N],
                flags: [0; N],
            };
            // SAFETY: the scene is committed, and the rays laid out as those of a packet.
            unsafe { ask(valid.0.as_ptr(), self.scene, &mut asked, null_mut()) };
            *answers = asked.tfar.map(|tfar| tfar == f32::NEG_INFINITY);
        }
        let first = N * packets.len();
        self.occluded_at(rest, |index| time(first + index), last);
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
