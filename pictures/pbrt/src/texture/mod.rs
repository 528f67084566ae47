//! Directives for textures, and parameters that may name a texture, with the defaults of pbrt-v3.
//!
//! Constant textures become values, and so do their products and mixtures. A texture of an unsupported class may be
//! defined, but its use is an error.
//!
//! - `image`: images that textures and lights look up, each read once
//! - `mapping`: maps from surfaces to texture coordinates

mod image;
mod mapping;

use std::ops::{Add, Deref, DerefMut, Mul};
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
pub(crate) struct Textured<'a> {
    pub lookup: Lookup<'a>,
    pub state: &'a State,
}

impl<'a> Deref for Textured<'a> {
    type Target = Lookup<'a>;

    fn deref(&self) -> &Self::Target {
        &self.lookup
    }
}

impl DerefMut for Textured<'_> {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.lookup
    }
}

impl Textured<'_> {
    /// Finds a parameter with the place of its value. `None`: it is not given, or a mistake was reported.
    pub fn textured<T: Value>(&mut self, name: &'static str) -> Option<(Param<T>, Span)> {
        let param = self.find(name, T::TYPES_OR_TEXTURE)?;
        let value = match param.param_type {
            ParamType::Texture => self.resolve(param)?,
            _ => Param::Constant(T::read(param, self.report)?),
        };
        Some((value, param.value))
    }

    /// Parameter, or the default.
    pub fn param<T: Value>(&mut self, name: &'static str, default: f32) -> Param<T> {
        let found = self.textured(name);
        found.map_or(Param::Constant(T::splat(default)), |(value, _)| value)
    }

    /// Parameter that cannot be a texture, or the default.
    fn constant<T: Value>(&mut self, name: &'static str, default: f32) -> T {
        let found = self.find(name, T::TYPES);
        let value = found.and_then(|param| T::read(param, self.report));
        value.unwrap_or(T::splat(default))
    }

    /// Finds the texture that a parameter names. `None`: it is unknown or unsupported, which was reported.
    fn resolve<T: Value>(&mut self, param: &params::Param) -> Option<Param<T>> {
        let name = one_string(param, self.report)?;
        let textures = T::textures(self.state);
        match textures.get(name) {
            Some(Definition::Known(value)) => Some(value.clone()),
            Some(Definition::Unsupported(class)) => self
                .report
                .refuse(param.value, format!("textures of class {class:?} are")),
            None if !self.report.is_counted_only() => {
                let message = format!("no {} texture is named {name:?} here", T::NAME);
                let help = suggest::help(name, &textures.names());
                self.report.fail_help(param.value, message, help)
            }
            Some(Definition::Broken) | None => None,
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
    let Quoted { text, span } = &declaration.value_type;
    match text.as_str() {
        "float" => define_as::<f32>(state, declaration, images, report),
        "color" | "spectrum" => define_as::<Rgb>(state, declaration, images, report),
        unknown => {
            let message = format!("unknown texture type {unknown:?}");
            report.error_help(*span, message, "known: float, color, spectrum");
        }
    }
}

fn define_as<T: Value>(
    state: &mut State,
    declaration: Declaration,
    images: &mut Images,
    report: &mut Report,
) {
    let Declaration {
        at, class, params, ..
    } = &declaration;
    let mut values = Textured {
        lookup: Lookup::new("texture", *at, class, params, report),
        state,
    };
    let definition = match class.text.as_str() {
        "constant" => Definition::Known(Param::Constant(values.constant::<T>("value", 1.0))),
        class => match refused::<T>(class, &values) {
            Some(refused) => {
                values.ignore_all();
                Definition::Unsupported(refused)
            }
            None => match build(&mut values, &declaration.space, images) {
                Some(value) => Definition::Known(value),
                None => Definition::Broken,
            },
        },
    };
    values.lookup.finish();
    T::textures_mut(state).define(declaration.name.text, definition);
}

/// Name for a class of textures that is known but not supported.
fn refused<T: Value>(class: &str, values: &Textured) -> Option<String> {
    match class {
        // pbrt-v3 has none of numbers, and says so where one is used.
        "marble" | "uv" if T::NAME == f32::NAME => Some(format!("{class} of numbers")),
        "directionmix" if values.is_version4() => Some(class.to_owned()),
        _ => UNSUPPORTED.contains(&class).then(|| class.to_owned()),
    }
}

/// Reads a texture of a supported class, or a value where its parts are values. `None`: a mistake was reported.
fn build<T: Value>(
    values: &mut Textured,
    space: &TextureSpace,
    images: &mut Images,
) -> Option<Param<T>> {
    let texture = match values.kind.text.as_str() {
        "scale" => {
            let factors = [values.param("tex1", 1.0), values.param("tex2", 1.0)];
            if let [Param::Constant(a), Param::Constant(b)] = factors {
                return Some(Param::Constant(a * b));
            }
            Texture::Scale(factors)
        }
        "mix" => {
            let ends = [values.param("tex1", 0.0), values.param("tex2", 1.0)];
            let amount = values.param("amount", 0.5);
            if let ([Param::Constant(a), Param::Constant(b)], Param::Constant(t)) = (&ends, &amount)
            {
                return Some(Param::Constant(*a * (1.0 - t) + *b * *t));
            }
            Texture::Mix { ends, amount }
        }
        "checkerboard" => checkerboard(values, space)?,
        "bilerp" => {
            let corners = [("v00", 0.0), ("v01", 1.0), ("v10", 0.0), ("v11", 1.0)];
            Texture::Bilerp {
                corners: corners.map(|(name, default)| values.constant(name, default)),
                mapping: mapping::read(values, space)?,
            }
        }
        // pbrt-v3 passes the two in the other order than it takes them.
        "dots" => Texture::Dots {
            dots: [values.param("inside", 1.0), values.param("outside", 0.0)],
            mapping: mapping::read(values, space)?,
        },
        "fbm" | "marble" | "windy" | "wrinkled" => Texture::Noise {
            pattern: pattern(values),
            texture_from_world: space.of_noise(values.report),
        },
        "uv" => Texture::Uv(mapping::read(values, space)?),
        "imagemap" => image_texture(values, space, images)?,
        name => {
            values.ignore_all();
            let span = values.kind.span;
            values
                .report
                .unknown(span, "texture class", name, SUPPORTED);
            return None;
        }
    };
    if !parts::texture_fits(&texture) {
        let most = parts::MAX_PARTS;
        let message = format!("a texture is made of more than {most} others");
        let at = values.at;
        values.report.error_once(at, message, None);
        return None;
    }
    Some(Param::Texture(Arc::new(texture)))
}

fn checkerboard<T: Value>(values: &mut Textured, space: &TextureSpace) -> Option<Texture<T>> {
    let squares = [values.param("tex1", 1.0), values.param("tex2", 0.0)];
    let dimension = values.integer_from("dimension", 2, 2);
    if dimension == 3 {
        return Some(Texture::Checkerboard3 {
            cubes: squares,
            texture_from_world: space.of_noise(values.report),
        });
    }
    if dimension > 3 {
        return values.fail(format!(
            "a checkerboard has 2 or 3 dimensions, found {dimension}"
        ));
    }
    let modes = [("closedform", true), ("none", false)];
    Some(Texture::Checkerboard {
        squares,
        smooth: values.choice("aamode", modes),
        mapping: mapping::read(values, space)?,
    })
}

/// Pattern of a class of noise.
fn pattern(values: &mut Textured) -> NoisePattern {
    match values.kind.text.as_str() {
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

fn octaves(values: &mut Lookup) -> Octaves {
    Octaves {
        count: values.integer_in("octaves", 8, [0, MAX_OCTAVES]),
        roughness: values.float("roughness", 0.5),
    }
}

/// Image, in pbrt-v4 perhaps inverted. `None`: a mistake was reported.
fn image_texture<T: Value>(
    values: &mut Textured,
    space: &TextureSpace,
    images: &mut Images,
) -> Option<Texture<T>> {
    let texture = image_map(values, space, images).map(Texture::Image);
    if !values.is_version4() || !values.bool("invert", false) {
        return texture;
    }
    match T::inverted(texture?) {
        None => values.refuse("\"invert\" of an image of colours is"),
        inverted => inverted,
    }
}

fn image_map(
    lookup: &mut Lookup,
    space: &TextureSpace,
    images: &mut Images,
) -> Option<ImageTexture> {
    let image = images.of(lookup, "filename");
    let mapping = mapping::read(lookup, space);
    let wraps = [
        ("repeat", Wrap::Repeat),
        ("black", Wrap::Black),
        ("clamp", Wrap::Clamp),
    ];
    let wrap = lookup.choice("wrap", wraps);
    let max_anisotropy = lookup.float_in("maxanisotropy", 8.0, [1.0, f32::MAX]);
    let filter = if lookup.bool("trilinear", false) {
        TextureFilter::Trilinear
    } else {
        TextureFilter::Ewa { max_anisotropy }
    };
    let scale = lookup.float("scale", 1.0);
    let is_encoded = (image.as_ref()).is_some_and(|image| image::is_encoded(&image.name));
    let gamma = lookup.bool("gamma", is_encoded);
    Some(ImageTexture {
        image: image?,
        mapping: mapping?,
        wrap,
        filter,
        gamma,
        scale,
    })
}
