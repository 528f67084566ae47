//! Lifted occluders: the triangles that together occlude the most training rays, tested before the root or put at the
//! top of the binary tree. All trees are in the order `joint`.

use antumbra::lab::{Cost, DuplicatesBvh, FrequentOccluders, Laboratory, LiftedFirstBvh};
use antumbra::{Bvh, Order, Ray, Recipe};
use antumbra_render::{RaysFrom, TrainedTree};

use super::row::{Row, counted};
use super::turns::{ask, time_both};
use super::{BATCH, Part, Subject, check_equal};
use crate::Error;
use crate::study::Kind;

/// Numbers of lifted triangles.
const COUNTS: [usize; 2] = [8, 16];

/// Everything about lifted occluders on one scene.
pub fn probe(subject: &Subject<'_>) -> Result<Vec<Row>, Error> {
    subject.on_all_trees(|kind, recipe| on_tree(subject, kind, recipe))
}

/// A tree that is compared.
struct Variant {
    technique: String,
    /// Answers all rays, or those that lifted occluders leave over.
    bvh: Bvh,
    /// What tests lifted occluders first, and how many these are.
    first: Option<(LiftedFirstBvh, usize)>,
    /// Leaves that were moved or have another reference.
    references: Option<usize>,
}

impl Variant {
    fn new(technique: impl Into<String>, bvh: Bvh) -> Self {
        Self {
            technique: technique.into(),
            bvh,
            first: None,
            references: None,
        }
    }

    /// Asks about rays in batches or one by one, on this thread.
    fn ask(&self, rays: &[Ray], batch: bool, answers: &mut [bool]) {
        if batch {
            for (rays, answers) in rays.chunks(BATCH).zip(answers.chunks_mut(BATCH)) {
                match &self.first {
                    Some((lifted, _)) => lifted.occluded_batch(rays, answers),
                    None => self.bvh.batch(rays).on_this_thread().occluded(answers),
                }
            }
            return;
        }
        let Some((lifted, _)) = &self.first else {
            return ask(&self.bvh, rays, false, answers);
        };
        for (ray, answer) in rays.iter().zip(answers) {
            *answer = lifted.occluded(ray);
        }
    }
}

fn on_tree(subject: &Subject<'_>, kind: Kind, recipe: &Recipe) -> Result<Vec<Row>, Error> {
    let test = subject.lots.test(kind);
    let variants = variants(subject, kind, recipe)?;
    let mut rows = counts(subject, kind, &variants)?;
    let rounds = subject.options.rounds;
    time_both(rounds, &variants, test, &mut rows, Variant::ask);
    Ok(rows)
}

/// All trees that are compared. The first is what speeds are relative to.
fn variants(subject: &Subject<'_>, kind: Kind, recipe: &Recipe) -> Result<Vec<Variant>, Error> {
    let train = subject.lots.train(kind);
    let trained = subject.trained(kind, recipe);
    let joint = |trained: &TrainedTree<'_>| -> Result<Bvh, Error> {
        Ok(trained.collapse(recipe).order(Order::Joint)?.bvh)
    };
    let bvh = joint(&trained)?;
    let mut variants = vec![Variant::new("none", bvh.clone())];
    let duplicates = DuplicatesBvh::new(&bvh, train, &recipe.costs);
    variants.push(Variant {
        references: Some(duplicates.count()),
        ..Variant::new("leaves duplicated above", duplicates.bvh().clone())
    });
    let (moved, count) = bvh.with_leaves_moved_up(train, &recipe.costs);
    variants.push(Variant {
        references: Some(count),
        ..Variant::new("leaves moved up", moved)
    });
    for count in COUNTS {
        let occluders = FrequentOccluders::new(&bvh, train, count);
        let first = |technique: String, bvh: Bvh| Variant {
            first: Some((LiftedFirstBvh::new(&bvh, &occluders), occluders.len())),
            ..Variant::new(technique, bvh)
        };
        variants.push(first(format!("{count} before the root"), bvh.clone()));
        // A tree for the rays that lifted occluders leave over.
        let mut answers = vec![false; train.len()];
        LiftedFirstBvh::new(&bvh, &occluders).occluded_at_once(train, &mut answers);
        let rest: Vec<Ray> = (train.iter().zip(&answers))
            .filter(|(_, occluded)| !**occluded)
            .map(|(ray, _)| *ray)
            .collect();
        if !rest.is_empty() {
            let of_rest = TrainedTree::new(subject.world, recipe, &rest, RaysFrom::Both);
            let technique = format!("{count} before the root, tree of the rest");
            variants.push(first(technique, joint(&of_rest)?));
        }
        for (in_blocks, name) in [(true, "in blocks"), (false, "one by one")] {
            let bvh = joint(&trained.with_lifted(&occluders, in_blocks))?;
            variants.push(Variant::new(format!("{count} at the top, {name}"), bvh));
        }
    }
    Ok(variants)
}

/// Counts of all variants, with answers checked every way.
fn counts(subject: &Subject<'_>, kind: Kind, variants: &[Variant]) -> Result<Vec<Row>, Error> {
    let test = subject.lots.test(kind);
    let prim = f64::from(subject.recipe.costs.prim);
    let mut rows = Vec::new();
    let mut expected = None;
    for variant in variants {
        let mut row = Row::new(subject, Part::Lifted, kind, variant.technique.clone());
        let (mut answers, mut costs) = counted(&variant.bvh, test);
        row.references = variant.references;
        if let Some((lifted, count)) = &variant.first {
            let mut at_once = vec![false; test.len()];
            lifted.occluded_at_once(test, &mut at_once);
            for ((answer, cost), at_once) in answers.iter_mut().zip(&mut costs).zip(&at_once) {
                if *at_once {
                    *answer = true;
                    *cost = Cost::default();
                }
                cost.prim_tests += *count as u32;
            }
            let answered = at_once.iter().filter(|one| **one).count();
            row.answered_share = Some(answered as f64 / test.len() as f64);
        }
        let expected = expected.get_or_insert_with(|| answers.clone());
        let scene = &subject.scene.name;
        check_equal(scene, &variant.technique, &answers, expected)?;
        for batch in [true, false] {
            let mut found = vec![false; test.len()];
            variant.ask(test, batch, &mut found);
            check_equal(scene, &variant.technique, &found, expected)?;
        }
        row.count(&costs, &answers, prim);
        rows.push(row);
    }
    Ok(rows)
}
