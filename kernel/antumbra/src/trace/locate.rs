//! Place of the primitive of a hit in the tree. Trees have no table of their primitives: the ray finds the way again.
//!
//! Plain scalar code: the boxes around one point are few.

use antumbra_simd::{Mask, Scalar, Width};

use crate::geometry::PrimRef;
use crate::geometry::leaf_block::{LeafBlock, Normal};
use crate::geometry::quad::{half_at, quad_of};
use crate::geometry::ray_setup::RaySetup;
use crate::ray::{Hit, INVALID_ID, Ray};
use crate::trace::step::NodeTest;
use crate::tree::leaves::on_leaf;
use crate::tree::node::{Child, ChildKind};
use crate::tree::wide::WideTree;

/// A primitive that was hit.
pub(crate) struct Located {
    /// Normal of the primitive at the hit, in the primitive's own space.
    pub normal: Option<Normal>,
    /// Index of its instance in [`WideTree::instances`].
    pub instance: Option<usize>,
}

/// The primitive that `hit` names; `None` unless the ray comes by a primitive of these ids. `stack` is memory of one for
/// this tree.
pub(crate) fn locate<const N: usize>(
    bvh: &WideTree<N>,
    stack: &mut [u32],
    ray: &Ray,
    hit: &Hit,
) -> Option<Located>
where
    Scalar: Width<N>,
{
    let here = Ray {
        tnear: hit.t.next_down(),
        tfar: hit.t.next_up(),
        ..*ray
    };
    // A distance in an instance may have been clamped to the instance interval, and the boxes in there know nothing of it.
    let anywhere = Ray {
        tnear: f32::NEG_INFINITY,
        tfar: f32::INFINITY,
        ..*ray
    };
    // Next to the diagonal of a quad rounding may give the other half.
    let half = half_at([hit.u, hit.v]);
    [half, 1 - half].into_iter().find_map(|half| {
        let sought = Sought {
            hit,
            half,
            interval: (ray.tnear, ray.tfar),
        };
        [here, anywhere].iter().find_map(|ray| {
            let world = RaySetup::new(ray, bvh.reach)?;
            search(bvh, stack, (Child::ROOT, None), &world, &sought)
        })
    })
}

/// The primitive to find.
struct Sought<'a> {
    hit: &'a Hit,
    /// Half to find, 0 or 1, if the primitive is a quad.
    half: usize,
    /// Interval of the ray that was hit.
    interval: (f32, f32),
}

impl Sought<'_> {
    fn is(&self, id: PrimRef) -> bool {
        let PrimRef { geom_id, prim_id } = id.told();
        (geom_id, prim_id) == (self.hit.geom_id, self.hit.prim_id)
            && quad_of(id.prim_id).is_none_or(|(_, half)| half == self.half)
    }
}

/// Searches the tree below a root: the root of the world, or of the object that an instance places.
fn search<const N: usize>(
    bvh: &WideTree<N>,
    stack: &mut [u32],
    (root, instance): (Child, Option<usize>),
    ray: &RaySetup,
    sought: &Sought<'_>,
) -> Option<Located>
where
    Scalar: Width<N>,
{
    let test = NodeTest::<Scalar, N>::new(Scalar, ray);
    let is_its_tree = instance.is_some() == (sought.hit.inst_id != INVALID_ID);
    stack[0] = root.0;
    let mut top = 1;
    while top > 0 {
        top -= 1;
        match Child(stack[top]).kind() {
            ChildKind::Inner(index) => {
                let node = &bvh.nodes[index];
                let (mask, _) = test.step(Scalar, &node.planes, ray.tfar);
                let mut lanes = mask.bits();
                while lanes != 0 {
                    stack[top] = node.children[lanes.trailing_zeros() as usize % N];
                    top += 1;
                    lanes &= lanes - 1;
                }
            }
            ChildKind::Leaf(leaf) if is_its_tree => {
                if let Some(normal) = on_leaf!(bvh, leaf, block => named(block, ray, sought)) {
                    return Some(Located { normal, instance });
                }
            }
            ChildKind::Instance(index) => {
                let placed = &bvh.instances[index];
                let mut object = RaySetup::IDLE;
                if placed.placement.inst_id == sought.hit.inst_id
                    && placed.placement.enter(Scalar, ray, &mut object).is_some()
                {
                    let root = Child::inner(placed.root as usize);
                    let below = (root, Some(index));
                    if let Some(found) = search(bvh, &mut stack[top..], below, &object, sought) {
                        return Some(found);
                    }
                }
            }
            ChildKind::Leaf(_) => {}
        }
    }
    None
}

/// The normal of the primitive that is sought, if that is in the block.
fn named<B: LeafBlock>(block: &B, ray: &Ray, sought: &Sought<'_>) -> Option<Option<Normal>> {
    let lane = (0..block.count()).find(|lane| sought.is(block.id(*lane)))?;
    // The search was for hits at one distance.
    let (tnear, tfar) = sought.interval;
    let ray = Ray {
        tnear,
        tfar,
        ..*ray
    };
    Some(block.normal(lane, &ray, sought.hit))
}
