//! Camera `realistic`: lenses in a file of four numbers per surface.

use std::sync::Arc;

use antumbra_scene::{Camera, LensElement, LensSystem, Projection};

use crate::lookup::{Lookup, POSITIVE};
use crate::number::parse_float;
use crate::params::shorten;
use crate::report::Report;
use crate::source::{Span, read_regular_file};

/// Diagonal of the film in millimetres, where the film says none.
pub(crate) const FILM_DIAGONAL: f32 = 35.0;

/// Largest size of a file in bytes.
const MAX_FILE: u64 = 1 << 20;

/// Most surfaces of a lens.
const MAX_ELEMENTS: usize = 256;

/// Reads a `realistic`. Mistakes are reported, and replaced by the default camera.
pub(super) fn realistic(lookup: &mut Lookup) -> Camera {
    let shutter = super::shutter(lookup);
    let diameter = lookup.float_in("aperturediameter", 1.0, POSITIVE);
    let focus_distance = lookup.float_in("focusdistance", 10.0, POSITIVE);
    let is_simple = lookup.bool("simpleweighting", true);
    let named = lookup.needed_string("lensfile");
    let read = named.and_then(|(name, span)| Some((name, read(name, span, lookup.report)?)));
    let Some((name, mut elements)) = read else {
        return Camera::default();
    };
    for stop in elements.iter_mut().filter(|element| element.radius == 0.0) {
        if diameter > stop.diameter {
            let most = stop.diameter;
            let message = format!(
                "\"aperturediameter\" {diameter} is taken as {most}, the largest of {name:?}"
            );
            lookup.note(message);
        } else {
            stop.diameter = diameter;
        }
    }
    if is_simple {
        let message = "with \"simpleweighting\" the picture gets darker towards its edges, and its brightness \
                       varies a little with the aperture, as in pbrt-v3";
        lookup.note(message);
    }
    Camera {
        shutter,
        projection: Projection::Realistic,
        lenses: Some(Arc::new(LensSystem {
            elements,
            focus_distance,
            film_diagonal: FILM_DIAGONAL,
            exposure: (!is_simple).then_some(shutter[1] - shutter[0]),
        })),
        ..Camera::default()
    }
}

/// Reads the surfaces of a lens file: radius, thickness, index and diameter each. Comments go from `#` to the end of the line.
/// `None`: a mistake was reported.
fn read(name: &str, span: Span, report: &mut Report) -> Option<Vec<LensElement>> {
    let path = report.sources.folder.join(name);
    let bytes = match read_regular_file(&path, MAX_FILE) {
        Ok(bytes) => bytes,
        Err(error) => {
            let help = "paths start at the folder of the main scene file";
            let message = format!("cannot read lens {name:?}: {error}");
            return report.fail_help(span, message, help);
        }
    };
    report.sources.note(path);
    match parse(&bytes) {
        Ok(elements) => Some(elements),
        Err(problem) => {
            let help = "a surface is its radius, thickness, index of refraction and diameter, in millimetres";
            report.fail_help(span, format!("lens {name:?}: {problem}"), help)
        }
    }
}

fn parse(bytes: &[u8]) -> Result<Vec<LensElement>, String> {
    let mut numbers: Vec<(f32, usize)> = Vec::new();
    for (index, line) in bytes.split(|byte| *byte == b'\n').enumerate() {
        let line = line.split(|byte| *byte == b'#').next().unwrap_or_default();
        let words = line.split(u8::is_ascii_whitespace);
        for word in words.filter(|word| !word.is_empty()) {
            match parse_float(word) {
                Ok(value) if value.is_finite() => numbers.push((value as f32, index + 1)),
                _ => {
                    let shown = shorten(&String::from_utf8_lossy(word));
                    return Err(format!("line {}: {shown} is not a number", index + 1));
                }
            }
        }
    }
    let count = numbers.len();
    if count == 0 || !count.is_multiple_of(4) || count > 4 * MAX_ELEMENTS {
        return Err(format!(
            "the file has {count} numbers; 4 for each of 1 to {MAX_ELEMENTS} surfaces are needed"
        ));
    }
    let elements = numbers.chunks_exact(4).map(|four| {
        let [radius, thickness, eta, diameter] = [0, 1, 2, 3].map(|k| four[k].0);
        if eta < 0.0 {
            let line = four[2].1;
            return Err(format!(
                "line {line}: an index of refraction of {eta} is negative"
            ));
        }
        if !(diameter > 0.0) {
            let line = four[3].1;
            return Err(format!(
                "line {line}: a diameter of {diameter} is not positive"
            ));
        }
        Ok(LensElement {
            radius,
            thickness,
            eta,
            diameter,
        })
    });
    elements.collect()
}
