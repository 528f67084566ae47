//! Pictures with trees that plug into the kernel.

use antumbra::Recipe;
use antumbra::recipe::Collapse;
use antumbra_render::{Options, Stats, render};
use antumbra_trees::{BUILDERS, COLLAPSES, ORDERS};

use crate::support::{cube_over_floor, world};

fn options(recipe: Recipe) -> Options {
    Options {
        spp: Some(2),
        recipe,
        ..Options::default()
    }
}

/// Every builder, with collapses and orders in turns.
#[test]
fn pictures_do_not_depend_on_the_tree() {
    let scene = cube_over_floor();
    let (world, _) = world(&scene);
    let picture = |recipe| -> Stats {
        let options = options(recipe);
        render(&world, &options, &()).expect("a picture").stats
    };
    let expected = picture(Recipe::default()).image_hash;
    for turn in 0..ORDERS.len() {
        let (builder, order) = (BUILDERS[turn % BUILDERS.len()], ORDERS[turn]);
        let collapse = COLLAPSES[turn % COLLAPSES.len()];
        let recipe = Recipe::default().builder(builder).collapse(collapse);
        let found = picture(recipe.order(order));
        assert_eq!(found.image_hash, expected, "{builder} {collapse} {order}");
    }
}

/// Builders that are driven by rays keep a bounded sample of them, as learned collapses do.
#[test]
fn any_share_may_drive_a_builder() {
    let scene = cube_over_floor();
    let (world, _) = world(&scene);
    for builder in BUILDERS.into_iter().filter(|one| one.needs_rays()) {
        let driven = Options {
            log_share: 1.0,
            ..options(Recipe::default().builder(builder).collapse(Collapse::Area))
        };
        let stats = render(&world, &driven, &()).expect("a picture").stats;
        let expected = stats.shadow_rays.min(1 << 12);
        assert_eq!(stats.logged_rays, expected, "{builder}");
    }
}
