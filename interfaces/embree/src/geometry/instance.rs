//! Scenes and transforms of instances.

use super::*;

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
