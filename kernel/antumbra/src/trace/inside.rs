//! What is around a point: which primitives a half-line along x crosses.

use alloc::vec::Vec;

use crate::aabb::Aabb;
use crate::geometry::PrimRef;
use crate::geometry::instance::{Affine, Placement, cross, dot};
use crate::geometry::leaf_block::LeafBlock;
use crate::tree::leaves::on_leaf;
use crate::tree::node::ChildKind;
use crate::tree::wide::Tree;

/// The point in the object of an instance, and the sign by which winding numbers change on the way, negative for
/// mirrors; `None` where the point lies outside the box of the instance, where its object does not count.
pub(crate) fn into_object(
    placement: &Placement,
    world_from_object: &[[f32; 4]; 3],
    point: [f64; 3],
) -> Option<([f64; 3], i32)> {
    let [low, high] = &placement.planes;
    for axis in 0..3 {
        if point[axis] < f64::from(low[axis]) || point[axis] > f64::from(high[axis]) {
            return None;
        }
    }
    let affine = Affine::new(world_from_object);
    let [x, y, z] = affine.rows.map(|[a, b, c, _]| [a, b, c]);
    let sign = if dot(x, cross(y, z)) < 0.0 { -1 } else { 1 };
    Some((affine.inverse()?.point(point), sign))
}

/// Winding number around a point, and whether the point is inside.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Around {
    /// Sum of all signed crossings.
    pub winding: i32,
    /// Whether some geometry is crossed an odd number of times.
    pub is_inside: bool,
}

impl Around {
    /// Sums up signed crossings of one list of geometries. Several crossings of one primitive count once.
    pub fn new(crossings: &mut Vec<(PrimRef, i32)>) -> Self {
        crossings.retain(|(_, count)| *count != 0);
        crossings.sort_unstable_by_key(|(id, _)| *id);
        crossings.dedup_by_key(|(id, _)| *id);
        let of_one_geometry = crossings.chunk_by(|(a, _), (b, _)| a.geom_id == b.geom_id);
        let mut around = Self::default();
        for crossings in of_one_geometry {
            around.winding += crossings.iter().map(|(_, count)| count).sum::<i32>();
            around.is_inside |= crossings.len() % 2 == 1;
        }
        around
    }

    /// Adds what is around the point in an instance. `sign` is the one that [`into_object`] returns.
    pub fn add(&mut self, sign: i32, other: Self) {
        self.winding += sign * other.winding;
        self.is_inside |= other.is_inside;
    }
}

/// Winding number around a point, which is finite, and whether the point is inside.
pub(crate) fn around(tree: &Tree, point: [f32; 3], memory: &mut Vec<u32>) -> Around {
    let point = point.map(f64::from);
    let mut met = Met::default();
    let mut instances = Vec::new();
    met.walk(tree, 0, point, memory, &mut instances);
    let mut around = met.around();
    for index in instances {
        let placed = &tree.instances[index];
        if let Some((point, sign)) =
            into_object(&placed.placement, &placed.world_from_object, point)
        {
            met.walk(tree, placed.root as usize, point, memory, &mut Vec::new());
            around.add(sign, met.around());
        }
    }
    around
}

/// Primitives crossed, with their signed crossings. A primitive in several leaves is listed more than once.
#[derive(Default)]
struct Met {
    primitives: Vec<(PrimRef, i32)>,
}

impl Met {
    /// Visits what the half-line may cross below a node. Instances are only listed.
    fn walk(
        &mut self,
        tree: &Tree,
        root: usize,
        point: [f64; 3],
        stack: &mut Vec<u32>,
        instances: &mut Vec<usize>,
    ) {
        stack.clear();
        stack.push(root as u32);
        while let Some(index) = stack.pop() {
            let children = tree.nodes.get(index as usize).children();
            for (child, _) in children.filter(|(_, bounds)| is_met(bounds, point)) {
                match child.kind() {
                    ChildKind::Inner(index) => stack.push(index as u32),
                    ChildKind::Leaf(leaf) => on_leaf!(tree, leaf, block => self.add(block, point)),
                    ChildKind::Instance(index) => instances.push(index),
                }
            }
        }
    }

    fn add<B: LeafBlock>(&mut self, block: &B, point: [f64; 3]) {
        for lane in 0..block.count() {
            let count = block.crossing(lane, point);
            if count != 0 {
                self.primitives.push((block.id(lane), count));
            }
        }
    }

    /// Sums up the crossings so far, and forgets them.
    fn around(&mut self) -> Around {
        let around = Around::new(&mut self.primitives);
        self.primitives.clear();
        around
    }
}

/// Whether the half-line hits the box of a child.
#[inline(always)]
fn is_met(Aabb { min, max }: &Aabb, [x, y, z]: [f64; 3]) -> bool {
    (x <= max[0].into())
        & (f64::from(min[1]) <= y)
        & (y <= max[1].into())
        & (f64::from(min[2]) <= z)
        & (z <= max[2].into())
}
