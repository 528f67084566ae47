//! Refuses scenes that would panic or make no picture.

use antumbra_scene::material::{Bumped, Mix, NormalMapped, Subsurface};
use antumbra_scene::{DensityGrid, Film, Geometry, Integrator, Material, Medium, Rgb, Scene};

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
        if matches!(shape.geometry, Geometry::Curves(_)) && shape.area_light.is_some() {
            return Err(Error::CurveLight { shape: index });
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
    check_media(scene)?;
    check_bodies(scene)?;
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

/// Whether light goes on inside of shapes of this material.
pub fn is_body(material: &Material) -> bool {
    match material {
        Material::Subsurface(_) => true,
        Material::Disney(disney) => disney.scatters_inside(),
        Material::Bumped(Bumped { material, .. })
        | Material::NormalMapped(NormalMapped { material, .. }) => is_body(material),
        Material::Mix(Mix { materials, .. }) => materials.iter().any(|part| is_body(part)),
        _ => false,
    }
}

/// Refuses bodies where the integrator does not follow light inside, in mixtures, and with impossible numbers.
fn check_bodies(scene: &Scene) -> Result<(), Error> {
    for (index, material) in scene
        .materials
        .iter()
        .enumerate()
        .filter(|(_, m)| is_body(m))
    {
        let inner = match material {
            Material::Bumped(Bumped { material, .. })
            | Material::NormalMapped(NormalMapped { material, .. }) => material,
            material => material,
        };
        let reason = match (inner, scene.integrator) {
            (_, Integrator::DirectLighting { .. }) => "directlighting does not follow light inside",
            (Material::Subsurface(Subsurface { eta, asymmetry, .. }), _) => {
                let good = *eta > 0.0 && eta.is_finite() && asymmetry.abs() < 1.0;
                if good {
                    continue;
                }
                "the index of refraction or the mean cosine is out of range"
            }
            (Material::Disney(_), _) => continue,
            _ => "it is part of a mixture",
        };
        return Err(Error::Interior { index, reason });
    }
    Ok(())
}

/// Checks coefficients and grids of media, and the indices that name media.
fn check_media(scene: &Scene) -> Result<(), Error> {
    for (index, medium) in scene.media.iter().enumerate() {
        let colors = [medium.absorption, medium.scattering];
        let is_good = |color: &Rgb| color.is_finite() && color.min_element() >= 0.0;
        let reason = if !colors.iter().all(is_good) {
            "a coefficient is negative or not finite"
        } else if !(medium.asymmetry > -1.0 && medium.asymmetry < 1.0) {
            "the mean cosine of the phase function is not between -1 and 1"
        } else if medium.density.as_ref().is_some_and(is_broken) {
            "the grid has another number of densities than of cells, a density that is negative or not finite, or a \
             transformation without inverse"
        } else if medium
            .density
            .as_ref()
            .is_some_and(|grid| optical_depth(medium, grid) > MAX_DEPTH)
        {
            "densities times coefficients along the diagonal of the grid are more than a million, so that walks through it \
             do not end"
        } else {
            continue;
        };
        return Err(Error::Medium { index, reason });
    }
    let media = scene.media.len();
    let of_shapes = scene.stored_shapes().filter_map(|shape| shape.media);
    let named = of_shapes.flat_map(|media| [media.inside, media.outside]);
    let mut named = named.flatten().chain(scene.camera.medium);
    match named.find(|&index| index as usize >= media) {
        Some(index) => Err(Error::NoMedium { index, media }),
        None => Ok(()),
    }
}

/// Largest optical depth of a grid: so many steps a ray makes.
const MAX_DEPTH: f32 = 1e6;

/// Optical depth of a grid along its longest diagonal, if all of it were as dense as the densest cell.
fn optical_depth(medium: &Medium, grid: &DensityGrid) -> f32 {
    let densest = grid
        .values
        .iter()
        .fold(0.0, |most: f32, &value| most.max(value));
    let attenuation = (medium.absorption + medium.scattering).max_element();
    let corners = [
        [1.0, 1.0, 1.0],
        [1.0, 1.0, -1.0],
        [1.0, -1.0, 1.0],
        [-1.0, 1.0, 1.0],
    ];
    let lengths = corners.map(|way| grid.world_from_grid.transform_vector3(way.into()).length());
    attenuation * densest * lengths.into_iter().fold(0.0, f32::max)
}

/// Whether a grid cannot be used.
fn is_broken(grid: &DensityGrid) -> bool {
    let cells: u64 = grid.size.iter().map(|&size| u64::from(size)).product();
    let determinant = grid.world_from_grid.determinant();
    cells != grid.values.len() as u64
        || grid.size.contains(&0)
        || grid
            .values
            .iter()
            .any(|&value| !(value >= 0.0 && value.is_finite()))
        || !(determinant.is_finite() && determinant != 0.0)
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
