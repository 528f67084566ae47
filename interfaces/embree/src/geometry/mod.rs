//! Geometries: what clients set before a commit. In `buffers`, `functions` and `instance` are the calls that set it.

mod buffers;
mod functions;
mod instance;

use std::ffi::c_void;
use std::sync::atomic::{AtomicPtr, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use crate::abi::{
    BoundsFunction, FilterFunction, IntersectFunction, PointFunction, buffer_type, format,
};
use crate::buffer::{Buffer, View};
use crate::curves::Basis;
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
    /// Flat curves.
    Curves(Basis),
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
            17 => Self::Curves(Basis::Linear),
            25 => Self::Curves(Basis::Bezier),
            33 => Self::Curves(Basis::BSpline),
            59 => Self::Curves(Basis::CatmullRom),
            15 | 16 | 24 | 32 | 40 | 58 => return Err(unsupported("round curves")),
            26 | 34 | 42 | 60 => return Err(unsupported("curves with normals")),
            41 => return Err(unsupported("Hermite curves")),
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
            Self::Curves(_) | Self::InstanceArray => Some(format::UINT),
            _ => None,
        }
    }

    /// Format of the vertex buffer.
    fn vertex_format(self) -> Option<u32> {
        match self {
            Self::Triangles | Self::Quads => Some(format::FLOAT3),
            Self::Spheres | Self::Disks | Self::Curves(_) => Some(format::FLOAT4),
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
    /// Quads of a cubic curve.
    pub tessellation: u32,
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
            tessellation: 4,
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

/// Checks the quality, which has no effect: the build quality of the scene decides how trees are built.
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

/// Number of quads of each cubic curve. A linear curve has none.
///
/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryTessellationRate(geometry: *const Geometry, rate: f32) {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, (), |geometry| {
            if !matches!(geometry.kind, Kind::Curves(_)) {
                return Err(Failure::operation("operation only allowed for curves"));
            }
            geometry.change(|state| {
                state.tessellation = (rate as u32).clamp(1, 16);
                Ok(())
            })
        })
    }
}
