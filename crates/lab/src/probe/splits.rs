//! Spatial splits for occlusion alone: trees whose primitives may lie in several leaves, beside those of other builders.
//! Collapses are learned, and all trees are in the order `joint`.

use antumbra::{Builder, Bvh, Collapse, Order};
use antumbra_render::{RaysFrom, TrainedTree};

use super::row::{Row, counted};
use super::turns::in_turns;
use super::{Part, Subject, check_equal};
use crate::Error;
use crate::study::Kind;

/// Builders that are compared. The first is what speeds are relative to.
const BUILDERS: [Builder; 3] = [Builder::Reinsertion, Builder::BinnedSah, Builder::Sbvh];

/// Everything about spatial splits on one scene.
pub fn probe(subject: &Subject<'_>) -> Result<Vec<Row>, Error> {
    let mut rows = Vec::new();
    for kind in Kind::ALL {
        let (train, test) = (subject.lots.train(kind), subject.lots.test(kind));
        if test.is_empty() {
            continue;
        }
        let recipe = subject.recipe.collapse(Collapse::Learned);
        let mut trees: Vec<Bvh> = Vec::new();
        for builder in BUILDERS {
            let recipe = recipe.builder(builder);
            let trained = TrainedTree::new(subject.world, &recipe, train, RaysFrom::Both);
            trees.push(trained.collapse(&recipe).order(Order::Joint)?.bvh);
        }
        let mut found = Vec::new();
        let mut expected = None;
        for (builder, bvh) in BUILDERS.into_iter().zip(&trees) {
            let (answers, costs) = counted(bvh, test);
            let expected = expected.get_or_insert_with(|| answers.clone());
            check_equal(&subject.scene.name, builder.name(), &answers, expected)?;
            let mut row = Row::new(subject, Part::Splits, kind, "joint");
            row.count(&costs, &answers, f64::from(recipe.costs.prim));
            row.tree = builder.name();
            row.collapse = recipe.collapse.name();
            row.bytes = Some(bvh.build_report().bytes);
            found.push(row);
        }
        if subject.options.rounds > 0 {
            for batch in [true, false] {
                let mut works: Vec<Box<dyn FnMut() + '_>> = Vec::new();
                for bvh in &trees {
                    let mut answers = vec![false; test.len()];
                    works.push(Box::new(move || {
                        if batch {
                            bvh.batch(test).on_this_thread().occluded(&mut answers);
                        } else {
                            for (ray, answer) in test.iter().zip(&mut answers) {
                                *answer = bvh.occluded(ray);
                            }
                        }
                    }));
                }
                let speeds = in_turns(subject.options.rounds, &mut works);
                for (row, speed) in found.iter_mut().zip(speeds) {
                    row.time(speed, batch);
                }
            }
        }
        rows.extend(found);
    }
    Ok(rows)
}
