//! Textures of textures and mixtures of mixtures: a few lines, each of which names the last one twice, describe more
//! parts than atoms exist, and many lines, each of which names the last, are nested deeper than calls may be. Whoever
//! walks over them later need not be afraid: each is counted as it is made, and refused if it is too much.

use antumbra_scene::{Material, Param, Texture};

/// Parts of a texture or a mixture; what is named twice counts twice. The renderer refuses more, too.
pub(crate) const MAX_PARTS: usize = 4096;

/// Whether a texture whose parts were found to fit has few enough itself.
pub(crate) fn texture_fits<T>(texture: &Texture<T>) -> bool {
    let mut left = MAX_PARTS;
    count_texture(texture, &mut left)
}

/// The same for a material; the textures of its parameters do not count.
pub(crate) fn material_fits(material: &Material) -> bool {
    let mut left = MAX_PARTS;
    count_material(material, &mut left)
}

/// Counts on the way down, so that the depth is bounded as well; false as soon as nothing is left.
fn count_texture<T>(texture: &Texture<T>, left: &mut usize) -> bool {
    if *left == 0 {
        return false;
    }
    *left -= 1;
    match texture {
        Texture::Scale(two)
        | Texture::Checkerboard { squares: two, .. }
        | Texture::Checkerboard3 { cubes: two, .. } => count_params(two, left),
        Texture::Mix { ends, amount } => {
            count_params(ends, left) && count_params(std::slice::from_ref(amount), left)
        }
        Texture::Bilerp { .. } | Texture::Image(_) => true,
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
    match material {
        Material::Mix { materials, .. } => materials.iter().all(|m| count_material(m, left)),
        Material::Bumped { material, .. } => count_material(material, left),
        _ => true,
    }
}
