//! Rays aimed where it hurts.

use crate::mesh::Mesh;
use crate::rng::Rng;

/// A ray as plain numbers: origin, direction, and the open interval of `t`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TestRay {
    /// Origin.
    pub org: [f32; 3],
    /// Direction.
    pub dir: [f32; 3],
    /// Lower end.
    pub tnear: f32,
    /// Upper end.
    pub tfar: f32,
}

/// Rays for a mesh: random ones, rays at vertices and edges, along axes, from far away, between
/// vertices, with short intervals, and every twentieth one no proper ray at all.
pub fn around(rng: &mut Rng, mesh: &Mesh, count: usize) -> Vec<TestRay> {
    let reach = reach(mesh);
    (0..count).map(|_| one(rng, mesh, reach)).collect()
}

/// The largest coordinate, or 1.
fn reach(mesh: &Mesh) -> f32 {
    let reach = mesh
        .positions
        .iter()
        .flatten()
        .filter(|x| x.is_finite())
        .fold(0f32, |reach, x| reach.max(x.abs()));
    if reach > 0.0 { reach } else { 1.0 }
}

/// Rays for a mesh in bundles that go nearly the same way: from a point, to a point, or side by side; wide and
/// narrow ones of up to 40 rays, here and there with a ray that goes elsewhere or is no proper ray.
pub fn bundles(rng: &mut Rng, mesh: &Mesh, count: usize) -> Vec<TestRay> {
    let reach = reach(mesh);
    let mut rays = Vec::new();
    while rays.len() < count {
        let first = one(rng, mesh, reach);
        let (kind, strays) = (rng.below(3), rng.below(2) == 0);
        let spread = 10f32.powf(rng.range(-5.0, -0.5));
        let length = first.dir.iter().fold(0f32, |most, x| most.max(x.abs()));
        for _ in 0..1 + rng.below(40) {
            if strays && rng.below(8) == 0 {
                rays.push(one(rng, mesh, reach));
                continue;
            }
            let mut ray = first;
            let aside = rng.point(1.0);
            for axis in 0..3 {
                let (moved, turned) = match kind {
                    // In the distance of one direction all of these meet again.
                    0 => (0.0, spread * length),
                    1 => (spread * length, -spread * length),
                    _ => (spread * reach, 0.0),
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

fn one(rng: &mut Rng, mesh: &Mesh, reach: f32) -> TestRay {
    let anywhere = |rng: &mut Rng| rng.point(1.5).map(|x| x * reach);
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
            let org = core::array::from_fn(|axis| target[axis] - 2.0 * reach * dir[axis]);
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

/// A vertex, a point on an edge or a point inside of some triangle.
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
