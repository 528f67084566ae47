//! Directives for shapes: geometry in world space, or in the space of its object.
//!
//! - `mesh`: triangle meshes and their alpha masks;  `subdivision`: meshes that are made smooth
//! - `bilinear`: patches of pbrt-v4;  `sphere`: spheres
//! - `curve`: curves;  `ribbon`: curves that become meshes
//! - `quadric`, `revolved`, `nurbs`: smooth surfaces, tessellated to meshes by `grid`;  `heightfield`: heights

mod bilinear;
mod curve;
mod grid;
mod heightfield;
mod mesh;
mod nurbs;
mod quadric;
mod revolved;
mod ribbon;
mod sphere;
mod subdivision;

use std::sync::Arc;

use antumbra_scene::Geometry;
use glam::{DMat4, DVec3};

pub(crate) use mesh::Cutouts;
use quadric::Tessellation;

use crate::mesh_file::MeshFile;
use crate::texture::Textured;

/// Supported shapes.
pub(crate) const SUPPORTED: &[&str] = &[
    "cone",
    "curve",
    "cylinder",
    "disk",
    "heightfield",
    "hyperboloid",
    "loopsubdiv",
    "nurbs",
    "paraboloid",
    "plymesh",
    "sphere",
    "trianglemesh",
];

/// Shapes of pbrt-v4 that version 3 does not have.
pub(crate) const SUPPORTED4: &[&str] = &["bilinearmesh"];

/// Source of a shape's geometry: the scene itself, or a file.
pub(crate) enum Source {
    Here(Geometry),
    File(MeshFile),
}

/// Reads the geometry of a shape, in world space or in the space of its object, and its alpha masks. Vertices of meshes are
/// measured from `middle`, a point of their own space, before they are rounded.
///
/// `None`: a mistake was reported.
pub(crate) fn read(
    values: &mut Textured,
    to_world: &DMat4,
    middle: DVec3,
) -> Option<(Source, Cutouts)> {
    let now = &values.state.now;
    let is_emitter = now.area_light.is_some() && now.object.is_none();
    let tessellation = Tessellation::of(is_emitter);
    let from_middle = to_world * DMat4::from_translation(middle);
    // Only meshes given as triangles can have alpha masks, as in pbrt-v3.
    let kind = values.kind.text.as_str();
    let cutouts = match kind {
        "trianglemesh" | "plymesh" => mesh::cutouts(values),
        "bilinearmesh" if values.is_version4() => mesh::cutouts(values),
        _ => Cutouts::default(),
    };
    let lookup = &mut values.lookup;
    let (mut mesh, to_world) = match kind {
        "trianglemesh" => (mesh::triangle_mesh(lookup, middle)?, &from_middle),
        "loopsubdiv" => (mesh::subdivided(lookup, middle)?, &from_middle),
        "bilinearmesh" if lookup.is_version4() => {
            (bilinear::bilinear_mesh(lookup, middle)?, &from_middle)
        }
        "plymesh" => {
            let file = mesh::ply_mesh(lookup, (to_world, middle))?;
            return Some((Source::File(file), cutouts));
        }
        "curve" => {
            let geometry = curve::curve(lookup, middle, &from_middle)?;
            if is_emitter {
                lookup.unsupported("an area light on a curve is");
            }
            return Some((Source::Here(geometry), cutouts));
        }
        "sphere" => {
            let geometry = sphere::sphere(lookup, to_world, tessellation)?;
            return Some((Source::Here(geometry), cutouts));
        }
        "cylinder" => (quadric::cylinder(lookup, tessellation)?, to_world),
        "disk" => (quadric::disk(lookup, tessellation)?, to_world),
        "cone" => (revolved::cone(lookup, tessellation)?, to_world),
        "paraboloid" => (revolved::paraboloid(lookup, tessellation)?, to_world),
        "hyperboloid" => (revolved::hyperboloid(lookup, tessellation)?, to_world),
        "heightfield" => (heightfield::heightfield(lookup)?, to_world),
        "nurbs" => (nurbs::nurbs(lookup)?, to_world),
        _ => {
            let more = if lookup.is_version4() {
                SUPPORTED4
            } else {
                &[]
            };
            lookup.unknown(&[SUPPORTED, more].concat());
            return None;
        }
    };
    mesh.transform(to_world);
    Some((Source::Here(Geometry::Mesh(Arc::new(mesh))), cutouts))
}
