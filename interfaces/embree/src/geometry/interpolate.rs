//! Interpolation of vertices and vertex attributes over triangles and quads.

use super::{Geometry, Kind, State, View};
use crate::abi::{InterpolateArguments, InterpolateManyArguments, InterpolateResults};
use crate::device::{Failure, Outcome, with};

/// Weights of three corners, and of their derivatives by `u` and `v`.
struct Weights {
    corners: [usize; 3],
    value: [f32; 3],
    by_u: [f32; 3],
    by_v: [f32; 3],
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

/// Writes the results of the `index`th of `n` points.
///
/// # Safety
/// The places are null or have room.
unsafe fn interpolate(
    kind: Kind,
    state: &State,
    view: &View,
    (prim, u, v): (u32, f32, f32),
    results: &InterpolateResults,
    (index, n): (usize, usize),
) -> Outcome {
    let weights = weights(kind, state, prim, u, v)?;
    if weights.corners.iter().any(|corner| *corner >= view.count) {
        return Err(Failure::argument(
            "a corner of the primitive is out of range",
        ));
    }
    let [a, b, c] = weights.corners.map(|corner| view.numbers(corner));
    let numbers = a.zip(b).zip(c).take(results.values as usize);
    for (number, ((a, b), c)) in numbers.enumerate() {
        let sum = |[x, y, z]: [f32; 3]| x * a + y * b + z * c;
        // Second derivatives are 0 on flat primitives.
        let answers = [
            (results.p, sum(weights.value)),
            (results.dp_du, sum(weights.by_u)),
            (results.dp_dv, sum(weights.by_v)),
            (results.ddp_dudu, 0.0),
            (results.ddp_dvdv, 0.0),
            (results.ddp_dudv, 0.0),
        ];
        for (place, answer) in answers {
            if !place.is_null() {
                // SAFETY: as the caller vouches.
                unsafe { place.add(number * n + index).write(answer) };
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
        rtcInterpolateN(&InterpolateManyArguments {
            geometry: given.geometry,
            valid: std::ptr::null(),
            prim_ids: &raw const given.prim_id,
            u: &raw const given.u,
            v: &raw const given.v,
            n: 1,
            buffer_type: given.buffer_type,
            slot: given.slot,
            results: given.results,
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
        with(given.geometry, |geometry| {
            let state = geometry.state();
            let n = given.n as usize;
            let is_active = |index: &usize| given.valid.is_null() || *given.valid.add(*index) == -1;
            for index in (0..n).filter(is_active) {
                let point = (
                    *given.prim_ids.add(index),
                    *given.u.add(index),
                    *given.v.add(index),
                );
                let view = state.view(given.buffer_type, given.slot)?;
                interpolate(
                    geometry.kind,
                    &state,
                    view,
                    point,
                    &given.results,
                    (index, n),
                )?;
            }
            Ok(())
        });
    }
}
