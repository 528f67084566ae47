//! Materials and textures.
//!
//! | glTF | scene |
//! |---|---|
//! | metallic-roughness | [`Material::Metallic`] |
//! | transmission with a volume | smooth or rough glass, mixed with the rest by its share |
//! | transmission without one | a thin sheet |
//! | alpha mode MASK | a mask with a hard edge |
//! | alpha mode BLEND | a mask that lets rays pass at random, as often as the surface is clear |
//! | emission | an area light with a texture |
//! | occlusion | none: light is traced |

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use antumbra_scene::material::{Glass, Metallic, Mix, NormalMapped};
use antumbra_scene::{AreaLight, Mapping, Material, Param, Rgb, Texture, Wrap};
use data_url::DataUrl;
use glam::Vec2;
use gltf::image::Source;
use gltf::json::Value;
use gltf::material::AlphaMode;
use gltf::texture::{Info, WrappingMode};

use super::file_of;
use crate::images::{Channel, Images, Laid, Loaded, Unread, times};
use crate::{PLAIN_GREY, plain_material};

/// Look of a primitive.
#[derive(Clone)]
pub(super) struct Look {
    /// Place among the materials.
    pub material: usize,
    pub emission: Option<AreaLight>,
    pub alpha: Option<Param<f32>>,
    /// Set of texture coordinates.
    pub uv_set: u32,
    /// Whether the alpha mask cuts all away.
    pub is_invisible: bool,
}

/// Looks made so far.
pub(super) struct Looks<'a> {
    buffers: &'a [Cow<'a, [u8]>],
    /// Folder of the images; `None` if they are not wanted.
    folder: Option<&'a Path>,
    pub images: Images,
    pub materials: Vec<Material>,
    known: HashMap<(Option<usize>, bool), Look>,
    pub notes: Vec<String>,
    /// Missing images.
    pub warnings: Vec<String>,
    /// Damaged images.
    pub mistakes: Vec<String>,
}

/// Coordinates of a texture: their set, and a transformation in the space of glTF.
#[derive(Clone, Copy)]
struct Coordinates {
    set: u32,
    offset: [f32; 2],
    rotation: f32,
    scale: [f32; 2],
}

impl Coordinates {
    fn plain(set: u32) -> Self {
        Self {
            set,
            offset: [0.0; 2],
            rotation: 0.0,
            scale: [1.0; 2],
        }
    }

    fn of(info: &Info) -> Self {
        let plain = Self::plain(info.tex_coord());
        match info.texture_transform() {
            None => plain,
            Some(transform) => Self {
                set: transform.tex_coord().unwrap_or(plain.set),
                offset: transform.offset(),
                rotation: transform.rotation(),
                scale: transform.scale(),
            },
        }
    }

    /// Of a normal texture, whose transformation the crate does not read.
    fn of_normal(texture: &gltf::material::NormalTexture) -> Self {
        let mut found = Self::plain(texture.tex_coord());
        let Some(transform) = texture.extension_value("KHR_texture_transform") else {
            return found;
        };
        let number = |value: &Value| value.as_f64().map(|number| number as f32);
        let pair = |name: &str| {
            let list = transform.get(name)?.as_array()?;
            Some([number(list.first()?)?, number(list.get(1)?)?])
        };
        found.offset = pair("offset").unwrap_or(found.offset);
        found.scale = pair("scale").unwrap_or(found.scale);
        let rotation = transform.get("rotation").and_then(number);
        found.rotation = rotation.unwrap_or(0.0);
        let set = transform.get("texCoord").and_then(Value::as_u64);
        found.set = set.map_or(found.set, |set| set as u32);
        found
    }

    /// Mapping of coordinates whose v was turned upside down.
    fn mapping(&self) -> Mapping {
        let (sin, cos) = (libm::sinf(self.rotation), libm::cosf(self.rotation));
        let ([sx, sy], [x, y]) = (self.scale, self.offset);
        // u' = a u + b v + x and v' = d u + e v + y, where v goes down.
        let (a, b, d, e) = (cos * sx, sin * sy, -sin * sx, cos * sy);
        let offset = Vec2::new(x + b, 1.0 - e - y);
        if b == 0.0 && d == 0.0 {
            let scale = Vec2::new(a, e);
            return Mapping::Uv { scale, offset };
        }
        Mapping::Affine {
            columns: [Vec2::new(a, -d), Vec2::new(-b, e)],
            offset,
        }
    }
}

impl<'a> Looks<'a> {
    pub fn new(buffers: &'a [Cow<'a, [u8]>], folder: Option<&'a Path>, images: Images) -> Self {
        Self {
            buffers,
            folder,
            images,
            materials: Vec::new(),
            known: HashMap::new(),
            notes: Vec::new(),
            warnings: Vec::new(),
            mistakes: Vec::new(),
        }
    }

    fn note(&mut self, note: &str) {
        if !self.notes.iter().any(|known| known == note) {
            self.notes.push(note.to_owned());
        }
    }

    /// Look of a material, on a primitive with or without vertex colours.
    pub fn of(&mut self, material: &gltf::Material, has_colors: bool) -> Look {
        let key = (material.index(), has_colors);
        if let Some(known) = self.known.get(&key) {
            return known.clone();
        }
        let mut surface = Surface {
            uv_set: None,
            place: match material.index() {
                Some(index) => format!("material {index}"),
                None => "the default material".into(),
            },
            looks: self,
        };
        let look = surface.look(material, has_colors);
        self.known.insert(key, look.clone());
        look
    }
}

/// Glass of a perceptual roughness, whose square is alpha.
fn glass(color: Param<Rgb>, roughness: &Param<f32>, eta: f32) -> Material {
    let alpha = match roughness {
        Param::Constant(value) => Param::Constant(value * value),
        texture => Param::Texture(Arc::new(Texture::Scale([texture.clone(), texture.clone()]))),
    };
    Material::Glass(Glass {
        kr: Rgb::ONE.into(),
        kt: color,
        eta: eta.max(1.0).into(),
        roughness: [alpha.clone(), alpha],
        remap_roughness: false,
    })
}

/// A material that is being read.
struct Surface<'s, 'a> {
    looks: &'s mut Looks<'a>,
    /// Texture coordinates of the first texture. The others must use them, too.
    uv_set: Option<u32>,
    place: String,
}

impl Surface<'_, '_> {
    fn note(&mut self, note: &str) {
        self.looks.note(note);
    }

    fn look(&mut self, material: &gltf::Material, has_colors: bool) -> Look {
        let pbr = material.pbr_metallic_roughness();
        let [r, g, b, opacity] = pbr.base_color_factor();
        let mut factor = Rgb::new(r, g, b).clamp(Rgb::ZERO, Rgb::ONE);
        let base = pbr.base_color_texture();
        let texture = (base.as_ref()).and_then(|info| self.info(info, Channel::Color));
        if base.is_some() && texture.is_none() {
            factor *= PLAIN_GREY;
        }
        let texture = texture.map(|(loaded, laid)| loaded.color(laid));
        let mut color = times(factor, Rgb::ONE, texture);
        if has_colors {
            let colors = Param::Texture(Arc::new(Texture::VertexColor));
            color = match color {
                Param::Constant(Rgb::ONE) => colors,
                color => Param::Texture(Arc::new(Texture::Scale([color, colors]))),
            };
        }
        let made = match material.index() {
            // Without a material: as meshes of other formats.
            None if !has_colors => plain_material(),
            _ => self.material(material, color),
        };
        let made = self.normal_mapped(material, made);
        if material.occlusion_texture().is_some() {
            self.note("occlusion textures are left out: light is traced");
        }
        let emission = self.emission(material);
        let (alpha, is_invisible) = self.alpha(material, opacity);
        self.looks.materials.push(made);
        Look {
            material: self.looks.materials.len() - 1,
            emission,
            alpha,
            uv_set: self.uv_set.unwrap_or(0),
            is_invisible,
        }
    }

    fn material(&mut self, material: &gltf::Material, color: Param<Rgb>) -> Material {
        let pbr = material.pbr_metallic_roughness();
        let both = pbr.metallic_roughness_texture();
        let roughness = self.number(both.as_ref(), 1, pbr.roughness_factor());
        let opaque = Metallic {
            color: color.clone(),
            metallic: self.number(both.as_ref(), 2, pbr.metallic_factor()),
            roughness: roughness.clone(),
            coat: self.coat(material).into(),
            transmission: 0.0.into(),
        };
        let Some(clear) = material.transmission() else {
            return opaque.into();
        };
        let (texture, factor) = (clear.transmission_texture(), clear.transmission_factor());
        let share = self.number(texture.as_ref(), 0, factor);
        if share.constant() == Some(&0.0) {
            return opaque.into();
        }
        let volume = (material.volume()).filter(|volume| volume.thickness_factor() > 0.0);
        let Some(volume) = volume else {
            if roughness.constant() != Some(&0.0) {
                self.note(
                    "light that passes through thin sheets is not blurred by their roughness",
                );
            }
            return Material::Metallic(Metallic {
                transmission: share,
                ..opaque
            });
        };
        if volume.attenuation_color() != [1.0; 3] && volume.attenuation_distance().is_finite() {
            self.note("attenuation inside volumes is left out: only the base colour tints glass");
        }
        let glass = glass(color, &roughness, material.ior().unwrap_or(1.5));
        let share = match share {
            Param::Constant(share) if share >= 1.0 => return glass,
            Param::Constant(share) => share,
            Param::Texture(_) => {
                self.note("textures of transmission are left out where there is a volume");
                factor
            }
        };
        Material::Mix(Mix {
            materials: [Arc::new(glass), Arc::new(opaque.into())],
            amount: Rgb::splat(share).into(),
        })
    }

    /// Factor times a channel of a texture, if there is one.
    fn number(&mut self, info: Option<&Info>, channel: u8, factor: f32) -> Param<f32> {
        match info.and_then(|info| self.info(info, Channel::One(channel))) {
            Some((loaded, laid)) => loaded.number(laid, factor),
            None => Param::Constant(factor),
        }
    }

    /// Reflectance of the surface of a dielectric at normal incidence.
    fn coat(&mut self, material: &gltf::Material) -> Rgb {
        // Index 0 stands for a mirror in older files.
        let reflectance = match material.ior().unwrap_or(1.5) {
            eta if eta < 1.0 => 1.0,
            eta => ((eta - 1.0) / (eta + 1.0)) * ((eta - 1.0) / (eta + 1.0)),
        };
        let coat = Rgb::splat(reflectance);
        let Some(specular) = material.specular() else {
            return coat;
        };
        if specular.specular_texture().is_some() || specular.specular_color_texture().is_some() {
            self.note("textures of KHR_materials_specular are left out");
        }
        (coat * Rgb::from(specular.specular_color_factor())).min(Rgb::ONE)
            * specular.specular_factor()
    }

    fn normal_mapped(&mut self, material: &gltf::Material, made: Material) -> Material {
        let Some(normal) = material.normal_texture() else {
            return made;
        };
        let coordinates = Coordinates::of_normal(&normal);
        let Some((loaded, laid)) = self.texture(&normal.texture(), coordinates, Channel::Color)
        else {
            return made;
        };
        Material::NormalMapped(NormalMapped {
            material: Arc::new(made),
            normal: loaded.raw(laid),
            scale: normal.scale(),
        })
    }

    fn emission(&mut self, material: &gltf::Material) -> Option<AreaLight> {
        let factor = Rgb::from(material.emissive_factor());
        let radiance = factor * material.emissive_strength().unwrap_or(1.0);
        if !(radiance.max_element() > 0.0 && radiance.is_finite()) {
            return None;
        }
        let texture = material.emissive_texture();
        let texture = texture.and_then(|info| self.info(&info, Channel::Color));
        Some(AreaLight {
            radiance,
            texture: texture.map(|(loaded, laid)| loaded.color(laid)),
            two_sided: material.double_sided(),
            samples: 1,
        })
    }

    /// Alpha mask, and whether it cuts all away.
    fn alpha(&mut self, material: &gltf::Material, factor: f32) -> (Option<Param<f32>>, bool) {
        let mode = material.alpha_mode();
        if mode == AlphaMode::Opaque {
            return (None, false);
        }
        let base = material.pbr_metallic_roughness().base_color_texture();
        let texture = base.and_then(|info| self.info(&info, Channel::Alpha));
        let texture = texture.filter(|(loaded, _)| loaded.image.width * loaded.image.height > 1);
        if mode == AlphaMode::Blend {
            let value = match texture {
                Some((loaded, laid)) => loaded.number(laid, factor),
                None if factor >= 1.0 => return (None, false),
                None => Param::Constant(factor),
            };
            let dither = Texture::Dither(value);
            return (Some(Param::Texture(Arc::new(dither))), factor <= 0.0);
        }
        let cutoff = material.alpha_cutoff().unwrap_or(0.5);
        let Some((loaded, laid)) = texture else {
            return (None, factor < cutoff);
        };
        // Halfway between two bytes, so that rounding does not matter.
        let least = (cutoff / factor * 255.0).ceil() - 0.5;
        if !(least <= 255.0) {
            return (None, true);
        }
        let edge = Texture::AtLeast {
            value: loaded.number(laid, 1.0),
            least: least / 255.0,
        };
        (Some(Param::Texture(Arc::new(edge))), false)
    }

    fn info(&mut self, info: &Info, channel: Channel) -> Option<(Loaded, Laid)> {
        self.texture(&info.texture(), Coordinates::of(info), channel)
    }

    /// Image of a texture, and how it lies on the surface.
    fn texture(
        &mut self,
        texture: &gltf::Texture,
        coordinates: Coordinates,
        channel: Channel,
    ) -> Option<(Loaded, Laid)> {
        let folder = self.looks.folder?;
        let set = *self.uv_set.get_or_insert(coordinates.set);
        if set != coordinates.set {
            self.note(
                "textures of one material that use several sets of coordinates all use the first",
            );
        }
        let Some(image) = texture.source() else {
            self.note("textures without an image are left out");
            return None;
        };
        let sampler = texture.sampler();
        let wrap = match sampler.wrap_s() {
            WrappingMode::ClampToEdge => Wrap::Clamp,
            WrappingMode::Repeat => Wrap::Repeat,
            WrappingMode::MirroredRepeat => {
                self.note("mirrored textures are repeated instead");
                Wrap::Repeat
            }
        };
        if sampler.wrap_s() != sampler.wrap_t() {
            self.note("textures that continue differently along u and v use the rule of u");
        }
        let laid = Laid {
            mapping: coordinates.mapping(),
            wrap,
        };
        match self.image(&image, channel, folder) {
            Ok(loaded) => Some((loaded, laid)),
            Err(unread) => {
                let (place, index) = (&self.place, image.index());
                let (list, reason) = match unread {
                    Unread::Absent(reason) => (&mut self.looks.warnings, reason),
                    Unread::Bad(reason) => (&mut self.looks.mistakes, reason),
                };
                let text = format!("{place}: image {index}: {reason}");
                if !list.contains(&text) {
                    list.push(text);
                }
                None
            }
        }
    }

    fn image(
        &mut self,
        image: &gltf::Image,
        channel: Channel,
        folder: &Path,
    ) -> Result<Loaded, Unread> {
        let name = format!("image {}", image.index());
        match image.source() {
            Source::View { view, .. } => {
                let buffer = self.looks.buffers.get(view.buffer().index());
                let end = view.offset().checked_add(view.length());
                let bytes = end.and_then(|end| buffer?.get(view.offset()..end));
                let bytes = bytes.ok_or("its bufferView reaches beyond its buffer")?;
                self.looks.images.bytes(bytes, &name, channel)
            }
            Source::Uri { uri, .. } => match DataUrl::process(uri) {
                Ok(data) => {
                    let bytes = data.decode_to_vec().map_err(|error| error.to_string())?.0;
                    self.looks.images.bytes(&bytes, &name, channel)
                }
                Err(_) => {
                    let (path, name) = file_of(uri, folder)?;
                    let read = self.looks.images.file(&path, channel);
                    read.map_err(|unread| unread.of(&name))
                }
            },
        }
    }
}
