//! Which way is up: what files say, and what speaks for it where they say nothing.
//!
//! Every command takes the axis from here, so that a mesh has the same up axis in all of them.

use std::path::Path;

use antumbra_scene::{Geometry, Scene};
use glam::{DVec3, Vec3};

use crate::extent::Extent;
use crate::stage::Up;

/// An axis that points up, and why.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Upright {
    /// The axis.
    pub axis: Up,
    /// Reason for the axis, as the end of a sentence such as "z is up, ...".
    pub reason: &'static str,
}

/// A ground has at least this part of the area of the box as seen from above.
const GROUND: f64 = 0.5;
/// Largest ratio of height to shorter side of a scene that is taken to be on a ground.
const HIGHEST: f64 = 0.7;
/// The shortest side is this much shorter than the others where it speaks for an axis.
const FLAT: f64 = 0.5;

impl Upright {
    /// y, before anything is known.
    pub(crate) const DEFAULT: Self = Self {
        axis: Up::Y,
        reason: "the default",
    };

    /// The axis of a scene, by its format, by map coordinates, by a ground, or by the usual one.
    pub(crate) fn of(name: &Path, scene: &Scene, has_camera: bool) -> Self {
        let found = |axis, reason| Self { axis, reason };
        let extension = name.extension().unwrap_or_default().to_string_lossy();
        let extension = extension.to_ascii_lowercase();
        if matches!(extension.as_str(), "gltf" | "glb") {
            return found(Up::Y, "as glTF has it");
        }
        if antumbra_raster::is_raster(name) {
            return found(Up::Z, "as rasters of heights have it");
        }
        if has_camera {
            return found(of_camera(scene), "as its camera has it");
        }
        let extent = Extent::of(scene);
        if is_map(scene.origin) {
            return found(Up::Z, "as map coordinates have it");
        }
        if extent.is_some_and(|extent| has_ground(scene, extent.size())) {
            return found(Up::Z, "which its ground faces");
        }
        found(Up::Y, "as most meshes have it")
    }

    /// The other axis of y and z, if the extent of the scene speaks for it: it is much shorter than both others.
    pub fn doubt(&self, extent: &Extent) -> Option<Up> {
        let size = extent.size();
        let (other, height, depth) = match self.axis {
            Up::Y => (Up::Z, size.z, size.y),
            Up::Z => (Up::Y, size.y, size.z),
            _ => return None,
        };
        (height < FLAT * depth && height < FLAT * size.x).then_some(other)
    }
}

/// Whether east and north are large for a height.
fn is_map(origin: DVec3) -> bool {
    let [x, y, z] = origin.abs().to_array();
    x > 1000.0 && y > 1000.0 && x.min(y) > 10.0 * z
}

/// Whether surfaces together face z as a ground does, which closed bodies do not.
fn has_ground(scene: &Scene, size: DVec3) -> bool {
    if size.z > HIGHEST * size.x.min(size.y) {
        return false;
    }
    let mut area = DVec3::ZERO;
    for shape in &scene.shapes {
        let Geometry::Mesh(mesh) = &shape.geometry else {
            continue;
        };
        for corners in &mesh.indices {
            let corner =
                |which: usize| Vec3::from(mesh.positions[corners[which] as usize]).as_dvec3();
            let twice = (corner(1) - corner(0)).cross(corner(2) - corner(0));
            if twice.is_finite() {
                area += 0.5 * twice;
            }
        }
    }
    let [x, y, z] = area.abs().to_array();
    z > x.max(y) && z >= GROUND * size.x * size.y && z > 0.0
}

/// Axis that points up in the picture, as far as an axis does.
fn of_camera(scene: &Scene) -> Up {
    let up = scene.camera.world_from_camera.y_axis;
    let axes = [
        (up.y, Up::Y),
        (up.z, Up::Z),
        (up.x, Up::X),
        (-up.y, Up::MinusY),
        (-up.z, Up::MinusZ),
        (-up.x, Up::MinusX),
    ];
    let mut best = axes[0];
    for axis in axes {
        if axis.0 > best.0 {
            best = axis;
        }
    }
    best.1
}
