//! Geometric normals of hits: not of length 1, in the space of the object, as Embree has them.

use antumbra::Hit;

use super::curves::tangent;
use crate::abi::RtcRay;
use crate::geometry::{Kind, State, View};
use crate::scene::Site;

/// Normal at a hit on geometry that is not the client's own.
pub fn normal(site: Site<'_>, ray: &RtcRay, hit: &Hit) -> [f32; 3] {
    let state = site.state();
    let prim = hit.prim_id;
    match site.kind() {
        Kind::Triangles => corners::<3>(state, prim).map_or([0.0; 3], of_triangle),
        Kind::Quads => corners::<4>(state, prim).map_or([0.0; 3], |[a, b, c, d]| {
            let is_first = hit.u + hit.v <= 1.0;
            of_triangle(if is_first { [a, b, d] } else { [c, d, b] })
        }),
        Kind::Spheres => {
            let Some([x, y, z, _]) = item::<4>(state.vertices.as_ref(), prim) else {
                return [0.0; 3];
            };
            let (org, dir) = site.in_object(ray);
            std::array::from_fn(|axis| org[axis] + hit.t * dir[axis] - [x, y, z][axis])
        }
        Kind::Disks => item(state.normals.as_ref(), prim).unwrap_or([0.0; 3]),
        Kind::Curves(basis) => tangent(basis, state, prim, hit.u),
        Kind::User | Kind::Instance | Kind::InstanceArray => [0.0; 3],
    }
}

/// Corners of a primitive, as the buffers have them now.
#[inline]
fn corners<const N: usize>(state: &State, prim: u32) -> Option<[[f32; 3]; N]> {
    let prim = prim as usize;
    let index = state.index.as_ref().filter(|index| prim < index.count)?;
    let vertices = state.vertices.as_ref()?;
    let indices = index.read::<N, u32>(prim);
    let mut corners = [[0.0; 3]; N];
    // A loop: closures over arrays are not inlined, and cost as much as the reads.
    for (corner, index) in corners.iter_mut().zip(indices) {
        if index as usize >= vertices.count {
            return None;
        }
        *corner = vertices.read(index as usize);
    }
    Some(corners)
}

/// The first numbers of an item, as the buffer has it now.
pub fn item<const N: usize>(view: Option<&View>, prim: u32) -> Option<[f32; N]> {
    let prim = prim as usize;
    Some(view.filter(|view| prim < view.count)?.read(prim))
}

fn of_triangle([a, b, c]: [[f32; 3]; 3]) -> [f32; 3] {
    let [p, q] =
        [b, c].map(|corner| -> [f32; 3] { std::array::from_fn(|axis| corner[axis] - a[axis]) });
    [
        p[1] * q[2] - p[2] * q[1],
        p[2] * q[0] - p[0] * q[2],
        p[0] * q[1] - p[1] * q[0],
    ]
}
