//! From the statements of a `.mtl` file to materials, masks and emission.
//!
//! | statements | material |
//! |---|---|
//! | `Pr`, `Pm` or their maps | metallic-roughness |
//! | `illum` 4, 6, 7 or 9 | glass, clear in the colour of `Tf` |
//! | `illum` 3, 5 or 8 | a mirror in the colour of `Ks` that takes its share from `Kd` |
//! | `illum` 0 or 1, or no `Ks` | diffuse |
//! | no `Kd` at all, and `Ks` above 1/2 | metal in the colour of `Ks` |
//! | others | diffuse under a clear coat |
//!
//! # Highlights
//!
//! `Ks` is the colour of a highlight of the Phong model, which knows no mirror images and no balance of energy. Programs
//! that show OBJ files lay the highlight over `Kd`, whatever its strength, and most files have some `Ks` on every
//! material. `Ks` is therefore no reflectance here. It scales the reflectance of a dielectric coat at normal incidence, so
//! that `Ks .5` is the coat of an index of refraction of 1.5, and `Ks 1` twice that. Blender reads `Ks` in the same way.
//! Light that the coat does not reflect reaches the base, so that no energy is gained and little is lost.

use std::sync::Arc;

use antumbra_scene::material::{Glass, Matte, Metallic, NormalMapped, Substrate};
use antumbra_scene::{
    AreaLight, Image, Mapping, Material, Param, Pixels, Rgb, Texture, TextureFilter,
};

use super::mtl::{Map, Mtl};
use super::scan::Mistakes;
use crate::images::{Channel, Images, Laid, Loaded, Unread, times};
use crate::{Model, PLAIN_GREY};

/// Look of a surface.
pub(super) struct Looks {
    pub material: Material,
    pub emission: Option<AreaLight>,
    pub alpha: Option<Param<f32>>,
}

/// Reflectance of the coat at normal incidence where `Ks` is 1.
const COAT: f32 = 0.08;
/// Exponent of highlights without `Ns`: perceptual roughness 1/2.
const USUAL_EXPONENT: f32 = 30.0;
/// Exponent of mirrors without `Ns`, the largest in common use.
const MIRROR_EXPONENT: f32 = 1000.0;
/// `Ks` above which a material without `Kd` is a metal. Black plastic often has 1/2.
const METAL: f32 = 0.5;

/// Microfacet alpha of a Phong exponent, with the same curvature of the highlight (Walter et al. 2007).
fn alpha_of_exponent(exponent: f32) -> f32 {
    (2.0 / (exponent.max(0.0) + 2.0)).sqrt()
}

impl Looks {
    /// A material without emission or transparency.
    pub fn plain(material: Material) -> Self {
        Self {
            material,
            emission: None,
            alpha: None,
        }
    }

    /// Diffuse in the colours of the vertices.
    pub fn of_vertex_colors() -> Self {
        Self::plain(Material::Matte(Matte {
            kd: Param::Texture(Arc::new(Texture::VertexColor)),
            sigma: 0.0.into(),
        }))
    }

    /// Look by a material of a library. Missing images are warnings, damaged ones mistakes.
    pub fn of(
        mtl: &Mtl,
        has_colors: bool,
        images: &mut Images,
        model: &mut Model,
        mistakes: &mut Mistakes,
    ) -> Self {
        let mut maps = Maps { images, mistakes };
        let kd = maps.base_color(mtl, has_colors);
        let map_ks = maps.color(mtl.map_ks.as_ref());
        let ks = factor(mtl.ks, &map_ks);
        let kind = Kind::of(mtl, ks);
        let material = maps.material(mtl, kind, kd, (ks, map_ks));
        if let Some(kind) = mtl.illum.filter(|&kind| kind > 9) {
            model.note(format!("`illum {kind}` is taken as `illum 2`"));
        }
        let material = maps.bumps(mtl, material);
        let map_ke = maps.color(mtl.map_ke.as_ref());
        let ke = factor(mtl.ke, &map_ke);
        let emission = (ke.max_element() > 0.0).then_some(AreaLight {
            radiance: ke,
            texture: map_ke,
            two_sided: true,
            samples: 1,
        });
        let opacity = match kind {
            Kind::Glass => 1.0,
            _ => mtl.opacity(),
        };
        let map_d = maps.load(mtl.map_d.as_ref(), Channel::AlphaOrGrey);
        let alpha = match map_d {
            Some((loaded, laid)) => Some(loaded.number(laid, opacity)),
            None if opacity < 1.0 => Some(opacity.into()),
            None => None,
        };
        let alpha = alpha.map(|value| Param::Texture(Arc::new(Texture::Dither(value))));
        Self {
            material,
            emission,
            alpha,
        }
    }
}

/// Factor of a map: the colour that is given, or else 1 if there is a map, and 0 if there is none.
fn factor(given: Option<Rgb>, map: &Option<Param<Rgb>>) -> Rgb {
    given.unwrap_or(match map {
        Some(_) => Rgb::ONE,
        None => Rgb::ZERO,
    })
}

/// Kind of a surface, by the table of this file.
#[derive(Clone, Copy)]
enum Kind {
    Physical,
    Glass,
    Mirror,
    /// Diffuse under a clear coat, or metal.
    Coated,
    Diffuse,
}

impl Kind {
    fn of(mtl: &Mtl, ks: Rgb) -> Self {
        let is_physical = [mtl.roughness, mtl.metallic].iter().any(Option::is_some)
            || mtl.map_roughness.is_some()
            || mtl.map_metallic.is_some();
        match mtl.illum {
            _ if is_physical => Self::Physical,
            Some(4 | 6 | 7 | 9) => Self::Glass,
            Some(0 | 1) => Self::Diffuse,
            Some(3 | 5 | 8) if ks.max_element() > 0.0 => Self::Mirror,
            _ if ks.max_element() > 0.0 => Self::Coated,
            _ => Self::Diffuse,
        }
    }
}

/// Reads the images of a material.
struct Maps<'a> {
    images: &'a mut Images,
    mistakes: &'a mut Mistakes,
}

impl Maps<'_> {
    fn load(&mut self, map: Option<&Map>, channel: Channel) -> Option<(Loaded, Laid)> {
        let map = map?;
        match self.images.file(&map.path, channel) {
            Ok(loaded) => {
                let mapping = Mapping::Uv {
                    scale: map.scale,
                    offset: map.offset,
                };
                let wrap = map.wrap;
                Some((loaded, Laid { mapping, wrap }))
            }
            Err(unread) => {
                let (library, line, column) = (&map.library, map.line, map.column);
                let text = |reason| format!("cannot read image `{}`: {reason}", map.name);
                match unread {
                    Unread::Absent(reason) => {
                        let text = text(reason);
                        self.mistakes.warn_of_file(library, line, column, text);
                    }
                    Unread::Bad(reason) => {
                        self.mistakes.of_file(library, line, column, text(reason));
                    }
                }
                None
            }
        }
    }

    /// Diffuse colour, with the colours of the vertices.
    fn base_color(&mut self, mtl: &Mtl, has_colors: bool) -> Param<Rgb> {
        let map_kd = self.color(mtl.map_kd.as_ref());
        let factor = match (mtl.kd, &mtl.map_kd) {
            (None, None) => PLAIN_GREY,
            (None, Some(_)) => Rgb::ONE,
            // Writers that leave the colour to the image. The product would be black.
            (Some(Rgb::ZERO), Some(_)) => Rgb::ONE,
            (Some(kd), _) => kd,
        };
        let kd = match (&mtl.map_kd, map_kd) {
            (Some(_), None) => (factor * PLAIN_GREY).into(),
            (_, map_kd) => times(factor, Rgb::ONE, map_kd),
        };
        if !has_colors {
            return kd;
        }
        let colors = Param::Texture(Arc::new(Texture::VertexColor));
        Param::Texture(Arc::new(Texture::Scale([kd, colors])))
    }

    /// Material of a kind, with its diffuse colour and the colour of its highlight.
    fn material(
        &mut self,
        mtl: &Mtl,
        kind: Kind,
        kd: Param<Rgb>,
        (ks, map_ks): (Rgb, Option<Param<Rgb>>),
    ) -> Material {
        let ks = ks.clamp(Rgb::ZERO, Rgb::ONE);
        match kind {
            Kind::Physical => {
                let factors = [mtl.roughness, mtl.metallic].map(|factor| factor.unwrap_or(1.0));
                let roughness = self.number(mtl.map_roughness.as_ref(), factors[0]);
                let metallic = self.number(mtl.map_metallic.as_ref(), factors[1]);
                let eta = mtl.ni.filter(|&eta| eta > 1.0).unwrap_or(1.5);
                let coat = (eta - 1.0) / (eta + 1.0);
                Material::Metallic(Metallic {
                    color: kd,
                    metallic: metallic.unwrap_or(mtl.metallic.unwrap_or(0.0).into()),
                    roughness: roughness.unwrap_or(mtl.roughness.unwrap_or(0.5).into()),
                    coat: Rgb::splat(coat * coat).into(),
                    transmission: 0.0.into(),
                })
            }
            Kind::Glass => Material::Glass(Glass {
                kr: Rgb::ONE.into(),
                kt: mtl.tf.unwrap_or(Rgb::ONE).into(),
                eta: mtl.ni.filter(|&eta| eta > 0.0).unwrap_or(1.5).into(),
                roughness: [0.0.into(), 0.0.into()],
                remap_roughness: false,
            }),
            Kind::Mirror => {
                let alpha = alpha_of_exponent(mtl.ns.unwrap_or(MIRROR_EXPONENT));
                Material::Substrate(Substrate {
                    kd,
                    ks: times(ks, Rgb::ONE, map_ks),
                    roughness: [alpha.into(), alpha.into()],
                    remap_roughness: false,
                })
            }
            Kind::Coated => {
                let alpha = alpha_of_exponent(mtl.ns.unwrap_or(USUAL_EXPONENT));
                let is_metal = kd.constant() == Some(&Rgb::ZERO) && ks.max_element() > METAL;
                let (color, coat) = match is_metal {
                    true => (times(ks, Rgb::ONE, map_ks), Param::Constant(Rgb::ZERO)),
                    false => (kd, times(COAT * ks, Rgb::ONE, map_ks)),
                };
                Material::Metallic(Metallic {
                    color,
                    metallic: f32::from(u8::from(is_metal)).into(),
                    // Perceptual roughness, whose square is alpha.
                    roughness: alpha.sqrt().into(),
                    coat,
                    transmission: 0.0.into(),
                })
            }
            Kind::Diffuse => Material::Matte(Matte {
                kd,
                sigma: 0.0.into(),
            }),
        }
    }

    fn color(&mut self, map: Option<&Map>) -> Option<Param<Rgb>> {
        let (loaded, laid) = self.load(map, Channel::Color)?;
        Some(loaded.color(laid))
    }

    /// Values of an image times a factor.
    fn number(&mut self, map: Option<&Map>, factor: f32) -> Option<Param<f32>> {
        let (loaded, laid) = self.load(map, Channel::One(0))?;
        Some(loaded.number(laid, factor))
    }

    /// Material with its normal map or bump map.
    ///
    /// Many files name a normal map as a bump map. Images that are mostly blue are taken for one.
    fn bumps(&mut self, mtl: &Mtl, material: Material) -> Material {
        let given = mtl.normal.as_ref();
        let map = given.or(mtl.bump.as_ref());
        let Some((loaded, laid)) = self.load(map, Channel::Color) else {
            return material;
        };
        let strength = map.map_or(1.0, |map| map.strength);
        let (normal, scale) = if given.is_some() || is_normal_map(&loaded.image) {
            (loaded.raw(laid), strength)
        } else {
            let name = format!("{} as normals", loaded.image.name);
            let made = self
                .images
                .make(&name, || normals_of_heights(&loaded.image));
            let texture = antumbra_scene::ImageTexture {
                image: made.image,
                mapping: laid.mapping,
                wrap: laid.wrap,
                filter: TextureFilter::Trilinear,
                gamma: false,
                scale: 1.0,
            };
            (Param::Texture(Arc::new(Texture::Image(texture))), strength)
        };
        Material::NormalMapped(NormalMapped {
            material: Arc::new(material),
            normal,
            scale,
        })
    }
}

/// Whether the colours of an image are mostly upright normals.
fn is_normal_map(image: &Image) -> bool {
    let Pixels::Rgb8(pixels) = &image.pixels else {
        return false;
    };
    let mut sums = [0_u64; 3];
    for pixel in pixels {
        for (sum, &value) in sums.iter_mut().zip(pixel) {
            *sum += u64::from(value);
        }
    }
    let [r, g, b] = sums.map(|sum| sum as f64 / pixels.len() as f64);
    b > 180.0 && (r - 128.0).abs() < 30.0 && (g - 128.0).abs() < 30.0
}

/// Normals of a height field, as colours. A rise by the whole range from one texel to the next is a slope of 1.
///
/// Files do not say how high bumps are in units of the scene.
fn normals_of_heights(image: &Image) -> Image {
    let (width, height) = (image.width as usize, image.height as usize);
    let at = |x: usize, y: usize| -> f32 {
        let index = y % height * width + x % width;
        match &image.pixels {
            Pixels::Grey8(values) => f32::from(values[index]) / 255.0,
            Pixels::Rgb8(values) => {
                values[index].iter().map(|&v| f32::from(v)).sum::<f32>() / (3.0 * 255.0)
            }
            Pixels::Rgb32(values) => values[index].iter().sum::<f32>() / 3.0,
        }
    };
    let mut pixels = Vec::with_capacity(width * height);
    for y in 0..height {
        for x in 0..width {
            let du = 0.5 * (at(x + 1, y) - at(x + width - 1, y));
            // Rows go down, v goes up.
            let dv = 0.5 * (at(x, y + height - 1) - at(x, y + 1));
            let normal = glam::Vec3::new(-du, -dv, 1.0);
            // Not normalized: factors of the first two parts then are factors of the height.
            pixels.push((normal * 0.5 + 0.5).to_array());
        }
    }
    Image {
        name: image.name.clone(),
        width: image.width,
        height: image.height,
        pixels: Pixels::Rgb32(pixels),
    }
}
