//! Directives for film and pixel filter, with the parameters and defaults of pbrt-v3.

use antumbra_scene::{Film, Filter};

use crate::directive::Quoted;
use crate::lookup::{Lookup, one_float};
use crate::params::{ParamType, Params, Values};
use crate::report::Report;
use crate::source::Span;

/// Handles `Film`. Returns the film, and its diagonal in millimetres with its place, where it is given.
pub(crate) fn declare(
    at: Span,
    kind: &Quoted,
    params: &Params,
    report: &mut Report,
) -> (Film, Option<(f32, Span)>) {
    let mut lookup = Lookup::new(at, format!("film {:?}", kind.text), params);
    let mut film = (Film::default(), None);
    if kind.text == "image" {
        film = image(&mut lookup, report);
    } else {
        report.error_help(
            kind.span,
            format!("unknown film {:?}", kind.text),
            "known: image",
        );
        lookup.ignore_all();
    }
    lookup.finish(report);
    film
}

fn image(lookup: &mut Lookup, report: &mut Report) -> (Film, Option<(f32, Span)>) {
    let defaults = Film::default();
    let [width, height] = defaults.resolution;
    let resolution = [
        lookup.integer_from("xresolution", width, 1, report),
        lookup.integer_from("yresolution", height, 1, report),
    ];
    if u64::from(resolution[0]) * u64::from(resolution[1]) > Film::MAX_PIXELS {
        let [x, y] = resolution;
        report.error(
            lookup.at,
            format!(
                "a film of {x} x {y} pixels is above the limit of {} pixels",
                Film::MAX_PIXELS
            ),
        );
    }
    let diagonal_at = lookup.find("diagonal", &[ParamType::Float]);
    let positive = [f32::MIN_POSITIVE, f32::MAX];
    let diagonal = lookup.float_in("diagonal", 35.0, positive, report);
    let film = Film {
        resolution,
        crop_window: crop_window(lookup, report),
        scale: lookup.float("scale", defaults.scale, report),
        max_sample_luminance: max_sample_luminance(lookup, report),
        file_name: lookup
            .string("filename", report)
            .map(|(name, _)| name.to_owned()),
        ..defaults
    };
    if film.is_empty() {
        let place = lookup
            .find("cropwindow", &[ParamType::Float])
            .map_or(lookup.at, |param| param.list);
        report.error_help(
            place,
            "no pixel is inside the crop window",
            "a crop window is [x_min x_max y_min y_max] in fractions of the picture",
        );
    }
    (film, diagonal_at.map(|param| (diagonal, param.declaration)))
}

/// Reads the crop window: each pair in either order, limited to the picture, as in pbrt-v3.
fn crop_window(lookup: &mut Lookup, report: &mut Report) -> [f32; 4] {
    let Some(given) = lookup.floats::<4>("cropwindow", report) else {
        return Film::default().crop_window;
    };
    let [x0, x1, y0, y1] = given.map(|v| v.clamp(0.0, 1.0));
    let window = [x0.min(x1), x0.max(x1), y0.min(y1), y0.max(y1)];
    if window != given {
        report.note(
            lookup.at,
            format!("the crop window {given:?} is taken as {window:?}, as pbrt does"),
        );
    }
    window
}

/// Reads "maxsampleluminance", which is infinite by default and may be given as infinite.
fn max_sample_luminance(lookup: &mut Lookup, report: &mut Report) -> f32 {
    let Some(param) = lookup.find("maxsampleluminance", &[ParamType::Float]) else {
        return f32::INFINITY;
    };
    if param.values == Values::Floats(vec![f32::INFINITY]) {
        return f32::INFINITY;
    }
    match one_float(param, report) {
        Some(value) if value > 0.0 => value,
        Some(value) => {
            report.error(
                param.value,
                format!("\"maxsampleluminance\" must be positive, found {value}"),
            );
            f32::INFINITY
        }
        None => f32::INFINITY,
    }
}

/// Reconstruction filters. All filters of pbrt-v3 are supported.
pub(crate) const FILTERS: &[&str] = &["box", "gaussian", "mitchell", "sinc", "triangle"];

/// Handles `PixelFilter`.
pub(crate) fn declare_filter(
    at: Span,
    kind: &Quoted,
    params: &Params,
    report: &mut Report,
) -> Filter {
    let mut lookup = Lookup::new(at, format!("pixel filter {:?}", kind.text), params);
    let mut radius = |default| {
        let limits = [f32::MIN_POSITIVE, Filter::MAX_RADIUS];
        [
            lookup.float_in("xwidth", default, limits, report),
            lookup.float_in("ywidth", default, limits, report),
        ]
    };
    let filter = match kind.text.as_str() {
        "box" => Filter::Box {
            radius: radius(0.5),
        },
        "triangle" => Filter::Triangle {
            radius: radius(2.0),
        },
        "gaussian" => Filter::Gaussian {
            radius: radius(2.0),
            alpha: lookup.float("alpha", 2.0, report),
        },
        "mitchell" => Filter::Mitchell {
            radius: radius(2.0),
            b: lookup.float("B", 1.0 / 3.0, report),
            c: lookup.float("C", 1.0 / 3.0, report),
        },
        "sinc" => Filter::LanczosSinc {
            radius: radius(4.0),
            tau: lookup.float_in("tau", 3.0, [f32::MIN_POSITIVE, f32::MAX], report),
        },
        name => {
            report.unknown(kind.span, "pixel filter", name, FILTERS);
            lookup.ignore_all();
            Filter::default()
        }
    };
    lookup.finish(report);
    filter
}
