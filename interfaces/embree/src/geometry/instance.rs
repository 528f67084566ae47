//! Scenes and transforms of instances.

use std::ffi::c_void;

use super::transform::{self, Rows};
use super::{Geometry, Kind, State};
use crate::abi::{buffer_type, format};
use crate::device::{Failure, Outcome, share_on};
use crate::scene::Scene;

const INSTANCES: [Kind; 2] = [Kind::Instance, Kind::InstanceArray];

exports! {
    fn rtcSetGeometryInstancedScene(geometry: Geometry, scene: *const Scene) {
        rtcSetGeometryInstancedScenes(geometry, &scene, 1);
        Ok(())
    }

    fn rtcSetGeometryInstancedScenes(geometry: Geometry, scenes: *const *const Scene, count: usize) {
        geometry.must_be(&INSTANCES, "instances")?;
        if scenes.is_null() && count > 0 {
            return Err(Failure::argument("the list of scenes is null"));
        }
        let scene = |index: usize| match *scenes.wrapping_add(index) {
            null if null.is_null() => Ok(None),
            scene => share_on(&geometry.device, scene).map(Some),
        };
        let scenes = (0..count).map(scene).collect::<Outcome<Vec<_>>>()?;
        geometry.set(|state| state.scenes = scenes)
    }

    fn rtcSetGeometryTransform(geometry: Geometry, time_step: u32, which: u32, transform: *const c_void) {
        geometry.set_transform(time_step, transform::read(which, transform))
    }

    fn rtcSetGeometryTransformQuaternion(geometry: Geometry, time_step: u32, transform: *const c_void) {
        geometry.set_transform(time_step, transform::read(format::QUATERNION, transform))
    }

    fn rtcGetGeometryTransform(geometry: Geometry, _time: f32, which: u32, transform: *mut c_void) {
        geometry.write_transform(0, which, transform)
    }

    fn rtcGetGeometryTransformEx(
        geometry: Geometry,
        inst_prim_id: u32,
        _time: f32,
        which: u32,
        transform: *mut c_void,
    ) {
        geometry.write_transform(inst_prim_id, which, transform)
    }
}

impl Geometry {
    /// Sets the transform of an instance, which is the same at all times.
    fn set_transform(&self, time_step: u32, rows: Outcome<Rows>) -> Outcome {
        self.must_be(&[Kind::Instance], "instances")?;
        if time_step != 0 {
            return Err(Failure::operation(
                "invalid timestep: motion blur is not supported",
            ));
        }
        let rows = rows?;
        self.set(|state| state.transform = rows)
    }

    /// Writes a transform to memory of the client.
    ///
    /// # Safety
    /// The memory has room for the format.
    unsafe fn write_transform(&self, inst_prim_id: u32, which: u32, place: *mut c_void) -> Outcome {
        self.must_be(&INSTANCES, "instances")?;
        let rows = self.transform_at(&self.state(), inst_prim_id as usize)?;
        // SAFETY: as the caller vouches.
        unsafe { transform::write(&rows, which, place) }
    }

    /// Transform of an instance, or of an instance of an array, by these settings.
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
