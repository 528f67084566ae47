//! Sun hours and sky view: many points, the same directions.

use antumbra::{Bvh, Ray};
use antumbra_bake::{
    Orientation, Place, Refraction, SkyDivision, Weighting, sky_view, sun_hours, sun_positions,
};
use antumbra_lab::embree::{Call, Scene, SceneFlags};
use antumbra_lab::harness::{Mesh, dot};

use super::{Job, Programs, differing};
use crate::Outcome;
use crate::input::{Sensors, along_curve, origin_offset};

/// What a packet of Embree holds.
#[derive(Clone, Copy)]
enum Way {
    /// Directions of one point.
    Directions(Call),
    /// One direction of 16 points.
    Points,
}

const WAYS: [(&str, Way); 4] = [
    ("single", Way::Directions(Call::Single)),
    ("packets of directions", Way::Directions(Call::Packets(16))),
    ("coherent, directions", Way::Directions(Call::Coherent)),
    ("coherent, points", Way::Points),
];

/// Hours of direct sun of a year in steps of an hour.
pub fn sun(job: &mut Job, mesh: &Mesh, sensors: &Sensors) -> Outcome {
    let place = Place {
        latitude: 48.2,
        longitude: 16.4,
        height: 170.0,
    };
    // The year 2025 in UTC, in the middle of each hour.
    let times: Vec<f64> = (0..8760)
        .map(|hour| 1_735_689_600.0 + 3600.0 * (f64::from(hour) + 0.5))
        .collect();
    let (mut suns, mut hours_of_day) = (Vec::new(), Vec::new());
    for (hour, sun) in sun_positions(&place, Refraction::Standard, &times)?
        .iter()
        .enumerate()
    {
        if sun.elevation > 0.0 {
            let direction = Orientation::default().direction(sun.azimuth, sun.elevation);
            suns.push(direction.map(|x| x as f32));
            hours_of_day.push(hour % 24);
        }
    }
    let hours = vec![1.0; suns.len()];
    let Sensors { points, normals } = sensors;
    let programs = Programs {
        mesh,
        flags: SceneFlags::default(),
        ours: |bvh: &Bvh| {
            sun_hours(bvh, points, normals, &suns, &hours, &()).expect("lists of the same length")
        },
        ways: &WAYS,
        embree: |scene: &Scene, way, share| {
            let mut by_hour: Vec<u32> = (0..suns.len() as u32).collect();
            by_hour.sort_by_key(|&sun| hours_of_day[sun as usize]);
            let directions: Vec<_> = by_hour.iter().map(|&sun| suns[sun as usize]).collect();
            embree(scene, (mesh, sensors), &directions, (way, share), |_, _| {
                1.0
            })
        },
    };
    job.compare(programs, differing(|a: &f64, b| a != b))?;
    Ok(())
}

/// Sky view by the cosine.
pub fn sky(job: &mut Job, mesh: &Mesh, sensors: &Sensors, division: SkyDivision) -> Outcome {
    let patches = division.patches()?;
    let orientation = Orientation::default();
    let centres = patches.directions(&orientation);
    let Sensors { points, normals } = sensors;
    let programs = Programs {
        mesh,
        flags: SceneFlags::default(),
        ours: |bvh: &Bvh| {
            let sky = (&patches, &orientation);
            sky_view(bvh, points, normals, sky, Weighting::Cosine, &())
                .expect("lists of the same length")
        },
        ways: &WAYS,
        embree: |scene: &Scene, way, share| {
            let order = along_curve(&centres);
            let directions: Vec<_> = order.iter().map(|&patch| centres[patch as usize]).collect();
            let angles = order
                .iter()
                .map(|&patch| patches.solid_angles[patch as usize]);
            let angles: Vec<f64> = angles.collect();
            let cosines = directions.iter().map(|dir| f64::from(dir[2]));
            let all: f64 = cosines
                .zip(&angles)
                .map(|(cosine, angle)| cosine * angle)
                .sum();
            let weigh =
                |normal, patch: usize| angles[patch] * f64::from(dot(normal, directions[patch]));
            let sums = embree(scene, (mesh, sensors), &directions, (way, share), weigh);
            sums.into_iter().map(|sum| (sum / all) as f32).collect()
        },
    };
    // A patch is worth a thousandth or more, unless its cosine is small; sums in another order differ by less.
    job.compare(programs, differing(|a: &f32, b| (a - b).abs() > 2e-6))?;
    Ok(())
}

/// Embree's program: sums of the weights of the directions that each point sees. Directions are in good order.
fn embree(
    scene: &Scene,
    (mesh, sensors): (&Mesh, &Sensors),
    directions: &[[f32; 3]],
    (way, share): (Way, usize),
    weigh: impl Fn([f32; 3], usize) -> f64,
) -> Vec<f64> {
    let origins = sensors.lifted(origin_offset(mesh, &sensors.points));
    let order = along_curve(&origins);
    let mut sums = vec![0.0; origins.len()];
    let mut faced: Vec<u32> = Vec::new();
    for points in order[..order.len() / share].chunks(16) {
        match way {
            Way::Directions(call) => {
                for &point in points {
                    let (origin, normal) =
                        (origins[point as usize], sensors.normals[point as usize]);
                    faced.clear();
                    faced.extend(
                        (0..directions.len() as u32)
                            .filter(|&at| dot(normal, directions[at as usize]) > 0.0),
                    );
                    let direction = |index: usize| faced[index] as usize;
                    let mut sum = 0.0;
                    scene.occluded(
                        call,
                        faced.len(),
                        |index| Ray::new(origin, directions[direction(index)]),
                        |index, occluded| {
                            sum += if occluded {
                                0.0
                            } else {
                                weigh(normal, direction(index))
                            }
                        },
                    );
                    sums[point as usize] = sum;
                }
            }
            Way::Points => {
                for (index, &direction) in directions.iter().enumerate() {
                    let faces =
                        |lane: usize| dot(sensors.normals[points[lane] as usize], direction) > 0.0;
                    scene.occluded(
                        Call::Coherent,
                        points.len(),
                        |lane| Ray {
                            // Rays that are not wanted end before they begin.
                            tfar: if faces(lane) { f32::INFINITY } else { -1.0 },
                            ..Ray::new(origins[points[lane] as usize], direction)
                        },
                        |lane, occluded| {
                            if !occluded && faces(lane) {
                                let point = points[lane] as usize;
                                sums[point] += weigh(sensors.normals[point], index);
                            }
                        },
                    );
                }
            }
        }
    }
    sums
}
