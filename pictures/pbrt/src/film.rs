//! Directives for film and pixel filter, with the parameters and defaults of pbrt-v3.

use antumbra_scene::{Film, Filter};

use crate::lookup::{FLOAT, Lookup, POSITIVE};
use crate::params::Values;
use crate::source::Span;

/// Reads a `Film`. Returns the film, and its diagonal in millimetres with its place, where it is given.
pub(crate) fn film(lookup: &mut Lookup) -> (Film, Option<(f32, Span)>) {
    if lookup.kind.text == "image" {
        return image(lookup);
    }
    let message = format!("unknown film {:?}", lookup.kind.text);
    (lookup.report).error_help(lookup.kind.span, message, "known: image");
    lookup.ignore_all();
    (Film::default(), None)
}

fn image(lookup: &mut Lookup) -> (Film, Option<(f32, Span)>) {
    let defaults = Film::default();
    let [width, height] = defaults.resolution;
    let resolution = [
        lookup.integer_from("xresolution", width, 1),
        lookup.integer_from("yresolution", height, 1),
    ];
    if u64::from(resolution[0]) * u64::from(resolution[1]) > Film::MAX_PIXELS {
        let [x, y] = resolution;
        let most = Film::MAX_PIXELS;
        lookup.error(format!(
            "a film of {x} x {y} pixels is above the limit of {most} pixels"
        ));
    }
    let diagonal_at = lookup.find("diagonal", FLOAT);
    let diagonal = lookup.float_in("diagonal", 35.0, POSITIVE);
    let film = Film {
        resolution,
        crop_window: crop_window(lookup),
        scale: lookup.float("scale", defaults.scale),
        max_sample_luminance: max_sample_luminance(lookup),
        file_name: (lookup.string("filename")).map(|(name, _)| name.to_owned()),
        ..defaults
    };
    if film.is_empty() {
        let found = lookup.find("cropwindow", FLOAT);
        let place = found.map_or(lookup.at, |param| param.list);
        let help = "a crop window is [x_min x_max y_min y_max] in fractions of the picture";
        (lookup.report).error_help(place, "no pixel is inside the crop window", help);
    }
    (film, diagonal_at.map(|param| (diagonal, param.declaration)))
}

/// Reads the crop window: each pair in either order, limited to the picture, as in pbrt-v3.
fn crop_window(lookup: &mut Lookup) -> [f32; 4] {
    let Some(given) = lookup.floats::<4>("cropwindow") else {
        return Film::default().crop_window;
    };
    let [x0, x1, y0, y1] = given.map(|v| v.clamp(0.0, 1.0));
    let window = [x0.min(x1), x0.max(x1), y0.min(y1), y0.max(y1)];
    if window != given {
        lookup.note(format!(
            "the crop window {given:?} is taken as {window:?}, as pbrt does"
        ));
    }
    window
}

/// Reads "maxsampleluminance", which is infinite by default and may be given as infinite.
fn max_sample_luminance(lookup: &mut Lookup) -> f32 {
    match lookup.find("maxsampleluminance", FLOAT) {
        Some(param) if param.values != Values::Floats(vec![f32::INFINITY]) => {
            lookup.float_in("maxsampleluminance", f32::INFINITY, POSITIVE)
        }
        _ => f32::INFINITY,
    }
}

/// Reconstruction filters. All filters of pbrt-v3 are supported.
pub(crate) const FILTERS: &[&str] = &["box", "gaussian", "mitchell", "sinc", "triangle"];

/// Reads a `PixelFilter`.
pub(crate) fn filter(lookup: &mut Lookup) -> Filter {
    let kind = lookup.kind.text.as_str();
    let mut radius = |default| {
        let limits = [f32::MIN_POSITIVE, Filter::MAX_RADIUS];
        ["xwidth", "ywidth"].map(|name| lookup.float_in(name, default, limits))
    };
    match kind {
        "box" => Filter::Box {
            radius: radius(0.5),
        },
        "triangle" => Filter::Triangle {
            radius: radius(2.0),
        },
        "gaussian" => Filter::Gaussian {
            radius: radius(2.0),
            alpha: lookup.float("alpha", 2.0),
        },
        "mitchell" => Filter::Mitchell {
            radius: radius(2.0),
            b: lookup.float("B", 1.0 / 3.0),
            c: lookup.float("C", 1.0 / 3.0),
        },
        "sinc" => Filter::LanczosSinc {
            radius: radius(4.0),
            tau: lookup.float_in("tau", 3.0, POSITIVE),
        },
        _ => {
            lookup.unknown(FILTERS);
            Filter::default()
        }
    }
}
