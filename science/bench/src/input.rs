//! Rays of camera paths, points of surfaces, and orders of points.

use std::error::Error;

use antumbra::recipe::Engine;
use antumbra::{Aabb, Isa, Ray};
use antumbra_lab::collect_rays;
use antumbra_lab::harness::Mesh;
use antumbra_load::{Options, load};
use antumbra_render::World;

/// A scene as one mesh, and its rays by name: without end from surfaces, and to light samples.
pub struct Input {
    pub mesh: Mesh,
    pub rays: [(&'static str, Vec<Ray>); 2],
}

impl Input {
    /// Reads a scene that a file or a name of the program stands for, with so many rays of each kind.
    pub fn read(name: &str, count: usize) -> Result<Self, Box<dyn Error>> {
        let scene = load(name.as_ref(), &Options::default())?.scene;
        let world = World::new(&scene)?;
        let bvh = world.bvh(Engine::of(Isa::best()));
        let rays = collect_rays(&world, &bvh, count, 1);
        Ok(Self {
            mesh: Mesh::merged(&scene)?,
            rays: [("ao", rays.diffuse), ("shadow", rays.shadow)],
        })
    }
}

/// Points of surfaces with normals.
#[derive(Clone, Default)]
pub struct Sensors {
    pub points: Vec<[f32; 3]>,
    pub normals: Vec<[f32; 3]>,
}

impl Sensors {
    pub fn push(&mut self, point: [f32; 3], normal: [f32; 3]) {
        self.points.push(point);
        self.normals.push(normal);
    }

    /// Sensors of which this is true.
    pub fn only(&self, is_wanted: impl Fn(usize, [f32; 3]) -> bool) -> Self {
        let mut only = Self::default();
        for (index, (&point, &normal)) in self.points.iter().zip(&self.normals).enumerate() {
            if is_wanted(index, point) {
                only.push(point, normal);
            }
        }
        only
    }

    /// Points moved along their normals.
    pub fn lifted(&self, offset: f32) -> Vec<[f32; 3]> {
        let both = self.points.iter().zip(&self.normals);
        both.map(|(p, n)| [0, 1, 2].map(|axis| p[axis] + offset * n[axis]))
            .collect()
    }
}

/// Origin offset of a scene and of these points.
pub fn origin_offset(mesh: &Mesh, points: &[[f32; 3]]) -> f32 {
    Aabb::around(&mesh.positions)
        .union(&Aabb::around(points))
        .origin_offset()
}

/// Places of points along a Morton curve.
pub fn along_curve(points: &[[f32; 3]]) -> Vec<u32> {
    let bounds = Aabb::around(points);
    let side = (0..3).fold(f32::MIN_POSITIVE, |side, axis| {
        side.max(bounds.max[axis] - bounds.min[axis])
    });
    let key = |point: &[f32; 3]| {
        let cells = [0, 1, 2].map(|axis| ((point[axis] - bounds.min[axis]) / side * 1023.0) as u32);
        (0..30).fold(0u32, |key, bit| {
            key | (cells[bit % 3] >> (bit / 3) & 1) << bit
        })
    };
    let mut order: Vec<(u32, u32)> = (0..)
        .zip(points)
        .map(|(index, point)| (key(point), index))
        .collect();
    order.sort_unstable();
    order.into_iter().map(|(_, index)| index).collect()
}
