//! The C interface: sequences of calls on shared handles, with arrays that end where the header says. No call may end the
//! program, report an internal error, read or write beyond an array, or leave a handle behind when it fails; forms of one
//! query agree. `SANITIZER=address fuzz/run 60 capi` watches the memory.
#![no_main]

mod callbacks;
mod changes;
mod handles;
mod queries;
mod scenes;
mod script;

use std::ptr::{from_mut, from_ref, null, null_mut};

use antumbra::{Hit, Ray};
use antumbra_capi::build::*;
use antumbra_capi::functions::Box3;
use antumbra_capi::scene::{antumbra_scene_free, antumbra_scene_new};
use antumbra_capi::single::{antumbra_intersect1, antumbra_occluded1};
use antumbra_capi::tree::antumbra_bvh_bounds;
use antumbra_capi::world::*;
use libfuzzer_sys::fuzz_target;

use crate::changes::{change_tree, move_world, save};
use crate::handles::{Handles, any, done, full, keep, threads};
use crate::queries::{look, trace};
use crate::scenes::{add, change, instances, with_options};
use crate::script::Script;

fuzz_target!(|input: &[u8]| {
    let mut script = Script(input);
    let script = &mut script;
    let mut own = Handles::default();
    // SAFETY: handles come from `own`, arrays know their lengths, callbacks do what the header says.
    unsafe {
        for _ in 0..40 {
            if script.0.is_empty() {
                break;
            }
            let (mut scene, mut object, mut bvh, mut world) =
                (null_mut(), null_mut(), null_mut(), null_mut());
            match script.below(16) {
                0 => {
                    antumbra_scene_free(full(&mut own.scenes, script));
                    let status = antumbra_scene_new(&mut scene);
                    keep(&mut own.scenes, status, scene);
                }
                1..=3 => {
                    let handle = any(&own.scenes, script);
                    add(script, handle);
                }
                4 => {
                    let handle = any(&own.scenes, script);
                    change(script, handle);
                }
                5 | 6 => {
                    antumbra_bvh_free(full(&mut own.trees, script));
                    let scene = any(&own.scenes, script);
                    let status = with_options(script, |options, _| {
                        antumbra_bvh_build(scene, options, &mut bvh)
                    });
                    keep(&mut own.trees, status, bvh);
                }
                7 => {
                    antumbra_object_free(full(&mut own.objects, script));
                    let scene = any(&own.scenes, script);
                    let status = with_options(script, |options, _| {
                        antumbra_object_build(scene, options, &mut object)
                    });
                    keep(&mut own.objects, status, object);
                }
                8 => {
                    antumbra_bvh_free(full(&mut own.trees, script));
                    let (ground, placed) = (any(&own.scenes, script), instances(script));
                    let scenes = [0; 2].map(|_: i32| any(&own.scenes, script).cast_const());
                    let status = with_options(script, |options, _| {
                        antumbra_bvh_build_instances(
                            ground,
                            scenes.as_ptr(),
                            2,
                            placed.as_ptr(),
                            placed.len(),
                            options,
                            &mut bvh,
                        )
                    });
                    keep(&mut own.trees, status, bvh);
                }
                9 => {
                    antumbra_world_free(full(&mut own.worlds, script));
                    let (ground, placed) = (any(&own.objects, script), instances(script));
                    let objects = [0; 2].map(|_: i32| any(&own.objects, script).cast_const());
                    let (count, pool) = (script.below(3), threads(script));
                    let status = antumbra_world_new(
                        ground,
                        objects.as_ptr(),
                        count,
                        placed.as_ptr(),
                        placed.len(),
                        pool,
                        &mut world,
                    );
                    keep(&mut own.worlds, status, world);
                }
                10 => {
                    let handle = any(&own.worlds, script);
                    move_world(script, handle, &mut own);
                }
                11 => {
                    let handle = any(&own.trees, script);
                    change_tree(script, handle, &mut own);
                }
                12 => {
                    let bvh = any(&own.trees, script);
                    save(script, bvh, &mut own.trees);
                }
                13 => {
                    let mut lent = null();
                    if done(antumbra_world_bvh(any(&own.worlds, script), &mut lent)) {
                        trace(script, lent);
                        look(script, lent);
                    }
                }
                14 => {
                    let handle = any(&own.trees, script);
                    trace(script, handle);
                }
                _ => {
                    let bvh = any(&own.trees, script);
                    look(script, bvh);
                    let (mut bounds, mut offset) = (
                        Box3 {
                            min: [0.0; 3],
                            max: [0.0; 3],
                        },
                        0.0,
                    );
                    let ray = Ray {
                        org: [script.number(); 3],
                        tnear: 0.0,
                        dir: [1.0, script.number(), 0.0],
                        tfar: 9.0,
                    };
                    let (mut is, mut hit) = (
                        false,
                        Hit {
                            t: 0.0,
                            u: 0.0,
                            v: 0.0,
                            prim_id: 0,
                            geom_id: 0,
                            inst_id: 0,
                        },
                    );
                    if done(antumbra_bvh_bounds(
                        bvh,
                        from_mut(&mut bounds).cast(),
                        &mut offset,
                    )) {
                        assert!(done(antumbra_occluded1(bvh, from_ref(&ray), &mut is)));
                        assert!(done(antumbra_intersect1(bvh, &ray, &mut hit)));
                        assert_eq!(is, hit.geom_id != u32::MAX);
                    }
                }
            }
        }
    }
});
