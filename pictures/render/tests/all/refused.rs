//! Renderings that are refused or stopped: invalid scenes and options, and monitors that cancel.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::support::heap::{heap, options};
use antumbra_render::{Error, Monitor, Options, Phase, World, render};
use antumbra_scene::{Filter, Geometry, Instance, Scene, TriangleMesh};
use glam::{Affine3, Vec3};

#[test]
fn what_cannot_be_rendered_is_refused() {
    let refused = |change: &dyn Fn(&mut Scene)| {
        let mut scene = heap(12);
        change(&mut scene);
        World::new(&scene).expect_err("refused")
    };
    assert!(matches!(
        refused(&|s| s.shapes[0].material = 99),
        Error::Material { material: 99, .. }
    ));
    assert!(matches!(
        refused(&|s| s.film.resolution = [0, 4]),
        Error::EmptyPicture { .. }
    ));
    assert!(matches!(
        refused(&|s| s.film.crop_window = [0.5, 0.5, 0.0, 1.0]),
        Error::EmptyPicture { .. }
    ));
    assert!(matches!(
        refused(&|s| s.film.filter = Filter::Box { radius: [0.0, 1.0] }),
        Error::FilterRadius { .. }
    ));
    assert!(matches!(
        refused(&|s| s.sampler.pixel_samples = 0),
        Error::NoSamples { .. }
    ));
    assert!(matches!(
        refused(&|s| s.camera.fov = 180.0),
        Error::FieldOfView { .. }
    ));
    assert!(matches!(
        refused(&|s| s.instances.push(Instance {
            object: 3,
            world_from_object: Affine3::IDENTITY,
            end: None,
        })),
        Error::Geometry(antumbra::Error::ObjectOutOfRange { object: 3, .. })
    ));
    let mesh = |indices, normals| TriangleMesh {
        positions: vec![[0.0; 3]; 3],
        indices: vec![indices],
        normals,
        ..TriangleMesh::default()
    };
    let normals = mesh([0, 1, 2], vec![Vec3::Z]);
    assert!(matches!(
        refused(&|s| s.shapes[0].geometry = Geometry::Mesh(Arc::new(normals.clone()))),
        Error::VertexAttribute {
            found: 1,
            positions: 3,
            ..
        }
    ));
    let index = mesh([0, 1, 7], Vec::new());
    assert!(matches!(
        refused(&|s| s.shapes[0].geometry = Geometry::Mesh(Arc::new(index.clone()))),
        Error::Geometry(_)
    ));
    let world = World::new(&heap(12)).expect("a valid scene");
    let error = |options: Options| render(&world, &options, &()).expect_err("refused");
    assert!(matches!(
        error(Options {
            spp: Some(0),
            ..options()
        }),
        Error::NoSamples { .. }
    ));
    let log_share = f64::NAN;
    assert!(matches!(
        error(Options {
            log_share,
            ..options()
        }),
        Error::LogShare { .. }
    ));
}

/// Stops when the picture is done.
#[derive(Default)]
struct TooLate(AtomicBool);

impl Monitor for TooLate {
    fn progress(&self, phase: Phase, done: u64, total: u64) {
        self.0
            .fetch_or(phase == Phase::Render && done == total, Ordering::Relaxed);
    }

    fn cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

#[test]
fn whoever_stops_after_the_last_tile_gets_the_picture() {
    let world = World::new(&heap(15)).expect("a valid scene");
    let monitor = TooLate::default();
    let late = render(&world, &options(), &monitor).expect("nothing was left to do");
    assert!(monitor.cancelled());
    let reference = render(&world, &options(), &()).expect("nothing stops it");
    assert_eq!(late.image, reference.image);
}

/// Counts progress and stops after so many questions.
struct Patience {
    left: AtomicU64,
    steps: AtomicU64,
}

impl Monitor for Patience {
    fn progress(&self, phase: Phase, done: u64, total: u64) {
        assert!(done <= total, "{phase:?}");
        self.steps.fetch_add(1, Ordering::Relaxed);
    }

    fn cancelled(&self) -> bool {
        self.left
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| {
                left.checked_sub(1)
            })
            .is_err()
    }
}

#[test]
fn a_monitor_can_stop_the_tree_of_a_world() {
    let scene = heap(13);
    let build = |stopped: bool| {
        World::with_builder_monitored(&scene, Default::default(), &AtomicBool::new(stopped))
    };
    assert!(matches!(build(true), Err(Error::Cancelled)));
    assert!(build(false).is_ok());
}

#[test]
fn a_monitor_can_stop_a_rendering_at_any_time() {
    let world = World::new(&heap(13)).expect("a valid scene");
    for left in [0, 1, 2, 5] {
        let monitor = Patience {
            left: left.into(),
            steps: 0.into(),
        };
        let outcome = render(&world, &options(), &monitor);
        assert!(matches!(outcome, Err(Error::Cancelled)), "after {left}");
    }
    let monitor = Patience {
        left: u64::MAX.into(),
        steps: 0.into(),
    };
    render(&world, &options(), &monitor).expect("never stopped");
    assert!(monitor.steps.load(Ordering::Relaxed) > 6);
}
