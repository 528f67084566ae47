//! The events of an instrumented traversal, and the cost of a ray as the first thing to be counted from them.
//!
//! Logs are observers, too. They lie in [`crate::learn`], where they are used.

use crate::ray::Ray;

/// Receives what happens to occlusion rays in [`observe`](crate::parts::observe). A method does nothing unless overridden.
pub trait Observer {
    /// Ray `index` of the batch begins.
    fn begin(&mut self, _index: usize, _ray: &Ray) {}

    /// The current ray is at its end.
    fn end(&mut self) {}

    /// Whether rays go on behind an occluder.
    fn goes_on(&self) -> bool {
        false
    }

    /// The boxes of a node are tested, all at once. The number returned comes back in [`Place::visit`] with every
    /// child of the node.
    fn node(&mut self, _visit: &NodeVisit) -> u32 {
        0
    }

    /// A leaf of `prims` primitives is tested. Leaves of all kinds share one numbering.
    fn leaf(&mut self, _leaf: usize, _prims: usize) {}

    /// The primitive in this lane of a leaf occludes the ray, which came to the leaf from `from`.
    fn occluder(&mut self, _leaf: usize, _lane: usize, _from: Place) {}

    /// The ray goes into an instance. Instances are numbered behind the leaves.
    fn enter(&mut self, _instance: usize) {}

    /// The ray comes back from an instance.
    fn exit(&mut self) {}
}

/// A ray at a node.
pub struct NodeVisit {
    /// Index of the node in the tree.
    pub node: usize,
    /// Slot from which the ray comes; for the root of an object, the slot of the instance.
    pub from: Place,
    /// Lanes whose boxes are hit, as bits.
    pub lanes: u32,
    /// Number of lanes of the node.
    pub width: usize,
}

/// A slot of a node that the ray has visited.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// The number that [`Observer::node`] gave the visit.
    pub visit: u32,
    /// The slot in that node.
    pub slot: u32,
}

impl Place {
    /// Above the root of the world.
    pub const NONE: Self = Self {
        visit: u32::MAX,
        slot: 0,
    };
}

/// Observer that ignores everything.
pub(crate) struct Nothing;

impl Observer for Nothing {}

/// The work done for one ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cost {
    /// Nodes whose N child boxes were tested, all N at once; on both levels of a scene with instances.
    pub node_tests: u32,
    /// Node tests in the tree of the world, that is, not in an instance.
    pub top_node_tests: u32,
    /// Primitives tested; a leaf block counts as many as it holds.
    pub prim_tests: u32,
}

/// Observer that counts the tests of each ray.
pub(crate) struct Counting<'a> {
    costs: &'a mut [Cost],
    current: usize,
    /// Nodes from this one on belong to objects.
    top_nodes: usize,
}

impl<'a> Counting<'a> {
    /// One cost for each ray to come. `top_nodes` is the number of nodes in the tree of the world.
    pub fn new(costs: &'a mut [Cost], top_nodes: usize) -> Self {
        costs.fill(Cost::default());
        Self {
            costs,
            current: 0,
            top_nodes,
        }
    }
}

impl Observer for Counting<'_> {
    fn begin(&mut self, index: usize, _ray: &Ray) {
        self.current = index;
    }

    fn node(&mut self, visit: &NodeVisit) -> u32 {
        let cost = &mut self.costs[self.current];
        cost.node_tests += 1;
        cost.top_node_tests += u32::from(visit.node < self.top_nodes);
        0
    }

    fn leaf(&mut self, _leaf: usize, prims: usize) {
        self.costs[self.current].prim_tests += prims as u32;
    }
}
