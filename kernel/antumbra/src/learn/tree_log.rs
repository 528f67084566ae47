//! The training log of a *binary* tree: which nodes sample rays enter and which primitives they hit, without stopping at
//! the first occluder.
//!
//! Every N-wide tree over the same primitives is a collapse of the binary one, so this one log serves them all,
//! whatever their width and the order of their children: it is not biased by any order, and needs no shuffling. It
//! keeps what each ray hit, not only sums, so that the visits of rays that do stop can be counted for any order, see
//! [`TreeLog::visits`]. Objects have logs of their own, in which the rays of all instances come together.

use alloc::vec;
use alloc::vec::Vec;
use core::cell::Cell;

use antumbra_simd::{Dispatch, Isa};

use crate::geometry::primitives::Primitives;
use crate::geometry::ray_setup::RaySetup;
use crate::learn::node_lists::NodeLists;
use crate::learn::surface_rays::{default_count, surface_rays_within};
use crate::monitor::BuildMonitor;
use crate::parallel;
use crate::ray::Ray;
use crate::trace::binary::{Exhaustive, LeafHits, Witness};
use crate::tree::binary::{BinaryKind, BinaryTree};

/// Rays that one task follows.
const CHUNK: usize = 128;
/// Tasks that share the memory of a log: one ray of a very large scene may need more than the share of a small task.
const MAX_TASKS: usize = 64;
/// Bytes that a ray takes besides its nodes: its weight and the length of its list.
const RAY_BYTES: usize = 8;
/// Bytes of a node in a list, unless it is far from the node before.
const NODE_BYTES: usize = 2;
/// Bytes of a hit of a primitive.
const HIT_BYTES: usize = size_of::<u32>();
/// Bytes of a log whatever the scene: of the whole log, and of one call of [`TreeLog::add`].
const FREE_BYTES: [usize; 2] = [48 << 20, 32 << 20];
/// Further bytes per node, primitive and instance of all trees.
const BYTES_PER_ITEM: [usize; 2] = [16, 12];
/// Bytes that bound the time of a call: whatever the scene, per node and primitive, and per ray that was given. Rays of
/// ordinary scenes take a hundred bytes, in a forest of instances seven hundred, in a soup half a byte per triangle.
const FAIR_BYTES: [usize; 3] = [256 << 10, 2, 2048];
/// Primitives that an instance counts as where time is bounded: rays go into its object.
pub(crate) const INSTANCE_ITEMS: usize = 32;
/// Nodes that a task enters between two questions whether it should stop: about a millisecond.
const NODES_PER_QUESTION: usize = 8192;

/// Training log of a binary tree: the nodes that sample rays entered and the primitives that they hit.
///
/// A few thousand rays are plenty. Each takes a hundred bytes or so until the log is dropped, seven hundred in a forest
/// of instances.
/// Rays through thousands of overlapping primitives would take a thousand times as much. Fewer of them are followed then, so
/// that learning takes a share of the time of the build whatever the scene: see [`TreeLog::add`].
///
/// Partly transparent triangles are hit by the rays that they would stop, see [`crate::cutout::Opacity`].
///
/// A log of one kind of rays can ruin the tree for another kind. Unless only one kind will be traced, add
/// [`crate::parts::surface_rays`] of the same weight as your own: on four scenes that costs your rays 0 to 6 % more
/// visits and spares the others up to 35 %.
#[derive(Clone, Debug, PartialEq)]
pub struct TreeLog {
    nodes: usize,
    /// Weight of the rays that hit the primitive at each place of [`BinaryTree::prims`].
    prim_hits: Vec<f32>,
    /// What each ray weighs.
    weights: Vec<f32>,
    /// Nodes that they entered, see [`Met::nodes`].
    met: NodeLists,
    /// Logs of objects: every ray counts once for each instance of the object that it enters.
    pub(crate) objects: Vec<TreeLog>,
}

/// Bounds of a task, shared by the trees that its rays go through.
struct Budget<'a> {
    /// Bytes that may still be written.
    left: Cell<usize>,
    /// Nodes entered since the last query of the monitor.
    unheard: Cell<usize>,
    monitor: &'a dyn BuildMonitor,
}

/// Nodes that some rays entered in one binary tree, and primitives that they hit.
struct Met<'a> {
    budget: &'a Budget<'a>,
    /// Nodes that each ray entered. [`Met::HIT`] marks leaves of which a primitive was hit. Rays that cannot hit anything
    /// are left out.
    nodes: NodeLists,
    /// The primitives and instances hit, by their places in [`BinaryTree::prims`].
    prims: Vec<u32>,
    /// Nodes that the current ray has entered so far.
    current: Vec<u32>,
    /// Length of `prims` before the current ray.
    before: usize,
}

impl<'a> Met<'a> {
    /// Leaves are at most 2³⁰, so node indices leave this bit free.
    const HIT: u32 = NodeLists::MARK;

    fn new(budget: &'a Budget<'a>) -> Self {
        Self {
            budget,
            nodes: NodeLists::default(),
            prims: Vec::new(),
            current: Vec::new(),
            before: 0,
        }
    }
}

impl Witness for Met<'_> {
    /// Refuses every ray once one did not fit, or the build is cancelled.
    #[inline(always)]
    fn begin(&mut self, _ray: &RaySetup) -> bool {
        let Budget {
            left,
            unheard,
            monitor,
        } = self.budget;
        self.current.clear();
        self.before = self.prims.len();
        if unheard.get() >= NODES_PER_QUESTION {
            unheard.set(0);
            if monitor.cancelled() {
                left.set(0);
            }
        }
        left.get() > 0
    }

    #[inline(always)]
    fn node(&mut self, node: u32) {
        self.current.push(node);
    }

    /// Not if it cannot be kept.
    #[inline(always)]
    fn goes_on(&self) -> bool {
        self.current.len() <= self.budget.left.get() / NODE_BYTES
    }

    #[inline(always)]
    fn hits(&mut self, _ray: &RaySetup, hits: LeafHits<'_>) {
        if self.prims.len() - self.before > self.budget.left.get() / HIT_BYTES {
            return;
        }
        if let Some(leaf) = self.current.last_mut() {
            *leaf |= Self::HIT;
        }
        let first = hits.first;
        for lane in hits {
            self.prims.push(first + lane as u32);
        }
    }

    /// Keeps the ray if there is room for it.
    #[inline(always)]
    fn end(&mut self) {
        let prims = HIT_BYTES * (self.prims.len() - self.before);
        let Budget { left, unheard, .. } = self.budget;
        unheard.set(unheard.get() + self.current.len());
        match (left.get()).checked_sub(RAY_BYTES + NODE_BYTES * self.current.len() + prims) {
            Some(_) => {
                let nodes = self.nodes.push(&self.current);
                left.set(left.get().saturating_sub(RAY_BYTES + nodes + prims));
            }
            None => {
                left.set(0);
                self.prims.truncate(self.before);
            }
        }
    }
}

/// Sums over the rays of a [`TreeLog`], per binary node.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct NodeCounts {
    /// `N`: weight of the rays that hit the box.
    pub entered: Vec<f32>,
    /// `L`: weight of those that hit a primitive below.
    pub hits: Vec<f32>,
}

impl TreeLog {
    /// An empty log for this tree.
    pub fn new(tree: &BinaryTree) -> Self {
        Self {
            nodes: tree.nodes.len(),
            prim_hits: vec![0.0; tree.prims.len()],
            weights: Vec::new(),
            met: NodeLists::default(),
            objects: tree.objects.iter().map(Self::new).collect(),
        }
    }

    /// What `count` [`surface_rays`](crate::parts::surface_rays) hit, each of weight 1: the default log of a scene whose
    /// rays are not known yet. `None` is the number that suits its size: their cost stays in proportion to the cost of
    /// the build, and on five scenes 1000 rays give nearly the visits that 4000 do, 256 up to 25 % more.
    pub fn of_surfaces(primitives: &Primitives, tree: &BinaryTree, count: Option<usize>) -> Self {
        Self::of_surfaces_until(primitives, tree, count, &())
    }

    /// [`TreeLog::of_surfaces`], of fewer rays if the monitor stops it.
    pub(crate) fn of_surfaces_until(
        primitives: &Primitives,
        tree: &BinaryTree,
        count: Option<usize>,
        monitor: &dyn BuildMonitor,
    ) -> Self {
        /// Any seed does; results must not depend on when or where they are computed.
        const SEED: u64 = 2016;
        let count = count.unwrap_or(default_count(primitives));
        let mut log = Self::new(tree);
        let Some(root) = tree.nodes.first() else {
            return log;
        };
        let rays = surface_rays_within(primitives, &root.bounds, count, SEED);
        log.add_until(primitives, tree, (&rays, 0), count as f32, monitor);
        log
    }

    /// Weight of `rays`, the rays that a tree is made for, in a log of [surface rays](Self::of_surfaces) or in an empty
    /// log. Each weighs as much as a surface ray, but together at least as much as all surface rays, which keep what
    /// `rays` do not visit from being forgotten. With half of the weight for surface rays, shadow rays test up to 4 %
    /// more nodes (sibenik) when 64 thousand rays were learned from, up to 12 % (bathroom) when it was 16 thousand.
    /// With a tenth or a fiftieth the count is the same to 2 %.
    pub fn weight_for(&self, rays: &[Ray]) -> f32 {
        self.weight().max(rays.len() as f32)
    }

    /// Follows `rays` through the tree. Together they count as `weight` rays, which is how kinds of rays
    /// are blended: give each the weight of its share. Rays that cannot hit anything (see [`Ray`]) are
    /// left out.
    ///
    /// Memory bounds the time as well, since every node that a ray enters takes 2 bytes and every hit 4. A call takes at most
    /// 256 KiB, 2 bytes per node and primitive of all trees, 64 per instance, and 2 KiB per ray. [Surface
    /// rays](Self::of_surfaces) have no bytes of their own: in ordinary scenes they take a third of the others. However many
    /// rays there are, a call takes at most 32 MiB and 12 bytes per node, primitive and instance, the whole log at most
    /// 48 MiB and 16 bytes. Every task gets an equal part of what a call may take. The first ray that does not fit ends its
    /// task, and the rays that are kept share the weight.
    ///
    /// Uses the rayon pool that is current, if the `parallel` feature is on; the log does not depend on
    /// the number of threads.
    ///
    /// # Panics
    /// If the log was made for another tree, the tree was built over other primitives, or the weight is negative or not
    /// finite.
    pub fn add(&mut self, primitives: &Primitives, tree: &BinaryTree, rays: &[Ray], weight: f32) {
        self.add_until(primitives, tree, (rays, rays.len()), weight, &());
    }

    /// [`TreeLog::add`] of rays, so many of which were given. Of fewer rays if the monitor stops it.
    pub(crate) fn add_until(
        &mut self,
        primitives: &Primitives,
        tree: &BinaryTree,
        (rays, given): (&[Ray], usize),
        weight: f32,
        monitor: &dyn BuildMonitor,
    ) {
        assert!(
            weight >= 0.0 && weight.is_finite(),
            "a weight of {weight} rays"
        );
        tree.assert_is_of(primitives);
        self.assert_fits(tree);
        if tree.nodes.is_empty() {
            return;
        }
        let isa = Isa::best();
        let (left, ray) = self.left(primitives, tree, given);
        let chunk = CHUNK.max(rays.len().div_ceil(MAX_TASKS.min(left / ray).max(1)));
        let tasks = rays.len().div_ceil(chunk);
        let share = left / tasks.max(1);
        let chunks = parallel::map(tasks, 1, |task| {
            let budget = Budget {
                left: Cell::new(share),
                unheard: Cell::new(NODES_PER_QUESTION),
                monitor,
            };
            let mut world = Met::new(&budget);
            let mut objects: Vec<_> = tree.objects.iter().map(|_| Met::new(&budget)).collect();
            isa.dispatch(Exhaustive {
                primitives,
                tree,
                rays: &rays[task * chunk..rays.len().min((task + 1) * chunk)],
                world: &mut world,
                objects: &mut objects,
            });
            let lists = |met: Met| (met.nodes, met.prims);
            let objects: Vec<_> = objects.into_iter().map(lists).collect();
            (lists(world), objects)
        });
        let traced: usize = chunks.iter().map(|((nodes, _), _)| nodes.len()).sum();
        let weight = weight / traced.max(1) as f32;
        let worlds = chunks.iter().map(|((nodes, _), _)| nodes);
        self.met.reserve(worlds);
        for (index, log) in self.objects.iter_mut().enumerate() {
            log.met
                .reserve(chunks.iter().map(|(_, objects)| &objects[index].0));
        }
        for (world, objects) in chunks {
            self.append(world, weight);
            for (log, met) in self.objects.iter_mut().zip(objects) {
                log.append(met, weight);
            }
        }
    }

    /// Adds the nodes that some rays, each of this weight, entered in this tree, and the primitives that they hit.
    fn append(&mut self, (nodes, prims): (NodeLists, Vec<u32>), weight: f32) {
        self.weights
            .extend(core::iter::repeat_n(weight, nodes.len()));
        self.met.append(&nodes);
        for place in prims {
            self.prim_hits[place as usize] += weight;
        }
    }

    /// Bytes that a call of [`TreeLog::add`] may take, if so many rays were given, and that one ray takes at the worst, but
    /// for coincident primitives.
    fn left(&self, primitives: &Primitives, tree: &BinaryTree, given: usize) -> (usize, usize) {
        let items = |tree: &BinaryTree| tree.nodes.len() + tree.prims.len();
        let items = items(tree) + tree.objects.iter().map(items).sum::<usize>();
        let [all, call] = [0, 1].map(|index| FREE_BYTES[index] + BYTES_PER_ITEM[index] * items);
        let bytes = |log: &Self| RAY_BYTES * log.weights.len() + log.met.bytes();
        let taken = bytes(self) + self.objects.iter().map(bytes).sum::<usize>();
        let [least, per_item, per_given] = FAIR_BYTES;
        let entered = INSTANCE_ITEMS * primitives.instances.len();
        let fair = least + per_item * (items + entered) + per_given * given;
        let left = fair.min(call).min(all.saturating_sub(taken));
        (left, items * 2 / 3 + 1)
    }

    /// Rays logged so far, without those that cannot hit anything.
    pub fn rays(&self) -> usize {
        self.weights.len()
    }

    /// Number of rays that the log counts as: the sum of their weights.
    pub fn weight(&self) -> f32 {
        self.weights.iter().sum()
    }

    /// Fails unless the log was made for this tree.
    pub(crate) fn assert_fits(&self, tree: &BinaryTree) {
        assert_eq!(
            (self.nodes, self.prim_hits.len()),
            (tree.nodes.len(), tree.prims.len()),
            "nodes and primitives of the log and of the tree"
        );
        assert_eq!(self.objects.len(), tree.objects.len(), "objects");
        for (log, tree) in self.objects.iter().zip(&tree.objects) {
            log.assert_fits(tree);
        }
    }

    /// Weight of the rays that hit the primitive at each place of [`BinaryTree::prims`].
    pub(crate) fn prim_hits(&self) -> &[f32] {
        &self.prim_hits
    }

    /// `N` and `L` of every node: weights of the rays that hit its box, and of the rays that hit a primitive below.
    pub(crate) fn counts(&self, tree: &BinaryTree) -> NodeCounts {
        let ends = subtree_ends(tree);
        let (entered, hits) = parallel::join(
            || {
                let mut entered = vec![0.0; self.nodes];
                self.for_each_ray(|weight, nodes| {
                    for entry in nodes {
                        entered[(entry & !Met::HIT) as usize] += weight;
                    }
                });
                entered
            },
            || {
                let mut hits = vec![0.0; self.nodes];
                self.for_each_ray(|weight, nodes| {
                    // Depth-first order: what is below a node follows it. The nearest hit leaf at or after it
                    // says whether any is below.
                    let mut nearest = u32::MAX;
                    for &entry in nodes.iter().rev() {
                        let node = entry & !Met::HIT;
                        if entry != node {
                            nearest = node;
                        }
                        let hit = nearest < ends[node as usize];
                        hits[node as usize] += if hit { weight } else { 0.0 };
                    }
                });
                hits
            },
        );
        NodeCounts { entered, hits }
    }

    /// Weight of the rays that visit each node when every ray stops at the first leaf that occludes it,
    /// leaves being visited by ascending `rank`. A node's rank is the least of the leaves below it.
    pub(crate) fn visits(&self, rank: &[u32]) -> Vec<f32> {
        let mut visits = vec![0.0; self.nodes];
        self.for_each_ray(|weight, nodes| {
            let last = nodes
                .iter()
                .filter(|entry| **entry & Met::HIT != 0)
                .map(|entry| rank[(entry & !Met::HIT) as usize])
                .min()
                .unwrap_or(u32::MAX);
            for entry in nodes {
                let node = (entry & !Met::HIT) as usize;
                visits[node] += if rank[node] <= last { weight } else { 0.0 };
            }
        });
        visits
    }

    fn for_each_ray(&self, mut f: impl FnMut(f32, &[u32])) {
        let mut ray = 0;
        self.met.for_each(|nodes| {
            f(self.weights[ray], nodes);
            ray += 1;
        });
    }
}

/// Per node, the index after the last node below it.
fn subtree_ends(tree: &BinaryTree) -> Vec<u32> {
    let mut ends = vec![0; tree.nodes.len()];
    for (index, node) in tree.nodes.iter().enumerate().rev() {
        ends[index] = match node.kind {
            BinaryKind::Inner { right } => ends[index + right as usize],
            BinaryKind::Leaf { .. } => index as u32 + 1,
        };
    }
    ends
}

#[cfg(test)]
mod tests {
    use alloc::format;

    use super::*;
    use crate::Recipe;
    use crate::builder::Builder;
    use crate::geometry::slab_test::hits_box;
    use crate::geometry::test_primitives::primitives;
    use crate::geometry::{Geometry, Instance, QueryKind};
    use crate::learn::LogKind;
    use crate::parts::Steps;
    use antumbra_testkit::{Rng, mesh, rays};

    fn kernel_rays(rng: &mut Rng, mesh: &mesh::Mesh, count: usize) -> Vec<Ray> {
        rays::around(rng, mesh, count)
            .iter()
            .map(|ray| Ray {
                org: ray.org,
                dir: ray.dir,
                tnear: ray.tnear,
                tfar: ray.tfar,
            })
            .collect()
    }

    /// The places of the primitives below a node.
    fn places(tree: &BinaryTree, node: usize) -> Vec<usize> {
        match tree.nodes[node].kind {
            BinaryKind::Leaf { first, count } => {
                (first as usize..(first + count) as usize).collect()
            }
            BinaryKind::Inner { .. } => {
                let [left, right] = tree.children(node).expect("an inner node");
                [places(tree, left), places(tree, right)].concat()
            }
        }
    }

    /// The log against every ray with every box and every primitive, on every kind of geometry.
    #[test]
    fn counts_are_those_of_brute_force() {
        let seed = 31;
        let mut rng = Rng::new(seed);
        for generate in mesh::ALL {
            let mesh = generate(&mut rng, 150);
            let primitives = primitives(&mesh, 20, &mut rng);
            let tree = BinaryTree::build(&primitives, Builder::default());
            let rays = kernel_rays(&mut rng, &mesh, 200);
            let reach = primitives.bounds().reach();
            let setups: Vec<_> = rays
                .iter()
                .filter_map(|ray| RaySetup::new(ray, reach))
                .collect();
            let hits_prim = |setup: &RaySetup, place: usize| {
                let prim = tree.prims[place] as usize;
                primitives.hit(prim, setup, QueryKind::Occluded).is_some()
            };

            let mut log = TreeLog::new(&tree);
            // Weights that are whole numbers of rays are added up exactly.
            log.add(&primitives, &tree, &rays, 2.0 * setups.len() as f32);
            let counts = log.counts(&tree);
            if !tree.nodes.is_empty() {
                assert_eq!(log.rays(), setups.len());
            }
            let count = |f: &dyn Fn(&RaySetup) -> bool| {
                2.0 * setups.iter().filter(|setup| f(setup)).count() as f32
            };
            let place = |what: &str| format!("seed {seed} {}: {what}", mesh.name);
            for node in 0..tree.nodes.len() {
                let bounds = &tree.nodes[node].bounds;
                let below = places(&tree, node);
                let entered = count(&|setup| node == 0 || hits_box(setup, bounds));
                assert_eq!(
                    counts.entered[node],
                    entered,
                    "{}",
                    place(&format!("N of {node}"))
                );
                let hits = count(&|setup| below.iter().any(|&prim| hits_prim(setup, prim)));
                assert_eq!(
                    counts.hits[node],
                    hits,
                    "{}",
                    place(&format!("L of {node}"))
                );
            }
            for prim in 0..tree.prims.len() {
                let hits = count(&|setup| hits_prim(setup, prim));
                assert_eq!(
                    log.prim_hits()[prim],
                    hits,
                    "{}",
                    place(&format!("place {prim}"))
                );
            }
        }
    }

    /// The same on two levels: an object has the rays of all its instances, each as it enters them, and an
    /// instance is hit by those that hit something in it.
    #[test]
    fn counts_of_instances_are_those_of_brute_force() {
        let seed = 33;
        let mut rng = Rng::new(seed);
        let mesh = mesh::soup(&mut rng, 60);
        let world = mesh::bumpy_grid(&mut rng, 50);
        let geometries = [&mesh, &world]
            .map(|mesh| [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])]);
        let instances: Vec<_> = (0..25)
            .map(|_| {
                Instance::new(
                    0,
                    core::array::from_fn(|_| core::array::from_fn(|_| rng.range(-1.0, 1.0))),
                )
            })
            .collect();
        let [object, world_geometry] = geometries;
        let primitives = Primitives::with_instances(&world_geometry, &[object], &instances)
            .expect("indices in range");
        let tree = BinaryTree::build(&primitives, Builder::default());
        let rays = kernel_rays(&mut rng, &world, 150);
        let mut log = TreeLog::new(&tree);
        let reach = primitives.bounds().reach();
        let setups: Vec<_> = rays
            .iter()
            .filter_map(|ray| RaySetup::new(ray, reach))
            .collect();
        log.add(&primitives, &tree, &rays, setups.len() as f32);
        let counts = log.counts(&tree);

        // What enters each instance: the rays in the object.
        let object = &primitives.objects[0];
        let mut entered_all = Vec::new();
        for (index, node) in tree.nodes.iter().enumerate() {
            let BinaryKind::Leaf { first, .. } = node.kind else {
                continue;
            };
            let Some(placed) = primitives.instance(tree.prims[first as usize] as usize) else {
                continue;
            };
            let reached = setups.iter().filter(|setup| hits_box(setup, &node.bounds));
            let entered: Vec<_> = reached
                .filter_map(|setup| {
                    let mut inside = RaySetup::IDLE;
                    placed
                        .placement
                        .enter(antumbra_simd::Scalar, setup, &mut inside)?;
                    Some(inside)
                })
                .collect();
            let hits = entered.iter().filter(|setup| {
                let mut triangles = object.triangles.iter();
                triangles.any(|corners| crate::geometry::triangle::hit(corners, setup).is_some())
            });
            assert_eq!(
                counts.hits[index],
                hits.count() as f32,
                "seed {seed} L {index}"
            );
            entered_all.extend(entered);
        }
        assert!(entered_all.len() > 100, "{}", entered_all.len());

        let (log, tree) = (&log.objects[0], &tree.objects[0]);
        assert_eq!(log.rays(), entered_all.len());
        let counts = log.counts(tree);
        for node in 0..tree.nodes.len() {
            let bounds = &tree.nodes[node].bounds;
            let enter = entered_all
                .iter()
                .filter(|setup| node == 0 || hits_box(setup, bounds));
            assert_eq!(counts.entered[node], enter.count() as f32, "N of {node}");
            let below = places(tree, node);
            let hit = entered_all.iter().filter(|setup| {
                below.iter().any(|&place| {
                    let corners = &object.triangles[tree.prims[place] as usize];
                    crate::geometry::triangle::hit(corners, setup).is_some()
                })
            });
            assert_eq!(counts.hits[node], hit.count() as f32, "L of {node}");
        }
    }

    /// A log in two parts is the log of the whole; the weight of a part is spread over its rays.
    #[test]
    fn parts_add_up() {
        let mut rng = Rng::new(32);
        let mesh = mesh::soup(&mut rng, 500);
        let geometry = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
        let primitives = Primitives::new(&geometry).expect("indices in range");
        let tree = BinaryTree::build(&primitives, Builder::default());
        let rays: Vec<_> = (0..300)
            .map(|_| Ray::new(rng.point(1.0), rng.direction()))
            .collect();
        let mut whole = TreeLog::new(&tree);
        whole.add(&primitives, &tree, &rays, 300.0);
        let mut parts = TreeLog::new(&tree);
        parts.add(&primitives, &tree, &rays[..100], 100.0);
        parts.add(&primitives, &tree, &[], 50.0);
        parts.add(&primitives, &tree, &rays[100..], 200.0);
        assert_eq!(parts, whole);
        assert_eq!(whole.weight(), 300.0);

        let mut blend = TreeLog::new(&tree);
        blend.add(&primitives, &tree, &rays[..100], 64.0);
        blend.add(&primitives, &tree, &rays[100..], 64.0);
        assert!((blend.weight() - 128.0).abs() < 1e-3);
        assert!((blend.counts(&tree).entered[0] - 128.0).abs() < 1e-3);
    }

    /// Every ray through a soup comes to a good part of all nodes. So few of them are followed that the nodes that they
    /// enter are in proportion to the primitives. Of a surface nothing is left out.
    #[test]
    fn learning_from_a_soup_is_bounded() {
        let mut rng = Rng::new(33);
        let soup: Vec<_> = (0..8000)
            .map(|_| [(); 3].map(|()| rng.point(1.0)))
            .collect();
        let soup = (
            soup.concat(),
            (0..8000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        );
        let grid = mesh::bumpy_grid(&mut rng, 8000);
        let grid: (Vec<_>, Vec<_>) = (grid.positions, grid.indices);
        for (name, (positions, indices), is_bounded) in
            [("soup", soup, true), ("grid", grid, false)]
        {
            let geometry = [Geometry::triangles(&positions[..], &indices[..])];
            let primitives = Primitives::new(&geometry).expect("indices in range");
            let stage = crate::Build::new(&primitives).stage().expect("a stage");
            let tree = stage.tree();
            let rays = default_count(&primitives);
            let log = TreeLog::of_surfaces(&primitives, tree, None);
            let items = tree.nodes.len() + tree.prims.len();
            let bytes = log.met.bytes()
                + HIT_BYTES * log.prim_hits.iter().filter(|hits| **hits > 0.0).count();
            assert!(bytes < (256 << 10) + 2 * items, "{name}: {bytes} bytes");
            assert_eq!(
                log.rays() < rays,
                is_bounded,
                "{name}: {} of {rays}",
                log.rays()
            );
            assert!(
                log.rays() > 8 && (log.weight() - rays as f32).abs() < 0.1,
                "{name}"
            );

            let bvh = stage.learn(&[], &Recipe::default(), &()).expect("a tree");
            let learned = bvh.report().training_rays;
            assert_eq!(
                learned < rays as u64,
                is_bounded,
                "{name}: {learned} of {rays}"
            );
            let surface = surface_rays_within(&primitives, &primitives.bounds(), rays, 7);
            let kind = LogKind {
                boxes: true,
                shuffled: true,
                masks: true,
            };
            let log = bvh.log_until((&surface, 0), kind, 1, &());
            let visits = log.masks().map_or(0, |masks| masks.visits().len());
            // What is tested before it is known that it was too much: the rays logged at once.
            let most = (16 << 10) + primitives.len() / 2 + 8 * bvh.report().nodes;
            assert!(visits < most, "{name}: {visits} of {most}");
            let all = bvh.log_of(&surface, kind, 1);
            assert_eq!(
                all.rays(),
                rays as u64,
                "{name}: given rays have budgets of their own"
            );
        }
    }

    /// Rays through coincident triangles enter all leaves. The log keeps as many rays as it has room for, however many
    /// threads there are, and the rays that it keeps have the weight of all.
    #[test]
    fn logs_of_coincident_triangles_are_bounded() {
        let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0_f32]];
        let indices = vec![[0, 1, 2_u32]; 40_000];
        let geometry = [Geometry::triangles(&positions[..], &indices[..])];
        let primitives = Primitives::new(&geometry).expect("indices in range");
        let tree = BinaryTree::build(&primitives, Builder::BinnedSah);
        let ray = |index: usize| Ray::new([0.1, 0.1, 1.0 + index as f32], [0.0, 0.0, -1.0]);
        let rays: Vec<_> = (0..2000).map(ray).collect();
        let mut log = TreeLog::new(&tree);
        let (room, _) = log.left(&primitives, &tree, rays.len());
        log.add(&primitives, &tree, &rays, 2000.0);
        let kept = log.rays();
        assert!((16..1000).contains(&kept), "{kept} rays");
        assert!((log.weight() - 2000.0).abs() < 1.0, "{}", log.weight());
        assert!(log.met.bytes() + 4 * indices.len() * kept < room + (1 << 20));
        let counts = log.counts(&tree);
        assert!((counts.entered[0] - 2000.0).abs() < 1.0);
        assert!((counts.hits[0] - 2000.0).abs() < 1.0);
        assert!((log.prim_hits()[0] - 2000.0).abs() < 1.0);
        // Many calls do not pass the limit of the whole log.
        for _ in 0..4 {
            log.add(&primitives, &tree, &rays, 2000.0);
        }
        assert!(log.met.bytes() < FREE_BYTES[0] + BYTES_PER_ITEM[0] * 100_000);
    }
}
