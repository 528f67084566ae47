//! Figures of a rendering: counts, predictions, cost maps, standard errors.

use std::num::NonZeroUsize;

use crate::support::heap::{heap, options};
use crate::support::*;
use antumbra::recipe::{Collapse, Order};
use antumbra_render::{Options, Rendering};
use antumbra_scene::SamplerKind;

#[test]
fn the_standard_error_is_the_spread_over_seeds() {
    let mut scene = heap(6);
    scene.sampler.kind = SamplerKind::Random;
    scene.film.resolution = [12, 12];
    let runs: Vec<Rendering> = (0..24)
        .map(|seed| {
            picture_with(
                &scene,
                &Options {
                    seed,
                    spp: Some(64),
                    standard_error: true,
                    ..options()
                },
            )
        })
        .collect();
    let (mut spread, mut claimed) = (0.0, 0.0);
    for pixel in 0..144 {
        let values: Vec<f64> = runs
            .iter()
            .map(|r| f64::from(r.image.pixels()[pixel][1]))
            .collect();
        let mean = values.iter().sum::<f64>() / 24.0;
        spread += values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / 23.0;
        let error =
            |r: &Rendering| r.standard_error.as_ref().expect("asked for").pixels()[pixel][1];
        claimed += runs
            .iter()
            .map(|r| f64::from(error(r)).powi(2))
            .sum::<f64>()
            / 24.0;
    }
    near(claimed, spread, 0.25, "variance");
}

#[test]
fn figures_of_orders_that_learn() {
    let scene = heap(8);
    let rendering = picture_with(
        &scene,
        &Options {
            count: true,
            recipe: options().recipe.order(Order::SortPlus),
            ..options()
        },
    );
    let stats = &rendering.stats;
    assert!(stats.logged_rays > 0 && stats.logged_rays < stats.shadow_rays / 2);
    for value in [
        stats.node_tests_before,
        stats.prim_tests_before,
        stats.node_tests_after,
        stats.prim_tests_after,
        stats.predicted_cost_before,
        stats.predicted_cost_after,
    ] {
        assert!(value.is_some_and(|v| v > 0.0 && v.is_finite()), "{stats:?}");
    }
    assert!(stats.predicted_cost_after <= stats.predicted_cost_before);
    assert!(stats.shadow_share() > 0.0 && stats.shadow_share() < 1.0);
    let parts = stats.split.named();
    assert!(parts.iter().all(|(_, seconds)| *seconds > 0.0), "{parts:?}");

    // The log is a sum over workers: its figures do not depend on their number.
    let threads = NonZeroUsize::new(3);
    let again = picture_with(
        &scene,
        &Options {
            count: true,
            threads,
            recipe: options().recipe.order(Order::SortPlus),
            ..options()
        },
    )
    .stats;
    assert_eq!(again.threads, 3);
    assert_eq!(again.logged_rays, stats.logged_rays);
    assert_eq!(again.node_tests_before, stats.node_tests_before);
    assert_eq!(again.node_tests_after, stats.node_tests_after);
    assert_eq!(again.predicted_cost_after, stats.predicted_cost_after);
}

#[test]
fn figures_of_orders_that_do_not_learn() {
    let scene = heap(9);
    let order = Order::Sato;
    let counted = picture_with(
        &scene,
        &Options {
            count: true,
            recipe: options().recipe.order(order),
            ..options()
        },
    )
    .stats;
    assert_eq!(counted.logged_rays, 0);
    assert!(counted.node_tests_before.is_some());
    assert_eq!(counted.node_tests_before, counted.node_tests_after);
    assert_eq!(counted.prim_tests_before, counted.prim_tests_after);
    assert_eq!(counted.predicted_cost_before, None);
    let plain = picture_with(
        &scene,
        &Options {
            recipe: options().recipe.order(order),
            ..options()
        },
    )
    .stats;
    assert_eq!(plain.node_tests_after, None);
    assert_eq!(plain.node_tests_before, None);
}

/// The map is the mean over each pixel's rays; weighted by rays it is the total, which a picture of one pixel
/// shows.
#[test]
fn cost_maps_hold_the_mean_cost_of_a_shadow_ray() {
    let mut scene = heap(10);
    let options = Options {
        cost_map: true,
        recipe: options().recipe.order(Order::Simple),
        ..options()
    };
    let rendering = picture_with(&scene, &options);
    let map = rendering.cost_map.expect("asked for");
    assert_eq!(map.len(), 40 * 27);
    assert!(map.iter().all(|cost| cost.is_finite()) && map.iter().any(|&cost| cost > 0.0));
    scene.film.resolution = [1, 1];
    let single = picture_with(&scene, &options);
    let map = single.cost_map.expect("asked for");
    let stats = single.stats;
    let total = stats.node_tests_after.expect("counted") + stats.prim_tests_after.expect("counted");
    near(f64::from(map[0]), total, 1e-6, "one pixel");
}

#[test]
fn any_share_may_be_learned_from() {
    let scene = heap(14);
    let stats_of = |collapse, log_share| {
        let options = Options {
            log_share,
            count: true,
            recipe: options().recipe.order(Order::SortPlus).collapse(collapse),
            ..options()
        };
        picture_with(&scene, &options).stats
    };
    // Learned collapses keep a bounded sample of the rays.
    let learned = stats_of(Collapse::Learned, 1.0);
    assert_eq!(learned.logged_rays, learned.shadow_rays.min(1 << 12));
    let nothing = stats_of(Collapse::Learned, 0.0);
    assert_eq!(nothing.logged_rays, 0);
    assert_eq!(nothing.predicted_cost_after, None);

    let stats = |log_share| stats_of(Collapse::Area, log_share);
    let all = stats(1.0);
    assert_eq!(all.logged_rays, all.shadow_rays);
    assert!(all.node_tests_before.is_some() && all.predicted_cost_after.is_some());
    assert_eq!(all.node_tests_after, None);
    let half = stats(0.5);
    let share = half.logged_rays as f64 / half.shadow_rays as f64;
    assert!((share - 0.5).abs() < 0.05, "{share}");
    assert_eq!(stats(0.0).logged_rays, 0);
}
