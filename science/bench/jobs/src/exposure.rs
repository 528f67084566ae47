//! Sun hours and sky view: many points, the same directions.

use antumbra::{Bvh, Ray};
use antumbra_bake::{
    Orientation, Place, Refraction, SkyDivision, Weighting, sky_view, sun_hours, sun_positions,
};

use crate::Outcome;
use crate::compare::{Ways, compare};
use crate::input::{Mesh, Sensors, along_curve, dot, origin_offset};
use crate::rtc::{Call, Rtc};

/// What a packet of Embree holds.
#[derive(Clone, Copy)]
enum Way {
    /// Directions of one point.
    Directions(Call),
    /// One direction of 16 points.
    Points,
}

const WAYS: &Ways<Way> = &[
    ("single", Way::Directions(Call::Single)),
    ("packets of directions", Way::Directions(Call::Packets)),
    ("coherent, directions", Way::Directions(Call::Coherent)),
    ("coherent, points", Way::Points),
];

/// Hours of direct sun of a year in steps of an hour.
pub fn sun(rtc: &Rtc, mesh: &Mesh, sensors: &Sensors) -> Outcome {
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
    let ours = |bvh: &Bvh| {
        let Sensors { points, normals } = sensors;
        sun_hours(bvh, points, normals, &suns, &hours, &()).expect("lists of the same length")
    };
    let embree = |way, share| {
        let mut by_hour: Vec<u32> = (0..suns.len() as u32).collect();
        by_hour.sort_by_key(|&sun| hours_of_day[sun as usize]);
        let directions: Vec<[f32; 3]> = by_hour.iter().map(|&sun| suns[sun as usize]).collect();
        embree(rtc, mesh, sensors, &directions, way, share, |_, _| 1.0)
    };
    let compared = compare(rtc, mesh, ours, WAYS, embree);
    let differ = compared
        .ours
        .iter()
        .zip(&compared.embree)
        .filter(|(a, b)| a != b)
        .count();
    Ok(compared.row(rays(sensors, &suns), sensors.points.len(), differ))
}

/// Sky view by the cosine.
pub fn sky(rtc: &Rtc, mesh: &Mesh, sensors: &Sensors, division: SkyDivision) -> Outcome {
    let patches = division.patches()?;
    let orientation = Orientation::default();
    let centres = patches.directions(&orientation);
    let ours = |bvh: &Bvh| {
        let Sensors { points, normals } = sensors;
        let sky = (&patches, &orientation);
        sky_view(bvh, points, normals, sky, Weighting::Cosine, &())
            .expect("lists of the same length")
    };
    let embree = |way, share| {
        let order = along_curve(&centres);
        let directions: Vec<[f32; 3]> =
            order.iter().map(|&patch| centres[patch as usize]).collect();
        let angles: Vec<f64> = order
            .iter()
            .map(|&patch| patches.solid_angles[patch as usize])
            .collect();
        let all: f64 = directions
            .iter()
            .zip(&angles)
            .map(|(dir, angle)| f64::from(dir[2]) * angle)
            .sum();
        let weigh =
            |normal, patch: usize| angles[patch] * f64::from(dot(normal, directions[patch]));
        let sums = embree(rtc, mesh, sensors, &directions, way, share, weigh);
        sums.into_iter().map(|sum| (sum / all) as f32).collect()
    };
    let compared = compare(rtc, mesh, ours, WAYS, embree);
    // A patch is worth a thousandth or more, unless its cosine is small; sums in another order differ by less.
    let differ = compared
        .ours
        .iter()
        .zip(&compared.embree)
        .filter(|(a, b)| (*a - *b).abs() > 2e-6)
        .count();
    Ok(compared.row(rays(sensors, &centres), sensors.points.len(), differ))
}

/// Number of directions above the surfaces of all points.
fn rays(sensors: &Sensors, directions: &[[f32; 3]]) -> u64 {
    let faced = |normal: &[f32; 3]| {
        directions
            .iter()
            .filter(|dir| dot(*normal, **dir) > 0.0)
            .count() as u64
    };
    sensors.normals.iter().map(faced).sum()
}

/// Embree's program: sums of the weights of the directions that each point sees. Directions are in good order.
fn embree(
    rtc: &Rtc,
    mesh: &Mesh,
    sensors: &Sensors,
    directions: &[[f32; 3]],
    way: Way,
    share: usize,
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
                    rtc.occluded(
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
                    rtc.occluded(
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
