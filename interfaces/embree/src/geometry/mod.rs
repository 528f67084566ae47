//! Geometries: what clients set before a commit.
//!
//! `buffer` and `buffers` have memory and what it means, `settings` and `instance` the other calls, `interpolate` attributes.

mod buffer;
mod buffers;
pub mod curves;
mod filters;
mod instance;
mod interpolate;
mod kind;
mod settings;
pub mod transform;

use std::ffi::c_void;
use std::sync::atomic::{AtomicPtr, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use crate::abi::{
    BoundsFunction, FilterFunction, IntersectFunction, PointFunction, buffer_type, format,
};
use crate::device::{Device, Failure, Outcome, give, lock, share};
use crate::scene::Scene;
pub use buffer::View;
pub use filters::{Filters, Query};
pub use kind::{Basis, Kind};
use transform::{IDENTITY, Rows};

/// `RTCGeometry`.
pub struct Geometry {
    device: Arc<Device>,
    pub kind: Kind,
    user: AtomicPtr<c_void>,
    /// Counts changes; 0 until the first commit of the geometry.
    committed: AtomicU64,
    state: Mutex<State>,
}

/// All settings of a geometry.
#[derive(Clone, Default)]
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
}

impl State {
    fn new() -> Self {
        Self {
            mask: 1,
            is_enabled: true,
            tessellation: 4,
            transform: IDENTITY,
            ..Self::default()
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

    /// Changes settings.
    fn set(&self, set: impl FnOnce(&mut State)) -> Outcome {
        set(&mut lock(&self.state));
        Ok(())
    }

    /// Changes settings that only user geometry has.
    fn set_of_user(&self, set: impl FnOnce(&mut State)) -> Outcome {
        self.must_be(&[Kind::User], "user geometries")?;
        self.set(set)
    }

    fn enable(&self, is_enabled: bool) -> Outcome {
        self.set(|state| state.is_enabled = is_enabled)?;
        self.committed.fetch_add(1, Ordering::AcqRel);
        Ok(())
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
        if slot != 0 && buffer != buffer_type::VERTEX_ATTRIBUTE {
            return Err(Failure::argument(
                "invalid buffer slot: motion blur is not supported",
            ));
        }
        match buffer {
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
            _ => match self.kind.format(buffer) {
                None => return Err(Failure::argument("unknown buffer type")),
                Some(format) if format != which => {
                    return Err(Failure::operation(format!(
                        "format {which:#x} of a buffer should be {format:#x}"
                    )));
                }
                Some(_) => {}
            },
        }
        *lock(&self.state).slot(buffer, slot)? = Some(view);
        Ok(())
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

exports! {
    fn rtcNewGeometry(device: Device, kind: u32) -> *const Geometry {
        Ok(give(Arc::new(Geometry {
            device: share(device)?,
            kind: Kind::new(kind)?,
            user: AtomicPtr::default(),
            committed: AtomicU64::new(0),
            state: Mutex::new(State::new()),
        })))
    }

    fn rtcCommitGeometry(geometry: Geometry) {
        geometry.committed.fetch_add(1, Ordering::AcqRel);
        Ok(())
    }

    fn rtcEnableGeometry(geometry: Geometry) {
        geometry.enable(true)
    }

    fn rtcDisableGeometry(geometry: Geometry) {
        geometry.enable(false)
    }
}

handle! { Geometry: rtcRetainGeometry rtcReleaseGeometry }
