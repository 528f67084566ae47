//! Builds that are watched, and stopped.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use crate::support::{bits, geometry, kernel_rays};
use antumbra::recipe::Preset;
use antumbra::{Build, BuildMonitor, Bvh, Error, Recipe};
use antumbra_testkit::{Rng, mesh, rays};

/// Stops a build when it has asked so often.
struct Patient {
    asked: AtomicUsize,
    most: usize,
    heard: Mutex<Vec<f32>>,
}

impl Patient {
    fn new(most: usize) -> Self {
        Self {
            asked: AtomicUsize::new(0),
            most,
            heard: Mutex::default(),
        }
    }
}

impl BuildMonitor for Patient {
    fn progress(&self, done: f32) {
        self.heard.lock().expect("no panic").push(done);
    }

    fn cancelled(&self) -> bool {
        self.asked.fetch_add(1, Ordering::Relaxed) >= self.most
    }
}

/// Stops a build at one question, and takes it back at the next.
struct Once {
    asked: AtomicUsize,
    which: usize,
}

impl BuildMonitor for Once {
    fn cancelled(&self) -> bool {
        self.asked.fetch_add(1, Ordering::Relaxed) == self.which
    }
}

/// A build can be stopped wherever it asks, and one that is not stopped is what it always is.
#[test]
fn builds_stop_wherever_they_ask() {
    let mut rng = Rng::new(4001);
    let mesh = mesh::soup(&mut rng, 3000);
    let rays = kernel_rays(&rays::around(&mut rng, &mesh, 200));
    let list = [geometry(&mesh)];
    for preset in Preset::ALL {
        let recipe = preset.recipe();
        let patient = Patient::new(usize::MAX);
        let built = Build::new(&list)
            .rays(&rays)
            .recipe(&recipe)
            .monitor(&patient)
            .bvh()
            .expect("not stopped");
        let expected = Bvh::learn(&list, &rays, &recipe).expect("in range");
        assert_eq!(built.report(), expected.report(), "{preset}");
        for ray in &rays {
            let hits = [&built, &expected].map(|bvh| bits(bvh.intersect(ray)));
            assert_eq!(hits[0], hits[1], "{preset} {ray:?}");
        }
        let heard = patient.heard.into_inner().expect("no panic");
        assert!(heard.is_sorted(), "{heard:?}");
        assert_eq!(heard.last(), Some(&1.0));

        let asked = patient.asked.into_inner();
        assert!(asked >= 4, "{preset} asks {asked} times");
        for most in 0..asked {
            let stopped = Build::new(&list)
                .rays(&rays)
                .recipe(&recipe)
                .monitor(&Patient::new(most))
                .bvh();
            assert_eq!(stopped.err(), Some(Error::Cancelled), "{preset} {most}");
        }
    }
    // Once stopped, always stopped: what was left undone does not become a tree.
    let recipe = Recipe::default();
    for which in 0..12 {
        let monitor = Once {
            asked: AtomicUsize::new(0),
            which,
        };
        let stopped = Build::new(&list).recipe(&recipe).monitor(&monitor).bvh();
        assert_eq!(stopped.err(), Some(Error::Cancelled), "question {which}");
        let stage = Build::new(&list).stage().expect("not stopped");
        monitor.asked.store(0, Ordering::Relaxed);
        let stopped = stage.learn(&rays, &recipe, &monitor);
        assert_eq!(stopped.err(), Some(Error::Cancelled), "question {which}");
        let learned = stage.learn(&[], &recipe, &()).expect("not stopped");
        let expected = Bvh::build(&list, &recipe).expect("in range");
        assert_eq!(
            learned.report(),
            expected.report(),
            "a log that was stopped is not kept"
        );
    }
    let stop = AtomicBool::new(true);
    let stopped = Build::new(&list)
        .rays(&rays)
        .recipe(&Recipe::default())
        .monitor(&stop)
        .bvh();
    assert_eq!(stopped.err(), Some(Error::Cancelled));
}
