//! Fingerprints of scenes: whether two are the same without keeping both.

use std::fmt::{self, Write};

use antumbra_scene::{Geometry, Scene};
use xxhash_rust::xxh3::Xxh3;

/// 16 hexadecimal digits that differ between scenes, of everything that a picture depends on except the
/// pixels of textures, of which it has the names and sizes.
pub fn of_scene(scene: &Scene) -> String {
    let mut hasher = Hasher(Xxh3::new());
    for shape in scene.stored_shapes() {
        hasher.say(&(shape.material, &shape.area_light));
        match &shape.geometry {
            Geometry::Sphere(sphere) => hasher.say(sphere),
            Geometry::Curves(curves) => {
                hasher.say(&(curves.points.len(), curves.profile));
                hasher.numbers(curves.points.iter().flatten().map(|x| x.to_bits()));
                hasher.numbers(curves.first.iter().copied());
            }
            Geometry::Mesh(mesh) => {
                hasher.say(&[mesh.positions.len(), mesh.indices.len(), mesh.normals.len()]);
                hasher.numbers(mesh.positions.iter().flatten().map(|x| x.to_bits()));
                hasher.numbers(mesh.indices.iter().flatten().copied());
                let normals = mesh.normals.iter().flat_map(|normal| normal.to_array());
                hasher.numbers(normals.map(f32::to_bits));
                let uvs = mesh.uvs.iter().flat_map(|uv| uv.to_array());
                hasher.numbers(uvs.map(f32::to_bits));
                let colors = mesh.colors.iter().flat_map(|color| color.to_array());
                hasher.numbers(colors.map(f32::to_bits));
            }
        }
    }
    for object in &scene.objects {
        hasher.say(&object.shapes.len());
    }
    hasher.say(&scene.instances);
    hasher.say(&scene.materials);
    hasher.say(&scene.lights);
    hasher.say(&scene.camera);
    hasher.say(&scene.film);
    hasher.say(&scene.sampler);
    hasher.say(&scene.integrator);
    format!("{:016x}", hasher.0.digest())
}

/// Takes text and numbers.
struct Hasher(Xxh3);

impl Hasher {
    fn say(&mut self, value: &impl fmt::Debug) {
        // Hashing cannot fail.
        let _ = write!(self, "{value:?};");
    }

    fn numbers(&mut self, numbers: impl Iterator<Item = u32>) {
        for number in numbers {
            self.0.update(&number.to_le_bytes());
        }
    }
}

impl Write for Hasher {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.update(text.as_bytes());
        Ok(())
    }
}
