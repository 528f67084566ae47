//! Depths of lidar sweeps along streets: closest hits of coherent rays.

use antumbra::{Bvh, Ray};

use crate::Outcome;
use crate::city::City;
use crate::compare::compare;
use crate::input::{Random, Sensors};
use crate::rtc::{CALLS, Rtc};

const SWEEPS: usize = 50;
const BEAMS: usize = 64;
const AZIMUTHS: usize = 2048;

pub fn run(rtc: &Rtc, city: &City) -> Outcome {
    let directions = directions();
    let all: Vec<[f32; 3]> = {
        let Sensors { points, .. } = &city.streets.inside(crate::city::MIDDLE);
        points.iter().map(|&[x, y, z]| [x, y, z + 1.8]).collect()
    };
    let mut random = Random(3);
    let places: Vec<[f32; 3]> = (0..SWEEPS)
        .map(|_| all[random.bits() as usize % all.len()])
        .collect();
    let ours = |bvh: &Bvh| {
        let mut depths = Vec::with_capacity(places.len() * directions.len());
        let mut hits = vec![None; directions.len()];
        for &place in &places {
            let rays: Vec<Ray> = directions.iter().map(|&dir| Ray::new(place, dir)).collect();
            bvh.batch(&rays).on_this_thread().intersect_into(&mut hits);
            depths.extend(
                hits.iter()
                    .map(|hit| hit.map_or(f32::INFINITY, |hit| hit.t)),
            );
        }
        depths
    };
    let embree = |call, share: usize| {
        let mut depths = Vec::with_capacity(places.len() * directions.len());
        for &place in &places[..places.len() / share] {
            let ray = |index: usize| Ray::new(place, directions[index]);
            rtc.intersect(call, directions.len(), ray, |_, depth, _| {
                depths.push(depth)
            });
        }
        depths
    };
    let compared = compare(rtc, &city.mesh, ours, &CALLS, embree);
    let both = compared.ours.iter().zip(&compared.embree);
    let differ = both
        .filter(|(a, b)| a.is_finite() != b.is_finite() || (*a - *b).abs() > 1e-4 * a.max(1.0))
        .count();
    let count = compared.ours.len();
    Ok(compared.row(count as u64, count, differ))
}

/// A sweep: beams from 25 degrees below the horizon to 15 above it, once around.
fn directions() -> Vec<[f32; 3]> {
    let mut directions = Vec::new();
    for beam in 0..BEAMS {
        let (up, flat) = (-25.0 + 40.0 * beam as f32 / (BEAMS - 1) as f32)
            .to_radians()
            .sin_cos();
        for azimuth in 0..AZIMUTHS {
            let (sin, cos) = (std::f32::consts::TAU * azimuth as f32 / AZIMUTHS as f32).sin_cos();
            directions.push([flat * cos, flat * sin, up]);
        }
    }
    directions
}
