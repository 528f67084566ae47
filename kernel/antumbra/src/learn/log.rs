//! The training log of a wide tree: counters of what occlusion rays hit, one copy per worker, added up afterwards.
//!
//! Hits of a *leaf* (paper, Listing 1) are counted where a ray ends. Hits of inner children are their sums, since every
//! occluded ray ends in exactly one leaf. A ray that ends below an instance is counted there, too: the counters of its
//! object are sums over all instances.
//!
//! A partly transparent triangle ends the share of rays that its opacity says, always the same ones, so its
//! counters grow by its opacity, stochastically but reproducibly, as section 4.2 wants it.

use alloc::vec;
use alloc::vec::Vec;

use crate::geometry::BLOCK;
use crate::learn::ray_log::RayLog;
use crate::ray::Ray;
use crate::shape::Shape;
use crate::trace::observe::{Counting, NodeVisit, Observer, Place};
use crate::tree::wide::Tree;

/// The amount of detail in a log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct LogKind {
    /// Box hits as well as leaf hits: what equation (5) needs.
    pub boxes: bool,
    /// Visit the hit children of a node in random order while logging (section 4.2 of the paper).
    pub shuffled: bool,
    /// Besides, follow every ray to its end and keep, for each node it comes to, which boxes it hits and below
    /// which of them something occludes it. Takes the time of another, longer query, and about a kilobyte per
    /// ray: some ten thousand rays are plenty.
    pub masks: bool,
}

impl LogKind {
    /// Whether a log of this kind holds all that one of the `other` kind would hold of the same rays, so that whatever
    /// learns from that one can learn the same from this one. Rays that visit children in another order hit other
    /// primitives: neither of a shuffled and a straight log covers the other.
    pub const fn covers(self, other: Self) -> bool {
        self.shuffled == other.shuffled
            && (self.boxes || !other.boxes)
            && (self.masks || !other.masks)
    }

    /// The kinds of which at least one covers each of the kinds given, none of them needlessly: what to log so
    /// that every order has its log.
    pub fn covering(kinds: impl IntoIterator<Item = Self>) -> Vec<Self> {
        let mut least: Vec<Self> = Vec::new();
        for kind in kinds {
            let same = |other: &&mut Self| other.shuffled == kind.shuffled;
            match least.iter_mut().find(same) {
                Some(other) => {
                    other.boxes |= kind.boxes;
                    other.masks |= kind.masks;
                }
                None => least.push(kind),
            }
        }
        least
    }
}

/// Training log of one tree: counts of rays by node, child and primitive, as far as its [`LogKind`] needs them.
/// Each thread fills a log of its own, and [`Log::merge`] adds them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Log {
    pub(crate) kind: LogKind,
    pub(crate) seed: u64,
    pub(crate) shape: Shape,
    pub(crate) rays: u64,
    pub(crate) occluded: u64,
    /// Rays that tested this node.
    pub(crate) node_entered: Vec<u32>,
    /// Rays that tested the node and hit the box of this lane; `width` per node.
    pub(crate) lane_hits: Vec<u32>,
    /// Rays that tested the primitives of a leaf and, behind the leaves, those that went into an instance.
    pub(crate) leaf_entered: Vec<u32>,
    /// Rays that ended at the primitive in this lane of the leaf. Behind the leaves come the instances: the
    /// rays that ended somewhere in them are in lane 0.
    pub(crate) prim_hits: Vec<[u32; BLOCK]>,
    /// Visits of rays that do not stop.
    pub(crate) masks: Option<RayLog>,
}

impl Log {
    pub(crate) fn new(tree: &Tree, kind: LogKind, seed: u64) -> Self {
        let (nodes, leaves) = (tree.nodes.len(), tree.leaf_count());
        let boxes = if kind.boxes { nodes } else { 0 };
        let ends = leaves + tree.instances.len();
        Self {
            kind,
            seed,
            shape: tree.shape(),
            rays: 0,
            occluded: 0,
            node_entered: vec![0; boxes],
            lane_hits: vec![0; boxes * tree.width().lanes()],
            leaf_entered: vec![0; if kind.boxes { ends } else { 0 }],
            prim_hits: vec![[0; BLOCK]; ends],
            masks: kind.masks.then(RayLog::default),
        }
    }

    /// What the log counts, and so which orders it can plan: see [`LogKind`].
    pub fn kind(&self) -> LogKind {
        self.kind
    }

    /// Rays logged so far.
    pub fn rays(&self) -> u64 {
        self.rays
    }

    /// Logged rays that were occluded.
    pub fn occluded(&self) -> u64 {
        self.occluded
    }

    /// Seed of the shuffling.
    pub(crate) fn seed(&self) -> u64 {
        self.seed
    }

    /// Adds the counters of another log of the same tree. Counters are whole numbers, so the sum does not depend on how
    /// rays were divided among logs.
    ///
    /// # Panics
    /// If the other log was made for another tree or kind.
    pub fn merge(&mut self, other: &Self) {
        assert_eq!(
            (self.kind, self.shape),
            (other.kind, other.shape),
            "logs of different trees or kinds"
        );
        let add = |sums: &mut [u32], values: &[u32]| {
            for (sum, value) in sums.iter_mut().zip(values) {
                *sum = sum.saturating_add(*value);
            }
        };
        self.rays += other.rays;
        self.occluded += other.occluded;
        add(&mut self.node_entered, &other.node_entered);
        add(&mut self.lane_hits, &other.lane_hits);
        add(&mut self.leaf_entered, &other.leaf_entered);
        add(
            self.prim_hits.as_flattened_mut(),
            other.prim_hits.as_flattened(),
        );
        if let (Some(sum), Some(other)) = (&mut self.masks, &other.masks) {
            sum.append(other);
        }
    }

    /// Visits of rays that do not stop, if they are logged.
    pub(crate) fn masks(&self) -> Option<&RayLog> {
        self.masks.as_ref()
    }

    pub(crate) fn masks_mut(&mut self) -> Option<&mut RayLog> {
        self.masks.as_mut()
    }

    /// The shape of the tree it was made for.
    pub(crate) fn shape(&self) -> Shape {
        self.shape
    }

    /// Rays that tested a node; 0 when box hits are not logged.
    pub(crate) fn node_entered(&self, node: usize) -> u32 {
        self.node_entered.get(node).copied().unwrap_or(0)
    }

    /// Rays that tested a node and hit the box of a lane; 0 when box hits are not logged.
    pub(crate) fn lane_hits(&self, node: usize, lane: usize) -> u32 {
        self.lane_hits
            .get(node * self.shape.width + lane)
            .copied()
            .unwrap_or(0)
    }

    /// Rays that tested the primitives of a leaf, or that went into an instance; 0 when box hits are not logged.
    pub(crate) fn leaf_entered(&self, leaf: usize) -> u32 {
        self.leaf_entered.get(leaf).copied().unwrap_or(0)
    }

    /// Rays that ended at each primitive of a leaf, or in an instance: see [`Tree::instance_index`].
    pub(crate) fn prim_hits(&self, leaf: usize) -> &[u32; BLOCK] {
        &self.prim_hits[leaf]
    }

    fn enter_node(&mut self, node: usize, lanes: u32) {
        if !self.kind.boxes {
            return;
        }
        self.node_entered[node] += 1;
        let hits = &mut self.lane_hits[node * self.shape.width..][..self.shape.width];
        let mut lanes = lanes;
        while lanes != 0 {
            hits[lanes.trailing_zeros() as usize] += 1;
            lanes &= lanes - 1;
        }
    }

    /// A leaf, or an instance behind them.
    fn enter_leaf(&mut self, leaf: usize) {
        if self.kind.boxes {
            self.leaf_entered[leaf] += 1;
        }
    }

    fn occluded_by(&mut self, leaf: usize, lane: usize, instance: Option<usize>) {
        self.occluded += 1;
        self.prim_hits[leaf][lane % BLOCK] += 1;
        if let Some(instance) = instance {
            self.prim_hits[instance][0] += 1;
        }
    }
}

/// Counts tests per ray and writes a [`Log`].
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
    fn begin(&mut self, index: usize, ray: &Ray) {
        self.counting.begin(index, ray);
        self.log.rays += 1;
        self.instance = None;
    }

    fn node(&mut self, visit: &NodeVisit) -> u32 {
        self.log.enter_node(visit.node, visit.lanes);
        self.counting.node(visit)
    }

    fn leaf(&mut self, leaf: usize, prims: usize) {
        self.counting.leaf(leaf, prims);
        self.log.enter_leaf(leaf);
    }

    fn occluder(&mut self, leaf: usize, lane: usize, _from: Place) {
        self.log.occluded_by(leaf, lane, self.instance);
    }

    fn enter(&mut self, instance: usize) {
        self.instance = Some(instance);
        self.log.enter_leaf(instance);
    }

    fn exit(&mut self) {
        self.instance = None;
    }
}

#[cfg(test)]
mod tests {
    use crate::Bvh;
    use crate::api::steps::Steps;
    use crate::builder::Builder;
    use crate::geometry::primitives::PrimKind;
    use crate::geometry::primitives::Primitives;
    use crate::geometry::{Geometry, Instance};
    use crate::ray::Ray;
    use crate::trace::observe::Cost;
    use crate::tree::binary::BinaryTree;
    use crate::tree::node::ChildKind;
    use crate::tree::width::Width;
    use antumbra_testkit::{Rng, mesh};

    use super::*;
    use crate::trace::engine::Engine;

    /// Every ray that ends in an instance is counted there and at one primitive of the object; the world's own
    /// primitives and the instances have ended all occluded rays.
    #[test]
    fn rays_that_end_in_instances_are_counted_on_both_levels() {
        let mut rng = Rng::new(71);
        let object = mesh::soup(&mut rng, 50);
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
        let tree = BinaryTree::build(&primitives, Builder::BinnedSah);
        let bvh = Bvh::collapse(
            &primitives,
            &tree,
            crate::recipe::Collapse::Area,
            Engine::best(Width::W8),
        );
        let rays: Vec<_> = (0..3000)
            .map(|_| Ray::between(rng.point(2.0), rng.point(2.0)))
            .collect();
        for shuffled in [false, true] {
            let kind = LogKind {
                boxes: true,
                shuffled,
                masks: false,
            };
            let mut log = bvh.new_log(kind, 1);
            let (mut occluded, mut costs) = (vec![false; 3000], vec![Cost::default(); 3000]);
            bvh.occluded_batch_logged(&rays, &mut occluded, &mut costs, &mut log);
            let ended = occluded.iter().filter(|occluded| **occluded).count() as u64;
            assert_eq!(log.occluded(), ended);

            let tree = &bvh.tree;
            let hits = |leaf: usize| {
                log.prim_hits(leaf)
                    .iter()
                    .map(|x| u64::from(*x))
                    .sum::<u64>()
            };
            // In the world, in instances, in the object.
            let mut sums = [0; 3];
            for (index, node) in tree.nodes.iter().enumerate() {
                let in_object = index >= tree.top_nodes();
                for slot in 0..node.len() {
                    match node.child(slot).kind() {
                        ChildKind::Inner(_) => {}
                        ChildKind::Leaf(leaf) => {
                            assert_eq!(leaf.kind, PrimKind::Triangle);
                            sums[if in_object { 2 } else { 0 }] += hits(leaf.index);
                        }
                        ChildKind::Instance(index) => sums[1] += hits(tree.instance_index(index)),
                    }
                }
            }
            let [in_world, in_instances, in_object] = sums;
            assert_eq!(in_world + in_instances, ended);
            assert_eq!(in_instances, in_object);
            assert!(in_world > 100 && in_instances > 100, "{sums:?}");
        }
    }
}
