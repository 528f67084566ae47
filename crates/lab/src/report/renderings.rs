//! Renderings of a scene: the paper's table, and heat maps to wipe between.

use std::path::Path;

use antumbra::recipe::Order;
use serde::Serialize;

use super::blocks::{Block, Cell, Line, marked_line};
use super::paper::{self, Figures};
use super::pictures::{Comparison, Embedded, Maps};
use crate::Error;
use crate::study::{By, Combination, Files, Plan, Row, Subject};
use crate::table::number;

#[derive(Serialize)]
pub struct Picture {
    pub address: String,
    pub width: usize,
    pub height: usize,
}

impl From<Embedded> for Picture {
    fn from(from: Embedded) -> Self {
        Self {
            address: from.address,
            width: from.width,
            height: from.height,
        }
    }
}

#[derive(Serialize)]
pub struct Wipe {
    pub picture: Picture,
    pub before: Picture,
    pub after: Picture,
    pub difference: Picture,
    pub scale: Picture,
    pub difference_scale: Picture,
    pub before_name: String,
    pub after_name: String,
    pub hottest: String,
    pub strongest: String,
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
                && row.width == c.width.lanes()
                && row.is_on(c.tree.name(), c.collapse.name())
                && row.order == c.order.name()
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
    let Some(found) = maps.compare([before, after], folder, &name)? else {
        return Ok(None);
    };
    let Comparison {
        picture,
        before: before_map,
        after: after_map,
        difference,
        scale,
        difference_scale,
        hottest,
        strongest,
    } = found;
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
        picture: picture.into(),
        before: before_map.into(),
        after: after_map.into(),
        difference: difference.into(),
        scale: scale.into(),
        difference_scale: difference_scale.into(),
        before_name: name(before),
        after_name: name(after),
        hottest: format!("{hottest:.0}"),
        strongest: format!("{strongest:.0}"),
    }))
}

/// Cells of text.
fn plain(rows: &[&Row], text: impl Fn(&Row) -> Option<String>) -> Vec<Cell> {
    let text = |row: &&Row| text(row).unwrap_or_else(|| "-".to_owned());
    rows.iter().map(text).map(Cell::plain).collect()
}

/// The layout of the paper's Tables 2 and 3: techniques beside each other, figures below each other.
pub fn paper_table(plan: &Plan, rows: &[&Row], width: usize, paper: &[Figures]) -> Option<Block> {
    let (tree, collapse) = plan.base();
    let own: Vec<&Row> = rows
        .iter()
        .filter(|row| row.by == By::Render && row.width == width)
        .filter(|row| row.is_on(tree.name(), collapse.name()))
        .copied()
        .collect();
    let first = own.first()?;
    let learned = |row: &Row, value: f64| (row.log_rays > 0).then_some(value);
    let line = |name: &str, decimals, value: &dyn Fn(&Row) -> Option<f64>| {
        let values: Vec<Option<f64>> = own.iter().map(|row| value(row)).collect();
        marked_line(name.to_owned(), &values, decimals, false)
    };
    let mut lines = vec![
        line("node tests while logging", 2, &|row| row.node_tests_logging),
        line("prim tests while logging", 2, &|row| row.prim_tests_logging),
        line("node tests before", 2, &|row| row.node_tests_before),
        line("prim tests before", 2, &|row| row.prim_tests_before),
        line("node tests after", 2, &|row| row.node_tests_after),
        line("prim tests after", 2, &|row| row.prim_tests_after),
        line("logging, s", 2, &|row| learned(row, row.log_seconds)),
        line("sorting alone, ms", 1, &|row| {
            learned(row, 1e3 * row.order_seconds)
        }),
        line("whole picture, composed, s", 2, &|row| row.render_seconds),
    ];
    if first.timed_renderings > 1 {
        let cells = plain(&own, |row| {
            row.spread().map(|spread| match spread {
                // A figure that cannot be trusted is not printed like one that can.
                spread if spread > 1.1 => format!("{spread:.2}, unsteady"),
                spread => format!("{spread:.2}"),
            })
        });
        lines.push(Line::new("most / least of the rounds", cells));
    }
    if own.iter().any(|row| row.measured_seconds.is_some()) {
        lines.push(line("whole picture, measured, s", 2, &|row| {
            row.measured_seconds
        }));
        let spread = |row: &Row| row.measured_seconds_range.map(|[least, most]| most / least);
        lines.push(line("slowest / fastest measured", 2, &spread));
    }
    if first.top_node_tests_after.is_some() {
        let top = [
            line("node tests while logging, top level", 2, &|row| {
                row.top_node_tests_logging
            }),
            line("node tests before, top level", 2, &|row| {
                row.top_node_tests_before
            }),
            line("node tests after, top level", 2, &|row| {
                row.top_node_tests_after
            }),
        ];
        for (place, line) in top.into_iter().enumerate().rev() {
            lines.insert(2 * place + 2, line);
        }
    }
    let theirs = paper::counterpart(&first.scene);
    let mut text = "Means per shadow ray. While logging: over the training rays, as the paper has its figures before sorting. Before and after: over all other rays, the same for every order. Composed: own queries, building and learning, with the shading and the film that all trees share. Measured: rendered apart. The best of each row is marked.".to_owned();
    if let Some(theirs) = theirs {
        let found: Vec<Option<&Figures>> = own
            .iter()
            .map(|row| {
                paper
                    .iter()
                    .find(|f| f.is_of(theirs.name, width, &row.order))
            })
            .collect();
        if found.iter().any(Option::is_some) {
            text.push_str(if theirs.same {
                " Below: the same scene in the paper (Core i7-4850HQ, its own renderer and trees)."
            } else {
                " Below: the scene of the paper that this one stands in for, which is not public."
            });
            let quote = |name: &str, decimals, value: &dyn Fn(&Figures) -> Option<f64>| Line {
                quoted: true,
                ..marked_line(
                    format!("{}: {name}", theirs.name),
                    &found.iter().map(|f| f.and_then(value)).collect::<Vec<_>>(),
                    decimals,
                    false,
                )
            };
            if let Some(note) = paper::differences(&first.scene) {
                text.push_str(&format!(" {note} Leaves hold up to 8 primitives here unless the builder is binned-sah-4, and 4 there, so primitive tests are more and node tests fewer."));
            }
            lines.extend([
                quote("box tests before", 2, &|f| Some(f.box_tests_before)),
                quote("prim tests before", 2, &|f| Some(f.prim_tests_before)),
                quote("box tests after", 2, &|f| {
                    f.box_tests_after.or(Some(f.box_tests_before))
                }),
                quote("prim tests after", 2, &|f| {
                    f.prim_tests_after.or(Some(f.prim_tests_before))
                }),
                quote("logging, s", 1, &|f| f.logging_s),
                quote("sorting, ms", 0, &|f| f.sorting_ms),
                quote("rendering, s", 0, &|f| Some(f.total_render_s)),
            ]);
        }
    }
    Some(
        Block::table(
            format!("Renderings, {width} wide, tree {tree}, collapse {collapse}"),
            text,
            own.iter().map(|row| row.order.clone()),
            lines,
        )
        .wide(),
    )
}
