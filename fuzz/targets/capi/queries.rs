//! Queries, in forms that must agree.

use std::ptr::{null, null_mut};

use antumbra::{Bvh, Directions, Hit, HitLists, PrimId, Ray};
use antumbra_capi::arrays::SAME;
use antumbra_capi::batch::BatchOptions;
use antumbra_capi::groups::*;
use antumbra_capi::hits::*;
use antumbra_capi::points::*;
use antumbra_capi::queries::*;
use antumbra_capi::single::{Surface, antumbra_occluded1};

use crate::callbacks::{filter, visit};
use crate::handles::{done, threads};
use crate::script::{Array, Script};

/// Queries of rays, in forms that must agree.
///
/// # Safety
/// As [`add`], for the tree.
pub unsafe fn trace(script: &mut Script, bvh: *const Bvh) {
    let count = match script.rarely(16) {
        true => 80 + usize::from(script.byte()),
        false => script.below(40),
    };
    let rays = Array::new(script, count, 8, |script| script.number().to_bits());
    let masks = Array::new(script, count, 1, |script| u32::from(script.byte()));
    let except = Array::new(script, count, 3, |script| match script.below(8) {
        7 => u32::MAX,
        id => id as u32,
    });
    let mut batch = BatchOptions {
        ray_stride: rays.stride,
        ..BatchOptions::of(&[])
    };
    batch.count = count;
    batch.rays = rays.first();
    if script.rarely(3) {
        (batch.masks, batch.mask_stride) = (masks.first(), masks.stride);
        if script.rarely(3) {
            batch.mask_stride = SAME;
        }
    }
    if script.rarely(3) {
        (batch.except, batch.except_stride) = (except.first(), except.stride);
    }
    batch.filter = script.rarely(4).then_some(filter);
    batch.flags = script.below(4) as u32;
    batch.order = script.below(4) as u32;
    if script.rarely(32) {
        (batch.flags, batch.order) = (script.byte().into(), script.byte().into());
    }
    batch.threads = threads(script);
    let mut dark = vec![7u8; count];
    let mut hits = vec![
        Hit {
            t: 0.0,
            u: 0.0,
            v: 0.0,
            prim_id: 0,
            geom_id: 0,
            inst_id: 0
        };
        count
    ];
    let (mut bits, mut counts) = (vec![u64::MAX; count.div_ceil(64)], vec![u32::MAX; count]);
    // SAFETY: the promise of this function.
    unsafe {
        if !done(antumbra_occluded(bvh, &batch, dark.as_mut_ptr(), 0)) {
            return;
        }
        assert!(done(antumbra_occluded_bits(
            bvh,
            &batch,
            bits.as_mut_ptr(),
            bits.len()
        )));
        assert!(done(antumbra_intersect(bvh, &batch, hits.as_mut_ptr(), 0)));
        assert!(done(antumbra_count_hits(
            bvh,
            &batch,
            counts.as_mut_ptr(),
            0
        )));
        let mut surfaces = vec![0u8; count * size_of::<Surface>()];
        let surfaces = surfaces.as_mut_ptr().cast::<Surface>();
        if surfaces.is_aligned() {
            done(antumbra_surface_of(bvh, &batch, surfaces, 0));
        }
        let mut found = vec![
            PrimId {
                inst_id: 0,
                geom_id: 0,
                prim_id: 0
            };
            count
        ];
        assert!(done(antumbra_occluder(bvh, &batch, found.as_mut_ptr(), 0)));
        done(antumbra_visit_hits(bvh, &batch, Some(visit), null_mut()));
        let (mut lists, mut splits): (*mut HitLists, *const usize) = (null_mut(), null());
        assert!(done(antumbra_all_hits(bvh, &batch, &mut lists)));
        assert!(done(antumbra_hit_lists_get(
            lists,
            &mut splits,
            null_mut(),
            null_mut()
        )));
        for ray in 0..count {
            let is_dark = dark[ray] == 1;
            assert!(dark[ray] < 2);
            assert_eq!(bits[ray / 64] >> (ray % 64) & 1 == 1, is_dark);
            assert_eq!(hits[ray].geom_id != u32::MAX, is_dark);
            assert_eq!(found[ray].geom_id != u32::MAX, is_dark);
            assert_eq!(counts[ray] > 0, is_dark);
            assert_eq!(
                *splits.add(ray + 1) - *splits.add(ray),
                counts[ray] as usize
            );
        }
        antumbra_hit_lists_free(lists);
    }
}

/// Queries of points and of groups.
///
/// # Safety
/// As [`add`], for the tree.
pub unsafe fn look(script: &mut Script, bvh: *const Bvh) {
    let (count, of_directions) = (script.below(20), script.below(80));
    let points = Array::numbers(script, count, 3);
    let reach = Array::numbers(script, count, 1);
    let directions = Array::numbers(script, of_directions, 3);
    let tfar = script.number();
    let options = PointOptions {
        size: size_of::<PointOptions>(),
        count,
        points: points.words(),
        point_stride: points.stride,
        max_distances: if script.rarely(2) {
            reach.words()
        } else {
            null()
        },
        max_distance_stride: reach.stride,
        flags: 2 * script.below(2) as u32,
        reserved: 0,
        threads: threads(script),
    };
    let group = GroupOptions {
        size: size_of::<GroupOptions>(),
        count,
        points: points.words(),
        point_stride: points.stride,
        normals: if script.rarely(3) {
            points.words()
        } else {
            null()
        },
        normal_stride: points.stride,
        tnear: if script.rarely(3) {
            reach.words()
        } else {
            null()
        },
        tnear_stride: reach.stride,
        tfar,
        flags: 2 * script.below(2) as u32,
        threads: threads(script),
    };
    let near = Near {
        distance: 0.0,
        position: [0.0; 3],
        u: 0.0,
        v: 0.0,
        prim_id: 0,
        geom_id: 0,
        inst_id: 0,
    };
    let (mut closest, mut inside) = (vec![near; count], vec![0u8; count]);
    let (mut distances, mut turns) = (vec![0f32; count], vec![0i32; count]);
    // SAFETY: the promise of this function.
    unsafe {
        done(antumbra_closest(bvh, &options, closest.as_mut_ptr(), 0));
        done(antumbra_contains(bvh, &options, inside.as_mut_ptr(), 0));
        done(antumbra_signed_distance(
            bvh,
            &options,
            distances.as_mut_ptr(),
            0,
        ));
        done(antumbra_winding_number(
            bvh,
            &options,
            turns.as_mut_ptr(),
            0,
        ));
        let mut lists = null_mut();
        if done(antumbra_within(bvh, &options, &mut lists)) {
            antumbra_closest_lists_free(lists);
        }
        let mut prepared: *mut Directions = null_mut();
        if !done(antumbra_directions_new(
            directions.words(),
            of_directions,
            directions.stride,
            &mut prepared,
        )) {
            return;
        }
        let words = of_directions.div_ceil(64);
        let mut bits = vec![0u64; count * words];
        if done(antumbra_group_open(
            bvh,
            &group,
            prepared,
            bits.as_mut_ptr(),
            words,
        )) && group.normals.is_null()
        {
            agree(bvh, &group, (&directions, of_directions), &bits);
        }
        antumbra_directions_free(prepared);
    }
}

/// Checks rays of a group without normals one by one.
///
/// # Safety
/// As [`add`], for the tree.
unsafe fn agree(
    bvh: *const Bvh,
    group: &GroupOptions,
    (directions, count): (&Array, usize),
    bits: &[u64],
) {
    let step = |stride, size| if stride == 0 { size } else { stride };
    for point in 0..group.count {
        // SAFETY: items of the arrays of the group.
        let (org, tnear) = unsafe {
            let org = group
                .points
                .byte_add(point * step(group.point_stride, 12))
                .cast::<[f32; 3]>();
            let tnear = match group.tnear.is_null() {
                true => 0.0,
                false => {
                    (group.tnear.byte_add(point * step(group.tnear_stride, 4))).read_unaligned()
                }
            };
            (org.read_unaligned(), tnear)
        };
        for place in 0..count {
            // SAFETY: as above.
            let dir = unsafe {
                directions
                    .words()
                    .byte_add(place * step(directions.stride, 12))
                    .cast::<[f32; 3]>()
                    .read_unaligned()
            };
            let ray = Ray {
                org,
                tnear,
                dir,
                tfar: group.tfar,
            };
            let longest = dir.iter().fold(0.0_f32, |longest, x| longest.max(x.abs()));
            let is_ray =
                org.iter().chain(&dir).all(|x| x.is_finite()) && (1.0 / longest).is_finite();
            let mut occluded = false;
            // SAFETY: the promise of this function.
            assert!(done(unsafe {
                antumbra_occluded1(bvh, &ray, &mut occluded)
            }));
            let is_open = bits[point * count.div_ceil(64) + place / 64] >> (place % 64) & 1 == 1;
            assert!(
                is_open == (is_ray && !occluded) || tnear.is_nan() || group.tfar.is_nan(),
                "{ray:?}"
            );
        }
    }
}
