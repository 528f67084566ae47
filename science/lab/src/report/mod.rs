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
use crate::table::{Column, Table, count, number};
use crate::{Error, Machine};

/// Columns of N_b and N_t, before and after sorting.
const TESTS: [&str; 6] = [
    "N_b before",
    "N_b after",
    "N_b gain",
    "N_t before",
    "N_t after",
    "N_t gain",
];

const LEGEND: &str = "\
N_b: node tests, all boxes of a node at once; N_t: primitive tests; both are means per shadow ray. Before: training rays \
while they are logged, as in the paper; after: held-out rays, the same for all trees of a scene; unsorted: held-out rays \
before the children are ordered; gain: after with order simple over after; top: N_b outside of instances, as the paper \
counts sanmiguel. In the CSV and JSON files N_b is node_tests and N_t is prim_tests.
C_p: cost of a primitive test by which the order was learned; log: seconds to learn the order; sort: milliseconds of \
sorting only; shadow: seconds in shadow rays, summed over the threads; composed: seconds of a whole picture, from the \
tree's own queries and learning and from the shading that all trees share, without building the first tree; spread: most \
over least of the rounds; vs simple: speed of the composed picture, order simple being 1.";

const REPLAY_LEGEND: &str = "\
Replays: a sample of held-out rays; occluded: N_b of the occluded rays; speed: relative to order simple on the default \
tree collapsed by area, one thread, median of interleaved rounds; rounds: least and most of them.";

/// How many of the best combinations are listed for people.
const MOST_BEST: usize = 10;

/// Rows that follow each other and have this in common.
fn runs<'a, K: PartialEq>(rows: &[&'a Row], key: impl Fn(&Row) -> K) -> Vec<Vec<&'a Row>> {
    rows.chunk_by(|a, b| key(a) == key(b))
        .map(<[&Row]>::to_vec)
        .collect()
}

/// Rows of which this is true.
fn only<'a>(rows: &[&'a Row], is_wanted: impl Fn(&Row) -> bool) -> Vec<&'a Row> {
    let wanted = rows.iter().filter(|row| is_wanted(row));
    wanted.copied().collect()
}

/// The tables of all scenes: pictures by width, replays by kind of rays.
fn tables(plan: &Plan, rows: &[&Row]) -> Vec<Table> {
    let mut tables = Vec::new();
    let (tree, collapse) = plan.base();
    for run in runs(rows, |row| (row.scene.clone(), row.by, row.width)) {
        if run[0].by == By::Render {
            let is_first = |row: &Row| row.is_on(tree.name(), collapse.name());
            let orders = only(&run, is_first);
            tables.extend(of_orders(&orders));
            tables.extend(of_the_paper(&orders));
            tables.extend(of_trees(&only(&run, |row| !is_first(row))));
            tables.extend(of_measured(&run));
        }
    }
    for kind in Kind::ALL {
        let replayed = only(rows, |row| row.is_replay(kind, Part::Techniques));
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
            "# Child orders of shadow rays\n\n{}; antumbra {}, seed {}.\n",
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
    // What a faster shadow ray can bring at most (Amdahl) is told with every time.
    let busy = reference.unwrap_or(first).busy_seconds;
    let share = busy.map_or(0.0, |busy| 100.0 * busy.shadow / busy.busy());
    let caption = format!(
        "{}: {} triangles, width {}, tree {}, collapse {}, {} spp, {} shadow rays ({:.0} % of all rays, {share:.0} % of the time)",
        first.scene,
        count(first.triangles as u64),
        first.width,
        first.tree,
        first.collapse,
        first.spp,
        count(first.shadow_rays.unwrap_or(0)),
        100.0 * first.shadow_share.unwrap_or(0.0),
    );
    let reference = reference.copied();
    let gain = |row: &Row, figure: fn(&Row) -> Option<f64>| {
        let pair = reference.and_then(figure).zip(figure(row));
        number(pair.map(|(simple, own)| simple / own), 2)
    };
    let columns: &[Column<Row>] = &[
        ("order", &|row| row.order.clone()),
        ("C_p", &|row| {
            number(learned(row, f64::from(row.prim_cost)), 2)
        }),
        (TESTS[0], &|row| number(row.node_tests_before, 2)),
        (TESTS[1], &|row| number(row.node_tests_after, 2)),
        (TESTS[2], &|row| gain(row, |row| row.node_tests_after)),
        (TESTS[3], &|row| number(row.prim_tests_before, 2)),
        (TESTS[4], &|row| number(row.prim_tests_after, 2)),
        (TESTS[5], &|row| gain(row, |row| row.prim_tests_after)),
        ("N_b unsorted", &|row| number(row.node_tests_unsorted, 2)),
        ("N_t unsorted", &|row| number(row.prim_tests_unsorted, 2)),
        ("log s", &|row| number(learned(row, row.log_seconds), 3)),
        ("sort ms", &|row| {
            number(learned(row, 1e3 * row.sort_seconds), 1)
        }),
        ("shadow s", &|row| {
            number(row.busy_seconds.map(|busy| busy.shadow), 2)
        }),
        ("composed s", &|row| number(row.render_seconds, 2)),
        ("spread", &|row| number(row.spread(), 2)),
        ("vs simple", &|row| gain(row, |row| row.render_seconds)),
        ("top N_b after", &|row| number(row.top_node_tests_after, 2)),
    ];
    let shown = columns.len() - usize::from(first.top_node_tests_after.is_none());
    Some(Table::of(caption, rows.iter().copied(), &columns[..shown]))
}

/// Figures of the paper for the scene, or for the scene that ours replaces.
fn of_the_paper(rows: &[&Row]) -> Option<Table> {
    let first = rows.first()?;
    let theirs = paper::counterpart(&first.scene)?;
    let lines = paper::lines(&first.scene, first.width);
    let simple = lines.iter().find(|line| line.technique == "Simple")?;
    let relation = match theirs.same {
        true => format!("{} in the paper", theirs.name),
        false => format!(
            "{} in the paper, for which {} stands in",
            theirs.name, first.scene
        ),
    };
    let cells = |line: &paper::Figures| {
        vec![
            line.technique.to_lowercase(),
            number(line.n_b_before(), 2),
            number(Some(line.n_b_after()), 2),
            number(Some(simple.n_b_after() / line.n_b_after()), 2),
            number(line.n_t_before(), 2),
            number(Some(line.n_t_after()), 2),
            number(Some(simple.n_t_after() / line.n_t_after()), 2),
            number(line.logging_s, 1),
            number(line.sorting_ms, 0),
            number(Some(line.total_render_s), 0),
        ]
    };
    Some(Table {
        caption: format!("{relation}, width {}", first.width),
        header: [&["order"][..], &TESTS, &["log s", "sort ms", "rendering s"]].concat(),
        rows: lines.iter().map(cells).collect(),
    })
}

/// Other trees and collapses by one order, if any was rendered.
fn of_trees(rows: &[&Row]) -> Option<Table> {
    let first = rows.first()?;
    let columns: &[Column<Row>] = &[
        ("tree and collapse", &|row| {
            format!("{} {}", row.tree, row.collapse)
        }),
        ("N_b before", &|row| number(row.node_tests_before, 3)),
        ("N_b after", &|row| number(row.node_tests_after, 3)),
        ("N_t before", &|row| number(row.prim_tests_before, 3)),
        ("N_t after", &|row| number(row.prim_tests_after, 3)),
        ("N_b unsorted", &|row| number(row.node_tests_unsorted, 3)),
        ("N_t unsorted", &|row| number(row.prim_tests_unsorted, 3)),
        ("log s", &|row| number(learned(row, row.log_seconds), 3)),
        ("sort ms", &|row| {
            number(learned(row, 1e3 * row.sort_seconds), 1)
        }),
        ("remake s", &|row| number(row.remake_seconds, 3)),
        ("shadow s", &|row| {
            number(row.busy_seconds.map(|busy| busy.shadow), 2)
        }),
        ("composed s", &|row| number(row.render_seconds, 2)),
        ("spread", &|row| number(row.spread(), 2)),
        ("build s", &|row| number(Some(row.build_seconds), 3)),
    ];
    let Row {
        scene,
        width,
        order,
        ..
    } = first;
    let caption = format!("{scene}: width {width}, order {order}");
    Some(Table::of(caption, rows.iter().copied(), columns))
}

/// Whole pictures that were rendered apart, if any were.
fn of_measured(rows: &[&Row]) -> Option<Table> {
    let measured = only(rows, |row| row.measured_seconds.is_some());
    let first = measured.first()?;
    let caption = format!(
        "{}: width {}, whole pictures rendered apart, median of {}",
        first.scene, first.width, first.measured_renderings
    );
    let range = |row: &Row| {
        let range = row.measured_seconds_range;
        range.map_or_else(String::new, |range| replays::range(Some(range)))
    };
    let columns: &[Column<Row>] = &[
        ("tree", &|row| row.tree.clone()),
        ("collapse", &|row| row.collapse.clone()),
        ("order", &|row| row.order.clone()),
        ("measured s", &|row| number(row.measured_seconds, 2)),
        ("fastest to slowest", &range),
        ("composed s", &|row| number(row.render_seconds, 2)),
    ];
    Some(Table::of(caption, measured, columns))
}

/// The best of many combinations.
fn of_best(plan: &Plan, mut rows: Vec<&Row>) -> Table {
    let caption = format!(
        "{}: {} rays, {} replayed; the fastest of {} combinations",
        rows[0].scene,
        rows[0].rays.name(),
        count(rows[0].test_rays),
        rows.len()
    );
    sort_by_speed(&mut rows, MOST_BEST);
    let columns: &[Column<Row>] = &[
        ("tree", &|row| row.tree.clone()),
        ("collapse", &|row| row.collapse.clone()),
        ("order", &|row| format!("{} {}", row.order, row.width)),
        ("speed", &|row| number(row.speed, 2)),
        ("rounds", &|row| replays::range(row.speed_range)),
        ("cost", &|row| number(row.cost(&plan.costs), 3)),
        ("N_b", &|row| number(row.node_tests_after, 3)),
        ("N_t", &|row| number(row.prim_tests_after, 3)),
        ("occluded", &|row| number(row.node_tests_occluded, 3)),
    ];
    Table::of(caption, rows, columns)
}

/// The fastest of some rows, the fastest first.
fn sort_by_speed(rows: &mut Vec<&Row>, most: usize) {
    let rank = |row: &Row| row.speed.unwrap_or(0.0);
    rows.sort_by(|a, b| rank(b).total_cmp(&rank(a)));
    rows.truncate(most);
}

/// A figure of learning; `None` where nothing was learned.
fn learned(row: &Row, value: f64) -> Option<f64> {
    (row.log_rays > 0).then_some(value)
}
