//! Scenes: meshes, and instances of scenes that hold meshes.

use std::ffi::c_uint;
use std::marker::PhantomData;
use std::sync::Arc;
use std::time::Instant;

use antumbra::{Geometry as Shape, TriangleMesh};
use antumbra_render::Lowered;

use super::filter::{self, Filter};
use super::{Device, Functions, Handle, Packet, RayHit, SingleRay};

const TRIANGLE_GEOMETRY: c_uint = 0;
const INSTANCE_GEOMETRY: c_uint = 121;
const INDEX_BUFFER: c_uint = 0;
const VERTEX_BUFFER: c_uint = 1;
const FORMAT_UINT3: c_uint = 0x5003;
const FORMAT_FLOAT3: c_uint = 0x9003;
const FORMAT_FLOAT3X4_ROW_MAJOR: c_uint = 0x9134;
const QUALITY_MEDIUM: c_uint = 1;
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
    has_filters: bool,
    /// Filters point into the model.
    model: PhantomData<&'m Lowered<'m>>,
}

impl<'m> Scene<'m> {
    /// Builds a scene of quality MEDIUM, Embree's default; `robust` asks for its watertight traversal. The
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
            let part = Part::new(device, robust)?;
            let before = device.bytes();
            for shape in shapes {
                match shape {
                    Shape::Triangles(mesh) => part.attach_mesh(mesh)?,
                    _ => return Err("Embree is given meshes only".into()),
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
            has_filters: has_opacity(model),
            model: PhantomData,
        })
    }

    /// `rtcOccluded1` for every ray.
    pub fn occluded(&self, rays: &mut [SingleRay]) {
        let occluded1 = self.world.functions().occluded1;
        let _mode = self.mode();
        for ray in rays {
            // SAFETY: the scene is committed and alive; the ray has the layout of `RTCRay`; no arguments
            // are given.
            unsafe { occluded1(self.world.handle, ray, std::ptr::null_mut()) };
        }
    }

    /// `rtcIntersect1` for every ray.
    pub fn intersect(&self, rays: &mut [RayHit]) {
        let intersect1 = self.world.functions().intersect1;
        let _mode = self.mode();
        for ray in rays {
            // SAFETY: as above, with room for an `RTCRayHit`.
            unsafe { intersect1(self.world.handle, ray, std::ptr::null_mut()) };
        }
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

    /// The mode for queries. Filters are Rust code, which must not run in another than the default one.
    fn mode(&self) -> Option<FlushDenormals> {
        (!self.has_filters).then(FlushDenormals::begin)
    }
}

fn has_opacity(model: &Lowered) -> bool {
    let all = model.objects.iter().flatten().chain(&model.world);
    all.into_iter()
        .any(|shape| matches!(shape, Shape::Triangles(mesh) if mesh.opacity.is_some()))
}

/// An `RTCScene`.
struct Part {
    device: Arc<Device>,
    handle: Handle,
}

// SAFETY: once committed it may be queried from any thread at the same time, and is never changed again.
unsafe impl Send for Part {}
// SAFETY: as above.
unsafe impl Sync for Part {}

impl Part {
    fn new(device: &Arc<Device>, robust: bool) -> Result<Self, String> {
        let functions = device.embree.functions;
        // SAFETY: the device is alive as long as the scene, which owns a share of it.
        let handle = unsafe { (functions.new_scene)(device.handle) };
        if handle.is_null() {
            device.check()?;
            return Err("Embree makes no scene".into());
        }
        // SAFETY: the scene is alive and not committed.
        unsafe {
            (functions.scene_flags)(handle, if robust { FLAG_ROBUST } else { 0 });
            (functions.scene_quality)(handle, QUALITY_MEDIUM);
        }
        let device = Arc::clone(device);
        Ok(Self { device, handle })
    }

    fn functions(&self) -> &'static Functions {
        self.device.embree.functions
    }

    /// Builds the tree; returns how long that took.
    fn commit(&self) -> Result<f64, String> {
        let start = Instant::now();
        // SAFETY: the scene is alive, and nobody queries it yet.
        unsafe { (self.functions().commit_scene)(self.handle) };
        let seconds = start.elapsed().as_secs_f64();
        self.device.check()?;
        Ok(seconds)
    }

    /// Copies a mesh into buffers. A filter of it is only pointed to.
    fn attach_mesh(&self, mesh: &TriangleMesh) -> Result<(), String> {
        if mesh.indices.is_empty() {
            return Ok(());
        }
        let functions = self.functions();
        let geometry = Geometry::new(self, TRIANGLE_GEOMETRY)?;
        let fill = |kind, format, from: *const [u32; 3], count: usize| {
            // SAFETY: the geometry is alive and not committed. Embree allocates at least `count` items of 12
            // bytes each, with the padding that its own loads need, and returns null if it cannot.
            let buffer =
                unsafe { (functions.new_buffer)(geometry.handle, kind, 0, format, 12, count) };
            if !buffer.is_null() {
                // SAFETY: `from` points to `count` items of three 32-bit numbers; the buffer is new, so they
                // do not overlap.
                unsafe { std::ptr::copy_nonoverlapping(from, buffer.cast(), count) };
            }
        };
        let (positions, triangles) = (&mesh.positions, &mesh.indices);
        let vertices = positions.as_ptr().cast::<[u32; 3]>();
        fill(VERTEX_BUFFER, FORMAT_FLOAT3, vertices, positions.len());
        fill(
            INDEX_BUFFER,
            FORMAT_UINT3,
            triangles.as_ptr(),
            triangles.len(),
        );
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
struct FlushDenormals {
    #[cfg(target_arch = "x86_64")]
    before: u32,
}

#[cfg(target_arch = "x86_64")]
impl FlushDenormals {
    /// Flush to zero, and denormals are zeros.
    const BITS: u32 = 0x8040;

    fn begin() -> Self {
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
    fn begin() -> Self {
        Self {}
    }
}
