//! Directives for lights with and without a surface, with the parameters and defaults of pbrt-v3.

use std::f32::consts::PI;
use std::sync::Arc;

use antumbra_scene::{AreaLight, Environment, EnvironmentMapping, Image, Light, Rgb, Sampler};
use glam::{DMat3, DMat4, DVec3, DVec4, Mat3};

use crate::directive::Quoted;
use crate::lookup::Lookup;
use crate::params::{ParamType, Params};
use crate::report::Report;
use crate::source::Span;
use crate::state::Transforms;
use crate::texture::Images;
use crate::transform;

/// Lights without a surface. All lights of pbrt-v3 are supported.
pub(crate) const SUPPORTED: &[&str] = &[
    "distant",
    "goniometric",
    "infinite",
    "point",
    "projection",
    "spot",
];

/// Lights with a surface; "area" is an older name of "diffuse".
pub(crate) const SUPPORTED_AREA: &[&str] = &["area", "diffuse"];

/// Handles `LightSource`. `None`: a mistake was reported.
pub(crate) fn declare(
    at: Span,
    kind: &Quoted,
    params: &Params,
    transforms: &Transforms,
    images: &mut Images,
    report: &mut Report,
) -> Option<Light> {
    let mut lookup = Lookup::new(at, format!("light {:?}", kind.text), params);
    if transforms.is_animated() {
        let message = "lights do not move, as in pbrt-v3: the transformation at the start is taken";
        report.note(at, message);
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
        // "exinfinite" is an older name that pbrt-v3 still accepts.
        "infinite" | "exinfinite" => infinite(&mut lookup, &to_world, images, report),
        "goniometric" => goniometric(&mut lookup, &to_world, images, report),
        "projection" => projection(&mut lookup, &to_world, images, report),
        name => {
            report.unknown(kind.span, "light", name, SUPPORTED);
            lookup.ignore_all();
            None
        }
    };
    lookup.finish(report);
    light
}

/// Colour of the given name times the colour "scale".
fn scaled(lookup: &mut Lookup, name: &'static str, report: &mut Report) -> Rgb {
    lookup.emission(name, Rgb::ONE, report) * lookup.color("scale", Rgb::ONE, report)
}

/// Factor that gives a light of pbrt-v4 the luminous power or illuminance of the parameter `name`, where it is given. The
/// light has the value `own` without it.
fn photometric(lookup: &mut Lookup, name: &'static str, own: f32, report: &mut Report) -> f32 {
    if !report.is_version4 {
        return 1.0;
    }
    match lookup.optional_float(name, report) {
        Some(wanted) if wanted > 0.0 => wanted / own,
        _ => 1.0,
    }
}

/// Samples per shaded point: "samples", or "nsamples" by its older name.
fn samples(lookup: &mut Lookup, report: &mut Report) -> u32 {
    let limits = [1, Sampler::MAX_SAMPLES];
    let older_name = lookup.integer_in("nsamples", 1, limits, report);
    lookup.integer_in("samples", older_name, limits, report)
}

fn point(lookup: &mut Lookup, to_world: &DMat4, report: &mut Report) -> Light {
    let intensity = scaled(lookup, "I", report) * photometric(lookup, "power", 4.0 * PI, report);
    let from = lookup.point("from", DVec3::ZERO, report);
    if report.is_version4 {
        return Light::Point {
            position: transform::point(to_world, from).as_vec3(),
            intensity,
        };
    }
    // pbrt-v3 adds "from" after the transformation, not before it.
    let position = transform::point(to_world, DVec3::ZERO) + from;
    Light::Point {
        position: position.as_vec3(),
        intensity,
    }
}

/// Direction between two points of a light in world space. `None`: the points are equal, which was reported.
fn direction(
    lookup: &Lookup,
    from: DVec3,
    to: DVec3,
    to_world: &DMat4,
    report: &mut Report,
) -> Option<DVec3> {
    let direction = to_world.transform_vector3(to - from).try_normalize();
    if direction.is_none() {
        report.error(lookup.at, "\"from\" and \"to\" of the light are equal");
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
    let own = PI * (2.0 - cos_falloff_start - cos_total_width);
    let intensity = intensity * photometric(lookup, "power", own, report);
    if report.is_version4 {
        let message =
            "the edge of a spot light falls off as in pbrt-v3, a little steeper than in pbrt-v4";
        report.note(lookup.at, message);
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
    let radiance = scaled(lookup, "L", report) * photometric(lookup, "illuminance", 1.0, report);
    let from = lookup.point("from", DVec3::ZERO, report);
    let to = lookup.point("to", DVec3::Z, report);
    let axis = direction(lookup, from, to, to_world, report)?;
    Some(Light::Distant {
        to_light: -axis.as_vec3(),
        radiance,
    })
}

fn infinite(
    lookup: &mut Lookup,
    to_world: &DMat4,
    images: &mut Images,
    report: &mut Report,
) -> Option<Light> {
    if report.is_version4 {
        return infinite4(lookup, to_world, images, report);
    }
    let radiance = scaled(lookup, "L", report);
    let samples = samples(lookup, report);
    let environment = match map_name(lookup, images, report) {
        Map::None => None,
        Map::Broken => return None,
        Map::Image(image) => Some(Environment {
            image,
            mapping: EnvironmentMapping::LongitudeLatitude,
            world_from_light: rotation(to_world, lookup, report)?,
        }),
    };
    Some(Light::Infinite {
        radiance,
        environment,
        samples,
    })
}

/// Infinite light of pbrt-v4: one colour, or an image on an octahedron.
fn infinite4(
    lookup: &mut Lookup,
    to_world: &DMat4,
    images: &mut Images,
    report: &mut Report,
) -> Option<Light> {
    let radiance = scaled(lookup, "L", report);
    let why = "portals change noise only";
    lookup.left_out("portal", &[ParamType::Point3], why, report);
    let light = |radiance, environment| {
        Some(Light::Infinite {
            radiance,
            environment,
            samples: 1,
        })
    };
    if !lookup.has("filename") {
        let factor = photometric(lookup, "illuminance", PI, report);
        return light(radiance * factor, None);
    }
    for other in ["L", "illuminance"] {
        if lookup.has(other) {
            let feature = format!("{other:?} of an infinite light with an image is");
            report.unsupported(lookup.at, feature);
        }
    }
    let _ = lookup.find("illuminance", &[ParamType::Float]);
    let image = images.of(lookup, "filename", report)?;
    if image.width != image.height {
        let (width, height) = (image.width, image.height);
        report.error_help(
            lookup.at,
            format!("the image of an infinite light has {width} x {height} pixels"),
            "pbrt-v4 takes a square image of an octahedron; imgtool makeequiarea of pbrt-v4 makes one",
        );
        return None;
    }
    let environment = Environment {
        image,
        mapping: EnvironmentMapping::EqualArea,
        world_from_light: rotation(to_world, lookup, report)?,
    };
    light(radiance, Some(environment))
}

fn goniometric(
    lookup: &mut Lookup,
    to_world: &DMat4,
    images: &mut Images,
    report: &mut Report,
) -> Option<Light> {
    let intensity = scaled(lookup, "I", report);
    if report.is_version4 && (lookup.has("filename") || lookup.has("power")) {
        let feature = "a goniometric light of pbrt-v4 with an image or \"power\" is";
        report.unsupported(lookup.at, feature);
        lookup.ignore_all();
        return None;
    }
    let map = map_name(lookup, images, report);
    check_affine(lookup, to_world, report)?;
    Some(Light::Goniometric {
        world_from_light: to_world.as_mat4(),
        intensity,
        image: map.image()?,
    })
}

fn projection(
    lookup: &mut Lookup,
    to_world: &DMat4,
    images: &mut Images,
    report: &mut Report,
) -> Option<Light> {
    let intensity = scaled(lookup, "I", report);
    let fov = lookup.float_in("fov", 45.0, [f32::MIN_POSITIVE, 179.9], report);
    let map = map_name(lookup, images, report);
    check_affine(lookup, to_world, report)?;
    Some(Light::Projection {
        world_from_light: to_world.as_mat4(),
        intensity,
        fov,
        image: map.image()?,
    })
}

/// Value of "mapname".
enum Map {
    None,
    Image(Arc<Image>),
    /// A mistake was reported.
    Broken,
}

impl Map {
    /// Image, if there is one. Outer `None`: a mistake was reported.
    fn image(self) -> Option<Option<Arc<Image>>> {
        match self {
            Self::None => Some(None),
            Self::Image(image) => Some(Some(image)),
            Self::Broken => None,
        }
    }
}

/// Image of "mapname". An empty name means no image, as in pbrt-v3.
fn map_name(lookup: &mut Lookup, images: &mut Images, report: &mut Report) -> Map {
    match lookup.string("mapname", report) {
        None | Some(("", _)) => Map::None,
        Some(_) => match images.of(lookup, "mapname", report) {
            Some(image) => Map::Image(image),
            None => Map::Broken,
        },
    }
}

/// Checks that a transformation is affine. `None`: it is a projection, which was reported.
fn check_affine(lookup: &Lookup, to_world: &DMat4, report: &mut Report) -> Option<()> {
    if to_world.row(3) != DVec4::W {
        report.unsupported(lookup.at, "a light under a perspective transformation is");
        return None;
    }
    Some(())
}

/// Rotation and reflection of a transformation with uniform scale. `None`: a mistake was reported.
fn rotation(to_world: &DMat4, lookup: &Lookup, report: &mut Report) -> Option<Mat3> {
    check_affine(lookup, to_world, report)?;
    let Some(scale) = transform::uniform_scale(to_world) else {
        let feature = "an infinite light with an image under a scale that differs by axis is";
        report.unsupported(lookup.at, feature);
        return None;
    };
    Some((DMat3::from_mat4(*to_world) * (1.0 / scale)).as_mat3())
}

/// Handles `AreaLightSource`. An empty name turns emission off, as in pbrt-v3.
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
            for name in ["power", "filename"] {
                if report.is_version4 && lookup.has(name) {
                    let _ = lookup.find(name, &[ParamType::Float, ParamType::String]);
                    report.unsupported(at, format!("{name:?} of an area light is"));
                }
            }
            Some(AreaLight {
                radiance,
                texture: None,
                two_sided: lookup.bool("twosided", false, report),
                samples: samples(&mut lookup, report),
            })
        }
        "" => None,
        name => {
            report.unknown(kind.span, "area light", name, SUPPORTED_AREA);
            lookup.ignore_all();
            None
        }
    };
    lookup.finish(report);
    light
}
