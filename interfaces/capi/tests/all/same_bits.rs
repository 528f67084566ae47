//! The C functions answer what the kernel answers, bit for bit, on random meshes of many sizes.

use std::ptr::{null, null_mut};

use antumbra::{Bvh, Directions, Geometry, Hit, Masks, PrimId, Ray, Recipe};
use antumbra_capi::batch::{BatchOptions, THIS_THREAD};
use antumbra_capi::single::Surface;
use antumbra_capi::status::Status;
use antumbra_capi::{build, groups, meshes, points, queries, scene, single};
use antumbra_testkit::{Rng, mesh};

fn ok(status: Status) {
    assert_eq!(status, Status::Ok, "{}", last_error());
}

fn last_error() -> String {
    let text = antumbra_capi::status::antumbra_last_error();
    // SAFETY: the text lives until the next failure on this thread.
    unsafe { std::ffi::CStr::from_ptr(text) }
        .to_string_lossy()
        .into_owned()
}

const MISS: Hit = single::MISS;

/// A tree by the kernel, and the same tree through C.
fn trees(positions: &[[f32; 3]], indices: &[[u32; 3]], masks: [u32; 2]) -> (Bvh, *mut Bvh) {
    // Two geometries: the first half of the triangles, and the rest.
    let (first, second) = indices.split_at(indices.len() / 2);
    let geometries = [
        Geometry::triangles(positions, first),
        Geometry::triangles(positions, second),
    ];
    let mut bvh = Bvh::build(&geometries, &Recipe::default()).expect("in range");
    bvh.set_masks(Masks::new().world(masks.to_vec()));
    let (mut own, mut tree) = (null_mut(), null_mut());
    // SAFETY: arrays and handles are as the header wants them.
    unsafe {
        ok(scene::antumbra_scene_new(&raw mut own));
        for (number, part) in [first, second].into_iter().enumerate() {
            let mut geom_id = 7;
            ok(meshes::antumbra_scene_add_triangles(
                own,
                positions.as_ptr().cast(),
                positions.len(),
                0,
                part.as_ptr().cast(),
                part.len(),
                12,
                &raw mut geom_id,
            ));
            assert_eq!(geom_id as usize, number);
            ok(scene::antumbra_scene_set_mask(own, geom_id, masks[number]));
        }
        ok(build::antumbra_bvh_build(own, null(), &raw mut tree));
        scene::antumbra_scene_free(own);
    }
    (bvh, tree)
}

#[test]
fn batches_answer_as_the_kernel_does() {
    for (size, count, seed) in [
        (0, 5, 1),
        (1, 11, 2),
        (40, 12, 3),
        (1000, 5000, 4),
        (3000, 40_000, 5),
    ] {
        println!("seed {seed}");
        let mut rng = Rng::new(seed);
        let mesh = mesh::soup(&mut rng, size);
        let (bvh, tree) = trees(&mesh.positions, &mesh.indices, [1, 6]);
        let rays: Vec<Ray> = (0..count)
            .map(|_| Ray::between(rng.point(1.2), rng.point(1.2)))
            .collect();
        let each: Vec<u32> = (0..count).map(|ray| ray as u32 % 8).collect();
        let found = bvh.batch(&rays).intersect();
        let except: Vec<PrimId> = found
            .iter()
            .map(|hit| hit.map_or(PrimId::NONE, PrimId::from))
            .collect();
        for flags in [0, THIS_THREAD] {
            for conditions in 0..4 {
                let mut batch = BatchOptions::of(&rays);
                let mut kernel = bvh.batch(&rays);
                batch.flags = flags;
                if conditions & 1 != 0 {
                    batch.masks = each.as_ptr();
                    kernel = kernel.masks(&each);
                }
                if conditions & 2 != 0 {
                    batch.except = except.as_ptr();
                    kernel = kernel.except(&except);
                }
                check(tree, &batch, kernel);
            }
        }
        // SAFETY: freed once.
        unsafe { build::antumbra_bvh_free(tree) }
    }
}

fn check(tree: *const Bvh, batch: &BatchOptions, kernel: antumbra::Batch<'_>) {
    let count = batch.count;
    let (mut dark, mut hits) = (vec![9; count], vec![MISS; count]);
    let nothing = Surface {
        hit: MISS,
        position: [1.0; 3],
        normal: [2.0; 3],
    };
    let (mut surfaces, mut bits) = (vec![nothing; count], vec![u64::MAX; count.div_ceil(64)]);
    let mut occluders = vec![PrimId::NONE; count];
    // SAFETY: arrays are as long as the batch.
    unsafe {
        ok(queries::antumbra_occluded(
            tree,
            batch,
            dark.as_mut_ptr(),
            0,
        ));
        ok(queries::antumbra_occluded_bits(
            tree,
            batch,
            bits.as_mut_ptr(),
            bits.len(),
        ));
        ok(queries::antumbra_intersect(
            tree,
            batch,
            hits.as_mut_ptr(),
            0,
        ));
        ok(queries::antumbra_surface_of(
            tree,
            batch,
            surfaces.as_mut_ptr(),
            0,
        ));
        ok(queries::antumbra_occluder(
            tree,
            batch,
            occluders.as_mut_ptr(),
            0,
        ));
    }
    let occluded = kernel.occluded();
    assert_eq!(
        dark,
        occluded
            .iter()
            .map(|dark| u8::from(*dark))
            .collect::<Vec<_>>()
    );
    let mut words = vec![0; count.div_ceil(64)];
    kernel.occluded_bits_into(&mut words);
    assert_eq!(bits, words);
    let found = kernel.intersect();
    let expected: Vec<Hit> = found.iter().map(|hit| hit.unwrap_or(MISS)).collect();
    assert_eq!(hits, expected);
    for (ours, found) in surfaces.iter().zip(kernel.surfaces()) {
        match found {
            Some(found) => {
                assert_eq!(ours.hit, found.hit);
                assert_eq!(
                    ours.position.map(f32::to_bits),
                    found.position.map(f32::to_bits)
                );
                assert_eq!(
                    ours.normal.map(f32::to_bits),
                    found.normal.map(f32::to_bits)
                );
            }
            None => assert_eq!((ours.hit, ours.normal), (MISS, [0.0; 3])),
        }
    }
    for (ours, dark) in occluders.iter().zip(&occluded) {
        assert_eq!(*ours != PrimId::NONE, *dark);
    }
}

#[test]
fn single_rays_groups_and_points_answer_as_the_kernel_does() {
    let mut rng = Rng::new(11);
    println!("seed 11");
    let mesh = mesh::bumpy_grid(&mut rng, 2000);
    let (bvh, tree) = trees(&mesh.positions, &mesh.indices, [u32::MAX; 2]);
    for _ in 0..2000 {
        let ray = Ray::between(rng.point(1.2), rng.point(1.2));
        let (mut dark, mut hit) = (false, MISS);
        // SAFETY: places for answers.
        unsafe {
            ok(single::antumbra_occluded1(
                tree,
                &raw const ray,
                &raw mut dark,
            ));
            ok(single::antumbra_intersect1(
                tree,
                &raw const ray,
                &raw mut hit,
            ));
        }
        assert_eq!(dark, bvh.occluded(&ray));
        assert_eq!(hit, bvh.intersect(&ray).unwrap_or(MISS));
    }

    let sky: Vec<[f32; 3]> = (0..70).map(|_| rng.point(1.0)).collect();
    let places: Vec<[f32; 3]> = (0..300).map(|_| rng.point(1.0)).collect();
    let kernel = Directions::new(&sky);
    let mut open = vec![0; 600];
    bvh.group(&places, &kernel).open_into(&mut open);
    let options = groups::GroupOptions {
        size: size_of::<groups::GroupOptions>(),
        count: places.len(),
        points: places.as_ptr().cast(),
        point_stride: 0,
        normals: null(),
        normal_stride: 0,
        tnear: null(),
        tnear_stride: 0,
        tfar: f32::INFINITY,
        flags: 0,
        threads: null(),
    };
    let (mut prepared, mut bits) = (null_mut(), vec![u64::MAX; 600]);
    let mut near = vec![0.0f32; places.len()];
    let points = points::PointOptions {
        size: size_of::<points::PointOptions>(),
        count: places.len(),
        points: places.as_ptr().cast(),
        point_stride: 12,
        max_distances: null(),
        max_distance_stride: 0,
        flags: 0,
        reserved: 0,
        threads: null(),
    };
    // SAFETY: arrays are as long as the options say.
    unsafe {
        ok(groups::antumbra_directions_new(
            sky.as_ptr().cast(),
            sky.len(),
            0,
            &raw mut prepared,
        ));
        ok(groups::antumbra_group_open(
            tree,
            &raw const options,
            prepared,
            bits.as_mut_ptr(),
            2,
        ));
        groups::antumbra_directions_free(prepared);
        ok(points::antumbra_signed_distance(
            tree,
            &raw const points,
            near.as_mut_ptr(),
            0,
        ));
        build::antumbra_bvh_free(tree);
    }
    assert_eq!(bits, open);
    assert_eq!(near, bvh.points(&places).signed_distances());
}
