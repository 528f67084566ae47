//! Meshes of a scene as one: vertices, normals and triangles in world space.

use std::path::Path;

use antumbra::{Builder, Bvh, Isa, Width};
use antumbra_bake::vertex_normals;
use antumbra_load::{Loaded, MemorySize};
use antumbra_render::World;
use antumbra_scene::{Geometry, Scene, Shape, TriangleMesh};

use crate::exit::{Failure, tell};
use crate::output::Files;
use crate::{interrupt, scenes};

/// A scene that was read for a bake, with its tree.
pub struct Ground {
    pub loaded: Loaded,
    pub world: World,
    pub bvh: Bvh,
    pub vertices: Vertices,
    pub build_seconds: f64,
}

impl Ground {
    /// Reads a scene and builds its tree.
    pub fn load(
        name: &Path,
        isa: Isa,
        memory: MemorySize,
        files: &mut Files,
    ) -> Result<Self, Failure> {
        let mut loaded = scenes::load(name, memory)?;
        files.reads_all(&loaded.inputs)?;
        let flat = loaded.scene.flattened();
        let flat = flat.map_err(|error| Failure::scene(&loaded.scene.name, error))?;
        loaded.scene = flat.into_owned();
        let vertices = Vertices::of(&loaded.scene)?;
        interrupt::check()?;
        let start = std::time::Instant::now();
        let world = scenes::world(&loaded.scene, Builder::default())?;
        let bvh = world.bvh(Width::auto(isa.level()), isa);
        Ok(Self {
            loaded,
            world,
            bvh,
            vertices,
            build_seconds: start.elapsed().as_secs_f64(),
        })
    }
}

/// Vertices and triangles of all meshes of a scene, in world space.
#[derive(Default)]
pub struct Vertices {
    pub positions: Vec<[f32; 3]>,
    pub normals: Vec<[f32; 3]>,
    pub indices: Vec<[u32; 3]>,
    /// Texture coordinates, NaN where a mesh has none.
    pub uvs: Vec<[f32; 2]>,
}

impl Vertices {
    /// Vertices of a scene without instances.
    ///
    /// # Errors
    /// The scene has no mesh, or more vertices than a PLY file can hold.
    pub fn of(scene: &Scene) -> Result<Self, Failure> {
        let mut all = Self::default();
        let mut spheres = 0;
        for shape in &scene.shapes {
            match &shape.geometry {
                Geometry::Mesh(mesh) => all.push(shape, mesh),
                Geometry::Sphere(_) => spheres += 1,
            }
        }
        // Indices of PLY files are signed.
        if all.positions.len() > i32::MAX as usize {
            let reason = "it has more vertices than a PLY file can hold";
            return Err(Failure::scene(&scene.name, reason));
        }
        if all.positions.is_empty() {
            return Err(Failure::scene(
                &scene.name,
                "it has no mesh, so no vertices",
            ));
        }
        if spheres > 0 {
            tell(format_args!(
                "note: {spheres} spheres occlude, but have no vertices to write"
            ));
        }
        Ok(all)
    }

    /// Adds the mesh of a shape, with its normals turned as the shape says.
    fn push(&mut self, shape: &Shape, mesh: &TriangleMesh) {
        let first = self.positions.len() as u32;
        let own = !mesh.normals.is_empty();
        let turned = shape.reverse_orientation != (!own && shape.transform_swaps_handedness);
        let sign = if turned { -1.0 } else { 1.0 };
        let normals = match own {
            true => mesh
                .normals
                .iter()
                .map(|normal| normal.to_array())
                .collect(),
            false => vertex_normals(&mesh.positions, &mesh.indices),
        };
        let normals = normals.into_iter();
        self.normals
            .extend(normals.map(|normal: [f32; 3]| normal.map(|x| sign * x)));
        self.positions.extend(&mesh.positions);
        self.uvs.extend(mesh.uvs.iter().map(|uv| uv.to_array()));
        self.uvs.resize(self.positions.len(), [f32::NAN; 2]);
        // More vertices than numbers are refused later.
        let moved = |corner: u32| corner.wrapping_add(first);
        self.indices
            .extend(mesh.indices.iter().map(|corners| corners.map(moved)));
    }
}
