//! Renderings that were interrupted and resumed, or made in parts and joined, have the bits of one made at once.

use std::io::Write;
use std::num::NonZeroUsize;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::support::*;
use antumbra::Width;
use antumbra::recipe::{Collapse, Engine, Order};
use antumbra_render::{
    Error, Identity, Lesson, Monitor, Options, Place, Rendering, Shard, Snapshot, Task, World,
    render, render_task,
};
use antumbra_scene::{Filter, Geometry, Light, Rgb, Scene};
use glam::Vec3;

/// A box and a ball under a lamp, with a filter that reaches over the edges of tiles.
fn scene() -> Scene {
    let mut scene = empty();
    scene.name = "ball".into();
    scene.camera = look(Vec3::new(0.0, 0.5, -5.0), Vec3::ZERO, 45.0);
    scene.film.resolution = [70, 45];
    scene.film.filter = Filter::Gaussian {
        radius: [2.0, 1.5],
        alpha: 1.0,
    };
    add(&mut scene, cube(Vec3::new(-1.0, 0.0, 0.0), 0.6), matte(0.7));
    add(
        &mut scene,
        sphere(Vec3::new(1.0, 0.2, 0.5), 0.8),
        glass(1.4),
    );
    add(&mut scene, floor(3.0), matte(0.5));
    let lamp = quad(Vec3::new(-1.0, 3.0, -1.0), Vec3::X, Vec3::Z);
    add(&mut scene, lamp, matte(0.0)).area_light = emission(20.0);
    scene.lights = vec![sky(0.3)];
    scene
}

fn options() -> Options {
    Options {
        // More than two batches per tile.
        spp: Some(40),
        standard_error: true,
        threads: NonZeroUsize::new(2),
        ..Options::default()
    }
}

/// Stops in one of so many batches and keeps what it is given; or requests that everything is kept.
struct Stop {
    left: AtomicU64,
    every_wave: bool,
    kept: Mutex<Vec<Snapshot>>,
}

impl Stop {
    fn after(left: u64) -> Self {
        Self {
            left: left.into(),
            every_wave: false,
            kept: Mutex::default(),
        }
    }

    fn kept(&self) -> Vec<Snapshot> {
        std::mem::take(&mut *self.kept.lock().expect("no panic"))
    }
}

impl Monitor for Stop {
    fn cancelled(&self) -> bool {
        self.left.load(Ordering::Relaxed) == 0
    }

    fn wants_snapshot(&self) -> bool {
        // Called before every batch, by several threads.
        let left = &self.left;
        let _ = left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| {
            left.checked_sub(1)
        });
        self.every_wave
    }

    fn keep(&self, snapshot: Snapshot) {
        self.kept.lock().expect("no panic").push(snapshot);
    }
}

/// What is written to a file.
fn bytes_of(write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Vec<u8> {
    let mut bytes = Vec::new();
    write(&mut bytes).expect("memory takes it");
    bytes
}

/// Through the bytes of a file and back.
fn stored(snapshot: &Snapshot, identity: &Identity) -> Snapshot {
    let bytes = bytes_of(|file| snapshot.write(identity, file));
    let (found, snapshot) = Snapshot::from_bytes(&bytes).expect("it can be read");
    assert_eq!(found.difference(identity), None);
    assert_eq!(bytes_of(|file| snapshot.write(identity, file)), bytes);
    snapshot
}

fn assert_equal(found: &Rendering, expected: &Rendering, what: &str) {
    assert!(found.image == expected.image, "{what}");
    assert!(found.standard_error == expected.standard_error, "{what}");
}

#[test]
fn a_rendering_interrupted_again_and_again_has_the_same_bits() {
    let scene = scene();
    let world = World::new(&scene).expect("a valid scene");
    let reference = render(&world, &options(), &()).expect("a picture");
    let identity = Identity::new(&scene, &options());
    for patience in [7, 12, 20] {
        let mut task = Task::default();
        let mut interruptions = 0;
        let (rendering, _) = loop {
            // Every time on other threads, in another tree.
            let options = Options {
                threads: NonZeroUsize::new(1 + interruptions % 3),
                recipe: options()
                    .recipe
                    .order([Order::SortPlus, Order::Simple, Order::Sort][interruptions / 3 % 3])
                    .collapse([Collapse::default(), Collapse::Area][interruptions / 2 % 2])
                    .engine(Engine::best(Width::ALL[interruptions % 3])),
                ..options()
            };
            let stop = Stop::after(patience + interruptions as u64);
            match render_task(&world, &options, task, &stop) {
                Ok(done) => break done,
                Err(Error::Cancelled) => {
                    interruptions += 1;
                    let last = stop.kept().pop();
                    task = Task {
                        resume: last.map(|snapshot| stored(&snapshot, &identity)),
                        ..Task::default()
                    };
                }
                Err(error) => panic!("{error}"),
            }
        };
        assert!(interruptions >= 2, "only {interruptions} interruptions");
        assert_equal(&rendering, &reference, &format!("patience {patience}"));
        assert_eq!(
            rendering.stats.dropped_samples,
            reference.stats.dropped_samples
        );
    }
}

#[test]
fn every_snapshot_of_a_running_rendering_can_be_gone_on_with() {
    let mut scene = scene();
    scene.film.resolution = [40, 40];
    let world = World::new(&scene).expect("a valid scene");
    let identity = Identity::new(&scene, &options());
    let stop = Stop {
        every_wave: true,
        ..Stop::after(u64::MAX)
    };
    let (reference, last) =
        render_task(&world, &options(), Task::default(), &stop).expect("a picture");
    let kept = stop.kept();
    assert!(kept.len() > 10);
    assert!(kept.iter().any(|snapshot| snapshot.finished()[0] > 0));
    for snapshot in kept.into_iter().step_by(3).chain([last]) {
        let resume = Some(stored(&snapshot, &identity));
        let task = Task {
            resume,
            ..Task::default()
        };
        let (rendering, last) = render_task(&world, &options(), task, &()).expect("a picture");
        assert_equal(&rendering, &reference, "one of many");
        assert!(last.is_complete());
        // Nothing of what was kept is traced again but samples of the pre-pass.
        let [closest, _] = last.rays();
        assert!(closest >= reference.stats.closest_rays);
        assert!(closest < reference.stats.closest_rays * 4 / 3);
    }
}

/// A part that was interrupted in its first tile; `None` if it has no tile.
fn begun(world: &World, shard: Shard) -> Option<Snapshot> {
    let options = Options {
        threads: NonZeroUsize::new(1),
        recipe: options().recipe.order(Order::Simple),
        ..options()
    };
    let task = Task {
        shard,
        ..Task::default()
    };
    // The monitor is called before each of the three batches of a tile.
    let stop = Stop::after(3);
    match render_task(world, &options, task, &stop) {
        Ok((_, empty)) => {
            assert_eq!(empty.finished(), [0, 0]);
            None
        }
        Err(_) => stop.kept().pop(),
    }
}

/// The parts of a picture; the one with a number as high as `interrupted` takes two runs.
fn parts(scene: &Scene, count: u32, interrupted: u32) -> Vec<(String, Identity, Snapshot)> {
    let world = World::new(scene).expect("a valid scene");
    let identity = Identity::new(scene, &options());
    (0..count)
        .map(|index| {
            let shard = Shard::new(index, count).expect("a shard");
            let mut task = Task {
                shard,
                ..Task::default()
            };
            if index == interrupted
                && let Some(last) = begun(&world, shard)
            {
                task.resume = Some(stored(&last, &identity));
            }
            let (_, snapshot) = render_task(&world, &options(), task, &()).expect("a part");
            assert!(snapshot.is_complete());
            let snapshot = stored(&snapshot, &identity);
            (format!("part {index}"), identity.clone(), snapshot)
        })
        .collect()
}

#[test]
fn parts_join_to_the_same_bits() {
    let scene = scene();
    let world = World::new(&scene).expect("a valid scene");
    let reference = render(&world, &options(), &()).expect("a picture");
    // 5 x 4 tiles, with the reach of the filter: more shards than that are empty.
    for count in [1, 2, 3, 7, 23] {
        let mut parts = parts(&scene, count, count / 2);
        parts.reverse();
        let whole = Snapshot::join(parts).expect("they fit");
        assert!(
            whole.image().expect("a picture") == reference.image,
            "{count}"
        );
        let errors = whole.standard_error().expect("a picture");
        assert!(errors == reference.standard_error, "{count}");
    }
}

#[test]
fn parts_that_do_not_make_one_picture_are_refused_by_name() {
    let scene = scene();
    let three = parts(&scene, 3, 9);
    let refused = |parts: Vec<_>| match Snapshot::join(parts) {
        Err(Error::Join { reason }) => reason,
        other => panic!("{other:?}"),
    };
    let reason = refused(three[..2].to_vec());
    assert_eq!(reason, "parts are missing: 2/3");
    let reason = refused([&three[..], &three[1..2]].concat());
    assert!(reason.contains("both part 1/3"), "{reason}");
    assert!(refused(Vec::new()).contains("no parts"));

    let other = parts(&scene, 2, 9);
    let reason = refused([&three[..2], &other[1..]].concat());
    assert!(
        reason.contains("part 1 does not go with part 0"),
        "{reason}"
    );
    let mut foreign = three.clone();
    let changed = Options {
        seed: 4,
        ..options()
    };
    foreign[2].1 = Identity::new(&scene, &changed);
    let reason = refused(foreign);
    assert!(
        reason.contains("part 2") && reason.contains("seed 4, not 0"),
        "{reason}"
    );

    let world = World::new(&scene).expect("a valid scene");
    let mut unfinished = three.clone();
    let shard = Shard::new(2, 3).expect("a shard");
    unfinished[2].2 = begun(&world, shard).expect("a snapshot");
    let reason = refused(unfinished);
    assert!(reason.contains("part 2 is not complete"), "{reason}");
}

#[test]
fn identities_name_what_differs() {
    let scene = scene();
    let identity = Identity::new(&scene, &options());
    assert_eq!(Identity::new(&scene.clone(), &options()), identity);
    let differs = |change: &dyn Fn(&mut Scene, &mut Options), word: &str| {
        let (mut scene, mut options) = (scene.clone(), options());
        change(&mut scene, &mut options);
        let reason = Identity::new(&scene, &options).difference(&identity);
        let reason = reason.expect("a difference");
        assert!(reason.contains(word), "{reason}");
    };
    differs(&|_, o| o.spp = Some(8), "samples per pixel 8, not 40");
    differs(&|_, o| o.seed = 1, "seed");
    differs(&|_, o| o.standard_error = false, "standard errors");
    differs(&|s, _| s.name = "other".into(), "scene other");
    differs(&|s, _| s.film.resolution = [8, 8], "resolution 8x8");
    differs(
        &|s, _| s.film.crop_window = [0.0, 0.5, 0.0, 1.0],
        "pixel bounds",
    );
    let inside = "what is in scene";
    differs(&|s, _| s.film.scale = 2.0, inside);
    differs(&|s, _| s.camera = look(Vec3::ONE, Vec3::ZERO, 45.0), inside);
    differs(&|s, _| s.materials[0] = matte(0.71), inside);
    differs(&|s, _| s.lights.push(sky(0.1)), inside);
    differs(&|s, _| s.shapes[1].reverse_orientation = true, inside);
    differs(
        &|s, _| {
            let Geometry::Mesh(mesh) = &mut s.shapes[0].geometry else {
                panic!("a mesh");
            };
            let position = &mut std::sync::Arc::make_mut(mesh).positions[3][1];
            *position = position.next_up();
        },
        inside,
    );

    // Options that change no bit of the picture make no difference.
    let mut same = options();
    (same.recipe.order, same.recipe.engine) = (Order::Sato, Engine::best(Width::W4));
    (same.threads, same.recipe.collapse) = (None, Collapse::Area);
    assert_eq!(Identity::new(&scene, &same).difference(&identity), None);
}

/// Monitor that keeps the training rays.
#[derive(Default)]
struct Student(Mutex<Option<Lesson>>);

impl Monitor for Student {
    fn learned(&self, lesson: &Lesson) {
        let before = self.0.lock().expect("no panic").replace(lesson.clone());
        assert!(before.is_none(), "told twice");
    }
}

#[test]
fn what_was_learned_can_be_learned_again_anywhere() {
    let scene = scene();
    let world = World::new(&scene).expect("a valid scene");
    for collapse in [Collapse::default(), Collapse::Area] {
        let options = Options {
            recipe: options().recipe.collapse(collapse),
            ..options()
        };
        let student = Student::default();
        let reference = render(&world, &options, &student).expect("a picture");
        let lesson = student.0.into_inner().expect("no panic").expect("a lesson");
        // Few enough shadow rays are all training rays.
        assert_eq!(lesson.rays().len() as u64, reference.stats.logged_rays);
        let bytes = bytes_of(|file| lesson.write(&Place::new(&scene), file));
        let (place, lesson) = Lesson::from_bytes(&bytes).expect("it can be read");

        // Equal trees from the training rays: equal costs are predicted, without a pre-pass.
        let student = Student::default();
        let task = Task {
            lesson: Some(lesson.clone()),
            ..Task::default()
        };
        let (again, _) = render_task(&world, &options, task, &student).expect("a picture");
        assert_equal(&again, &reference, "the same lesson");
        assert_eq!(again.stats.logged_rays, reference.stats.logged_rays);
        assert_eq!(
            again.stats.predicted_cost_after,
            reference.stats.predicted_cost_after
        );
        assert_eq!(student.0.into_inner().expect("no panic"), Some(lesson));

        // Training rays belong to the geometry, whatever else there is.
        let mut other = scene.clone();
        other.camera = look(Vec3::ONE, Vec3::ZERO, 60.0);
        other.lights.push(Light::Point {
            position: Vec3::ONE,
            intensity: Rgb::ONE,
        });
        assert_eq!(place.difference(&Place::new(&other)), None);
        add(&mut other, sphere(Vec3::ZERO, 0.1), matte(0.1));
        assert!(place.difference(&Place::new(&other)).is_some());
    }
}

#[test]
fn damaged_files_are_refused() {
    let mut scene = scene();
    scene.film.resolution = [8, 8];
    let options = Options {
        spp: Some(2),
        ..options()
    };
    let world = World::new(&scene).expect("a valid scene");
    let (_, snapshot) = render_task(&world, &options, Task::default(), &()).expect("a picture");
    let identity = Identity::new(&scene, &options);
    let bytes = bytes_of(|file| snapshot.write(&identity, file));
    for length in (0..bytes.len())
        .step_by(7)
        .chain(bytes.len() - 40..bytes.len())
    {
        let outcome = Snapshot::from_bytes(&bytes[..length]);
        let refused = matches!(outcome, Err(Error::NotAnArchive | Error::DamagedArchive));
        assert!(refused, "{length} bytes");
    }
    for position in (0..bytes.len()).step_by(5).chain(0..64) {
        let mut bytes = bytes.clone();
        bytes[position] ^= 1 << (position % 8);
        assert!(Snapshot::from_bytes(&bytes).is_err(), "byte {position}");
    }
    let mut longer = bytes.clone();
    longer.push(0);
    assert!(Snapshot::from_bytes(&longer).is_err());
    let newer = Snapshot::from_bytes(&[&bytes[..8], &[9, 0, 0, 0], &bytes[12..]].concat());
    assert!(matches!(newer, Err(Error::ArchiveFormat { found: 9, .. })));
    let lesson = bytes_of(|file| Lesson::default().write(&Place::new(&scene), file));
    assert!(matches!(
        Snapshot::from_bytes(&lesson),
        Err(Error::ArchiveKind { .. })
    ));
    assert!(Lesson::from_bytes(&bytes).is_err());
}

#[test]
fn a_snapshot_of_something_else_is_refused() {
    let scene = scene();
    let world = World::new(&scene).expect("a valid scene");
    let (_, snapshot) = render_task(&world, &options(), Task::default(), &()).expect("a picture");
    let resume = |options: &Options, shard: Shard| {
        let task = Task {
            shard,
            resume: Some(snapshot.clone()),
            ..Task::default()
        };
        render_task(&world, options, task, &())
    };
    assert!(resume(&options(), Shard::WHOLE).is_ok());
    let refused = |outcome| {
        matches!(
            outcome,
            Err::<(Rendering, Snapshot), _>(Error::OtherSnapshot)
        )
    };
    let shard = Shard::new(0, 2).expect("a shard");
    assert!(refused(resume(&options(), shard)));
    for change in [
        |o: &mut Options| o.spp = Some(41),
        |o: &mut Options| o.standard_error = false,
        |o: &mut Options| o.cost_map = true,
    ] {
        let mut options = options();
        change(&mut options);
        assert!(refused(resume(&options, Shard::WHOLE)));
    }
}
