//! One picture whose queries many trees answer, interleaved.
//!
//! Camera paths, shading and film are done once. Every batch of shadow rays is answered and counted by every tree, and
//! a sample of the batches is timed tree by tree. All trees therefore trace the same rays at nearly the same moment.
//!
//! - `trees.rs`: the trees, each learned as its own rendering would
//! - `comparison.rs`: the trees while the picture is traced
//! - `thread.rs`: the trees on one thread

mod comparison;
mod thread;
mod trees;

use antumbra::Recipe;
use antumbra::recipe::Order;
use antumbra_image::Image;
use antumbra_render::{
    Counts, Monitor, ObservedPicture, Options, Phase, SampleCost, Session, Split, World, image_hash,
};

use crate::Error;
use comparison::{Candidate, Comparison, Found};
use trees::{First, Maker, Ready, Training};

/// A picture that many trees were compared on.
#[derive(Clone, Debug)]
pub struct Compared {
    /// The picture, with the bits of [`render`](antumbra_render::render()).
    pub image: Image,
    /// [`image_hash`] of the picture.
    pub image_hash: u64,
    /// Closest-hit rays.
    pub closest_rays: u64,
    /// Shadow rays, including the pre-pass.
    pub shadow_rays: u64,
    /// Shadow rays that are occluded.
    pub occluded_rays: u64,
    /// Shadow rays of the main pass, which all trees were counted on. None was learned from.
    pub held_out_rays: u64,
    /// Every tree, in the order of the recipes.
    pub trees: Vec<ComparedTree>,
}

/// Figures of one tree. Tests are means per shadow ray: of nodes, of primitives, and of nodes outside of instances.
///
/// Times of a whole picture are composed. The part that does not depend on the tree was measured once for all of them:
/// shading, film, and the camera paths of the pre-pass.
#[derive(Clone, Debug)]
pub struct ComparedTree {
    /// Training rays of the child order; 0 if it did not learn.
    pub training_rays: u64,
    /// Tests of the training rays while they were logged. `None` if nothing was learned.
    pub logging: Option<[f64; 3]>,
    /// Tests of the held-out rays in the first tree, before its children were ordered. `None` without rays.
    pub before: Option<[f64; 3]>,
    /// Tests of the same rays in the final tree.
    pub after: Option<[f64; 3]>,
    /// Predicted cost of a shadow ray before and after ordering.
    pub predicted: Option<[f64; 2]>,
    /// Seconds of the trees, as [`Stats::build_seconds`](antumbra_render::Stats::build_seconds).
    pub build_seconds: f64,
    /// Seconds of the pre-pass spread over the threads, and of following training rays.
    pub log_seconds: f64,
    /// As [`Stats::sort_seconds`](antumbra_render::Stats::sort_seconds).
    pub sort_seconds: f64,
    /// As [`Stats::order_seconds`](antumbra_render::Stats::order_seconds).
    pub order_seconds: f64,
    /// Seconds of a whole picture with this tree, composed, round by round. Work of all threads is divided by their
    /// number.
    pub render_seconds: Vec<f64>,
    /// Seconds of every kind of work, summed over threads. Shadow queries are from the median round.
    pub split: Split,
    /// Whether all answers equal the answers of the first tree, bit for bit.
    pub agrees: bool,
    /// Mean tests per shadow ray of every pixel, if requested.
    pub cost_map: Option<Vec<f32>>,
}

/// Renders one picture, and compares the trees of `recipes` on its queries.
///
/// Times are those for which threads have run. Every timed batch of shadow rays is answered `rounds` times by each tree.
/// `options.recipe` is the only recipe if there is no other. `options.threads` and `options.count` do not matter: all
/// rays are counted, in the current rayon pool.
///
/// # Errors
/// As [`render`](antumbra_render::render()).
pub fn compare(
    world: &World,
    options: &Options,
    recipes: &[Recipe],
    rounds: usize,
    monitor: &dyn Monitor,
) -> Result<Compared, Error> {
    let mut session = Session::new(world, options, monitor)?;
    let recipes = match recipes {
        [] => std::slice::from_ref(&options.recipe),
        _ => recipes,
    };
    monitor.progress(Phase::Build, 0, 1);
    let mut maker = Maker::default();
    let first = maker.first(&session, &recipes[0])?;
    monitor.progress(Phase::Build, 1, 1);
    let training = Training::trace(&mut session, &maker.firsts[first].bvh, recipes)?;
    let trees = maker.trees(&session, recipes, &training, (options.seed, monitor))?;
    let firsts = maker.firsts;

    let (candidates, before) = candidates(&trees, recipes, &firsts);
    let (window, batches) = (session.window(), session.batches());
    let comparison = Comparison::new(candidates, rounds.max(1), window, batches, options.cost_map);
    let ObservedPicture {
        image,
        counts: main,
        developing,
    } = session.trace(&trees[0].bvh, &comparison)?;
    let mut found = comparison.into_found().ok_or(Error::Interrupted)?;
    let maps = std::mem::take(&mut found.maps);
    let mut total = main;
    total.add(&training.counts);
    let composer = Composer {
        found: &found,
        closest: closest_times(&trees, &found),
        training: &training,
        main: &main,
        developing: developing.as_secs_f64(),
    };
    let figures = trees.iter().enumerate().map(|(place, tree)| {
        let map = maps.get(place);
        let before = match tree.learns {
            true => before[tree.first].unwrap_or(place),
            false => place,
        };
        ComparedTree {
            cost_map: map.map(|costs| costs.iter().map(SampleCost::mean).collect()),
            ..composer.tree(place, before, tree)
        }
    });
    Ok(Compared {
        image_hash: image_hash(&image),
        trees: figures.collect(),
        image,
        closest_rays: total.closest_rays,
        shadow_rays: total.shadow_rays,
        occluded_rays: total.occluded_rays,
        held_out_rays: main.shadow_rays,
    })
}

/// What is compared, and the place of the tree that each first tree is counted in. Orders are compared with the tree that they
/// began with: with the one that keeps it as it is, or else with itself, beside the others.
fn candidates<'a>(
    trees: &'a [Ready],
    recipes: &[Recipe],
    firsts: &'a [First],
) -> (Vec<Candidate<'a>>, Vec<Option<usize>>) {
    let candidate = |bvh, timed| Candidate { bvh, timed };
    let all = trees.iter().map(|tree| candidate(&tree.bvh, true));
    let mut candidates: Vec<_> = all.collect();
    let mut before = vec![None; firsts.len()];
    for (place, (tree, recipe)) in trees.iter().zip(recipes).enumerate() {
        if recipe.order == Order::Simple {
            before[tree.first] = Some(place);
        }
    }
    for tree in trees.iter().filter(|tree| tree.learns) {
        before[tree.first].get_or_insert_with(|| {
            candidates.push(candidate(&firsts[tree.first].bvh, false));
            candidates.len() - 1
        });
    }
    (candidates, before)
}

/// Seconds of timed closest hits, tree by tree. They do not depend on the order of children, so trees that differ only in
/// it share the median.
fn closest_times(trees: &[Ready], found: &Found) -> Vec<f64> {
    let median_of = |first: usize| {
        let alike = trees
            .iter()
            .zip(&found.trees)
            .filter(|(tree, _)| tree.first == first);
        let mut seconds: Vec<f64> = alike.map(|(_, own)| own.closest).collect();
        seconds.sort_unstable_by(f64::total_cmp);
        seconds[seconds.len() / 2]
    };
    trees.iter().map(|tree| median_of(tree.first)).collect()
}

/// Makes the figures of a tree from what was measured of the tree and of all trees.
struct Composer<'a> {
    found: &'a Found,
    /// See [`closest_times`].
    closest: Vec<f64>,
    training: &'a Training,
    /// Rays of the main pass.
    main: &'a Counts,
    developing: f64,
}

impl Composer<'_> {
    fn tests(&self, place: usize) -> Option<[f64; 3]> {
        let rays = self.main.shadow_rays;
        let tests = self.found.trees[place].tests;
        (rays > 0).then(|| tests.map(|tests| tests as f64 / rays as f64))
    }

    fn tree(&self, place: usize, before: usize, tree: &Ready) -> ComparedTree {
        let (shared, own) = (&self.found.shared, &self.found.trees[place]);
        // Of all rays, from those that were timed.
        let scale = |[all, timed]: [u64; 2]| all as f64 / timed.max(1) as f64;
        let mut shadow: Vec<f64> = own
            .shadow
            .iter()
            .map(|s| s * scale(shared.shadow_rays))
            .collect();
        let closest = self.closest[place] * scale(shared.closest_rays);
        let learned = &tree.figures;
        let following = learned.following.as_secs_f64();
        let prepass = if tree.learns {
            self.training.shared + tree.log_busy
        } else {
            0.0
        };
        let sort = learned.sorting.as_secs_f64();
        let threads = rayon::current_num_threads() as f64;
        let serial = following + sort + self.developing;
        let work = prepass + closest + shared.shading + shared.film;
        let render_seconds = shadow
            .iter()
            .map(|s| serial + (work + s) / threads)
            .collect();
        shadow.sort_unstable_by(f64::total_cmp);
        let build = (tree.build + learned.rebuilding).as_secs_f64();
        ComparedTree {
            training_rays: learned.logged_rays,
            logging: tree.logging,
            before: self.tests(before),
            after: self.tests(place),
            predicted: learned.predicted,
            build_seconds: build,
            log_seconds: prepass / threads + following,
            sort_seconds: sort,
            order_seconds: learned.ordering.as_secs_f64(),
            render_seconds,
            split: Split {
                build,
                log: prepass + following,
                sort,
                shadow: shadow[shadow.len() / 2],
                closest,
                shading: shared.shading,
                film: shared.film + self.developing,
            },
            agrees: !own.differs,
            cost_map: None,
        }
    }
}
