//! Shapes: geometry brought to world space, or to that of its object.
//!
//! - `mesh`: triangles as they are given, and where they are cut out
//! - `sphere`: spheres

mod mesh;
mod sphere;

use std::sync::Arc;

use antumbra_scene::{Geometry, TriangleMesh};
use glam::DMat4;

pub(crate) use mesh::Cutouts;
pub(crate) use sphere::ELLIPSOID;

use crate::directive::Quoted;
use crate::mesh_file::MeshFile;
use crate::suggest;
use crate::texture::Textured;

/// Shapes that are read.
pub(crate) const SUPPORTED: &[&str] = &["plymesh", "sphere", "trianglemesh"];

/// Shapes that pbrt-v3 has too.
pub(crate) const UNSUPPORTED: &[&str] = &[
    "cone",
    "curve",
    "cylinder",
    "disk",
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
        "sphere" => {
            let sphere = sphere::sphere(values.lookup, to_world, values.report)?;
            Some((Source::Here(Geometry::Sphere(sphere)), Cutouts::default()))
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

fn moved(mut mesh: TriangleMesh, to_world: &DMat4) -> Source {
    mesh.transform(to_world);
    Source::Here(Geometry::Mesh(Arc::new(mesh)))
}
