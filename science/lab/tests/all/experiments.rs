//! Experiments called as a library: what they return, what they write, and how a watcher stops them.

use std::fs;
use std::io;
use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use antumbra::recipe::{Collapse, Order};
use antumbra_lab::bench::{self, Options};
use antumbra_lab::study::{self, By, Plan};
use antumbra_lab::{Error, Step, Table, Watcher, Work};
use antumbra_render::Monitor;
use antumbra_scene::{Scene, builtin};

fn city(name: &str) -> Scene {
    let mut scene = builtin::by_name("city:1500").expect("a scene");
    scene.name = name.to_owned();
    scene.film.resolution = [24, 16];
    scene
}

fn plan(out: Option<&Path>) -> Plan {
    Plan {
        scenes: study::subjects(vec![city("a b"), city("a-b")], None).expect("no camera to refuse"),
        orders: vec![Order::Simple, Order::Joint],
        spp: Some(1),
        replay: 200,
        out: out.map(Path::to_path_buf),
        ..Plan::default()
    }
}

/// Counts what is announced and finished, and stops after so many pieces of work.
#[derive(Default)]
struct Counter {
    expected: AtomicUsize,
    finished: AtomicUsize,
    /// Finished now or before.
    announced_finished: AtomicUsize,
    continued: AtomicUsize,
    tables: AtomicUsize,
    stop_after: Option<usize>,
}

impl Monitor for Counter {
    fn cancelled(&self) -> bool {
        let finished = self.finished.load(Ordering::Relaxed);
        self.stop_after.is_some_and(|most| finished >= most)
    }
}

impl Watcher for Counter {
    fn expect(&self, left: &[Work]) {
        assert!(left.iter().all(|work| work.weight > 0.0));
        let left: usize = left.iter().map(|work| work.count).sum();
        let finished = self.announced_finished.load(Ordering::Relaxed);
        self.expected.store(finished + left, Ordering::Relaxed);
    }

    fn finished(&self, _: Step, worked: bool) {
        self.announced_finished.fetch_add(1, Ordering::Relaxed);
        self.finished
            .fetch_add(usize::from(worked), Ordering::Relaxed);
    }

    fn continued(&self, found: usize) {
        self.continued.store(found, Ordering::Relaxed);
    }

    fn show(&self, tables: &[Table]) -> io::Result<()> {
        self.tables.fetch_add(tables.len(), Ordering::Relaxed);
        Ok(())
    }
}

#[test]
fn a_study_is_stopped_and_continued() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let plan = plan(Some(folder.path()));
    let stems: Vec<_> = plan.scenes.iter().map(|scene| &scene.stem).collect();
    assert_eq!(stems, ["a-b", "a-b-2"]);
    let early = Counter {
        stop_after: Some(3),
        ..Counter::default()
    };
    let results = study::run(&plan, &early).expect("some rows");
    assert!(!results.is_complete() && results.rows().count() > 0);
    assert!(results.journal().is_some_and(|path| path.is_file()));

    let rest = Counter::default();
    let results = study::run(&plan, &rest).expect("all rows");
    assert!(results.is_complete());
    assert_eq!(rest.continued.into_inner(), 3);
    assert_eq!(results.rows().filter(|row| row.by == By::Render).count(), 4);
    results.verdict().expect("equal images and answers");
    // By scene the renderings, and the replays of both kinds of rays.
    assert_eq!(results.tables().len(), 2 * 3);
    let report = results.write().expect("files");
    assert_eq!(report, Some(folder.path().join("report.html")));
    for name in ["report.html", "report.md", "results.json", "results.csv"] {
        assert!(folder.path().join(name).is_file(), "{name}");
    }

    let mut other = plan.clone();
    other.seed = 1;
    let refused = study::run(&other, &()).err().expect("another study");
    assert!(matches!(&refused, Error::OtherStudy { reason, .. } if reason.contains("--seed 1")));
}

#[test]
fn a_watcher_that_stops_at_once_leaves_nothing() {
    let stopped = Counter {
        stop_after: Some(0),
        ..Counter::default()
    };
    let plan = plan(None);
    let end = study::run(&plan, &stopped);
    assert!(matches!(end.err(), Some(Error::Interrupted)));
    let end = bench::run(vec![city("city")], &Options::default(), &stopped);
    assert!(matches!(end.err(), Some(Error::Interrupted)));
}

#[test]
fn a_benchmark_returns_rows_and_writes_files() {
    let options = Options {
        rays: 200,
        log_rays: 100,
        orders: vec![Order::Simple, Order::Joint],
        collapses: vec![Collapse::Area],
        builds: vec![Default::default()],
        threads: vec![NonZeroUsize::new(1)],
        repeat: 1,
        ..Options::default()
    };
    let watcher = Counter::default();
    let results = bench::run(vec![city("city")], &options, &watcher).expect("rows");
    assert!(watcher.tables.into_inner() > 0);
    let document = results.document();
    assert!(document.complete && document.embree.is_none());
    // Kinds of rays, queries, interfaces and orders.
    assert_eq!(document.rows.len(), 3 * 2 * 2 * 2);
    assert!(document.rows.iter().all(|row| row.disagreements == 0));
    let folder = tempfile::tempdir().expect("a temporary folder");
    results.write(folder.path()).expect("files");
    for name in ["bench.json", "bench.md", "bench.svg"] {
        assert!(folder.path().join(name).is_file(), "{name}");
    }
    let text = fs::read_to_string(folder.path().join("bench.md")).expect("a report");
    assert!(
        text.contains("area joint") && text.contains("## Building"),
        "{text}"
    );
    results.end().expect("right answers");
}
