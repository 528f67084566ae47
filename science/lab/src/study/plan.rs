//! Work of a study: the list of its renderings and replays, in the order in which they are done.

use std::path::PathBuf;

use antumbra::recipe::{Builder, Collapse, CostModel, Order};
use antumbra::{Isa, Width};
use antumbra_scene::{Camera, Scene};
use antumbra_trees::ORDERS;

use super::kinds::{Kind, Part, Trained};
use super::log_size::LogSize;
use crate::{Caller, RaysFrom};

/// Everything that a study is to do.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The scenes, see [`subjects`](super::subjects).
    pub scenes: Vec<Subject>,
    /// Child orders.
    pub orders: Vec<Order>,
    /// Children per node.
    pub widths: Vec<Width>,
    /// Builders of the binary tree. The default builder, or else the first, is rendered by all orders.
    pub trees: Vec<Builder>,
    /// Collapses. The default collapse, or else the first, is rendered by all orders.
    pub collapses: Vec<Collapse>,
    /// Samples per pixel; `None` is the scene's own number.
    pub spp: Option<u32>,
    /// Whole pictures with each tree of the headline, rendered apart for their times. Batches of shadow rays are timed as
    /// often, but once at least.
    pub repeat: u32,
    /// Seed of all random values.
    pub seed: u64,
    /// Instruction set.
    pub isa: Isa,
    /// Rays of each kind that are replayed; 0 for none.
    pub replay: usize,
    /// Number of training rays.
    pub log_size: LogSize,
    /// Origin of the training rays of replays.
    pub rays_from: RaysFrom,
    /// Costs of traversal steps, by which trees are learned and ranked.
    pub costs: CostModel,
    /// Other costs of a primitive test. On pictures, the child orders of the base tree are learned by these as well.
    pub more_prim_costs: Vec<f32>,
    /// Bytes that the trees of one picture may take. Trees that find no room are compared on the same picture again.
    pub memory: u64,
    /// Directory of the journal, the report and the pictures, if they are kept.
    pub out: Option<PathBuf>,
    /// Whether a journal found there is forgotten.
    pub restart: bool,
    /// The program that runs the study.
    pub caller: Caller,
}

impl Default for Plan {
    /// All orders on the default tree, rendered once; no scenes, no replays, no files.
    fn default() -> Self {
        let isa = Isa::best();
        Self {
            scenes: Vec::new(),
            orders: ORDERS.to_vec(),
            widths: vec![Width::auto(isa.level())],
            trees: vec![Builder::default()],
            collapses: vec![Collapse::default()],
            spp: None,
            repeat: 0,
            seed: 0,
            isa,
            replay: 0,
            log_size: LogSize::default(),
            rays_from: RaysFrom::default(),
            costs: CostModel::default(),
            more_prim_costs: Vec::new(),
            memory: 2 << 30,
            out: None,
            restart: false,
            caller: Caller::default(),
        }
    }
}

/// A scene of a study.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Subject {
    /// The scene, with the camera of its pictures.
    pub scene: Scene,
    /// The scene's name as part of file names; no two scenes of a study share one.
    pub stem: String,
    /// The camera of the training rays of replays, unless it is the scene's.
    pub train: Option<Camera>,
}

/// A tree for shadow rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Combination {
    /// Children per node.
    pub width: Width,
    /// Builder of the binary tree.
    pub tree: Builder,
    /// Collapse that makes the tree wide.
    pub collapse: Collapse,
    /// Child order.
    pub order: Order,
    /// Cost of a primitive test to learn by; `None` is what the plan says.
    pub prim_cost: Option<f32>,
}

impl Combination {
    /// A tree that learns by the cost of a primitive test that the plan says.
    pub const fn new(width: Width, (tree, collapse): (Builder, Collapse), order: Order) -> Self {
        Self {
            width,
            tree,
            collapse,
            order,
            prim_cost: None,
        }
    }

    /// The trees of the paper, unsorted.
    pub fn of_the_paper(width: Width) -> Self {
        let tree = (Builder::BinnedSah, Collapse::Area);
        Self::new(width, tree, Order::Simple)
    }

    /// Defaults of renderings.
    pub fn default_of(width: Width) -> Self {
        let tree = (Builder::default(), Collapse::default());
        Self::new(width, tree, Order::default())
    }
}

/// A tree to be compared with others on a picture, or a whole picture to be rendered with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rendering {
    pub combination: Combination,
    /// 0 for the comparison; whole pictures are numbered from 1.
    pub round: u32,
}

/// Rays to be answered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Replay {
    pub part: Part,
    pub kind: Kind,
    pub trained: Trained,
    /// Rays to learn from; `None` is what the plan says.
    pub log_rays: Option<usize>,
    pub combination: Combination,
}

impl Combination {
    fn key(&self) -> String {
        let Self { width, tree, .. } = self;
        let (collapse, order) = (self.collapse, self.order);
        let prim_cost = self.prim_cost.map(|cost| format!(" C_p {cost}"));
        let prim_cost = prim_cost.unwrap_or_default();
        format!("w{width} {tree} {collapse} {order}{prim_cost}")
    }
}

impl Rendering {
    /// A name that no other piece of work of the same scene has.
    pub fn key(&self, subject: &Subject) -> String {
        let combination = self.combination.key();
        format!("{} render {combination} #{}", subject.stem, self.round)
    }
}

impl Replay {
    fn new(part: Part, kind: Kind, trained: Trained, combination: Combination) -> Self {
        Self {
            part,
            kind,
            trained,
            log_rays: None,
            combination,
        }
    }

    /// A name that no other piece of work of the same scene has.
    pub fn key(&self, subject: &Subject) -> String {
        let size = self.log_rays.map(|rays| format!(" {rays}"));
        format!(
            "{} replay {} {} {}{} {}",
            subject.stem,
            self.part.name(),
            self.kind.name(),
            self.trained.name(),
            size.unwrap_or_default(),
            self.combination.key()
        )
    }

    /// Whether both want the same binary tree and log.
    pub fn shares_tree(&self, other: &Self) -> bool {
        let needs = |replay: &Self| (replay.kind, replay.trained, replay.log_rays);
        needs(self) == needs(other) && self.combination.tree == other.combination.tree
    }

    /// Whether both want the same wide tree, if they share the binary one.
    pub fn shares_collapse(&self, other: &Self) -> bool {
        let needs = |replay: &Self| (replay.combination.collapse, replay.combination.width);
        needs(self) == needs(other)
    }
}

impl Plan {
    /// The order of the trees and collapses that are not rendered by all orders: the default if it was requested, or else
    /// the paper's.
    pub fn default_order(&self) -> Order {
        let preferred = [Order::default(), Order::SortPlus];
        let mut preferred = preferred.into_iter();
        let chosen = preferred.find(|order| self.orders.contains(order));
        let last = self.orders.last().copied();
        chosen.or(last).unwrap_or_default()
    }

    /// The tree and the collapse that are rendered by all orders: the default ones if they were
    /// requested, otherwise the first ones.
    pub fn base(&self) -> (Builder, Collapse) {
        (base_of(&self.trees), base_of(&self.collapses))
    }

    /// All trees with all collapses.
    fn trees_and_collapses(&self) -> impl Iterator<Item = (Builder, Collapse)> {
        let collapses = |&tree| self.collapses.iter().map(move |&collapse| (tree, collapse));
        self.trees.iter().flat_map(collapses)
    }

    /// The combinations that are compared on pictures with nodes of this width, those on the base tree first.
    pub fn rendered(&self, width: Width) -> Vec<Combination> {
        let base = self.base();
        let of = |tree, order| Combination::new(width, tree, order);
        let by_all_orders = self.orders.iter().map(|&order| of(base, order));
        let learned = || self.orders.iter().filter(|order| order.learns());
        let by_costs = self.more_prim_costs.iter().flat_map(|&cost| {
            learned().map(move |&order| Combination {
                prim_cost: Some(cost),
                ..of(base, order)
            })
        });
        let others = self.trees_and_collapses().filter(|pair| *pair != base);
        let by_default = others.map(|pair| of(pair, self.default_order()));
        let mut all: Vec<_> = by_all_orders.chain(by_costs).chain(by_default).collect();
        // What whole pictures gain is told against the unsorted trees of the paper.
        let paper = Combination::of_the_paper(width);
        let wanted = (self.trees.contains(&paper.tree))
            && self.collapses.contains(&paper.collapse)
            && self.orders.contains(&paper.order);
        if wanted && !all.contains(&paper) {
            all.push(paper);
        }
        all
    }

    /// The combinations that are compared on pictures, of all widths.
    pub fn compared(&self) -> Vec<Combination> {
        let widths = self.widths.iter();
        widths.flat_map(|&width| self.rendered(width)).collect()
    }

    /// The two combinations of a width whose whole pictures are rendered apart: the unsorted trees of the paper and the
    /// default, as far as they are requested, or else `simple` and the default order on the base tree.
    pub fn headline(&self, width: Width) -> Vec<Combination> {
        let all = self.rendered(width);
        let on_base = |order| Combination::new(width, self.base(), order);
        let (paper, default) = (
            Combination::of_the_paper(width),
            Combination::default_of(width),
        );
        let either = |wanted: Combination, other: Combination| {
            let found = [wanted, other].into_iter().find(|c| all.contains(c));
            found.or(all.first().copied())
        };
        let mut pair = Vec::new();
        pair.extend(either(paper, on_base(Order::Simple)));
        pair.extend(either(default, on_base(self.default_order())));
        pair.dedup();
        pair
    }

    /// The whole pictures of every scene. Combinations take turns, so that what disturbs the machine for a while
    /// disturbs all of them.
    pub fn renderings(&self) -> Vec<Rendering> {
        let mut all = Vec::new();
        for &width in &self.widths {
            for round in 1..=self.repeat {
                let turn = self.headline(width).into_iter();
                all.extend(turn.map(|combination| Rendering { combination, round }));
            }
        }
        all
    }

    /// The replays of a scene, those that share a tree one after the other. `log_rays` is what the log size
    /// means in it.
    pub fn replays(&self, subject: &Subject, log_rays: usize) -> Vec<Replay> {
        let mut all = Vec::new();
        if self.replay == 0 {
            return all;
        }
        let main = match (self.rays_from, &subject.train) {
            (RaysFrom::Surfaces, _) => Trained::Surfaces,
            (_, Some(_)) => Trained::TrainCamera,
            (_, None) => Trained::TestCamera,
        };
        for kind in Kind::ALL {
            for tree in self.trees_and_collapses() {
                for &width in &self.widths {
                    all.extend(self.orders.iter().map(|&order| {
                        let combination = Combination::new(width, tree, order);
                        Replay::new(Part::Techniques, kind, main, combination)
                    }));
                }
            }
            all.extend(self.log_sizes(kind, main, log_rays));
            all.extend(self.transfers(subject, kind, main));
        }
        all
    }

    /// The base tree and collapse, learned from fewer rays.
    fn log_sizes(&self, kind: Kind, trained: Trained, log_rays: usize) -> Vec<Replay> {
        let mut all = Vec::new();
        let sizes = (3..).map(|power| 1 << (2 * power));
        for size in sizes.take_while(|size| *size < log_rays) {
            for &width in &self.widths {
                let learning = self.orders.iter().filter(|o| o.log_kind().is_some());
                all.extend(learning.map(|&order| Replay {
                    log_rays: Some(size),
                    ..Replay::new(
                        Part::LogSize,
                        kind,
                        trained,
                        Combination::new(width, self.base(), order),
                    )
                }));
            }
        }
        all
    }

    /// The base tree with all collapses and the default order, learned from other rays.
    fn transfers(&self, subject: &Subject, kind: Kind, main: Trained) -> Vec<Replay> {
        let mut all = Vec::new();
        let (tree, _) = self.base();
        let camera = match subject.train {
            Some(_) => Trained::TrainCamera,
            None => Trained::TurnedCamera,
        };
        let sources = [
            Trained::TestCamera,
            camera,
            Trained::Surfaces,
            Trained::OtherKind,
        ];
        for trained in sources.into_iter().filter(|trained| *trained != main) {
            for &collapse in &self.collapses {
                for &width in &self.widths {
                    let order = self.default_order();
                    let combination = Combination::new(width, (tree, collapse), order);
                    all.push(Replay::new(Part::Transfer, kind, trained, combination));
                }
            }
        }
        all
    }
}

/// The default if it is in the list, otherwise the first, otherwise the default all the same.
fn base_of<T: Copy + Default + PartialEq>(list: &[T]) -> T {
    let default = T::default();
    match list.first() {
        Some(first) if !list.contains(&default) => *first,
        _ => default,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use antumbra_scene::builtin;
    use antumbra_trees::{BUILDERS, COLLAPSES};
    use std::collections::HashSet;

    #[test]
    fn the_base_is_the_default_if_it_was_asked_for() {
        assert_eq!(base_of(&[3, 0, 2]), 0);
        assert_eq!(base_of(&[3, 2]), 3);
        assert_eq!(base_of::<u8>(&[]), 0);
    }

    #[test]
    fn whole_pictures_are_of_the_default_and_of_the_paper() {
        let width = Width::W8;
        let plan = Plan {
            widths: vec![width],
            trees: BUILDERS.to_vec(),
            collapses: COLLAPSES.to_vec(),
            repeat: 1,
            ..Plan::default()
        };
        let [paper, default] = [
            Combination::of_the_paper(width),
            Combination::default_of(width),
        ];
        assert_eq!(plan.headline(width), [paper, default]);
        // The trees of the paper alone: unsorted, and by its best order.
        let plan = Plan {
            orders: vec![Order::Simple, Order::Sort, Order::SortPlus],
            trees: vec![paper.tree],
            collapses: vec![paper.collapse],
            ..plan
        };
        let sorted = Combination {
            order: Order::SortPlus,
            ..paper
        };
        assert_eq!(plan.headline(width), [paper, sorted]);
        let plan = Plan {
            orders: vec![Order::Sort],
            ..plan
        };
        let order = Order::Sort;
        assert_eq!(plan.headline(width), [Combination { order, ..paper }]);
    }

    #[test]
    fn every_piece_of_work_has_a_key_of_its_own() {
        let subject = |stem: &str| Subject {
            scene: builtin::by_name("city:1000").expect("a scene"),
            stem: stem.to_owned(),
            train: None,
        };
        let plan = Plan {
            scenes: vec![subject("a"), subject("b")],
            orders: ORDERS.to_vec(),
            widths: Width::ALL.to_vec(),
            trees: BUILDERS.to_vec(),
            collapses: COLLAPSES.to_vec(),
            repeat: 2,
            replay: 100,
            rays_from: RaysFrom::Both,
            ..Plan::default()
        };
        let mut keys = HashSet::new();
        for subject in &plan.scenes {
            let compared = plan.compared();
            let trees = BUILDERS.len() * COLLAPSES.len();
            // And the paper's tree, unsorted.
            let pictures = ORDERS.len() + trees;
            assert_eq!(compared.len(), 3 * pictures);
            // Two whole pictures of each width, twice.
            let whole = plan.renderings();
            assert_eq!(whole.len(), 3 * 2 * 2);
            let mut renderings: Vec<_> = (compared.into_iter())
                .map(|combination| Rendering {
                    combination,
                    round: 0,
                })
                .collect();
            renderings.extend(whole);
            let replays = plan.replays(subject, 5000);
            let main = replays.iter().filter(|r| r.part == Part::Techniques);
            assert_eq!(main.count(), 2 * 3 * trees * ORDERS.len());
            for rendering in renderings {
                assert!(keys.insert(rendering.key(subject)));
            }
            for replay in replays {
                assert!(keys.insert(replay.key(subject)), "{replay:?}");
            }
        }
    }
}
