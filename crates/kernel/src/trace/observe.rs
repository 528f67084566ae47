//! What a traversal tells while it runs. Observers are compiled into the one loop; the null observer
//! vanishes.

use crate::learn::log::Log;

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
    /// The ray goes into an instance, by its place behind the leaves in their numbering.
    #[inline(always)]
    fn enter(&mut self, _instance: usize) {}
    /// The ray comes back from an instance.
    #[inline(always)]
    fn exit(&mut self) {}
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
    /// Nodes whose N child boxes were tested, all N at once; on both levels of a scene with instances.
    pub node_tests: u32,
    /// Those of them in the tree of the world, that is, not in an instance.
    pub top_node_tests: u32,
    /// Primitives tested; a leaf block counts as many as it holds.
    pub prim_tests: u32,
}

/// Counts tests per ray.
pub(crate) struct Counting<'a> {
    pub costs: &'a mut [Cost],
    current: usize,
    /// Nodes from this one on belong to objects.
    top_nodes: usize,
}

impl<'a> Counting<'a> {
    /// `top_nodes` is the number of nodes in the tree of the world.
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
    #[inline(always)]
    fn counts_prims(&self) -> bool {
        true
    }

    #[inline(always)]
    fn begin(&mut self, index: usize) {
        self.current = index;
    }
    #[inline(always)]
    fn node(&mut self, node: usize, _lanes: u32) {
        self.costs[self.current].node_tests += 1;
        self.costs[self.current].top_node_tests += u32::from(node < self.top_nodes);
    }
    #[inline(always)]
    fn leaf(&mut self, _leaf: usize, prims: usize) {
        self.costs[self.current].prim_tests += prims as u32;
    }
}

/// Counts tests per ray and writes the log an order is learned from.
pub(crate) struct Logging<'a> {
    counting: Counting<'a>,
    log: &'a mut Log,
    /// The instance where the ray is.
    instance: Option<usize>,
}

impl<'a> Logging<'a> {
    pub fn new(counting: Counting<'a>, log: &'a mut Log) -> Self {
        Self {
            counting,
            log,
            instance: None,
        }
    }
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
        self.instance = None;
    }
    #[inline(always)]
    fn node(&mut self, node: usize, lanes: u32) {
        self.counting.node(node, lanes);
        self.log.enter_node(node, lanes);
    }
    #[inline(always)]
    fn leaf(&mut self, leaf: usize, prims: usize) {
        self.counting.leaf(leaf, prims);
        self.log.enter_leaf(leaf);
    }
    #[inline(always)]
    fn occluder(&mut self, leaf: usize, lane: usize) {
        self.log.occluded_by(leaf, lane, self.instance);
    }
    #[inline(always)]
    fn enter(&mut self, instance: usize) {
        self.instance = Some(instance);
        self.log.enter_leaf(instance);
    }
    #[inline(always)]
    fn exit(&mut self) {
        self.instance = None;
    }
}
