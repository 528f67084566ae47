//! Layers and notes of an EXR file.

use antumbra_image::{Channel, Notes};
use antumbra_render::{Layers, Options, Rendering, World};
use antumbra_scene::{Projection, Scene};
use glam::{DVec3, Vec3};

use super::start::Picture;
use crate::args::{AovNames, RenderArgs};
use crate::exit::Failure;

/// Largest number of samples per pixel for layers. Their noise is small.
const MOST_SAMPLES: u32 = 64;

/// Writes a picture with its layers, if they are wanted, and with notes about it.
pub fn write(
    args: &RenderArgs,
    picture: &Picture,
    world: &World,
    rendering: &Rendering,
) -> Result<(), Failure> {
    let options = &picture.options;
    let channels = if args.layers {
        channels(args.aov_names, world, rendering, options)?
    } else {
        Vec::new()
    };
    let notes = notes(&picture.scene, rendering, options);
    Ok((rendering.image).write_layers(&picture.file, &channels, &notes)?)
}

fn channels(
    names: AovNames,
    world: &World,
    rendering: &Rendering,
    options: &Options,
) -> Result<Vec<Channel>, Failure> {
    let spp = rendering.stats.spp;
    let isa = options.recipe.engine.isa();
    let samples = [spp, MOST_SAMPLES];
    let layers = Layers::trace(world, isa, samples, options.texture_spp, options.seed)?;
    let mut channels = Vec::new();
    let mut three = |name: &str, axes: [&str; 3], values: &[Vec3]| {
        for (axis, letter) in axes.into_iter().enumerate() {
            channels.push(Channel {
                name: format!("{name}.{letter}"),
                values: values.iter().map(|value| value[axis]).collect(),
            });
        }
    };
    let (rgb, xyz) = (["R", "G", "B"], ["X", "Y", "Z"]);
    let counts = vec![spp as f32; layers.depth.len()];
    let one = match names {
        AovNames::Pbrt => {
            three("Albedo", rgb, &layers.albedo);
            three("N", xyz, &layers.normal);
            three("Ns", xyz, &layers.shading_normal);
            three("P", xyz, &layers.position);
            ["Z", "SampleCount"]
        }
        AovNames::Cycles => {
            three("Denoising Albedo", rgb, &layers.albedo);
            three("Denoising Normal", xyz, &layers.shading_normal);
            three("Position", xyz, &layers.position);
            ["Denoising Depth.Z", "Debug Sample Count.X"]
        }
    };
    if let Some(errors) = &rendering.standard_error {
        // The variance of single samples, as pbrt-v4 has it.
        let variance = |&[r, g, b]: &[f32; 3]| Vec3::new(r * r, g * g, b * b) * spp as f32;
        let values: Vec<Vec3> = errors.pixels().iter().map(variance).collect();
        three("Variance", rgb, &values);
    }
    for (name, values) in one.into_iter().zip([layers.depth, counts]) {
        channels.push(Channel {
            name: name.to_owned(),
            values,
        });
    }
    Ok(channels)
}

/// How the picture was made. Nothing that depends on the machine or the hour.
fn notes(scene: &Scene, rendering: &Rendering, options: &Options) -> Notes {
    let camera = &scene.camera;
    let matrix = camera.world_from_camera;
    let is_local = scene.origin != DVec3::ZERO;
    let at = |v: Vec3| match is_local {
        true => {
            let v = v.as_dvec3() + scene.origin;
            format!("{} {} {}", v.x, v.y, v.z)
        }
        false => format!("{} {} {}", v.x, v.y, v.z),
    };
    let eye = matrix.project_point3(Vec3::ZERO);
    let forward = matrix.transform_vector3(Vec3::Z);
    let up = matrix.transform_vector3(Vec3::Y);
    let look = format!(
        "LookAt {} {} {} {} {}",
        at(eye),
        at(eye + forward),
        up.x,
        up.y,
        up.z
    );
    let lines = [
        ("program", format!("antumbra {}", env!("CARGO_PKG_VERSION"))),
        ("scene", scene.name.clone()),
        ("camera", look),
        ("samples per pixel", rendering.stats.spp.to_string()),
        ("sampler", scene.sampler.kind.name().to_owned()),
        ("seed", options.seed.to_string()),
        ("order", options.recipe.order.name().to_owned()),
    ];
    let mut notes = lines.map(|(name, value)| (name.to_owned(), value)).to_vec();
    if camera.projection == Projection::Perspective {
        notes.insert(3, ("fov".to_owned(), camera.fov.to_string()));
    }
    if is_local {
        notes.push(("origin of positions".to_owned(), at(Vec3::ZERO)));
    }
    Notes(notes)
}
