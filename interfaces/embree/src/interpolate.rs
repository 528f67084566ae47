//! Interpolation of vertices and vertex attributes over triangles and quads.

use std::ffi::c_int;

use crate::abi::{InterpolateArguments, InterpolateManyArguments};
use crate::failure::{Failure, Outcome, guarded};
use crate::geometry::{Geometry, Kind, State};
use crate::handle::{device_of, look};

/// Weights of three corners, and of their derivatives by `u` and `v`.
struct Weights {
    corners: [usize; 3],
    value: [f32; 3],
    by_u: [f32; 3],
    by_v: [f32; 3],
}

/// Where results go. Null places are left out.
struct Places {
    value: *mut f32,
    by_u: *mut f32,
    by_v: *mut f32,
    /// Second derivatives, which are 0 on flat primitives.
    second: [*mut f32; 3],
    /// Distance between numbers of one result.
    stride: usize,
}

fn weights(kind: Kind, state: &State, prim: u32, u: f32, v: f32) -> Outcome<Weights> {
    let index = (state.index.as_ref()).filter(|index| (prim as usize) < index.count);
    let index = index.ok_or_else(|| Failure::argument("there is no such primitive"))?;
    Ok(match kind {
        Kind::Triangles => Weights {
            corners: index
                .read::<3, u32>(prim as usize)
                .map(|corner| corner as usize),
            value: [1.0 - u - v, u, v],
            by_u: [-1.0, 1.0, 0.0],
            by_v: [-1.0, 0.0, 1.0],
        },
        Kind::Quads => {
            let [a, b, c, d] = index
                .read::<4, u32>(prim as usize)
                .map(|corner| corner as usize);
            if u + v <= 1.0 {
                Weights {
                    corners: [a, b, d],
                    value: [1.0 - u - v, u, v],
                    by_u: [-1.0, 1.0, 0.0],
                    by_v: [-1.0, 0.0, 1.0],
                }
            } else {
                Weights {
                    corners: [c, d, b],
                    value: [u + v - 1.0, 1.0 - u, 1.0 - v],
                    by_u: [1.0, -1.0, 0.0],
                    by_v: [1.0, 0.0, -1.0],
                }
            }
        }
        _ => {
            return Err(Failure::operation(
                "only triangles and quads can be interpolated",
            ));
        }
    })
}

/// Writes `count` numbers of one point.
///
/// # Safety
/// The places have room.
unsafe fn interpolate(
    (kind, state): (Kind, &State),
    (buffer_type, slot): (u32, u32),
    (prim, u, v): (u32, f32, f32),
    count: usize,
    places: &Places,
) -> Outcome {
    let view = state.view(buffer_type, slot)?;
    let weights = weights(kind, state, prim, u, v)?;
    if weights.corners.iter().any(|corner| *corner >= view.count) {
        return Err(Failure::argument(
            "a corner of the primitive is out of range",
        ));
    }
    let [a, b, c] = weights.corners.map(|corner| view.numbers(corner));
    let numbers = a.zip(b).zip(c).take(count);
    for (number, ((a, b), c)) in numbers.enumerate() {
        let sum = |[x, y, z]: [f32; 3]| x * a + y * b + z * c;
        let results = [
            (places.value, sum(weights.value)),
            (places.by_u, sum(weights.by_u)),
            (places.by_v, sum(weights.by_v)),
            (places.second[0], 0.0),
            (places.second[1], 0.0),
            (places.second[2], 0.0),
        ];
        for (place, result) in results {
            if !place.is_null() {
                // SAFETY: as the caller vouches.
                unsafe { place.add(number * places.stride).write(result) };
            }
        }
    }
    Ok(())
}

/// # Safety
/// Arguments with room for the results.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcInterpolate(arguments: *const InterpolateArguments<Geometry>) {
    // SAFETY: the caller's memory and handle.
    unsafe {
        let Some(given) = arguments.as_ref() else {
            return;
        };
        guarded(device_of(given.geometry), (), || {
            let geometry = look(given.geometry)?;
            let places = Places {
                value: given.p,
                by_u: given.dp_du,
                by_v: given.dp_dv,
                second: [given.ddp_dudu, given.ddp_dvdv, given.ddp_dudv],
                stride: 1,
            };
            interpolate(
                (geometry.kind, &geometry.state()),
                (given.buffer_type, given.slot),
                (given.prim_id, given.u, given.v),
                given.values as usize,
                &places,
            )
        });
    }
}

/// # Safety
/// Arguments with room for the results: arrays of `n` numbers, one array after the other.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcInterpolateN(arguments: *const InterpolateManyArguments<Geometry>) {
    // SAFETY: the caller's memory and handle.
    unsafe {
        let Some(given) = arguments.as_ref() else {
            return;
        };
        guarded(device_of(given.geometry), (), || {
            let geometry = look(given.geometry)?;
            let state = geometry.state();
            let is_active = |index: usize| {
                given.valid.is_null() || *given.valid.cast::<c_int>().add(index) == -1
            };
            for index in (0..given.n as usize).filter(|index| is_active(*index)) {
                let at = |place: *mut f32| match place.is_null() {
                    true => place,
                    false => place.add(index),
                };
                let places = Places {
                    value: at(given.p),
                    by_u: at(given.dp_du),
                    by_v: at(given.dp_dv),
                    second: [given.ddp_dudu, given.ddp_dvdv, given.ddp_dudv].map(at),
                    stride: given.n as usize,
                };
                let point = (
                    *given.prim_ids.add(index),
                    *given.u.add(index),
                    *given.v.add(index),
                );
                let source = (given.buffer_type, given.slot);
                interpolate(
                    (geometry.kind, &state),
                    source,
                    point,
                    given.values as usize,
                    &places,
                )?;
            }
            Ok(())
        });
    }
}
