//! From the binary tree to N children per node: which nodes stay, in which order they are visited, where they are in
//! memory.

mod area;
mod cheapest;
pub(crate) mod layout;
pub(crate) mod skeleton;
mod split_leaves;

use alloc::borrow::Cow;
use alloc::boxed::Box;
use alloc::vec::Vec;

use crate::aabb::Aabb;
use crate::collapse::area::AreaCollapse;
use crate::collapse::cheapest::CheapestCollapse;
use crate::collapse::layout::Part;
use crate::collapse::skeleton::{Contraction, Skeleton, Sorting};
use crate::collapse::split_leaves::SplitLeaves;
use crate::geometry::primitives::Primitives;
use crate::learn::tree_log::TreeLog;
use crate::monitor::{BuildMonitor, goes_on};
use crate::parallel;
use crate::tree::binary::{BinaryKind, BinaryTree};
use crate::tree::costs::CostModel;
use crate::tree::wide::Tree;
use crate::tree::width::Width;
use antumbra_simd::{Row, named_list};

/// Weight of the area prior, as a share of the rays in the log: what no ray visited is collapsed by area, and an open
/// scene does not fit only the sampled rays. Anything from 0.01 to 1 gives the same visits within 1 % on four scenes;
/// 0.5 does best for rays of another kind than the training rays.
const AREA_PRIOR: f32 = 0.5;

named_list! {
    /// How the binary tree is made wide: which of its nodes become nodes of the wide tree.
    ///
    /// ```
    /// use antumbra::recipe::Collapse;
    ///
    /// assert_eq!("area".parse(), Ok(Collapse::Area));
    /// assert!(Collapse::Learned.needs_log());
    /// ```
    #[derive(Default)]
    pub enum Collapse("collapse"): Properties, open Contract {
        Area = "area",
            "Children of large area are opened first",
            Some("Wald, Benthin and Boulos 2008"), Properties { needs_log: false };
        Sah = "sah",
            "The combination of least surface area, by dynamic programming",
            Some("Ylitie, Karras and Laine 2017"), Properties { needs_log: false };
        #[default]
        Learned = "learned",
            "The combination that costs training rays least, and leaf splitting",
            None, Properties { needs_log: true };
    }
}

/// Columns of the table of collapses.
pub(crate) struct Properties {
    needs_log: bool,
}

impl Properties {
    fn of(_: &dyn Contract) -> Self {
        Self { needs_log: true }
    }
}

impl Collapse {
    /// Whether it learns from training rays.
    pub fn needs_log(self) -> bool {
        self.properties().needs_log
    }

    /// Whether it puts children and primitives in a learned order, if a [`Learning`] wants that.
    pub(crate) fn sorts(self) -> bool {
        match self {
            Self::Other(other) => other.sorts(),
            _ => true,
        }
    }
}

/// A collapse of your own, for [`Collapse::Other`]. It learns from a training log of the binary tree.
pub trait Contract: Row {
    /// Whether children and primitives are put in a learned order, too.
    fn sorts(&self) -> bool {
        true
    }

    /// What decides which binary nodes stay; `None` for the nodes of [`Collapse::Learned`].
    fn contraction(&self) -> Option<Contractor>;
}

/// Makes a contraction of a binary tree to nodes of so many children, for training rays that visit each of its inner nodes so
/// often, were it a node of the wide tree: finite and not negative. Leaves have a number, too, of no meaning.
pub type Contractor = fn(&BinaryTree, &[f32], usize) -> Box<dyn Contraction>;

/// What a collapse takes from a training log: the nodes that stay, the leaves that are split, and the order of children.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Learning {
    /// Which binary nodes stay.
    pub collapse: Collapse,
    /// Whether children and primitives are put in the learned order; if not, they stay in the depth-first
    /// order of the binary tree.
    pub sort: bool,
    /// The costs that are minimised.
    pub model: CostModel,
    /// Whether the learned collapse is searched for from two starts, which takes about three times as long as from one.
    /// The search pays for rays that are known, where many more will follow.
    pub thorough: bool,
}

impl Default for Learning {
    /// All that can be learned, with one start.
    fn default() -> Self {
        Self {
            collapse: Collapse::default(),
            sort: true,
            model: CostModel::default(),
            thorough: false,
        }
    }
}

/// Collapses by area; slots in the depth-first order of the binary tree.
pub(crate) fn by_area(primitives: &Primitives, tree: &BinaryTree, width: Width) -> Tree {
    if tree.nodes.is_empty() {
        return Tree::empty(width);
    }
    let top = Part {
        primitives,
        tree: Cow::Borrowed(tree),
        skeleton: Skeleton::new(tree, &AreaCollapse, width.lanes()),
        prim_hits: None,
    };
    let objects = parallel::map(tree.objects.len(), 1, |object| {
        let tree = &tree.objects[object];
        (!tree.nodes.is_empty()).then(|| Part {
            primitives: &primitives.objects[object],
            tree: Cow::Borrowed(tree),
            skeleton: Skeleton::new(tree, &AreaCollapse, width.lanes()),
            prim_hits: None,
        })
    });
    layout::lay_out(&top, &objects, width)
}

/// Collapses by what is in a log of this tree. Returns the cost that equation (1) predicts, too. `None` if the monitor stops
/// it.
pub(crate) fn by_log(
    primitives: &Primitives,
    tree: &BinaryTree,
    log: &TreeLog,
    learning: &Learning,
    width: Width,
    monitor: &dyn BuildMonitor,
) -> Option<(Tree, f64)> {
    if tree.nodes.is_empty() {
        return Some((Tree::empty(width), f64::from(learning.model.node)));
    }
    let learning = &Learning {
        sort: learning.sort && learning.collapse.sorts(),
        ..*learning
    };
    // Objects first: what they cost is part of the cost of their instances.
    let learned = parallel::map(tree.objects.len(), 1, |object| {
        let (tree, log) = (&tree.objects[object], &log.objects[object]);
        if tree.nodes.is_empty() {
            return Some((None, 0.0));
        }
        let primitives = &primitives.objects[object];
        let (part, cost) = part(
            primitives,
            (tree, log),
            learning,
            &[],
            width.lanes(),
            monitor,
        )?;
        Some((Some(part), cost))
    });
    let learned = learned.into_iter().collect::<Option<Vec<_>>>()?;
    let (objects, costs): (Vec<_>, Vec<_>) = learned.into_iter().unzip();
    let (top, cost) = part(
        primitives,
        (tree, log),
        learning,
        &costs,
        width.lanes(),
        monitor,
    )?;
    goes_on(monitor)?;
    Some((layout::lay_out(&top, &objects, width), cost))
}

/// What is learned of a tree of at least one node, and the cost predicted. `objects` are the costs predicted for
/// those that its instances place.
fn part<'a>(
    primitives: &'a Primitives,
    (tree, log): (&'a BinaryTree, &'a TreeLog),
    learning: &Learning,
    objects: &[f64],
    width: usize,
    monitor: &dyn BuildMonitor,
) -> Option<(Part<'a>, f64)> {
    let counts = &log.counts(tree);
    let sorting = Sorting {
        counts,
        primitives,
        objects,
        model: &learning.model,
        sort: learning.sort,
    };
    let rays = Rays::new(tree, log, width, monitor);
    let sorted = |collapse: &dyn Contraction| Skeleton::sorted(tree, collapse, width, sorting);
    let whole = |skeleton| Part {
        primitives,
        tree: Cow::Borrowed(tree),
        skeleton,
        prim_hits: learning.sort.then(|| Cow::Borrowed(log.prim_hits())),
    };
    let (skeleton, cost) = match learning.collapse {
        Collapse::Area => sorted(&AreaCollapse),
        Collapse::Sah => {
            let prior = AreaPrior::new(tree, 0.0);
            let areas: Vec<_> = (tree.nodes.iter())
                .map(|node| prior.of(&node.bounds))
                .collect();
            sorted(&CheapestCollapse::new(tree, &areas, width))
        }
        Collapse::Learned | Collapse::Other(_) => {
            if let Collapse::Other(other) = learning.collapse
                && let Some(contraction) = other.contraction()
            {
                let contract = |visits: &[f32]| contraction(tree, visits, width);
                let visits = rays.visits(&contract, sorting, false)?;
                let (skeleton, cost) = sorted(&*contract(&visits));
                return Some((whole(skeleton), cost));
            }
            let visits = rays.visits(&rays.cheapest(), sorting, learning.thorough)?;
            // Of a log without rays nothing can be learned that is worth memory.
            if log.weight() > 0.0 {
                return Some(opened(primitives, sorting, &rays, &visits));
            }
            sorted(&CheapestCollapse::new(tree, &visits, width))
        }
    };
    Some((whole(skeleton), cost))
}

/// The learned collapse for rays that visit nodes so often, leaves being opened where that pays.
fn opened<'a>(
    primitives: &'a Primitives,
    sorting: Sorting,
    rays: &Rays,
    visits: &[f32],
) -> (Part<'a>, f64) {
    let opened = SplitLeaves::new(primitives, rays.tree, |node| visits[node]);
    let visits: Vec<_> = (opened.origins.iter().zip(&opened.shares))
        .map(|(origin, share)| visits[*origin as usize] * share)
        .collect();
    let collapse = CheapestCollapse::new(&opened.tree, &visits, rays.width);
    let counts = &opened.counts(sorting.counts, rays.log);
    let sorting = Sorting { counts, ..sorting };
    let (skeleton, cost) = Skeleton::sorted(&opened.tree, &collapse, rays.width, sorting);
    let prim_hits = sorting.sort.then(|| opened.prim_hits(rays.log));
    let part = Part {
        primitives,
        tree: Cow::Owned(opened.tree),
        skeleton,
        prim_hits: prim_hits.map(Cow::Owned),
    };
    (part, cost)
}

/// The rays of a log, and those that are added by area.
struct Rays<'a> {
    tree: &'a BinaryTree,
    log: &'a TreeLog,
    prior: AreaPrior,
    /// Children per node of the trees that they visit.
    width: usize,
    monitor: &'a dyn BuildMonitor,
}

/// The contraction for rays that visit each binary node so often, see [`Contractor`].
type ForVisits<'a> = dyn Fn(&[f32]) -> Box<dyn Contraction> + 'a;

impl<'a> Rays<'a> {
    fn new(
        tree: &'a BinaryTree,
        log: &'a TreeLog,
        width: usize,
        monitor: &'a dyn BuildMonitor,
    ) -> Self {
        Self {
            tree,
            log,
            prior: AreaPrior::new(tree, log.weight()),
            width,
            monitor,
        }
    }

    /// The contraction of least cost.
    fn cheapest(&self) -> impl Fn(&[f32]) -> Box<dyn Contraction> {
        |visits| Box::new(CheapestCollapse::new(self.tree, visits, self.width))
    }

    /// How many of them visit each node. The visits depend on the order of children, and the order on the collapse. At
    /// first every ray is taken to visit what it hits, then what it would visit in the tree that this gives. Of the
    /// learned collapse the second round saves 1 to 7 % of the visits, a third nothing.
    ///
    /// The result depends on the start. A `thorough` search also starts with rays that visit only what occludes them,
    /// and keeps the result that costs the rays of the log less: on sponza, 8 wide, that saves up to 18 % of the node
    /// tests, elsewhere nothing to 2 %. Random starts promise more by the model than they keep (up to 4 % more node
    /// tests on sibenik).
    ///
    /// `None` if the monitor stops the search.
    fn visits(
        &self,
        contract: &ForVisits<'_>,
        sorting: Sorting,
        thorough: bool,
    ) -> Option<Vec<f32>> {
        goes_on(self.monitor)?;
        let from = |start: &[f32]| self.visits_if(contract, sorting, &self.with_prior(start));
        let first = from(&sorting.counts.entered).0;
        goes_on(self.monitor)?;
        if !thorough || self.log.weight() == 0.0 {
            return Some(first);
        }
        let second = from(&sorting.counts.hits).0;
        goes_on(self.monitor)?;
        let cost = |visits: &[f32]| self.visits_if(contract, sorting, visits).1;
        Some(if cost(&second) < cost(&first) {
            second
        } else {
            first
        })
    }

    /// How many of them visit each node in the tree for rays that visit nodes so often, and what the rays of the log
    /// cost there below the root.
    fn visits_if(
        &self,
        contract: &ForVisits<'_>,
        sorting: Sorting,
        visits: &[f32],
    ) -> (Vec<f32>, f64) {
        let sorted = Sorting {
            sort: true,
            ..sorting
        };
        let (skeleton, _) = Skeleton::sorted(self.tree, &*contract(visits), self.width, sorted);
        let visits = self.log.visits(&skeleton.ranks(self.tree));
        let cost = |binary: usize| {
            let once = match self.tree.nodes[binary].kind {
                BinaryKind::Inner { .. } => f64::from(sorting.model.node),
                BinaryKind::Leaf { first, count } => {
                    sorting.leaf_cost(self.tree.prims[first as usize], count)
                }
            };
            once * f64::from(visits[binary])
        };
        let children = skeleton.all_children().iter();
        let cost = children.map(|child| cost(child.binary as usize)).sum();
        (self.with_prior(&visits), cost)
    }

    fn with_prior(&self, visits: &[f32]) -> Vec<f32> {
        (visits.iter().zip(&self.tree.nodes))
            .map(|(visits, node)| visits + self.prior.of(&node.bounds))
            .collect()
    }
}

/// Rays that visit nodes by their area.
struct AreaPrior {
    /// Area of the root.
    area: f32,
    rays: f32,
}

impl AreaPrior {
    /// Prior for a log of this many rays. An empty log counts as one ray.
    fn new(tree: &BinaryTree, rays: f32) -> Self {
        Self {
            area: tree.nodes[0].bounds.half_area(),
            // An empty log is all prior.
            rays: if rays > 0.0 { rays * AREA_PRIOR } else { 1.0 },
        }
    }

    /// How many of them visit a node.
    fn of(&self, bounds: &Aabb) -> f32 {
        let share = bounds.half_area() / self.area;
        // 0 / 0 of a flat scene without area, ∞ / ∞ of one that overflows: no preference.
        self.rays * if share.is_finite() { share } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec;

    use super::*;
    use crate::builder::Builder;
    use crate::geometry::Geometry;
    use crate::parts::Steps;
    use crate::ray::Ray;
    use crate::recipe::Level;
    use crate::trace::engine::Engine;
    use crate::trace::observe::Cost;
    use crate::tree::width::Width;
    use crate::{Bvh, Isa};
    use antumbra_testkit::{Rng, mesh};

    fn scene(seed: u64) -> (Primitives, BinaryTree, Vec<Ray>) {
        let mut rng = Rng::new(seed);
        let mesh = mesh::soup(&mut rng, 3000);
        let geometry = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
        let primitives = Primitives::new(&geometry).expect("indices in range");
        let tree = BinaryTree::build(&primitives, Builder::default());
        let rays = (0..500)
            .map(|_| Ray::between(rng.point(1.2), rng.point(1.2)))
            .collect();
        (primitives, tree, rays)
    }

    /// The visits that the log counts for an order are the nodes that the rays of the log really test in
    /// the tree laid out in that order.
    #[test]
    fn visits_are_those_of_real_traversal() {
        let (primitives, tree, rays) = scene(51);
        let mut log = TreeLog::new(&tree);
        log.add(&primitives, &tree, &rays, rays.len() as f32);
        for collapse in Collapse::ALL {
            for sort in [false, true] {
                let learning = Learning {
                    collapse,
                    // As the callers of `part` do.
                    sort: sort && collapse.sorts(),
                    ..Default::default()
                };
                let (part, _) = part(&primitives, (&tree, &log), &learning, &[], 8, &())
                    .expect("nobody stops it");
                let (skeleton, own_tree) = (&part.skeleton, &part.tree);
                // Of the tree with its leaves opened, if they are.
                let mut own_log = TreeLog::new(own_tree);
                own_log.add(&primitives, own_tree, &rays, rays.len() as f32);
                let visits = own_log.visits(&skeleton.ranks(own_tree));
                let counted: f32 = skeleton
                    .nodes
                    .iter()
                    .map(|node| visits[node.binary as usize])
                    .sum();
                // Other levels may fuse operations and so enter a few more or fewer boxes.
                let isa = Isa::new(Level::Scalar).expect("on every CPU");
                let engine = Engine::new(isa, Width::W8).expect("plain code");
                let bvh = Bvh::collapse_logged(&primitives, &tree, &log, &learning, engine);
                let mut costs = vec![Cost::default(); rays.len()];
                bvh.occluded_batch_counted(&rays, &mut vec![false; rays.len()], &mut costs);
                let tested: u32 = costs.iter().map(|cost| cost.node_tests).sum();
                assert_eq!(counted, tested as f32, "{collapse} sorted {sort}");
            }
        }
    }

    /// What the rays of a log cost in the collapse found from two starts is never more than from one, and sometimes less.
    #[test]
    fn a_second_start_does_no_harm() {
        let mut better = 0;
        for seed in 54..60 {
            let (primitives, tree, rays) = scene(seed);
            let mut log = TreeLog::new(&tree);
            log.add(&primitives, &tree, &rays, rays.len() as f32);
            let learning = Learning::default();
            let sorting = Sorting {
                counts: &log.counts(&tree),
                primitives: &primitives,
                objects: &[],
                model: &learning.model,
                sort: true,
            };
            let rays = Rays::new(&tree, &log, 8, &());
            let [one, two] = [false, true].map(|thorough| {
                let visits = rays.visits(&rays.cheapest(), sorting, thorough);
                let visits = visits.expect("nobody stops it");
                rays.visits_if(&rays.cheapest(), sorting, &visits).1
            });
            assert!(two <= one, "seed {seed}: {two}, {one} with one start");
            better += usize::from(two < one);
            let [one_tree, two_tree] = [false, true].map(|thorough| {
                let learning = Learning {
                    thorough,
                    ..learning
                };
                let (part, _) = part(&primitives, (&tree, &log), &learning, &[], 8, &())
                    .expect("nobody stops it");
                let nodes = part.skeleton.nodes.iter();
                nodes.map(|node| node.binary).collect::<Vec<_>>()
            });
            assert_eq!(one_tree != two_tree, two < one, "seed {seed}");
        }
        assert!(better > 0);
    }

    /// Without rays only areas are left: the collapse of least surface area.
    #[test]
    fn an_empty_log_gives_the_least_area() {
        let (primitives, tree, _) = scene(52);
        let log = TreeLog::new(&tree);
        let area = |skeleton: &Skeleton| -> f64 {
            let area = |node: usize| f64::from(tree.nodes[node].bounds.half_area());
            skeleton
                .nodes
                .iter()
                .map(|node| area(node.binary as usize))
                .sum()
        };
        let learning = Learning::default();
        let (learned, _) =
            part(&primitives, (&tree, &log), &learning, &[], 8, &()).expect("nobody stops it");
        assert!(area(&learned.skeleton) <= area(&Skeleton::new(&tree, &AreaCollapse, 8)));
    }

    /// No collapse has less area than the one that is to have the least, whatever the log says.
    #[test]
    fn the_collapse_by_sah_has_the_least_area() {
        let (primitives, tree, rays) = scene(53);
        let mut log = TreeLog::new(&tree);
        log.add(&primitives, &tree, &rays, rays.len() as f32);
        let area = |collapse| -> f64 {
            let learning = Learning {
                collapse,
                ..Default::default()
            };
            let (part, _) =
                part(&primitives, (&tree, &log), &learning, &[], 8, &()).expect("nobody stops it");
            let nodes = part.skeleton.nodes.iter();
            let area = |node: usize| f64::from(part.tree.nodes[node].bounds.half_area());
            nodes.map(|node| area(node.binary as usize)).sum()
        };
        let least = area(Collapse::Sah);
        for collapse in Collapse::ALL
            .into_iter()
            .filter(|one| *one != Collapse::Sah)
        {
            assert!(least < 0.999 * area(collapse), "{collapse}");
        }
    }
}
