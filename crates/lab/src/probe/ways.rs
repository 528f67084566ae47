//! Orders that look at the ray, and a way of picking for each node, beside the static orders.

use antumbra::Bvh;
use antumbra::lab::Laboratory;
use antumbra::recipe::Order;

use super::row::Row;
use super::turns::{ask, time_both};
use super::{Part, Subject};
use crate::Error;
use crate::study::Kind;

/// Orders that are compared. Speeds are relative to the first one.
const ORDERS: [Order; 8] = [
    Order::Simple,
    Order::Ftob,
    Order::Far,
    Order::SortPlus,
    Order::Pairs,
    Order::Joint,
    Order::TwoWay,
    Order::Octants,
];
/// Orders that nodes depart from where distances pick better.
const BASES: [Order; 2] = [Order::SortPlus, Order::Joint];

/// Everything about ways of picking on one scene.
pub fn probe(subject: &Subject<'_>) -> Result<Vec<Row>, Error> {
    subject.on_all_trees(|kind, recipe| {
        let trained = subject.trained(kind, recipe);
        let mut collapsed = trained.collapse(recipe);
        let mut variants = Vec::new();
        for order in ORDERS {
            let bvh = collapsed.order(order)?.bvh;
            variants.push((order.name().to_owned(), bvh, None));
        }
        for order in BASES {
            let mut bvh = collapsed.order(order)?.bvh;
            let ways = bvh.learn_ways(subject.lots.train(kind), &recipe.costs);
            variants.push((format!("{order}, ways"), bvh, Some(ways)));
        }
        on_tree(subject, kind, &variants)
    })
}

type Variant = (String, Bvh, Option<[usize; 3]>);

fn on_tree(subject: &Subject<'_>, kind: Kind, variants: &[Variant]) -> Result<Vec<Row>, Error> {
    let test = subject.lots.test(kind);
    let mut expected = None;
    let mut rows = Vec::new();
    let visits = variants[0].1.oracle_visits(test);
    let oracle = visits.occluded() * visits.occluded_rays as f64
        + visits.unoccluded() * visits.unoccluded_rays as f64;
    let oracle = oracle / test.len() as f64;
    for (technique, bvh, ways) in variants {
        let row = Row::new(subject, Part::Ways, kind, technique.clone());
        let mut row = row.counted(bvh, test, subject.recipe.costs.prim, &mut expected)?;
        row.oracle = Some(oracle);
        if let Some([slots, near, far]) = ways {
            let all = (slots + near + far).max(1) as f64;
            row.near_share = Some(*near as f64 / all);
            row.far_share = Some(*far as f64 / all);
        }
        rows.push(row);
    }
    let ask_one = |(_, bvh, _): &Variant, rays: &[_], batch, answers: &mut [bool]| {
        ask(bvh, rays, batch, answers);
    };
    time_both(subject.options.rounds, variants, test, &mut rows, ask_one);
    Ok(rows)
}
