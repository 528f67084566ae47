//! Changes of trees and worlds, and files in memory.

use std::ptr::{null, null_mut};

use antumbra::Bvh;
use antumbra_capi::build::antumbra_bvh_free;
use antumbra_capi::learning::*;
use antumbra_capi::save::*;
use antumbra_capi::tree::*;
use antumbra_capi::world::*;

use crate::handles::{Handles, any, done, full, keep, threads};
use crate::scenes::{instances, recipe};
use crate::script::{Array, Script};

/// Writes a tree into memory and reads it, perhaps with other bytes.
///
/// # Safety
/// As [`add`], for the tree.
pub unsafe fn save(script: &mut Script, bvh: *const Bvh, trees: &mut Vec<*mut Bvh>) {
    let (mut bytes, mut count, mut loaded) = (null_mut(), 0, null_mut());
    // SAFETY: the promise of this function.
    unsafe {
        if !done(antumbra_bvh_to_memory(bvh, &mut bytes, &mut count)) {
            return;
        }
        let mut copy = std::slice::from_raw_parts(bytes, count).to_vec();
        antumbra_memory_free(bytes, count);
        for _ in 0..script.below(3) {
            let place = (script.below(255) << 8 | script.below(255)) % count;
            copy[place] ^= 1 << script.below(8);
        }
        let length = if script.rarely(8) { count - 1 } else { count };
        let status = antumbra_bvh_from_memory(copy.as_ptr(), length, null(), &mut loaded);
        if !loaded.is_null() && trees.len() > 3 {
            antumbra_bvh_free(trees.swap_remove(0));
        }
        keep(trees, status, loaded);
    }
}

/// Changes a world in one of several ways.
///
/// # Safety
/// As [`add`], for the world.
pub unsafe fn move_world(script: &mut Script, world: *mut OwnWorld, own: &mut Handles) {
    let placed = instances(script);
    let rays = Array::numbers(script, 16, 8);
    let (mut order, mut index, mut quality) = (null_mut(), 0, 0.0);
    let choices = recipe(script);
    // SAFETY: the promise of this function.
    unsafe {
        match script.below(8) {
            0 | 1 => {
                done(antumbra_world_set_instances(
                    world,
                    placed.as_ptr(),
                    placed.len(),
                    threads(script),
                ));
            }
            2 | 3 => {
                let scenes = [
                    any(&own.scenes, script).cast_const(),
                    any(&own.scenes, script),
                ];
                let objects = [script.index(3), script.index(3)];
                let (count, pool) = (script.below(3), threads(script));
                done(antumbra_world_refit(
                    world,
                    objects.as_ptr(),
                    scenes.as_ptr(),
                    count,
                    placed.as_ptr(),
                    placed.len(),
                    pool,
                ));
            }
            4 => {
                done(antumbra_world_add_object(
                    world,
                    any(&own.objects, script),
                    &mut index,
                ));
            }
            5 => {
                let masks = [script.byte().into(), 1, 2];
                done(antumbra_world_set_masks(
                    world,
                    script.index(3),
                    masks.as_ptr(),
                    script.below(4),
                ));
            }
            6 => {
                let status = antumbra_world_relearn(
                    world,
                    rays.first(),
                    16,
                    rays.stride,
                    &choices,
                    &mut order,
                );
                antumbra_child_order_free(full(&mut own.orders, script));
                keep(&mut own.orders, status, order);
            }
            _ => {
                done(antumbra_world_adopt(world, any(&own.orders, script)));
                done(antumbra_world_quality(world, script.index(3), &mut quality));
            }
        }
    }
}

/// Changes a tree in one of several ways.
///
/// # Safety
/// As [`add`], for the tree.
pub unsafe fn change_tree(script: &mut Script, bvh: *mut Bvh, own: &mut Handles) {
    let rays = Array::numbers(script, 16, 8);
    let (mut order, mut copy) = (null_mut(), null_mut());
    let choices = recipe(script);
    // SAFETY: the promise of this function.
    unsafe {
        match script.below(6) {
            0 | 1 => {
                done(antumbra_bvh_refit(
                    bvh,
                    any(&own.scenes, script),
                    threads(script),
                ));
            }
            2 => {
                let masks = [script.byte().into(), 1, 2];
                done(antumbra_bvh_set_masks(bvh, masks.as_ptr(), script.below(4)));
            }
            3 => {
                let status =
                    antumbra_bvh_relearn(bvh, rays.first(), 16, rays.stride, &choices, &mut order);
                antumbra_child_order_free(full(&mut own.orders, script));
                keep(&mut own.orders, status, order);
            }
            4 => {
                done(antumbra_bvh_adopt(bvh, any(&own.orders, script)));
            }
            _ => {
                let status = antumbra_bvh_copy(bvh, &mut copy);
                antumbra_bvh_free(full(&mut own.trees, script));
                keep(&mut own.trees, status, copy);
            }
        }
    }
}
