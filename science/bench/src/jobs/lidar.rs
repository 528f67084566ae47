//! Depths of lidar sweeps along streets: closest hits of coherent rays.

use antumbra::{Bvh, Ray};
use antumbra_lab::embree::{Call, Scene, SceneFlags};
use antumbra_lab::harness::Mesh;
use antumbra_testkit::Rng;

use super::{Job, Programs, differing};
use crate::Outcome;
use crate::input::Sensors;

const BEAMS: usize = 64;
const AZIMUTHS: usize = 2048;

/// So many sweeps in streets.
pub fn run(job: &mut Job, mesh: &Mesh, streets: &Sensors, sweeps: usize) -> Outcome {
    let directions = directions();
    let mut rng = Rng::new(3);
    let places: Vec<[f32; 3]> = (0..sweeps)
        .map(|_| streets.points[rng.bits() as usize % streets.points.len()])
        .map(|[x, y, z]| [x, y, z + 1.8])
        .collect();
    let programs = Programs {
        mesh,
        flags: SceneFlags::default(),
        ours: |bvh: &Bvh| {
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
        },
        ways: &Call::USUAL,
        embree: |scene: &Scene, call, share| {
            let mut depths = Vec::with_capacity(places.len() * directions.len());
            for &place in &places[..places.len() / share] {
                let ray = |index: usize| Ray::new(place, directions[index]);
                scene.intersect(call, directions.len(), ray, |_, (depth, _)| {
                    depths.push(depth)
                });
            }
            depths
        },
    };
    let differs =
        |a: &f32, b: &f32| a.is_finite() != b.is_finite() || (a - b).abs() > 1e-4 * a.max(1.0);
    job.compare(programs, differing(differs))?;
    Ok(())
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
