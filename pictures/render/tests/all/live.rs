//! Pictures that are looked at while they are traced, and pictures that grow in rounds.

use std::num::NonZeroUsize;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::support::*;
use antumbra::recipe::Engine;
use antumbra::{Recipe, Width};
use antumbra_render::{
    Error, Growth, KeptTree, LiveTiles, Monitor, Options, Seen, Snapshot, Task, World, render,
    render_rounds, render_task, training_rays,
};
use antumbra_scene::{Filter, Scene};
use glam::Vec3;

/// Two bodies on a floor under a sky.
fn scene(filter: Filter) -> Scene {
    let mut scene = empty();
    scene.name = "bodies".into();
    scene.camera = look(Vec3::new(0.0, 0.5, -5.0), Vec3::ZERO, 45.0);
    scene.film.resolution = [70, 45];
    scene.film.crop_window = [0.1, 1.0, 0.0, 0.9];
    scene.film.filter = filter;
    add(&mut scene, cube(Vec3::new(-1.0, 0.0, 0.0), 0.6), matte(0.7));
    add(
        &mut scene,
        sphere(Vec3::new(1.0, 0.2, 0.5), 0.8),
        matte(0.4),
    );
    add(&mut scene, floor(3.0), matte(0.5));
    scene.lights = vec![sky(0.3)];
    scene
}

const FILTERS: [Filter; 2] = [
    Filter::Box { radius: [0.5, 0.5] },
    Filter::Gaussian {
        radius: [2.0, 1.5],
        alpha: 1.0,
    },
];

fn options() -> Options {
    Options {
        spp: Some(40),
        threads: NonZeroUsize::new(2),
        ..Options::default()
    }
}

/// Publishes tiles, and stops after some batches.
struct Live {
    tiles: LiveTiles,
    left: AtomicU64,
    kept: std::sync::Mutex<Option<Snapshot>>,
}

impl Live {
    fn new(scene: &Scene, left: u64) -> Self {
        Self {
            tiles: LiveTiles::new(&scene.film),
            left: left.into(),
            kept: std::sync::Mutex::default(),
        }
    }
}

impl Monitor for Live {
    fn tiles(&self) -> Option<&LiveTiles> {
        Some(&self.tiles)
    }

    fn cancelled(&self) -> bool {
        self.left.load(Ordering::Relaxed) == 0
    }

    fn wants_snapshot(&self) -> bool {
        let left = &self.left;
        let _ = left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| {
            left.checked_sub(1)
        });
        false
    }

    fn keep(&self, snapshot: Snapshot) {
        *self.kept.lock().expect("no panic") = Some(snapshot);
    }
}

#[test]
fn looking_at_a_picture_changes_no_bit_and_shows_all_of_it() {
    for filter in FILTERS {
        let scene = scene(filter);
        let world = World::new(&scene).expect("a valid scene");
        let reference = render(&world, &options(), &()).expect("a picture");
        let live = Live::new(&scene, u64::MAX);
        let done = std::sync::atomic::AtomicBool::new(false);
        let (rendering, seen) = std::thread::scope(|scope| {
            let viewer = scope.spawn(|| {
                let mut seen = Seen::default();
                let mut updates = 0;
                while !done.load(Ordering::Relaxed) {
                    updates += live.tiles.changed(&mut seen).len();
                }
                updates + live.tiles.changed(&mut seen).len()
            });
            let rendering = render(&world, &options(), &live).expect("a picture");
            done.store(true, Ordering::Relaxed);
            (rendering, viewer.join().expect("no panic"))
        });
        assert!(rendering.image == reference.image);
        assert!(live.tiles.image().expect("a picture") == reference.image);
        // 12 tiles reach the window at least.
        assert!(seen >= 12, "{seen}");
    }
}

#[test]
fn a_resumed_picture_shows_what_was_done_before() {
    let scene = scene(FILTERS[0]);
    let world = World::new(&scene).expect("a valid scene");
    let first = Live::new(&scene, 11);
    let outcome = render_task(&world, &options(), Task::default(), &first);
    assert!(matches!(outcome, Err(Error::Cancelled)));
    let before = first.tiles.image().expect("a picture");
    let snapshot = first.kept.lock().expect("no panic").take();
    assert!(snapshot.is_some());
    let task = Task {
        resume: snapshot,
        ..Task::default()
    };
    // Stopped in its first batch, so that nothing new is there.
    let second = Live::new(&scene, 1);
    let outcome = render_task(&world, &options(), task, &second);
    assert!(matches!(outcome, Err(Error::Cancelled)));
    let shown = second.tiles.image().expect("a picture");
    let black = |image: &antumbra_image::Image| {
        let dark = image.pixels().iter().filter(|pixel| **pixel == [0.0; 3]);
        dark.count()
    };
    assert!(black(&shown) <= black(&before));
    assert!(black(&before) < before.pixels().len());
}

#[test]
fn a_picture_made_in_rounds_has_the_same_bits() {
    let scene = scene(FILTERS[0]);
    let world = World::new(&scene).expect("a valid scene");
    for spp in [1, 3, 40] {
        let options = Options {
            spp: Some(spp),
            ..options()
        };
        let reference = render(&world, &options, &()).expect("a picture");
        let recipe = Recipe::default().engine(Engine::best(Width::W8));
        let plain = Arc::new(KeptTree::unlearned(&world, &recipe));
        let lesson = training_rays(&world, &plain, &options, &()).expect("rays");
        assert!(!lesson.rays().is_empty());
        let learned = KeptTree::learned(&world, &recipe, &lesson).expect("a tree");
        assert!(learned.is_learned() && !plain.is_learned());
        let learned = Arc::new(learned);
        // Another tree in every round.
        let turn = AtomicU64::new(0);
        let tree = || match turn.fetch_add(1, Ordering::Relaxed) % 2 {
            0 => Arc::clone(&plain),
            _ => Arc::clone(&learned),
        };
        let live = Live::new(&scene, u64::MAX);
        let rounds = std::sync::Mutex::new(Vec::new());
        let after = |round: &antumbra_render::Round| {
            rounds.lock().expect("no panic").push(round.samples);
        };
        let mut growth = Growth::default();
        let image = render_rounds(&world, &options, &tree, &live, &after, &mut growth);
        let image = image.expect("a picture");
        assert!(image == reference.image, "{spp}");
        assert!(live.tiles.image().expect("a picture") == image);
        let rounds = rounds.into_inner().expect("no panic");
        let expected: &[u32] = match spp {
            1 => &[1],
            3 => &[1, 2, 3],
            _ => &[1, 2, 4, 8, 16, 32, 40],
        };
        assert_eq!(rounds, expected);
    }
}

/// Stops after some looks.
struct Impatient(LiveTiles, AtomicU64);

impl Monitor for Impatient {
    fn tiles(&self) -> Option<&LiveTiles> {
        Some(&self.0)
    }

    fn cancelled(&self) -> bool {
        let less = |left: u64| left.checked_sub(1);
        let (set, fetch) = (Ordering::Relaxed, Ordering::Relaxed);
        self.1.fetch_update(set, fetch, less).is_err()
    }
}

#[test]
fn a_picture_that_was_cancelled_goes_on_growing() {
    for filter in FILTERS {
        let scene = scene(filter);
        let world = World::new(&scene).expect("a valid scene");
        let tree = Arc::new(KeptTree::unlearned(&world, &Recipe::default()));
        let tree = || Arc::clone(&tree);
        let reference = {
            let all = &mut Growth::default();
            render_rounds(&world, &options(), &tree, &(), &|_| {}, all).expect("a picture")
        };
        let mut live = Impatient(LiveTiles::new(&scene.film), AtomicU64::new(0));
        let rounds = std::sync::Mutex::new(Vec::new());
        let after = |round: &antumbra_render::Round| {
            let figures = (round.samples, round.closest_rays);
            rounds.lock().expect("no panic").push(figures);
        };
        let (mut growth, mut turns) = (Growth::default(), 0);
        let image = loop {
            turns += 1;
            live.1 = AtomicU64::new(5 * turns);
            match render_rounds(&world, &options(), &tree, &live, &after, &mut growth) {
                Ok(image) => break image,
                Err(error) => assert!(matches!(error, Error::Cancelled)),
            }
        };
        assert!(turns > 3, "{turns}");
        assert!(image == reference);
        assert!(live.0.image().expect("a picture") == image);
        // No round is begun twice.
        let rounds = rounds.into_inner().expect("no panic");
        let samples: Vec<u32> = rounds.iter().map(|round| round.0).collect();
        assert_eq!(samples, [1, 2, 4, 8, 16, 32, 40]);
        assert!(rounds.is_sorted_by_key(|round| round.1));
    }
}

#[test]
fn another_camera_shows_what_a_new_world_shows() {
    let mut other = scene(FILTERS[0]);
    let world = World::new(&other).expect("a valid scene");
    other.camera = look(Vec3::new(2.0, 1.5, -4.0), Vec3::ZERO, 60.0);
    other.film.resolution = [50, 50];
    other.film.crop_window = [0.0, 1.0, 0.0, 1.0];
    let expected = World::new(&other).expect("a valid scene");
    let expected = render(&expected, &options(), &()).expect("a picture");
    let mut bad = other.camera.clone();
    bad.fov = 400.0;
    assert!(world.look(&bad, &other.film).is_err());
    let world = world
        .look(&other.camera, &other.film)
        .expect("a valid camera");
    let found = render(&world, &options(), &()).expect("a picture");
    assert!(found.image == expected.image);
    let tree = KeptTree::unlearned(&world, &Recipe::default());
    let seen = tree.seen(&world, [25.0, 25.0]).expect("a surface");
    assert!(seen.point.iter().all(|x| x.abs() < 4.0), "{seen:?}");
    assert!((Vec3::from(seen.normal).length() - 1.0).abs() < 1e-4);
    let to_eye = Vec3::new(2.0, 1.5, -4.0) - Vec3::from(seen.point);
    assert!(Vec3::from(seen.normal).dot(to_eye) > 0.0);
    assert!(tree.seen(&world, [25.0, -500.0]).is_none());
}
