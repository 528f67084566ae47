//! The traversal that tells what it does: rays one after another, any order of children, any observer.
//!
//! Counts, logs and orders that look at the ray share this one loop. The order and the observer are chosen at run time,
//! so the loop is compiled once per width and level. Node steps and leaf steps are those of [`crate::trace::single`], and
//! so are the answers.

use antumbra_simd::{Mask, Simd, Width, WithSimd};

use crate::geometry::ray_setup::RaySetup;
use crate::ray::Ray;
use crate::trace::observe::{NodeVisit, Observer, Place};
use crate::trace::pick::Pick;
use crate::trace::step::{NodeLanes, NodeTest, leaf_occluder};
use crate::tree::node::{Child, ChildKind};
use crate::tree::wide::Bvh;

/// A child still to visit, and where the ray comes to it from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Open {
    child: Child,
    from: Place,
}

/// Occlusion of `rays` one by one; `answers` is as long.
pub(crate) struct Instrumented<'a, const N: usize> {
    pub bvh: &'a Bvh<N>,
    /// Memory of a stack.
    pub stack: &'a mut Vec<Open>,
    pub pick: Pick<'a>,
    pub observer: &'a mut dyn Observer,
    pub rays: &'a [Ray],
    pub answers: &'a mut [bool],
}

impl<const N: usize> WithSimd<N> for Instrumented<'_, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd + Width<N>>(self, simd: S) {
        let Self {
            bvh,
            stack,
            mut pick,
            observer,
            rays,
            answers,
        } = self;
        let mut setup = RaySetup::IDLE;
        let mut object_setup = RaySetup::IDLE;
        for (index, (ray, answer)) in rays.iter().zip(answers).enumerate() {
            observer.begin(index, ray);
            pick.begin(ray);
            *answer = setup.set(simd, ray, bvh.reach) && {
                let setups = (&setup, &mut object_setup);
                traverse::<S, N>(simd, bvh, setups, stack, &mut pick, observer)
            };
            observer.end();
        }
    }
}

/// Whether anything occludes the ray. The ray is given as made ready for the world, and memory for it as made ready for
/// the object of an instance.
#[inline(always)]
fn traverse<S: Simd + Width<N>, const N: usize>(
    simd: S,
    bvh: &Bvh<N>,
    (world, object): (&RaySetup, &mut RaySetup),
    stack: &mut Vec<Open>,
    pick: &mut Pick<'_>,
    observer: &mut dyn Observer,
) -> bool {
    let goes_on = observer.goes_on();
    let mut occluded = false;
    let mut ray = world;
    stack.clear();
    stack.push(Open {
        child: Child::ROOT,
        from: Place::NONE,
    });
    while let Some(Open { child, from }) = stack.pop() {
        match child.kind() {
            ChildKind::Inner(index) => {
                let node = &bvh.nodes[index];
                let test = NodeTest::<S, N>::new(simd, ray);
                let (mask, entry) = test.step(simd, &node.planes, ray.tfar);
                let visit = observer.node(&NodeVisit {
                    node: index,
                    from,
                    lanes: mask.bits(),
                    width: N,
                    ray,
                });
                let (lanes, count) = pick.lanes::<N, NodeLanes<S, N>>(index, ray, mask, entry);
                for &lane in &lanes[..count] {
                    let slot = N as u32 - 1 - lane;
                    stack.push(Open {
                        child: Child(node.children[lane as usize % N]),
                        from: Place { visit, slot },
                    });
                }
            }
            ChildKind::Leaf(leaf) => {
                let found = leaf_occluder::<S, N, false>(simd, bvh, leaf, ray);
                let index = bvh.leaf_index(leaf);
                observer.leaf(index, bvh.leaf_len(leaf));
                if let Some(lane) = found {
                    observer.occluder(index, lane, from);
                    occluded = true;
                    if !goes_on {
                        break;
                    }
                }
            }
            ChildKind::Instance(_) if child == Child::EXIT => {
                ray = world;
                observer.exit();
            }
            ChildKind::Instance(index) => {
                ray = world;
                let placed = &bvh.instances[index];
                if placed.placement.enter(simd, world, object).is_some() {
                    observer.enter(bvh.instance_index(index));
                    ray = &*object;
                    for child in [Child::EXIT, Child::inner(placed.root as usize)] {
                        stack.push(Open { child, from });
                    }
                }
            }
        }
    }
    occluded
}
