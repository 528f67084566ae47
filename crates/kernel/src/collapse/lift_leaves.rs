//! Lifted leaves: nodes above refer to leaves that occlude many rays, in place of the nodes that did or in addition to them.
//!
//! A ray that such a leaf occludes is spared the nodes between. A ray that meets the leaf's box and nothing in it tests the
//! leaf in vain, and twice if both nodes refer to it. Upper nodes have no free slots, so children that few rays come to
//! make room: they move into a new node below, which these rays test in addition. References are added where training rays gain more than they lose, from the root
//! downwards.
//!
//! A tree with two references to a leaf answers occlusion and nothing else: other queries would come to a primitive twice. A
//! tree of moved leaves is like any other.

use alloc::vec;
use alloc::vec::Vec;

use crate::aabb::Aabb;
use crate::ray::Ray;
use crate::trace::observe::{NodeVisit, Observer, Place};
use crate::tree::costs::CostModel;
use crate::tree::node::{Child, ChildKind, Leaf, Node};
use crate::tree::wide::WideTree;

/// Training rays must gain so much by a reference, in node tests of all together.
const LEAST_GAIN: f32 = 8.0;

/// A node that the current ray visits.
struct Visit {
    node: u32,
    from: Place,
    /// Cost of the ray from here downwards until something occludes it; `None` if it stops before.
    cost: Option<f32>,
    /// The ray in the space of the node.
    line: Ray,
    /// The slot below which the first occluder lies.
    stop: Option<u32>,
}

/// A leaf whose box the current ray hits.
struct Met {
    visit: u32,
    leaf: Leaf,
    /// Whether the ray tests the leaf before something occludes it.
    tested: bool,
    occludes: bool,
}

/// What becomes of the references that lifted leaves have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lift {
    /// Old references stay, and so a leaf has two.
    Duplicate,
    /// Old references go.
    Move,
}

/// Gain of a ray if a node referred to a leaf below.
#[derive(Clone, Copy)]
struct Gain {
    node: u32,
    /// Leaf as a [`Child`].
    leaf: u32,
    ray: u32,
    /// In node tests, if the leaf occludes the ray; it loses a test of the leaf otherwise.
    gain: f32,
    occludes: bool,
}

/// Follows training rays to their ends and collects what references would gain.
pub(crate) struct Gains<'a, const N: usize> {
    bvh: &'a WideTree<N>,
    model: &'a CostModel,
    lift: Lift,
    /// Per leaf, the node that refers to it.
    parents: Vec<u32>,
    ray: u32,
    stopped: bool,
    visits: Vec<Visit>,
    met: Vec<Met>,
    gains: Vec<Gain>,
    passing: Vec<Passing>,
}

/// A ray that comes to a node.
struct Passing {
    node: u32,
    ray: u32,
    /// The ray in the space of the node.
    line: Ray,
    /// The slot below which something occludes the ray.
    stop: Option<u32>,
}

impl Passing {
    /// Whether the ray would come to a new node of these children, as the last one of its node.
    fn comes_to(&self, slots: &[usize], bounds: &Aabb) -> bool {
        if self
            .stop
            .is_some_and(|stop| !slots.contains(&(stop as usize)))
        {
            return false;
        }
        let (mut near, mut far) = (self.line.tnear, self.line.tfar);
        for axis in 0..3 {
            let (org, dir) = (self.line.org[axis], self.line.dir[axis]);
            let [a, b] = [bounds.min[axis], bounds.max[axis]].map(|plane| (plane - org) / dir);
            // 0 / 0 limits nothing.
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        near <= far
    }
}

/// What is to be changed in a node.
pub(crate) struct Addition {
    node: u32,
    /// Leaves to be referred to, as [`Child`]s.
    leaves: Vec<u32>,
    /// Slots of children that move into a new node.
    moved: Vec<usize>,
}

impl Addition {
    /// Number of references.
    pub fn len(&self) -> usize {
        self.leaves.len()
    }
}

impl<'a, const N: usize> Gains<'a, N> {
    /// For a tree whose leaves have one reference each.
    pub fn new(bvh: &'a WideTree<N>, model: &'a CostModel, lift: Lift) -> Self {
        let mut parents = vec![0; bvh.leaf_count()];
        for (index, node) in bvh.nodes.iter().enumerate() {
            for (_, leaf) in leaves_of(node) {
                parents[bvh.leaf_index(leaf)] = index as u32;
            }
        }
        Self {
            bvh,
            model,
            lift,
            parents,
            ray: 0,
            stopped: false,
            visits: Vec::new(),
            met: Vec::new(),
            gains: Vec::new(),
            passing: Vec::new(),
        }
    }

    /// What is to be added, by ascending nodes.
    pub fn additions(mut self) -> Vec<Addition> {
        self.gains.sort_by_key(|gain| (gain.node, gain.leaf));
        self.passing.sort_by_key(|passing| passing.node);
        let mut answered = vec![false; self.ray as usize + 1];
        let mut additions = Vec::new();
        let mut moved_leaves = Vec::new();
        for of_node in self.gains.chunk_by(|a, b| a.node == b.node) {
            let mut addition = Addition {
                node: of_node[0].node,
                leaves: Vec::new(),
                moved: Vec::new(),
            };
            // A node of references and a new node alone would spare nothing.
            while addition.leaves.len() + 2 < N {
                let sum = |of_leaf: &[Gain]| -> f32 {
                    let open = of_leaf.iter().filter(|gain| !answered[gain.ray as usize]);
                    open.map(|gain| gain.gain).sum()
                };
                let leaves = of_node.chunk_by(|a, b| a.leaf == b.leaf);
                let stays = |of_leaf: &&[Gain]| !moved_leaves.contains(&of_leaf[0].leaf);
                let sums = leaves.filter(stays).map(|of_leaf| (sum(of_leaf), of_leaf));
                let Some((gain, best)) = sums.max_by(|a, b| a.0.total_cmp(&b.0)) else {
                    break;
                };
                if gain < LEAST_GAIN {
                    break;
                }
                let (moved, price) = self.make_room(&addition, &answered);
                if gain - self.model.node * (price as f32) < LEAST_GAIN {
                    break;
                }
                addition.leaves.push(best[0].leaf);
                if self.lift == Lift::Move {
                    moved_leaves.push(best[0].leaf);
                }
                addition.moved = moved;
                for gain in best.iter().filter(|gain| gain.occludes) {
                    answered[gain.ray as usize] = true;
                }
            }
            if !addition.leaves.is_empty() {
                additions.push(addition);
            }
        }
        additions
    }

    /// Slots of children that move into a new node if one more reference is added, and how many more rays come to that
    /// node.
    fn make_room(&self, addition: &Addition, answered: &[bool]) -> (Vec<usize>, usize) {
        let node = &self.bvh.nodes[addition.node as usize];
        let len = node.len();
        let taken = addition.leaves.len() + 1;
        if len + taken <= N {
            return (Vec::new(), 0);
        }
        let first = self
            .passing
            .partition_point(|passing| passing.node < addition.node);
        let here = self.passing[first..].iter();
        let here: Vec<_> = here
            .take_while(|passing| passing.node == addition.node)
            .filter(|passing| !answered[passing.ray as usize])
            .collect();
        let come = |slots: &[usize]| {
            let boxes = slots.iter().map(|slot| node.bounds(*slot));
            let bounds = boxes.fold(Aabb::EMPTY, |all, bounds| all.union(&bounds));
            let rays = here
                .iter()
                .filter(|passing| passing.comes_to(slots, &bounds));
            rays.count()
        };
        let old = &addition.moved;
        let before = if old.is_empty() { 0 } else { come(old) };
        let mut best: Option<(Vec<usize>, usize)> = None;
        for a in (0..len).filter(|slot| !old.contains(slot)) {
            // The first to move are two, as the new node takes the slot of one.
            let partners = if old.is_empty() { a + 1..len } else { a..a + 1 };
            for b in partners {
                let mut slots = old.clone();
                slots.push(a);
                if b != a {
                    slots.push(b);
                }
                let rays = come(&slots);
                if best.as_ref().is_none_or(|(_, least)| rays < *least) {
                    best = Some((slots, rays));
                }
            }
        }
        best.map_or((Vec::new(), usize::MAX), |(slots, rays)| {
            (slots, rays.saturating_sub(before))
        })
    }
}

/// Slots of a node that refer to leaves.
fn leaves_of<const N: usize>(node: &Node<N>) -> impl Iterator<Item = (usize, Leaf)> {
    (0..node.len()).filter_map(|slot| match node.child(slot).kind() {
        ChildKind::Leaf(leaf) => Some((slot, leaf)),
        _ => None,
    })
}

/// A node with some of its children.
fn retained<const N: usize>(node: &Node<N>, stays: impl Fn(Child) -> bool) -> Node<N> {
    let mut found = Node::EMPTY;
    let slots = (0..node.len()).filter(|slot| stays(node.child(*slot)));
    for (place, slot) in slots.enumerate() {
        found.set(place, node.child(slot), &node.bounds(slot));
    }
    found
}

impl<const N: usize> Observer for Gains<'_, N> {
    fn begin(&mut self, index: usize, _: &Ray) {
        self.ray = index as u32;
        self.stopped = false;
        self.visits.clear();
        self.met.clear();
    }

    fn goes_on(&self) -> bool {
        true
    }

    fn node(&mut self, visit: &NodeVisit<'_>) -> u32 {
        let number = self.visits.len() as u32;
        for (slot, leaf) in leaves_of(&self.bvh.nodes[visit.node]) {
            if visit.lanes >> Node::<N>::lane(slot) & 1 == 1 {
                self.met.push(Met {
                    visit: number,
                    leaf,
                    tested: false,
                    occludes: false,
                });
            }
        }
        self.visits.push(Visit {
            node: visit.node as u32,
            from: visit.from,
            cost: (!self.stopped).then_some(self.model.node),
            line: **visit.ray,
            stop: None,
        });
        number
    }

    fn leaf(&mut self, leaf: usize, prims: usize) {
        if self.stopped {
            return;
        }
        let is_it = |met: &&mut Met| self.bvh.leaf_index(met.leaf) == leaf;
        if let Some(met) = self.met.iter_mut().rev().find(is_it) {
            met.tested = true;
        }
        let parent = self.parents[leaf];
        let visit = self
            .visits
            .iter_mut()
            .rev()
            .find(|visit| visit.node == parent);
        if let Some(cost) = visit.and_then(|visit| visit.cost.as_mut()) {
            *cost += self.model.prim * prims as f32;
        }
    }

    fn occluder(&mut self, leaf: usize, _: usize, from: Place) {
        let mut at = from;
        while !self.stopped && at != Place::NONE {
            let visit = &mut self.visits[at.visit as usize];
            visit.stop = Some(at.slot);
            at = visit.from;
        }
        self.stopped = true;
        let is_it =
            |met: &&mut Met| met.visit == from.visit && self.bvh.leaf_index(met.leaf) == leaf;
        if let Some(met) = self.met.iter_mut().rev().find(is_it) {
            met.occludes = true;
        }
    }

    fn end(&mut self) {
        for index in (0..self.visits.len()).rev() {
            let Visit {
                node,
                from,
                cost,
                line,
                stop,
            } = self.visits[index];
            if cost.is_some() {
                self.passing.push(Passing {
                    node,
                    ray: self.ray,
                    line,
                    stop,
                });
            }
            if let (Some(cost), true) = (cost, from != Place::NONE)
                && let Some(sum) = &mut self.visits[from.visit as usize].cost
            {
                *sum += cost;
            }
        }
        for met in &self.met {
            let leaf_cost = self.bvh.leaf_cost(met.leaf, self.model) as f32;
            let mut from = self.visits[met.visit as usize].from;
            while from != Place::NONE {
                let above = &self.visits[from.visit as usize];
                let node = &self.bvh.nodes[above.node as usize];
                if !matches!(node.child(from.slot as usize).kind(), ChildKind::Inner(_)) {
                    // Above is another space.
                    break;
                }
                if let Some(cost) = above.cost {
                    let spared = if met.occludes {
                        cost - self.model.node
                    } else {
                        0.0
                    };
                    // A leaf that was moved is tested here in place of there.
                    let is_spared = self.lift == Lift::Move && met.tested && !met.occludes;
                    self.gains.push(Gain {
                        node: above.node,
                        leaf: Child::leaf(met.leaf).0,
                        ray: self.ray,
                        gain: spared - if is_spared { 0.0 } else { leaf_cost },
                        occludes: met.occludes,
                    });
                }
                from = above.from;
            }
        }
    }
}

impl<const N: usize> WideTree<N> {
    /// The tree with these references. They come first in their nodes.
    pub fn with_additions(&self, additions: &[Addition], lift: Lift) -> Self {
        let mut bounds = vec![Aabb::EMPTY; self.leaf_count()];
        for node in &self.nodes {
            for (slot, leaf) in leaves_of(node) {
                bounds[self.leaf_index(leaf)] = node.bounds(slot);
            }
        }
        let mut nodes = self.nodes.clone();
        for addition in additions {
            let old = &self.nodes[addition.node as usize];
            let mut node = Node::EMPTY;
            let mut len = 0;
            let mut add = |child: Child, bounds: &Aabb| {
                node.set(len, child, bounds);
                len += 1;
            };
            for &leaf in &addition.leaves {
                if let ChildKind::Leaf(kind) = Child(leaf).kind() {
                    add(Child(leaf), &bounds[self.leaf_index(kind)]);
                }
            }
            let moved = &addition.moved;
            for slot in (0..old.len()).filter(|slot| !moved.contains(slot)) {
                add(old.child(slot), &old.bounds(slot));
            }
            if !moved.is_empty() {
                let mut below = Node::EMPTY;
                for (place, &slot) in moved.iter().enumerate() {
                    below.set(place, old.child(slot), &old.bounds(slot));
                }
                add(Child::inner(nodes.len()), &below.all_bounds());
                nodes.push(below);
            }
            nodes[addition.node as usize] = node;
        }
        let mut tree = Self {
            nodes,
            ..self.clone()
        };
        if lift == Lift::Move {
            tree.drop_other_references(additions);
        }
        tree.renumber();
        tree.fit_boxes();
        tree.depth = tree.levels().expect("children follow their parents");
        tree
    }

    /// Leaves no reference to a moved leaf but the new one, and none to nodes without children.
    fn drop_other_references(&mut self, additions: &[Addition]) {
        let mut targets = vec![None; self.leaf_count()];
        for addition in additions {
            for &leaf in &addition.leaves {
                if let ChildKind::Leaf(leaf) = Child(leaf).kind() {
                    targets[self.leaf_index(leaf)] = Some(addition.node as usize);
                }
            }
        }
        for index in 0..self.nodes.len() {
            let stays = |child: Child| match child.kind() {
                ChildKind::Leaf(leaf) => {
                    targets[self.leaf_index(leaf)].is_none_or(|target| target == index)
                }
                _ => true,
            };
            self.nodes[index] = retained(&self.nodes[index], stays);
        }
        loop {
            let empty: Vec<_> = self.nodes.iter().map(|node| node.len() == 0).collect();
            let is_full = |child: Child| match child.kind() {
                ChildKind::Inner(index) => !empty[index],
                _ => true,
            };
            let mut has_changed = false;
            for node in &mut self.nodes {
                let retained = retained(node, is_full);
                has_changed |= retained.len() < node.len();
                *node = retained;
            }
            if !has_changed {
                break;
            }
        }
    }

    /// Makes the boxes of all inner nodes anew from those of their children, which follow them.
    fn fit_boxes(&mut self) {
        for index in (0..self.nodes.len()).rev() {
            for slot in 0..self.nodes[index].len() {
                let child = self.nodes[index].child(slot);
                if let ChildKind::Inner(below) = child.kind() {
                    let bounds = self.nodes[below].all_bounds();
                    self.nodes[index].set(slot, child, &bounds);
                }
            }
        }
    }

    /// Puts the nodes of every tree into depth-first order.
    fn renumber(&mut self) {
        let mut order = Vec::with_capacity(self.nodes.len());
        let mut places = vec![0; self.nodes.len()];
        let roots = core::iter::once(0).chain(self.roots.iter().copied());
        for root in roots {
            let mut open = vec![root as usize];
            while let Some(index) = open.pop() {
                places[index] = order.len() as u32;
                order.push(index);
                let node = &self.nodes[index];
                for slot in (0..node.len()).rev() {
                    if let ChildKind::Inner(child) = node.child(slot).kind() {
                        open.push(child);
                    }
                }
            }
        }
        let old = core::mem::take(&mut self.nodes);
        self.nodes = order.iter().map(|index| old[*index].clone()).collect();
        for node in &mut self.nodes {
            for child in &mut node.children {
                if let ChildKind::Inner(index) = Child(*child).kind() {
                    *child = places[index];
                }
            }
        }
        for root in &mut self.roots {
            *root = places[*root as usize];
        }
        for placed in &mut self.instances {
            placed.root = places[placed.root as usize];
        }
    }
}
