//! Directives for textures, and parameters that may name a texture, with the defaults of pbrt-v3.
//!
//! Constant textures become values, and so do their products and mixtures. A texture of an unsupported class may be
//! defined, but its use is an error.
//!
//! - `image`: images that textures and lights look up, each read once
//! - `mapping`: maps from surfaces to texture coordinates

mod image;
mod mapping;

use std::ops::{Add, Mul};
use std::sync::Arc;

use antumbra_scene::{
    ImageTexture, NoisePattern, Octaves, Param, Rgb, Texture, TextureFilter, Wrap,
};
use glam::{DMat4, DVec3};

pub(crate) use image::Images;
#[cfg(test)]
pub(crate) use mapping::SUPPORTED as MAPPINGS;

use crate::directive::Quoted;
use crate::lookup::{COLOR, Lookup, one_float, one_string};
use crate::params::{self, ParamType, Params};
use crate::report::Report;
use crate::source::Span;
use crate::state::{Definition, Scoped, State};
use crate::{parts, spectrum, suggest};

/// Supported classes of textures.
pub(crate) const SUPPORTED: &[&str] = &[
    "bilerp",
    "checkerboard",
    "constant",
    "dots",
    "fbm",
    "imagemap",
    "marble",
    "mix",
    "scale",
    "uv",
    "windy",
    "wrinkled",
];

/// Classes of pbrt-v3 that are not supported.
pub(crate) const UNSUPPORTED: &[&str] = &["ptex"];

/// Most octaves of noise. The frequency of the last is beyond single precision.
const MAX_OCTAVES: u32 = 128;

/// Type of a texture's values: numbers or colours.
pub(crate) trait Value:
    Copy + Add<Output = Self> + Mul<Output = Self> + Mul<f32, Output = Self> + 'static
{
    /// Name of the type in messages.
    const NAME: &'static str;
    /// Types of a parameter with such a value.
    const TYPES: &'static [ParamType];
    /// Types of a parameter with such a value or the name of a texture.
    const TYPES_OR_TEXTURE: &'static [ParamType];

    fn splat(value: f32) -> Self;
    /// Reads a parameter of one of the types. `None`: a mistake was reported.
    fn read(param: &params::Param, report: &mut Report) -> Option<Self>;
    fn textures(state: &State) -> &Scoped<Definition<Self>>;
    fn textures_mut(state: &mut State) -> &mut Scoped<Definition<Self>>;
    /// 1 minus a texture. `None` for colours.
    fn inverted(texture: Texture<Self>) -> Option<Texture<Self>>;
}

impl Value for f32 {
    const NAME: &'static str = "float";
    const TYPES: &'static [ParamType] = &[ParamType::Float];
    const TYPES_OR_TEXTURE: &'static [ParamType] = &[ParamType::Float, ParamType::Texture];

    fn splat(value: f32) -> Self {
        value
    }

    fn read(param: &params::Param, report: &mut Report) -> Option<Self> {
        one_float(param, report)
    }

    fn textures(state: &State) -> &Scoped<Definition<Self>> {
        &state.float_textures
    }

    fn textures_mut(state: &mut State) -> &mut Scoped<Definition<Self>> {
        &mut state.float_textures
    }

    fn inverted(texture: Texture<Self>) -> Option<Texture<Self>> {
        Some(Texture::Mix {
            ends: [1.0.into(), 0.0.into()],
            amount: Param::Texture(Arc::new(texture)),
        })
    }
}

impl Value for Rgb {
    const NAME: &'static str = "color";
    const TYPES: &'static [ParamType] = COLOR;
    const TYPES_OR_TEXTURE: &'static [ParamType] = &[
        ParamType::Rgb,
        ParamType::Xyz,
        ParamType::Spectrum,
        ParamType::Blackbody,
        ParamType::Texture,
    ];

    fn splat(value: f32) -> Self {
        Self::splat(value)
    }

    fn read(param: &params::Param, report: &mut Report) -> Option<Self> {
        spectrum::read(param, report)
    }

    fn textures(state: &State) -> &Scoped<Definition<Self>> {
        &state.color_textures
    }

    fn textures_mut(state: &mut State) -> &mut Scoped<Definition<Self>> {
        &mut state.color_textures
    }

    fn inverted(_: Texture<Self>) -> Option<Texture<Self>> {
        None
    }
}

/// Lookups of parameters that may name textures.
pub(crate) struct Textured<'a, 'p> {
    pub lookup: &'a mut Lookup<'p>,
    pub state: &'a State,
    pub report: &'a mut Report,
}

impl Textured<'_, '_> {
    /// Finds a parameter with the place of its value. `None`: it is not given, or a mistake was reported.
    pub fn find<T: Value>(&mut self, name: &'static str) -> Option<(Param<T>, Span)> {
        let param = self.lookup.find(name, T::TYPES_OR_TEXTURE)?;
        let value = if param.param_type == ParamType::Texture {
            self.resolve(param)?
        } else {
            Param::Constant(T::read(param, self.report)?)
        };
        Some((value, param.value))
    }

    /// Parameter, or the default.
    pub fn param<T: Value>(&mut self, name: &'static str, default: f32) -> Param<T> {
        self.find(name)
            .map_or(Param::Constant(T::splat(default)), |(value, _)| value)
    }

    /// Parameter that cannot be a texture, or the default.
    fn constant<T: Value>(&mut self, name: &'static str, default: f32) -> T {
        self.lookup
            .find(name, T::TYPES)
            .and_then(|param| T::read(param, self.report))
            .unwrap_or(T::splat(default))
    }

    /// Finds the texture that a parameter names. `None`: it is unknown or unsupported, which was reported.
    fn resolve<T: Value>(&mut self, param: &params::Param) -> Option<Param<T>> {
        let name = one_string(param, self.report)?;
        let textures = T::textures(self.state);
        match textures.get(name) {
            Some(Definition::Known(value)) => Some(value.clone()),
            Some(Definition::Unsupported(class)) => {
                let feature = format!("textures of class {class:?} are");
                self.report.unsupported(param.value, feature);
                None
            }
            Some(Definition::Broken) => None,
            None => {
                if !self.report.is_counted_only() {
                    self.report.error_help(
                        param.value,
                        format!("no {} texture is named {name:?} here", T::NAME),
                        suggest::help(name, &textures.names()),
                    );
                }
                None
            }
        }
    }
}

/// `Texture` directive with the current transformation at its place.
pub(crate) struct Declaration {
    pub at: Span,
    pub name: Quoted,
    pub value_type: Quoted,
    pub class: Quoted,
    pub params: Params,
    pub space: TextureSpace,
}

/// The current transformation at a texture, and where positions of the scene are measured from.
#[derive(Clone, Copy)]
pub(crate) struct TextureSpace {
    pub world_from_texture: DMat4,
    pub origin: DVec3,
}

impl TextureSpace {
    /// From the scene to the world of the file.
    fn world_from_scene(&self) -> DMat4 {
        DMat4::from_translation(self.origin)
    }

    /// From the scene to the space of noise and cubes. pbrt-v3 does not invert the transformation.
    fn of_noise(&self, report: &Report) -> DMat4 {
        let matrix = match report.is_version4 {
            true => self.world_from_texture.inverse(),
            false => self.world_from_texture,
        };
        matrix * self.world_from_scene()
    }
}

impl Declaration {
    /// File name of the image, if the texture looks one up.
    pub fn image_name(&self) -> Option<&str> {
        (self.class.text == "imagemap").then_some(())?;
        image::file_name(&self.params)
    }
}

/// Handles `Texture "name" "type" "class"`.
pub(crate) fn define(
    state: &mut State,
    declaration: Declaration,
    images: &mut Images,
    report: &mut Report,
) {
    match declaration.value_type.text.as_str() {
        "float" => define_as::<f32>(state, declaration, images, report),
        "color" | "spectrum" => define_as::<Rgb>(state, declaration, images, report),
        unknown => report.error_help(
            declaration.value_type.span,
            format!("unknown texture type {unknown:?}"),
            "known: float, color, spectrum",
        ),
    }
}

fn define_as<T: Value>(
    state: &mut State,
    declaration: Declaration,
    images: &mut Images,
    report: &mut Report,
) {
    let Declaration { at, class, .. } = &declaration;
    let what = format!("texture {:?}", class.text);
    let mut lookup = Lookup::new(*at, what, &declaration.params);
    let mut values = Textured {
        lookup: &mut lookup,
        state,
        report,
    };
    let definition = build::<T>(&declaration, &mut values, images);
    lookup.finish(report);
    T::textures_mut(state).define(declaration.name.text, definition);
}

fn build<T: Value>(
    declaration: &Declaration,
    values: &mut Textured,
    images: &mut Images,
) -> Definition<T> {
    let class = &declaration.class;
    let space = &declaration.space;
    let texture = match class.text.as_str() {
        "constant" => return Definition::Known(Param::Constant(values.constant("value", 1.0))),
        "scale" => {
            let factors = [values.param("tex1", 1.0), values.param("tex2", 1.0)];
            if let [Param::Constant(a), Param::Constant(b)] = factors {
                return Definition::Known(Param::Constant(a * b));
            }
            Some(Texture::Scale(factors))
        }
        "mix" => {
            let ends = [values.param("tex1", 0.0), values.param("tex2", 1.0)];
            let amount = values.param("amount", 0.5);
            if let ([Param::Constant(a), Param::Constant(b)], Param::Constant(t)) = (&ends, &amount)
            {
                return Definition::Known(Param::Constant(*a * (1.0 - t) + *b * *t));
            }
            Some(Texture::Mix { ends, amount })
        }
        "checkerboard" => checkerboard(values, space),
        "directionmix" if values.report.is_version4 => {
            values.lookup.ignore_all();
            return Definition::Unsupported("directionmix".into());
        }
        "bilerp" => {
            let corners = [("v00", 0.0), ("v01", 1.0), ("v10", 0.0), ("v11", 1.0)];
            let corners = corners.map(|(name, default)| values.constant(name, default));
            let mapping = mapping::read(values.lookup, space, values.report);
            mapping.map(|mapping| Texture::Bilerp { corners, mapping })
        }
        "dots" => {
            // pbrt-v3 passes the two in the other order than it takes them.
            let dots = [values.param("inside", 1.0), values.param("outside", 0.0)];
            let mapping = mapping::read(values.lookup, space, values.report);
            mapping.map(|mapping| Texture::Dots { dots, mapping })
        }
        // pbrt-v3 has none of numbers, and says so where one is used.
        name @ ("marble" | "uv") if T::NAME == f32::NAME => {
            values.lookup.ignore_all();
            return Definition::Unsupported(format!("{name} of numbers"));
        }
        "fbm" | "marble" | "windy" | "wrinkled" => Some(Texture::Noise {
            pattern: pattern(&class.text, values),
            texture_from_world: space.of_noise(values.report),
        }),
        "uv" => mapping::read(values.lookup, space, values.report).map(Texture::Uv),
        "imagemap" => image_texture(values, space, images),
        name => {
            values.lookup.ignore_all();
            if UNSUPPORTED.contains(&name) {
                return Definition::Unsupported(name.to_owned());
            }
            values
                .report
                .unknown(class.span, "texture class", name, SUPPORTED);
            None
        }
    };
    match texture {
        Some(texture) if !parts::texture_fits(&texture) => {
            let most = parts::MAX_PARTS;
            let message = format!("a texture is made of more than {most} others");
            values.report.error_once(declaration.at, message, None);
            Definition::Broken
        }
        Some(texture) => Definition::Known(Param::Texture(Arc::new(texture))),
        None => Definition::Broken,
    }
}

fn checkerboard<T: Value>(values: &mut Textured, space: &TextureSpace) -> Option<Texture<T>> {
    let squares = [values.param("tex1", 1.0), values.param("tex2", 0.0)];
    let Textured { lookup, report, .. } = values;
    let dimension = lookup.integer_from("dimension", 2, 2, report);
    if dimension == 3 {
        return Some(Texture::Checkerboard3 {
            cubes: squares,
            texture_from_world: space.of_noise(report),
        });
    }
    if dimension > 3 {
        let message = format!("a checkerboard has 2 or 3 dimensions, found {dimension}");
        report.error(lookup.at, message);
        return None;
    }
    let modes = [("closedform", true), ("none", false)];
    let smooth = lookup.choice("aamode", modes, report);
    let mapping = mapping::read(lookup, space, report)?;
    Some(Texture::Checkerboard {
        squares,
        mapping,
        smooth,
    })
}

/// Pattern of noise of a class.
fn pattern(class: &str, values: &mut Textured) -> NoisePattern {
    match class {
        "fbm" => NoisePattern::Fbm(octaves(values)),
        "wrinkled" => NoisePattern::Wrinkled(octaves(values)),
        "marble" => NoisePattern::Marble {
            octaves: octaves(values),
            scale: values.constant("scale", 1.0),
            variation: values.constant("variation", 0.2),
        },
        _ => NoisePattern::Windy,
    }
}

fn octaves(values: &mut Textured) -> Octaves {
    let Textured { lookup, report, .. } = values;
    Octaves {
        count: lookup.integer_in("octaves", 8, [0, MAX_OCTAVES], report),
        roughness: lookup.float("roughness", 0.5, report),
    }
}

/// Image, in pbrt-v4 perhaps inverted. `None`: a mistake was reported.
fn image_texture<T: Value>(
    values: &mut Textured,
    space: &TextureSpace,
    images: &mut Images,
) -> Option<Texture<T>> {
    let texture = image_map(values, space, images).map(Texture::Image);
    let Textured { lookup, report, .. } = values;
    if !report.is_version4 || !lookup.bool("invert", false, report) {
        return texture;
    }
    let inverted = texture.map(T::inverted);
    if inverted.as_ref().is_some_and(Option::is_none) {
        report.unsupported(lookup.at, "\"invert\" of an image of colours is");
    }
    inverted.flatten()
}

fn image_map(
    values: &mut Textured,
    space: &TextureSpace,
    images: &mut Images,
) -> Option<ImageTexture> {
    let Textured { lookup, report, .. } = values;
    let image = images.of(lookup, "filename", report);
    let mapping = mapping::read(lookup, space, report);
    let wraps = [
        ("repeat", Wrap::Repeat),
        ("black", Wrap::Black),
        ("clamp", Wrap::Clamp),
    ];
    let wrap = lookup.choice("wrap", wraps, report);
    let max_anisotropy = lookup.float_in("maxanisotropy", 8.0, [1.0, f32::MAX], report);
    let filter = if lookup.bool("trilinear", false, report) {
        TextureFilter::Trilinear
    } else {
        TextureFilter::Ewa { max_anisotropy }
    };
    let scale = lookup.float("scale", 1.0, report);
    let is_encoded = image
        .as_ref()
        .is_some_and(|image| image::is_encoded(&image.name));
    let gamma = lookup.bool("gamma", is_encoded, report);
    Some(ImageTexture {
        image: image?,
        mapping: mapping?,
        wrap,
        filter,
        gamma,
        scale,
    })
}
