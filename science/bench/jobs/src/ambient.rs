//! Ambient occlusion: directions around the normal of each point.

use antumbra::{Bvh, Ray};
use antumbra_bake::{AmbientOcclusion, ambient_occlusion, ambient_rays};

use crate::Outcome;
use crate::compare::compare;
use crate::input::{Mesh, Random, Sensors, along_curve, cross, origin_offset, unit};
use crate::rtc::{CALLS, Call, Rtc};
use crate::turns::seconds;

pub fn run(rtc: &Rtc, mesh: &Mesh, sensors: &Sensors, samples: u32) -> Outcome {
    let options = AmbientOcclusion {
        samples,
        ..AmbientOcclusion::default()
    };
    let Sensors { points, normals } = sensors;
    let ours = |bvh: &Bvh| {
        ambient_occlusion(bvh, points, normals, &options, &()).expect("one normal per point")
    };
    let compared = compare(rtc, mesh, ours, &CALLS, |call, share| {
        embree(rtc, mesh, sensors, samples, call, share)
    });
    let expected = same_rays(rtc, &crate::build(mesh), sensors, &options);
    let differ = compared
        .ours
        .iter()
        .zip(&expected)
        .filter(|(a, b)| a != b)
        .count();
    // Both estimate the same numbers with other rays.
    let both = compared.ours.iter().zip(&compared.embree);
    let apart: f64 = both.map(|(a, b)| f64::from((a - b).abs())).sum();
    eprintln!(
        "    mean difference of the estimates {:.4}",
        apart / points.len() as f64
    );
    Ok(compared.row(
        points.len() as u64 * u64::from(samples),
        points.len(),
        differ,
    ))
}

/// Embree's program: one table of directions in squares of 4 x 4, turned around the normal of each point by chance.
fn embree(
    rtc: &Rtc,
    mesh: &Mesh,
    sensors: &Sensors,
    samples: u32,
    call: Call,
    share: usize,
) -> Vec<f32> {
    let table = table(samples);
    let origins = sensors.lifted(origin_offset(mesh, &sensors.points));
    let order = along_curve(&origins);
    let mut open = vec![0.0; origins.len()];
    let mut random = Random(7);
    for &point in &order[..order.len() / share] {
        let normal = sensors.normals[point as usize];
        let other = if normal[0].abs() < 0.5 {
            [1.0, 0.0, 0.0]
        } else {
            [0.0, 1.0, 0.0]
        };
        let right = unit(cross(normal, other));
        let ahead = cross(normal, right);
        let (sin, cos) = (std::f32::consts::TAU * random.next()).sin_cos();
        let s = [0, 1, 2].map(|axis| cos * right[axis] + sin * ahead[axis]);
        let t = [0, 1, 2].map(|axis| cos * ahead[axis] - sin * right[axis]);
        let mut count = 0;
        rtc.occluded(
            call,
            table.len(),
            |index| {
                let [x, y, z] = table[index];
                Ray::new(
                    origins[point as usize],
                    [0, 1, 2].map(|axis| x * s[axis] + y * t[axis] + z * normal[axis]),
                )
            },
            |_, occluded| count += u32::from(!occluded),
        );
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
fn same_rays(rtc: &Rtc, bvh: &Bvh, sensors: &Sensors, options: &AmbientOcclusion) -> Vec<f32> {
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
        rtc.occluded(
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
