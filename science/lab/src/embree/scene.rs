//! Scenes: meshes, quads, curves, user geometry, and instances of scenes that hold them, still or moving.

use std::ffi::{c_int, c_uint};
use std::marker::PhantomData;
use std::sync::Arc;
use std::time::Instant;

use antumbra::shapes::TriangleMesh;
use antumbra::{Geometry as Shape, Instance};
use antumbra_render::Lowered;
use glam::{Mat3, Quat, Vec3};

use super::callbacks::{self, Filter, Shapes};
use super::{Device, Functions, Handle};
use crate::Error;

const TRIANGLE_GEOMETRY: c_uint = 0;
const QUAD_GEOMETRY: c_uint = 1;
const FLAT_LINEAR_CURVES: c_uint = 17;
const USER_GEOMETRY: c_uint = 120;
const INSTANCE_GEOMETRY: c_uint = 121;
const INDEX_BUFFER: c_uint = 0;
const VERTEX_BUFFER: c_uint = 1;
const FORMAT_UINT: c_uint = 0x5001;
const FORMAT_UINT3: c_uint = 0x5003;
const FORMAT_UINT4: c_uint = 0x5004;
const FORMAT_FLOAT3: c_uint = 0x9003;
const FORMAT_FLOAT4: c_uint = 0x9004;
const FORMAT_FLOAT3X4_ROW_MAJOR: c_uint = 0x9134;
const QUALITY_LOW: c_uint = 0;
const QUALITY_MEDIUM: c_uint = 1;
const QUALITY_REFIT: c_uint = 3;

/// `RTCSceneFlags`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SceneFlags(c_int);

impl SceneFlags {
    /// For vertices that move.
    const DYNAMIC: Self = Self(1);
    /// Watertight traversal.
    pub const ROBUST: Self = Self(4);
    /// Filters of queries are called, see [`Scene::visit_hits`].
    pub const FILTER_IN_ARGUMENTS: Self = Self(8);
}

/// `RTCQuaternionDecomposition` of a transform that rotates and moves.
#[repr(C, align(16))]
pub(super) struct Decomposition {
    scale: [f32; 3],
    skew: [f32; 3],
    shift: [f32; 3],
    /// Real part first.
    quaternion: [f32; 4],
    translation: [f32; 3],
}

impl Decomposition {
    fn new(rows: &[[f32; 4]; 3]) -> Self {
        let rotation = Mat3::from_cols_array_2d(&rows.map(|[x, y, z, _]| [x, y, z])).transpose();
        let [x, y, z, w] = Quat::from_mat3(&rotation).to_array();
        Self {
            scale: Vec3::ONE.to_array(),
            skew: [0.0; 3],
            shift: [0.0; 3],
            quaternion: [w, x, y, z],
            translation: rows.map(|row| row[3]),
        }
    }
}

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
    /// Builds a scene of quality MEDIUM, Embree's default. Instances that move rotate and move only. The device must have no
    /// other scene under construction, or bytes are mixed up.
    ///
    /// # Errors
    /// [`Error::Embree`].
    pub fn build(
        device: &Arc<Device>,
        model: &'m Lowered<'_>,
        flags: SceneFlags,
    ) -> Result<Self, Error> {
        Self::try_build(device, model, flags).map_err(Error::Embree)
    }

    fn try_build(
        device: &Arc<Device>,
        model: &'m Lowered<'_>,
        flags: SceneFlags,
    ) -> Result<Self, String> {
        let before = device.bytes();
        let (mut buffer_bytes, mut seconds) = (0, 0.0);
        let mut filled = |shapes: &[Shape]| -> Result<Part, String> {
            let part = Part::new(device, flags, QUALITY_MEDIUM)?;
            let before = device.bytes();
            for shape in shapes {
                part.attach(shape)?;
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
                world.attach_instance(object, instance)?;
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

    /// Builds a dynamic scene of one mesh, of quality LOW, as Embree wants it for geometries of quality REFIT.
    ///
    /// # Errors
    /// [`Error::Embree`].
    pub fn of_moving(device: &Arc<Device>, mesh: &TriangleMesh) -> Result<Self, Error> {
        let build = || {
            let world = Part::new(device, SceneFlags::DYNAMIC, QUALITY_LOW)?;
            world.attach_mesh(mesh, QUALITY_REFIT)?;
            let seconds = world.commit()?;
            Ok((world, seconds))
        };
        let (world, seconds) = build().map_err(Error::Embree)?;
        Ok(Self {
            world,
            seconds,
            bytes: 0,
            buffer_bytes: 0,
            calls_back: false,
            model: PhantomData,
        })
    }

    /// Moves the vertices of the only mesh and refits; returns the seconds from `rtcUpdateGeometryBuffer` to the end of
    /// `rtcCommitScene`. As many new positions as there were are copied before.
    ///
    /// # Errors
    /// [`Error::Embree`].
    pub fn refit(&mut self, positions: &[[f32; 3]]) -> Result<f64, Error> {
        let functions = self.functions();
        // SAFETY: the scene and its geometry are alive, and nobody queries them. The buffer has room for so many vertices of
        // three numbers, and is not ours.
        let geometry = unsafe {
            let geometry = (functions.get_geometry)(self.handle(), 0);
            let buffer = (functions.buffer_data)(geometry, VERTEX_BUFFER, 0);
            if buffer.is_null() {
                return Err(Error::Embree("Embree has no vertex buffer".into()));
            }
            std::ptr::copy_nonoverlapping(positions.as_ptr(), buffer.cast(), positions.len());
            geometry
        };
        let start = Instant::now();
        // SAFETY: as above.
        unsafe {
            (functions.update_buffer)(geometry, VERTEX_BUFFER, 0);
            (functions.commit_geometry)(geometry);
        }
        self.world.commit().map_err(Error::Embree)?;
        Ok(start.elapsed().as_secs_f64())
    }

    /// The mode for queries. What is called back is Rust code, which must not run in another than the default one.
    pub(super) fn mode(&self) -> Option<FlushDenormals> {
        (!self.calls_back).then(FlushDenormals::begin)
    }

    pub(super) fn functions(&self) -> &'static Functions {
        self.world.functions()
    }

    pub(super) fn handle(&self) -> Handle {
        self.world.handle
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
struct Part {
    device: Arc<Device>,
    handle: Handle,
}

// SAFETY: once committed it may be queried from any thread at the same time, and is never changed again.
unsafe impl Send for Part {}
// SAFETY: as above.
unsafe impl Sync for Part {}

impl Part {
    fn new(device: &Arc<Device>, flags: SceneFlags, quality: c_uint) -> Result<Self, String> {
        let functions = device.embree.functions;
        // SAFETY: the device is alive as long as the scene, which owns a share of it.
        let handle = unsafe { (functions.new_scene)(device.handle) };
        if handle.is_null() {
            device.check()?;
            return Err("Embree makes no scene".into());
        }
        // SAFETY: the scene is alive and not committed.
        unsafe {
            (functions.scene_flags)(handle, flags.0.cast_unsigned());
            (functions.scene_quality)(handle, quality);
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

    /// Copies a geometry into buffers, or points to it.
    fn attach(&self, shape: &Shape) -> Result<(), String> {
        let (kind, fill): (_, &dyn Fn(&Geometry)) = match shape {
            Shape::Triangles(mesh) => return self.attach_mesh(mesh, QUALITY_MEDIUM),
            Shape::User { count, shape } => return self.attach_user(*count, shape),
            Shape::Quads(mesh) if mesh.indices.is_empty() => return Ok(()),
            Shape::Quads(mesh) => (QUAD_GEOMETRY, &|geometry| {
                geometry.fill((VERTEX_BUFFER, 0), FORMAT_FLOAT3, &mesh.positions);
                geometry.fill((INDEX_BUFFER, 0), FORMAT_UINT4, &mesh.indices);
            }),
            Shape::Curves(curves) => (FLAT_LINEAR_CURVES, &|geometry| {
                geometry.fill((VERTEX_BUFFER, 0), FORMAT_FLOAT4, &curves.points);
                let segments = curves.segments.as_chunks::<1>().0;
                geometry.fill((INDEX_BUFFER, 0), FORMAT_UINT, segments);
            }),
            _ => return Err("Embree is given meshes, curves and user geometry only".into()),
        };
        let geometry = Geometry::new(self, kind)?;
        fill(&geometry);
        geometry.attach()
    }

    /// Copies a mesh into buffers, for each of its times. A filter of it is only pointed to.
    fn attach_mesh(&self, mesh: &TriangleMesh, quality: c_uint) -> Result<(), String> {
        if mesh.indices.is_empty() {
            return Ok(());
        }
        let functions = self.functions();
        let geometry = Geometry::new(self, TRIANGLE_GEOMETRY)?;
        geometry.steps(1 + mesh.moves_to.len());
        for (slot, positions) in (0..).zip([&mesh.positions].into_iter().chain(&mesh.moves_to)) {
            geometry.fill((VERTEX_BUFFER, slot), FORMAT_FLOAT3, positions);
        }
        geometry.fill((INDEX_BUFFER, 0), FORMAT_UINT3, &mesh.indices);
        // SAFETY: the geometry is alive and not committed.
        unsafe { (functions.geometry_quality)(geometry.handle, quality) };
        if let Some(opacity) = &mesh.opacity {
            let user: *const Filter = opacity;
            // SAFETY: the geometry is alive and not committed. The functions are of the right type, and what
            // they are told is what they expect; it lives as long as the scene, and is only read.
            unsafe {
                (functions.user_data)(geometry.handle, user.cast_mut().cast());
                (functions.occluded_filter)(geometry.handle, Some(callbacks::holes_occluded));
                (functions.intersect_filter)(geometry.handle, Some(callbacks::holes_intersect));
            }
        }
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
            (functions.user_bounds)(handle, Some(callbacks::user_bounds), std::ptr::null_mut());
            (functions.user_intersect)(handle, Some(callbacks::user_intersect));
            (functions.user_occluded)(handle, Some(callbacks::user_occluded));
        }
        geometry.attach()
    }

    /// Places another part, committed, in this one.
    fn attach_instance(&self, object: &Self, instance: &Instance) -> Result<(), String> {
        let functions = self.functions();
        let geometry = Geometry::new(self, INSTANCE_GEOMETRY)?;
        let rows: *const f32 = instance.transform.as_flattened().as_ptr();
        // SAFETY: geometry and object are alive; Embree counts itself as an owner of the object.
        unsafe { (functions.instanced_scene)(geometry.handle, object.handle) };
        if instance.moves_to.is_empty() {
            let format = FORMAT_FLOAT3X4_ROW_MAJOR;
            // SAFETY: the matrix has the twelve numbers of its format, which are copied.
            unsafe { (functions.transform)(geometry.handle, 0, format, rows.cast()) };
            return geometry.attach();
        }
        geometry.steps(1 + instance.moves_to.len());
        let keys = [&instance.transform].into_iter().chain(&instance.moves_to);
        for (step, rows) in (0..).zip(keys) {
            // SAFETY: the geometry is alive and has so many keys; the decomposition is copied.
            unsafe { (functions.quaternion)(geometry.handle, step, &Decomposition::new(rows)) };
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

    /// Says how many times there are, if there is more than one.
    fn steps(&self, count: usize) {
        if count > 1 {
            // SAFETY: the geometry is alive and not committed.
            unsafe { (self.part.functions().time_steps)(self.handle, count as c_uint) };
        }
    }

    /// Copies a list into a buffer of its own, by kind and slot. Items are made of 32-bit numbers, as `format` says.
    fn fill<const N: usize, T: Copy>(
        &self,
        (kind, slot): (c_uint, c_uint),
        format: c_uint,
        items: &[[T; N]],
    ) {
        const { assert!(size_of::<T>() == 4) };
        let functions = self.part.functions();
        let count = items.len();
        // SAFETY: the geometry is alive and not committed. Embree allocates at least `count` items of so many bytes, with
        // the padding that its own loads need, and returns null if it cannot.
        let buffer =
            unsafe { (functions.new_buffer)(self.handle, kind, slot, format, 4 * N, count) };
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
