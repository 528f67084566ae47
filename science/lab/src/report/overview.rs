//! All scenes together: orders, trees and collapses by their means, and where the time of renderings goes.

use antumbra::recipe::{Collapse, Order};

use super::blocks::{Block, Cell, Line, Measured, marked_line, words};
use super::charts::Stacks;
use super::paper;
use super::summary::Summary;
use crate::Error;
use crate::study::{Combination, Kind, Plan, Row};
use crate::table::number;

/// Blocks about all scenes together.
pub fn overview(plan: &Plan, rows: &[&Row], summary: &Summary) -> Result<Vec<Block>, Error> {
    let mut blocks = Vec::new();
    for kind in Kind::ALL {
        blocks.extend(ablation_block(plan, summary, kind));
    }
    blocks.extend(orders_block(plan, summary));
    for kind in Kind::ALL {
        blocks.extend(trees_block(plan, summary, kind));
    }
    blocks.extend(shares_block(rows)?);
    blocks.extend(times_block(plan, rows)?);
    Ok(blocks)
}

/// Gains of builder, collapse and order, from the trees of the paper to the default.
fn ablation_block(plan: &Plan, summary: &Summary, kind: Kind) -> Option<Block> {
    let mut lines = Vec::new();
    for &width in &plan.widths {
        for (name, figures) in summary.ablation(kind, width) {
            let name = match plan.widths.len() {
                1 => name,
                _ => format!("{name}, {width} wide"),
            };
            let cells = figures.map(|figure| Cell::number(figure, 3));
            lines.push(Line::new(name, cells.into()));
        }
    }
    let head = ["node tests", "cost", "rate"];
    (!lines.is_empty()).then(|| Block::table(format!("From the trees of the paper to the default, {}", words(kind)), "How many times fewer, less and higher; rates in batches. One thing changes in each line, the others are held fixed: geometric mean of the scenes.", head, lines))
}

/// Times fewer node tests of every order, on the base tree.
fn orders_block(plan: &Plan, summary: &Summary) -> Option<Block> {
    let (tree, collapse) = plan.base();
    let mut lines = Vec::new();
    for kind in Kind::ALL {
        for &width in &plan.widths {
            let gain =
                |order: &Order| summary.gain(kind, &Combination::new(width, plan.base(), *order));
            let gains: Vec<Option<f64>> = plan.orders.iter().map(gain).collect();
            if gains.iter().any(Option::is_some) {
                let name = format!("{}, {width} wide", words(kind));
                let gains: Vec<_> = gains.iter().map(|gain| gain.map(Measured::exact)).collect();
                lines.push(marked_line(name, &gains, 3, true));
            }
        }
    }
    (!lines.is_empty()).then(|| Block::table("Orders", format!(
            "Times fewer node tests per ray than {}: geometric mean of the scenes; tree {tree}, collapse {collapse}.{}",
            summary.reference_words,
            summary.over_free_orders().map_or_else(String::new, |sentence| format!(" {sentence}"))
        ), plan.orders.iter(), lines).wide())
}

/// Times fewer node tests of every tree and collapse, by the default order.
fn trees_block(plan: &Plan, summary: &Summary, kind: Kind) -> Option<Block> {
    if plan.trees.len() * plan.collapses.len() < 2 {
        return None;
    }
    let order = plan.default_order();
    let mut lines = Vec::new();
    for &width in &plan.widths {
        for &tree in &plan.trees {
            let gain = |collapse: &Collapse| {
                summary.gain(kind, &Combination::new(width, (tree, *collapse), order))
            };
            let gains: Vec<Option<f64>> = plan.collapses.iter().map(gain).collect();
            if gains.iter().any(Option::is_some) {
                let name = if plan.widths.len() > 1 {
                    format!("{tree}, {width} wide")
                } else {
                    tree.to_string()
                };
                lines.push((name, gains));
            }
        }
    }
    let all = || {
        lines
            .iter()
            .flat_map(|(_, gains)| gains.iter().flatten().copied())
    };
    let (low, high) = (
        all().fold(f64::INFINITY, f64::min),
        all().fold(0.0, f64::max),
    );
    let shade = |gain: f64| {
        if high > low {
            (gain - low) / (high - low)
        } else {
            0.0
        }
    };
    let lines: Vec<Line> = lines
        .iter()
        .map(|(name, gains)| {
            let cell = |gain: &Option<f64>| Cell {
                text: number(*gain, 3),
                best: *gain == Some(high),
                shade: gain.map_or(-1.0, shade),
            };
            Line::new(name, gains.iter().map(cell).collect())
        })
        .collect();
    (!lines.is_empty()).then(|| Block::table(format!("Trees and collapses, {}", words(kind)), format!(
            "Times fewer node tests per ray than {}: geometric mean of the scenes; order {order}.",
            summary.reference_words
        ), plan.collapses.iter(), lines))
}

/// The paper's Figure 2.
fn shares_block(rows: &[&Row]) -> Result<Option<Block>, Error> {
    let mut lines: Vec<(String, Vec<f64>)> = Vec::new();
    for row in rows {
        if let Some(share) = row.shadow_share
            && lines.iter().all(|(name, _)| *name != row.scene)
        {
            lines.push((
                row.scene.clone(),
                vec![100.0 * share, 100.0 - 100.0 * share],
            ));
            if let Some(theirs) = paper::counterpart(&row.scene) {
                let share = 100.0 * theirs.shadow_share;
                lines.push((
                    format!("{} in the paper", theirs.name),
                    vec![share, 100.0 - share],
                ));
            }
        }
    }
    if lines.is_empty() {
        return Ok(None);
    }
    let stacks = Stacks {
        lines,
        parts: vec!["shadow rays".into(), "closest-hit rays".into()],
        axis: "per cent of all rays".into(),
    };
    Ok(Some(Block::plot(
        "Share of shadow rays",
        "What a faster shadow ray can bring is bounded by it (the paper's Figure 2).",
        stacks.draw()?,
    )))
}

/// Shares of the time of pictures.
fn times_block(plan: &Plan, rows: &[&Row]) -> Result<Option<Block>, Error> {
    let (tree, collapse) = plan.base();
    let shown = [Order::Simple, plan.default_order()].map(Order::name);
    let mut lines = Vec::new();
    let mut parts = Vec::new();
    for row in rows {
        if let Some(busy) = row.busy_seconds
            && row.is_on(tree.name(), collapse.name())
            && shown.contains(&&*row.order)
            && row.prim_cost == plan.costs.prim
        {
            let name = format!("{}, {} wide, {}", row.scene, row.width, row.order);
            // Building is no part of a composed time.
            let named = || {
                busy.named()
                    .into_iter()
                    .filter(|(part, _)| *part != "build")
            };
            parts = named().map(|(part, _)| part.to_owned()).collect();
            lines.push((name, named().map(|(_, seconds)| seconds).collect()));
        }
    }
    if lines.is_empty() {
        return Ok(None);
    }
    let stacks = Stacks {
        lines,
        parts,
        axis: "seconds, summed over the threads".into(),
    };
    Ok(Some(Block::plot(
        "Where the time of a picture goes",
        "Parts of the composed time, summed over the threads; shading and film are measured once for all trees of a picture. The part \"sort\" includes making a tree again for its training rays.",
        stacks.draw()?,
    )))
}
