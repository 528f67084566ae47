//! Batches from separate arrays, all hits of a ray, and a tree in a file: an example of the book in `docs/`, run by its tests.

use std::sync::Arc;

use antumbra::{Bvh, Directions, Error, Geometry, Ray, RayColumns, RayOrder, Recipe, Visit};

fn main() -> Result<(), Error> {
    // A roof over the right half of a floor.
    let positions = [
        [0.0, 0.0, 0.0],
        [8.0, 0.0, 0.0],
        [0.0, 8.0, 0.0],
        [4.0, 0.0, 2.0],
        [8.0, 0.0, 2.0],
        [8.0, 8.0, 2.0],
        [4.0, 8.0, 2.0],
    ];
    let triangles = vec![[0, 1, 2], [3, 4, 5], [3, 5, 6]];
    let geometry = [Geometry::triangles(&positions[..], triangles)];
    let bvh = Arc::new(Bvh::build(&geometry, &Recipe::default())?);

    // ANCHOR: columns
    let points: Vec<[f32; 3]> = (0..1000).map(|i| [i as f32 / 125.0, 0.5, 0.01]).collect();
    let sun = [0.0, 0.0, 1.0];
    let rays = RayColumns::new(points.len(), &points, &sun)?.far(100.0)?;
    let mut in_shadow = vec![false; points.len()];
    bvh.batch(rays)
        .on_this_thread()
        .occluded_into(&mut in_shadow);
    // ANCHOR_END: columns

    let mut sorted = vec![false; points.len()];
    let batch = bvh.batch(rays).order(RayOrder::Sorted);
    batch.occluded_into(&mut sorted);
    assert_eq!(sorted, in_shadow, "the order changes no answer");

    // ANCHOR: group
    // Suns of an afternoon, which all points look at.
    let suns: Vec<[f32; 3]> = (0..100).map(|i| [0.01 * i as f32, 0.0, 0.5]).collect();
    let suns = Directions::new(&suns);
    let normals = vec![[0.0, 0.0, 1.0]; points.len()];
    let group = bvh.group(&points, &suns).above(&normals);
    let words = group.words_per_row();
    let mut sunlit = vec![0u64; words * points.len()];
    group.open_into(&mut sunlit);
    let seen = |row: &[u64]| row.iter().map(|word| word.count_ones()).sum::<u32>();
    println!("the first point sees {} suns", seen(&sunlit[..words]));
    // ANCHOR_END: group
    assert!(seen(&sunlit[..words]) < 100, "the roof is in the way");

    // ANCHOR: hit
    let ray = Ray::new([6.0, 1.0, 5.0], [0.0, 0.0, -1.0]);
    if let Some(hit) = bvh.intersect(&ray) {
        let (point, normal) = (ray.at(hit.t), bvh.normal(&ray, &hit));
        println!("the roof is at {point:?}, its normal {normal:?}");
    }
    // ANCHOR_END: hit

    // ANCHOR: visit
    // How much light comes through the roof, of tinted glass, and reaches the floor, which is opaque.
    let mut light = 1.0;
    let opaque = bvh.query(&ray).visit_hits(|hit| {
        light *= if hit.prim_id == 0 { 0.0 } else { 0.5 };
        if light > 0.0 {
            Visit::Reject
        } else {
            Visit::Accept
        }
    });
    // ANCHOR_END: visit
    assert_eq!((light, opaque.map(|hit| hit.t)), (0.0, Some(5.0)));

    // ANCHOR: save
    let mut file = Vec::new();
    bvh.write(&mut file)?;
    let loaded = Bvh::read(&file[..])?;
    // ANCHOR_END: save
    assert_eq!(loaded.intersect(&ray), bvh.intersect(&ray));

    let shadows = in_shadow.iter().filter(|shadow| **shadow).count();
    println!("{shadows} of {} points lie in shadow", points.len());
    Ok(())
}
