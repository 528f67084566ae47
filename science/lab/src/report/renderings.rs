//! Renderings of a scene: the paper's table, and heat maps to wipe between.

use std::path::Path;

use antumbra::recipe::Order;
use serde::Serialize;

use super::blocks::{Block, Cell, Line, Measured, marked_line, plain_line};
use super::paper::{self, Figures};
use super::pictures::{Comparison, Maps};
use super::{learned, only};
use crate::Error;
use crate::study::{By, Combination, Files, Plan, Row, Subject};
use crate::table::number;

/// Two heat maps to wipe between.
#[derive(Serialize)]
pub struct Wipe {
    #[serde(flatten)]
    maps: Comparison,
    before_name: String,
    after_name: String,
}

/// The heat maps of the first order and of the cheapest, on the base tree.
pub fn wipe(
    plan: &Plan,
    subject: &Subject,
    width: antumbra::Width,
    rows: &[&Row],
    folder: &Path,
) -> Result<Option<Wipe>, Error> {
    let row_of = |c: &Combination| {
        rows.iter().find(|row| {
            row.by == By::Render
                && row.is_of(c)
                && row.prim_cost == c.prim_cost.unwrap_or(plan.costs.prim)
        })
    };
    let all = plan.rendered(width);
    let rendered: Vec<Combination> = all.into_iter().filter(|c| row_of(c).is_some()).collect();
    let Some(maps) = Maps::draw(plan, subject, &rendered, folder)? else {
        return Ok(None);
    };
    let tests = |c: &Combination| {
        let row = row_of(c);
        let tests = row.map(|row| (row.node_tests_after, row.prim_tests_after));
        let (nodes, prims) = tests.unwrap_or_default();
        nodes
            .zip(prims)
            .map_or(f64::INFINITY, |(nodes, prims)| nodes + prims)
    };
    let cost = |c: &Combination| {
        let cost = row_of(c).and_then(|row| row.cost(&plan.costs));
        cost.unwrap_or(f64::INFINITY)
    };
    // One thing changes: the order, on one tree.
    let on_base = || (rendered.iter()).filter(|c| (c.tree, c.collapse) == plan.base());
    let simple = on_base().find(|c| c.order == Order::Simple);
    let before = simple.or(on_base().next());
    let after = on_base().min_by(|a, b| cost(a).total_cmp(&cost(b)));
    let (Some(before), Some(after)) = (before, after) else {
        return Ok(None);
    };
    let name = format!("{}-difference", Files::new(plan, subject, after).tests);
    let Some(maps) = maps.compare([before, after], folder, &name)? else {
        return Ok(None);
    };
    let name = |c: &Combination| {
        let tree = if (c.tree, c.collapse) == plan.base() {
            String::new()
        } else {
            format!(" on {} {}", c.tree, c.collapse)
        };
        let tests = number(Some(tests(c)), 1);
        format!("{}{tree}, {} wide: {tests} tests per ray", c.order, c.width)
    };
    Ok(Some(Wipe {
        maps,
        before_name: name(before),
        after_name: name(after),
    }))
}

/// The order of a row, with C_p where the study has several.
pub fn order_name(plan: &Plan, row: &Row) -> String {
    let learns = antumbra_trees::order(&row.order).is_ok_and(Order::learns);
    match plan.more_prim_costs.is_empty() || !learns {
        true => row.order.clone(),
        false => format!("{}, C_p {}", row.order, row.prim_cost),
    }
}

/// The layout of the paper's Tables 2 and 3: techniques beside each other, figures below each other.
pub fn paper_table(plan: &Plan, rows: &[&Row], width: usize, paper: &[Figures]) -> Option<Block> {
    let (tree, collapse) = plan.base();
    let is_own = |row: &Row| row.by == By::Render && row.width == width;
    let own = only(rows, |row| {
        is_own(row) && row.is_on(tree.name(), collapse.name())
    });
    let first = own.first()?;
    let mut lines = own_figures(&own, first);
    let theirs = paper::counterpart(&first.scene);
    let mut text = "N_b: node tests, N_t: primitive tests, means per shadow ray. Before: over the training rays while they are logged, as in the paper. After: over the held-out rays, which are the same for every order. Unsorted: over the held-out rays, before the children are ordered. Sorting: the child order only. Composed: own queries and learning, with the shading and the film that all trees share, without building the first tree. Measured: rendered apart. Marked: the best of a row, and what its spread does not tell from it.".to_owned();
    if let Some(theirs) = theirs {
        let found: Vec<Option<&Figures>> = (own.iter())
            .map(|row| {
                let mut paper = paper.iter();
                paper.find(|f| f.is_of(theirs.name, width, &row.order))
            })
            .collect();
        if found.iter().any(Option::is_some) {
            text.push_str(if theirs.same {
                " Below: the same scene in the paper (Core i7-4850HQ, its own renderer and trees)."
            } else {
                " Below: the scene of the paper that this one stands in for, which is not public."
            });
            if let Some(note) = paper::differences(&first.scene) {
                text.push_str(&format!(" {note}"));
                if !first.tree.starts_with("pbrt") {
                    text.push_str(" Leaves hold up to 8 primitives here and 4 there, so primitive tests are more and node tests fewer; the builder pbrt has the leaves of the paper.");
                }
            }
            lines.extend(quoted(theirs.name, &found));
        }
    }
    Some(
        Block::table(
            format!("Renderings, {width} wide, tree {tree}, collapse {collapse}"),
            text,
            own.iter().map(|row| order_name(plan, row)),
            lines,
        )
        .wide(),
    )
}

type Figure = fn(&Row) -> Option<f64>;

/// Counted figures, and whether the best is marked. The last three are of scenes with instances only.
const COUNTS: [(&str, bool, Figure); 9] = [
    ("N_b before", false, |row| row.node_tests_before),
    ("N_t before", false, |row| row.prim_tests_before),
    ("N_b after", true, |row| row.node_tests_after),
    ("N_t after", true, |row| row.prim_tests_after),
    ("N_b unsorted", false, |row| row.node_tests_unsorted),
    ("N_t unsorted", false, |row| row.prim_tests_unsorted),
    ("top level: N_b before", false, |row| {
        row.top_node_tests_before
    }),
    ("top level: N_b after", true, |row| row.top_node_tests_after),
    ("top level: N_b unsorted", false, |row| {
        row.top_node_tests_unsorted
    }),
];

/// Lines of our own figures.
fn own_figures(own: &[&Row], first: &Row) -> Vec<Line> {
    let plain_of = |name: &str, decimals, value: &dyn Fn(&Row) -> Option<f64>| {
        let values: Vec<Option<f64>> = own.iter().map(|row| value(row)).collect();
        plain_line(name.to_owned(), &values, decimals)
    };
    let marked = |name: &str, value: &dyn Fn(&Row) -> Option<Measured>| {
        let values: Vec<Option<Measured>> = own.iter().map(|row| value(row)).collect();
        marked_line(name.to_owned(), &values, 2, false)
    };
    let levels = COUNTS.len()
        - if first.top_node_tests_after.is_some() {
            0
        } else {
            3
        };
    let count = |&(name, is_marked, figure): &(&str, bool, Figure)| match is_marked {
        true => marked(name, &|row| figure(row).map(Measured::exact)),
        false => plain_of(name, 2, &figure),
    };
    let mut lines: Vec<Line> = COUNTS[..levels].iter().map(count).collect();
    lines.extend([
        plain_of("logging, s", 2, &|row| learned(row, row.log_seconds)),
        plain_of("sorting, ms", 1, &|row| {
            learned(row, 1e3 * row.sort_seconds)
        }),
    ]);
    // A time without a spread marks nothing.
    lines.push(marked("whole picture, composed, s", &|row| {
        let (value, range) = (row.render_seconds, row.render_seconds_range);
        Measured::of_rounds(value, range, row.timed_renderings)
    }));
    if first.timed_renderings > 1 {
        let cells = own.iter().map(|row| match row.spread() {
            // A figure that cannot be trusted is not printed like one that can.
            Some(spread) if spread > 1.1 => format!("{spread:.2}, unsteady"),
            spread => number(spread, 2),
        });
        let cells = cells.map(Cell::plain).collect();
        lines.push(Line::new("most / least of the rounds", cells));
    }
    if own.iter().any(|row| row.measured_seconds.is_some()) {
        lines.push(marked("whole picture, measured, s", &|row| {
            let (value, range) = (row.measured_seconds, row.measured_seconds_range);
            Measured::of_rounds(value, range, row.measured_renderings)
        }));
        let spread = |row: &Row| row.measured_seconds_range.map(|[least, most]| most / least);
        lines.push(plain_of("slowest / fastest measured", 2, &spread));
    }
    lines
}

/// Lines of the paper about a scene, technique by technique as far as it has them.
fn quoted(scene: &str, found: &[Option<&Figures>]) -> impl Iterator<Item = Line> {
    type Figure = fn(&Figures) -> Option<f64>;
    let figures: [(&str, usize, Figure); 7] = [
        ("N_b before", 2, Figures::n_b_before),
        ("N_t before", 2, Figures::n_t_before),
        ("N_b after", 2, |f| Some(f.n_b_after())),
        ("N_t after", 2, |f| Some(f.n_t_after())),
        ("logging, s", 1, |f| f.logging_s),
        ("sorting, ms", 0, |f| f.sorting_ms),
        ("rendering, s", 0, |f| Some(f.total_render_s)),
    ];
    figures.into_iter().map(move |(name, decimals, value)| {
        let values: Vec<Option<f64>> = found.iter().map(|f| f.and_then(value)).collect();
        Line {
            quoted: true,
            ..plain_line(format!("{scene}: {name}"), &values, decimals)
        }
    })
}
