//! The traversal that reports what it does: rays one after another, any order of children, any observer.
//!
//! Counts, logs and orders that look at the ray share this one loop. The order and the observer are chosen at run time,
//! so the loop is compiled once per width and level. Node steps and leaf steps are the ones of [`crate::trace::single`],
//! and so are the answers.

use alloc::vec::Vec;

use antumbra_simd::{Mask, Simd, Width, WithSimd};

use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::ray_setup::RaySetup;
use crate::ray::Ray;
use crate::trace::observe::{NodeVisit, Observer, Place};
use crate::trace::pick::Pick;
use crate::trace::step::{NodeLanes, NodeTest};
use crate::tree::leaves::on_leaf;
use crate::tree::node::{Child, ChildKind};
use crate::tree::wide::WideTree;

/// A child still to visit, and where the ray comes to it from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Open {
    child: Child,
    from: Place,
}

/// Occlusion of `rays` one by one; `answers` is as long.
pub(crate) struct Instrumented<'a, const N: usize> {
    pub bvh: &'a WideTree<'a, N>,
    /// Memory of a stack.
    pub stack: &'a mut Vec<Open>,
    pub pick: Pick,
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
    bvh: &WideTree<N>,
    (world, object): (&RaySetup, &mut RaySetup),
    stack: &mut Vec<Open>,
    pick: &mut Pick,
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
                });
                let hit = (mask, entry);
                let (lanes, count) = pick.lanes::<N, NodeLanes<S, N>>(bvh, hit);
                for &lane in &lanes[..count] {
                    let slot = N as u32 - 1 - lane;
                    stack.push(Open {
                        child: Child(node.children[lane as usize % N]),
                        from: Place { visit, slot },
                    });
                }
            }
            ChildKind::Leaf(leaf) => {
                let found = on_leaf!(bvh, leaf, block => block.occluded(simd, ray, &bvh.filters));
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
                    let root = Child(placed.root);
                    for child in [Child::EXIT, root] {
                        stack.push(Open { child, from });
                    }
                }
            }
        }
    }
    occluded
}

#[cfg(test)]
mod tests {
    use alloc::vec;

    use antumbra_simd::{Dispatch, Isa, Row};
    use antumbra_testkit::{Rng, mesh};

    use super::*;
    use crate::Bvh;
    use crate::api::steps::Steps;
    use crate::builder::Builder;
    use crate::error::Error;
    use crate::geometry::primitives::Primitives;
    use crate::geometry::{Geometry, Instance};
    use crate::learn::Log;
    use crate::order::Plan;
    use crate::trace::engine::Engine;
    use crate::trace::pick::Shuffle;
    use crate::tree::binary::BinaryTree;
    use crate::tree::costs::CostModel;
    use crate::tree::slot_order::{self, SlotOrder};
    use crate::tree::wide::Tree;
    use crate::tree::width::Width as NodeWidth;

    /// The farthest box first.
    struct Farthest;

    impl Row for Farthest {
        fn name(&self) -> &'static str {
            "farthest"
        }

        fn sentence(&self) -> &'static str {
            "The farthest box first"
        }

        fn source(&self) -> Option<&'static str> {
            None
        }
    }

    impl Plan for Farthest {
        fn plan(&self, tree: &Tree, _: Option<&Log>, _: &CostModel) -> Result<SlotOrder, Error> {
            Ok(SlotOrder::of_nothing(tree))
        }

        fn pick(&self) -> Option<&'static dyn slot_order::Pick> {
            Some(&Farthest)
        }
    }

    impl slot_order::Pick for Farthest {
        fn sort(&self, entered: &[f32], lanes: &mut [u32]) {
            lanes.sort_by(|a, b| entered[*a as usize].total_cmp(&entered[*b as usize]));
        }
    }

    /// Checks every place that is reported to it against the tree.
    struct Check<'a> {
        bvh: &'a WideTree<'a, 8>,
        goes_on: bool,
        /// Nodes visited by the current ray.
        nodes: Vec<usize>,
        /// Occluders of the current ray.
        occluders: usize,
        nodes_of_all: usize,
        occluders_of_all: usize,
    }

    impl Check<'_> {
        fn child(&self, from: Place) -> ChildKind {
            let node = &self.bvh.nodes[self.nodes[from.visit as usize]];
            node.any().kind(from.slot as usize)
        }
    }

    impl Observer for Check<'_> {
        fn begin(&mut self, _index: usize, _ray: &Ray) {
            self.nodes.clear();
            self.occluders = 0;
        }

        fn goes_on(&self) -> bool {
            self.goes_on
        }

        fn node(&mut self, visit: &NodeVisit) -> u32 {
            if visit.from == Place::NONE {
                assert_eq!(
                    (visit.node, self.nodes.len()),
                    (0, 0),
                    "the root comes first"
                );
            } else {
                match self.child(visit.from) {
                    ChildKind::Inner(index) => assert_eq!(index, visit.node),
                    ChildKind::Instance(index) => {
                        assert_eq!(self.bvh.instances[index].root as usize, visit.node);
                    }
                    ChildKind::Leaf(leaf) => panic!("{leaf:?} is no node"),
                }
            }
            self.nodes.push(visit.node);
            self.nodes.len() as u32 - 1
        }

        fn occluder(&mut self, leaf: usize, _lane: usize, from: Place) {
            match self.child(from) {
                ChildKind::Leaf(found) => assert_eq!(self.bvh.leaf_index(found), leaf),
                other => panic!("{other:?} is no leaf"),
            }
            self.occluders += 1;
            assert!(
                self.goes_on || self.occluders == 1,
                "went on behind an occluder"
            );
        }

        fn end(&mut self) {
            self.nodes_of_all += self.nodes.len();
            self.occluders_of_all += self.occluders;
        }
    }

    /// Every pick and every observer gives the plain answers, and reports where each child comes from. Rays that go on
    /// visit the same nodes and occluders in any order, and more than rays that stop.
    #[test]
    fn answers_are_plain_and_places_lead_to_children() {
        let mut rng = Rng::new(81);
        let object = mesh::soup(&mut rng, 60);
        let world = mesh::bumpy_grid(&mut rng, 60);
        let [object, world] = [&object, &world]
            .map(|mesh| [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])]);
        let instances: Vec<_> = (0..30)
            .map(|_| {
                Instance::new(
                    0,
                    core::array::from_fn(|_| core::array::from_fn(|_| rng.range(-1.0, 1.0))),
                )
            })
            .collect();
        let primitives =
            Primitives::with_instances(&world, &[object], &instances).expect("indices in range");
        let tree = BinaryTree::build(&primitives, Builder::default());
        let rays: Vec<_> = (0..500)
            .map(|_| Ray::between(rng.point(2.0), rng.point(2.0)))
            .collect();
        let mut plain = Bvh::collapse(
            &primitives,
            &tree,
            crate::recipe::Collapse::Area,
            Engine::best(NodeWidth::W8),
        );
        let mut expected = vec![false; rays.len()];
        plain.batch(&rays).occluded_into(&mut expected);
        plain.tree.pick = Some(&Farthest);

        let bvh = &plain.tree.wide::<8>();
        for isa in Isa::available() {
            let mut met = Vec::new();
            for goes_on in [false, true] {
                for shuffled in [None, Some(1), Some(2)] {
                    for by_distance in [false, true] {
                        let pick = match (shuffled, by_distance) {
                            (Some(seed), _) => Pick::Shuffled(Shuffle::new(seed)),
                            (None, true) => Pick::Rule,
                            (None, false) => Pick::Slots,
                        };
                        let mut check = Check {
                            bvh,
                            goes_on,
                            nodes: Vec::new(),
                            occluders: 0,
                            nodes_of_all: 0,
                            occluders_of_all: 0,
                        };
                        let mut answers = vec![false; rays.len()];
                        isa.dispatch(Instrumented {
                            bvh,
                            stack: &mut Vec::new(),
                            pick,
                            observer: &mut check,
                            rays: &rays,
                            answers: &mut answers,
                        });
                        assert_eq!(answers, expected, "{}", isa.level());
                        met.push((goes_on, check.nodes_of_all, check.occluders_of_all));
                    }
                }
            }
            let (stopped, gone_on) = met.split_at(6);
            assert!(gone_on.iter().all(|one| *one == gone_on[0]), "{gone_on:?}");
            let [(_, nodes, occluders), ..] = *gone_on else {
                unreachable!("six")
            };
            let occluded = expected.iter().filter(|occluded| **occluded).count();
            for &(_, fewer_nodes, stops) in stopped {
                assert!(fewer_nodes < nodes && stops < occluders);
                assert_eq!(stops, occluded);
            }
        }
        // By the rule of the tree, and without an observer.
        let mut answers = vec![false; rays.len()];
        plain.batch(&rays).occluded_into(&mut answers);
        assert_eq!(answers, expected);
    }
}
