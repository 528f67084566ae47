//! Meshes, points of surfaces, and orders of points.

use std::path::Path;

use antumbra::Aabb;
use antumbra_load::{Options, load};
use antumbra_scene::Geometry;

/// Triangles of a scene.
#[derive(Default)]
pub struct Mesh {
    pub positions: Vec<[f32; 3]>,
    pub indices: Vec<[u32; 3]>,
}

impl Mesh {
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
}

/// Reads a scene of the shared folder as one mesh, without its lights.
pub fn read(name: &str) -> Result<Mesh, Box<dyn std::error::Error>> {
    let folder = std::env::var("ANTUMBRA_SCENES").unwrap_or_default();
    let path = Path::new(&folder).join(name);
    if !path.exists() {
        return Err("no shared scenes".into());
    }
    let scene = load(&path, &Options::default())?.scene;
    let mut mesh = Mesh::default();
    for shape in &scene.flattened()?.shapes {
        if let (Geometry::Mesh(part), None) = (&shape.geometry, &shape.area_light) {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend_from_slice(&part.positions);
            let moved = part
                .indices
                .iter()
                .map(|corners| corners.map(|index| first + index));
            mesh.indices.extend(moved);
        }
    }
    Ok(mesh)
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

    /// Sensors in a square around the origin, so wide to each side.
    pub fn inside(&self, half: f32) -> Self {
        let mut inside = Self::default();
        for (&point, &normal) in self.points.iter().zip(&self.normals) {
            if point[0].abs() < half && point[1].abs() < half {
                inside.push(point, normal);
            }
        }
        inside
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
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

pub fn unit(a: [f32; 3]) -> [f32; 3] {
    let length = dot(a, a).sqrt();
    a.map(|x| x / length)
}

/// Numbers that look random: the output function of SplitMix64.
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// From 0 to less than 1.
    pub fn next(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1 << 24) as f32
    }
}
