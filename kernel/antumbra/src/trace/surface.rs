//! Position and normal of a hit, from the leaf of its primitive.
//!
//! The position of a hit is the point of the ray at the distance of the hit, which is rounded once, in double precision. On a
//! triangle it is then moved to the nearest point of the plane. (The mean of the corners by the barycentrics lies in the plane,
//! too, but on long triangles farther from the ray: a rounding of a weight is one of the whole length.)

use antumbra_simd::Scalar;

use crate::geometry::PrimRef;
use crate::geometry::instance::{Affine, cross, dot};
use crate::geometry::leaf_block::{LeafBlock, Normal};
use crate::geometry::ray_setup::RaySetup;
use crate::math;
use crate::ray::{Hit, Ray};
use crate::trace::ray_batch::LocatedHit;
use crate::trace::view::{View, on_seen_leaf};
use crate::tree::node::ChildKind;
use crate::tree::wide::Tree;

/// A closest hit with its position and normal.
///
/// 48 bytes: the [`Hit`], the position, the normal.
///
/// ```
/// # use antumbra::{Bvh, Geometry, Recipe};
/// use antumbra::{Ray, Surface};
///
/// # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
/// # let bvh = Bvh::build(&geometry, &Recipe::default())?;
/// let ray = Ray::new([0.25, 0.25, 0.0], [0.0, 0.0, 1.0]);
/// let seen: Surface = bvh.surface(&ray).expect("a triangle above");
/// assert_eq!((seen.position, seen.normal), ([0.25, 0.25, 1.0], [0.0, 0.0, 1.0]));
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
#[non_exhaustive]
pub struct Surface {
    /// The hit: distance, barycentric coordinates and ids.
    pub hit: Hit,
    /// The point in the world: the point of the ray at the distance `t`, computed in double precision. On a triangle it
    /// is moved to its plane, from which it is then away by no more than the rounding of the three coordinates, half a
    /// unit in the last place of each. In an instance the plane goes through the transformed corners, in double precision.
    pub position: [f32; 3],
    /// Geometric normal in the world, of length 1, as by [`Bvh::normal`](crate::Bvh::normal). Zero if there is none.
    pub normal: [f32; 3],
}

/// The surface of a hit that was found.
pub(crate) fn surface(tree: &Tree, view: impl View, ray: &Ray, found: &LocatedHit) -> Surface {
    let hit = found.hit.told();
    let (mut position, mut normal) = ([0, 1, 2].map(|axis| at(ray, hit.t, axis)), [0.0; 3]);
    let instance = (found.instance != LocatedHit::WORLD).then_some(found.instance as usize);
    let placed = instance.and_then(|index| view.placed(tree, index));
    if let ChildKind::Leaf(leaf) = found.leaf.kind() {
        let mut object = RaySetup::IDLE;
        let here = match instance {
            None => Some(ray),
            // Triangles look only at the hit.
            Some(_) if leaf.kind.is_triangle() => Some(ray),
            // The ray in the object, where the primitive was hit.
            Some(index) => RaySetup::new(ray, tree.reach).and_then(|world| {
                let entered = view.place(Scalar, tree, index, &world, &mut object);
                entered.map(|_| &*object)
            }),
        };
        let told = here.and_then(
            |ray| on_seen_leaf!(Scalar, tree, view, leaf, block => of_block(block, ray, found)),
        );
        if let Some((corners, found_normal)) = told {
            if let Some(corners) = corners {
                let corners = corners.map(|corner| corner.map(f64::from));
                let corners = match &placed {
                    Some((_, world_from_object)) => {
                        let affine = Affine::new(world_from_object);
                        corners.map(|corner| affine.point(corner))
                    }
                    None => corners,
                };
                position = in_plane(position, &corners);
            }
            let columns = placed
                .as_ref()
                .map(|(placement, _)| &placement.object_from_world);
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

/// The nearest point of the plane of a triangle; the point itself if there is no plane.
fn in_plane(point: [f64; 3], [a, b, c]: &[[f64; 3]; 3]) -> [f64; 3] {
    let from_a = |to: &[f64; 3]| [0, 1, 2].map(|axis| to[axis] - a[axis]);
    let normal = cross(from_a(b), from_a(c));
    let share = dot(normal, from_a(&point)) / dot(normal, normal);
    match share.is_finite() {
        true => [0, 1, 2].map(|axis| point[axis] - share * normal[axis]),
        false => point,
    }
}

/// Corners of a triangle, and the normal at a hit on a primitive of a block, in the space of the block.
type Here = (Option<[[f32; 3]; 3]>, Option<Normal>);

fn of_block<B: LeafBlock>(block: &B, ray: &Ray, found: &LocatedHit) -> Option<Here> {
    let hit = &found.hit.told();
    let sought = PrimRef {
        geom_id: found.hit.hit.geom_id,
        prim_id: found.hit.hit.prim_id,
    };
    let lane = (0..block.count()).find(|&lane| block.id(lane) == sought)?;
    Some((block.corners(lane), block.normal(lane, ray, hit)))
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

#[cfg(test)]
mod tests {
    use alloc::vec;

    use antumbra_testkit::Rng;

    use super::*;
    use crate::{Bvh, Geometry, Recipe};

    /// Slivers: points in their plane and on the ray, but for the rounding of three
    /// coordinates and of the distance.
    #[test]
    fn points_are_in_the_plane_and_on_the_ray() {
        let mut rng = Rng::new(31);
        let mut hits = 0;
        for _ in 0..500 {
            let [a, b] = [rng.point(1.0), rng.point(1.0)];
            let near = rng.point(1e-3);
            let c = [0, 1, 2].map(|axis: usize| 0.5 * (a[axis] + b[axis]) + near[axis]);
            let geometry = [Geometry::triangles(vec![a, b, c], vec![[0, 1, 2]])];
            let bvh = Bvh::build(&geometry, &Recipe::default()).expect("a tree");
            let middle = [0, 1, 2].map(|axis: usize| (a[axis] + b[axis] + c[axis]) / 3.0);
            let from = rng.point(3.0);
            let ray = Ray::new(from, [0, 1, 2].map(|axis: usize| middle[axis] - from[axis]));
            let Some(surface) = bvh.surface(&ray) else {
                continue;
            };
            hits += 1;
            let corners = [a, b, c].map(|corner| corner.map(f64::from));
            let point = surface.position.map(f64::from);
            let there = in_plane(point, &corners);
            let along = [0, 1, 2].map(|axis| at(&ray, surface.hit.t, axis));
            for axis in 0..3 {
                assert!((point[axis] - there[axis]).abs() < 2e-7, "{surface:?}");
                assert!((point[axis] - along[axis]).abs() < 1e-6, "{surface:?}");
            }
        }
        assert!(hits > 200, "{hits}");
    }
}
