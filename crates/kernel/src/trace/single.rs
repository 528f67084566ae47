//! The traversal of one ray.

use antumbra_simd::{Simd, Width};

use super::query::Query;
use super::setup::RaySetup;
use super::stack::Stack;
use super::step::node_step;
use crate::bvh::Bvh;
use crate::node::{Child, ChildKind};

/// Visits the nodes and leaves that `query` wants, until it is done or nothing is left.
#[inline(always)]
pub(crate) fn traverse<S, const N: usize, Q: Query>(
    simd: S,
    bvh: &Bvh<N>,
    ray: &RaySetup,
    stack: &mut Stack,
    query: &mut Q,
) where
    S: Simd + Width<N>,
{
    stack.clear();
    stack.push_with_entry(Child::ROOT.0, f32::NEG_INFINITY);
    while let Some(child) = query.pop(stack) {
        match Child(child).kind() {
            ChildKind::Inner(index) => {
                let node = &bvh.nodes[index];
                let (mask, entry) = node_step::<S, N>(simd, node, ray, query.limit(ray));
                query.node::<S, N>(stack, index, node, mask, entry);
            }
            ChildKind::Leaf(leaf) => {
                if query.leaf(simd, bvh, leaf, ray) {
                    return;
                }
            }
        }
    }
}
