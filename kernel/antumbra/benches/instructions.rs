//! Work for `bench/instructions`, which counts the instructions of it: see there. Prints one line per count, in
//! the order in which the counts come: a name, and by how many rays to divide.

mod cases;

use std::hint::black_box;

use antumbra::Isa;
use antumbra::recipe::{Engine, Level};

use cases::{Scene, Work};

/// Where one count ends and the next begins: every call of this function, found by its name.
#[inline(never)]
fn counts_begin_anew() {
    black_box(());
}

type Kind = (&'static str, fn(&mut Work<'_>) -> usize);

const KINDS: [Kind; 5] = [
    ("missed", |work| work.missed()),
    ("batch/occluded", |work| work.batch_occluded()),
    ("batch/intersect", |work| work.batch_intersect()),
    ("single/occluded", |work| work.single_occluded()),
    ("single/intersect", |work| work.single_intersect()),
];

fn main() {
    // Valgrind knows no AVX-512, and the counts of a machine with it must be those of one without.
    for isa in Isa::available().filter(|isa| isa.level() != Level::Avx512) {
        let engine = Engine::of(isa);
        let case = format!("{}-{}", isa.level(), engine.width());
        let scene = Scene::new(engine);
        let mut work = Work::new(&scene);
        for (name, kind) in KINDS {
            counts_begin_anew();
            let rays = kind(&mut work);
            counts_begin_anew();
            println!("{case}/{name} {rays}");
        }
    }
}
