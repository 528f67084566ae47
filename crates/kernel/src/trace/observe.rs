//! What a traversal tells while it runs. Observers are compiled into the one loop; the null observer
//! vanishes.

use crate::order::log::Log;

/// Receives what happens to occlusion rays. Every method does nothing unless overridden.
pub(crate) trait Observer {
    /// Ray `index` of the batch begins.
    #[inline(always)]
    fn begin(&mut self, _index: usize) {}
    /// The boxes of a node are tested, all at once; `lanes` are those that were hit.
    #[inline(always)]
    fn node(&mut self, _node: usize, _lanes: u32) {}
    /// A leaf of so many primitives is tested. Leaves of all kinds share one numbering.
    #[inline(always)]
    fn leaf(&mut self, _leaf: usize, _prims: usize) {}
    /// A primitive of a leaf occludes the ray, which ends it.
    #[inline(always)]
    fn occluder(&mut self, _leaf: usize, _lane: usize) {}
    /// Whether [`Observer::leaf`] looks at its count, which costs a little to find out.
    #[inline(always)]
    fn counts_prims(&self) -> bool {
        false
    }
}

/// Sees nothing.
pub(crate) struct Nothing;

impl Observer for Nothing {}

/// The work done for one ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cost {
    /// Nodes whose N child boxes were tested, all N at once.
    pub node_tests: u32,
    /// Primitives tested; a leaf block counts as many as it holds.
    pub prim_tests: u32,
}

/// Counts tests per ray.
pub(crate) struct Counting<'a> {
    pub costs: &'a mut [Cost],
    pub current: usize,
}

impl<'a> Counting<'a> {
    pub fn new(costs: &'a mut [Cost]) -> Self {
        costs.fill(Cost::default());
        Self { costs, current: 0 }
    }
}

impl Observer for Counting<'_> {
    #[inline(always)]
    fn counts_prims(&self) -> bool {
        true
    }

    #[inline(always)]
    fn begin(&mut self, index: usize) {
        self.current = index;
    }
    #[inline(always)]
    fn node(&mut self, _node: usize, _lanes: u32) {
        self.costs[self.current].node_tests += 1;
    }
    #[inline(always)]
    fn leaf(&mut self, _leaf: usize, prims: usize) {
        self.costs[self.current].prim_tests += prims as u32;
    }
}

/// Counts tests per ray and writes the log an order is learned from.
pub(crate) struct Logging<'a> {
    pub counting: Counting<'a>,
    pub log: &'a mut Log,
}

impl Observer for Logging<'_> {
    #[inline(always)]
    fn counts_prims(&self) -> bool {
        true
    }

    #[inline(always)]
    fn begin(&mut self, index: usize) {
        self.counting.begin(index);
        self.log.begin_ray();
    }
    #[inline(always)]
    fn node(&mut self, node: usize, lanes: u32) {
        self.counting.node(node, lanes);
        self.log.enter_node(node, lanes);
    }
    #[inline(always)]
    fn leaf(&mut self, leaf: usize, prims: usize) {
        self.counting.leaf(leaf, prims);
    }
    #[inline(always)]
    fn occluder(&mut self, leaf: usize, lane: usize) {
        self.log.occluded_by(leaf, lane);
    }
}
