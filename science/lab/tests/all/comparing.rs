//! Trees that are compared on one picture, against pictures that are rendered one by one.

use crate::support::*;
use antumbra::recipe::{Builder, Collapse, Engine, Order};
use antumbra::{Recipe, Width};
use antumbra_lab::{Compared, Error, compare};
use antumbra_render::{Monitor, Options, Phase, render};

const SEED: u64 = 3;

fn options() -> Options {
    Options {
        spp: Some(3),
        seed: SEED,
        cost_map: true,
        ..Options::default()
    }
}

/// All ways of learning: none, from a log of all rays, from a sample, with a tree made anew, from rays alone.
fn recipes() -> Vec<Recipe> {
    let area = Recipe::default()
        .builder(Builder::BinnedSah)
        .collapse(Collapse::Area);
    vec![
        area.order(Order::SortPlus),
        area.order(Order::Joint),
        Recipe::default().order(Order::Simple),
        Recipe::default(),
        Recipe::default()
            .order(Order::Sort)
            .engine(Engine::best(Width::W4)),
        Recipe::default().builder(antumbra_trees::SRDH),
        area.builder(antumbra_trees::SRDH).order(Order::SortMinus),
    ]
}

fn compared(threads: usize, recipes: &[Recipe]) -> Compared {
    let scene = cube_over_floor();
    let (world, _) = world(&scene);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.expect("threads")
        .install(|| compare(&world, &options(), recipes, 2, &()))
        .expect("a picture")
}

#[test]
fn counts_and_pictures_are_those_of_separate_renderings() {
    let scene = cube_over_floor();
    let (world, _) = world(&scene);
    let recipes = recipes();
    let found = compared(2, &recipes);
    let mut simple = None;
    for (recipe, tree) in recipes.iter().zip(&found.trees) {
        let options = Options {
            recipe: *recipe,
            ..options()
        };
        let alone = render(&world, &options, &()).expect("a picture");
        let stats = &alone.stats;
        assert!(tree.agrees);
        assert_eq!(found.image_hash, stats.image_hash);
        assert_eq!(found.closest_rays, stats.closest_rays);
        assert_eq!(found.shadow_rays, stats.shadow_rays);
        assert_eq!(found.occluded_rays, stats.occluded_rays);
        assert_eq!(tree.training_rays, stats.logged_rays);
        let predicted = stats.predicted_cost_before.zip(stats.predicted_cost_after);
        assert_eq!(
            tree.predicted,
            predicted.map(|(before, after)| [before, after])
        );
        let tests = |tests: Option<[f64; 3]>| tests.map(|[nodes, prims, _]| [nodes, prims]);
        let alone_before = stats.node_tests_before.zip(stats.prim_tests_before);
        let alone_after = stats.node_tests_after.zip(stats.prim_tests_after);
        let learns = recipe.order.learns();
        assert_eq!(tree.logging.is_some(), learns);
        if learns {
            let after = alone_after.map(|(nodes, prims)| [nodes, prims]);
            assert_eq!(tests(tree.after), after, "{recipe:?}");
            let logging = alone_before.map(|(nodes, prims)| [nodes, prims]);
            assert_eq!(tests(tree.logging), logging, "{recipe:?}");
            // The samples of the pre-pass are on no map.
            assert_eq!(tree.cost_map, alone.cost_map, "{recipe:?}");
        } else {
            simple = Some((alone_after, tree.after, *recipe));
            assert_eq!(tree.before, tree.after);
        }
        assert_eq!(tree.render_seconds.len(), 2);
        assert!(tree.render_seconds.iter().all(|seconds| *seconds > 0.0));
        assert!(tree.split.shadow > 0.0 && tree.split.closest > 0.0);
    }
    // Two orders of one tree: closest hits are the same work.
    assert_eq!(found.trees[0].split.closest, found.trees[1].split.closest);
    // Alone, a tree that does not learn is counted on the rays of the pre-pass as well.
    let (Some(alone), Some(held_out), recipe) = simple.expect("a tree that does not learn") else {
        panic!("no rays");
    };
    let same =
        |other: &Recipe| (other.builder, other.collapse) == (recipe.builder, recipe.collapse);
    let place = recipes
        .iter()
        .position(|other| same(other) && other.order.learns());
    let learned = &found.trees[place.expect("its learned tree")];
    assert_eq!(learned.before, Some(held_out));
    let logging = learned.logging.expect("a log");
    let [all, rest] = [found.shadow_rays, found.held_out_rays].map(|rays| rays as f64);
    for (alone, place) in [(alone.0, 0), (alone.1, 1)] {
        let sum = held_out[place] * rest + logging[place] * (all - rest);
        assert!(
            (alone * all - sum).abs() < 1e-6 * sum,
            "{} {sum}",
            alone * all
        );
    }
}

#[test]
fn counts_depend_neither_on_threads_nor_on_the_other_trees() {
    let recipes = recipes();
    let found = compared(1, &recipes);
    for threads in [2, 3] {
        let again = compared(threads, &recipes);
        assert_eq!(again.image_hash, found.image_hash);
        for (tree, other) in again.trees.iter().zip(&found.trees) {
            assert_eq!((tree.before, tree.after), (other.before, other.after));
            assert_eq!(
                (tree.logging, tree.predicted),
                (other.logging, other.predicted)
            );
        }
    }
    for (recipe, tree) in recipes.iter().zip(&found.trees) {
        let alone = &compared(2, &[*recipe]).trees[0];
        if recipe.order.learns() {
            assert_eq!((alone.before, alone.after), (tree.before, tree.after));
            assert_eq!(alone.cost_map, tree.cost_map);
        } else {
            // Without any tree that learns, there is no pre-pass.
            assert_ne!(alone.after, tree.after);
        }
    }
}

/// Stops when a share of the picture is done.
struct Stop(u64);

impl Monitor for Stop {
    fn cancelled(&self) -> bool {
        DONE.with(|done| done.get() >= self.0)
    }

    fn progress(&self, phase: Phase, done: u64, _: u64) {
        if phase == Phase::Render {
            DONE.with(|last| last.set(done.max(last.get())));
        }
    }
}

thread_local! {
    static DONE: std::cell::Cell<u64> = const { std::cell::Cell::new(0) };
}

/// A wish to stop that comes when the rays of all tiles are kept, but not all are answered, is obeyed.
#[test]
fn a_comparison_that_is_stopped_gives_nothing() {
    let scene = cube_over_floor();
    let (world, _) = world(&scene);
    // Three columns and four rows of tiles.
    for after in [1, 12] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let end = pool
            .expect("a thread")
            .install(|| compare(&world, &options(), &recipes(), 1, &Stop(after)));
        assert!(matches!(end, Err(Error::Interrupted)), "{after}");
    }
}
