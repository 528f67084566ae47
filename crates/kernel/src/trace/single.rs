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
    let mut next = Child::ROOT;
    loop {
        match next.kind() {
            ChildKind::Inner(index) => {
                let node = &bvh.nodes[index];
                let (mask, entry) = node_step::<S, N>(simd, node, ray, query.limit(ray));
                // The first child comes out of a register: a detour through the stack would cost a
                // store and a load in the chain that everything waits for.
                if let Some(child) = query.node::<S, N>(stack, index, node, mask, entry) {
                    next = child;
                    continue;
                }
            }
            ChildKind::Leaf(leaf) => {
                if query.leaf(simd, bvh, leaf, ray) {
                    return;
                }
            }
        }
        let Some(child) = query.pop(stack) else {
            return;
        };
        next = Child(child);
    }
}
