//! Meshes that measurements are about, and vectors.

use std::error::Error;

use antumbra::shapes::TriangleMesh;
use antumbra::{Bvh, Geometry, Recipe};
use antumbra_load::{Options, load};
use antumbra_render::Lowered;
use antumbra_scene::Scene;

/// Triangles that measurements are about.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Vertices.
    pub positions: Vec<[f32; 3]>,
    /// Three vertices per triangle.
    pub indices: Vec<[u32; 3]>,
}

impl Mesh {
    /// The triangles of the world of a model.
    pub fn of(model: &Lowered) -> Self {
        let mut mesh = Self::default();
        for geometry in &model.world {
            if let Geometry::Triangles(part) = geometry {
                mesh.push(&part.positions, &part.indices);
            }
        }
        mesh
    }

    /// All meshes of a scene as one.
    ///
    /// # Errors
    /// The scene cannot be flattened.
    pub fn merged(scene: &Scene) -> Result<Self, Box<dyn Error>> {
        let mut mesh = Self::default();
        for shape in &scene.flattened()?.shapes {
            if let antumbra_scene::Geometry::Mesh(part) = &shape.geometry {
                mesh.push(&part.positions, &part.indices);
            }
        }
        Ok(mesh)
    }

    fn push(&mut self, positions: &[[f32; 3]], indices: &[[u32; 3]]) {
        let first = self.positions.len() as u32;
        self.positions.extend_from_slice(positions);
        let moved = |corners: &[u32; 3]| corners.map(|index| first + index);
        self.indices.extend(indices.iter().map(moved));
    }

    /// Reads a scene as one mesh, without its lights: one in the sky would be nearest to most points of its bounds.
    ///
    /// # Errors
    /// There is no such scene, there are mistakes in it, or it cannot be flattened.
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
        Geometry::Triangles(self.triangles())
    }

    /// The mesh as the kernel has it.
    pub fn triangles(&self) -> TriangleMesh<'_> {
        TriangleMesh::new(&self.positions[..], &self.indices[..])
    }

    /// Corners of a triangle.
    pub fn corners(&self, triangle: usize) -> [[f32; 3]; 3] {
        self.indices[triangle].map(|vertex| self.positions[vertex as usize])
    }

    /// The mesh for scenes of Embree.
    pub fn model(&self) -> Lowered<'_> {
        model(self.geometry())
    }

    /// Our tree, by default.
    ///
    /// # Panics
    /// A vertex is not finite.
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

/// Scalar product.
pub fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Difference of two vectors.
pub fn less(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|axis| a[axis] - b[axis])
}

/// Cross product.
pub fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|axis| {
        let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
        a[next] * b[last] - a[last] * b[next]
    })
}

/// A vector of length 1 in the same direction.
pub fn unit(a: [f32; 3]) -> [f32; 3] {
    let length = dot(a, a).sqrt();
    a.map(|x| x / length)
}
