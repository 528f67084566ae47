//! All hits of a ray, one after another, front to back.
//!
//! Children still to visit wait in one heap, by the distance at which their boxes are entered, and hits not reported yet
//! in another. The nearest child is visited next, unless a hit lies before it: then that hit is reported. No child is
//! visited that begins behind the hit at which the visit ends.
//!
//! # Why every hit is reported once and in order
//!
//! By [`crate::geometry::ray_setup`], every box above a hit is entered at or before the distance at which the hit is
//! reported. In an instance the reported distance may have been clamped down to the end of the instance interval, so what
//! is entered behind that end counts as entered there. So when the nearest child left begins behind a hit, all hits up to
//! that one have been found.
//!
//! A triangle that lies in several leaves may be found again in any of them, also in one that is entered behind the hit.
//! Such a hit does not come after the one reported last, and all hits that do not have been reported. So one comparison
//! keeps it from being reported twice.
//!
//! Distances of children are at least 0 in the heap, so hits at negative distances wait until all children entered at or
//! behind the origin are visited.

use alloc::collections::BinaryHeap;
use alloc::vec::Vec;
use core::cmp::{Ordering, Reverse};

use antumbra_simd::{Lanes, Simd, Width, WithSimd};

use crate::geometry::QueryKind;
use crate::geometry::best::TreeHit;
use crate::geometry::instance_ray::Interval;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::ray_setup::RaySetup;
use crate::ray::{Hit, Ray};
use crate::trace::condition::Condition;
use crate::trace::stack::Item;
use crate::trace::step::NodeTest;
use crate::trace::view::{View, on_seen_leaf};
use crate::tree::node::{Child, ChildKind, Leaf};
use crate::tree::wide::WideTree;

/// Answer to a hit of a visit: see [`RayQuery::visit_hits`](crate::RayQuery::visit_hits).
///
/// ```
/// # use antumbra::{Bvh, Geometry, Recipe};
/// use antumbra::{Ray, Visit};
///
/// # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
/// # let bvh = Bvh::build(&geometry, &Recipe::default())?;
/// let ray = Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0]);
/// let mut seen = 0;
/// let accepted = bvh.query(&ray).visit_hits(|_| {
///     seen += 1;
///     Visit::Reject
/// });
/// assert_eq!((seen, accepted), (1, None));
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Visit {
    /// The hit counts: the visit ends with it.
    Accept,
    /// The hit does not count: the visit goes on behind it.
    Reject,
    /// The visit ends without a hit.
    Stop,
}

/// Visits the hits of `ray`. The output is the hit that was accepted.
pub(crate) struct Visiting<'a, V, const N: usize> {
    pub bvh: &'a WideTree<'a, N>,
    pub view: V,
    pub ahead: &'a mut Ahead,
    pub ray: &'a Ray,
    /// Instances in which nothing fulfils it are left out. Hits are the business of `visit`.
    pub condition: &'a Condition<'a>,
    pub visit: &'a mut dyn FnMut(Hit) -> Visit,
}

/// Everything ahead of a ray, in memory that is used again.
#[derive(Debug, Default)]
pub(crate) struct Ahead {
    children: BinaryHeap<Reverse<Waiting>>,
    hits: BinaryHeap<Reverse<Ranked>>,
    /// The world, and the objects of instances that were entered.
    spaces: Vec<Space>,
}

/// A child still to visit. The nearer one is the lesser one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Waiting {
    /// The child with its distance, as on stacks.
    item: u64,
    /// Index in [`Ahead::spaces`].
    space: u32,
}

impl Waiting {
    /// Bits of the distance, which is not negative.
    fn distance(self) -> u32 {
        (self.item >> 32) as u32
    }
}

/// The ray in the world or in an object.
#[derive(Debug)]
struct Space {
    ray: RaySetup,
    interval: Interval,
}

/// A hit, in the order in which hits are reported. The distance is no NaN and no negative zero.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ranked(pub TreeHit);

impl Ord for Ranked {
    fn cmp(&self, other: &Self) -> Ordering {
        let ids = |Hit {
                       inst_id,
                       geom_id,
                       prim_id,
                       ..
                   }| (inst_id, geom_id, prim_id);
        let (a, b) = (self.0.hit, other.0.hit);
        a.t.total_cmp(&b.t).then_with(|| ids(a).cmp(&ids(b)))
    }
}

impl PartialOrd for Ranked {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Ranked {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Ranked {}

impl Ahead {
    fn clear(&mut self) {
        self.children.clear();
        self.hits.clear();
        self.spaces.clear();
    }

    /// The nearest child, which is taken out.
    fn nearest(&mut self) -> Option<Waiting> {
        self.children.pop().map(|Reverse(child)| child)
    }

    /// The nearest child, which is taken out, or `child` if that is as near.
    fn nearest_or(&mut self, child: Option<Waiting>) -> Option<Waiting> {
        let Some(mut child) = child else {
            return self.nearest();
        };
        if let Some(mut nearest) = self.children.peek_mut()
            && nearest.0 < child
        {
            core::mem::swap(&mut nearest.0, &mut child);
        }
        Some(child)
    }

    /// Takes the nearest hit out, if it lies before a child.
    fn hit_before(&mut self, child: Option<Waiting>) -> Option<Ranked> {
        let Reverse(nearest) = self.hits.peek()?;
        let t = nearest.0.hit.t.max(0.0).to_bits();
        if child.is_some_and(|child| child.distance() <= t) {
            return None;
        }
        self.hits.pop().map(|Reverse(hit)| hit)
    }

    /// Takes a hit found in a space.
    fn found(&mut self, space: u32, found: TreeHit) {
        let Space { ray, interval } = &self.spaces[space as usize];
        let found = found.placed(*interval, ray.inst_id);
        self.hits.push(Reverse(Ranked(found)));
    }
}

impl<V: View, const N: usize> WithSimd<N> for Visiting<'_, V, N> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn with_simd<S: Simd + Width<N>>(self, simd: S) -> Option<Hit> {
        let Self {
            bvh,
            view,
            ahead,
            ray,
            condition,
            visit,
        } = self;
        let mut setup = RaySetup::IDLE;
        if !setup.set(simd, ray, bvh.reach) {
            return None;
        }
        ahead.clear();
        ahead.spaces.push(Space {
            ray: setup,
            interval: Interval::WORLD,
        });
        let mut told: Option<Ranked> = None;
        let mut next = Some(Waiting {
            item: u64::unordered(Child::ROOT),
            space: 0,
        });
        loop {
            while let Some(hit) = ahead.hit_before(next) {
                if told.is_none_or(|told| told < hit) {
                    told = Some(hit);
                    let hit = hit.0.told();
                    match visit(hit) {
                        Visit::Accept => return Some(hit),
                        Visit::Reject => {}
                        Visit::Stop => return None,
                    }
                }
            }
            let now = next?;
            let space = now.space;
            next = match now.item.child().kind() {
                ChildKind::Inner(index) => {
                    let child = expand(simd, (bvh, view), ahead, index, space);
                    ahead.nearest_or(child)
                }
                ChildKind::Leaf(leaf) => {
                    search(simd, (bvh, view), ahead, leaf, space);
                    ahead.nearest()
                }
                ChildKind::Instance(index) => {
                    let placed = &bvh.instances[index];
                    let world = &ahead.spaces[0].ray;
                    let entered = match condition.enters(placed.placement.inst_id) {
                        true => view.place(simd, bvh, index, world, &mut setup),
                        false => None,
                    };
                    match entered {
                        Some(interval) => {
                            let space = ahead.spaces.len() as u32;
                            ahead.spaces.push(Space {
                                ray: setup,
                                interval,
                            });
                            let root = Child::inner(placed.root as usize);
                            Some(Waiting {
                                item: at(now.distance(), root),
                                space,
                            })
                        }
                        None => ahead.nearest(),
                    }
                }
            };
        }
    }
}

/// A child at the distance of these bits.
fn at(distance: u32, child: Child) -> u64 {
    u64::from(distance) << 32 | u64::from(child.0)
}

/// Puts the children of a node that are hit into the heap, but for the nearest.
#[inline(always)]
fn expand<S: Simd + Width<N>, const N: usize>(
    simd: S,
    (bvh, view): (&WideTree<N>, impl View),
    ahead: &mut Ahead,
    index: usize,
    space: u32,
) -> Option<Waiting> {
    let Space { ray, interval } = &ahead.spaces[space as usize];
    let node = &bvh.nodes[index];
    let test = NodeTest::<S, N>::new(simd, ray);
    let (mask, entry) = view.step(simd, bvh, index, &test, ray.tfar);
    let mut items = [0; N];
    let count = entry.compress_sorted(mask, &node.children, &mut items);
    let end = interval.leave.max(0.0).to_bits();
    let mut nearest = None;
    for &item in &items[..count] {
        let distance = ((item >> 32) as u32).min(end);
        let item = at(distance, item.child());
        if let Some(farther) = nearest.replace(Waiting { item, space }) {
            ahead.children.push(Reverse(farther));
        }
    }
    nearest
}

/// Finds the hits in a leaf. Filters decide which hits on cut-outs count.
#[inline(always)]
fn search<S: Simd, const N: usize>(
    simd: S,
    (bvh, view): (&WideTree<N>, impl View),
    ahead: &mut Ahead,
    leaf: Leaf,
    space: u32,
) {
    let ray = ahead.spaces[space as usize].ray;
    let filters = &bvh.filters;
    on_seen_leaf!(simd, bvh, view, leaf, block => {
        for lane in block.candidates::<S, false>(simd, &ray, ray.tfar) {
            if let Some(hit) = block.hit(lane, &ray, filters, QueryKind::Intersect) {
                ahead.found(space, hit);
            }
        }
    });
}
