//! Equality of materials, for finding equal ones by hashing.

use std::mem::{Discriminant, discriminant};
use std::sync::Arc;

use antumbra_scene::{Material, MaterialPart, Param};

/// Hash key of a material: numbers by their bits, textures by identity.
///
/// A key is valid while the textures of its material live, which the scene's list of materials guarantees. Two
/// declarations of one texture count as different textures.
#[derive(PartialEq, Eq, Hash)]
pub(crate) struct MaterialKey(Vec<Word>);

#[derive(PartialEq, Eq, Hash)]
enum Word {
    Kind(Discriminant<Material>),
    Number(u32),
    Color([u32; 3]),
    Texture(usize),
}

impl MaterialKey {
    /// Makes the key of a material.
    pub fn new(material: &Material) -> Self {
        let mut key = Self(Vec::new());
        key.material(material);
        key
    }

    fn material(&mut self, material: &Material) {
        self.0.push(Word::Kind(discriminant(material)));
        for part in material.parts() {
            let word = match part {
                MaterialPart::Material(material) => {
                    self.material(material);
                    continue;
                }
                MaterialPart::Table(table) => identity(table),
                MaterialPart::Setting(number) => Word::Number(number.to_bits()),
                MaterialPart::Number(Param::Constant(number)) => Word::Number(number.to_bits()),
                MaterialPart::Color(Param::Constant(color)) => {
                    Word::Color(color.to_array().map(f32::to_bits))
                }
                MaterialPart::Number(Param::Texture(texture)) => identity(texture),
                MaterialPart::Color(Param::Texture(texture)) => identity(texture),
            };
            self.0.push(word);
        }
    }
}

fn identity<T>(texture: &Arc<T>) -> Word {
    Word::Texture(Arc::as_ptr(texture) as usize)
}
