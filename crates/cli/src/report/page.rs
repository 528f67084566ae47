//! The page: everything a study has found, in one file that needs nothing else.

use std::path::Path;

use antumbra::{Builder, Collapse, Order};
use antumbra_image::atomic_write;
use minijinja::Environment;
use minijinja::value::Serde;
use serde::Serialize;

use super::charts::{Dot, Dots, Points, Stacks};
use super::paper::{self, Figures};
use super::pictures::{Comparison, Embedded, Maps};
use super::summary::{self, Summary};
use crate::exit::Failure;
use crate::study::{By, Combination, Document, Files, Kind, Part, Plan, Row, Subject, Trained};
use crate::table::{count, number};

const TEMPLATE: &str = include_str!("page.html");
const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// Combinations that are listed as the best of a scene.
const MOST_BEST: usize = 12;

/// A table: names above, and lines of cells.
#[derive(Serialize)]
struct Table {
    head: Vec<String>,
    lines: Vec<Line>,
}

#[derive(Serialize, Default)]
struct Line {
    name: String,
    cells: Vec<Cell>,
    /// Not ours.
    quoted: bool,
}

#[derive(Serialize, Default)]
struct Cell {
    text: String,
    best: bool,
    /// How good it is within its table, from 0 to 1; negative for cells without a colour.
    shade: f64,
}

/// A plot or a table with its title and what it shows.
#[derive(Serialize)]
struct Block {
    title: String,
    text: String,
    svg: Option<String>,
    table: Option<Table>,
    /// Wants the whole width of the page.
    wide: bool,
}

#[derive(Serialize)]
struct Picture {
    address: String,
    width: usize,
    height: usize,
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
struct Wipe {
    picture: Picture,
    before: Picture,
    after: Picture,
    difference: Picture,
    scale: Picture,
    difference_scale: Picture,
    before_name: String,
    after_name: String,
    hottest: String,
    strongest: String,
}

#[derive(Serialize)]
struct Scene {
    id: String,
    name: String,
    facts: String,
    wipes: Vec<Wipe>,
    blocks: Vec<Block>,
}

/// All of it, as the template has it.
#[derive(Serialize)]
struct Page {
    style: &'static str,
    script: &'static str,
    complete: bool,
    machine: String,
    version: &'static str,
    seed: u64,
    command: String,
    headline: Vec<[String; 3]>,
    blocks: Vec<Block>,
    scenes: Vec<Scene>,
    replayed: bool,
    rows: usize,
}

/// Writes the page.
pub fn write(
    plan: &Plan,
    rows: &[(usize, Row)],
    document: &Document,
    folder: &Path,
) -> Result<(), Failure> {
    let paper = paper::tables()?;
    let mut scenes = Vec::new();
    for (place, subject) in plan.scenes.iter().enumerate() {
        let of_scene = rows.iter().filter(|(scene, _)| *scene == place);
        let own: Vec<&Row> = of_scene.map(|(_, row)| row).collect();
        if !own.is_empty() {
            scenes.push(Scene::new(plan, subject, &own, &paper, folder)?);
        }
    }
    let all: Vec<&Row> = rows.iter().map(|(_, row)| row).collect();
    let summary = Summary::new(plan, rows);
    let machine = &document.machine;
    let mut environment = Environment::new();
    environment
        .add_template("report.html", TEMPLATE)
        .map_err(Failure::work)?;
    let template = environment
        .get_template("report.html")
        .map_err(Failure::work)?;
    let page = Page {
        style: STYLE,
        script: SCRIPT,
        complete: document.complete,
        machine: format!(
            "{}, {} {}",
            machine.describe(),
            std::env::consts::OS,
            std::env::consts::ARCH
        ),
        version: machine.version,
        seed: document.seed,
        command: machine.command_line.join(" "),
        headline: summary.headline(),
        blocks: overview(plan, &all, &summary)?,
        scenes,
        replayed: all.iter().any(|row| row.by == By::Replay),
        rows: all.len(),
    };
    let text = template.render(Serde(&page));
    let text = text.map_err(Failure::work)?;
    atomic_write(folder.join("report.html"), |file| {
        file.write_all(text.as_bytes())
    })?;
    Ok(())
}

/// What is about all scenes together.
fn overview(plan: &Plan, rows: &[&Row], summary: &Summary) -> Result<Vec<Block>, Failure> {
    let mut blocks = Vec::new();
    blocks.extend(orders_block(plan, summary));
    for kind in Kind::ALL {
        blocks.extend(trees_block(plan, summary, kind));
    }
    blocks.extend(shares_block(rows)?);
    blocks.extend(times_block(plan, rows)?);
    Ok(blocks)
}

/// Words for a kind of rays.
fn words(kind: Kind) -> &'static str {
    match kind {
        Kind::Shadow => "shadow rays",
        Kind::Ao => "ambient occlusion rays",
    }
}

/// Times fewer node tests of every order, on the base tree.
fn orders_block(plan: &Plan, summary: &Summary) -> Option<Block> {
    let (tree, collapse) = plan.base();
    let mut lines = Vec::new();
    for kind in Kind::ALL {
        for &width in &plan.widths {
            let gain = |order: &Order| {
                let combination = Combination {
                    width,
                    tree,
                    collapse,
                    order: *order,
                };
                summary.gain(kind, &combination)
            };
            let gains: Vec<Option<f64>> = plan.orders.iter().map(gain).collect();
            if gains.iter().any(Option::is_some) {
                let name = format!("{}, {width} wide", words(kind));
                lines.push(marked_line(name, &gains, 3, true));
            }
        }
    }
    (!lines.is_empty()).then(|| Block {
        title: "Orders".into(),
        text: format!(
            "Times fewer node tests per ray than {}: geometric mean of the scenes; tree {tree}, collapse {collapse}.",
            summary.reference_words
        ),
        svg: None,
        table: Some(Table {
            head: plan.orders.iter().map(ToString::to_string).collect(),
            lines,
        }),
        wide: true,
    })
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
                summary.gain(
                    kind,
                    &Combination {
                        width,
                        tree,
                        collapse: *collapse,
                        order,
                    },
                )
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
        .map(|(name, gains)| Line {
            name: name.clone(),
            quoted: false,
            cells: gains
                .iter()
                .map(|gain| Cell {
                    text: number(*gain, 3),
                    best: *gain == Some(high),
                    shade: gain.map_or(-1.0, shade),
                })
                .collect(),
        })
        .collect();
    (!lines.is_empty()).then(|| Block {
        title: format!("Trees and collapses, {}", words(kind)),
        text: format!(
            "Times fewer node tests per ray than {}: geometric mean of the scenes; order {order}.",
            summary.reference_words
        ),
        svg: None,
        table: Some(Table {
            head: plan.collapses.iter().map(ToString::to_string).collect(),
            lines,
        }),
        wide: false,
    })
}

/// A line whose best value is marked.
fn marked_line(name: String, values: &[Option<f64>], decimals: usize, most: bool) -> Line {
    let better = |a: f64, b: f64| if most { a.max(b) } else { a.min(b) };
    let best = values.iter().flatten().copied().reduce(better);
    // What is printed alike is equally good.
    let text = |value: Option<f64>| number(value, decimals);
    Line {
        name,
        quoted: false,
        cells: values
            .iter()
            .map(|value| Cell {
                text: text(*value),
                best: value.is_some() && text(*value) == text(best) && values.len() > 1,
                shade: -1.0,
            })
            .collect(),
    }
}

/// The paper's Figure 2.
fn shares_block(rows: &[&Row]) -> Result<Option<Block>, Failure> {
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
    Ok(Some(Block {
        title: "Share of shadow rays".into(),
        text: "What a faster shadow ray can bring is bounded by it (the paper's Figure 2).".into(),
        svg: Some(stacks.draw()?),
        table: None,
        wide: false,
    }))
}

/// What the time of renderings goes into.
fn times_block(plan: &Plan, rows: &[&Row]) -> Result<Option<Block>, Failure> {
    let (tree, collapse) = plan.base();
    let shown = [Order::Simple, plan.default_order()].map(Order::name);
    let mut lines = Vec::new();
    let mut parts = Vec::new();
    for row in rows {
        if let Some(busy) = row.busy_seconds
            && row.is_on(tree.name(), collapse.name())
            && shown.contains(&&*row.order)
        {
            let name = format!("{}, {} wide, {}", row.scene, row.width, row.order);
            let named = busy.named();
            parts = named.iter().map(|(name, _)| (*name).to_owned()).collect();
            lines.push((name, named.iter().map(|(_, seconds)| *seconds).collect()));
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
    Ok(Some(Block {
        title: "Where the time of a rendering goes".into(),
        text: "Counting the tests is part of the time unless renderings were repeated for it."
            .into(),
        svg: Some(stacks.draw()?),
        table: None,
        wide: false,
    }))
}

impl Scene {
    fn new(
        plan: &Plan,
        subject: &Subject,
        rows: &[&Row],
        paper: &[Figures],
        folder: &Path,
    ) -> Result<Self, Failure> {
        let first = rows[0];
        let rendered = rows.iter().find(|row| row.by == By::Render);
        let mut facts = format!("{} triangles", count(first.triangles as u64));
        if let Some(row) = rendered {
            facts.push_str(&format!(
                ", {} samples per pixel, {} shadow rays ({:.0} % of all rays, {:.0} % of them blocked)",
                row.spp,
                count(row.shadow_rays.unwrap_or(0)),
                100.0 * row.shadow_share.unwrap_or(0.0),
                100.0 * row.occluded_share,
            ));
        }
        let mut scene = Self {
            id: format!("scene-{}", subject.stem),
            name: subject.scene.name.clone(),
            facts,
            wipes: Vec::new(),
            blocks: Vec::new(),
        };
        for &width in &plan.widths {
            scene
                .wipes
                .extend(wipe(plan, subject, width, rows, folder)?);
            scene
                .blocks
                .extend(paper_table(plan, rows, width.lanes(), paper));
        }
        for kind in Kind::ALL {
            let replayed: Vec<&Row> = rows
                .iter()
                .filter(|row| row.by == By::Replay && row.rays == kind)
                .copied()
                .collect();
            let part = |part: Part| -> Vec<&Row> {
                replayed
                    .iter()
                    .filter(|row| row.part == part)
                    .copied()
                    .collect()
            };
            let techniques = part(Part::Techniques);
            if techniques.is_empty() {
                continue;
            }
            scene.blocks.push(strip(plan, &techniques, kind)?);
            scene
                .blocks
                .push(best(&techniques, plan.widths.len(), kind));
            scene.blocks.extend(prediction(&techniques, kind)?);
            scene.blocks.extend(gap(plan, &techniques, kind)?);
            scene
                .blocks
                .extend(log_sizes(plan, &techniques, &part(Part::LogSize), kind)?);
            scene
                .blocks
                .extend(transfer(plan, &techniques, &part(Part::Transfer), kind)?);
        }
        Ok(scene)
    }
}

/// The heat maps of the first order and of the best rendering.
fn wipe(
    plan: &Plan,
    subject: &Subject,
    width: antumbra::Width,
    rows: &[&Row],
    folder: &Path,
) -> Result<Option<Wipe>, Failure> {
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
    let simple = rendered.iter().find(|c| c.order == Order::Simple);
    let before = simple.or(rendered.first());
    let after = rendered.iter().min_by(|a, b| tests(a).total_cmp(&tests(b)));
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

/// The layout of the paper's Tables 2 and 3: techniques beside each other, figures below each other.
fn paper_table(plan: &Plan, rows: &[&Row], width: usize, paper: &[Figures]) -> Option<Block> {
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
        line("node tests before", 2, &|row| row.node_tests_before),
        line("prim tests before", 2, &|row| row.prim_tests_before),
        line("node tests after", 2, &|row| row.node_tests_after),
        line("prim tests after", 2, &|row| row.prim_tests_after),
        line("logging, s", 2, &|row| learned(row, row.log_seconds)),
        line("sorting, ms", 1, &|row| {
            learned(row, 1e3 * row.sort_seconds)
        }),
        line("rendering, s", 2, &|row| row.render_seconds),
    ];
    let theirs = paper::counterpart(&first.scene);
    let mut text = "Means per shadow ray. Before: over the rays that were learned from; after: over all others. The best of each row is marked.".to_owned();
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
    Some(Block {
        title: format!("Renderings, {width} wide, tree {tree}, collapse {collapse}"),
        text,
        svg: None,
        table: Some(Table {
            head: own.iter().map(|row| row.order.clone()).collect(),
            lines,
        }),
        wide: true,
    })
}

/// Every combination as a dot on the line of its order.
fn strip(plan: &Plan, rows: &[&Row], kind: Kind) -> Result<Block, Failure> {
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
    let dots = Dots {
        dots: dots.collect(),
        lines: orders.clone(),
        series: series.clone(),
        axis: "node tests per ray".into(),
        from_zero: false,
        mark: None,
    };
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
    Ok(Block {
        title: format!("Node tests by technique, {}", words(kind)),
        text,
        svg: Some(dots.draw()?),
        table: None,
        wide: false,
    })
}

/// The combinations with the fewest tests.
fn best(rows: &[&Row], widths: usize, kind: Kind) -> Block {
    let mut sorted = rows.to_vec();
    let tests = |row: &Row| row.node_tests_after.unwrap_or(f64::INFINITY);
    sorted.sort_by(|a, b| tests(a).total_cmp(&tests(b)));
    sorted.truncate(MOST_BEST);
    let head = ["nodes", "prims", "nodes, occluded", "Mray/s", "speed"];
    let plain = |text: String| Cell {
        text,
        best: false,
        shade: -1.0,
    };
    let lines = sorted.iter().map(|row| Line {
        name: if widths > 1 {
            format!("{} {} {} {}", row.tree, row.collapse, row.order, row.width)
        } else {
            format!("{} {} {}", row.tree, row.collapse, row.order)
        },
        quoted: false,
        cells: vec![
            plain(number(row.node_tests_after, 3)),
            plain(number(row.prim_tests_after, 3)),
            plain(number(row.node_tests_occluded, 3)),
            plain(number(row.mrays_per_s, 1)),
            plain(number(row.speed, 2)),
        ],
    });
    Block {
        title: format!("Best combinations, {}", words(kind)),
        text: format!(
            "The {} of {} with the fewest node tests. Speed: relative to order simple on the default tree collapsed by area, one thread, timed in turn.",
            sorted.len(),
            rows.len()
        ),
        svg: None,
        table: Some(Table {
            head: head.map(str::to_owned).to_vec(),
            lines: lines.collect(),
        }),
        wide: false,
    }
}

/// What the paper's model says against what was measured.
fn prediction(rows: &[&Row], kind: Kind) -> Result<Option<Block>, Failure> {
    let model = antumbra::CostModel::default();
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
    Ok(Some(Block {
        title: format!("Predicted and measured cost, {}", words(kind)),
        text: format!(
            "A dot per combination. Correlation {correlation:.3}; a model that predicts well has them on a line. Cost: node tests + {} prim tests.",
            model.prim
        ),
        svg: Some(plot.draw()?),
        table: None,
        wide: false,
    }))
}

/// How much of the way to the oracle each order goes.
fn gap(plan: &Plan, rows: &[&Row], kind: Kind) -> Result<Option<Block>, Failure> {
    let (tree, base) = plan.base();
    // Where the collapse has learned an order, `simple` is no beginning.
    let unlearned = plan.collapses.contains(&Collapse::Area);
    let collapse = if unlearned { Collapse::Area } else { base };
    let own = || {
        rows.iter()
            .filter(|row| row.is_on(tree.name(), collapse.name()))
    };
    let mut dots = Vec::new();
    let orders: Vec<String> = plan.orders.iter().map(ToString::to_string).collect();
    let mut lines = Vec::new();
    for row in own() {
        let simple = own().find(|r| r.width == row.width && r.order == Order::Simple.name());
        let ends = simple.and_then(|simple| simple.node_tests_occluded.zip(row.oracle_occluded));
        let (Some((from, to)), Some(tests)) = (ends, row.node_tests_occluded) else {
            continue;
        };
        let closed = 100.0 * (from - tests) / (from - to);
        let Some(line) = orders.iter().position(|order| *order == row.order) else {
            continue;
        };
        let series = plan
            .widths
            .iter()
            .position(|w| w.lanes() == row.width)
            .unwrap_or(0);
        dots.push(Dot {
            line,
            series,
            value: closed,
            bold: true,
        });
        let values = [
            Some(tests),
            row.node_tests_unoccluded,
            Some(to),
            Some(closed),
        ];
        lines.push(Line {
            name: format!("{}, {} wide", row.order, row.width),
            quoted: false,
            cells: values
                .iter()
                .zip([2, 2, 2, 0])
                .map(|(value, decimals)| Cell {
                    text: number(*value, decimals),
                    best: false,
                    shade: -1.0,
                })
                .collect(),
        });
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
        title: format!("Gap to the oracle, {}", words(kind)),
        text: format!(
            "The oracle goes the cheapest way to any occluder, chosen for every ray. Rays that meet nothing cost the same in every order. Tree {tree}, collapse {collapse}."
        ),
        svg: Some(chart.draw()?),
        table: Some(Table {
            head: head.map(str::to_owned).to_vec(),
            lines,
        }),
        wide: false,
    }))
}

/// Node tests against the number of rays learned from.
fn log_sizes(
    plan: &Plan,
    techniques: &[&Row],
    fewer: &[&Row],
    kind: Kind,
) -> Result<Option<Block>, Failure> {
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
    Ok(Some(Block {
        title: format!("Cost against log size, {}", words(kind)),
        text: format!(
            "Tree {tree}, collapse {collapse}; a smaller log is the beginning of a larger one."
        ),
        svg: Some(plot.draw()?),
        table: None,
        wide: false,
    }))
}

/// Node tests by what was learned from.
fn transfer(
    plan: &Plan,
    techniques: &[&Row],
    others: &[&Row],
    kind: Kind,
) -> Result<Option<Block>, Failure> {
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
    let own = |row: &&&Row| row.tree == tree.name() && row.order == order.name();
    let mut shown: Vec<&Row> = techniques
        .iter()
        .chain(others)
        .filter(own)
        .copied()
        .collect();
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
    let chart = Dots {
        lines,
        series,
        dots,
        axis: "node tests per ray".into(),
        from_zero: false,
        mark: None,
    };
    Ok(Some(Block {
        title: format!("Learned from other rays, tested on {}", words(kind)),
        text: format!("Tree {tree}, order {order}. Left is better."),
        svg: Some(chart.draw()?),
        table: None,
        wide: false,
    }))
}
