//! Geometries as the kernel takes them.

use std::sync::Arc;

use antumbra::Geometry as Kernel;
use antumbra::shapes::{Disk, Sphere};

use super::committed::Placed;
use super::user::UserShape;
use crate::geometry::{Kind, State, View, curves};

/// A geometry as the kernel takes it.
pub fn kernel_geometry(placed: &Placed) -> Kernel<'static> {
    let state = &placed.state;
    match placed.geometry.kind {
        Kind::Triangles => {
            let (positions, indices) = mesh::<3>(state);
            Kernel::triangles(positions, indices)
        }
        Kind::Quads => {
            let (positions, indices) = mesh::<4>(state);
            Kernel::quads(positions, indices)
        }
        Kind::Spheres => {
            let sphere = |[x, y, z, radius]: [f32; 4]| Sphere {
                center: [x, y, z],
                radius,
            };
            Kernel::spheres(points(state).map(sphere).collect::<Vec<_>>())
        }
        Kind::Disks => {
            let normals = state.normals.as_ref();
            let disk = |(index, [x, y, z, radius]): (usize, [f32; 4])| Disk {
                center: [x, y, z],
                normal: (normals.filter(|normals| index < normals.count))
                    .map_or([0.0; 3], |normals| normals.read(index)),
                radius,
            };
            Kernel::disks(points(state).enumerate().map(disk).collect::<Vec<_>>())
        }
        Kind::Curves(basis) => curves::kernel_curves(basis, state),
        Kind::User => {
            let count = state.bounds.map_or(0, |_| state.user_count);
            Kernel::user(count, Arc::new(UserShape(placed.clone())))
        }
        Kind::Instance | Kind::InstanceArray => Kernel::spheres(Vec::new()),
    }
}

/// Points with radii.
fn points(state: &State) -> impl Iterator<Item = [f32; 4]> + '_ {
    (state.vertices.iter()).flat_map(|view| (0..view.count).map(|index| view.read(index)))
}

/// A mesh. Primitives with an index out of range are dropped, as by Embree: their corners are not numbers.
fn mesh<const N: usize>(state: &State) -> (Vec<[f32; 3]>, Vec<[u32; N]>) {
    let vertices = state.vertices.as_ref();
    let count = vertices.map_or(0, |view| view.count);
    let mut positions: Vec<[f32; 3]> = vertices.map_or(Vec::new(), |view| {
        (0..count).map(|index| view.read(index)).collect()
    });
    let nowhere = positions.len() as u32;
    positions.push([f32::NAN; 3]);
    let corners = |index: &View| {
        let all = (0..index.count).map(|prim| index.read::<N, u32>(prim));
        let checked = all.map(|corners| {
            if corners.iter().all(|corner| (*corner as usize) < count) {
                corners
            } else {
                [nowhere; N]
            }
        });
        checked.collect()
    };
    let indices = state.index.as_ref().map_or(Vec::new(), corners);
    (positions, indices)
}
