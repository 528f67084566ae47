//! Cost models against what rays really cost.

use antumbra::lab::{Events, Laboratory, LogKind};
use antumbra::recipe::Order;

use super::row::{Row, counted};
use super::{Part, Subject};
use crate::Error;

/// Orders whose cost is predicted.
const ORDERS: [Order; 7] = [
    Order::Simple,
    Order::Random,
    Order::Sato,
    Order::Sort,
    Order::SortPlus,
    Order::Pairs,
    Order::Joint,
];

/// Predicted and measured costs on one scene.
pub fn probe(subject: &Subject<'_>) -> Result<Vec<Row>, Error> {
    // Costs in the same units as measured ones: entering an instance is no test.
    let costs = subject.recipe.costs;
    let costs = costs.entry(0.0).cutout(costs.prim);
    subject.on_all_trees(|kind, recipe| {
        let (train, test) = (subject.lots.train(kind), subject.lots.test(kind));
        let trained = subject.trained(kind, recipe);
        let mut collapsed = trained.collapse(recipe);
        let mut rows = Vec::new();
        for order in ORDERS {
            let bvh = collapsed.order(order)?.bvh;
            let kind_of_log = LogKind {
                boxes: true,
                shuffled: false,
                masks: true,
            };
            let log = bvh.log_of(train, kind_of_log, subject.options.seed);
            let predicted = |events| bvh.predicted_by(&log, &costs, events);
            let (answers, found) = counted(&bvh, test);
            let mut row = Row::new(subject, Part::Model, kind, order.name());
            row.count(&found, &answers, f64::from(costs.prim));
            row.independent = Some(predicted(Events::Independent)?);
            row.exclusive = Some(predicted(Events::Exclusive)?);
            row.overlapping = Some(predicted(Events::Overlapping)?);
            row.paired = Some(predicted(Events::Paired)?);
            rows.push(row);
        }
        Ok(rows)
    })
}
