//! What there is to know of a hit, from the leaf that it was found in.
//!
//! The position of a hit on a triangle is the mean of the corners by its barycentrics, in double precision: it lies in the
//! plane of the triangle but for the rounding of its three coordinates. Other kinds have the point of the ray at the distance
//! of the hit, which is rounded once.

use antumbra_simd::Scalar;

use crate::geometry::PrimRef;
use crate::geometry::instance::{Affine, cross, dot};
use crate::geometry::leaf_block::{LeafBlock, Normal};
use crate::geometry::primitives::PrimKind;
use crate::geometry::ray_setup::RaySetup;
use crate::math;
use crate::ray::{Hit, Ray};
use crate::trace::asked::Found;
use crate::tree::leaves::on_leaf;
use crate::tree::node::ChildKind;
use crate::tree::wide::WideTree;

/// Where a ray hit something: the closest hit with its position and normal.
///
/// 48 bytes: the [`Hit`], the position, the normal.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
#[non_exhaustive]
pub struct Surface {
    /// Distance, barycentrics and ids.
    pub hit: Hit,
    /// The point in the world. On a triangle it is in its plane but for the rounding of each coordinate, at most half a unit in
    /// its last place; in an instance the transform is applied in double precision. On other kinds it is the point of the
    /// ray at the distance of the hit.
    pub position: [f32; 3],
    /// Geometric normal in the world, of length 1, as of [`Bvh::normal`](crate::Bvh::normal). Zero where that has none.
    pub normal: [f32; 3],
}

/// The surface of a hit that was found.
pub(crate) fn surface<const N: usize>(bvh: &WideTree<N>, ray: &Ray, found: &Found) -> Surface {
    let hit = found.hit.told();
    let (mut position, mut normal) = ([0, 1, 2].map(|axis| at(ray, hit.t, axis)), [0.0; 3]);
    let placed = bvh.instances.get(found.instance as usize);
    if let ChildKind::Leaf(leaf) = found.leaf.kind() {
        let mut object = RaySetup::IDLE;
        let here = match placed {
            None => Some(ray),
            // Triangles look at the hit alone.
            Some(_) if [PrimKind::Triangle, PrimKind::Cutout].contains(&leaf.kind) => Some(ray),
            // The ray as the primitive met it.
            Some(placed) => RaySetup::new(ray, bvh.reach).and_then(|world| {
                let entered = placed.placement.enter(Scalar, &world, &mut object);
                entered.map(|_| &*object)
            }),
        };
        let told =
            here.and_then(|ray| on_leaf!(bvh, leaf, block => of_block(block, ray, &found.hit)));
        if let Some((point, found_normal)) = told {
            position = match (point, placed) {
                (None, _) => position,
                (Some(point), None) => point,
                (Some(point), Some(placed)) => Affine::new(&placed.world_from_object).point(point),
            };
            let columns = placed.map(|placed| &placed.placement.object_from_world);
            normal = found_normal
                .and_then(|normal| unit(&normal, columns))
                .unwrap_or(normal);
        }
    }
    Surface {
        hit,
        position: position.map(|x| x as f32),
        normal,
    }
}

/// A coordinate of the point of a ray.
fn at(ray: &Ray, t: f32, axis: usize) -> f64 {
    f64::from(ray.org[axis]) + f64::from(t) * f64::from(ray.dir[axis])
}

/// Point and normal at a hit on a primitive of a block, in the space of the block.
type Here = (Option<[f64; 3]>, Option<Normal>);

fn of_block<B: LeafBlock>(block: &B, ray: &Ray, hit: &Hit) -> Option<Here> {
    let sought = PrimRef {
        geom_id: hit.geom_id,
        prim_id: hit.prim_id,
    };
    let lane = (0..block.count()).find(|&lane| block.id(lane) == sought)?;
    Some((block.point(lane, hit), block.normal(lane, ray, &hit.told())))
}

/// A normal of length 1 in the world, given the columns of the map from the world to the object where it is.
pub(crate) fn unit(normal: &Normal, columns: Option<&[[f32; 4]; 4]>) -> Option<[f32; 3]> {
    let normal = match columns {
        None => normal.direction,
        Some(columns) => world_normal(normal, columns),
    };
    let length = math::sqrt(dot(normal, normal));
    // Not if it is NaN.
    (length > 0.0 && length < f64::INFINITY).then(|| normal.map(|x| (x / length) as f32))
}

/// Takes a normal from an object to the world, given the columns of the map from the world to the object: normals go by
/// its transpose.
fn world_normal(normal: &Normal, columns: &[[f32; 4]; 4]) -> [f64; 3] {
    let [x, y, z, _] = columns.map(|[x, y, z, _]| [x, y, z].map(f64::from));
    let turned = [x, y, z].map(|column| dot(column, normal.direction));
    if normal.mirrors_turn && dot(x, cross(y, z)) < 0.0 {
        turned.map(|x| -x)
    } else {
        turned
    }
}
