//! Time per step and per ray, for every width on every instruction set that this CPU has:
//! `cargo bench -p antumbra --features steps --bench steps`. The column to read is the throughput, in steps or
//! rays per second. Append `-- leaf` for those with "leaf" in their names.

mod cases;

use antumbra::{Isa, Width};
use divan::Bencher;
use divan::counter::ItemsCount;

use cases::{Case, Scene, Work};

fn main() {
    divan::main();
}

/// Every width on every level; the natural one of a level is not always the fastest.
fn all() -> impl Iterator<Item = Case> {
    Isa::available().flat_map(|isa| Width::ALL.map(|width| Case { isa, width }))
}

fn measure(bencher: Bencher, case: Case, kind: fn(&mut Work<'_>) -> usize) {
    let scene = Scene::new(case);
    let mut work = Work::new(&scene);
    let count = kind(&mut work);
    bencher
        .counter(ItemsCount::new(count))
        .bench_local(|| kind(&mut work));
}

macro_rules! benches {
    ($($kind:ident)*) => {$(
        #[divan::bench(args = all())]
        fn $kind(bencher: Bencher, case: Case) {
            measure(bencher, case, |work| work.$kind());
        }
    )*};
}
benches! {
    set_up
    node_occluded node_intersect
    leaf_occluded leaf_intersect
    missed
    batch_occluded batch_intersect
    single_occluded single_intersect
}
