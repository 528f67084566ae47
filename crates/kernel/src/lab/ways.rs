//! A rule for each node to pick children: in the order of slots, by the distance at which boxes are entered, or by the
//! distance at which they are left, the farthest first. Each node takes the rule that costs the training rays least.

use alloc::vec;
use alloc::vec::Vec;

use super::by_ray::{Way, entered_at, left_at};
use crate::learn::ray_log::{Following, RayLog};
use crate::order::joint::learner::{Learner, STOPPED};
use crate::order::joint::passage::Passage;
use crate::ray::Ray;
use crate::trace::observe::{NodeVisit, Observer, Place};
use crate::tree::costs::CostModel;
use crate::tree::wide::WideTree;

/// A rule other than the order of slots is taken where it saves this share of the cost: sorting takes time, and few
/// rays prove little.
const WORTH: f64 = 0.02;
/// With fewer rays than this a node keeps the order of slots.
const FEW: usize = 8;

/// Slots in the order of a visit, four bits each, the first one lowest.
type Packed = u64;

/// Visits and hits of rays, and how the children of each node lie along them.
#[derive(Debug, Default)]
pub(crate) struct Distances {
    pub log: RayLog,
    /// For each visit of the log, the slots hit, those whose boxes are entered first at the front.
    near: Vec<Packed>,
    /// For each visit of the log, the slots hit, with the box that is left last at the front.
    far: Vec<Packed>,
}

/// Follows rays to their ends and writes down [`Distances`].
pub(crate) struct Measuring<'a, const N: usize> {
    bvh: &'a WideTree<N>,
    following: Following<'a>,
    near: &'a mut Vec<Packed>,
    far: &'a mut Vec<Packed>,
}

impl<'a, const N: usize> Measuring<'a, N> {
    pub fn new(bvh: &'a WideTree<N>, distances: &'a mut Distances) -> Self {
        Self {
            bvh,
            following: Following::new(&mut distances.log),
            near: &mut distances.near,
            far: &mut distances.far,
        }
    }
}

impl<const N: usize> Observer for Measuring<'_, N> {
    fn begin(&mut self, index: usize, ray: &Ray) {
        self.following.begin(index, ray);
    }

    fn goes_on(&self) -> bool {
        true
    }

    fn node(&mut self, visit: &NodeVisit<'_>) -> u32 {
        let node = &self.bvh.nodes[visit.node];
        let mut by_slot: Vec<(u8, f32, f32)> = (0..node.len())
            .filter(|slot| visit.lanes >> (N - 1 - slot) & 1 == 1)
            .map(|slot| {
                let bounds = node.bounds(slot);
                let (near, far) = (entered_at(visit.ray, &bounds), left_at(visit.ray, &bounds));
                (slot as u8, near, far)
            })
            .collect();
        let packed = |slots: &[(u8, f32, f32)]| {
            let slots = slots.iter().rev();
            slots.fold(0, |word, (slot, ..)| word << 4 | Packed::from(*slot))
        };
        // Stable: equal ones stay in the order of slots.
        by_slot.sort_by(|a, b| a.1.total_cmp(&b.1));
        self.near.push(packed(&by_slot));
        by_slot.sort_by(|a, b| b.2.total_cmp(&a.2).then(a.0.cmp(&b.0)));
        self.far.push(packed(&by_slot));
        self.following.node(visit)
    }

    fn occluder(&mut self, leaf: usize, lane: usize, from: Place) {
        self.following.occluder(leaf, lane, from);
    }

    fn end(&mut self) {
        self.following.end();
    }
}

/// The rule of every node that costs the rays least, in a tree whose slots are in their order.
pub(crate) fn learn_ways<const N: usize>(
    bvh: &WideTree<N>,
    distances: &Distances,
    model: &CostModel,
) -> Vec<Way> {
    let mut learner = Learner::new(bvh, &distances.log, model);
    let mut ways = sort_all(&mut learner, distances);
    trace(&mut learner, distances, &ways);
    ways = sort_all(&mut learner, distances);
    ways
}

fn sort_all<const N: usize>(learner: &mut Learner<'_, N>, distances: &Distances) -> Vec<Way> {
    let mut ways = vec![Way::Slots; learner.bvh.nodes.len()];
    // Children follow their parents, so going backwards visits them first.
    for (node, way) in ways.iter_mut().enumerate().rev() {
        learner.gather(node);
        let mut sums = [0.0; Way::ALL.len()];
        let mut rays = 0;
        for passage in &learner.passages {
            for (sum, way) in sums.iter_mut().zip(Way::ALL) {
                *sum += passage.weight * cost(&passage.costs, passage, distances, way);
            }
            rays += usize::from(passage.weight > STOPPED);
        }
        let least = |a: &Way, b: &Way| sums[*a as usize].total_cmp(&sums[*b as usize]);
        let best = Way::ALL.into_iter().min_by(least).unwrap_or_default();
        let own = sums[Way::Slots as usize];
        if rays >= FEW && sums[best as usize] < own * (1.0 - WORTH) {
            *way = best;
        }
        for passage in &learner.passages {
            learner.costs[passage.visit] =
                f64::from(learner.model.node) + cost(&passage.costs, passage, distances, *way);
        }
    }
    ways
}

/// The slots of a visit in the order of a rule.
fn slots_of<const N: usize>(
    hit: u16,
    visit: usize,
    distances: &Distances,
    way: Way,
) -> impl Iterator<Item = usize> {
    let count = hit.count_ones() as usize;
    let packed = match way {
        Way::Slots => {
            let slots = (0..N as u64).rev().filter(|slot| hit >> slot & 1 == 1);
            slots.fold(0, |word, slot| word << 4 | slot)
        }
        Way::Near => distances.near[visit],
        Way::Far => distances.far[visit],
    };
    (0..count).map(move |place| (packed >> (4 * place) & 15) as usize)
}

/// Cost of a ray in a node whose children are visited by a rule.
fn cost<const N: usize>(
    costs: &[f64; N],
    passage: &Passage<N>,
    distances: &Distances,
    way: Way,
) -> f64 {
    let mut sum = 0.0;
    for slot in slots_of::<N>(passage.hit, passage.visit, distances, way) {
        sum += costs[slot];
        if passage.occluding >> slot & 1 == 1 {
            break;
        }
    }
    sum
}

/// Finds out which visits the rays reach by these rules.
fn trace<const N: usize>(learner: &mut Learner<'_, N>, distances: &Distances, ways: &[Way]) {
    // A visit comes before the visits below it.
    for (place, visit) in learner.visits.iter().enumerate() {
        let mut entered = 0;
        if learner.arrives[place] {
            let way = ways[visit.node as usize];
            for slot in slots_of::<N>(visit.hit, place, distances, way) {
                entered |= 1 << slot;
                if visit.occluding >> slot & 1 == 1 {
                    break;
                }
            }
        }
        let mut below = place + 1;
        for slot in (0..N).filter(|slot| visit.followed >> slot & 1 == 1) {
            learner.arrives[below] = entered >> slot & 1 == 1;
            below += learner.visits[below].len as usize;
        }
    }
}
