//! Directives for lights with and without a surface, with the parameters and defaults of pbrt-v3.

use std::f32::consts::PI;
use std::sync::Arc;

use antumbra_scene::{AreaLight, Environment, EnvironmentMapping, Image, Light, Rgb, Sampler};
use glam::{DMat3, DMat4, DVec3, DVec4, Mat3};

use crate::lookup::{FLOAT, Lookup};
use crate::params::ParamType;
use crate::state::Transforms;
use crate::texture::Images;
use crate::transform;

/// Where a light reads its image, and its transformation to the world.
type Read = fn(&mut Lookup, &DMat4, &mut Images) -> Option<Light>;

/// Lights without a surface. All lights of pbrt-v3 are supported.
const LIGHTS: &[(&str, Read)] = &[
    ("distant", distant),
    ("goniometric", goniometric),
    ("infinite", infinite),
    ("point", point),
    ("projection", projection),
    ("spot", spot),
];

/// Names of the lights without a surface.
pub(crate) fn supported() -> Vec<&'static str> {
    LIGHTS.iter().map(|(name, _)| *name).collect()
}

/// Lights with a surface; "area" is an older name of "diffuse".
pub(crate) const SUPPORTED_AREA: &[&str] = &["area", "diffuse"];

/// Reads a `LightSource`. `None`: a mistake was reported.
pub(crate) fn read(
    lookup: &mut Lookup,
    transforms: &Transforms,
    images: &mut Images,
) -> Option<Light> {
    if transforms.is_animated() {
        lookup.note("lights do not move, as in pbrt-v3: the transformation at the start is taken");
    }
    let to_world = transforms.start;
    if !transform::is_invertible(&to_world) {
        lookup.ignore_all();
        return lookup.fail("the current transformation cannot be inverted");
    }
    let name = match lookup.kind.text.as_str() {
        // An older name that pbrt-v3 still accepts.
        "exinfinite" => "infinite",
        name => name,
    };
    let Some((_, read)) = LIGHTS.iter().find(|(known, _)| *known == name) else {
        lookup.unknown(&supported());
        return None;
    };
    read(lookup, &to_world, images)
}

/// Colour of the given name times the colour "scale".
fn scaled(lookup: &mut Lookup, name: &'static str) -> Rgb {
    lookup.emission(name, Rgb::ONE) * lookup.color("scale", Rgb::ONE)
}

/// Factor that gives a light of pbrt-v4 the luminous power or illuminance of the parameter `name`, where it is given. The
/// light has the value `own` without it.
fn photometric(lookup: &mut Lookup, name: &'static str, own: f32) -> f32 {
    if !lookup.is_version4() {
        return 1.0;
    }
    match lookup.optional_float(name) {
        Some(wanted) if wanted > 0.0 => wanted / own,
        _ => 1.0,
    }
}

/// Samples per shaded point: "samples", or "nsamples" by its older name.
fn samples(lookup: &mut Lookup) -> u32 {
    let limits = [1, Sampler::MAX_SAMPLES];
    let older_name = lookup.integer_in("nsamples", 1, limits);
    lookup.integer_in("samples", older_name, limits)
}

fn point(lookup: &mut Lookup, to_world: &DMat4, _: &mut Images) -> Option<Light> {
    let intensity = scaled(lookup, "I") * photometric(lookup, "power", 4.0 * PI);
    let from = lookup.point("from", DVec3::ZERO);
    let position = match lookup.is_version4() {
        true => transform::point(to_world, from),
        // pbrt-v3 adds "from" after the transformation, not before it.
        false => transform::point(to_world, DVec3::ZERO) + from,
    };
    Some(Light::Point {
        position: position.as_vec3(),
        intensity,
    })
}

/// Point "from" of a light, and the direction from there to its point "to", in world space. `None`: they are equal, which was
/// reported.
fn axis(lookup: &mut Lookup, to_world: &DMat4) -> Option<(DVec3, DVec3)> {
    let from = lookup.point("from", DVec3::ZERO);
    let to = lookup.point("to", DVec3::Z);
    match to_world.transform_vector3(to - from).try_normalize() {
        Some(direction) => Some((transform::point(to_world, from), direction)),
        None => lookup.fail("\"from\" and \"to\" of the light are equal"),
    }
}

fn spot(lookup: &mut Lookup, to_world: &DMat4, _: &mut Images) -> Option<Light> {
    let intensity = scaled(lookup, "I");
    let cone = lookup.float_in("coneangle", 30.0, [0.0, 180.0]);
    let delta = lookup.float_in("conedeltaangle", 5.0, [0.0, 180.0]);
    let (position, axis) = axis(lookup, to_world)?;
    if transform::uniform_scale(to_world).is_none() {
        return lookup.refuse("a spot light under a scale that differs by axis is");
    }
    let cos = |degrees: f32| f64::from(degrees).to_radians().cos() as f32;
    let [cos_total_width, cos_falloff_start] = [cos(cone), cos(cone - delta)];
    if cos_falloff_start < cos_total_width {
        return lookup.fail(format!(
            "\"conedeltaangle\" {delta} is too wide for \"coneangle\" {cone}"
        ));
    }
    let own = PI * (2.0 - cos_falloff_start - cos_total_width);
    let intensity = intensity * photometric(lookup, "power", own);
    if lookup.is_version4() {
        let message =
            "the edge of a spot light falls off as in pbrt-v3, a little steeper than in pbrt-v4";
        lookup.note(message);
    }
    Some(Light::Spot {
        position: position.as_vec3(),
        axis: axis.as_vec3(),
        intensity,
        cos_total_width,
        cos_falloff_start,
    })
}

fn distant(lookup: &mut Lookup, to_world: &DMat4, _: &mut Images) -> Option<Light> {
    let radiance = scaled(lookup, "L") * photometric(lookup, "illuminance", 1.0);
    let (_, axis) = axis(lookup, to_world)?;
    Some(Light::Distant {
        to_light: -axis.as_vec3(),
        radiance,
    })
}

fn infinite(lookup: &mut Lookup, to_world: &DMat4, images: &mut Images) -> Option<Light> {
    if lookup.is_version4() {
        return infinite4(lookup, to_world, images);
    }
    let radiance = scaled(lookup, "L");
    let samples = samples(lookup);
    let environment = match map(lookup, images)? {
        None => None,
        Some(image) => Some(Environment {
            image,
            mapping: EnvironmentMapping::LongitudeLatitude,
            world_from_light: rotation(to_world, lookup)?,
        }),
    };
    Some(Light::Infinite {
        radiance,
        environment,
        samples,
    })
}

/// Infinite light of pbrt-v4: one colour, or an image on an octahedron.
fn infinite4(lookup: &mut Lookup, to_world: &DMat4, images: &mut Images) -> Option<Light> {
    let radiance = scaled(lookup, "L");
    let why = "portals change noise only";
    lookup.left_out("portal", &[ParamType::Point3], why);
    let light = |radiance, environment| {
        Some(Light::Infinite {
            radiance,
            environment,
            samples: 1,
        })
    };
    if !lookup.has("filename") {
        let factor = photometric(lookup, "illuminance", PI);
        return light(radiance * factor, None);
    }
    for other in ["L", "illuminance"] {
        if lookup.has(other) {
            lookup.unsupported(format!("{other:?} of an infinite light with an image is"));
        }
    }
    let _ = lookup.find("illuminance", FLOAT);
    let image = images.of(lookup, "filename")?;
    if image.width != image.height {
        let (width, height) = (image.width, image.height);
        let message = format!("the image of an infinite light has {width} x {height} pixels");
        let help = "pbrt-v4 takes a square image of an octahedron; imgtool makeequiarea of pbrt-v4 makes one";
        return lookup.fail_help(message, help);
    }
    let environment = Environment {
        image,
        mapping: EnvironmentMapping::EqualArea,
        world_from_light: rotation(to_world, lookup)?,
    };
    light(radiance, Some(environment))
}

fn goniometric(lookup: &mut Lookup, to_world: &DMat4, images: &mut Images) -> Option<Light> {
    let intensity = scaled(lookup, "I");
    if lookup.is_version4() && (lookup.has("filename") || lookup.has("power")) {
        let feature = "a goniometric light of pbrt-v4 with an image or \"power\" is";
        lookup.ignore_all();
        return lookup.refuse(feature);
    }
    let map = map(lookup, images);
    check_affine(lookup, to_world)?;
    Some(Light::Goniometric {
        world_from_light: to_world.as_mat4(),
        intensity,
        image: map?,
    })
}

fn projection(lookup: &mut Lookup, to_world: &DMat4, images: &mut Images) -> Option<Light> {
    let intensity = scaled(lookup, "I");
    let fov = lookup.float_in("fov", 45.0, [f32::MIN_POSITIVE, 179.9]);
    let map = map(lookup, images);
    check_affine(lookup, to_world)?;
    Some(Light::Projection {
        world_from_light: to_world.as_mat4(),
        intensity,
        fov,
        image: map?,
    })
}

/// Image of "mapname". An empty name means no image, as in pbrt-v3. Outer `None`: a mistake was reported.
fn map(lookup: &mut Lookup, images: &mut Images) -> Option<Option<Arc<Image>>> {
    match lookup.string("mapname") {
        None | Some(("", _)) => Some(None),
        Some(_) => images.of(lookup, "mapname").map(Some),
    }
}

/// Checks that a transformation is affine. `None`: it is a projection, which was reported.
fn check_affine(lookup: &mut Lookup, to_world: &DMat4) -> Option<()> {
    if to_world.row(3) != DVec4::W {
        return lookup.refuse("a light under a perspective transformation is");
    }
    Some(())
}

/// Rotation and reflection of a transformation with uniform scale. `None`: a mistake was reported.
fn rotation(to_world: &DMat4, lookup: &mut Lookup) -> Option<Mat3> {
    check_affine(lookup, to_world)?;
    let Some(scale) = transform::uniform_scale(to_world) else {
        return lookup
            .refuse("an infinite light with an image under a scale that differs by axis is");
    };
    Some((DMat3::from_mat4(*to_world) * (1.0 / scale)).as_mat3())
}

/// Reads an `AreaLightSource`. An empty name turns emission off, as in pbrt-v3.
pub(crate) fn area(lookup: &mut Lookup) -> Option<AreaLight> {
    match lookup.kind.text.as_str() {
        "diffuse" | "area" => {
            let radiance = scaled(lookup, "L");
            for name in ["power", "filename"] {
                if lookup.is_version4() && lookup.has(name) {
                    let _ = lookup.find(name, &[ParamType::Float, ParamType::String]);
                    lookup.unsupported(format!("{name:?} of an area light is"));
                }
            }
            Some(AreaLight {
                radiance,
                texture: None,
                two_sided: lookup.bool("twosided", false),
                samples: samples(lookup),
            })
        }
        "" => None,
        _ => {
            lookup.unknown(SUPPORTED_AREA);
            None
        }
    }
}
