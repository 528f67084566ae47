//! Reports of studies: tables, Markdown, a page, images and heat maps.
//!
//! - `page`: the self-contained page, made of `blocks`;  `charts`: its plots;  `pictures`: its heat maps
//!   - `overview`: all scenes together;  `renderings`, `replays`: of one scene
//! - `paper`: the figures of the paper that ours are set beside;  `summary`: means over scenes
//! - `sheet`: rows as CSV

mod blocks;
mod charts;
mod overview;
mod page;
mod paper;
mod pictures;
mod renderings;
mod replays;
mod sheet;
mod summary;

use std::fmt::Write;
use std::path::PathBuf;

use antumbra::recipe::Order;
use antumbra_image::atomic_write;

use crate::output::write_json;
use crate::study::{By, Kind, Part, Plan, Results, Row};
use crate::table::{Table, count, number};
use crate::{Error, Machine};

const HEADER: [&str; 12] = [
    "order",
    "nodes before",
    "nodes after",
    "prims before",
    "prims after",
    "log s",
    "sort ms",
    "shadow s",
    "composed s",
    "spread",
    "vs simple",
    "paper: nodes after",
];

const BEST: [&str; 9] = [
    "tree", "collapse", "order", "cost", "nodes", "prims", "occluded", "Mray/s", "speed",
];

const LEGEND: &str = "\
nodes, prims: box tests of a node's children at once, and primitive tests, per shadow ray that was not learned from; \
before: unsorted, after: in its order. All trees of a scene meet the same rays.
log: seconds to learn the order; sort: milliseconds of sorting alone; shadow: seconds in shadow rays, summed over the \
threads; composed: seconds of a whole picture, from the tree's own queries and learning and from the shading that all \
trees share; spread: most over least of the rounds; vs simple: speed of the composed picture, order simple being 1; \
paper: the same scene, or the one it stands in for.";

const REPLAY_LEGEND: &str = "\
Replays: a sample of rays, none of them learned from; occluded: node tests of the rays that meet something; speed: \
relative to order simple on the default tree collapsed by area, one thread.";

/// How many of the best combinations are listed for people.
const MOST_BEST: usize = 10;

/// Rows that follow each other and have this in common.
fn runs<'a, K: PartialEq>(rows: &[&'a Row], key: impl Fn(&Row) -> K) -> Vec<Vec<&'a Row>> {
    rows.chunk_by(|a, b| key(a) == key(b))
        .map(<[&Row]>::to_vec)
        .collect()
}

/// The tables of all scenes: pictures by width, replays by kind of rays.
fn tables(plan: &Plan, rows: &[&Row]) -> Vec<Table> {
    let mut tables = Vec::new();
    let (tree, collapse) = plan.base();
    for run in runs(rows, |row| (row.scene.clone(), row.by, row.width)) {
        if run[0].by == By::Render {
            let first = |row: &&&Row| row.is_on(tree.name(), collapse.name());
            let orders: Vec<&Row> = run.iter().filter(first).copied().collect();
            let others: Vec<&Row> = run.iter().filter(|row| !first(row)).copied().collect();
            tables.extend(of_orders(&orders));
            tables.extend(of_trees(&others));
            tables.extend(of_measured(&run));
        }
    }
    for kind in Kind::ALL {
        let replayed: Vec<&Row> = rows
            .iter()
            .filter(|r| r.by == By::Replay && r.part == Part::Techniques && r.rays == kind)
            .copied()
            .collect();
        for run in runs(&replayed, |row| row.scene.clone()) {
            tables.push(of_best(plan, run));
        }
    }
    tables
}

impl Results<'_> {
    /// The results as tables, scene by scene.
    pub fn tables(&self) -> Vec<Table> {
        let rows: Vec<&Row> = self.rows().collect();
        tables(self.plan, &rows)
    }

    /// One line about the machine, for the top of the tables.
    pub fn machine(&self) -> &Machine {
        &self.machine
    }

    /// Meaning of the words in the headings of the tables.
    pub fn legend(&self) -> String {
        if self.rows().any(|row| row.by == By::Replay) {
            format!("{LEGEND}\n{REPLAY_LEGEND}")
        } else {
            LEGEND.to_owned()
        }
    }

    /// Writes `report.html`, `report.md`, `results.json`, `results.csv` and heat maps to the directory of the
    /// [plan](Plan::out), which holds the pictures already. Returns the path of `report.html`; `None` if the plan has no
    /// directory.
    ///
    /// # Errors
    /// A file cannot be written, or a picture not be read again.
    pub fn write(&self) -> Result<Option<PathBuf>, Error> {
        let Some(folder) = &self.plan.out else {
            return Ok(None);
        };
        let document = self.document();
        let mut text = format!(
            "# Visiting orders of shadow rays\n\n{}; antumbra {}, seed {}.\n",
            document.machine.describe(),
            document.machine.version,
            document.seed
        );
        if !document.complete {
            text.push_str(
                "\nThe study was interrupted: these are the pictures that were finished.\n",
            );
        }
        for table in self.tables() {
            let _ = write!(text, "\n## {}\n\n{}\n", table.caption, table.markdown());
        }
        let _ = write!(text, "\n{}\n", self.legend());
        write_json(&document, &folder.join("results.json"))?;
        sheet::write(&document.rows, &folder.join("results.csv"))?;
        atomic_write(folder.join("report.md"), |file| {
            file.write_all(text.as_bytes())
        })?;
        page::write(self.plan, &self.placed, &document, folder)?;
        Ok(Some(folder.join("report.html")))
    }
}

/// All orders of one tree, if any was rendered.
fn of_orders(rows: &[&Row]) -> Option<Table> {
    let reference = rows.iter().find(|row| row.order == Order::Simple.name());
    let first = rows.first()?;
    let simple = reference.and_then(|row| row.render_seconds);
    // What a faster shadow ray can bring at most (Amdahl) is told with every time.
    let busy = reference.unwrap_or(first).busy_seconds;
    let share = busy.map_or(0.0, |busy| 100.0 * busy.shadow / busy.busy());
    let caption = format!(
        "{}: {} triangles, width {}, collapse {}, {} spp, {} shadow rays ({:.0} % of all rays, {share:.0} % of the time)",
        first.scene,
        count(first.triangles as u64),
        first.width,
        first.collapse,
        first.spp,
        count(first.shadow_rays.unwrap_or(0)),
        100.0 * first.shadow_share.unwrap_or(0.0),
    );
    Some(Table {
        caption,
        header: HEADER.to_vec(),
        rows: rows
            .iter()
            .map(|row| line(row, row.order.clone(), simple))
            .collect(),
    })
}

/// Other trees and collapses by one order, if any was rendered.
fn of_trees(rows: &[&Row]) -> Option<Table> {
    const TREES: [&str; 11] = [
        "tree and collapse",
        "nodes before",
        "nodes after",
        "prims before",
        "prims after",
        "log s",
        "sort ms",
        "shadow s",
        "composed s",
        "spread",
        "build s",
    ];
    let first = rows.first()?;
    let cells = rows.iter().map(|row| {
        let mut cells = line(row, format!("{} {}", row.tree, row.collapse), None);
        cells.truncate(10);
        cells.push(number(Some(row.build_seconds), 3));
        cells
    });
    Some(Table {
        caption: format!(
            "{}: width {}, order {}",
            first.scene, first.width, first.order
        ),
        header: TREES.to_vec(),
        rows: cells.collect(),
    })
}

/// Whole pictures that were rendered apart, if any were.
fn of_measured(rows: &[&Row]) -> Option<Table> {
    const MEASURED: [&str; 6] = [
        "tree",
        "collapse",
        "order",
        "measured s",
        "fastest to slowest",
        "composed s",
    ];
    let measured: Vec<&&Row> = (rows.iter())
        .filter(|row| row.measured_seconds.is_some())
        .collect();
    let first = measured.first()?;
    let cells = measured.iter().map(|row| {
        let range = row.measured_seconds_range;
        vec![
            row.tree.clone(),
            row.collapse.clone(),
            row.order.clone(),
            number(row.measured_seconds, 2),
            range.map_or_else(String::new, |[least, most]| {
                format!("{least:.2} to {most:.2}")
            }),
            number(row.render_seconds, 2),
        ]
    });
    Some(Table {
        caption: format!(
            "{}: width {}, whole pictures rendered apart, median of {}",
            first.scene, first.width, first.measured_renderings
        ),
        header: MEASURED.to_vec(),
        rows: cells.collect(),
    })
}

/// The best of many combinations.
fn of_best(plan: &Plan, mut rows: Vec<&Row>) -> Table {
    let caption = format!(
        "{}: {} rays, {} replayed; the cheapest of {} combinations",
        rows[0].scene,
        rows[0].rays.name(),
        count(rows[0].test_rays),
        rows.len()
    );
    let cost = |row: &Row| row.cost(&plan.costs);
    let rank = |row: &Row| cost(row).unwrap_or(f64::INFINITY);
    rows.sort_by(|a, b| rank(a).total_cmp(&rank(b)));
    rows.truncate(MOST_BEST);
    let cells = rows.iter().map(|row| {
        vec![
            row.tree.clone(),
            row.collapse.clone(),
            format!("{} {}", row.order, row.width),
            number(cost(row), 3),
            number(row.node_tests_after, 3),
            number(row.prim_tests_after, 3),
            number(row.node_tests_occluded, 3),
            number(row.mrays_per_s, 2),
            number(row.speed, 2),
        ]
    });
    Table {
        caption,
        header: BEST.to_vec(),
        rows: cells.collect(),
    }
}

/// The figures of a rendering.
fn line(row: &Row, name: String, simple: Option<f64>) -> Vec<String> {
    let learned = row.log_rays > 0;
    let theirs = paper::node_tests(&row.scene, row.width, &row.order);
    let seconds = |value: f64| number(learned.then_some(value), 3);
    let speed = simple
        .zip(row.render_seconds)
        .map(|(simple, own)| simple / own);
    vec![
        name,
        number(row.node_tests_before, 3),
        number(row.node_tests_after, 3),
        number(row.prim_tests_before, 3),
        number(row.prim_tests_after, 3),
        seconds(row.log_seconds),
        number(learned.then_some(1e3 * row.order_seconds), 1),
        number(row.busy_seconds.map(|busy| busy.shadow), 2),
        number(row.render_seconds, 2),
        number(row.spread(), 2),
        number(speed, 3),
        number(theirs, 2),
    ]
}
