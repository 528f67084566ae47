//! Replayed rays of a scene: every combination of order, tree, collapse and width on the same rays.

use antumbra::recipe::{Builder, Collapse, Order};

use super::blocks::{Block, Cell, Line, words};
use super::charts::{Dot, Dots, Points};
use super::{only, sort_by_speed, summary};
use crate::Error;
use crate::study::{Kind, Plan, Row, Trained};
use crate::table::count;

/// Combinations that are listed as the best of a scene.
const MOST_BEST: usize = 12;

/// Every combination as a dot on the line of its order.
pub fn strip(plan: &Plan, rows: &[&Row], kind: Kind) -> Result<Block, Error> {
    let (tree, collapse) = plan.base();
    let orders: Vec<String> = plan.orders.iter().map(ToString::to_string).collect();
    let series: Vec<String> = plan.collapses.iter().map(ToString::to_string).collect();
    let dots = rows.iter().filter_map(|row| {
        Some(Dot {
            line: orders.iter().position(|order| *order == row.order)?,
            series: series.iter().position(|name| *name == row.collapse)?,
            value: row.node_tests_after?,
            bold: row.is_on(tree.name(), collapse.name()),
        })
    });
    let dots = Dots::tests(orders.clone(), series.clone(), dots.collect());
    let mut text = format!(
        "{} {}, none of them learned from.",
        count(rows[0].test_rays),
        words(kind)
    );
    if series.len() * plan.trees.len() > 1 {
        text.push_str(&format!(
            " A dot is a tree, its colour the collapse; bold: tree {tree}, collapse {collapse}."
        ));
    }
    Ok(Block::plot(
        format!("Node tests by technique, {}", words(kind)),
        text,
        dots.draw()?,
    ))
}

/// The fastest combinations.
pub fn best(plan: &Plan, rows: &[&Row], kind: Kind) -> Block {
    let widths = plan.widths.len();
    let mut sorted = rows.to_vec();
    sort_by_speed(&mut sorted, MOST_BEST);
    let head = [
        "cost",
        "nodes",
        "prims",
        "nodes, occluded",
        "speed",
        "of the rounds",
    ];
    let lines = sorted.iter().map(|row| {
        let mut name = format!("{} {} {}", row.tree, row.collapse, row.order);
        if widths > 1 {
            name = format!("{name} {}", row.width);
        }
        let cells = vec![
            Cell::number(row.cost(&plan.costs), 3),
            Cell::number(row.node_tests_after, 3),
            Cell::number(row.prim_tests_after, 3),
            Cell::number(row.node_tests_occluded, 3),
            Cell::number(row.speed, 2),
            Cell::plain(range(row.speed_range)),
        ];
        Line::new(name, cells)
    });
    Block::table(
        format!("Fastest combinations, {}", words(kind)),
        format!(
            "The {} of {} with the highest measured speed. Speed: relative to order simple on the default tree collapsed by area, one thread, median of interleaved rounds, then the least and the most. Cost: node tests and {} times the primitive tests.",
            sorted.len(),
            rows.len(),
            plan.costs.prim
        ),
        head,
        lines.collect(),
    )
}

/// Least and most in words.
pub fn range(range: Option<[f64; 2]>) -> String {
    range.map_or_else(
        || "-".to_owned(),
        |[least, most]| format!("{least:.2} to {most:.2}"),
    )
}

/// Costs predicted by the paper's model, against measured ones.
pub fn prediction(plan: &Plan, rows: &[&Row], kind: Kind) -> Result<Option<Block>, Error> {
    let model = plan.costs;
    let mut series: Vec<(String, Vec<(f64, f64)>)> = Vec::new();
    for row in rows {
        let measured = row.node_tests_after.zip(row.prim_tests_after);
        if let (Some(predicted), Some((nodes, prims))) = (row.predicted_cost_after, measured) {
            let cost = f64::from(model.node) * nodes + f64::from(model.prim) * prims;
            let point = (predicted, cost);
            match series.iter_mut().find(|(name, _)| *name == row.collapse) {
                Some((_, points)) => points.push(point),
                None => series.push((row.collapse.clone(), vec![point])),
            }
        }
    }
    let points: Vec<(f64, f64)> = series.iter().flat_map(|(_, p)| p.iter().copied()).collect();
    let Some(correlation) = summary::correlation(&points) else {
        return Ok(None);
    };
    let plot = Points {
        series,
        axes: ["predicted C_any".into(), "measured cost".into()],
        joined: false,
        logarithmic: false,
        fit: summary::line(&points),
    };
    Ok(Some(Block::plot(
        format!("Predicted and measured cost, {}", words(kind)),
        format!(
            "A dot per combination. Correlation {correlation:.3}; a model that predicts well has them on a line. Cost: node tests + {} prim tests.",
            model.prim
        ),
        plot.draw()?,
    )))
}

/// Node tests of the occluded rays in an order and by the oracle, and the per cent of the way from order simple to the
/// oracle that the order goes; `None` unless all are known.
fn part_of_gap(rows: &[&Row], row: &Row) -> Option<[f64; 3]> {
    let mut of_width = rows.iter().filter(|other| other.width == row.width);
    let simple = of_width.find(|other| other.order == Order::Simple.name())?;
    let (from, oracle) = (simple.node_tests_occluded?, row.oracle_occluded?);
    let tests = row.node_tests_occluded?;
    Some([tests, oracle, 100.0 * (from - tests) / (from - oracle)])
}

/// How much of the way to the oracle each order goes.
pub fn gap(plan: &Plan, rows: &[&Row], kind: Kind) -> Result<Option<Block>, Error> {
    let (tree, base) = plan.base();
    // Where the collapse has learned an order, `simple` is no beginning.
    let unlearned = plan.collapses.contains(&Collapse::Area);
    let collapse = if unlearned { Collapse::Area } else { base };
    let own = only(rows, |row| row.is_on(tree.name(), collapse.name()));
    let orders: Vec<String> = plan.orders.iter().map(ToString::to_string).collect();
    let (mut dots, mut lines) = (Vec::new(), Vec::new());
    for row in &own {
        let line = orders.iter().position(|order| *order == row.order);
        let (Some(line), Some([tests, oracle, closed])) = (line, part_of_gap(&own, row)) else {
            continue;
        };
        let place = plan.widths.iter().position(|w| w.lanes() == row.width);
        let series = place.unwrap_or(0);
        dots.push(Dot {
            line,
            series,
            value: closed,
            bold: true,
        });
        let values = [
            Some(tests),
            row.node_tests_unoccluded,
            Some(oracle),
            Some(closed),
        ];
        let cells = values.into_iter().zip([2, 2, 2, 0]);
        let cells = cells.map(|(value, decimals)| Cell::number(value, decimals));
        let name = format!("{}, {} wide", row.order, row.width);
        lines.push(Line::new(name, cells.collect()));
    }
    if dots.is_empty() {
        return Ok(None);
    }
    let chart = Dots {
        lines: orders,
        series: plan
            .widths
            .iter()
            .map(|width| format!("{width} wide"))
            .collect(),
        dots,
        axis: "per cent of the gap between simple and the oracle that is closed, occluded rays"
            .into(),
        from_zero: true,
        mark: Some((100.0, "oracle".into())),
    };
    let head = ["occluded", "unoccluded", "oracle, occluded", "closed, %"];
    Ok(Some(Block {
        svg: Some(chart.draw()?),
        ..Block::table(
            format!("Gap to the oracle, {}", words(kind)),
            format!(
                "The oracle goes the cheapest way to any occluder, chosen for every ray. Rays that meet nothing cost the same in every order. Tree {tree}, collapse {collapse}."
            ),
            head,
            lines,
        )
    }))
}

/// Node tests against the number of rays learned from.
pub fn log_sizes(
    plan: &Plan,
    techniques: &[&Row],
    fewer: &[&Row],
    kind: Kind,
) -> Result<Option<Block>, Error> {
    if fewer.is_empty() {
        return Ok(None);
    }
    let (tree, collapse) = plan.base();
    let mut series = Vec::new();
    for &width in &plan.widths {
        for order in plan.orders.iter().filter(|o| o.log_kind().is_some()) {
            let all = fewer.iter().chain(techniques).filter(|row| {
                row.width == width.lanes()
                    && row.order == order.name()
                    && row.is_on(tree.name(), collapse.name())
            });
            let point = |row: &&Row| Some((row.log_rays as f64, row.node_tests_after?));
            let points: Vec<(f64, f64)> = all.filter_map(point).collect();
            let name = if plan.widths.len() > 1 {
                format!("{order} {width}")
            } else {
                order.to_string()
            };
            series.push((name, points));
        }
    }
    let plot = Points {
        series,
        axes: ["rays learned from".into(), "node tests per ray".into()],
        joined: true,
        logarithmic: true,
        fit: None,
    };
    Ok(Some(Block::plot(
        format!("Cost against log size, {}", words(kind)),
        format!(
            "Tree {tree}, collapse {collapse}; a smaller log is the beginning of a larger one."
        ),
        plot.draw()?,
    )))
}

/// Node tests by what was learned from.
pub fn transfer(
    plan: &Plan,
    techniques: &[&Row],
    others: &[&Row],
    kind: Kind,
) -> Result<Option<Block>, Error> {
    if others.is_empty() {
        return Ok(None);
    }
    let (tree, _): (Builder, Collapse) = plan.base();
    let order = plan.default_order();
    let name = |row: &Row| match row.learned_from {
        Trained::TestCamera => "the same camera",
        Trained::TrainCamera => "the other camera",
        Trained::TurnedCamera => "looking the other way",
        Trained::Surfaces => "surfaces alone",
        Trained::OtherKind => match kind {
            Kind::Shadow => "ambient occlusion rays",
            Kind::Ao => "shadow rays",
        },
    };
    let all = [techniques, others].concat();
    let mut shown = only(&all, |row| {
        row.tree == tree.name() && row.order == order.name()
    });
    shown.sort_by_key(|row| row.learned_from as u8);
    let mut lines: Vec<String> = Vec::new();
    let series: Vec<String> = plan.collapses.iter().map(ToString::to_string).collect();
    let mut dots = Vec::new();
    for row in shown {
        let name = name(row);
        let line = match lines.iter().position(|line| line == name) {
            Some(line) => line,
            None => {
                lines.push(name.to_owned());
                lines.len() - 1
            }
        };
        let place = series.iter().position(|name| *name == row.collapse);
        if let (Some(series), Some(value)) = (place, row.node_tests_after) {
            dots.push(Dot {
                line,
                series,
                value,
                bold: true,
            });
        }
    }
    let chart = Dots::tests(lines, series, dots);
    Ok(Some(Block::plot(
        format!("Learned from other rays, tested on {}", words(kind)),
        format!("Tree {tree}, order {order}. Left is better."),
        chart.draw()?,
    )))
}
