//! The top level of a world whose objects are trees already: wide nodes over boxes, made anew for every frame.
//!
//! A node begins as one group of items. The group of the largest box is split by the surface area heuristic with bins
//! (Wald 2007) until there are as many groups as slots. Groups of one item become its reference, the others nodes.
//! Nothing is learned: children stand by falling area. One thread and plain code suffice for tens of thousands of items.

use alloc::vec::Vec;
use core::ops::Range;

use crate::aabb::Aabb;
use crate::tree::node::{Child, ChildKind, Node};

/// Bins per axis, at most.
const BINS: usize = 16;

/// From this many splits on groups are halved by count, so that no input can make the tree deeper than this plus 30
/// levels.
const MAX_SAH_SPLITS: u32 = 48;

/// What a top level is built over: an instance, or a subtree that lies in the world itself.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TopItem {
    planes: Planes,
    /// What below the item costs relative to other items. Positive.
    weight: f32,
    child: TopChild,
}

/// What an item refers to.
#[derive(Clone, Copy, Debug)]
pub(crate) enum TopChild {
    /// A node or leaf of the tree.
    Subtree(Child),
    /// Index of an instance among those given.
    Instance(u32),
}

impl TopItem {
    /// An item in a box, which is not empty and finite.
    pub fn new(bounds: &Aabb, weight: f32, child: TopChild) -> Self {
        Self {
            planes: Planes::new(bounds),
            weight,
            child,
        }
    }

    /// Follows a node that moved so many places back.
    pub fn move_back(&mut self, by: usize) {
        if let TopChild::Subtree(child) = &mut self.child
            && let ChildKind::Inner(index) = child.kind()
        {
            *child = Child::inner(index + by);
        }
    }
}

/// Nodes over items.
#[derive(Debug)]
pub(crate) struct TopLevel<const N: usize> {
    /// In depth-first order; the first is the root and always there.
    pub nodes: Vec<Node<N>>,
    /// The instances in the order in which the nodes refer to them.
    pub instances: Vec<u32>,
    /// Levels of nodes, the root being one.
    pub depth: usize,
    /// The box around all items.
    pub bounds: Aabb,
}

impl<const N: usize> TopLevel<N> {
    /// Builds nodes over items, which come out in another order. Without items there is an empty root.
    pub fn new(items: &mut [TopItem]) -> Self {
        let mut top = Self {
            nodes: Vec::with_capacity(1 + items.len() / 2),
            instances: Vec::with_capacity(items.len()),
            depth: 1,
            bounds: Planes::around(items).bounds(),
        };
        let root = Group {
            items: 0..items.len(),
            planes: Planes::around(items),
            splits: 0,
        };
        top.add_node(items, root, 1);
        top
    }

    /// Nodes that so many items need at most.
    pub fn most_nodes(items: usize) -> usize {
        // Every node but an empty or a lone root has two children or more.
        items.saturating_sub(1).max(1)
    }

    /// Appends the node of a group and all that is below, and returns its place.
    fn add_node(&mut self, items: &mut [TopItem], group: Group, level: usize) -> usize {
        self.depth = self.depth.max(level);
        let place = self.nodes.len();
        self.nodes.push(Node::EMPTY);
        for (slot, group) in children::<N>(items, group).into_iter().enumerate() {
            let bounds = group.planes.bounds();
            let child = match &items[group.items.clone()] {
                [item] => match item.child {
                    TopChild::Subtree(child) => child,
                    TopChild::Instance(index) => {
                        self.instances.push(index);
                        Child::instance(self.instances.len() - 1)
                    }
                },
                _ => Child::inner(self.add_node(items, group, level + 1)),
            };
            self.nodes[place].set(slot, child, &bounds);
        }
        place
    }
}

/// Items that stand together.
#[derive(Clone, Debug)]
struct Group {
    items: Range<usize>,
    planes: Planes,
    /// How many splits it comes from.
    splits: u32,
}

/// Divides a group into the children of a node, the largest first.
fn children<const N: usize>(items: &mut [TopItem], group: Group) -> Vec<Group> {
    let mut groups = Vec::with_capacity(N);
    if !group.items.is_empty() {
        groups.push(group);
    }
    while groups.len() < N
        && let Some(large) = largest(&groups, N + 1..usize::MAX)
    {
        let [left, right] = split(items, &groups[large]);
        groups[large] = left;
        groups.push(right);
    }
    // Groups whose items all have room need no node of their own.
    while let Some(small) = largest(&groups, 2..N + 2 - groups.len()) {
        let group = groups.swap_remove(small);
        groups.extend(group.items.map(|index| Group {
            items: index..index + 1,
            planes: items[index].planes,
            splits: 0,
        }));
    }
    groups.sort_by(|a, b| b.planes.half_area().total_cmp(&a.planes.half_area()));
    groups
}

/// The group of the largest box among those of so many items.
fn largest(groups: &[Group], lens: Range<usize>) -> Option<usize> {
    let mut largest = None;
    let mut largest_area = f32::NEG_INFINITY;
    for (place, group) in groups.iter().enumerate() {
        let area = group.planes.half_area();
        // NaN, of boxes too large to be measured, is taken like any other if nothing else is left.
        if lens.contains(&group.items.len()) && (largest.is_none() || area > largest_area) {
            (largest, largest_area) = (Some(place), area);
        }
    }
    largest
}

/// Divides a group of two items or more; both halves have some.
fn split(items: &mut [TopItem], group: &Group) -> [Group; 2] {
    let first = group.items.start;
    let items = &mut items[group.items.clone()];
    let middle = match best_plane(items, group.splits) {
        Some(Plane {
            bins,
            axis,
            first_right,
        }) => partition(items, |item| bins.place(&item.planes, axis) < first_right),
        None => {
            halve(items);
            items.len() / 2
        }
    };
    let part = |range: Range<usize>| Group {
        planes: Planes::around(&items[range.clone()]),
        items: first + range.start..first + range.end,
        splits: group.splits + 1,
    };
    [part(0..middle), part(middle..items.len())]
}

/// Puts items for which `is_left` holds first and returns how many they are.
fn partition(items: &mut [TopItem], is_left: impl Fn(&TopItem) -> bool) -> usize {
    let mut left = 0;
    for index in 0..items.len() {
        if is_left(&items[index]) {
            items.swap(left, index);
            left += 1;
        }
    }
    left
}

/// Puts items in order along the axis where their centres are farthest apart.
fn halve(items: &mut [TopItem]) {
    let centers = Planes::around_centers(items);
    let spread = |axis: usize| centers.high[axis] - centers.low[axis];
    let axis = (1..3).fold(0, |best, axis| {
        if spread(axis) > spread(best) {
            axis
        } else {
            best
        }
    });
    items.sort_by(|a, b| a.planes.center()[axis].total_cmp(&b.planes.center()[axis]));
}

/// Where a group is split.
struct Plane {
    bins: Bins,
    axis: usize,
    first_right: usize,
}

/// The split of least expected cost; `None` if there is none between two bins, or the areas are too large to be
/// compared.
fn best_plane(items: &[TopItem], splits: u32) -> Option<Plane> {
    if items.len() == 2 || splits >= MAX_SAH_SPLITS {
        return None;
    }
    let bins = Bins::new(&Planes::around_centers(items), items.len().min(BINS));
    let mut contents = [[(Planes::EMPTY, 0.0); BINS]; 3];
    for item in items {
        let places = bins.places(&item.planes);
        for (contents, place) in contents.iter_mut().zip(places) {
            let (planes, weight) = &mut contents[place];
            *planes = planes.union(&item.planes);
            *weight += item.weight;
        }
    }
    let mut best = None;
    let mut best_cost = f32::INFINITY;
    for (axis, contents) in contents.iter().enumerate() {
        if bins.scales[axis] == 0.0 {
            continue;
        }
        let mut right_costs = [0.0; BINS];
        let mut right = (Planes::EMPTY, 0.0);
        for bin in (1..bins.count).rev() {
            right = (right.0.union(&contents[bin].0), right.1 + contents[bin].1);
            right_costs[bin] = right.0.half_area() * right.1;
        }
        let mut left = (Planes::EMPTY, 0.0);
        for bin in 1..bins.count {
            let here = &contents[bin - 1];
            left = (left.0.union(&here.0), left.1 + here.1);
            let cost = left.0.half_area() * left.1 + right_costs[bin];
            // The first and the last bin are never empty, so both sides have some items.
            if cost < best_cost {
                best_cost = cost;
                best = Some(Plane {
                    bins,
                    axis,
                    first_right: bin,
                });
            }
        }
    }
    best
}

/// Where centres fall on each axis.
#[derive(Clone, Copy)]
struct Bins {
    origin: [f32; 4],
    /// 0 where centres coincide, or are too far apart or too close for this to be a number.
    scales: [f32; 4],
    count: usize,
}

impl Bins {
    fn new(centers: &Planes, count: usize) -> Self {
        let scale = |axis: usize| {
            let scale = count as f32 / (centers.high[axis] - centers.low[axis]);
            if scale > 0.0 && scale < f32::INFINITY {
                scale
            } else {
                0.0
            }
        };
        Self {
            origin: centers.low,
            scales: [scale(0), scale(1), scale(2), 0.0],
            count,
        }
    }

    #[inline(always)]
    fn places(&self, planes: &Planes) -> [usize; 3] {
        [0, 1, 2].map(|axis| self.place(planes, axis))
    }

    #[inline(always)]
    fn place(&self, planes: &Planes, axis: usize) -> usize {
        let place = (planes.center()[axis] - self.origin[axis]) * self.scales[axis];
        // Conversion to 32 bits is the fastest. Neither NaN nor anything negative becomes an index out of range.
        (place as i32 as usize).min(self.count - 1)
    }
}

/// A box in two vectors of four; the fourth numbers have no meaning.
#[derive(Clone, Copy, Debug)]
struct Planes {
    low: [f32; 4],
    high: [f32; 4],
}

impl Planes {
    const EMPTY: Self = Self {
        low: [f32::INFINITY; 4],
        high: [f32::NEG_INFINITY; 4],
    };

    fn new(bounds: &Aabb) -> Self {
        let four = |[x, y, z]: [f32; 3]| [x, y, z, 0.0];
        Self {
            low: four(bounds.min),
            high: four(bounds.max),
        }
    }

    fn bounds(&self) -> Aabb {
        let three = |[x, y, z, _]: [f32; 4]| [x, y, z];
        Aabb {
            min: three(self.low),
            max: three(self.high),
        }
    }

    #[inline(always)]
    fn center(&self) -> [f32; 4] {
        // Halves cannot overflow when added.
        core::array::from_fn(|axis| 0.5 * self.low[axis] + 0.5 * self.high[axis])
    }

    #[inline(always)]
    fn union(&self, other: &Self) -> Self {
        let less = |a: f32, b: f32| if a < b { a } else { b };
        let more = |a: f32, b: f32| if a > b { a } else { b };
        Self {
            low: core::array::from_fn(|axis| less(self.low[axis], other.low[axis])),
            high: core::array::from_fn(|axis| more(self.high[axis], other.high[axis])),
        }
    }

    fn around(items: &[TopItem]) -> Self {
        (items.iter()).fold(Self::EMPTY, |all, item| all.union(&item.planes))
    }

    fn around_centers(items: &[TopItem]) -> Self {
        items.iter().fold(Self::EMPTY, |all, item| {
            let center = item.planes.center();
            all.union(&Self {
                low: center,
                high: center,
            })
        })
    }

    /// Half the surface area. Of the empty box it may be anything but less than 0.
    #[inline(always)]
    fn half_area(&self) -> f32 {
        let [x, y, z]: [f32; 3] = core::array::from_fn(|axis| self.high[axis] - self.low[axis]);
        x * y + y * z + z * x
    }
}

#[cfg(test)]
mod tests {
    use alloc::format;
    use alloc::vec;

    use super::*;
    use antumbra_testkit::Rng;

    /// Boxes of a kind, each with its place in the list.
    fn items(count: usize, mut bounds: impl FnMut(usize) -> Aabb) -> Vec<TopItem> {
        let item = |index: usize| {
            let child = TopChild::Instance(index as u32);
            TopItem::new(&bounds(index), 1.0, child)
        };
        (0..count).map(item).collect()
    }

    /// Checks that every item is referred to once and that boxes hold what is below them.
    fn check<const N: usize>(items: &[TopItem], place: &str) -> TopLevel<N> {
        let mut sorted = items.to_vec();
        let top = TopLevel::<N>::new(&mut sorted);
        assert!(
            top.nodes.len() <= TopLevel::<N>::most_nodes(items.len()),
            "{place}"
        );
        let mut found = vec![0; items.len()];
        let mut parents = vec![0; top.nodes.len()];
        for (index, node) in top.nodes.iter().enumerate() {
            for slot in 0..node.len() {
                let below = match node.child(slot).kind() {
                    ChildKind::Inner(child) => {
                        assert!(child > index, "{place}");
                        parents[child] += 1;
                        top.nodes[child].all_bounds()
                    }
                    ChildKind::Instance(instance) => {
                        let item = top.instances[instance] as usize;
                        found[item] += 1;
                        items[item].planes.bounds()
                    }
                    ChildKind::Leaf(_) => unreachable!("no leaves are given"),
                };
                assert_eq!(node.bounds(slot), below, "{place}");
            }
        }
        assert!(found.iter().all(|count| *count == 1), "{place}");
        assert!(parents[1..].iter().all(|count| *count == 1), "{place}");
        assert!(top.depth <= MAX_SAH_SPLITS as usize + 30, "{place}");
        top
    }

    #[test]
    fn everything_is_below_the_root_once() {
        let mut rng = Rng::new(404);
        for count in [0, 1, 2, 3, 4, 5, 16, 17, 18, 40, 300, 5000] {
            let random = items(count, |_| Aabb::around(&[rng.point(1.0), rng.point(1.0)]));
            let equal = items(count, |_| Aabb::around(&[[1.0; 3], [2.0; 3]]));
            let huge = items(count, |index| {
                let x = 1e38 * (index % 3) as f32;
                Aabb::around(&[[-x; 3], [1e30 + x; 3]])
            });
            let nested = items(count, |index| {
                let size = 0.5f32.powi((index % 200) as i32);
                Aabb::around(&[[0.0; 3], [size; 3]])
            });
            for (items, kind) in [
                (random, "random"),
                (equal, "equal"),
                (huge, "huge"),
                (nested, "nested"),
            ] {
                let place = format!("{count} {kind}");
                check::<4>(&items, &place);
                check::<8>(&items, &place);
                check::<16>(&items, &place);
            }
        }
    }

    /// Nodes are nearly full, which is what makes them few.
    #[test]
    fn slots_are_used() {
        let mut rng = Rng::new(405);
        let items = items(10_000, |_| {
            let [x, y, z] = rng.point(100.0);
            Aabb::around(&[[x, y, z], [x + 1.0, y + 1.0, z + 1.0]])
        });
        let nodes = check::<8>(&items, "scattered").nodes.len();
        assert!(nodes < 10_000 / 4, "{nodes} nodes");
    }
}
