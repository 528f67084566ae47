//! The walk through the nodes of a tree that learns the orders of all of them.

use alloc::vec;
use alloc::vec::Vec;

use super::groups::least_cost;
use super::passage::{Passage, by_ratio};
use crate::learn::ray_log::{RayLog, Visit};
use crate::monitor::BuildMonitor;
use crate::order::sorted_slots;
use crate::tree::costs::CostModel;
use crate::tree::node::{ChildKind, MAX_WIDTH, NodeRef, PerSlot};
use crate::tree::slot_order::SlotOrder;
use crate::tree::wide::Tree;

/// How often all nodes are sorted. See `docs/notes/kernel.md`.
const ROUNDS: usize = 2;

/// Weight of a ray in a node that it does not come to, because something occludes it before. See
/// `docs/notes/kernel.md`.
pub(crate) const STOPPED: f64 = 0.05;

/// Goes through the nodes, children first, with the costs of the nodes below known.
pub(crate) struct Learner<'a> {
    pub tree: &'a Tree,
    pub model: &'a CostModel,
    pub visits: &'a [Visit],
    /// Visits by node, and where the visits of each node begin. In an order that depends on nothing but the rays, so
    /// that sums come out the same.
    places: Vec<u32>,
    firsts: Vec<usize>,
    /// Cost of each visit, once its node is sorted.
    pub costs: Vec<f64>,
    /// Whether the ray comes to the node of each visit.
    pub arrives: Vec<bool>,
    pub passages: Vec<Passage>,
}

impl<'a> Learner<'a> {
    pub fn new(tree: &'a Tree, log: &'a RayLog, model: &'a CostModel) -> Self {
        let visits = log.visits();
        let mut firsts = vec![0; tree.nodes.len() + 1];
        for visit in visits {
            firsts[visit.node as usize + 1] += 1;
        }
        for node in 0..tree.nodes.len() {
            firsts[node + 1] += firsts[node];
        }
        let mut ends = firsts.clone();
        let mut places = vec![0; visits.len()];
        for range in log.sorted_ranges() {
            for place in range {
                let end = &mut ends[visits[place].node as usize];
                places[*end] = place as u32;
                *end += 1;
            }
        }
        Self {
            tree,
            model,
            visits,
            places,
            firsts,
            costs: vec![0.0; visits.len()],
            arrives: vec![true; visits.len()],
            passages: Vec::new(),
        }
    }

    /// The orders of all nodes, after fewer rounds if the monitor stops it.
    pub fn learn(&mut self, monitor: &dyn BuildMonitor) -> SlotOrder {
        let mut order = self.sort_all();
        for _ in 1..ROUNDS {
            if monitor.cancelled() {
                break;
            }
            self.trace(&order);
            order = self.sort_all();
        }
        order
    }

    /// Finds the orders of all nodes for the rays that arrive.
    pub fn sort_all(&mut self) -> SlotOrder {
        let mut order = SlotOrder::of_nodes(self.tree);
        // Children follow their parents, so going backwards visits them first.
        for node in (0..self.tree.nodes.len()).rev() {
            order.set(node, &self.sort(node));
        }
        order
    }

    /// Finds out how far the rays come in these orders.
    fn trace(&mut self, order: &SlotOrder) {
        let width = self.tree.width().lanes();
        // A visit comes before the visits below it.
        for (place, visit) in self.visits.iter().enumerate() {
            let mut entered = 0;
            if self.arrives[place] {
                for slot in &order.slots[visit.node as usize * width..][..width] {
                    entered |= 1 << slot;
                    if visit.occluding >> slot & 1 == 1 {
                        break;
                    }
                }
            }
            let mut below = place + 1;
            for slot in (0..width).filter(|slot| visit.followed >> slot & 1 == 1) {
                self.arrives[below] = entered >> slot & 1 == 1;
                below += self.visits[below].len as usize;
            }
        }
    }

    /// Finds the orders of a node, the nodes below it being done.
    fn sort(&mut self, index: usize) -> PerSlot<u8> {
        let node = self.tree.nodes.get(index);
        self.gather(index);
        if self.passages.is_empty() {
            return sorted_slots(node, &[0.0; MAX_WIDTH]);
        }
        let ratio = by_ratio(node, &self.passages);
        let order = least_cost(&self.passages, &ratio[..node.width()]);
        for passage in &self.passages {
            let cost = passage.cost(&order[..node.width()]);
            self.costs[passage.visit] = f64::from(self.model.node) + cost;
        }
        order
    }

    /// Collects the rays in a node and what each child costs each of them.
    pub fn gather(&mut self, index: usize) {
        let fixed = self.fixed_costs(self.tree.nodes.get(index));
        self.passages.clear();
        for &place in &self.places[self.firsts[index]..self.firsts[index + 1]] {
            let visit = place as usize;
            let Visit {
                hit,
                occluding,
                followed,
                ..
            } = self.visits[visit];
            let mut costs = [0.0; MAX_WIDTH];
            let mut below = visit + 1;
            for (slot, cost) in costs.iter_mut().enumerate() {
                if hit >> slot & 1 == 1 {
                    *cost = fixed[slot];
                }
                if followed >> slot & 1 == 1 {
                    *cost += self.costs[below];
                    below += self.visits[below].len as usize;
                }
            }
            self.passages.push(Passage {
                visit,
                hit,
                occluding,
                weight: if self.arrives[visit] { 1.0 } else { STOPPED },
                costs,
            });
        }
    }

    /// Cost of entering each child for every ray that hits its box, without the costs of the nodes below.
    fn fixed_costs(&self, node: NodeRef<'_>) -> PerSlot<f64> {
        let mut fixed = [0.0; MAX_WIDTH];
        for (slot, cost) in fixed.iter_mut().enumerate().take(node.len()) {
            *cost = match node.child(slot).kind() {
                ChildKind::Inner(_) => 0.0,
                ChildKind::Leaf(leaf) => self.tree.leaf_cost(leaf, self.model),
                ChildKind::Instance(_) => f64::from(self.model.entry),
            };
        }
        fixed
    }
}
