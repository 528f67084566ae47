//! Scenes of pbrt-v4: recognised by directives that version 3 does not have, and translated directive by directive where both mean
//! the same.
//!
//! The translation renames, so that messages name the version 3 counterpart. What does not map keeps its name, and is
//! refused by the reader of version 3 with its place.

use crate::directive::{Directive, Quoted};
use crate::lexer::{Lexer, TokenKind, is_binary};
use crate::params::{Param, ParamType, Params, Values};
use crate::report::Report;
use crate::source::Span;

/// Directives of version 4 alone.
const DIRECTIVES: &[&str] = &["Attribute", "ColorSpace", "Option"];
/// Names of version 4 alone, after their directives.
const KINDS: &[(&str, &[&str])] = &[
    ("Film", &["rgb", "gbuffer", "spectral"]),
    (
        "Integrator",
        &[
            "simplepath",
            "simplevolpath",
            "randomwalk",
            "lightpath",
            "function",
        ],
    ),
    (
        "Material",
        &[
            "coatedconductor",
            "coateddiffuse",
            "conductor",
            "dielectric",
            "diffuse",
            "diffusetransmission",
            "interface",
            "measured",
            "thindielectric",
        ],
    ),
    (
        "Sampler",
        &["independent", "paddedsobol", "pmj02bn", "zsobol"],
    ),
];

/// Names of version 3 alone, after their directives.
const OLD_KINDS: &[(&str, &[&str])] = &[
    ("Film", &["image"]),
    ("Integrator", &["directlighting", "whitted"]),
    (
        "Material",
        &[
            "disney",
            "fourier",
            "glass",
            "kdsubsurface",
            "matte",
            "metal",
            "mirror",
            "plastic",
            "substrate",
            "translucent",
            "uber",
        ],
    ),
    (
        "Sampler",
        &["02sequence", "lowdiscrepancy", "maxmindist", "random"],
    ),
];

/// Whether the file is a scene of pbrt-v4: the first directive that only one version has decides.
///
/// Comments, and strings in other places than the name of such a directive, change nothing. Included files are not
/// searched. Most scenes name their film or sampler at the beginning, where the search ends.
pub(crate) fn is_version4(report: &Report, file: u32) -> bool {
    if is_binary(&report.sources.file(file).bytes) {
        return false;
    }
    let mut lexer = Lexer::new(report, file);
    let mut directive: &[u8] = b"";
    while let Some(token) = lexer.scan() {
        let text = lexer.slice(token);
        if token.kind == TokenKind::Word && DIRECTIVES.iter().any(|name| name.as_bytes() == text) {
            return true;
        }
        if token.kind == TokenKind::Text {
            let kind = &text[1..text.len() - 1];
            if has(KINDS, directive, kind) {
                return true;
            }
            if has(OLD_KINDS, directive, kind) {
                return false;
            }
        }
        directive = match token.kind {
            TokenKind::Word => named(text),
            _ => b"",
        };
    }
    false
}

/// Whether a table has this name after this directive.
fn has(table: &[(&str, &[&str])], directive: &[u8], kind: &[u8]) -> bool {
    let mut rows = table.iter();
    rows.any(|(of, kinds)| {
        of.as_bytes() == directive && kinds.iter().any(|known| known.as_bytes() == kind)
    })
}

/// The directive that a word is, if its name tells the versions apart.
fn named(word: &[u8]) -> &'static [u8] {
    let mut names = KINDS.iter().map(|(of, _)| of.as_bytes());
    names.find(|of| *of == word).unwrap_or_default()
}

/// Says in one sentence that a scene is of version 4: before its mistakes, or as a note.
pub(crate) fn say(file: u32, report: &mut Report) {
    let start = Span {
        file,
        offset: 0,
        len: 1,
        line: 1,
    };
    if report.error_count() > 0 {
        report.error_help(
            start,
            "this is a scene of pbrt-v4, of which only what means the same in pbrt-v3 is read",
            "what is named below does not map; docs/src/pbrt-support.md has the list",
        );
    } else {
        report.note(
            start,
            "this is a scene of pbrt-v4, read by what means the same in pbrt-v3",
        );
    }
}

/// Directive of version 3 that means the same.
pub(crate) fn translate(directive: Directive, report: &mut Report) -> Directive {
    use Directive as D;
    match directive {
        D::Film(mut kind, mut params) => {
            if kind.text == "rgb" {
                kind.text = "image".into();
                params.drop("savefp16");
                if params.string("sensor") == Some("cie1931") {
                    params.drop("sensor");
                }
            }
            D::Film(kind, params)
        }
        D::PixelFilter(kind, mut params) => {
            params.rename("xradius", "xwidth");
            params.rename("yradius", "ywidth");
            if kind.text == "gaussian" {
                let sigma = params.take_float("sigma").unwrap_or(0.5);
                params.set_float("alpha", 1.0 / (2.0 * sigma * sigma), kind.span);
                for side in ["xwidth", "ywidth"] {
                    params.default_float(side, 1.5, kind.span);
                }
            }
            D::PixelFilter(kind, params)
        }
        D::Sampler(mut kind, mut params) => {
            let name = match kind.text.as_str() {
                "independent" => "random",
                "zsobol" | "paddedsobol" | "pmj02bn" => "02sequence",
                name => name,
            };
            kind.text = name.to_owned();
            // Both change noise, not the picture.
            params.drop("randomization");
            params.drop("seed");
            if kind.text == "random" {
                params.default_integer("pixelsamples", 16, kind.span);
            }
            D::Sampler(kind, params)
        }
        D::Integrator(mut kind, mut params) => {
            if matches!(
                kind.text.as_str(),
                "volpath" | "simplepath" | "simplevolpath" | "path"
            ) {
                kind.text = "path".into();
                for noise in ["lightsampler", "samplelights", "samplebsdf"] {
                    params.drop(noise);
                }
                if params.bool("regularize") == Some(false) {
                    params.drop("regularize");
                }
            }
            D::Integrator(kind, params)
        }
        D::Material(mut kind, mut params) => {
            kind.text = material(&kind.text, &mut params, kind.span, report);
            D::Material(kind, params)
        }
        D::MakeNamedMaterial(name, mut params) => {
            if let Some(kind) = params.string("type").map(str::to_owned) {
                let kind = material(&kind, &mut params, name.span, report);
                params.set_string("type", kind);
            }
            D::MakeNamedMaterial(name, params)
        }
        D::Texture {
            name,
            value_type,
            class,
            mut params,
        } => {
            texture(&class, &mut params, report);
            D::Texture {
                name,
                value_type,
                class,
                params,
            }
        }
        D::LightSource(kind, mut params) => {
            params.widen("scale");
            if kind.text == "infinite"
                && let Some(image) = params.find("filename")
            {
                let place = image.declaration;
                report.unsupported(place, "equal-area environments of pbrt-v4 are");
                params.drop("filename");
            }
            D::LightSource(kind, params)
        }
        D::AreaLightSource(kind, mut params) => {
            params.widen("scale");
            D::AreaLightSource(kind, params)
        }
        D::Shape(kind, params) => {
            let alpha = params.find("alpha").filter(|alpha| match &alpha.values {
                Values::Floats(values) => values.iter().any(|value| *value > 0.0 && *value < 1.0),
                _ => false,
            });
            if let Some(alpha) = alpha {
                report.unsupported(alpha.declaration, "alpha between 0 and 1 is");
            }
            D::Shape(kind, params)
        }
        other => other,
    }
}

/// Materials of version 4 without an equal in version 3, or with one that is not supported.
const UNSUPPORTED_MATERIALS: &[&str] = &[
    "coatedconductor",
    "diffusetransmission",
    "hair",
    "measured",
    "subsurface",
    "thindielectric",
];

/// Renames the parameters of a material, and returns its name in version 3.
fn material(kind: &str, params: &mut Params, at: Span, report: &mut Report) -> String {
    let name = match kind {
        "diffuse" => {
            params.rename("reflectance", "Kd");
            "matte"
        }
        "coateddiffuse" => {
            params.rename("reflectance", "Kd");
            params.set_rgb("Ks", [0.04; 3], at);
            roughness(params, 0.0, at, report);
            for inside in ["thickness", "nsamples", "maxdepth"] {
                params.drop(inside);
            }
            report.note(
                at,
                "coateddiffuse is rendered as substrate: light is not traced between coat and base, so colours are less \
                 saturated",
            );
            "substrate"
        }
        "dielectric" => {
            roughness(params, 0.0, at, report);
            "glass"
        }
        "conductor" => {
            for name in ["eta", "k"] {
                let copper = format!("metal-Cu-{name}");
                if params.string_of(name, ParamType::Spectrum) == Some(&copper) {
                    params.drop(name);
                }
            }
            conductor_of_reflectance(params, at);
            roughness(params, 0.0, at, report);
            "metal"
        }
        "interface" => "",
        other => {
            if UNSUPPORTED_MATERIALS.contains(&other) {
                report.unsupported(at, format!("material {other:?} of pbrt-v4 is"));
                params.list.retain(|param| param.name == "type");
                "matte"
            } else {
                other
            }
        }
    };
    params.rename("displacement", "bumpmap");
    name.to_owned()
}

/// Index 1 and the absorption that reflects so much straight on, as in pbrt-v4. A texture keeps its name, and is refused.
fn conductor_of_reflectance(params: &mut Params, at: Span) {
    let Some(Values::Floats(values)) = params.find("reflectance").map(|param| &param.values) else {
        return;
    };
    let Ok(color) = <[f32; 3]>::try_from(&values[..]) else {
        return;
    };
    params.drop("reflectance");
    let absorption = color.map(|r| {
        let r = r.clamp(0.0, 0.9999);
        2.0 * r.sqrt() / (1.0 - r).sqrt()
    });
    params.set_rgb("eta", [1.0; 3], at);
    params.set_rgb("k", absorption, at);
}

/// Makes microfacet alphas of roughnesses: in version 4 their square roots.
fn roughness(params: &mut Params, default: f32, at: Span, report: &mut Report) {
    let remap = params.bool("remaproughness").unwrap_or(true);
    params.drop("remaproughness");
    let both = params.take_float("roughness");
    for name in ["uroughness", "vroughness"] {
        if let Some(texture) = params.find(name).or(params.find("roughness"))
            && texture.param_type == ParamType::Texture
            && remap
        {
            let place = texture.declaration;
            report.unsupported(place, "textures of remapped roughness of pbrt-v4 are");
            return;
        }
        let value = params.take_float(name).or(both).unwrap_or(default);
        let alpha = if remap { value.max(0.0).sqrt() } else { value };
        params.set_float(name, alpha, at);
    }
    params.set_bool("remaproughness", false, at);
}

fn texture(class: &Quoted, params: &mut Params, report: &mut Report) {
    match class.text.as_str() {
        "imagemap" => {
            let gamma = match params.string("encoding") {
                Some("sRGB") => Some(true),
                Some("linear") => Some(false),
                _ => None,
            };
            if let Some(gamma) = gamma {
                params.drop("encoding");
                params.set_bool("gamma", gamma, class.span);
            }
            if params.find("filter").is_some() {
                params.drop("filter");
                report.note(
                    class.span,
                    "the filter of image maps is left out: they are filtered by pbrt-v3's default",
                );
            }
        }
        "scale" => {
            params.rename("tex", "tex1");
            params.rename("scale", "tex2");
        }
        _ => {}
    }
}

impl Params {
    fn find(&self, name: &str) -> Option<&Param> {
        self.list.iter().find(|param| param.name == name)
    }

    fn drop(&mut self, name: &str) {
        self.list.retain(|param| param.name != name);
    }

    fn rename(&mut self, from: &str, to: &str) {
        for param in &mut self.list {
            if param.name == from {
                to.clone_into(&mut param.name);
            }
        }
    }

    fn string(&self, name: &str) -> Option<&str> {
        self.string_of(name, ParamType::String)
    }

    fn string_of(&self, name: &str, param_type: ParamType) -> Option<&str> {
        let param = self
            .find(name)
            .filter(|param| param.param_type == param_type)?;
        match &param.values {
            Values::Strings(texts) => texts.first().map(String::as_str),
            _ => None,
        }
    }

    fn bool(&self, name: &str) -> Option<bool> {
        match &self.find(name)?.values {
            Values::Bools(values) => values.first().copied(),
            _ => None,
        }
    }

    /// Removes a single number.
    fn take_float(&mut self, name: &str) -> Option<f32> {
        let found = match (self.find(name)?.param_type, &self.find(name)?.values) {
            (ParamType::Float, Values::Floats(values)) => values.first().copied(),
            _ => None,
        };
        if found.is_some() {
            self.drop(name);
        }
        found
    }

    fn set(&mut self, name: &str, param_type: ParamType, values: Values, at: Span) {
        self.drop(name);
        self.list.push(Param {
            param_type,
            name: name.to_owned(),
            declaration: at,
            values,
            list: at,
            value: at,
        });
    }

    fn set_float(&mut self, name: &str, value: f32, at: Span) {
        self.set(name, ParamType::Float, Values::Floats(vec![value]), at);
    }

    fn set_rgb(&mut self, name: &str, value: [f32; 3], at: Span) {
        self.set(name, ParamType::Rgb, Values::Floats(value.to_vec()), at);
    }

    fn set_bool(&mut self, name: &str, value: bool, at: Span) {
        self.set(name, ParamType::Bool, Values::Bools(vec![value]), at);
    }

    fn set_string(&mut self, name: &str, value: String) {
        for param in &mut self.list {
            if param.name == name {
                param.values = Values::Strings(vec![value.clone()]);
            }
        }
    }

    fn default_float(&mut self, name: &str, value: f32, at: Span) {
        if self.find(name).is_none() {
            self.set_float(name, value, at);
        }
    }

    fn default_integer(&mut self, name: &str, value: i32, at: Span) {
        if self.find(name).is_none() {
            self.set(name, ParamType::Integer, Values::Integers(vec![value]), at);
        }
    }

    /// Makes a colour of a number.
    fn widen(&mut self, name: &str) {
        for param in &mut self.list {
            if param.name == name
                && param.param_type == ParamType::Float
                && let Values::Floats(values) = &mut param.values
                && let [value] = values[..]
            {
                param.param_type = ParamType::Rgb;
                *values = vec![value; 3];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(text: &str) -> bool {
        let mut report = Report::default();
        let path = std::path::Path::new("scene.pbrt");
        let file = report.sources.take(path, text.into()).expect("a text");
        is_version4(&report, file)
    }

    #[test]
    fn versions_are_told_apart() {
        for text in [
            "Film \"rgb\"",
            "WorldBegin\nMaterial   \"diffuse\"",
            "Material # in a comment \"matte\"\n\"diffuse\"",
            "Attribute \"shape\" \"float radius\" 2",
            "Sampler\t\"zsobol\"",
            "Sampler\"zsobol\"",
            "ColorSpace \"srgb\"",
            "Film \"rgb\" Material \"matte\"",
        ] {
            assert!(told(text), "{text}");
        }
        for text in [
            "",
            "Film \"image\"",
            "AreaLightSource \"diffuse\"",
            "# Material \"diffuse\"",
            "AttributeBegin",
            "Texture \"diffuse\" \"color\" \"constant\"",
            "Material \"matte\" \"texture Kd\" \"diffuse\"",
            "\"string filename\" \"my Option file.png\"",
            "\"string filename\" \"Film\" \"rgb\"",
            "Texture \"a\" \"color\" \"imagemap\" \"string filename\" [ \"Material\" \"diffuse\" ]",
            "Film \"image\" Material \"diffuse\"",
            "\"Option",
            "\"",
        ] {
            assert!(!told(text), "{text}");
        }
    }
}
