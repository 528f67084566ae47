//! Coloured shadows: light of suns through leaves, each of which tints it.

use antumbra::{Bvh, Hit, Ray, Visit};
use antumbra_lab::embree::{Call, Scene, SceneFlags};
use antumbra_lab::harness::{Mesh, cross, unit};
use antumbra_testkit::Rng;

use super::{Job, Programs, differing};
use crate::Outcome;

/// Leaves in a volume of 100 x 100 x 20 metres, each 0.4 metres wide.
const LEAVES: usize = 200_000;
const SUNS: usize = 12;

#[derive(Clone, Copy)]
enum Way {
    /// An occlusion filter that lets rays through.
    Filter(Call),
    /// Closest hits, each behind the one before.
    Restart,
}

const WAYS: [(&str, Way); 4] = [
    ("filter, single", Way::Filter(Call::Single)),
    ("filter, packets", Way::Filter(Call::Packets(16))),
    ("filter, coherent packets", Way::Filter(Call::Coherent)),
    ("rtcIntersect1, restarted", Way::Restart),
];

/// So many points of the ground to a side.
pub fn run(job: &mut Job, side: usize) -> Outcome {
    let (mesh, tints) = leaves();
    let points: Vec<[f32; 3]> = (0..side * side)
        .map(|index| {
            [index % side, index / side].map(|place| 100.0 * (place as f32 + 0.5) / side as f32)
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
    type Trace<'a> = &'a dyn Fn(&[Ray], &mut [[f32; 3]]);
    let tinted = |trace: Trace| {
        let mut lights = vec![[1.0f32; 3]; points.len() * suns.len()];
        for (&sun, lights) in suns.iter().zip(lights.chunks_mut(points.len())) {
            trace(&rays(sun), lights);
        }
        lights
    };
    let tint = |light: &mut [f32; 3], triangle: u32| multiply(light, tints[triangle as usize / 2]);
    let programs = Programs {
        mesh: &mesh,
        flags: SceneFlags::FILTER_IN_ARGUMENTS,
        ours: |bvh: &Bvh| {
            let visit = |light: &mut [f32; 3], hit: Hit| {
                tint(light, hit.prim_id);
                Visit::Reject
            };
            tinted(&|rays, lights| bvh.batch(rays).on_this_thread().visit_hits(lights, visit))
        },
        ways: &WAYS,
        embree: |scene: &Scene, way, share| {
            tinted(&|rays, lights| {
                let (rays, lights) = (
                    &rays[..rays.len() / share],
                    &mut lights[..rays.len() / share],
                );
                match way {
                    Way::Filter(call) => scene.visit_hits(call, rays, lights, &tint),
                    Way::Restart => {
                        for (ray, light) in rays.iter().zip(lights) {
                            restart(scene, *ray, |triangle| tint(light, triangle));
                        }
                    }
                }
            })
        },
    };
    let apart = |a: &[f32; 3], b: &[f32; 3]| {
        (0..3).any(|colour| (a[colour] - b[colour]).abs() > 1e-4 * a[colour])
    };
    job.compare(programs, differing(apart))?;
    Ok(())
}

fn multiply(light: &mut [f32; 3], tint: [f32; 3]) {
    for (light, tint) in light.iter_mut().zip(tint) {
        *light *= tint;
    }
}

/// Follows a ray from hit to hit.
fn restart(scene: &Scene, ray: Ray, mut tint: impl FnMut(u32)) {
    /// Rounding may find a hit again behind the next number.
    const STEP: f32 = 1.000_001;
    let (mut ray, mut last) = (ray, u32::MAX);
    while ray.tnear < f32::INFINITY {
        let mut hit = (f32::INFINITY, u32::MAX);
        scene.intersect(Call::Single, 1, |_| ray, |_, found| hit = found);
        let (t, triangle) = hit;
        if t < f32::INFINITY && triangle != last {
            tint(triangle);
        }
        last = triangle;
        ray.tnear = STEP * t.max(ray.tnear);
    }
}

/// Leaves anywhere in the volume, turned any way, with a tint for each.
fn leaves() -> (Mesh, Vec<[f32; 3]>) {
    let mut rng = Rng::new(5);
    let (mut mesh, mut tints) = (Mesh::default(), Vec::new());
    for _ in 0..LEAVES {
        let middle = [100.0, 100.0, 20.0].map(|size| size * rng.unit());
        let middle = [middle[0], middle[1], middle[2] + 2.0];
        let mut direction = || unit([(); 3].map(|()| rng.unit() - 0.5));
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
        tints.push([(); 3].map(|()| 0.5 + 0.5 * rng.unit()));
    }
    (mesh, tints)
}
