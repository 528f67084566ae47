//! Ambient occlusion: directions around the normal of each point.

use antumbra::{Bvh, Ray};
use antumbra_bake::{AmbientOcclusion, ambient_occlusion, ambient_rays};
use antumbra_lab::embree::{Call, Scene, SceneFlags};
use antumbra_lab::harness::{Mesh, cross, unit};
use antumbra_lab::thread_seconds as seconds;
use antumbra_testkit::Rng;

use super::{Job, Programs};
use crate::Outcome;
use crate::input::{Sensors, along_curve, origin_offset};

pub fn run(job: &mut Job, mesh: &Mesh, sensors: &Sensors, samples: u32) -> Outcome {
    let options = AmbientOcclusion {
        samples,
        ..AmbientOcclusion::default()
    };
    let Sensors { points, normals } = sensors;
    let programs = Programs {
        mesh,
        flags: SceneFlags::default(),
        ours: |bvh: &Bvh| {
            ambient_occlusion(bvh, points, normals, &options, &()).expect("one normal per point")
        },
        ways: &Call::USUAL,
        embree: |scene: &Scene, call, share| embree(scene, (mesh, sensors), samples, call, share),
    };
    // Embree's program estimates the same numbers with other rays, so ours are compared with its answers to our rays.
    let model = mesh.model();
    let scene = Scene::build(&job.bench.device()?, &model, SceneFlags::default())?;
    let expected = same_rays(&scene, &mesh.tree(), sensors, &options);
    job.compare(programs, |ours, theirs| {
        let apart = ours
            .iter()
            .zip(theirs)
            .map(|(a, b)| f64::from((a - b).abs()));
        let apart = apart.sum::<f64>() / points.len() as f64;
        eprintln!("    mean difference of the estimates {apart:.4}");
        let both = ours.iter().zip(&expected);
        [points.len(), both.filter(|(a, b)| a != b).count()]
    })?;
    Ok(())
}

/// Embree's program: one table of directions in squares of 4 x 4, turned around the normal of each point by chance.
fn embree(
    scene: &Scene,
    (mesh, sensors): (&Mesh, &Sensors),
    samples: u32,
    call: Call,
    share: usize,
) -> Vec<f32> {
    let table = table(samples);
    let origins = sensors.lifted(origin_offset(mesh, &sensors.points));
    let order = along_curve(&origins);
    let mut open = vec![0.0; origins.len()];
    let mut rng = Rng::new(7);
    for &point in &order[..order.len() / share] {
        let normal = sensors.normals[point as usize];
        let other = if normal[0].abs() < 0.5 {
            [1.0, 0.0, 0.0]
        } else {
            [0.0, 1.0, 0.0]
        };
        let right = unit(cross(normal, other));
        let ahead = cross(normal, right);
        let (sin, cos) = (std::f32::consts::TAU * rng.unit()).sin_cos();
        let s = [0, 1, 2].map(|axis| cos * right[axis] + sin * ahead[axis]);
        let t = [0, 1, 2].map(|axis| cos * ahead[axis] - sin * right[axis]);
        let ray = |index: usize| {
            let [x, y, z] = table[index];
            let dir = [0, 1, 2].map(|axis| x * s[axis] + y * t[axis] + z * normal[axis]);
            Ray::new(origins[point as usize], dir)
        };
        let mut count = 0;
        scene.occluded(call, table.len(), ray, |_, occluded| {
            count += u32::from(!occluded)
        });
        open[point as usize] = count as f32 / samples as f32;
    }
    open
}

/// Directions by the cosine around the z axis, stratified. Every 16 are neighbours.
fn table(samples: u32) -> Vec<[f32; 3]> {
    let heights = samples / 16;
    (0..samples)
        .map(|index| {
            let (tile, place) = (index / 16, index % 16);
            let row = (tile / 4 * 4 + place / 4) as f32 + 0.5;
            let column = (tile % 4 * 4 + place % 4) as f32 + 0.5;
            let u = row / heights as f32;
            let (sin, cos) = (std::f32::consts::TAU * column / 16.0).sin_cos();
            [u.sqrt() * cos, u.sqrt() * sin, (1.0 - u).sqrt()]
        })
        .collect()
}

/// Values by single calls of Embree for the very rays that we trace.
fn same_rays(scene: &Scene, bvh: &Bvh, sensors: &Sensors, options: &AmbientOcclusion) -> Vec<f32> {
    const BLOCK: usize = 1 << 12;
    let samples = options.samples as usize;
    let (mut open, mut making, mut tracing) = (Vec::new(), 0.0, 0.0);
    for (points, normals) in (sensors.points.chunks(BLOCK)).zip(sensors.normals.chunks(BLOCK)) {
        let count = points.len() * samples;
        let start = seconds();
        let rays = ambient_rays(bvh, (points, normals), options, count, samples);
        assert_eq!(rays.len(), count, "every point has rays");
        let made = seconds();
        let mut counts = vec![0u32; points.len()];
        scene.occluded(
            Call::Single,
            count,
            |index| rays[index],
            |index, occluded| {
                counts[index / samples] += u32::from(!occluded);
            },
        );
        making += made - start;
        tracing += seconds() - made;
        open.extend(
            counts
                .into_iter()
                .map(|count| (f64::from(count) / samples as f64) as f32),
        );
    }
    eprintln!("    our own rays: made in {making:.3} s, traced by rtcOccluded1 in {tracing:.3} s");
    open
}
