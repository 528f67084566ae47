//! Meshes, rays of camera paths, points of surfaces, and orders of points.

use std::error::Error;

use antumbra::recipe::Engine;
use antumbra::{Aabb, Bvh, Geometry, Isa, Ray, Recipe};
use antumbra_lab::collect_rays;
use antumbra_load::{Options, load};
use antumbra_render::{Lowered, World};
use antumbra_scene::Scene;

/// Triangles of a scene.
#[derive(Clone, Default)]
pub struct Mesh {
    pub positions: Vec<[f32; 3]>,
    pub indices: Vec<[u32; 3]>,
}

impl Mesh {
    /// All meshes of a scene as one.
    fn merged(scene: &Scene) -> Result<Self, Box<dyn Error>> {
        let mut mesh = Self::default();
        for shape in &scene.flattened()?.shapes {
            if let antumbra_scene::Geometry::Mesh(part) = &shape.geometry {
                let first = mesh.positions.len() as u32;
                mesh.positions.extend_from_slice(&part.positions);
                let corners = part.indices.iter();
                mesh.indices
                    .extend(corners.map(|corners| corners.map(|index| first + index)));
            }
        }
        Ok(mesh)
    }

    /// Reads a scene as one mesh, without its lights: one in the sky would be nearest to most points of its bounds.
    pub fn read(name: &str) -> Result<Self, Box<dyn Error>> {
        let mut scene = load(name.as_ref(), &Options::default())?.scene;
        scene.shapes.retain(|shape| shape.area_light.is_none());
        Self::merged(&scene)
    }

    /// The first triangles, with vertices of their own.
    pub fn first(&self, count: usize) -> Self {
        let mut part = Self::default();
        let mut places = std::collections::HashMap::new();
        for triangle in &self.indices[..count] {
            part.indices.push(triangle.map(|index| {
                *places.entry(index).or_insert_with(|| {
                    part.positions.push(self.positions[index as usize]);
                    part.positions.len() as u32 - 1
                })
            }));
        }
        part
    }

    /// Adds a grid of triangles over a height field, with a vertex for each of `columns` x `rows` places.
    pub fn push_field(&mut self, columns: u32, rows: u32, place: impl Fn(u32, u32) -> [f32; 3]) {
        let first = self.positions.len() as u32;
        for row in 0..rows {
            self.positions
                .extend((0..columns).map(|column| place(column, row)));
        }
        for row in 0..rows - 1 {
            for column in 0..columns - 1 {
                let a = first + row * columns + column;
                let (b, c, d) = (a + 1, a + 1 + columns, a + columns);
                self.indices.extend([[a, b, c], [a, c, d]]);
            }
        }
    }

    /// Adds a rectangle.
    pub fn push_quad(&mut self, corners: [[f32; 3]; 4]) {
        let first = self.positions.len() as u32;
        self.positions.extend(corners);
        self.indices.push([first, first + 1, first + 2]);
        self.indices.push([first, first + 2, first + 3]);
    }

    /// The mesh for trees.
    pub fn geometry(&self) -> Geometry<'_> {
        Geometry::triangles(&self.positions[..], &self.indices[..])
    }

    /// The mesh for scenes of Embree.
    pub fn model(&self) -> Lowered<'_> {
        model(self.geometry())
    }

    /// Our tree, by default.
    pub fn tree(&self) -> Bvh {
        Bvh::build(&[self.geometry()], &Recipe::default()).expect("a mesh of finite triangles")
    }
}

/// A model of one geometry.
pub fn model(geometry: Geometry<'_>) -> Lowered<'_> {
    Lowered {
        world: vec![geometry],
        ..Lowered::default()
    }
}

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

pub fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub fn less(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|axis| a[axis] - b[axis])
}

pub fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|axis| {
        let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
        a[next] * b[last] - a[last] * b[next]
    })
}

pub fn unit(a: [f32; 3]) -> [f32; 3] {
    let length = dot(a, a).sqrt();
    a.map(|x| x / length)
}
