//! The key of a bake: a hash of everything that its answers depend on.

use antumbra_scene::{Geometry, Scene};
use xxhash_rust::xxh3::Xxh3;

use crate::exit::Failure;

/// A hash in the making.
pub struct Key(Xxh3);

impl Key {
    /// The key of a command on the geometry of a scene whose instances are in place.
    pub fn new(command: &str, scene: &Scene) -> Result<Self, Failure> {
        let mut key = Self(Xxh3::new());
        key.text(command);
        for shape in &scene.shapes {
            match &shape.geometry {
                Geometry::Mesh(mesh) => {
                    key.floats(mesh.positions.as_flattened());
                    key.0.update(&(mesh.indices.len() as u64).to_le_bytes());
                    for corner in mesh.indices.as_flattened() {
                        key.0.update(&corner.to_le_bytes());
                    }
                }
                Geometry::Sphere(sphere) => key.text(&format!("{sphere:?}")),
            }
        }
        Ok(key)
    }

    /// Adds a text, such as choices that were made.
    pub fn text(&mut self, text: &str) {
        self.0.update(&(text.len() as u64).to_le_bytes());
        self.0.update(text.as_bytes());
    }

    /// Adds numbers.
    pub fn floats(&mut self, numbers: &[f32]) {
        self.0.update(&(numbers.len() as u64).to_le_bytes());
        let mut bytes = Vec::with_capacity(4 * numbers.len().min(1 << 12));
        for piece in numbers.chunks(1 << 12) {
            bytes.clear();
            piece
                .iter()
                .for_each(|x| bytes.extend(x.to_bits().to_le_bytes()));
            self.0.update(&bytes);
        }
    }

    /// The hash.
    pub fn value(&self) -> u64 {
        self.0.digest()
    }
}
