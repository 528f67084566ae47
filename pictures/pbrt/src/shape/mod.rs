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

use antumbra_scene::{Geometry, TriangleMesh};
use glam::{DMat4, DVec3};

pub(crate) use mesh::Cutouts;
use quadric::Tessellation;

use crate::directive::Quoted;
use crate::mesh_file::MeshFile;
use crate::suggest;
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
    kind: &Quoted,
    values: &mut Textured,
    to_world: &DMat4,
    middle: DVec3,
) -> Option<(Source, Cutouts)> {
    let now = &values.state.now;
    let is_emitter = now.area_light.is_some() && now.object.is_none();
    let tessellation = Tessellation::of(is_emitter);
    match kind.text.as_str() {
        "trianglemesh" => {
            let cutouts = mesh::cutouts(values);
            let mesh = mesh::triangle_mesh(values.lookup, middle, values.report)?;
            let to_world = to_world * DMat4::from_translation(middle);
            Some((moved(mesh, &to_world), cutouts))
        }
        "loopsubdiv" => {
            let mesh = mesh::subdivided(values.lookup, middle, values.report)?;
            without_cutouts(moved(mesh, &(to_world * DMat4::from_translation(middle))))
        }
        "plymesh" => {
            let cutouts = mesh::cutouts(values);
            let file = mesh::ply_mesh(values.lookup, (to_world, middle), values.report)?;
            Some((Source::File(file), cutouts))
        }
        "bilinearmesh" if values.report.is_version4 => {
            let cutouts = mesh::cutouts(values);
            let mesh = bilinear::bilinear_mesh(values.lookup, middle, values.report)?;
            let to_world = to_world * DMat4::from_translation(middle);
            Some((moved(mesh, &to_world), cutouts))
        }
        "curve" => {
            let geometry = curve::curve(values.lookup, middle, values.report)?;
            if is_emitter {
                let at = values.lookup.at;
                values.report.unsupported(at, "an area light on a curve is");
            }
            let to_world = to_world * DMat4::from_translation(middle);
            without_cutouts(Source::Here(match geometry {
                Geometry::Curves(mut curves) => {
                    Arc::make_mut(&mut curves).transform(&to_world);
                    Geometry::Curves(curves)
                }
                Geometry::Mesh(mut mesh) => {
                    Arc::make_mut(&mut mesh).transform(&to_world);
                    Geometry::Mesh(mesh)
                }
                Geometry::Sphere(sphere) => Geometry::Sphere(sphere),
            }))
        }
        "cylinder" => {
            let mesh = quadric::cylinder(values.lookup, tessellation, values.report)?;
            without_cutouts(moved(mesh, to_world))
        }
        "cone" => {
            let mesh = revolved::cone(values.lookup, tessellation, values.report)?;
            without_cutouts(moved(mesh, to_world))
        }
        "paraboloid" => {
            let mesh = revolved::paraboloid(values.lookup, tessellation, values.report)?;
            without_cutouts(moved(mesh, to_world))
        }
        "hyperboloid" => {
            let mesh = revolved::hyperboloid(values.lookup, tessellation, values.report)?;
            without_cutouts(moved(mesh, to_world))
        }
        "heightfield" => {
            let mesh = heightfield::heightfield(values.lookup, values.report)?;
            without_cutouts(moved(mesh, to_world))
        }
        "nurbs" => {
            let mesh = nurbs::nurbs(values.lookup, values.report)?;
            without_cutouts(moved(mesh, to_world))
        }
        "disk" => {
            let mesh = quadric::disk(values.lookup, tessellation, values.report)?;
            without_cutouts(moved(mesh, to_world))
        }
        "sphere" => {
            let geometry = sphere::sphere(values.lookup, to_world, tessellation, values.report)?;
            without_cutouts(Source::Here(geometry))
        }
        name => {
            values.lookup.ignore_all();
            let known = match values.report.is_version4 {
                true => [SUPPORTED, SUPPORTED4].concat(),
                false => SUPPORTED.to_vec(),
            };
            let message = format!("unknown shape {name:?}");
            let help = suggest::help(name, &known);
            values.report.error_help(kind.span, message, help);
            None
        }
    }
}

/// Geometry without alpha masks. Only meshes given as triangles can have them, as in pbrt-v3.
fn without_cutouts(source: Source) -> Option<(Source, Cutouts)> {
    Some((source, Cutouts::default()))
}

fn moved(mut mesh: TriangleMesh, to_world: &DMat4) -> Source {
    mesh.transform(to_world);
    Source::Here(Geometry::Mesh(Arc::new(mesh)))
}
