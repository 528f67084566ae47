//! Digest of everything that the kernel answers, counts and saves, a case per line: the same before and after a change
//! that should change nothing.
//!
//! `cargo build -p antumbra-cli -p antumbra-digest` builds it beside the program, of the same kernel; by itself it would get a
//! kernel of its own, compiled once more for other features of a dependency.
//!
//! Names of cases stay when the interface of the kernel changes. Then only `ask` (queries), `trees` (builds, counts, files)
//! and `scenes` (geometry) follow.
//!
//! | row | value |
//! |---|---|
//! | `level NAME` | whether this machine has it |
//! | `who SCENE QUERY CONDITION` | hash of hit or not, and of ids |
//! | `where SCENE QUERY CONDITION` | hash of distances, coordinates, positions and normals |
//! | `first SCENE wWIDTH LEVEL` | hash of the occluders that are found first, which depend on the tree |
//! | `counts SCENE RECIPE wWIDTH LEVEL occluded` | node and primitive tests, and the predicted cost |
//! | `saved SCENE RECIPE wWIDTH` | hash and length of the bytes, and figures of the tree |
//! | `order`, `collapse`, `builder SCENE NAME wWIDTH` | the same of every entry of the lists, and what they count |
//!
//! Answers are promised to be the same for every tree, level and call. Each is tried; where one disagrees with the
//! first, it has a row of its own, whose name goes on with the tree, the level and the way.

mod ask;
mod scenes;
mod trees;

use antumbra_trees::engine;
use std::collections::BTreeMap;

use antumbra::{Bvh, Isa, Width};
use antumbra_testkit::Rng;
use ask::{Answer, CONDITIONS, Questions};
use clap::Parser;
use rayon::prelude::*;
use scenes::{Moving, STILL, Scene};

/// Scenes small enough for every order, collapse and builder.
const ALL_CHOICES: [&str; 3] = ["instances", "quads", "mixed"];

/// Prints a digest of everything that the kernel answers, counts and saves.
#[derive(Parser)]
struct Args {
    /// Only a part of the same rows, in less time: each tree at one level, and few of the orders and builders
    #[arg(long)]
    short: bool,
    /// Only rows whose names begin like this
    #[arg(long, value_name = "PREFIX", default_value = "")]
    only: String,
}

impl Args {
    /// Whether a kind of rows of a scene is wanted.
    fn wants(&self, kind: &str, scene: &str) -> bool {
        let name = format!("{kind} {scene} ");
        name.starts_with(&self.only) || self.only.starts_with(&name)
    }

    /// Levels that a tree is queried at: in short, one for each tree in turn.
    fn levels(&self, turn: usize) -> Vec<Isa> {
        let all: Vec<_> = trees::levels().filter_map(|(_, isa)| isa).collect();
        match self.short {
            true => vec![all[turn % all.len()]],
            false => all,
        }
    }
}

fn main() {
    let args = Args::parse();
    let parts: Vec<Vec<String>> = (0..=STILL.len())
        .into_par_iter()
        .map(|place| match STILL.get(place) {
            Some((name, generate)) => still(&args, name, &generate(&mut Rng::new(place as u64))),
            None => moving(&args, &scenes::moving()),
        })
        .collect();
    let levels = trees::levels().map(|(level, isa)| match isa {
        Some(_) => format!("level {level} run"),
        None => format!("level {level} not run"),
    });
    for row in levels.chain(parts.into_iter().flatten()) {
        if row.starts_with(&args.only) {
            println!("{row}");
        }
    }
}

/// Rows of a scene in which nothing moves.
fn still(args: &Args, name: &str, scene: &Scene) -> Vec<String> {
    let kinds = [
        "who", "where", "first", "counts", "saved", "order", "collapse", "builder",
    ];
    if !kinds.iter().any(|kind| args.wants(kind, name)) {
        return Vec::new();
    }
    let (mut rows, mut answers) = (Vec::new(), Answers::default());
    let primitives = trees::primitives(scene);
    let training = trees::training(&scene.rays);
    let presets = trees::by_presets(&primitives, &training);
    let questions = Questions::new(&presets[0].2, &scene.rays, &scene.points);
    for (turn, (recipe, width, bvh)) in presets.iter().enumerate() {
        let tree = format!("{recipe} w{width}");
        rows.push(format!("saved {name} {tree} {}", trees::saved(bvh)));
        let counted = |bvh: &Bvh| trees::counted(bvh, &scene.rays);
        let of_counts = [&*format!("counts {name} {tree}"), " occluded"];
        rows.extend(at_levels(args, turn, bvh, of_counts, counted));
        if *recipe != "default" {
            let times = if args.short { 1 } else { 12 };
            answers.add(&tree, questions.briefly(bvh, times));
            continue;
        }
        let first = |bvh: &Bvh| questions.first_occluders(bvh);
        let of_first = [&*format!("first {name} w{width}"), ""];
        rows.extend(at_levels(args, turn, bvh, of_first, first));
        for (what, bytes) in trees::changed(scene, *width, bvh.clone()) {
            let saved = trees::hashed(&bytes);
            rows.push(format!("saved {name} {what} w{width} {saved}"));
        }
        // In short, conditions one by one in trees of one width only.
        let conditions = match args.short && *width != Width::W8 {
            true => &["all"],
            false => &CONDITIONS[..],
        };
        if args.wants("who", name) || args.wants("where", name) {
            for (kind, mut bvh) in trees::masked(scene, *width, bvh.clone()) {
                for isa in args.levels(turn) {
                    engine(isa, bvh.width()).run(&mut bvh).expect("its width");
                    let tree = format!("{kind} w{width} {}", isa.level());
                    answers.add(&tree, questions.all(&bvh, conditions));
                }
            }
        }
    }
    if ALL_CHOICES.contains(&name) && (!args.short || name == ALL_CHOICES[0]) {
        for (choice, tree, bvh) in trees::by_choices(&primitives, &training) {
            let [saved, counted] = [trees::saved(&bvh), trees::counted(&bvh, &scene.rays)];
            rows.push(format!("{choice} {name} {tree} {saved} tests {counted}"));
            answers.add(&format!("{choice} {tree}"), questions.briefly(&bvh, 1));
        }
    }
    rows.extend(answers.rows(name));
    rows
}

/// Rows of the scene that moves.
fn moving(args: &Args, moving: &Moving) -> Vec<String> {
    let (mut rows, mut answers) = (Vec::new(), Answers::default());
    if !["who", "where", "saved"]
        .iter()
        .any(|kind| args.wants(kind, "moving"))
    {
        return rows;
    }
    for (turn, width) in Width::ALL.into_iter().enumerate() {
        let (wholes, spans) = trees::moving(moving, width);
        for (span, bvh) in spans.iter().enumerate() {
            rows.push(format!(
                "saved moving span-{span} w{width} {}",
                trees::saved(bvh)
            ));
        }
        for (kind, mut bvh) in wholes {
            for isa in args.levels(turn) {
                engine(isa, bvh.width()).run(&mut bvh).expect("its width");
                answers.add(
                    &format!("{kind} w{width} {}", isa.level()),
                    ask::at_times(&bvh, moving),
                );
            }
        }
    }
    rows.extend(answers.rows("moving"));
    rows
}

/// A row for each level, whose name has the level between two parts.
fn at_levels(
    args: &Args,
    turn: usize,
    bvh: &Bvh,
    [start, end]: [&str; 2],
    figure: impl Fn(&Bvh) -> String,
) -> Vec<String> {
    let (wanted, mut bvh) = (args.levels(turn), bvh.clone());
    let row = |(level, isa): (&str, Option<Isa>)| match isa {
        None => Some(format!("{start} {level}{end} not run")),
        Some(isa) if wanted.contains(&isa) => {
            engine(isa, bvh.width()).run(&mut bvh).expect("its width");
            Some(format!("{start} {level}{end} {}", figure(&bvh)))
        }
        Some(_) => None,
    };
    trees::levels().filter_map(row).collect()
}

/// Answers by query and condition, each with the tree that gave it.
#[derive(Default)]
struct Answers(BTreeMap<[&'static str; 2], Vec<(String, Answer)>>);

impl Answers {
    fn add(&mut self, tree: &str, answers: Vec<Answer>) {
        for answer in answers {
            let all = self.0.entry([answer.query, answer.condition]);
            all.or_default().push((tree.to_owned(), answer));
        }
    }

    /// A row for the first answer, and for each that differs from it.
    fn rows(&self, scene: &str) -> Vec<String> {
        let mut rows = Vec::new();
        for ([query, condition], all) in &self.0 {
            let who: fn(&Answer) -> Option<u64> = |answer| Some(answer.who);
            for (kind, of) in [("who", who), ("where", |answer| answer.place)] {
                let Some(first) = of(&all[0].1) else { continue };
                let name = format!("{kind} {scene} {query} {condition}");
                rows.push(format!("{name} {first:016x}"));
                for (tree, answer) in all {
                    if let Some(hash) = of(answer).filter(|hash| *hash != first) {
                        rows.push(format!("{name} {tree} {} {hash:016x}", answer.way));
                    }
                }
            }
        }
        rows
    }
}
