//! Geometry, and options of builds.

use std::ffi::c_char;
use std::ptr::{from_mut, null, null_mut};

use antumbra_capi::arrays::SAME;
use antumbra_capi::build::BuildOptions;
use antumbra_capi::functions::{OpacityFunction, UserFunctions};
use antumbra_capi::meshes::*;
use antumbra_capi::recipe::{RecipeChoices, antumbra_recipe_init};
use antumbra_capi::scene::*;
use antumbra_capi::status::Status;
use antumbra_capi::world::Placed;

use crate::callbacks::*;
use crate::handles::{done, threads};
use crate::script::{Array, Script};

pub fn recipe(script: &mut Script) -> RecipeChoices {
    // SAFETY: numbers and pointers, which a call sets.
    let mut recipe: RecipeChoices = unsafe { std::mem::zeroed() };
    let preset = [c"fast", c"default", c"paper", c"fast"][script.below(4)];
    // SAFETY: a place for a recipe, and a literal.
    assert!(done(unsafe {
        antumbra_recipe_init(&mut recipe, preset.as_ptr())
    }));
    recipe.surface_rays = script.below(64) as u64;
    if script.rarely(4) {
        recipe.width = [0, 4, 8, 16, 5][script.below(5)];
        recipe.training = script.below(5) as u32;
        recipe.level = [
            null::<c_char>(),
            c"scalar".as_ptr(),
            c"avx2".as_ptr(),
            c"none".as_ptr(),
        ][script.below(4)];
        recipe.order = [
            c"joint".as_ptr(),
            c"sort+".as_ptr(),
            c"".as_ptr(),
            c"sato".as_ptr(),
        ][script.below(4)];
        recipe.collapse = [c"learned".as_ptr(), c"area".as_ptr(), c"sah".as_ptr()][script.below(3)];
        recipe.node_cost = script.number();
        recipe.prefetch = script.below(3) as u32;
        recipe.seed = script.byte().into();
    }
    recipe
}

/// Builds with options, or without.
pub fn with_options<R>(
    script: &mut Script,
    build: impl FnOnce(*const BuildOptions, &mut Script) -> R,
) -> R {
    let (recipe, count) = (recipe(script), script.below(24));
    let rays = Array::numbers(script, count, 8);
    let options = BuildOptions {
        size: size_of::<BuildOptions>() - usize::from(script.rarely(64)),
        recipe: &recipe,
        rays: rays.first(),
        ray_count: count,
        ray_stride: rays.stride,
        data: if script.rarely(16) {
            from_mut(script).cast()
        } else {
            null_mut()
        },
        progress: Some(progress),
        cancelled: Some(cancelled),
        threads: threads(script),
    };
    build(&options, script)
}

pub fn instances(script: &mut Script) -> Vec<Placed> {
    (0..script.below(5))
        .map(|_| Placed {
            object: script.index(3),
            mask: [u32::MAX, 1, 2, 0][script.below(4)],
            transform: match script.below(3) {
                0 => [0.0; 12].map(|_: f32| script.number()),
                kind => {
                    let mut rows = [
                        1.0,
                        0.0,
                        0.0,
                        0.0,
                        0.0,
                        1.0,
                        0.0,
                        0.0,
                        0.0,
                        0.0,
                        kind as f32,
                        0.0,
                    ];
                    for place in [3, 7, 11] {
                        rows[place] = script.number();
                    }
                    rows
                }
            },
        })
        .collect()
}

/// Adds a geometry.
///
/// # Safety
/// The scene is null or a handle. All other addresses are right, here and below: the arrays say how long they are.
pub unsafe fn add(script: &mut Script, scene: *mut Scene) {
    let count = 3 + script.below(24);
    let (kind, prims) = (script.below(9), script.below(32));
    let mut geom_id = 0;
    // SAFETY: the promise of this function.
    unsafe {
        match kind {
            0..=3 => {
                let corners = 3 + kind % 2;
                let points = Array::numbers(script, count, 3);
                let indices = Array::new(script, prims, corners, |script| script.index(count));
                let (add, indices, step): (
                    unsafe extern "C" fn(_, _, _, _, _, _, _, _) -> Status,
                    _,
                    _,
                ) = match kind {
                    3 => (antumbra_scene_add_triangles, null::<u32>(), 0),
                    _ if corners == 3 => (
                        antumbra_scene_add_triangles,
                        indices.first(),
                        indices.stride,
                    ),
                    _ => (antumbra_scene_add_quads, indices.first(), indices.stride),
                };
                let prims = if indices.is_null() { count / 3 } else { prims };
                done(add(
                    scene,
                    points.words(),
                    count,
                    points.stride,
                    indices,
                    prims,
                    step,
                    &mut geom_id,
                ));
            }
            4 | 5 => {
                let centers = Array::numbers(script, prims, 3);
                let (radii, normals) = (
                    Array::numbers(script, prims, 1),
                    Array::numbers(script, prims, 3),
                );
                let step = if script.rarely(4) { SAME } else { radii.stride };
                if kind == 4 {
                    let (first, stride) = (centers.words(), centers.stride);
                    done(antumbra_scene_add_spheres(
                        scene,
                        first,
                        stride,
                        radii.words(),
                        step,
                        prims,
                        &mut geom_id,
                    ));
                } else {
                    let (first, stride, facing) =
                        (centers.words(), centers.stride, normals.words());
                    let (turn, radius) = (normals.stride, radii.words());
                    done(antumbra_scene_add_disks(
                        scene,
                        first,
                        stride,
                        facing,
                        turn,
                        radius,
                        step,
                        prims,
                        null_mut(),
                    ));
                }
            }
            6 => {
                let points = Array::numbers(script, count, 4);
                let segments = Array::new(script, prims, 1, |script| script.index(count));
                let (first, step) = if script.rarely(3) {
                    (null::<u32>(), 0)
                } else {
                    (segments.first(), segments.stride)
                };
                let prims = if first.is_null() { count - 1 } else { prims };
                done(antumbra_scene_add_curves(
                    scene,
                    points.words(),
                    count,
                    points.stride,
                    first,
                    prims,
                    step,
                    null_mut(),
                ));
            }
            7 => {
                let doubles: Vec<f64> = (0..3 * count).map(|_| script.number().into()).collect();
                let origin = [0; 3].map(|_: i32| f64::from(script.number()));
                done(antumbra_scene_set_origin(scene, origin.as_ptr()));
                done(antumbra_scene_add_triangles_f64(
                    scene,
                    doubles.as_ptr(),
                    count,
                    0,
                    null(),
                    count / 3,
                    0,
                    null_mut(),
                ));
            }
            _ => {
                let mut functions = UserFunctions {
                    size: size_of::<UserFunctions>(),
                    data: Numbers::leak(script),
                    bounds: Some(bounds),
                    intersect: Some(intersect),
                    occluded: None,
                    closest_point: (!script.rarely(4)).then_some(nearest),
                    normal: Some(normal),
                    release: Some(release),
                };
                if script.rarely(16) {
                    functions.bounds = None;
                }
                if !done(antumbra_scene_add_user(
                    scene,
                    prims as u32,
                    &functions,
                    null_mut(),
                )) {
                    release(functions.data);
                }
            }
        }
    }
}

/// Changes what a scene has.
///
/// # Safety
/// As [`add`].
pub unsafe fn change(script: &mut Script, scene: *mut Scene) {
    let (geom_id, count) = (script.byte() as u32 % 5, 3 + script.below(24));
    // SAFETY: the promise of this function.
    unsafe {
        match script.below(4) {
            0 => {
                let size = size_of::<OpacityFunction>();
                let (data, opacity) = (
                    Numbers::leak(script),
                    Some(opacity as extern "C" fn(_, _) -> _),
                );
                let function = OpacityFunction {
                    size,
                    data,
                    opacity,
                    release: Some(release),
                };
                if !done(antumbra_scene_set_opacity(scene, geom_id, &function)) {
                    release(data);
                }
            }
            1 => {
                done(antumbra_scene_set_mask(
                    scene,
                    geom_id,
                    script.byte().into(),
                ));
            }
            _ => {
                let points = Array::numbers(script, count, 3);
                done(antumbra_scene_set_positions(
                    scene,
                    geom_id,
                    points.words(),
                    count,
                    points.stride,
                ));
            }
        }
    }
}
