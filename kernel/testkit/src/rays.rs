//! Rays for a mesh that hit its special cases.

use crate::mesh::Mesh;
use crate::rng::Rng;

/// Ray as plain numbers: origin, direction, and the open interval of `t`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TestRay {
    /// Origin.
    pub org: [f32; 3],
    /// Direction.
    pub dir: [f32; 3],
    /// Lower end of the interval, in multiples of the direction's length.
    pub tnear: f32,
    /// Upper end of the interval, in multiples of the direction's length.
    pub tfar: f32,
}

/// Rays of many kinds for a mesh.
///
/// Some are random. Others aim at vertices and edges, run along axes, come from far away, or lead from one vertex to
/// another. Some have short intervals. About one in twenty is invalid, with NaN, an infinity or no direction.
pub fn around(rng: &mut Rng, mesh: &Mesh, count: usize) -> Vec<TestRay> {
    let extent = extent(mesh);
    (0..count).map(|_| one(rng, mesh, extent)).collect()
}

/// Scene extent: the largest absolute coordinate that is finite, or 1 if there is none above 0.
fn extent(mesh: &Mesh) -> f32 {
    let extent = mesh
        .positions
        .iter()
        .flatten()
        .filter(|x| x.is_finite())
        .fold(0f32, |extent, x| extent.max(x.abs()));
    if extent > 0.0 { extent } else { 1.0 }
}

/// Rays for a mesh in bundles of up to 40 similar rays.
///
/// Rays of a bundle leave one point, end in one point, or run side by side, with a narrow or wide spread. Some bundles
/// contain unrelated or invalid rays.
pub fn bundles(rng: &mut Rng, mesh: &Mesh, count: usize) -> Vec<TestRay> {
    let extent = extent(mesh);
    let mut rays = Vec::new();
    while rays.len() < count {
        let first = one(rng, mesh, extent);
        let (kind, strays) = (rng.below(3), rng.below(2) == 0);
        let spread = 10f32.powf(rng.range(-5.0, -0.5));
        let length = first.dir.iter().fold(0f32, |most, x| most.max(x.abs()));
        for _ in 0..1 + rng.below(40) {
            if strays && rng.below(8) == 0 {
                rays.push(one(rng, mesh, extent));
                continue;
            }
            let mut ray = first;
            let aside = rng.point(1.0);
            for axis in 0..3 {
                let (moved, turned) = match kind {
                    // The rays meet again after one length of the direction.
                    0 => (0.0, spread * length),
                    1 => (spread * length, -spread * length),
                    _ => (spread * extent, 0.0),
                };
                ray.org[axis] += moved * aside[axis];
                ray.dir[axis] += turned * aside[axis];
            }
            rays.push(ray);
        }
    }
    rays.truncate(count);
    rays
}

fn one(rng: &mut Rng, mesh: &Mesh, extent: f32) -> TestRay {
    let anywhere = |rng: &mut Rng| rng.point(1.5).map(|x| x * extent);
    let target = target(rng, mesh).unwrap_or_else(|| anywhere(rng));
    let towards = |from: [f32; 3], to: [f32; 3]| core::array::from_fn(|axis| to[axis] - from[axis]);
    let (org, mut dir) = match rng.below(8) {
        0 => (anywhere(rng), rng.direction()),
        1..4 => {
            let org = anywhere(rng);
            (org, towards(org, target))
        }
        // From the middle of the geometry outwards.
        4 => (target, rng.direction()),
        // Along an axis, through the target.
        5 => {
            let mut dir = [0.0, -0.0, 0.0];
            dir[rng.below(3)] = if rng.below(2) == 0 { 1.0 } else { -1.0 };
            let org = core::array::from_fn(|axis| target[axis] - 2.0 * extent * dir[axis]);
            (org, dir)
        }
        // From far outside.
        6 => {
            let org = anywhere(rng).map(|x| x * 300.0);
            (org, towards(org, target))
        }
        // From one point of the geometry to another.
        _ => {
            let org = self::target(rng, mesh).unwrap_or(target);
            (org, towards(org, target))
        }
    };
    if rng.below(4) == 0 {
        let scale = 10f32.powf(rng.range(-3.0, 3.0));
        dir = dir.map(|x| x * scale);
    }
    let (tnear, tfar) = match rng.below(6) {
        0 => (0.0, 1.0),
        1 => (1e-3, 0.999),
        2 => (rng.range(-2.0, 1.0), rng.range(0.0, 3.0)),
        _ => (0.0, f32::INFINITY),
    };
    let mut ray = TestRay {
        org,
        dir,
        tnear,
        tfar,
    };
    if rng.below(20) == 0 {
        let nasty = [
            f32::NAN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            0.0,
            f32::MAX,
            1e-45,
        ][rng.below(6)];
        match rng.below(5) {
            0 => ray.org[rng.below(3)] = nasty,
            1 => ray.dir[rng.below(3)] = nasty,
            2 => ray.dir = [0.0, -0.0, nasty],
            3 => ray.tnear = nasty,
            _ => ray.tfar = nasty,
        }
    }
    ray
}

/// Vertex, point on an edge or inner point of a random triangle; `None` for a mesh without triangles.
fn target(rng: &mut Rng, mesh: &Mesh) -> Option<[f32; 3]> {
    if mesh.indices.is_empty() {
        return None;
    }
    let [a, b, c] = mesh.triangle(rng.below(mesh.indices.len()));
    let mix = |a: [f32; 3], b: [f32; 3], share: f32| {
        core::array::from_fn(|axis| a[axis] + (b[axis] - a[axis]) * share)
    };
    Some(match rng.below(4) {
        0 => a,
        1 => mix(b, c, 0.5),
        2 => mix(a, b, rng.unit()),
        _ => mix(mix(a, b, rng.unit()), c, rng.unit()),
    })
}
