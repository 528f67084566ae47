//! Refuses scenes that would panic or make no picture.

use antumbra_scene::{Film, Geometry, Scene};

use crate::Error;
use crate::film::filter;
use crate::texture;

/// Checks materials, vertex attributes, textures, film, sampler and integrator.
pub fn check(scene: &Scene) -> Result<(), Error> {
    let materials = scene.materials.len();
    for (index, shape) in scene.stored_shapes().enumerate() {
        if shape.material >= materials {
            return Err(Error::Material {
                shape: index,
                material: shape.material,
                materials,
            });
        }
        if let Geometry::Mesh(mesh) = &shape.geometry {
            let positions = mesh.positions.len();
            for (attribute, found) in [
                ("normals", mesh.normals.len()),
                ("texture coordinates", mesh.uvs.len()),
                ("colours", mesh.colors.len()),
            ] {
                if found != 0 && found != positions {
                    return Err(Error::VertexAttribute {
                        shape: index,
                        attribute,
                        found,
                        positions,
                    });
                }
            }
        }
    }
    texture::check(scene)?;
    check_film(&scene.film)?;
    if scene.sampler.pixel_samples == 0 {
        return Err(Error::NoSamples {
            what: "samples per pixel",
        });
    }
    match scene.integrator {
        antumbra_scene::Integrator::AmbientOcclusion { samples: 0, .. } => Err(Error::NoSamples {
            what: "ambient occlusion samples",
        }),
        _ => Ok(()),
    }
}

/// Checks the size of the picture and the filter.
pub fn check_film(film: &Film) -> Result<(), Error> {
    let [width, height] = film.resolution;
    let [x0, x1, y0, y1] = film.pixel_bounds();
    let limit = i32::MAX as u32 / 2;
    if x1 <= x0 || y1 <= y0 || width > limit || height > limit {
        return Err(Error::EmptyPicture {
            width,
            height,
            crop: film.crop_window,
        });
    }
    let radius = filter::radius(&film.filter);
    if !radius.iter().all(|&r| r > 0.0 && r <= 64.0) {
        return Err(Error::FilterRadius { radius });
    }
    Ok(())
}
