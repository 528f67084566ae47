//! Scenes as one mesh, with rays of their camera paths.

use antumbra::recipe::Engine;
use antumbra::{Isa, Ray};
use antumbra_lab::collect_rays;
use antumbra_load::{Options, load};
use antumbra_render::World;
use antumbra_scene::{Geometry, Scene};

/// Rays of each kind.
const RAYS: usize = 1 << 16;

/// Triangles of a scene.
#[derive(Default)]
pub struct Mesh {
    pub positions: Vec<[f32; 3]>,
    pub indices: Vec<[u32; 3]>,
}

impl Mesh {
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
}

/// A scene and its rays.
pub struct Input {
    pub mesh: Mesh,
    /// Rays without end from surfaces.
    pub ao: Vec<Ray>,
    /// Rays to light samples.
    pub shadow: Vec<Ray>,
}

/// Reads a scene that a file or a name of the program stands for.
pub fn read(name: &str) -> Result<Input, Box<dyn std::error::Error>> {
    let scene = load(name.as_ref(), &Options::default())?.scene;
    let world = World::new(&scene)?;
    let isa = Isa::best();
    let bvh = world.bvh(Engine::of(isa));
    let rays = collect_rays(&world, &bvh, RAYS, 1);
    Ok(Input {
        mesh: merged(&scene)?,
        ao: rays.diffuse,
        shadow: rays.shadow,
    })
}

/// Reads the mesh of a scene alone, without lights: one in the sky would be nearest to most points of its bounds.
pub fn read_mesh(name: &str) -> Result<Mesh, Box<dyn std::error::Error>> {
    let mut scene = load(name.as_ref(), &Options::default())?.scene;
    scene.shapes.retain(|shape| shape.area_light.is_none());
    merged(&scene)
}

fn merged(scene: &Scene) -> Result<Mesh, Box<dyn std::error::Error>> {
    let mut mesh = Mesh::default();
    for shape in &scene.flattened()?.shapes {
        if let Geometry::Mesh(part) = &shape.geometry {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend_from_slice(&part.positions);
            let moved = part
                .indices
                .iter()
                .map(|triangle| triangle.map(|index| first + index));
            mesh.indices.extend(moved);
        }
    }
    Ok(mesh)
}
