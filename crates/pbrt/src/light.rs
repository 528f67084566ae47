//! Lights with and without a surface: parameters and defaults of pbrt-v3.

use antumbra_scene::{AreaLight, Light, Rgb};
use glam::{DMat4, DVec3};

use crate::directive::Quoted;
use crate::lookup::Lookup;
use crate::params::Params;
use crate::report::Report;
use crate::source::Span;
use crate::state::Transforms;
use crate::{suggest, transform};

const SUPPORTED: &[&str] = &["distant", "infinite", "point", "spot"];
const UNSUPPORTED: &[&str] = &["goniometric", "projection"];

/// Handles `LightSource`. `None`: something was reported.
pub(crate) fn declare(
    at: Span,
    kind: &Quoted,
    params: &Params,
    transforms: &Transforms,
    report: &mut Report,
) -> Option<Light> {
    let mut lookup = Lookup::new(at, format!("light {:?}", kind.text), params);
    if transforms.is_animated() {
        report.unsupported(at, "moving lights are");
    }
    let to_world = transforms.start;
    if !transform::is_invertible(&to_world) {
        report.error(at, "the current transformation cannot be inverted");
        return None;
    }
    let light = match kind.text.as_str() {
        "point" => Some(point(&mut lookup, &to_world, report)),
        "spot" => spot(&mut lookup, &to_world, report),
        "distant" => distant(&mut lookup, &to_world, report),
        // "exinfinite" is an older name that pbrt-v3 still takes.
        "infinite" | "exinfinite" => Some(infinite(&mut lookup, report)),
        name if UNSUPPORTED.contains(&name) => {
            report.unsupported(kind.span, format!("light {name:?} is"));
            lookup.ignore_all();
            None
        }
        name => {
            report.error_help(
                kind.span,
                format!("unknown light {name:?}"),
                suggest::help(name, SUPPORTED),
            );
            lookup.ignore_all();
            None
        }
    };
    lookup.finish(report);
    light
}

/// The colour of that name times `scale`, which is a colour too.
fn scaled(lookup: &mut Lookup, name: &'static str, report: &mut Report) -> Rgb {
    lookup.color(name, Rgb::ONE, report) * lookup.color("scale", Rgb::ONE, report)
}

/// Samples per shaded point; "nsamples" is an older name.
fn samples(lookup: &mut Lookup, report: &mut Report) -> u32 {
    let older_name = lookup.integer_from("nsamples", 1, 1, report);
    lookup.integer_from("samples", older_name, 1, report)
}

fn point(lookup: &mut Lookup, to_world: &DMat4, report: &mut Report) -> Light {
    let intensity = scaled(lookup, "I", report);
    let from = lookup.point("from", DVec3::ZERO, report);
    // pbrt-v3 moves by `from` after the transformation, not before it.
    let position = transform::point(to_world, DVec3::ZERO) + from;
    Light::Point {
        position: position.as_vec3(),
        intensity,
    }
}

/// The direction between two points of a light, in world space.
fn direction(
    lookup: &Lookup,
    from: DVec3,
    to: DVec3,
    to_world: &DMat4,
    report: &mut Report,
) -> Option<DVec3> {
    let direction = to_world.transform_vector3(to - from).try_normalize();
    if direction.is_none() {
        report.error(lookup.at, "\"from\" and \"to\" of this light are the same");
    }
    direction
}

fn spot(lookup: &mut Lookup, to_world: &DMat4, report: &mut Report) -> Option<Light> {
    let intensity = scaled(lookup, "I", report);
    let cone = lookup.float_in("coneangle", 30.0, [0.0, 180.0], report);
    let delta = lookup.float_in("conedeltaangle", 5.0, [0.0, 180.0], report);
    let from = lookup.point("from", DVec3::ZERO, report);
    let to = lookup.point("to", DVec3::Z, report);
    let axis = direction(lookup, from, to, to_world, report)?;
    if transform::uniform_scale(to_world).is_none() {
        report.unsupported(
            lookup.at,
            "a spot light under a scale that differs by axis is",
        );
        return None;
    }
    let cos = |degrees: f32| f64::from(degrees).to_radians().cos() as f32;
    let [cos_total_width, cos_falloff_start] = [cos(cone), cos(cone - delta)];
    if cos_falloff_start < cos_total_width {
        report.error(
            lookup.at,
            format!("\"conedeltaangle\" {delta} is too wide for \"coneangle\" {cone}"),
        );
        return None;
    }
    Some(Light::Spot {
        position: transform::point(to_world, from).as_vec3(),
        axis: axis.as_vec3(),
        intensity,
        cos_total_width,
        cos_falloff_start,
    })
}

fn distant(lookup: &mut Lookup, to_world: &DMat4, report: &mut Report) -> Option<Light> {
    let radiance = scaled(lookup, "L", report);
    let from = lookup.point("from", DVec3::ZERO, report);
    let to = lookup.point("to", DVec3::Z, report);
    let axis = direction(lookup, from, to, to_world, report)?;
    Some(Light::Distant {
        to_light: -axis.as_vec3(),
        radiance,
    })
}

fn infinite(lookup: &mut Lookup, report: &mut Report) -> Light {
    let radiance = scaled(lookup, "L", report);
    if let Some((_, span)) = lookup
        .string("mapname", report)
        .filter(|(path, _)| !path.is_empty())
    {
        report.unsupported(span, "a picture as infinite light is");
    }
    let samples = samples(lookup, report);
    Light::Infinite {
        radiance,
        environment: None,
        samples,
    }
}

/// Handles `AreaLightSource`; an empty name turns emission off, as in pbrt-v3.
pub(crate) fn declare_area(
    at: Span,
    kind: &Quoted,
    params: &Params,
    report: &mut Report,
) -> Option<AreaLight> {
    let mut lookup = Lookup::new(at, format!("area light {:?}", kind.text), params);
    let light = match kind.text.as_str() {
        "diffuse" | "area" => {
            let radiance = scaled(&mut lookup, "L", report);
            Some(AreaLight {
                radiance,
                two_sided: lookup.bool("twosided", false, report),
                samples: samples(&mut lookup, report),
            })
        }
        "" => None,
        name => {
            report.error_help(
                kind.span,
                format!("unknown area light {name:?}"),
                suggest::help(name, &["diffuse"]),
            );
            lookup.ignore_all();
            None
        }
    };
    lookup.finish(report);
    light
}
