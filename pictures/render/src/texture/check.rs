//! Textures and materials that are refused, since lowering them would panic or never end.

use antumbra_scene::{Image, Material, MaterialPart, Param, Pixels, Scene, Texture};

use crate::Error;

/// Largest number of parts of a material: mixed materials and textures together.
///
/// A part that is used twice counts twice, since a few lines of a file can describe an exponential number.
const MAX_PARTS: usize = 4096;

/// Checks that images have as many pixels as they claim, and that materials and masks have few enough parts.
pub fn check(scene: &Scene) -> Result<(), Error> {
    for (index, material) in scene.materials.iter().enumerate() {
        let mut parts = Parts::new("material", index);
        parts.material(material)?;
    }
    let shapes = scene.objects.iter().flat_map(|object| &object.shapes);
    for (index, shape) in scene.shapes.iter().chain(shapes).enumerate() {
        for mask in [&shape.alpha, &shape.shadow_alpha].into_iter().flatten() {
            Parts::new("mask of shape", index).param(mask)?;
        }
        let emitted = shape.area_light.as_ref();
        if let Some(texture) = emitted.and_then(|light| light.texture.as_ref()) {
            Parts::new("emission of shape", index).param(texture)?;
        }
    }
    Ok(())
}

struct Parts {
    what: &'static str,
    index: usize,
    count: usize,
}

impl Parts {
    fn new(what: &'static str, index: usize) -> Self {
        let count = 0;
        Self { what, index, count }
    }

    /// Counts a part on the way down, which bounds the depth as well.
    fn one_more(&mut self) -> Result<(), Error> {
        self.count += 1;
        if self.count > MAX_PARTS {
            return Err(Error::Parts {
                what: self.what,
                index: self.index,
                limit: MAX_PARTS,
            });
        }
        Ok(())
    }

    fn params<T>(&mut self, params: &[&Param<T>]) -> Result<(), Error> {
        params.iter().try_for_each(|param| self.param(param))
    }

    fn param<T>(&mut self, param: &Param<T>) -> Result<(), Error> {
        let Param::Texture(texture) = param else {
            return Ok(());
        };
        self.one_more()?;
        match &**texture {
            Texture::Scale([a, b])
            | Texture::Checkerboard {
                squares: [a, b], ..
            }
            | Texture::Checkerboard3 { cubes: [a, b], .. }
            | Texture::Dots { dots: [a, b], .. } => self.params(&[a, b]),
            Texture::Mix {
                ends: [a, b],
                amount,
            } => {
                self.params(&[a, b])?;
                self.param(amount)
            }
            Texture::Bilerp { .. }
            | Texture::Uv(_)
            | Texture::Noise { .. }
            | Texture::VertexColor => Ok(()),
            Texture::AtLeast { value, .. } | Texture::Root(value) | Texture::Dither(value) => {
                self.param(value)
            }
            Texture::Image(texture) => image(&texture.image),
        }
    }

    fn material(&mut self, material: &Material) -> Result<(), Error> {
        self.one_more()?;
        material
            .parts()
            .into_iter()
            .try_for_each(|part| match part {
                MaterialPart::Color(param) => self.param(param),
                MaterialPart::Number(param) => self.param(param),
                MaterialPart::Setting(_) => Ok(()),
                MaterialPart::Table(table) => table.check().map_err(|reason| Error::Table {
                    name: table.name.clone(),
                    reason,
                }),
                MaterialPart::Material(material) => self.material(material),
            })
    }
}

fn image(image: &Image) -> Result<(), Error> {
    let found = match &image.pixels {
        Pixels::Grey8(pixels) => pixels.len(),
        Pixels::Rgb8(pixels) => pixels.len(),
        Pixels::Rgb32(pixels) => pixels.len(),
    };
    let [width, height] = [image.width, image.height];
    let fits = |size: u32| (1..=MAX_SIDE).contains(&size);
    let expected = u64::from(width) * u64::from(height);
    if !fits(width) || !fits(height) || found as u64 != expected {
        return Err(Error::Texture {
            name: image.name.clone(),
            width,
            height,
            found,
        });
    }
    Ok(())
}

/// Largest number of texels along a side that single precision distinguishes.
const MAX_SIDE: u32 = 1 << 24;

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use antumbra_scene::material::{Matte, Mix};
    use antumbra_scene::{ImageTexture, Mapping, TextureFilter, Wrap};
    use glam::Vec3;

    use super::*;

    fn matte(kd: Param<Vec3>) -> Material {
        let sigma = 0.0.into();
        Material::Matte(Matte { kd, sigma })
    }

    fn check_material(material: &Material) -> Result<(), Error> {
        Parts::new("material", 7).material(material)
    }

    #[test]
    fn what_doubles_with_every_line_is_refused() {
        let mut material = Arc::new(matte(Vec3::ONE.into()));
        let mut texture = Param::Constant(Vec3::ONE);
        let double = |material: &Arc<Material>| {
            Material::Mix(Mix {
                materials: [Arc::clone(material), Arc::clone(material)],
                amount: Vec3::ONE.into(),
            })
        };
        for line in 0..60 {
            let of_texture = matte(texture.clone());
            for result in [check_material(&material), check_material(&of_texture)] {
                match result {
                    Ok(()) => assert!(line < 13),
                    Err(Error::Parts { index: 7, .. }) => assert!(line >= 12),
                    Err(other) => panic!("{other}"),
                }
            }
            material = Arc::new(double(&material));
            texture = Param::Texture(Arc::new(Texture::Scale([texture.clone(), texture])));
        }
    }

    #[test]
    fn images_have_the_pixels_they_say() {
        for (width, height, count, fine) in [
            (2, 3, 6, true),
            (2, 3, 5, false),
            (0, 3, 0, false),
            (u32::MAX, u32::MAX, 6, false),
        ] {
            let image = Arc::new(Image {
                name: "leaf.png".into(),
                width,
                height,
                pixels: Pixels::Grey8(vec![0; count]),
            });
            let texture = Texture::Image(ImageTexture {
                image,
                mapping: Mapping::default(),
                wrap: Wrap::Repeat,
                filter: TextureFilter::Trilinear,
                gamma: false,
                scale: 1.0,
            });
            let result = check_material(&matte(Param::Texture(Arc::new(texture))));
            assert_eq!(result.is_ok(), fine);
            if let Err(error) = result {
                assert!(error.to_string().contains("leaf.png"), "{error}");
            }
        }
    }
}
