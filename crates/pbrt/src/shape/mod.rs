//! Shapes: geometry brought to world space, or to that of its object.
//!
//! - `mesh`: triangles as they are given, and where they are cut out
//! - `sphere`: spheres
//! - `quadric`, `curve`, `grid`: smooth surfaces as meshes

mod curve;
mod grid;
mod mesh;
mod quadric;
mod sphere;

use std::sync::Arc;

use antumbra_scene::{Geometry, TriangleMesh};
use glam::DMat4;

pub(crate) use mesh::Cutouts;
use quadric::Fineness;

use crate::directive::Quoted;
use crate::mesh_file::MeshFile;
use crate::suggest;
use crate::texture::Textured;

/// Shapes that are read.
pub(crate) const SUPPORTED: &[&str] = &[
    "curve",
    "cylinder",
    "disk",
    "plymesh",
    "sphere",
    "trianglemesh",
];

/// Shapes that pbrt-v3 has too.
pub(crate) const UNSUPPORTED: &[&str] = &[
    "cone",
    "heightfield",
    "hyperboloid",
    "loopsubdiv",
    "nurbs",
    "paraboloid",
];

/// Where the points of a shape come from.
pub(crate) enum Source {
    Here(Geometry),
    File(MeshFile),
}

/// The geometry of a shape in world space, or in that of its object, and where it is cut out. `None`: something
/// was reported.
pub(crate) fn read(
    kind: &Quoted,
    values: &mut Textured,
    to_world: &DMat4,
) -> Option<(Source, Cutouts)> {
    let now = &values.state.now;
    let is_emitter = now.area_light.is_some() && now.object.is_none();
    let fineness = Fineness::of(is_emitter);
    match kind.text.as_str() {
        "trianglemesh" => {
            let cutouts = mesh::cutouts(values);
            let mesh = mesh::triangle_mesh(values.lookup, values.report)?;
            Some((moved(mesh, to_world), cutouts))
        }
        "plymesh" => {
            let cutouts = mesh::cutouts(values);
            let file = mesh::ply_mesh(values.lookup, to_world, values.report)?;
            Some((Source::File(file), cutouts))
        }
        "curve" => {
            let mesh = curve::curve(values.lookup, values.report)?;
            if is_emitter {
                let at = values.lookup.at;
                values.report.unsupported(at, "an area light on a curve is");
            }
            without_cutouts(moved(mesh, to_world))
        }
        "cylinder" => {
            let mesh = quadric::cylinder(values.lookup, fineness, values.report)?;
            without_cutouts(moved(mesh, to_world))
        }
        "disk" => {
            let mesh = quadric::disk(values.lookup, fineness, values.report)?;
            without_cutouts(moved(mesh, to_world))
        }
        "sphere" => {
            let geometry = sphere::sphere(values.lookup, to_world, fineness, values.report)?;
            without_cutouts(Source::Here(geometry))
        }
        name => {
            values.lookup.ignore_all();
            if UNSUPPORTED.contains(&name) {
                let feature = format!("shape {name:?} is");
                values.report.unsupported(kind.span, feature);
            } else {
                let message = format!("unknown shape {name:?}");
                let help = suggest::help(name, SUPPORTED);
                values.report.error_help(kind.span, message, help);
            }
            None
        }
    }
}

/// Only meshes that are given as such can be cut out, as in pbrt-v3.
fn without_cutouts(source: Source) -> Option<(Source, Cutouts)> {
    Some((source, Cutouts::default()))
}

fn moved(mut mesh: TriangleMesh, to_world: &DMat4) -> Source {
    mesh.transform(to_world);
    Source::Here(Geometry::Mesh(Arc::new(mesh)))
}
