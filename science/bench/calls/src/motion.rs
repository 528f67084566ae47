//! Meshes and instances that move between two keys, beside Embree with the same keys.

use std::cell::RefCell;

use antumbra::{Bvh, Error, Geometry, Instance, Primitives, Ray, Recipe};
use antumbra_testkit::{Rng, mesh};

use crate::embree::{Embree, Key};
use crate::input::{Mesh, read_mesh};
use crate::turns::{Work, medians};

/// Rays of a scene: what one thread takes at a time.
const RAYS: usize = 1 << 14;

/// Prints times, rates relative to Embree's single calls, and how many answers differ.
pub fn run(embree: &mut Embree, rounds: usize) -> Result<(), Box<dyn std::error::Error>> {
    let city = read_mesh("builtin:city:200000")?;
    for share in [0.001, 0.01, 0.1] {
        let end = bent(&city.positions, share);
        embree.build_moving(&[&city.positions, &end], &city.indices);
        let mesh = Geometry::moving([city.positions.clone(), end], &city.indices[..]);
        let scene = Primitives::new(&[mesh])?;
        let name = format!("city, moved by {share} of its size");
        compare(&name, &scene, embree, rounds)?;
    }
    for count in [200, 5000] {
        let (ball, keys) = balls(count);
        embree.build_instances(&ball, &keys);
        let object = vec![Geometry::triangles(ball.positions, ball.indices)];
        let instances = keys
            .iter()
            .map(|keys| Instance::moving(0, keys.map(|key| key.rows())));
        let instances: Vec<_> = instances.collect();
        let scene = Primitives::with_instances(&[], &[object], &instances)?;
        compare(&format!("{count} instances"), &scene, embree, rounds)?;
    }
    Ok(())
}

/// Writes a number for each ray: its distance, or for shadow rays 1 and infinity.
type Ask<'a> = Box<dyn Fn(&mut [f32]) + 'a>;

fn shadows<'a>(ask: impl Fn(&mut [bool]) + 'a) -> Ask<'a> {
    Box::new(move |found| {
        let mut occluded = vec![false; found.len()];
        ask(&mut occluded);
        for (found, occluded) in found.iter_mut().zip(occluded) {
            *found = if occluded { 1.0 } else { f32::INFINITY };
        }
    })
}

fn compare(
    name: &str,
    scene: &Primitives,
    embree: &Embree,
    rounds: usize,
) -> Result<(), Error> {
    let bvh = Bvh::build(scene, &Recipe::default())?;
    // The same rays among what does not move, to see what motion costs.
    let still = Bvh::build(&scene.middle(0), &Recipe::default())?;
    let (rays, times) = rays(&bvh);
    let (rays, times, bvh, still) = (&rays[..], &times[..], &bvh, &still);
    let time = |index: usize| times[index];
    let rows: [(&str, Ask<'_>); 8] = [
        (
            "rtcOccluded1",
            shadows(|occluded| embree.occluded_at(rays, time, occluded)),
        ),
        (
            "rtcOccluded16",
            shadows(|occluded| embree.occluded_packets_at(16, rays, time, occluded)),
        ),
        (
            "occluded",
            shadows(|occluded| {
                for ((ray, time), occluded) in rays.iter().zip(times).zip(occluded) {
                    *occluded = bvh.query(ray).at(*time).occluded();
                }
            }),
        ),
        (
            "occluded_batch",
            shadows(|occluded| {
                let batch = bvh.batch(rays).at(times);
                batch.on_this_thread().occluded_into(occluded);
            }),
        ),
        (
            "occluded_batch, nothing moves",
            shadows(|occluded| still.batch(rays).on_this_thread().occluded_into(occluded)),
        ),
        (
            "rtcIntersect1",
            Box::new(|found| embree.intersect_at(rays, time, found)),
        ),
        (
            "intersect",
            Box::new(|found| {
                for ((ray, time), found) in rays.iter().zip(times).zip(found) {
                    let hit = bvh.query(ray).at(*time).intersect();
                    *found = hit.map_or(f32::INFINITY, |hit| hit.t);
                }
            }),
        ),
        (
            "intersect_batch",
            Box::new(|found| {
                let mut hits = vec![None; rays.len()];
                let batch = bvh.batch(rays).at(times);
                batch.on_this_thread().intersect_into(&mut hits);
                for (found, hit) in found.iter_mut().zip(hits) {
                    *found = hit.map_or(f32::INFINITY, |hit| hit.t);
                }
            }),
        ),
    ];
    let found = rows.each_ref().map(|_| RefCell::new(vec![0.0; rays.len()]));
    let works = rows.iter().zip(&found);
    let mut works: Vec<Work<'_>> = works
        .map(|((name, ask), found)| -> Work<'_> {
            (name.to_string(), Box::new(|| ask(&mut found.borrow_mut())))
        })
        .collect();
    let medians = medians(rounds, &mut works);
    drop(works);
    let found = found.map(RefCell::into_inner);
    let hits = found[0].iter().filter(|&&shadow| shadow == 1.0).count();
    println!("{name}: {} % occluded", 100 * hits / rays.len());
    // Rays begin that close to surfaces.
    let nearly = 1e-4 * bvh.bounds().reach();
    let first_closest = rows
        .iter()
        .position(|(name, _)| *name == "rtcIntersect1")
        .expect("a row");
    for (index, (what, _)) in rows.iter().enumerate() {
        let base = if index < first_closest {
            0
        } else {
            first_closest
        };
        let differ = (found[index].iter().zip(&found[base])).filter(|(a, b)| {
            a != b && (base == 0 || !((*a - *b).abs() <= 1e-3 * b.abs() + nearly))
        });
        println!(
            "  {what:<30} {:8.1} ns {:6.2}  {} differ",
            1e9 * medians[index] / rays.len() as f64,
            medians[base] / medians[index],
            differ.count()
        );
    }
    Ok(())
}

/// Positions bent and moved by a share of their size.
fn bent(positions: &[[f32; 3]], share: f32) -> Vec<[f32; 3]> {
    let size = positions
        .iter()
        .flatten()
        .fold(0.0f32, |size, x| size.max(x.abs()));
    let by = share * size;
    let wave = |at: f32| by * (6.0 * at / size).sin();
    let moved = positions
        .iter()
        .map(|&[x, y, z]| [x + wave(y), y + wave(x + z), z + wave(x)]);
    moved.collect()
}

/// A ball with bumps, and instances of it that turn and move by about their size.
fn balls(count: usize) -> (Mesh, Vec<[Key; 2]>) {
    let mut rng = Rng::new(7);
    let ball = mesh::icosphere(4).map("bumpy", |at| {
        let bump = 1.0 + 0.2 * (9.0 * at[0]).sin() * (9.0 * at[1]).sin();
        at.map(|x| x * bump)
    });
    let half = 1.6 * (count as f32).cbrt();
    let instances = (0..count).map(|_| {
        let (at, way, axis) = (rng.point(half), rng.direction(), rng.direction());
        let length = axis.iter().map(|x| x * x).sum::<f32>().sqrt();
        let angles = [rng.range(-0.6, 0.6), rng.range(-0.6, 0.6)];
        let key = |angle: f32, share: f32| {
            let (sin, cos) = angle.sin_cos();
            let [x, y, z] = axis.map(|x| x / length * sin);
            Key {
                quaternion: [cos, x, y, z],
                translation: [0, 1, 2].map(|i| at[i] + share * way[i]),
            }
        };
        [key(angles[0], 0.0), key(angles[1], 1.0)]
    });
    let instances = instances.collect();
    let mesh = Mesh {
        positions: ball.positions,
        indices: ball.indices,
    };
    (mesh, instances)
}

/// Rays without end from what the first rays through the scene hit, in random directions away from there, each at a time of its own.
fn rays(bvh: &Bvh) -> (Vec<Ray>, Vec<f32>) {
    let mut rng = Rng::new(11);
    let bounds = bvh.bounds();
    let offset = bounds.origin_offset();
    let inside = |rng: &mut Rng| -> [f32; 3] {
        [0, 1, 2].map(|i| bounds.min[i] + rng.unit() * (bounds.max[i] - bounds.min[i]))
    };
    let (mut rays, mut times) = (Vec::new(), Vec::new());
    while rays.len() < RAYS {
        let time = rng.unit();
        let first = Ray::new(inside(&mut rng), rng.direction());
        let Some(hit) = bvh.query(&first).at(time).intersect() else {
            continue;
        };
        let at = first.at(hit.t);
        // Back to the side that the first ray came from.
        let dir = rng.direction();
        let side = dir.iter().zip(first.dir).map(|(a, b)| a * b).sum::<f32>();
        let dir = if side > 0.0 { dir.map(|x| -x) } else { dir };
        let length = first.dir.iter().map(|x| x * x).sum::<f32>().sqrt();
        let back = first.dir.map(|x| x / length * offset.max(1e-4 * hit.t));
        rays.push(Ray::new([0, 1, 2].map(|i| at[i] - back[i]), dir));
        times.push(time);
    }
    (rays, times)
}
