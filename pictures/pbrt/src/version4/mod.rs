//! Scenes of pbrt-v4: recognised by directives that version 3 does not have, and translated directive by directive where both mean
//! the same.
//!
//! The translation renames, so that messages name the version 3 counterpart. What does not map keeps its name, and is
//! read by name or refused with its place. `edit` changes lists of parameters.

mod edit;

use std::sync::Arc;

use glam::DMat3;

use crate::directive::{Directive, Quoted};
use crate::lexer::{Lexer, TokenKind, is_binary};
use crate::material::version4::SUPPORTED;
use crate::params::{ParamType, Params, Values};
use crate::report::Report;
use crate::source::Span;
use crate::state::State;
use crate::texture::{self, TextureSpace};

/// Directives that only version 4 has.
pub(crate) const DIRECTIVES: &[&str] = &["Attribute", "ColorSpace", "Import", "Option"];
/// Directive, whether its names are of version 4, and names that only that version has.
const KINDS: &[(&str, bool, &[&str])] = &[
    ("Film", true, &["rgb", "gbuffer", "spectral"]),
    ("Film", false, &["image"]),
    (
        "Integrator",
        true,
        &["simplepath", "simplevolpath", "randomwalk"],
    ),
    ("Integrator", true, &["lightpath", "function"]),
    ("Integrator", false, &["directlighting", "whitted"]),
    ("Material", true, SUPPORTED),
    ("Material", true, &["interface", "measured"]),
    (
        "Material",
        false,
        &["disney", "fourier", "glass", "matte", "metal", "mirror"],
    ),
    ("Material", false, &["kdsubsurface", "plastic", "substrate"]),
    ("Material", false, &["translucent", "uber"]),
    (
        "Sampler",
        true,
        &["independent", "paddedsobol", "pmj02bn", "zsobol"],
    ),
    (
        "Sampler",
        false,
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
    let mut before = None;
    while let Some(token) = lexer.scan() {
        let text = lexer.slice(token);
        match (token.kind, before) {
            (TokenKind::Word, _) if DIRECTIVES.iter().any(|name| name.as_bytes() == text) => {
                return true;
            }
            (TokenKind::Text, Some(word)) => {
                let kind = &text[1..text.len() - 1];
                if let Some(is_version4) = version_of(lexer.slice(word), kind) {
                    return is_version4;
                }
            }
            _ => {}
        }
        before = (token.kind == TokenKind::Word).then_some(token);
    }
    false
}

/// Whether this name after this directive is of version 4, if only one version has it.
fn version_of(directive: &[u8], kind: &[u8]) -> Option<bool> {
    let is_kind = |name: &&str| name.as_bytes() == kind;
    let mut rows = KINDS.iter();
    let row = rows.find(|(of, _, names)| of.as_bytes() == directive && names.iter().any(is_kind));
    row.map(|(_, is_version4, _)| *is_version4)
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
        let message = "this is a scene of pbrt-v4, of which not everything is read";
        let help = "errors name what is not read; docs/src/pbrt-support.md has the list";
        report.error_help(start, message, help);
    } else {
        let message = "this is a scene of pbrt-v4; docs/src/pbrt-support.md lists what differs";
        report.note(start, message);
    }
}

/// Makes a directive of version 3 that means the same.
pub(crate) fn translate(directive: &mut Directive, report: &mut Report) {
    use Directive as D;
    match directive {
        D::Film(kind, params) => film(kind, params, report),
        D::PixelFilter(kind, params) => {
            params.rename("xradius", "xwidth");
            params.rename("yradius", "ywidth");
            if kind.text == "gaussian" {
                let sigma = params.take_float("sigma").unwrap_or(0.5);
                params.set_float("alpha", 1.0 / (2.0 * sigma * sigma), kind.span);
                for side in ["xwidth", "ywidth"] {
                    params.default_float(side, 1.5, kind.span);
                }
            }
        }
        D::Sampler(kind, params) => {
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
        }
        D::Integrator(kind, params) => integrator(kind, params, report),
        D::Material(kind, params) => material(kind, params, report),
        D::MakeNamedMaterial(name, params) => {
            if let Some(text) = params.string("type").map(str::to_owned) {
                let span = params.find("type").map_or(name.span, |param| param.value);
                let mut kind = Quoted { text, span };
                material(&mut kind, params, report);
                params.set_string("type", kind.text);
            }
        }
        D::MakeNamedMedium(_, params) => medium(params, report),
        D::Texture(_, _, class, params) => image_or_scale(class, params, report),
        D::LightSource(kind, params) => {
            params.widen("scale");
            if kind.text == "projection" {
                params.rename("filename", "mapname");
                params.default_float("fov", 90.0, kind.span);
            }
        }
        D::AreaLightSource(_, params) => params.widen("scale"),
        _ => {}
    }
}

/// Parameters of films that change no picture here.
fn film(kind: &mut Quoted, params: &mut Params, report: &mut Report) {
    if !matches!(kind.text.as_str(), "rgb" | "gbuffer") {
        return;
    }
    if kind.text == "gbuffer" {
        params.drop("coordinatesystem");
        let message =
            "layers of film \"gbuffer\" are written by --layers; the picture is that of \"rgb\"";
        report.note(kind.span, message);
    }
    kind.text = "image".into();
    params.drop("savefp16");
    if let Some(sensor) = params.string("sensor").map(str::to_owned) {
        if sensor != "cie1931" {
            let message =
                format!("sensor {sensor:?} is taken as \"cie1931\": colours differ a little");
            report.note(kind.span, message);
        }
        params.drop("sensor");
    }
    match params.take_float("whitebalance") {
        None | Some(0.0 | 6500.0) => {}
        Some(kelvin) => {
            let message = format!(
                "the white balance of {kelvin} K is left out: the picture has the colours of its lights"
            );
            report.note(kind.span, message);
        }
    }
    let speed = params.take_float("iso").unwrap_or(100.0);
    if !(speed > 0.0 && speed.is_finite()) {
        let message = format!("\"iso\" must be positive, found {speed}");
        report.error(kind.span, message);
    }
    params.set_float("scale", speed / 100.0, kind.span);
    if let Some(most) = params.take_float("maxcomponentvalue") {
        let message = "\"maxcomponentvalue\" limits the luminance of a sample instead of its largest component";
        report.note(kind.span, message);
        params.set_float("maxsampleluminance", most, kind.span);
    }
}

fn integrator(kind: &mut Quoted, params: &mut Params, report: &mut Report) {
    let name = match kind.text.as_str() {
        "path" | "simplepath" => "path",
        "volpath" | "simplevolpath" | "randomwalk" | "lightpath" => "volpath",
        "ambientocclusion" | "ao" => {
            if let Some(distance) = params.find("maxdistance") {
                let place = distance.declaration;
                report.unsupported(place, "\"maxdistance\" of an integrator is");
                params.drop("maxdistance");
            }
            return;
        }
        _ => return,
    };
    if kind.text == "lightpath" {
        let message = "integrator \"lightpath\" is taken as \"volpath\"";
        report.note(kind.span, message);
    }
    kind.text = name.into();
    for noise in [
        "lightsampler",
        "samplelights",
        "samplebsdf",
        "sampleallights",
    ] {
        params.drop(noise);
    }
    if params.bool("regularize") == Some(true) {
        let message = "\"regularize\" is left out: nothing is made rougher against noise";
        report.note(kind.span, message);
    }
    params.drop("regularize");
}

/// Renames parameters of a material, and its kind where version 3 has it under another name.
fn material(kind: &mut Quoted, params: &mut Params, report: &mut Report) {
    params.rename("displacement", "bumpmap");
    match kind.text.as_str() {
        "interface" => kind.text = "none".into(),
        "measured" => {
            report.unsupported(kind.span, "material \"measured\" of pbrt-v4 is");
            refuse(kind, params);
        }
        "hair" => params.rename("reflectance", "color"),
        "subsurface" => {
            // Roughness is mapped by a square root, and a texture of it is none of version 3.
            alphas(params, kind.span, report);
            if params.find("reflectance").is_some() {
                params.rename("reflectance", "Kd");
                kind.text = "kdsubsurface".into();
            }
        }
        "mix" => {
            let named = match params
                .find("materials")
                .map(|param| (&param.values, param.list))
            {
                Some((Values::Strings(names), _)) if names.len() == 2 => Ok(names.clone()),
                Some((_, place)) => Err(place),
                None => Err(kind.span),
            };
            params.drop("materials");
            match named {
                // The amount is the share of the second.
                Ok(names) => {
                    for (name, to) in names.iter().zip(["namedmaterial2", "namedmaterial1"]) {
                        params.set_text(to, name, kind.span);
                    }
                }
                Err(place) => {
                    report.error(place, "\"materials\" of a mix are two names");
                    refuse(kind, params);
                }
            }
        }
        _ => {}
    }
}

/// Makes a matte material of one that was reported, so that no further mistakes follow.
fn refuse(kind: &mut Quoted, params: &mut Params) {
    params.list.retain(|param| param.name == "type");
    kind.text = "matte".into();
}

/// Makes microfacet alphas of roughnesses: in version 4 their square roots.
fn alphas(params: &mut Params, at: Span, report: &mut Report) {
    let remap = params.bool("remaproughness").unwrap_or(true);
    params.drop("remaproughness");
    let both = params.take_float("roughness");
    for name in ["uroughness", "vroughness"] {
        if let Some(texture) = params.find(name).or(params.find("roughness"))
            && texture.param_type == ParamType::Texture
        {
            let place = texture.declaration;
            report.unsupported(place, "a texture of the roughness of \"subsurface\" is");
            return;
        }
        let value = params.take_float(name).or(both).unwrap_or(0.0);
        let alpha = if remap { value.max(0.0).sqrt() } else { value };
        params.set_float(name, alpha, at);
    }
    params.set_bool("remaproughness", false, at);
}

fn medium(params: &mut Params, report: &mut Report) {
    if params.string("type") == Some("uniformgrid") {
        params.set_string("type", "heterogeneous".into());
        let at = params.find("type").map(|param| param.declaration);
        for name in ["sigma_a", "sigma_s"] {
            if let Some(at) = at
                && params.find(name).is_none()
                && params.find("preset").is_none()
            {
                params.set_rgb(name, [1.0; 3], at);
            }
        }
    }
    for name in ["Le", "Lescale", "temperature", "temperaturescale"] {
        if let Some(param) = params.find(name) {
            let place = param.declaration;
            report.unsupported(place, format!("{name:?} of a medium is"));
            params.drop(name);
        }
    }
}

fn image_or_scale(class: &mut Quoted, params: &mut Params, report: &mut Report) {
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
                let message =
                    "the filter of image maps is left out: they are filtered by pbrt-v3's default";
                report.note(class.span, message);
            }
        }
        // The factor is a number in version 4, also for textures of colours.
        "scale" => {
            class.text = "mix".into();
            params.rename("tex", "tex2");
            params.rename("scale", "amount");
            params.default_float("amount", 1.0, class.span);
        }
        _ => {}
    }
}

/// Directive with the values that `Attribute` directives give for its group.
pub(crate) fn fill(directive: &mut Directive, state: &State) {
    use Directive as D;
    let group = match directive {
        D::Shape(..) => "shape",
        D::LightSource(..) | D::AreaLightSource(..) => "light",
        D::Material(..) | D::MakeNamedMaterial(..) => "material",
        D::MakeNamedMedium(..) => "medium",
        D::Texture(..) => "texture",
        _ => return,
    };
    if let Some(params) = directive.params_mut() {
        let newest_first = state.now.attributes.iter().rev();
        for (_, attributes) in newest_first.filter(|(of, _)| of == group) {
            params.fill(attributes);
        }
    }
}

/// Time during which the shutter of a camera is open. The film multiplies pixels by it.
pub(crate) fn exposure(params: &Params, at: Span, report: &mut Report) -> f32 {
    let time = |name: &str, default: f32| match params.find(name).map(|param| &param.values) {
        Some(Values::Floats(values)) => values.first().copied().unwrap_or(default),
        _ => default,
    };
    let exposure = time("shutterclose", 1.0) - time("shutteropen", 0.0);
    if exposure > 0.0 && exposure.is_finite() {
        return exposure;
    }
    let message =
        format!("the shutter of the camera is open for {exposure}, not for a positive time");
    report.error(at, message);
    1.0
}

/// Takes the image that "normalmap" names out of a material, as the declaration of a texture that the material names instead.
pub(crate) fn normal_map(
    params: &mut Params,
    at: Span,
    space: TextureSpace,
) -> Option<texture::Declaration> {
    let file = params.string("normalmap")?.to_owned();
    let place = params.find("normalmap").map_or(at, |param| param.value);
    // No texture of a file has a line break in its name.
    let name = format!("normalmap\n{file}");
    params.set_texture("normalmap", &name, place);
    let mut image = Params::default();
    image.set_text("filename", &file, place);
    image.set_bool("gamma", false, place);
    let quoted = |text: &str| Quoted {
        text: text.into(),
        span: place,
    };
    Some(texture::Declaration {
        at: place,
        name: quoted(&name),
        value_type: quoted("spectrum"),
        class: quoted("imagemap"),
        params: image,
        space,
    })
}

/// Chromaticities of the primaries and of white of a colour space, as in its standard.
type Primaries = [[f64; 2]; 4];

/// White of daylight (CIE D65).
const D65: [f64; 2] = [0.31271, 0.32902];

const COLOR_SPACES: &[(&str, Primaries)] = &[
    (
        "aces2065-1",
        [
            [0.7347, 0.2653],
            [0.0, 1.0],
            [0.0001, -0.077],
            [0.32168, 0.33767],
        ],
    ),
    (
        "dci-p3",
        [[0.680, 0.320], [0.265, 0.690], [0.150, 0.060], D65],
    ),
    (
        "rec2020",
        [[0.708, 0.292], [0.170, 0.797], [0.131, 0.046], D65],
    ),
    (
        "srgb",
        [[0.640, 0.330], [0.300, 0.600], [0.150, 0.060], D65],
    ),
];

/// Handles `ColorSpace`: the matrix to linear sRGB. `None` for sRGB, and for an unknown name, which was reported.
pub(crate) fn color_space(name: &Quoted, report: &mut Report) -> Option<DMat3> {
    let Some((known, primaries)) = COLOR_SPACES.iter().find(|(known, _)| *known == name.text)
    else {
        let known: Vec<&str> = COLOR_SPACES.iter().map(|(known, _)| *known).collect();
        report.unknown(name.span, "colour space", &name.text, &known);
        return None;
    };
    (*known != "srgb").then(|| {
        let [red, green, blue, white] = primaries.map(crate::spectrum::from_chromaticity);
        let matrix = DMat3::from_cols(red, green, blue);
        let share = matrix.inverse() * white;
        // White, the sum of the primaries, stays white, whatever its colour.
        DMat3::from_diagonal(white.recip()) * matrix * DMat3::from_diagonal(share)
    })
}

/// Groups of directives that an `Attribute` may name.
const GROUPS: &[&str] = &["light", "material", "medium", "shape", "texture"];

/// Handles `Attribute "group"`.
pub(crate) fn attribute(group: Quoted, params: Params, state: &mut State, report: &mut Report) {
    if GROUPS.contains(&group.text.as_str()) {
        state.now.attributes.push((group.text, Arc::new(params)));
    } else {
        report.unknown(group.span, "group of attributes", &group.text, GROUPS);
    }
}

/// Options that change noise, time or output, and no picture.
const OPTIONS_LEFT_OUT: &[&str] = &[
    "disablewavelengthjitter",
    "fullscreen",
    "msereferenceimage",
    "msereferenceout",
    "pixelstats",
    "rendercoordsys",
    "seed",
    "wavefront",
];

/// Handles `Option`.
pub(crate) fn option(params: &Params, report: &mut Report) {
    for param in &params.list {
        let name = param.name.as_str();
        if OPTIONS_LEFT_OUT.contains(&name) {
            let message = format!("option {name:?} is left out: it changes no picture");
            report.note(param.declaration, message);
        } else if param.values != Values::Bools(vec![false]) {
            report.unsupported(param.declaration, format!("option {name:?} is"));
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
