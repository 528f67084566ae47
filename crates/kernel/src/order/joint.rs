//! The orders of least measured cost: what the rays of a log would really have cost is minimised, without the
//! assumption of the paper's model that hits of different children are independent.
//!
//! The log says of every ray and every node that it comes to which boxes it hits and below which of them something
//! occludes it, whether or not an occlusion query would have come there ([`RayLog`]). Given an order, the ray's
//! cost in the node is that of the children hit, up to the first that occludes it, and each child's cost for this
//! very ray follows from the child's own order: nodes are worked out bottom-up. The cheapest order of the
//! children is found by [`arrange()`]: exactly for up to eight children that occlude anything, nearly so for more.
//!
//! A child that never occludes is best visited after all that do; which of those comes first does not matter to
//! the log. They, and children in doubt, stand by the paper's rule `H / (I C)`, with its chances taken from the
//! same log and blended with a prior as in [`crate::order::ratio`]. Nodes that no ray came to keep area order.
//!
//! Which rays come to a node depends on the orders of the nodes above it, which are not known yet. So the nodes are
//! sorted twice ([`ROUNDS`]): at first for all rays that hit their boxes, then for those that come to them in the tree
//! so sorted. Rays that something else occludes before count little then, but not nothing ([`STOPPED`]), so that few rays
//! do not decide alone.
//!
//! With [`Directions`] a node has several orders, each learned from the rays that will use it; the other rays
//! count, too, at [`OTHERS`] each, for the same reason.

use crate::error::Error;
use crate::learn::log::Log;
use crate::learn::ray_log::{RayLog, Visit};
use crate::order::arrange::{Costs, EXACT, arrange};
use crate::order::ratio::{area_shares, precise_chances, sorted_lanes};
use crate::order::{Order, sorted_by_key, sorted_slots};
use crate::tree::costs::CostModel;
use crate::tree::directed::DirectedOrder;
use crate::tree::directed::Rule;
use crate::tree::node::{ChildKind, Node};
use crate::tree::slot_order::SlotOrder;
use crate::tree::wide::Bvh;

/// What a ray counts for the order of another direction.
const OTHERS: f64 = 0.1;

/// How often all nodes are sorted. A second time saves 1 to 3 % of the node tests and up to 7 % of the primitive tests in
/// scenes of many overlapping instances (sanmiguel, ecosys) and next to nothing elsewhere, a third time nothing.
const ROUNDS: usize = 2;

/// What a ray counts in a node that it does not come to, because something occludes it before. Anything from 0.02 to 0.1
/// gives the same tests to 1 %.
const STOPPED: f64 = 0.05;

/// How many orders a node has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Directions {
    /// One for all rays.
    One,
    /// One for each sign of the direction on an axis: that on which it saves most.
    Two,
    /// One for each octant of directions.
    Eight,
}

/// The order of least measured cost.
pub(crate) fn plan<const N: usize>(
    bvh: &Bvh<N>,
    order: Order,
    log: &Log,
    model: &CostModel,
    directions: Directions,
) -> Result<SlotOrder, Error> {
    Error::unless_fits(log.shape(), bvh.shape())?;
    let rays = log.masks().ok_or(Error::NeedsMasks(order.name()))?;
    let by_node = Learner::new(bvh, rays, model).learn(directions);
    let mut slots = vec![0; bvh.nodes.len() * N];
    for (slots, orders) in slots.chunks_mut(N).zip(&by_node) {
        slots.copy_from_slice(&orders.all);
    }
    let pick = match directions {
        Directions::One => Rule::Slots,
        Directions::Two => Rule::Direction(directed(&by_node, 2)),
        Directions::Eight => Rule::Direction(directed(&by_node, 8)),
    };
    let lanes = (0..bvh.leaf_count())
        .map(|leaf| sorted_lanes(log.prim_hits(leaf)))
        .collect();
    Ok(SlotOrder {
        slots,
        lanes,
        pick,
        ..SlotOrder::as_built(bvh.shape())
    })
}

/// The table of the orders by direction, in a tree whose slots stand by the order for all.
fn directed<const N: usize>(nodes: &[NodeOrders<N>], count: usize) -> DirectedOrder {
    let mut table = DirectedOrder::with_capacity(count, nodes.len(), N);
    for orders in nodes {
        let mut moved = [0; N];
        for (now, &before) in orders.all.iter().enumerate() {
            moved[before as usize] = now as u8;
        }
        let slots = (0..count).map(|which| {
            let octant = which << orders.axis;
            orders.of(octant).map(|slot| moved[slot as usize])
        });
        table.push(orders.axis, slots);
    }
    table
}

/// The orders of a node.
#[derive(Clone, Debug)]
struct NodeOrders<const N: usize> {
    /// For rays of all directions.
    all: [u8; N],
    /// What decides, if there are two; 0 otherwise.
    axis: usize,
    /// By octant. Empty: all the same.
    octants: Vec<[u8; N]>,
}

impl<const N: usize> Default for NodeOrders<N> {
    fn default() -> Self {
        Self {
            all: [0; N],
            axis: 0,
            octants: Vec::new(),
        }
    }
}

impl<const N: usize> NodeOrders<N> {
    /// That of an octant.
    fn of(&self, octant: usize) -> [u8; N] {
        self.octants.get(octant).copied().unwrap_or(self.all)
    }
}

/// A ray in the node at hand.
struct Passage<const N: usize> {
    visit: usize,
    hit: u16,
    occluding: u16,
    octant: u8,
    /// What it counts.
    weight: f64,
    /// What entering each child costs it; 0 for those whose boxes it misses.
    costs: [f64; N],
}

impl<const N: usize> Passage<N> {
    /// What it costs to visit the children in this order until one occludes.
    fn cost(&self, order: &[u8; N]) -> f64 {
        let mut cost = 0.0;
        for &slot in order {
            cost += self.costs[slot as usize];
            if self.occluding >> slot & 1 == 1 {
                break;
            }
        }
        cost
    }
}

/// Goes through the nodes and knows what those below cost.
struct Learner<'a, const N: usize> {
    bvh: &'a Bvh<N>,
    model: &'a CostModel,
    visits: &'a [Visit],
    /// Visits by node, and where those of each begin. In an order that depends on nothing but the rays, so that
    /// sums come out the same.
    places: Vec<u32>,
    firsts: Vec<usize>,
    /// What each visit costs, once its node is sorted.
    costs: Vec<f64>,
    /// Whether the ray comes so far.
    arrives: Vec<bool>,
    passages: Vec<Passage<N>>,
}

impl<'a, const N: usize> Learner<'a, N> {
    fn new(bvh: &'a Bvh<N>, log: &'a RayLog, model: &'a CostModel) -> Self {
        let visits = log.visits();
        let mut firsts = vec![0; bvh.nodes.len() + 1];
        for visit in visits {
            firsts[visit.node as usize + 1] += 1;
        }
        for node in 0..bvh.nodes.len() {
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
            bvh,
            model,
            visits,
            places,
            firsts,
            costs: vec![0.0; visits.len()],
            arrives: vec![true; visits.len()],
            passages: Vec::new(),
        }
    }

    /// The orders of all nodes.
    fn learn(&mut self, directions: Directions) -> Vec<NodeOrders<N>> {
        let mut by_node = self.sort_all(directions);
        for _ in 1..ROUNDS {
            self.trace(&by_node);
            by_node = self.sort_all(directions);
        }
        by_node
    }

    /// Finds the orders of all nodes for the rays that arrive.
    fn sort_all(&mut self, directions: Directions) -> Vec<NodeOrders<N>> {
        let mut by_node = vec![NodeOrders::default(); self.bvh.nodes.len()];
        // Children follow their parents, so going backwards meets them first.
        for (node, orders) in by_node.iter_mut().enumerate().rev() {
            *orders = self.sort(node, directions);
        }
        by_node
    }

    /// Finds out how far the rays come in these orders.
    fn trace(&mut self, by_node: &[NodeOrders<N>]) {
        // A visit stands before those below it.
        for (place, visit) in self.visits.iter().enumerate() {
            let mut entered = 0;
            if self.arrives[place] {
                for slot in by_node[visit.node as usize].of(visit.octant as usize) {
                    entered |= 1 << slot;
                    if visit.occluding >> slot & 1 == 1 {
                        break;
                    }
                }
            }
            let mut below = place + 1;
            for slot in (0..N).filter(|slot| visit.followed >> slot & 1 == 1) {
                self.arrives[below] = entered >> slot & 1 == 1;
                below += self.visits[below].len as usize;
            }
        }
    }

    /// Finds the orders of a node, the nodes below it being done.
    fn sort(&mut self, index: usize, directions: Directions) -> NodeOrders<N> {
        let node = &self.bvh.nodes[index];
        self.gather(index);
        if self.passages.is_empty() {
            return NodeOrders {
                all: sorted_slots(node, &[0.0; N]),
                ..NodeOrders::default()
            };
        }
        let ratio = self.by_ratio(node);
        let passages = &self.passages[..];
        let least = |weight: &dyn Fn(&Passage<N>) -> f64| least_cost(passages, &ratio, weight);
        let all = least(&|passage| passage.weight);
        let own = |octant_is: &dyn Fn(u8) -> bool| {
            least(&|passage| {
                let share = if octant_is(passage.octant) {
                    1.0
                } else {
                    OTHERS
                };
                share * passage.weight
            })
        };
        let mut orders = NodeOrders {
            all,
            ..NodeOrders::default()
        };
        match directions {
            Directions::One => {}
            Directions::Two => {
                let mut best = f64::INFINITY;
                for axis in 0..3 {
                    let sides =
                        [0, 1].map(|negative| own(&|octant| octant >> axis & 1 == negative));
                    let octants: [_; 8] = core::array::from_fn(|octant| sides[octant >> axis & 1]);
                    let cost = passages
                        .iter()
                        .map(|passage| {
                            passage.weight * passage.cost(&octants[passage.octant as usize])
                        })
                        .sum();
                    if cost < best {
                        best = cost;
                        orders.axis = axis;
                        orders.octants = octants.to_vec();
                    }
                }
            }
            Directions::Eight => {
                orders.octants = (0..8).map(|octant| own(&|other| other == octant)).collect();
            }
        }
        for passage in &self.passages {
            let order = orders.of(passage.octant as usize);
            self.costs[passage.visit] = f64::from(self.model.node) + passage.cost(&order);
        }
        orders
    }

    /// Collects the rays in a node and what each child costs each of them.
    fn gather(&mut self, index: usize) {
        let node = &self.bvh.nodes[index];
        let mut fixed = [0.0; N];
        for (slot, cost) in fixed.iter_mut().enumerate().take(node.len()) {
            *cost = match node.child(slot).kind() {
                ChildKind::Inner(_) => 0.0,
                ChildKind::Leaf(leaf) => self.bvh.leaf_cost(leaf, self.model),
                ChildKind::Instance(_) => f64::from(self.model.entry),
            };
        }
        self.passages.clear();
        for &place in &self.places[self.firsts[index]..self.firsts[index + 1]] {
            let visit = place as usize;
            let Visit {
                hit,
                occluding,
                followed,
                octant,
                ..
            } = self.visits[visit];
            let mut costs = [0.0; N];
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
                octant,
                weight: if self.arrives[visit] { 1.0 } else { STOPPED },
                costs,
            });
        }
    }

    /// The order by the paper's rule.
    fn by_ratio(&self, node: &Node<N>) -> [u8; N] {
        let (mut hits, mut occluded, mut costs) = ([0.0; N], [0.0; N], [0.0; N]);
        for passage in &self.passages {
            for slot in 0..N {
                hits[slot] += f64::from(passage.hit >> slot & 1);
                occluded[slot] += f64::from(passage.occluding >> slot & 1);
                costs[slot] += passage.costs[slot];
            }
        }
        let areas = core::array::from_fn(|slot| node.bounds(slot).half_area());
        let shares = area_shares(&areas, node.all_bounds().half_area());
        let entered = self.passages.len() as f64;
        let mut chances = precise_chances(node.len(), entered, &hits, &occluded, &shares);
        for (slot, chance) in chances.iter_mut().enumerate() {
            if hits[slot] > 0.0 {
                chance.cost = costs[slot] / hits[slot];
            }
        }
        sorted_by_key(node.len(), &chances.map(|chance| chance.key()), &areas)
    }
}

/// Puts those children first that occlude any ray, as is cheapest; the others follow as they stand in `ratio`.
fn least_cost<const N: usize>(
    passages: &[Passage<N>],
    ratio: &[u8; N],
    weight: &dyn Fn(&Passage<N>) -> f64,
) -> [u8; N] {
    let any = passages
        .iter()
        .fold(0, |any, passage| any | passage.occluding);
    let mut order = *ratio;
    order.sort_by_key(|slot| any >> slot & 1 == 0);
    let first = &mut order[..any.count_ones() as usize];
    let groups = Groups::new(passages, first, weight);
    let arranged = if first.len() <= EXACT {
        arrange(first.len(), &groups.table())
    } else {
        arrange(first.len(), &groups)
    };
    let slots: Vec<_> = arranged.into_iter().map(|thing| first[thing]).collect();
    first.copy_from_slice(&slots);
    order
}

/// Rays that the same children occlude stop together, so that it is enough to know the sums of their costs.
/// Children are numbered as they were given.
struct Groups<const N: usize> {
    len: usize,
    groups: Vec<Group<N>>,
}

struct Group<const N: usize> {
    occluding: u32,
    weight: f64,
    costs: [f64; N],
}

impl<const N: usize> Groups<N> {
    /// Of these children alone.
    fn new(passages: &[Passage<N>], children: &[u8], weight: &dyn Fn(&Passage<N>) -> f64) -> Self {
        // Rays that nothing occludes cost the same in any order; so do those that hit but one box.
        let mut stopped: Vec<_> = passages
            .iter()
            .filter(|passage| passage.occluding != 0 && passage.hit.count_ones() > 1)
            .collect();
        stopped.sort_by_key(|passage| passage.occluding);
        let groups = stopped
            .chunk_by(|a, b| a.occluding == b.occluding)
            .map(|passages| {
                let occluding = children.iter().enumerate().fold(0, |set, (child, slot)| {
                    set | u32::from(passages[0].occluding >> slot & 1) << child
                });
                let mut group = Group {
                    occluding,
                    weight: 0.0,
                    costs: [0.0; N],
                };
                for passage in passages {
                    let weight = weight(passage);
                    group.weight += weight;
                    for (cost, &slot) in group.costs.iter_mut().zip(children) {
                        *cost += weight * passage.costs[slot as usize];
                    }
                }
                group
            })
            .collect();
        Self {
            len: children.len(),
            groups,
        }
    }

    /// The same, worked out for all sets of at most [`EXACT`] children.
    fn table(&self) -> Table {
        let sets = 1usize << self.len;
        let mut costs = vec![[0.0; EXACT]; sets];
        for group in &self.groups {
            // Those that are not stopped by a set are those that only others occlude.
            let sum = &mut costs[group.occluding as usize];
            for (sum, cost) in sum.iter_mut().zip(&group.costs) {
                *sum += cost;
            }
        }
        // Sums over all subsets, one element after the other.
        for element in 0..self.len {
            for set in (0..sets).filter(|set| set >> element & 1 == 1) {
                let part = costs[set ^ 1 << element];
                for (sum, cost) in costs[set].iter_mut().zip(part) {
                    *sum += cost;
                }
            }
        }
        Table { costs }
    }
}

impl<const N: usize> Costs for Groups<N> {
    fn cost(&self, child: usize, before: u32) -> f64 {
        let mut sum = 0.0;
        for group in &self.groups {
            sum += if group.occluding & before == 0 {
                group.costs[child]
            } else {
                0.0
            };
        }
        sum
    }

    /// The rays that it stops.
    fn gain(&self, child: usize, before: u32) -> f64 {
        let mut sum = 0.0;
        for group in &self.groups {
            let stops = group.occluding & before == 0 && group.occluding >> child & 1 == 1;
            sum += if stops { group.weight } else { 0.0 };
        }
        sum
    }
}

/// Costs by the set of the children that do *not* come before.
struct Table {
    costs: Vec<[f64; EXACT]>,
}

impl Costs for Table {
    fn cost(&self, child: usize, before: u32) -> f64 {
        self.costs[self.costs.len() - 1 - before as usize][child]
    }

    /// Not asked for: so few children are arranged exactly.
    fn gain(&self, _: usize, _: u32) -> f64 {
        0.0
    }
}

#[cfg(test)]
mod tests;
