//! What orders do to costs: learned ones lower them, none changes an answer (see `oracle.rs` for that).

use std::panic::AssertUnwindSafe;

use crate::support::{engines_for, geometry, row};
use antumbra::parts::{Cost, Log, LogKind, Plan, Row, SlotOrder, Steps, Tree};
use antumbra::recipe::{Collapse, CostModel, Engine, Order};
use antumbra::{Bvh, Error, Ray, Recipe, Width};
use antumbra_testkit::{Mesh, Rng, mesh};

/// A wall of small triangles before a few large ones: the kind of scene an order matters in.
fn scene(rng: &mut Rng) -> Mesh {
    let mut mesh = mesh::soup(rng, 4000);
    let grid = mesh::bumpy_grid(rng, 200);
    let first = mesh.positions.len() as u32;
    mesh.positions.extend(
        grid.positions
            .iter()
            .map(|p| [p[0] * 2.0, p[1] * 2.0, p[2] + 1.2]),
    );
    mesh.indices
        .extend(grid.indices.iter().map(|t| t.map(|vertex| vertex + first)));
    mesh
}

fn shadow_rays(rng: &mut Rng, count: usize) -> Vec<Ray> {
    (0..count)
        .map(|_| Ray::between(rng.point(1.0), [0.3, 0.2, 3.0]))
        .collect()
}

fn build(mesh: &Mesh, width: Width) -> Bvh {
    let options = Recipe::default()
        .collapse(Collapse::Area)
        .engine(Engine::best(width))
        .order(Order::Simple);
    Bvh::build(&[geometry(mesh)], &options).expect("indices in range")
}

fn log(bvh: &Bvh, kind: LogKind, rays: &[Ray]) -> Log {
    let mut log = bvh.new_log(kind, 3);
    let mut occluded = vec![false; rays.len()];
    bvh.occluded_batch_logged(
        rays,
        &mut occluded,
        &mut vec![Cost::default(); rays.len()],
        &mut log,
    );
    assert_eq!(log.rays(), rays.len() as u64);
    assert_eq!(
        log.occluded(),
        occluded.iter().filter(|occluded| **occluded).count() as u64
    );
    log
}

fn node_tests(bvh: &Bvh, rays: &[Ray]) -> u64 {
    let mut costs = vec![Cost::default(); rays.len()];
    bvh.occluded_batch_counted(rays, &mut vec![false; rays.len()], &mut costs);
    costs.iter().map(|cost| u64::from(cost.node_tests)).sum()
}

fn learned_orders() -> impl Iterator<Item = Order> {
    Order::ALL
        .into_iter()
        .filter(|order| order.log_kind().is_some())
}

#[test]
fn learned_orders_lower_the_predicted_and_the_measured_cost() {
    let seed = 77;
    let mut rng = Rng::new(seed);
    let mesh = scene(&mut rng);
    let (training, test) = (shadow_rays(&mut rng, 4000), shadow_rays(&mut rng, 20_000));
    for width in Width::ALL {
        let built = build(&mesh, width);
        let simple = node_tests(&built, &test);
        for order in learned_orders() {
            let mut bvh = built.clone();
            let log = log(&bvh, order.log_kind().expect("a learned order"), &training);
            let model = CostModel::default();
            let plan = bvh.plan(order, Some(&log), &model).expect("a log");
            let before = bvh
                .predicted_cost(&log, &model, None)
                .expect("the same tree");
            let after = bvh
                .predicted_cost(&log, &model, Some(&plan))
                .expect("the same tree");
            // Predictions are those of equation (5), whose bias this order is there to avoid.
            assert!(
                after < before || order == Order::Visits,
                "x{width} {order}: predicted {after} after {before}"
            );
            bvh.apply(&plan);
            bvh.validate().expect("a valid tree");
            let sorted = node_tests(&bvh, &test);
            assert!(
                sorted < simple,
                "seed {seed} x{width} {order}: {sorted} after {simple}"
            );
        }
    }
}

#[test]
fn logs_add_up_however_rays_are_divided() {
    let mut rng = Rng::new(8);
    let mesh = scene(&mut rng);
    let rays = shadow_rays(&mut rng, 1000);
    for shuffled in [false, true] {
        for (boxes, masks) in [(false, false), (true, false), (true, true), (false, true)] {
            let kind = LogKind {
                boxes,
                shuffled,
                masks,
            };
            let bvh = build(&mesh, Width::W8);
            let whole = log(&bvh, kind, &rays);
            let mut parts = bvh.new_log(kind, 3);
            for part in rays.chunks(123).rev() {
                parts.merge(&log(&bvh, kind, part));
            }
            assert_eq!(parts, whole, "{kind:?}");
        }
    }
}

#[test]
fn every_level_logs_the_same_occlusions() {
    let mut rng = Rng::new(9);
    let mesh = scene(&mut rng);
    let rays = shadow_rays(&mut rng, 1000);
    let kind = LogKind {
        boxes: false,
        shuffled: false,
        masks: false,
    };
    for width in Width::ALL {
        let mut bvh = build(&mesh, width);
        let best = log(&bvh, kind, &rays);
        for engine in engines_for(bvh.width()) {
            engine.run(&mut bvh).expect("its width");
            assert_eq!(
                log(&bvh, kind, &rays).occluded(),
                best.occluded(),
                "{engine:?}"
            );
        }
    }
}

#[test]
fn an_order_without_its_log_is_an_error() {
    let mut rng = Rng::new(10);
    let bvh = build(&scene(&mut rng), Width::W4);
    let model = CostModel::default();
    let poor = log(
        &bvh,
        LogKind {
            boxes: false,
            shuffled: false,
            masks: false,
        },
        &[],
    );
    assert_eq!(
        bvh.plan(Order::Sort, None, &model),
        Err(Error::NeedsLog("sort"))
    );
    assert_eq!(
        bvh.plan(Order::SortPlus, Some(&poor), &model),
        Err(Error::NeedsBoxes("sort+"))
    );
    assert_eq!(
        bvh.plan(Order::Joint, Some(&poor), &model),
        Err(Error::NeedsMasks("joint"))
    );
    let other = build(&mesh::soup(&mut rng, 50), Width::W4);
    assert!(matches!(
        other.plan(Order::SortMinus, Some(&poor), &model),
        Err(Error::OtherTree { .. })
    ));
}

#[test]
fn an_empty_log_gives_the_area_order() {
    let mut rng = Rng::new(12);
    let mesh = scene(&mut rng);
    for width in Width::ALL {
        let bvh = build(&mesh, width);
        let model = CostModel::default();
        let sato = bvh.plan(Order::Sato, None, &model).expect("no log needed");
        for order in learned_orders() {
            let log = log(&bvh, order.log_kind().expect("a learned order"), &[]);
            let plan = bvh.plan(order, Some(&log), &model).expect("a log");
            let (mut a, mut b) = (bvh.clone(), bvh.clone());
            a.apply(&sato);
            b.apply(&plan);
            let rays = shadow_rays(&mut rng, 2000);
            assert_eq!(
                node_tests(&a, &rays),
                node_tests(&b, &rays),
                "x{width} {order}"
            );
        }
    }
}

#[test]
fn free_nodes_and_primitives_are_no_trouble() {
    let mut rng = Rng::new(13);
    let mesh = scene(&mut rng);
    let rays = shadow_rays(&mut rng, 500);
    let mut bvh = build(&mesh, Width::W8);
    let log = log(
        &bvh,
        LogKind {
            boxes: true,
            shuffled: true,
            masks: false,
        },
        &rays,
    );
    let model = CostModel::default()
        .node(0.0)
        .prim(0.0)
        .entry(0.0)
        .cutout(0.0);
    let plan = bvh
        .plan(Order::SortPlus, Some(&log), &model)
        .expect("a log");
    assert_eq!(bvh.predicted_cost(&log, &model, Some(&plan)), Ok(0.0));
    bvh.apply(&plan);
    bvh.validate().expect("a valid tree");
}

#[test]
fn names_read_back() {
    for order in Order::ALL {
        assert_eq!(order.name().parse(), Ok(order));
    }
    let error = "sortplus".parse::<Order>().expect_err("no such order");
    for order in Order::ALL {
        assert!(error.to_string().contains(order.name()), "{error}");
    }
}

/// Five leaves: two nodes of four, or one of eight; both have eight slots.
#[test]
fn an_order_of_another_width_does_not_fit() {
    let mut rng = Rng::new(14);
    let mesh = (33..40)
        .map(|size| mesh::soup(&mut rng, size))
        .find(|mesh| {
            build(mesh, Width::W4).report().nodes == 2 && build(mesh, Width::W8).report().nodes == 1
        })
        .expect("some mesh of five to eight leaves");
    let (four, eight) = (build(&mesh, Width::W4), build(&mesh, Width::W8));
    let model = CostModel::default();
    let plan = four.plan(Order::Sato, None, &model).expect("no log needed");
    let kind = LogKind {
        boxes: true,
        shuffled: false,
        masks: false,
    };
    let log = log(&eight, kind, &[]);
    assert!(matches!(
        eight.predicted_cost(&log, &model, Some(&plan)),
        Err(Error::OtherTree { .. })
    ));
    let applied = std::panic::catch_unwind(AssertUnwindSafe(|| eight.clone().apply(&plan)));
    assert!(applied.is_err());
}

/// Two logs serve all orders, and teach each of them what a log of its own would.
#[test]
fn one_log_serves_all_orders_that_it_covers() {
    let mut rng = Rng::new(15);
    let mesh = scene(&mut rng);
    let rays = shadow_rays(&mut rng, 1000);
    let bvh = build(&mesh, Width::W8);
    let kinds = LogKind::covering(learned_orders().filter_map(Order::log_kind));
    assert_eq!(kinds.len(), 2);
    let logs: Vec<_> = kinds.iter().map(|kind| log(&bvh, *kind, &rays)).collect();
    let model = CostModel::default();
    for order in learned_orders() {
        let kind = order.log_kind().expect("a learned order");
        let own = log(&bvh, kind, &rays);
        let shared = logs.iter().find(|log| log.kind().covers(kind));
        let shared = shared.expect("a log for every order");
        assert_eq!(
            bvh.plan(order, Some(shared), &model),
            bvh.plan(order, Some(&own), &model),
            "{order}"
        );
        assert!(!kind.covers(LogKind {
            shuffled: !kind.shuffled,
            ..kind
        }));
    }
}

/// Slots in any order, the empty ones among them.
struct Shuffled;

row!(Shuffled, "shuffled", "All slots at random");

impl Plan for Shuffled {
    fn plan(&self, tree: &Tree, _: Option<&Log>, _: &CostModel) -> Result<SlotOrder, Error> {
        let mut rng = Rng::new(18);
        let mut order = SlotOrder::of_nodes(tree);
        for index in 0..tree.node_count() {
            let mut slots: Vec<_> = (0..tree.node(index).width()).collect();
            for last in (1..slots.len()).rev() {
                slots.swap(last, rng.below(last + 1));
            }
            order.arrange(index, |place| slots[place]);
        }
        Ok(order)
    }
}

/// An order that plugs in may say anything of empty slots.
#[test]
fn empty_slots_stay_behind_the_others() {
    let mut rng = Rng::new(19);
    let mesh = scene(&mut rng);
    let rays = shadow_rays(&mut rng, 1000);
    for width in Width::ALL {
        let built = build(&mesh, width);
        let mut bvh = built.clone();
        bvh.relearn(&[], &Recipe::default().order(Order::Other(&Shuffled)));
        bvh.validate().expect("slots are permuted and no more");
        assert_ne!(bvh.to_bytes(), built.to_bytes());
        let (mut before, mut after) = (vec![false; rays.len()], vec![false; rays.len()]);
        built.batch(&rays).occluded_into(&mut before);
        bvh.batch(&rays).occluded_into(&mut after);
        assert_eq!(before, after, "x{width}");
    }
}

/// Puts every child of a node into one slot.
struct Crowded;

row!(Crowded, "crowded", "No permutation of the slots");

impl Plan for Crowded {
    fn plan(&self, tree: &Tree, _: Option<&Log>, _: &CostModel) -> Result<SlotOrder, Error> {
        let mut order = SlotOrder::of_nodes(tree);
        order.arrange(0, |_| 0);
        Ok(order)
    }
}

#[test]
#[should_panic(expected = "a permutation of the slots")]
fn slots_are_not_lost() {
    let bvh = build(&mesh::soup(&mut Rng::new(20), 50), Width::W8);
    let _ = bvh.plan(Order::Other(&Crowded), None, &CostModel::default());
}

/// What an order learns from is missing.
struct Picky;

row!(Picky, "picky", "Never content with its log");

impl Plan for Picky {
    fn plan(&self, _: &Tree, _: Option<&Log>, _: &CostModel) -> Result<SlotOrder, Error> {
        Err(Error::NeedsBoxes(self.name()))
    }
}

#[test]
fn the_error_of_an_order_that_plugs_in_is_returned() {
    let mesh = mesh::soup(&mut Rng::new(21), 50);
    let recipe = Recipe::default().order(Order::Other(&Picky));
    let built = Bvh::build(&[geometry(&mesh)], &recipe);
    assert_eq!(built.err(), Some(Error::NeedsBoxes("picky")));
}
