//! Scenes: meshes, quads, user geometry, and instances of scenes that hold them.

use std::ffi::c_uint;
use std::marker::PhantomData;
use std::sync::Arc;
use std::time::Instant;

use antumbra::Geometry as Shape;
use antumbra::shapes::{QuadMesh, TriangleMesh};
use antumbra_render::Lowered;

use super::filter::{self, Filter};
use super::user::{self, Shapes};
use super::{Device, Functions, Handle, Packet, RayHit, SingleRay};

const TRIANGLE_GEOMETRY: c_uint = 0;
const QUAD_GEOMETRY: c_uint = 1;
const USER_GEOMETRY: c_uint = 120;
const INSTANCE_GEOMETRY: c_uint = 121;
const INDEX_BUFFER: c_uint = 0;
pub(super) const VERTEX_BUFFER: c_uint = 1;
const FORMAT_UINT3: c_uint = 0x5003;
const FORMAT_UINT4: c_uint = 0x5004;
const FORMAT_FLOAT3: c_uint = 0x9003;
const FORMAT_FLOAT3X4_ROW_MAJOR: c_uint = 0x9134;
pub(super) const QUALITY_LOW: c_uint = 0;
const QUALITY_MEDIUM: c_uint = 1;
pub(super) const QUALITY_REFIT: c_uint = 3;
pub(super) const FLAG_DYNAMIC: c_uint = 1;
const FLAG_ROBUST: c_uint = 4;

/// A committed scene with all that it refers to.
pub struct Scene<'m> {
    /// Scene that is queried: the meshes of the world, and instances of the objects.
    world: Part,
    /// Seconds in `rtcCommitScene`, of all objects and of the world.
    pub seconds: f64,
    /// Bytes that the device holds more than before, but for the buffers: the finished trees, and the instances.
    pub bytes: usize,
    /// Bytes of the vertex and index buffers.
    pub buffer_bytes: usize,
    /// Whether Embree calls back.
    calls_back: bool,
    /// Filters and user geometry point into the model.
    model: PhantomData<&'m Lowered<'m>>,
}

impl<'m> Scene<'m> {
    /// Builds a scene of quality MEDIUM, Embree's default; `robust` selects its watertight traversal. The
    /// device must have no other scene under construction, or bytes are mixed up.
    ///
    /// # Errors
    /// Message of Embree.
    pub fn build(
        device: &Arc<Device>,
        model: &'m Lowered<'_>,
        robust: bool,
    ) -> Result<Self, String> {
        let before = device.bytes();
        let (mut buffer_bytes, mut seconds) = (0, 0.0);
        let mut filled = |shapes: &[Shape]| -> Result<Part, String> {
            let flags = if robust { FLAG_ROBUST } else { 0 };
            let part = Part::new(device, flags, QUALITY_MEDIUM)?;
            let before = device.bytes();
            for shape in shapes {
                match shape {
                    Shape::Triangles(mesh) => part.attach_mesh(mesh, QUALITY_MEDIUM)?,
                    Shape::Quads(mesh) => part.attach_quads(mesh)?,
                    Shape::User { count, shape } => part.attach_user(*count, shape)?,
                    _ => return Err("Embree is given meshes and user geometry only".into()),
                }
            }
            buffer_bytes += device.bytes().saturating_sub(before);
            Ok(part)
        };
        // Instances keep the parts alive that they are made of.
        let mut objects: Vec<Option<Part>> = model.objects.iter().map(|_| None).collect();
        let world = filled(&model.world)?;
        for instance in &model.instances {
            let index = instance.object as usize;
            if objects[index].is_none() {
                let object = filled(&model.objects[index])?;
                seconds += object.commit()?;
                objects[index] = Some(object);
            }
            if let Some(object) = &objects[index] {
                world.attach_instance(object, &instance.transform)?;
            }
        }
        seconds += world.commit()?;
        let all_bytes = device.bytes().saturating_sub(before);
        Ok(Self {
            world,
            seconds,
            bytes: all_bytes.saturating_sub(buffer_bytes),
            buffer_bytes,
            calls_back: calls_back(model),
            model: PhantomData,
        })
    }

    /// `rtcOccluded1` for every ray.
    pub fn occluded(&self, rays: &mut [SingleRay]) {
        let _mode = self.mode();
        self.world.occluded(rays);
    }

    /// `rtcIntersect1` for every ray.
    pub fn intersect(&self, rays: &mut [RayHit]) {
        let _mode = self.mode();
        self.world.intersect(rays);
    }

    /// `rtcOccluded16` for every packet.
    pub fn occluded_packets(&self, packets: &mut [Packet]) {
        let occluded16 = self.world.functions().occluded16;
        let _mode = self.mode();
        for Packet { valid, rays } in packets {
            // SAFETY: as above, with the layout and alignment of a mask of 16 and an `RTCRay16`.
            unsafe {
                occluded16(
                    valid.as_ptr(),
                    self.world.handle,
                    rays,
                    std::ptr::null_mut(),
                )
            };
        }
    }

    /// The mode for queries. What is called back is Rust code, which must not run in another than the default one.
    fn mode(&self) -> Option<FlushDenormals> {
        (!self.calls_back).then(FlushDenormals::begin)
    }

    /// The scene that is queried.
    pub(super) fn world(&self) -> &Part {
        &self.world
    }
}

fn calls_back(model: &Lowered) -> bool {
    let all = model.objects.iter().flatten().chain(&model.world);
    all.into_iter().any(|shape| match shape {
        Shape::Triangles(mesh) => mesh.opacity.is_some(),
        Shape::User { .. } => true,
        _ => false,
    })
}

/// An `RTCScene`.
pub(super) struct Part {
    pub device: Arc<Device>,
    pub handle: Handle,
}

// SAFETY: once committed it may be queried from any thread at the same time, and is never changed again.
unsafe impl Send for Part {}
// SAFETY: as above.
unsafe impl Sync for Part {}

impl Part {
    pub fn new(device: &Arc<Device>, flags: c_uint, quality: c_uint) -> Result<Self, String> {
        let functions = device.embree.functions;
        // SAFETY: the device is alive as long as the scene, which owns a share of it.
        let handle = unsafe { (functions.new_scene)(device.handle) };
        if handle.is_null() {
            device.check()?;
            return Err("Embree makes no scene".into());
        }
        // SAFETY: the scene is alive and not committed.
        unsafe {
            (functions.scene_flags)(handle, flags);
            (functions.scene_quality)(handle, quality);
        }
        let device = Arc::clone(device);
        Ok(Self { device, handle })
    }

    pub fn functions(&self) -> &'static Functions {
        self.device.embree.functions
    }

    /// `rtcOccluded1` for every ray, in the mode of the thread.
    pub fn occluded(&self, rays: &mut [SingleRay]) {
        let occluded1 = self.functions().occluded1;
        for ray in rays {
            // SAFETY: the scene is committed and alive; the ray has the layout of `RTCRay`; no arguments
            // are given.
            unsafe { occluded1(self.handle, ray, std::ptr::null_mut()) };
        }
    }

    /// `rtcIntersect1` for every ray, in the mode of the thread.
    pub fn intersect(&self, rays: &mut [RayHit]) {
        let intersect1 = self.functions().intersect1;
        for ray in rays {
            // SAFETY: as above, with room for an `RTCRayHit`.
            unsafe { intersect1(self.handle, ray, std::ptr::null_mut()) };
        }
    }

    /// Builds the tree; returns how long that took.
    pub fn commit(&self) -> Result<f64, String> {
        let start = Instant::now();
        // SAFETY: the scene is alive, and nobody queries it yet.
        unsafe { (self.functions().commit_scene)(self.handle) };
        let seconds = start.elapsed().as_secs_f64();
        self.device.check()?;
        Ok(seconds)
    }

    /// Copies a mesh into buffers. A filter of it is only pointed to.
    pub fn attach_mesh(&self, mesh: &TriangleMesh, quality: c_uint) -> Result<(), String> {
        if mesh.indices.is_empty() {
            return Ok(());
        }
        let functions = self.functions();
        let geometry = Geometry::new(self, TRIANGLE_GEOMETRY)?;
        geometry.fill(VERTEX_BUFFER, FORMAT_FLOAT3, &mesh.positions);
        geometry.fill(INDEX_BUFFER, FORMAT_UINT3, &mesh.indices);
        // SAFETY: the geometry is alive and not committed.
        unsafe { (functions.geometry_quality)(geometry.handle, quality) };
        if let Some(opacity) = &mesh.opacity {
            let user: *const Filter = opacity;
            // SAFETY: the geometry is alive and not committed. The functions are of the right type, and what
            // they are told is what they expect; it lives as long as the scene, and is only read.
            unsafe {
                (functions.user_data)(geometry.handle, user.cast_mut().cast());
                (functions.occluded_filter)(geometry.handle, Some(filter::occluded));
                (functions.intersect_filter)(geometry.handle, Some(filter::intersect));
            }
        }
        geometry.attach()
    }

    /// Copies quads into buffers.
    fn attach_quads(&self, mesh: &QuadMesh) -> Result<(), String> {
        if mesh.indices.is_empty() {
            return Ok(());
        }
        let geometry = Geometry::new(self, QUAD_GEOMETRY)?;
        geometry.fill(VERTEX_BUFFER, FORMAT_FLOAT3, &mesh.positions);
        geometry.fill(INDEX_BUFFER, FORMAT_UINT4, &mesh.indices);
        geometry.attach()
    }

    /// Points to user geometry.
    fn attach_user(&self, count: u32, shapes: &Shapes) -> Result<(), String> {
        let functions = self.functions();
        let geometry = Geometry::new(self, USER_GEOMETRY)?;
        let shapes: *const Shapes = shapes;
        // SAFETY: the geometry is alive and not committed. The functions are of the right type, and what they are told
        // is what they expect; it lives as long as the scene, and is only read.
        unsafe {
            let handle = geometry.handle;
            (functions.user_count)(handle, count);
            (functions.user_data)(handle, shapes.cast_mut().cast());
            (functions.user_bounds)(handle, Some(user::bounds), std::ptr::null_mut());
            (functions.user_intersect)(handle, Some(user::intersect));
            (functions.user_occluded)(handle, Some(user::occluded));
        }
        geometry.attach()
    }

    /// Places another part, committed, in this one.
    fn attach_instance(&self, object: &Self, transform: &[[f32; 4]; 3]) -> Result<(), String> {
        let functions = self.functions();
        let geometry = Geometry::new(self, INSTANCE_GEOMETRY)?;
        let rows: *const f32 = transform.as_flattened().as_ptr();
        // SAFETY: geometry and object are alive; Embree counts itself as an owner of the object. The matrix has the
        // twelve numbers of its format, which are copied.
        unsafe {
            (functions.instanced_scene)(geometry.handle, object.handle);
            let format = FORMAT_FLOAT3X4_ROW_MAJOR;
            (functions.transform)(geometry.handle, 0, format, rows.cast());
        }
        geometry.attach()
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        // SAFETY: queries borrow the scene, so none is running.
        unsafe { (self.functions().release_scene)(self.handle) };
    }
}

/// A geometry that is being made for a part.
struct Geometry<'a> {
    part: &'a Part,
    handle: Handle,
}

impl<'a> Geometry<'a> {
    fn new(part: &'a Part, kind: c_uint) -> Result<Self, String> {
        // SAFETY: the device is alive.
        let handle = unsafe { (part.functions().new_geometry)(part.device.handle, kind) };
        if handle.is_null() {
            part.device.check()?;
            return Err("Embree makes no geometry".into());
        }
        Ok(Self { part, handle })
    }

    /// Copies a list into a buffer of its own. Items are made of 32-bit numbers, as `format` says.
    fn fill<const N: usize, T: Copy>(&self, kind: c_uint, format: c_uint, items: &[[T; N]]) {
        const { assert!(size_of::<T>() == 4) };
        let functions = self.part.functions();
        let count = items.len();
        // SAFETY: the geometry is alive and not committed. Embree allocates at least `count` items of so many bytes, with
        // the padding that its own loads need, and returns null if it cannot.
        let buffer = unsafe { (functions.new_buffer)(self.handle, kind, 0, format, 4 * N, count) };
        if !buffer.is_null() {
            // SAFETY: there are `count` items; the buffer is new, so they do not overlap.
            unsafe { std::ptr::copy_nonoverlapping(items.as_ptr(), buffer.cast(), count) };
        }
    }

    /// Makes it belong to the part, if nothing went wrong so far.
    fn attach(self) -> Result<(), String> {
        self.part.device.check()?;
        let functions = self.part.functions();
        // SAFETY: both are alive and not committed.
        unsafe {
            (functions.commit_geometry)(self.handle);
            (functions.attach_geometry)(self.part.handle, self.handle);
        }
        Ok(())
    }
}

impl Drop for Geometry<'_> {
    fn drop(&mut self) {
        // SAFETY: it is alive. If it was attached it belongs to the part, too, so that this share of it can be
        // given up.
        unsafe { (self.part.functions().release_geometry)(self.handle) };
    }
}

/// Has this thread flush denormal numbers to zero until dropped, as Embree recommends to its callers. While it
/// lives only Embree may compute with floating-point numbers: Rust assumes the default mode.
pub(super) struct FlushDenormals {
    #[cfg(target_arch = "x86_64")]
    before: u32,
}

#[cfg(target_arch = "x86_64")]
impl FlushDenormals {
    /// Flush to zero, and denormals are zeros.
    const BITS: u32 = 0x8040;

    pub fn begin() -> Self {
        let mut before = 0u32;
        // SAFETY: stores the control register to a variable. Every x86-64 CPU has it.
        unsafe { std::arch::asm!("stmxcsr [{}]", in(reg) &mut before, options(nostack)) };
        Self::set(before | Self::BITS);
        Self { before }
    }

    fn set(mode: u32) {
        // SAFETY: loads a control register that was read before, at most with two defined bits more; Rust
        // code meets it restored, see above.
        unsafe { std::arch::asm!("ldmxcsr [{}]", in(reg) &mode, options(nostack)) };
    }
}

#[cfg(target_arch = "x86_64")]
impl Drop for FlushDenormals {
    fn drop(&mut self) {
        Self::set(self.before);
    }
}

#[cfg(not(target_arch = "x86_64"))]
impl FlushDenormals {
    pub fn begin() -> Self {
        Self {}
    }
}
