//! Object splits judged by what sample rays do: what the ray-driven builders have in common. They differ in what
//! they take a split to cost.
//!
//! Every node knows the rays that enter its box and which primitives in it they hit; every candidate for a split is
//! judged by exact counts of both on its two sides. Where fewer than [`MIN_RAYS`] rays come there is nothing to be
//! learned, and binned SAH goes on; without rays the tree is the tree of binned SAH.

pub(crate) mod evidence;
pub(crate) mod rdh;
pub(crate) mod seen;
pub(crate) mod srdh;
pub(crate) mod vdbvh;

use crate::builders::candidates::{Candidates, Split, cheapest};
use crate::builders::pieces::Piece;
use crate::builders::ray_driven::evidence::Evidence;
use antumbra::Aabb;
use antumbra::Primitives;
use antumbra::parts::BLOCK;
use antumbra::parts::BinaryTree;
use antumbra::parts::binned_subtree;

/// Nodes that fewer rays enter are split by areas.
const MIN_RAYS: usize = 4;

/// From this depth on binned SAH goes on, which bounds the depth of the tree.
const MAX_DEPTH: u32 = 56;

/// Nodes of fewer primitives and rays than this are the work of one thread.
const SEQUENTIAL: usize = 1024;

/// Measures of a node, or of one side of a split.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Measure {
    /// Half of the surface area.
    pub area: f64,
    pub prims: usize,
    /// Rays that enter the box.
    pub entered: usize,
    /// Rays that hit a primitive.
    pub hits: usize,
    /// Sum over these of `1 / (1 + k)`, `k` being how many they hit: the share of all primitives that a ray tests
    /// before the first of `k` at random places stops it.
    pub until_hit: f64,
}

impl Measure {
    /// Area relative to the parent's; 1 where the quotient is not finite.
    pub fn area_share(&self, parent: &Self) -> f64 {
        let share = self.area / parent.area;
        if share.is_finite() { share } else { 1.0 }
    }
}

/// Cost of a split, as a builder estimates it.
pub(crate) trait SplitCost: Sync {
    /// The cost; splits of least cost are made. Never NaN.
    fn of(&self, parent: &Measure, left: &Measure, right: &Measure) -> f64;

    /// Whether the right side is to be visited before the left one.
    fn right_first(&self, _parent: &Measure, _left: &Measure, _right: &Measure) -> bool {
        false
    }
}

/// Builds the tree.
pub(crate) fn build(
    primitives: &Primitives,
    evidence: &Evidence,
    cost: &impl SplitCost,
) -> BinaryTree {
    let count = primitives.len();
    if count == 0 {
        return BinaryTree::default();
    }
    let plan = Plan {
        primitives,
        evidence,
        cost,
    };
    let bounds = primitives.bounds();
    let rays = 0..evidence.rays.len() as u32;
    let root = Node {
        prims: (0..count as u32).collect(),
        rays: plan.entering(rays, &bounds),
        hits: evidence.hits.clone(),
        depth: 0,
    };
    plan.piece(root).into_tree()
}

/// What rays find out about the world's own primitives, and about each object in all of its instances.
pub(crate) struct Levels<T> {
    pub world: T,
    pub objects: Vec<T>,
}

impl<T> Levels<T> {
    /// Levels about which nothing is known yet.
    pub fn new(primitives: &Primitives, nothing: impl Fn(&Primitives) -> T) -> Self {
        let objects = primitives.object_list().iter();
        Self {
            world: nothing(primitives),
            objects: objects.map(&nothing).collect(),
        }
    }

    /// The world, or an object, which are number 1 and up.
    pub fn of(&self, place: usize) -> &T {
        let object = place.checked_sub(1);
        object.map_or(&self.world, |object| &self.objects[object])
    }
}

/// Primitives that become a subtree.
struct Node {
    /// Ascending.
    prims: Vec<u32>,
    /// Rays that enter the box.
    rays: Vec<u32>,
    /// Rays and primitives that they hit, ray after ray.
    hits: Vec<(u32, u32)>,
    depth: u32,
}

struct Plan<'a, C> {
    primitives: &'a Primitives,
    evidence: &'a Evidence,
    cost: &'a C,
}

impl<C: SplitCost> Plan<'_, C> {
    fn entering(&self, rays: impl IntoIterator<Item = u32>, bounds: &Aabb) -> Vec<u32> {
        rays.into_iter()
            .filter(|ray| self.evidence.rays[*ray as usize].hits_box(bounds))
            .collect()
    }

    fn piece(&self, node: Node) -> Piece {
        if node.prims.len() <= BLOCK || node.rays.len() < MIN_RAYS || node.depth >= MAX_DEPTH {
            return Piece::from(binned_subtree(self.primitives, &node.prims, node.depth));
        }
        let boxes: Vec<_> = node
            .prims
            .iter()
            .map(|prim| self.primitives.bounds_of(*prim as usize))
            .collect();
        let Some((split, right_first)) = self.best_split(&node, &boxes) else {
            return Piece::from(binned_subtree(self.primitives, &node.prims, node.depth));
        };
        let size = node.prims.len() + node.rays.len();
        let mut halves = self.halves(node, &split);
        if right_first {
            halves.reverse();
        }
        let bounds = split.bounds[0].union(&split.bounds[1]);
        Piece::of_parts(bounds, halves, size > SEQUENTIAL, |half| self.piece(half))
    }

    fn halves(&self, node: Node, split: &Split) -> [Node; 2] {
        let side_of = |prim: u32| {
            let place = node.prims.partition_point(|other| *other < prim);
            usize::from(!split.is_left[place])
        };
        let mut prims = split.sides(node.prims.iter().copied());
        let mut hits = [Vec::new(), Vec::new()];
        for &(ray, prim) in &node.hits {
            hits[side_of(prim)].push((ray, prim));
        }
        [0, 1].map(|side| Node {
            prims: std::mem::take(&mut prims[side]),
            rays: self.entering(node.rays.iter().copied(), &split.bounds[side]),
            hits: std::mem::take(&mut hits[side]),
            depth: node.depth + 1,
        })
    }

    /// The split that costs least, the first of equals, and whether its right side comes first; `None` if there is none of
    /// finite cost.
    fn best_split(&self, node: &Node, boxes: &[Aabb]) -> Option<(Split, bool)> {
        let bounds = boxes.iter().fold(Aabb::EMPTY, |all, one| all.union(one));
        // Each hit by the place of its primitive in the node.
        let places: Vec<_> = node
            .hits
            .iter()
            .map(|(ray, prim)| (*ray, node.prims.partition_point(|other| other < prim)))
            .collect();
        let parent = Measure {
            area: area(&bounds),
            prims: node.prims.len(),
            entered: node.rays.len(),
            hits: places.chunk_by(|a, b| a.0 == b.0).count(),
            // Nothing reads it.
            until_hit: 0.0,
        };
        cheapest(boxes, |candidates| {
            let sides = self.sides(node, candidates, &places);
            let judged = |split: usize| {
                let [left, right] = &sides[split];
                let right_first = self.cost.right_first(&parent, left, right);
                (self.cost.of(&parent, left, right), right_first)
            };
            candidates.splits().map(judged).collect()
        })
    }

    /// Measures of the two sides of every split.
    fn sides(
        &self,
        node: &Node,
        candidates: &Candidates,
        places: &[(u32, usize)],
    ) -> Vec<[Measure; 2]> {
        let len = candidates.len();
        let mut sides = vec![[Measure::default(); 2]; len];
        for (split, [left, right]) in sides.iter_mut().enumerate() {
            for (side, part) in [
                (left, &candidates.left[split]),
                (right, &candidates.right[split]),
            ] {
                side.area = area(&part.bounds);
                side.prims = part.count;
            }
        }
        // What is counted at the first split that has it on the left is on the left of all later ones, and
        // what is counted at the last split that has it on the right is on the right of all earlier ones.
        for ray in &node.rays {
            let ray = &self.evidence.rays[*ray as usize];
            // The boxes on one side of ever later splits hold each other, so a search finds the first that is
            // entered.
            let first = first_true(1, len, |split| ray.hits_box(&candidates.left[split].bounds));
            if let Some(side) = sides.get_mut(first) {
                side[0].entered += 1;
            }
            let end = first_true(1, len, |split| {
                !ray.hits_box(&candidates.right[split].bounds)
            });
            sides[end - 1][1].entered += 1;
        }
        let mut bins = Vec::new();
        for hits in places.chunk_by(|a, b| a.0 == b.0) {
            bins.clear();
            bins.extend(hits.iter().map(|hit| usize::from(candidates.bins[hit.1])));
            bins.sort_unstable();
            for (index, &bin) in bins.iter().enumerate() {
                if let Some(side) = sides.get_mut(bin + 1) {
                    side[0].hits += usize::from(index == 0);
                    side[0].until_hit += share_gained(index);
                }
                let index = bins.len() - 1 - index;
                let side = &mut sides[bin][1];
                side.hits += usize::from(index == 0);
                side.until_hit += share_gained(index);
            }
        }
        for split in 1..len {
            let before = sides[split - 1][0];
            let left = &mut sides[split][0];
            left.entered += before.entered;
            left.hits += before.hits;
            left.until_hit += before.until_hit;
        }
        for split in (0..len - 1).rev() {
            let after = sides[split + 1][1];
            let right = &mut sides[split][1];
            right.entered += after.entered;
            right.hits += after.hits;
            right.until_hit += after.until_hit;
        }
        sides
    }
}

/// Growth of [`Measure::until_hit`] when a ray that has this many hits gets one more.
fn share_gained(hits: usize) -> f64 {
    let share = |hits: usize| 1.0 / (1 + hits) as f64;
    match hits {
        0 => share(1),
        hits => share(hits + 1) - share(hits),
    }
}

/// The first number in `first..end` from which on `f` is true; `end` if there is none.
fn first_true(first: usize, end: usize, f: impl Fn(usize) -> bool) -> usize {
    let (mut low, mut high) = (first, end);
    while low < high {
        let middle = low.midpoint(high);
        if f(middle) {
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    low
}

fn area(bounds: &Aabb) -> f64 {
    f64::from(bounds.half_area())
}

#[cfg(test)]
mod tests;
