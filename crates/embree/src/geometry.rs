//! Geometries: what clients set before a commit.

use std::ffi::c_void;
use std::sync::atomic::{AtomicPtr, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use crate::abi::{
    BoundsFunction, FilterFunction, IntersectFunction, PointFunction, buffer_type, format,
};
use crate::buffer::{Buffer, View};
use crate::device::Device;
use crate::failure::{Failure, Outcome, guarded};
use crate::handle::{Handle, device_of, give, lock, look, release, retain, share};
use crate::scene::Scene;
use crate::transform::{self, IDENTITY, Rows};

/// Kinds of geometry that there are here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Triangles,
    Quads,
    Spheres,
    Disks,
    User,
    Instance,
    InstanceArray,
}

impl Kind {
    fn new(kind: u32) -> Outcome<Self> {
        Ok(match kind {
            0 => Self::Triangles,
            1 => Self::Quads,
            50 => Self::Spheres,
            52 => Self::Disks,
            120 => Self::User,
            121 => Self::Instance,
            122 => Self::InstanceArray,
            2 => return Err(unsupported("grids")),
            8 => return Err(unsupported("subdivision surfaces")),
            51 => return Err(unsupported("discs that face the ray")),
            15..=17 | 24..=26 | 32..=34 | 40..=42 | 58..=60 => return Err(unsupported("curves")),
            _ => {
                return Err(Failure::argument(format!(
                    "unknown type of geometry {kind}"
                )));
            }
        })
    }

    /// Format of the index buffer.
    fn index_format(self) -> Option<u32> {
        match self {
            Self::Triangles => Some(format::UINT3),
            Self::Quads => Some(format::UINT4),
            Self::InstanceArray => Some(format::UINT),
            _ => None,
        }
    }

    /// Format of the vertex buffer.
    fn vertex_format(self) -> Option<u32> {
        match self {
            Self::Triangles | Self::Quads => Some(format::FLOAT3),
            Self::Spheres | Self::Disks => Some(format::FLOAT4),
            _ => None,
        }
    }

    /// Kinds whose hits have `u` and `v` on corners.
    pub fn has_corners(self) -> bool {
        matches!(self, Self::Triangles | Self::Quads)
    }
}

fn unsupported(what: &str) -> Failure {
    Failure::operation(format!("{what} are not supported"))
}

/// `RTCGeometry`.
pub struct Geometry {
    device: Arc<Device>,
    pub kind: Kind,
    user: AtomicPtr<c_void>,
    /// Counts changes; 0 until the first commit of the geometry.
    committed: AtomicU64,
    state: Mutex<State>,
}

impl Handle for Geometry {
    fn device(&self) -> Option<&Device> {
        Some(&self.device)
    }
}

/// All settings of a geometry.
#[derive(Clone)]
pub struct State {
    pub index: Option<View>,
    pub vertices: Option<View>,
    pub normals: Option<View>,
    pub attributes: Vec<Option<View>>,
    pub transforms: Option<View>,
    pub mask: u32,
    pub is_enabled: bool,
    pub user_count: u32,
    pub bounds: Option<BoundsFunction>,
    pub intersect: Option<IntersectFunction>,
    pub occluded: Option<IntersectFunction>,
    pub point: Option<PointFunction>,
    pub intersect_filter: Option<FilterFunction>,
    pub occluded_filter: Option<FilterFunction>,
    pub takes_argument_filter: bool,
    pub scenes: Vec<Option<Arc<Scene>>>,
    pub transform: Rows,
    /// Whether anything has changed since the geometry was committed.
    is_modified: bool,
}

impl State {
    fn new() -> Self {
        Self {
            index: None,
            vertices: None,
            normals: None,
            attributes: Vec::new(),
            transforms: None,
            mask: 1,
            is_enabled: true,
            user_count: 0,
            bounds: None,
            intersect: None,
            occluded: None,
            point: None,
            intersect_filter: None,
            occluded_filter: None,
            takes_argument_filter: false,
            scenes: Vec::new(),
            transform: IDENTITY,
            is_modified: true,
        }
    }
}

impl Geometry {
    /// The pointer of the client.
    pub fn user(&self) -> *mut c_void {
        self.user.load(Ordering::Acquire)
    }

    /// A number that grows with each commit of the geometry and each call that enables or disables it.
    pub fn version(&self) -> u64 {
        self.committed.load(Ordering::Acquire)
    }

    /// The settings of now.
    pub fn state(&self) -> State {
        lock(&self.state).clone()
    }

    pub fn is_enabled(&self) -> bool {
        lock(&self.state).is_enabled
    }

    pub fn transform(&self) -> Rows {
        lock(&self.state).transform
    }

    fn change(&self, change: impl FnOnce(&mut State) -> Outcome) -> Outcome {
        let mut state = lock(&self.state);
        change(&mut state)?;
        state.is_modified = true;
        Ok(())
    }

    fn enable(&self, is_enabled: bool) {
        lock(&self.state).is_enabled = is_enabled;
        self.committed.fetch_add(1, Ordering::AcqRel);
    }

    fn commit(&self) {
        lock(&self.state).is_modified = false;
        self.committed.fetch_add(1, Ordering::AcqRel);
    }

    fn must_be(&self, kinds: &[Kind], what: &str) -> Outcome {
        if kinds.contains(&self.kind) {
            Ok(())
        } else {
            Err(Failure::operation(format!(
                "operation only allowed for {what}"
            )))
        }
    }

    /// Puts a view where a buffer of this type belongs.
    fn set_view(&self, buffer: u32, slot: u32, which: u32, view: View) -> Outcome {
        let expect = |format: Option<u32>| match format {
            None => Err(Failure::argument("unknown buffer type")),
            Some(format) if format != which => Err(Failure::operation(format!(
                "format {which:#x} of a buffer should be {format:#x}"
            ))),
            Some(_) => Ok(()),
        };
        if slot != 0 && buffer != buffer_type::VERTEX_ATTRIBUTE {
            return Err(Failure::argument(
                "invalid buffer slot: motion blur is not supported",
            ));
        }
        match buffer {
            buffer_type::INDEX => expect(self.kind.index_format())?,
            buffer_type::VERTEX => expect(self.kind.vertex_format())?,
            buffer_type::NORMAL => {
                expect((self.kind == Kind::Disks).then_some(format::FLOAT3))?;
            }
            buffer_type::TRANSFORM => {
                self.must_be(&[Kind::InstanceArray], "instance arrays")?;
                if which < format::FLOAT3X4_ROW_MAJOR {
                    return Err(Failure::operation("invalid format of transforms"));
                }
            }
            buffer_type::VERTEX_ATTRIBUTE => {
                if !self.kind.has_corners() {
                    return Err(Failure::operation(
                        "no attributes for this type of geometry",
                    ));
                }
                if !(format::FLOAT..=format::FLOAT16).contains(&which) {
                    return Err(Failure::operation("invalid format of a vertex attribute"));
                }
            }
            _ => return Err(Failure::argument("unknown buffer type")),
        }
        self.change(|state| {
            *state.slot(buffer, slot)? = Some(view);
            Ok(())
        })
    }
}

impl State {
    fn slot(&mut self, buffer: u32, slot: u32) -> Outcome<&mut Option<View>> {
        Ok(match buffer {
            buffer_type::INDEX => &mut self.index,
            buffer_type::VERTEX => &mut self.vertices,
            buffer_type::NORMAL => &mut self.normals,
            buffer_type::TRANSFORM => &mut self.transforms,
            buffer_type::VERTEX_ATTRIBUTE => {
                self.attributes.get_mut(slot as usize).ok_or_else(|| {
                    Failure::operation(
                        "invalid vertex attribute buffer slot: set the count of attributes first",
                    )
                })?
            }
            _ => return Err(Failure::argument("unknown buffer type")),
        })
    }

    /// The buffer of this type.
    pub fn view(&self, buffer: u32, slot: u32) -> Outcome<&View> {
        let view = match buffer {
            buffer_type::INDEX => &self.index,
            buffer_type::VERTEX => &self.vertices,
            buffer_type::NORMAL => &self.normals,
            buffer_type::TRANSFORM => &self.transforms,
            buffer_type::VERTEX_ATTRIBUTE => self.attributes.get(slot as usize).unwrap_or(&None),
            _ => &None,
        };
        if slot != 0 && buffer != buffer_type::VERTEX_ATTRIBUTE {
            return Err(Failure::argument("invalid buffer slot"));
        }
        view.as_ref()
            .ok_or_else(|| Failure::argument("there is no such buffer"))
    }
}

/// Runs a call on a geometry.
///
/// # Safety
/// A geometry of this library, or null.
unsafe fn with<T>(
    geometry: *const Geometry,
    otherwise: T,
    call: impl FnOnce(&Geometry) -> Outcome<T>,
) -> T {
    // SAFETY: the caller's handle.
    unsafe { guarded(device_of(geometry), otherwise, || call(look(geometry)?)) }
}

/// # Safety
/// A device of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcNewGeometry(device: *const Device, kind: u32) -> *const Geometry {
    // SAFETY: the caller's handle.
    unsafe {
        guarded(device_of(device), std::ptr::null(), || {
            Ok(give(Arc::new(Geometry {
                device: share(device)?,
                kind: Kind::new(kind)?,
                user: AtomicPtr::default(),
                committed: AtomicU64::new(0),
                state: Mutex::new(State::new()),
            })))
        })
    }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcRetainGeometry(geometry: *const Geometry) {
    // SAFETY: the caller's handle.
    unsafe { guarded(device_of(geometry), (), || retain(geometry)) }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcReleaseGeometry(geometry: *const Geometry) {
    // SAFETY: the caller's handle.
    guarded(None, (), || unsafe { release(geometry) })
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcCommitGeometry(geometry: *const Geometry) {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, (), |geometry| {
            geometry.commit();
            Ok(())
        })
    }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcEnableGeometry(geometry: *const Geometry) {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, (), |geometry| {
            geometry.enable(true);
            Ok(())
        })
    }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcDisableGeometry(geometry: *const Geometry) {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, (), |geometry| {
            geometry.enable(false);
            Ok(())
        })
    }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryTimeStepCount(geometry: *const Geometry, count: u32) {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, (), |_| match count {
            1 => Ok(()),
            0 | 130.. => Err(Failure::argument("number of time steps is out of range")),
            _ => Err(unsupported("several time steps")),
        })
    }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryVertexAttributeCount(geometry: *const Geometry, count: u32) {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, (), |geometry| {
            if !geometry.kind.has_corners() || count > 1 << 16 {
                return Err(Failure::operation(
                    "no so many attributes for this geometry",
                ));
            }
            geometry.change(|state| {
                state.attributes.resize(count as usize, None);
                Ok(())
            })
        })
    }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryMask(geometry: *const Geometry, mask: u32) {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, (), |geometry| {
            geometry.change(|state| {
                state.mask = mask;
                Ok(())
            })
        })
    }
}

/// Every quality has the same answers; that of the scene decides how trees are built.
///
/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryBuildQuality(geometry: *const Geometry, quality: u32) {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, (), |_| match quality {
            0..=3 => Ok(()),
            _ => Err(Failure::argument("invalid build quality")),
        })
    }
}

/// # Safety
/// Handles of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryBuffer(
    geometry: *const Geometry,
    buffer_type: u32,
    slot: u32,
    which: u32,
    buffer: *const Buffer,
    offset: usize,
    stride: usize,
    count: usize,
) {
    // SAFETY: the caller's handles.
    unsafe {
        with(geometry, (), |geometry| {
            let buffer = share(buffer)?;
            if buffer.device().map(Device::id) != Some(geometry.device.id()) {
                return Err(Failure::argument("inputs are from different devices"));
            }
            let view = View::new(buffer, which, offset, stride, count)?;
            geometry.set_view(buffer_type, slot, which, view)
        })
    }
}

/// # Safety
/// A geometry of this library, or null; memory of so many items that lives as long as the geometry.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetSharedGeometryBuffer(
    geometry: *const Geometry,
    buffer_type: u32,
    slot: u32,
    which: u32,
    memory: *const c_void,
    offset: usize,
    stride: usize,
    count: usize,
) {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, (), |geometry| {
            let device = Arc::clone(&geometry.device);
            let view = View::shared(device, memory, which, offset, stride, count)?;
            geometry.set_view(buffer_type, slot, which, view)
        })
    }
}

/// # Safety
/// As [`rtcSetSharedGeometryBuffer`]. There is one memory, so `device_memory` must be null or the same.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetSharedGeometryBufferHostDevice(
    geometry: *const Geometry,
    buffer_type: u32,
    slot: u32,
    which: u32,
    memory: *const c_void,
    device_memory: *const c_void,
    offset: usize,
    stride: usize,
    count: usize,
) {
    // SAFETY: the caller's handle and memory.
    unsafe {
        if !device_memory.is_null() && device_memory != memory {
            return with(geometry, (), |_| {
                Err(Failure::argument("the device is no SYCL device: pass NULL"))
            });
        }
        rtcSetSharedGeometryBuffer(
            geometry,
            buffer_type,
            slot,
            which,
            memory,
            offset,
            stride,
            count,
        );
    }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetNewGeometryBuffer(
    geometry: *const Geometry,
    buffer_type: u32,
    slot: u32,
    which: u32,
    stride: usize,
    count: usize,
) -> *mut c_void {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, std::ptr::null_mut(), |geometry| {
            if !stride.is_multiple_of(4) {
                return Err(Failure::operation("data must be 4 bytes aligned"));
            }
            let size =
                (stride.checked_mul(count)).ok_or_else(|| Failure::argument("buffer too large"))?;
            // The last item is whole, also where items overlap.
            let size = size.max(format::size(which).unwrap_or(0));
            let buffer = Buffer::new(Arc::clone(&geometry.device), size)?;
            let memory = buffer.memory();
            let view = View::new(buffer, which, 0, stride, count)?;
            geometry.set_view(buffer_type, slot, which, view)?;
            Ok(memory.cast())
        })
    }
}

/// # Safety
/// A geometry of this library, or null; places for the pointers, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetNewGeometryBufferHostDevice(
    geometry: *const Geometry,
    buffer_type: u32,
    slot: u32,
    which: u32,
    stride: usize,
    count: usize,
    memory: *mut *mut c_void,
    device_memory: *mut *mut c_void,
) {
    // SAFETY: the caller's handle and places.
    unsafe {
        let data = rtcSetNewGeometryBuffer(geometry, buffer_type, slot, which, stride, count);
        for place in [memory, device_memory] {
            if let Some(place) = place.as_mut() {
                *place = data;
            }
        }
    }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcGetGeometryBufferData(
    geometry: *const Geometry,
    buffer_type: u32,
    slot: u32,
) -> *mut c_void {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, std::ptr::null_mut(), |geometry| {
            Ok(geometry.state().view(buffer_type, slot)?.data().cast())
        })
    }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcGetGeometryBufferDataDevice(
    geometry: *const Geometry,
    buffer_type: u32,
    slot: u32,
) -> *mut c_void {
    // SAFETY: as for the other.
    unsafe { rtcGetGeometryBufferData(geometry, buffer_type, slot) }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcUpdateGeometryBuffer(
    geometry: *const Geometry,
    buffer_type: u32,
    slot: u32,
) {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, (), |geometry| {
            geometry.state().view(buffer_type, slot)?;
            geometry.change(|_| Ok(()))
        })
    }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryIntersectFilterFunction(
    geometry: *const Geometry,
    filter: Option<FilterFunction>,
) {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, (), |geometry| {
            geometry.change(|state| {
                state.intersect_filter = filter;
                Ok(())
            })
        })
    }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryOccludedFilterFunction(
    geometry: *const Geometry,
    filter: Option<FilterFunction>,
) {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, (), |geometry| {
            geometry.change(|state| {
                state.occluded_filter = filter;
                Ok(())
            })
        })
    }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryEnableFilterFunctionFromArguments(
    geometry: *const Geometry,
    is_enabled: bool,
) {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, (), |geometry| {
            geometry.change(|state| {
                state.takes_argument_filter = is_enabled;
                Ok(())
            })
        })
    }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryUserData(geometry: *const Geometry, user: *mut c_void) {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, (), |geometry| {
            geometry.user.store(user, Ordering::Release);
            Ok(())
        })
    }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcGetGeometryUserData(geometry: *const Geometry) -> *mut c_void {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, std::ptr::null_mut(), |geometry| {
            Ok(geometry.user())
        })
    }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryPointQueryFunction(
    geometry: *const Geometry,
    function: Option<PointFunction>,
) {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, (), |geometry| {
            geometry.change(|state| {
                state.point = function;
                Ok(())
            })
        })
    }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryUserPrimitiveCount(geometry: *const Geometry, count: u32) {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, (), |geometry| {
            geometry.must_be(&[Kind::User], "user geometries")?;
            geometry.change(|state| {
                state.user_count = count;
                Ok(())
            })
        })
    }
}

/// The function receives the user data of the geometry, as with Embree; `_user` is not used there either.
///
/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryBoundsFunction(
    geometry: *const Geometry,
    bounds: Option<BoundsFunction>,
    _user: *mut c_void,
) {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, (), |geometry| {
            geometry.must_be(&[Kind::User], "user geometries")?;
            geometry.change(|state| {
                state.bounds = bounds;
                Ok(())
            })
        })
    }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryIntersectFunction(
    geometry: *const Geometry,
    intersect: Option<IntersectFunction>,
) {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, (), |geometry| {
            geometry.must_be(&[Kind::User], "user geometries")?;
            geometry.change(|state| {
                state.intersect = intersect;
                Ok(())
            })
        })
    }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryOccludedFunction(
    geometry: *const Geometry,
    occluded: Option<IntersectFunction>,
) {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, (), |geometry| {
            geometry.must_be(&[Kind::User], "user geometries")?;
            geometry.change(|state| {
                state.occluded = occluded;
                Ok(())
            })
        })
    }
}

/// # Safety
/// Handles of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryInstancedScene(
    geometry: *const Geometry,
    scene: *const Scene,
) {
    // SAFETY: the caller's handles.
    unsafe { rtcSetGeometryInstancedScenes(geometry, &scene, 1) }
}

/// # Safety
/// A geometry of this library, or null; `count` scenes of this library, or null ones.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryInstancedScenes(
    geometry: *const Geometry,
    scenes: *const *const Scene,
    count: usize,
) {
    // SAFETY: the caller's handles.
    unsafe {
        with(geometry, (), |geometry| {
            geometry.must_be(&[Kind::Instance, Kind::InstanceArray], "instances")?;
            if scenes.is_null() && count > 0 {
                return Err(Failure::argument("the list of scenes is null"));
            }
            let scene = |index: usize| match *scenes.wrapping_add(index) {
                null if null.is_null() => Ok(None),
                scene => share(scene).map(Some),
            };
            let scenes = (0..count).map(scene).collect::<Outcome<Vec<_>>>()?;
            for scene in scenes.iter().flatten() {
                if scene.device().map(Device::id) != Some(geometry.device.id()) {
                    return Err(Failure::argument("inputs are from different devices"));
                }
            }
            geometry.change(|state| {
                state.scenes = scenes;
                Ok(())
            })
        })
    }
}

/// # Safety
/// A geometry of this library, or null; a transform in this format.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryTransform(
    geometry: *const Geometry,
    time_step: u32,
    which: u32,
    transform: *const c_void,
) {
    // SAFETY: the caller's handle and memory.
    unsafe {
        with(geometry, (), |geometry| {
            geometry.must_be(&[Kind::Instance], "instances")?;
            if time_step != 0 {
                return Err(Failure::operation(
                    "invalid timestep: motion blur is not supported",
                ));
            }
            let rows = transform::read(which, transform)?;
            geometry.change(|state| {
                state.transform = rows;
                Ok(())
            })
        })
    }
}

/// # Safety
/// A geometry of this library, or null; a decomposition.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryTransformQuaternion(
    geometry: *const Geometry,
    time_step: u32,
    transform: *const c_void,
) {
    // SAFETY: the caller's handle and memory.
    unsafe { rtcSetGeometryTransform(geometry, time_step, format::QUATERNION, transform) }
}

/// # Safety
/// A geometry of this library, or null; room for a transform in this format.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcGetGeometryTransform(
    geometry: *const Geometry,
    time: f32,
    which: u32,
    transform: *mut c_void,
) {
    // SAFETY: the caller's handle and memory.
    unsafe { rtcGetGeometryTransformEx(geometry, 0, time, which, transform) }
}

/// # Safety
/// A geometry of this library, or null; room for a transform in this format.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcGetGeometryTransformEx(
    geometry: *const Geometry,
    inst_prim_id: u32,
    _time: f32,
    which: u32,
    transform: *mut c_void,
) {
    // SAFETY: the caller's handle and memory.
    unsafe {
        with(geometry, (), |geometry| {
            geometry.must_be(&[Kind::Instance, Kind::InstanceArray], "instances")?;
            let rows = geometry.transform_of(inst_prim_id)?;
            transform::write(&rows, which, transform)
        })
    }
}

impl Geometry {
    /// Transform of an instance, or of an instance of an array.
    pub fn transform_of(&self, inst_prim_id: u32) -> Outcome<Rows> {
        self.transform_at(&self.state(), inst_prim_id as usize)
    }

    /// As [`Geometry::transform_of`], by settings of before.
    pub fn transform_at(&self, state: &State, index: usize) -> Outcome<Rows> {
        if self.kind == Kind::Instance {
            return Ok(state.transform);
        }
        let view = state.view(buffer_type::TRANSFORM, 0)?;
        if index >= view.count {
            return Err(Failure::argument("there is no such instance in the array"));
        }
        let numbers: Vec<f32> = view.numbers(index).collect();
        transform::from_numbers(view.format, &numbers)
    }
}
