//! What a tree learned while running, for copies of it.

use alloc::vec::Vec;

use super::bvh::Bvh;
use super::recipe::Recipe;
use super::steps::Steps;
use crate::learn::Log;
use crate::ray::Ray;
use crate::tree::node::{AS_THEY_ARE, Child, ChildKind};
use crate::tree::wide::Tree;

/// Nodes that fewer than one of this many rays visited are left out: they are many, and save next to nothing.
const RARE: u64 = 256;

/// The order of children that a tree [learned](Bvh::relearn), for [copies](Bvh::adopt) of the tree.
///
/// Learning takes many milliseconds, adopting about a tenth of one. So a copy can learn on a thread of its own while the tree
/// answers queries:
///
/// ```
/// use antumbra::{Bvh, Geometry, Ray, Recipe};
///
/// let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// let mut bvh = Bvh::build(&[Geometry::triangles(&positions[..], vec![[0, 1, 2]])], &Recipe::default())?;
/// let mut copy = bvh.clone();
/// let sample = [Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0])];
/// let learning = std::thread::spawn(move || copy.relearn(&sample, &Recipe::default()));
/// // Frames are drawn here with `bvh`, until:
/// bvh.adopt(&learning.join().expect("it does not panic"));
/// # Ok::<(), antumbra::Error>(())
/// ```
///
/// Holds the nodes that at least one of 256 rays visited.
#[derive(Clone, Debug, Default)]
pub struct ChildOrder {
    width: usize,
    /// Nodes in ascending order, counted from the first that copies have in common.
    nodes: Vec<u32>,
    /// The children of each, `width` per node, by slots. A child that is a node is stored as its distance behind the node.
    children: Vec<Child>,
    /// Order of the top level of a world.
    pub(super) ranks: Ranks,
}

impl ChildOrder {
    /// The order of a tree from a node on, at the nodes that rays of a log visited.
    fn of(tree: &Tree, first: usize, log: &Log) -> Self {
        let mut order = Self {
            width: tree.width().lanes(),
            ..Self::default()
        };
        let is_known = log.kind().boxes;
        for (index, node) in tree.nodes.iter().enumerate().skip(first) {
            let visits = u64::from(log.node_entered(index));
            if node.len() > 1 && (!is_known || visits * RARE >= log.rays().max(1)) {
                order.nodes.push((index - first) as u32);
                let children = (0..node.width()).map(|slot| from_here(node.child(slot), index));
                order.children.extend(children);
            }
        }
        order
    }

    /// Puts the children of the nodes of a tree in this order, where they are the same.
    fn apply(&self, tree: &mut Tree, first: usize) {
        let width = tree.width().lanes();
        if self.width != width {
            return;
        }
        for (node, children) in self.nodes.iter().zip(self.children.chunks_exact(width)) {
            let index = first + *node as usize;
            if index >= tree.nodes.len() {
                return;
            }
            let mut node = tree.nodes.get_mut(index);
            let mut slots = AS_THEY_ARE;
            let mut found = 0_u32;
            for (slot, child) in children.iter().enumerate() {
                let is_it = |old: &usize| from_here(node.any().child(*old), index) == *child;
                // Empty slots are alike.
                let is_free = |old: &usize| found >> old & 1 == 0;
                if let Some(old) = (0..width).find(|old| is_free(old) && is_it(old)) {
                    slots[slot] = old as u8;
                    found |= 1 << old;
                }
            }
            if found.count_ones() as usize == width {
                node.permute(&slots[..width]);
            }
        }
    }
}

/// A child relative to its node, which does not depend on where the tree is in the list of nodes.
fn from_here(child: Child, node: usize) -> Child {
    match child.kind() {
        ChildKind::Inner(index) => Child::inner(index - node),
        _ => child,
    }
}

/// Places of the items of a top level in an order that was learned.
#[derive(Clone, Debug, Default)]
pub(super) struct Ranks {
    /// Rank of each subtree of the ground.
    pub ground: Vec<u32>,
    /// Rank of each instance.
    pub instances: Vec<u32>,
}

impl Ranks {
    /// Ranks of this many items of the ground, followed by the ranks of instances. Empty if nothing was learned. New
    /// items come last.
    pub fn of(&self, ground: usize, instances: usize) -> Vec<u32> {
        let known = self.ground.len() + self.instances.len();
        let ranks = |ranks: &[u32], count: usize| -> Vec<u32> {
            let missing = core::iter::repeat(known as u32);
            ranks.iter().copied().chain(missing).take(count).collect()
        };
        match known {
            0 => Vec::new(),
            _ => [
                ranks(&self.ground, ground),
                ranks(&self.instances, instances),
            ]
            .concat(),
        }
    }
}

impl Bvh {
    /// Learns the child order again, for these rays: puts the children of every node in the [order](Recipe::order) of the
    /// recipe, whatever order they are in. The nodes stay, and so does every answer. Returns the order for copies of the tree.
    ///
    /// Takes about a hundred times as long as tracing the rays, on the calling thread: some ten milliseconds for a few
    /// thousand. Rays of the last frames are a good sample, see [`RayMemory`](crate::RayMemory). Without rays an order that
    /// [learns](crate::recipe::Order::learns) changes nothing, and [`Order::Simple`](crate::recipe::Order::Simple) never does.
    ///
    /// A tree that [moves](Bvh::moving) keeps its order.
    ///
    /// ```
    /// # use antumbra::{Bvh, Geometry, Ray, Recipe};
    /// # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
    /// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
    /// # let mut bvh = Bvh::build(&geometry, &Recipe::default())?;
    /// let rays = [Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0]); 100];
    /// let order = bvh.relearn(&rays, &Recipe::default());
    /// let mut copy = bvh.clone();
    /// copy.adopt(&order);
    /// assert!(copy.occluded(&rays[0]));
    /// # Ok::<(), antumbra::Error>(())
    /// ```
    pub fn relearn(&mut self, rays: &[Ray], recipe: &Recipe) -> ChildOrder {
        self.relearn_from(0, rays, recipe)
    }

    /// Puts children in the order that a copy of this tree [learned](Bvh::relearn). The nodes stay, and so does every answer.
    ///
    /// Takes less than a millisecond for a hundred thousand triangles. Both trees may have been [refitted](Bvh::refit) since they were copied.
    /// Nodes whose children are not those that the copy had stay as they are: the order of another tree changes
    /// nothing, or next to nothing.
    pub fn adopt(&mut self, order: &ChildOrder) {
        self.adopt_from(0, order);
    }

    /// [`Bvh::relearn`]. The order returned covers the nodes from `first` on.
    pub(super) fn relearn_from(
        &mut self,
        first: usize,
        rays: &[Ray],
        recipe: &Recipe,
    ) -> ChildOrder {
        if self.moves() {
            return ChildOrder::default();
        }
        let log = self
            .learn_order(rays, None, recipe)
            .expect("the log is made here, of this tree and as the order needs it");
        log.map_or_else(ChildOrder::default, |log| {
            ChildOrder::of(&self.tree, first, &log)
        })
    }

    /// [`Bvh::adopt`], for an order whose nodes are counted from `first`.
    pub(super) fn adopt_from(&mut self, first: usize, order: &ChildOrder) {
        if !self.moves() {
            order.apply(&mut self.tree, first);
        }
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec;
    use antumbra_testkit::{Rng, mesh};

    use super::*;
    use crate::parts::{Cost, Steps};
    use crate::recipe::Engine;
    use crate::{Geometry, Width};

    /// A tree that learned from some rays and learns again from others gives the same answers, with fewer tests.
    #[test]
    fn a_tree_learns_the_rays_of_today() {
        let mut rng = Rng::new(2026);
        let mesh = mesh::bumpy_grid(&mut rng, 4000);
        let geometry = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
        let mut rays = |low: f32, high: f32| -> Vec<Ray> {
            (0..4000)
                .map(|_| {
                    let mut from = rng.point(1.0);
                    from[0] = rng.range(low, high);
                    Ray::between(from, rng.point(1.2))
                })
                .collect()
        };
        let (yesterday, today, test) = (rays(-1.0, -0.5), rays(0.5, 1.0), rays(0.5, 1.0));
        // Of one width everywhere: an order has least to gain in a tree of four children.
        let recipe = Recipe {
            engine: Engine::best(Width::W16),
            ..Recipe::default()
        };
        let mut bvh = Bvh::learn(&geometry, &yesterday, &recipe).expect("a tree");
        let tests = |bvh: &Bvh| {
            let (mut occluded, mut costs) =
                (vec![false; test.len()], vec![Cost::default(); test.len()]);
            bvh.occluded_batch_counted(&test, &mut occluded, &mut costs);
            let nodes: u64 = costs.iter().map(|cost| u64::from(cost.node_tests)).sum();
            (occluded, nodes)
        };
        let (before, before_nodes) = tests(&bvh);
        let mut copy = bvh.clone();
        let order = bvh.relearn(&today, &recipe);
        let (after, after_nodes) = tests(&bvh);
        assert_eq!(before, after);
        assert!(after_nodes < before_nodes, "{after_nodes} {before_nodes}");
        bvh.validate().expect("sound");
        // Nodes that are rarely visited are left out.
        copy.adopt(&order);
        let (adopted, adopted_nodes) = tests(&copy);
        assert_eq!(before, adopted);
        let saved = (before_nodes - after_nodes) as f64;
        assert!(
            (before_nodes - adopted_nodes) as f64 > 0.8 * saved,
            "{adopted_nodes} {after_nodes}"
        );
        copy.validate().expect("sound");
        // The order of another tree changes nothing that matters.
        let mut other = Bvh::build(&geometry[..0], &recipe).expect("a tree");
        other.adopt(&order);
        other.validate().expect("sound");
        bvh.relearn(&[], &recipe);
        assert_eq!(tests(&bvh).1, after_nodes);
    }
}
