//! Orders in which an occlusion query may visit the hit children of a node.
//!
//! Plain queries know one order only: ascending slots, compiled into [`crate::trace::query`]. The others are chosen at
//! run time and serve comparisons and logs, in [`crate::trace::instrumented`].

use antumbra_simd::{Lanes, Mask};

use crate::aabb::Aabb;
use crate::geometry::ray_setup::{RaySetup, max};
use crate::hash;
use crate::ray::Ray;
use crate::trace::stack::Stack;
use crate::tree::directed::{DirectedOrder, Rule, Way};
use crate::tree::node::Node;

/// Pushes the hit children so that nearer ones are nearer to the top; of equally near ones the lower slot is.
/// Boxes around or behind the origin count as entered there: equally near, and never culled too early.
#[inline(always)]
pub(crate) fn push_sorted<const N: usize, L: Lanes<N>>(
    stack: &mut Stack<'_, u64>,
    node: &Node<N>,
    mask: L::Mask,
    entry: L,
) {
    let count = entry.compress_sorted(mask, &node.children, stack.window());
    stack.grow(count);
}

/// Chooses among the hit children of a node.
pub(crate) enum Pick<'a> {
    /// Ascending slots: whatever order the tree was given.
    Slots,
    /// By entry distance, nearest first.
    Distance,
    /// By the distance at which boxes are left, farthest first.
    Far,
    /// By the way of each node.
    Nodes(&'a [Way]),
    /// By one of several orders that a node has, chosen by the signs of the ray's direction.
    Direction(&'a DirectedOrder),
    /// At random.
    Shuffled(Shuffle),
}

impl<'a> From<&'a Rule> for Pick<'a> {
    fn from(rule: &'a Rule) -> Self {
        match rule {
            Rule::Slots => Self::Slots,
            Rule::Distance => Self::Distance,
            Rule::Far => Self::Far,
            Rule::Nodes(ways) => Self::Nodes(ways),
            Rule::Direction(order) => Self::Direction(order),
        }
    }
}

impl Pick<'_> {
    /// A new ray begins.
    #[inline(always)]
    pub fn begin(&mut self, ray: &Ray) {
        if let Self::Shuffled(shuffle) = self {
            shuffle.begin(ray);
        }
    }

    /// The lanes of node `index` that `ray` hit, the one to be visited first at the end, and how many they are. `mask`
    /// are these lanes, `entry` the distances at which their boxes are entered.
    #[inline(always)]
    pub fn lanes<const N: usize, L: Lanes<N>>(
        &mut self,
        (index, node): (usize, &Node<N>),
        ray: &RaySetup,
        mask: L::Mask,
        entry: L,
    ) -> ([u32; N], usize) {
        let mut all = [0; N];
        for lane in 0..N {
            all[lane] = lane as u32;
        }
        let mut lanes = [0; N];
        let way = match self {
            Self::Distance => Way::Near,
            Self::Far => Way::Far,
            Self::Nodes(ways) => ways[index],
            _ => Way::Slots,
        };
        let count = match self {
            Self::Slots | Self::Distance | Self::Far | Self::Nodes(_) => match way {
                Way::Slots => mask.compress(&all, &mut lanes),
                Way::Near => {
                    let mut pairs = [0; N];
                    let count = entry.compress_sorted(mask, &all, &mut pairs);
                    for lane in 0..N {
                        lanes[lane] = pairs[lane] as u32;
                    }
                    count
                }
                Way::Far => {
                    let count = mask.compress(&all, &mut lanes);
                    sort_by_end(ray, node, &mut lanes[..count]);
                    count
                }
            },
            Self::Direction(order) => {
                let bits = mask.bits();
                let mut count = 0;
                for &lane in order.lanes::<N>(index, ray.octant()) {
                    // Written whether hit or not, and overwritten by the next one if not.
                    lanes[count % N] = u32::from(lane);
                    count += (bits >> lane & 1) as usize;
                }
                count
            }
            Self::Shuffled(shuffle) => {
                let count = mask.compress(&all, &mut lanes);
                shuffle.shuffle(&mut lanes[..count]);
                count
            }
        };
        (lanes, count)
    }
}

/// Distance at which a ray enters a box, or of its own beginning.
pub(crate) fn entered_at(ray: &RaySetup, bounds: &Aabb) -> f32 {
    let [rdir, offset, _] = &ray.slabs;
    let near = |axis: usize| match ray.negative(axis) {
        true => bounds.max[axis],
        false => bounds.min[axis],
    };
    (0..3).fold(ray.tnear, |enter, axis| {
        max(near(axis) * rdir[axis] - offset[axis], enter)
    })
}

/// Distance at which a ray leaves a box, wherever it ends itself.
pub(crate) fn left_at(ray: &RaySetup, bounds: &Aabb) -> f32 {
    let [rdir, _, offset] = &ray.slabs;
    let far = |axis: usize| match ray.negative(axis) {
        true => bounds.min[axis],
        false => bounds.max[axis],
    };
    (0..3).fold(f32::INFINITY, |leave, axis| {
        -max(offset[axis] - far(axis) * rdir[axis], -leave)
    })
}

/// Sorts lanes so that the box that is left last stands at the end; of equal ones that of the lower slot.
fn sort_by_end<const N: usize>(ray: &RaySetup, node: &Node<N>, lanes: &mut [u32]) {
    let mut ends = [0.0; N];
    for &lane in lanes.iter() {
        ends[lane as usize] = left_at(ray, &node.bounds(N - 1 - lane as usize));
    }
    // Stable, and lanes ascend: equal ones stay so.
    lanes.sort_by(|a, b| ends[*a as usize].total_cmp(&ends[*b as usize]));
}

/// A random order: the remedy of Ogaki and Derouet-Jourdan (section 4.2) against the bias of a log towards the
/// order in force.
///
/// Each ray is its own seed, so the order does not depend on how rays were batched or divided among threads.
pub(crate) struct Shuffle {
    seed: u64,
    state: u64,
}

impl Shuffle {
    pub fn new(seed: u64) -> Self {
        Self { seed, state: 0 }
    }

    fn begin(&mut self, ray: &Ray) {
        self.state = hash::of_ray(self.seed, ray);
    }

    fn random(&mut self) -> u64 {
        self.state = self.state.wrapping_add(hash::STEP);
        hash::mixed(self.state)
    }

    /// Fisher and Yates, by multiply and shift instead of a division.
    fn shuffle(&mut self, lanes: &mut [u32]) {
        for last in (1..lanes.len()).rev() {
            let random = self.random() >> 32;
            lanes.swap(last, ((random * (last as u64 + 1)) >> 32) as usize);
        }
    }
}
