//! Reports of benchmarks: tables, Markdown and the chart.

use std::fmt::Write;
use std::path::Path;

use antumbra_image::atomic_write;

use super::chart;
use super::engine::Query;
use super::model::Size;
use super::record::{BuildRow, Document, Group, KindRow, Row, distinct, groups};
use crate::Error;
use crate::output::write_json;
use crate::table::{Column, Table, count, number};

const RATES: [&str; 11] = [
    "engine",
    "api",
    "tree",
    "primary Mray/s",
    "ratio",
    "shadow Mray/s",
    "ratio",
    "diffuse Mray/s",
    "ratio",
    "shadow nodes",
    "shadow prims",
];
/// Meaning of the words in the headings of the tables.
pub const LEGEND: &str = "\
Mray/s: millions of rays per second, by the median time; ratio: median speed relative to Embree's single-ray call of the same \
round, level and number of threads.
tree: children per node, collapse and order; nodes, prims: box tests of a node's children at once, and primitive tests, \
per shadow ray of an occlusion query.
differ: rays of all kinds answered otherwise than by the watertight reference. Ours must be 0, bit for bit; others may differ \
where rounding decides, above all close to where a ray starts.
to triangles: median speed relative to plain triangles of the same engine and api.";

/// Writes `bench.json`, `bench.md` and `bench.svg`.
pub fn write(document: &Document, directory: &Path) -> Result<(), Error> {
    let machine = &document.machine;
    let embree = document.embree.as_deref();
    let mut text = format!(
        "# Rays per second\n\n{}; antumbra {}, {}; {}; seed {}, {} rounds.\n",
        machine.cpu.as_deref().unwrap_or("unknown CPU"),
        machine.version,
        document.compiler.as_deref().unwrap_or("unknown compiler"),
        embree.map_or("without Embree".to_owned(), |version| format!(
            "Embree {version}"
        )),
        document.seed,
        document.repeat,
    );
    if !document.complete {
        text.push_str("\nThe benchmark was interrupted: this is what was finished.\n");
    }
    text.push_str("\n![bars](bench.svg)\n\n");
    let means = tables(&document.means());
    for table in means
        .iter()
        .chain(&tables(&document.rows))
        .chain(&kinds(&document.kinds))
        .chain([&builds(&document.builds)])
    {
        let _ = write!(text, "## {}\n\n{}\n\n", table.caption, table.markdown());
    }
    let _ = writeln!(text, "{LEGEND}");
    let picture = chart::draw(document).map_err(Error::Report)?;
    write_json(document, &directory.join("bench.json"))?;
    for (name, text) in [("bench.svg", picture), ("bench.md", text)] {
        atomic_write(directory.join(name), |file| file.write_all(text.as_bytes()))?;
    }
    Ok(())
}

/// A table for every group of rows.
pub fn tables(rows: &[Row]) -> Vec<Table> {
    let table = |group: &Group| {
        let (header, rows) = cells(group);
        Table {
            caption: caption(group),
            header,
            rows,
        }
    };
    groups(rows).iter().map(table).collect()
}

/// The table of build times.
pub fn builds(builds: &[BuildRow]) -> Table {
    let megabytes = |row: &BuildRow| {
        let buffers = match row.buffer_bytes {
            0 => String::new(),
            bytes => format!(" + {:.1}", bytes as f64 / 1e6),
        };
        format!("{:.1}{buffers}", row.bytes as f64 / 1e6)
    };
    let rate = |row: &BuildRow| row.size.unique_triangles as f64 / row.seconds / 1e6;
    let columns: &[Column<BuildRow>] = &[
        ("scene", &|row| row.scene.clone()),
        ("engine", &|row| row.engine.to_owned()),
        ("builder", &|row| row.builder.to_owned()),
        ("level", &|row| row.level.clone()),
        ("threads", &|row| row.threads.to_string()),
        ("seconds", &|row| number(Some(row.seconds), 3)),
        ("best", &|row| number(Some(row.best_seconds), 3)),
        ("Mtri/s", &|row| number(Some(rate(row)), 2)),
        ("MB", &megabytes),
    ];
    Table::of("Building".to_owned(), builds, columns)
}

/// A table of things beside plain triangles for every scene.
pub fn kinds(rows: &[KindRow]) -> Vec<Table> {
    let columns: &[Column<KindRow>] = &[
        ("kind", &|row| row.kind.to_owned()),
        ("query", &|row| row.query.to_owned()),
        ("engine", &|row| row.engine.to_owned()),
        ("api", &|row| row.api.to_owned()),
        ("level", &|row| row.level.clone()),
        ("million/s", &|row| number(Some(row.millions_per_s), 3)),
        ("ratio", &|row| number(row.ratio_to_embree, 2)),
        ("to triangles", &|row| number(row.ratio_to_triangles, 2)),
        ("differ", &|row| row.disagreements.to_string()),
    ];
    let table = |scene: &String| {
        let caption = format!("{scene}: beside plain triangles, 1 thread");
        Table::of(
            caption,
            rows.iter().filter(|row| row.scene == *scene),
            columns,
        )
    };
    let scenes = distinct(rows.iter().map(|row| &row.scene));
    scenes.into_iter().map(table).collect()
}

fn caption(group: &Group) -> String {
    let plural = if group.threads == 1 { "" } else { "s" };
    let Size {
        triangles,
        unique_triangles,
        cutouts,
        instances,
    } = group.rows.first().map_or(Size::default(), |row| row.size);
    let mut what = format!("{} triangles", count(triangles as u64));
    for (number, of_what) in [
        (instances, "instances"),
        (unique_triangles, "unique"),
        (cutouts, "with holes"),
    ] {
        // Of one level and without holes it was all said.
        if number > 0 && number != triangles {
            let _ = write!(what, ", {} {of_what}", count(number as u64));
        }
    }
    format!(
        "{}: {what}, query {}, level {}, {} thread{plural}",
        group.scene, group.query, group.level, group.threads,
    )
}

/// The header and the cells of a group; only occlusion queries count their tests.
fn cells(group: &Group) -> (Vec<&'static str>, Vec<Vec<String>>) {
    let counts = group.query == Query::Occluded;
    let mut header = RATES.to_vec();
    if !counts {
        header.truncate(RATES.len() - 2);
    }
    header.push("differ");
    let mut lines = Vec::new();
    for line in group.lines() {
        let Some(any) = line.iter().flatten().next() else {
            continue;
        };
        let tree = match (any.width, any.collapse, any.order) {
            (Some(width), Some(collapse), Some(order)) => format!("{width} {collapse} {order}"),
            _ => "-".to_owned(),
        };
        let mut cells = vec![any.engine.to_owned(), any.api.to_owned(), tree];
        for row in line {
            cells.push(number(row.map(|row| row.mrays_per_s), 2));
            cells.push(number(row.and_then(|row| row.ratio_to_embree), 2));
        }
        if counts {
            let [_, shadow, _] = line;
            cells.push(number(shadow.and_then(|row| row.node_tests), 2));
            cells.push(number(shadow.and_then(|row| row.prim_tests), 2));
        }
        let differ: usize = line.iter().flatten().map(|row| row.disagreements).sum();
        cells.push(differ.to_string());
        lines.push(cells);
    }
    (header, lines)
}
