//! Coloured shadows: light of suns through leaves, each of which tints it.

use antumbra::{Bvh, Hit, Ray, Visit};

use crate::Outcome;
use crate::compare::{Ways, compare};
use crate::input::{Mesh, Random, cross, unit};
use crate::rtc::{Call, Rtc};

/// Leaves in a volume of 100 x 100 x 20 metres, each 0.4 metres wide.
const LEAVES: usize = 200_000;
/// Points of the ground, to a side.
const SIDE: usize = 320;
const SUNS: usize = 12;

#[derive(Clone, Copy)]
enum Way {
    /// An occlusion filter that lets rays through.
    Filter(Call),
    /// Closest hits, each behind the one before.
    Restart,
}

const WAYS: &Ways<Way> = &[
    ("filter, single", Way::Filter(Call::Single)),
    ("filter, packets", Way::Filter(Call::Packets)),
    ("filter, coherent packets", Way::Filter(Call::Coherent)),
    ("rtcIntersect1, restarted", Way::Restart),
];

pub fn run(rtc: &Rtc) -> Outcome {
    let (mesh, tints) = leaves();
    let points: Vec<[f32; 3]> = (0..SIDE * SIDE)
        .map(|index| {
            [index % SIDE, index / SIDE].map(|place| 100.0 * (place as f32 + 0.5) / SIDE as f32)
        })
        .map(|[x, y]| [x, y, 0.0])
        .collect();
    let suns: Vec<[f32; 3]> = (0..SUNS)
        .map(|hour| {
            let (sin, cos) =
                (std::f32::consts::PI * (hour as f32 + 2.0) / (SUNS + 3) as f32).sin_cos();
            [cos, -0.6 * sin, 0.8 * sin]
        })
        .collect();
    let rays =
        |sun: [f32; 3]| -> Vec<Ray> { points.iter().map(|&point| Ray::new(point, sun)).collect() };
    let ours = |bvh: &Bvh| {
        let mut lights = vec![[1.0f32; 3]; points.len() * suns.len()];
        for (&sun, lights) in suns.iter().zip(lights.chunks_mut(points.len())) {
            let visit = |light: &mut [f32; 3], hit: Hit| {
                multiply(light, tints[hit.prim_id as usize / 2]);
                Visit::Reject
            };
            bvh.batch(&rays(sun))
                .on_this_thread()
                .visit_hits(lights, visit);
        }
        lights
    };
    let embree = |way, share: usize| {
        let mut lights = vec![[1.0f32; 3]; points.len() * suns.len()];
        for (&sun, lights) in suns.iter().zip(lights.chunks_mut(points.len())) {
            let rays = &rays(sun)[..points.len() / share];
            match way {
                Way::Filter(call) => rtc.tinted(call, rays, &tints, lights),
                Way::Restart => rays
                    .iter()
                    .zip(lights)
                    .for_each(|(ray, light)| restart(rtc, *ray, &tints, light)),
            }
        }
        lights
    };
    rtc.set_filters(true);
    let compared = compare(rtc, &mesh, ours, WAYS, embree);
    rtc.set_filters(false);
    let both = compared.ours.iter().zip(&compared.embree);
    let apart = |a: &[f32; 3], b: &[f32; 3]| {
        (0..3).any(|colour| (a[colour] - b[colour]).abs() > 1e-4 * a[colour])
    };
    let differ = both.filter(|(a, b)| apart(a, b)).count();
    let count = compared.ours.len();
    Ok(compared.row(count as u64, count, differ))
}

fn multiply(light: &mut [f32; 3], tint: [f32; 3]) {
    for (light, tint) in light.iter_mut().zip(tint) {
        *light *= tint;
    }
}

/// Follows a ray from hit to hit.
fn restart(rtc: &Rtc, ray: Ray, tints: &[[f32; 3]], light: &mut [f32; 3]) {
    /// Rounding may find a hit again behind the next number.
    const STEP: f32 = 1.000_001;
    let (mut ray, mut last) = (ray, u32::MAX);
    while ray.tnear < f32::INFINITY {
        let mut hit = (f32::INFINITY, u32::MAX);
        rtc.intersect(
            Call::Single,
            1,
            |_| ray,
            |_, t, triangle| hit = (t, triangle),
        );
        let (t, triangle) = hit;
        if t < f32::INFINITY && triangle != last {
            multiply(light, tints[triangle as usize / 2]);
        }
        last = triangle;
        ray.tnear = STEP * t.max(ray.tnear);
    }
}

/// Leaves anywhere in the volume, turned any way, with a tint for each.
fn leaves() -> (Mesh, Vec<[f32; 3]>) {
    let mut random = Random(5);
    let (mut mesh, mut tints) = (Mesh::default(), Vec::new());
    for _ in 0..LEAVES {
        let middle = [100.0, 100.0, 20.0].map(|size| size * random.next());
        let middle = [middle[0], middle[1], middle[2] + 2.0];
        let mut direction = || unit([(); 3].map(|()| random.next() - 0.5));
        let normal = direction();
        let right = unit(cross(normal, direction()));
        let up = cross(normal, right);
        let corner =
            |s: f32, t: f32| [0, 1, 2].map(|axis| middle[axis] + s * right[axis] + t * up[axis]);
        mesh.push_quad([
            corner(-0.2, -0.2),
            corner(0.2, -0.2),
            corner(0.2, 0.2),
            corner(-0.2, 0.2),
        ]);
        tints.push([(); 3].map(|()| 0.5 + 0.5 * random.next()));
    }
    (mesh, tints)
}
