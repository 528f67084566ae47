//! Spatial splits for occlusion only: trees whose primitives may be in several leaves, beside trees of other builders.
//! Collapses are learned, and all trees are in the order `joint`.

use antumbra::Bvh;
use antumbra::recipe::{Builder, Collapse, Order};

use super::row::Row;
use super::turns::{ask, time_both};
use super::{Part, Subject};
use crate::Error;
use crate::study::Kind;

/// Builders that are compared. The first is what speeds are relative to.
const BUILDERS: [Builder; 3] = [Builder::Reinsertion, Builder::BinnedSah, Builder::Sbvh];

/// Everything about spatial splits on one scene.
pub fn probe(subject: &Subject<'_>) -> Result<Vec<Row>, Error> {
    let mut rows = Vec::new();
    for kind in Kind::ALL {
        let test = subject.lots.test(kind);
        if test.is_empty() {
            continue;
        }
        let recipe = subject.recipe.collapse(Collapse::Learned);
        let mut trees: Vec<Bvh> = Vec::new();
        for builder in BUILDERS {
            let recipe = recipe.builder(builder);
            let trained = subject.trained(kind, &recipe);
            trees.push(trained.collapse(&recipe).order(Order::Joint)?.bvh);
        }
        let mut found = Vec::new();
        let mut expected = None;
        for (builder, bvh) in BUILDERS.into_iter().zip(&trees) {
            let row = Row::new(subject, Part::Splits, kind, "joint");
            let mut row = row.counted(bvh, test, recipe.costs.prim, &mut expected)?;
            row.tree = builder.name();
            row.collapse = recipe.collapse.name();
            row.bytes = Some(bvh.report().bytes);
            found.push(row);
        }
        time_both(subject.options.rounds, &trees, test, &mut found, ask);
        rows.extend(found);
    }
    Ok(rows)
}
