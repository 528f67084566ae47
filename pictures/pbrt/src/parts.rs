//! Parts of textures and materials: limits on their number, and keys by which equal materials are found.
//!
//! A few lines, each of which names the line before twice, describe exponentially many parts. Many lines, each of
//! which names the line before once, are nested deeper than the call stack allows. Every texture and mixture is
//! therefore counted when it is defined, so later code can use recursion.

use std::mem::{Discriminant, discriminant};
use std::sync::Arc;

use antumbra_scene::{Material, MaterialPart, Param, Texture};

/// Largest number of parts of a texture or mixture, where a part that is named twice counts twice.
///
/// The renderer has the same limit.
pub(crate) const MAX_PARTS: usize = 4096;

/// Returns true if a texture has at most [`MAX_PARTS`] parts. The parts must have been checked before.
pub(crate) fn texture_fits<T>(texture: &Texture<T>) -> bool {
    let mut left = MAX_PARTS;
    count_texture(texture, &mut left)
}

/// Returns true if a material has at most [`MAX_PARTS`] parts. Textures of its parameters do not count.
pub(crate) fn material_fits(material: &Material) -> bool {
    let mut left = MAX_PARTS;
    count_material(material, &mut left)
}

/// Subtracts the parts of a texture from `left`; false if there are too many.
///
/// Parts are counted before their children, which bounds the depth of the recursion as well.
fn count_texture<T>(texture: &Texture<T>, left: &mut usize) -> bool {
    if *left == 0 {
        return false;
    }
    *left -= 1;
    match texture {
        Texture::Scale(two)
        | Texture::Checkerboard { squares: two, .. }
        | Texture::Checkerboard3 { cubes: two, .. }
        | Texture::Dots { dots: two, .. } => count_params(two, left),
        Texture::Mix { ends, amount } => {
            count_params(ends, left) && count_params(std::slice::from_ref(amount), left)
        }
        Texture::AtLeast { value, .. } | Texture::Root(value) | Texture::Dither(value) => {
            count_params(std::slice::from_ref(value), left)
        }
        Texture::Bilerp { .. }
        | Texture::Uv(_)
        | Texture::Noise { .. }
        | Texture::Image(_)
        | Texture::VertexColor => true,
    }
}

fn count_params<T>(params: &[Param<T>], left: &mut usize) -> bool {
    params.iter().all(|param| match param {
        Param::Constant(_) => true,
        Param::Texture(texture) => count_texture(texture, left),
    })
}

fn count_material(material: &Material, left: &mut usize) -> bool {
    if *left == 0 {
        return false;
    }
    *left -= 1;
    material.parts().into_iter().all(|part| match part {
        MaterialPart::Material(material) => count_material(material, left),
        _ => true,
    })
}

/// Word of the key of a material.
#[derive(PartialEq, Eq, Hash)]
pub(crate) enum Word {
    Kind(Discriminant<Material>),
    Number(u32),
    Color([u32; 3]),
    /// Address of a texture or a table.
    Shared(usize),
}

/// Appends what equal materials have in common: numbers by their bits, textures by identity.
///
/// A key is valid while the textures of its material live, which the scene's list of materials guarantees. Two
/// declarations of one texture count as different textures.
pub(crate) fn push_key(material: &Material, key: &mut Vec<Word>) {
    key.push(Word::Kind(discriminant(material)));
    for part in material.parts() {
        key.push(match part {
            MaterialPart::Material(material) => {
                push_key(material, key);
                continue;
            }
            MaterialPart::Setting(number) => Word::Number(number.to_bits()),
            MaterialPart::Number(Param::Constant(number)) => Word::Number(number.to_bits()),
            MaterialPart::Color(Param::Constant(color)) => {
                Word::Color(color.to_array().map(f32::to_bits))
            }
            MaterialPart::Table(table) => Word::Shared(Arc::as_ptr(table).addr()),
            MaterialPart::Number(Param::Texture(texture)) => {
                Word::Shared(Arc::as_ptr(texture).addr())
            }
            MaterialPart::Color(Param::Texture(texture)) => {
                Word::Shared(Arc::as_ptr(texture).addr())
            }
        });
    }
}
