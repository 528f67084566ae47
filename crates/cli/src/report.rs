//! What a study found: tables, Markdown, images and heat maps.

use std::fmt::Write;
use std::path::Path;

use antumbra::Order;
use antumbra_image::heatmap::{self, Range};
use antumbra_image::{Image, Window, atomic_write};

use crate::exit::{Failure, print, say};
use crate::json;
use crate::study::{Document, Entry, Group};
use crate::table::{Form, count, draw, number};

const HEADER: [&str; 10] = [
    "order",
    "nodes before",
    "nodes after",
    "prims before",
    "prims after",
    "log s",
    "sort s",
    "shadow s",
    "total s",
    "vs simple",
];

const LEGEND: &str = "\
nodes, prims: box tests of a node's children at once, and primitive tests, per shadow ray; before: over the rays learned \
from, after: over the others.
log, sort: seconds to learn the order, within the total; shadow: seconds in shadow rays that were not learned from, summed over the threads; \
vs simple: speed of the whole rendering, order simple being 1.";

/// Prints the tables: the result of the command, unless the standard output belongs to JSON.
pub fn show(groups: &[Group], document: &Document, to_stderr: bool) -> Result<(), Failure> {
    let mut text = format!("{}\n", document.machine.describe());
    for group in groups {
        let table = draw(Form::Terminal, &HEADER, &cells(group));
        let _ = write!(text, "\n{}\n{table}\n", caption(group));
    }
    text.push('\n');
    text.push_str(LEGEND);
    if to_stderr {
        say(format_args!("{text}"));
        Ok(())
    } else {
        print(text)
    }
}

/// Writes `study.json`, `report.md` and per group the image, a heat map per order and its values.
pub fn write(groups: &[Group], document: &Document, directory: &Path) -> Result<(), Failure> {
    let mut text = format!(
        "# Visiting orders of shadow rays\n\n{}; antumbra {}, seed {}.\n",
        document.machine.describe(),
        document.machine.version,
        document.seed
    );
    if !document.complete {
        text.push_str(
            "\nThe study was interrupted: these are the renderings that were finished.\n",
        );
    }
    for group in groups {
        let table = draw(Form::Markdown, &HEADER, &cells(group));
        let _ = write!(text, "\n## {}\n\n{table}\n", caption(group));
        text.push_str(&write_pictures(group, directory)?);
    }
    let _ = write!(text, "\n{LEGEND}\n");
    json::write_file(document, &directory.join("study.json"))?;
    atomic_write(directory.join("report.md"), |file| {
        file.write_all(text.as_bytes())
    })?;
    Ok(())
}

fn caption(group: &Group) -> String {
    let Some(Entry { row, .. }) = group.entries.first() else {
        return group.scene.clone();
    };
    // What a faster shadow ray can bring at most (Amdahl) is told with every time.
    let slowest = reference(group).or(group.entries.first());
    let share = slowest.map_or(0.0, |entry| {
        100.0 * entry.shadow_seconds / entry.busy_seconds
    });
    format!(
        "{}: {} triangles, width {}, collapse {}, {} spp, {} shadow rays ({:.0} % of all rays, {share:.0} % of the time)",
        group.scene,
        count(row.triangles as u64),
        group.width,
        row.collapse,
        row.spp,
        count(row.shadow_rays),
        100.0 * row.shadow_share,
    )
}

/// The rendering in the builder's order.
fn reference(group: &Group) -> Option<&Entry> {
    let mut entries = group.entries.iter();
    entries.find(|entry| entry.order == Order::Simple)
}

fn cells(group: &Group) -> Vec<Vec<String>> {
    let simple = reference(group).map(|entry| entry.row.render_seconds);
    let line = |Entry {
                    row,
                    shadow_seconds,
                    ..
                }: &Entry| {
        let learned = row.predicted_cost_before.is_some();
        let seconds = |value: f64| number(learned.then_some(value), 3);
        vec![
            row.order.to_owned(),
            number(row.node_tests_before, 3),
            number(row.node_tests_after, 3),
            number(row.prim_tests_before, 3),
            number(row.prim_tests_after, 3),
            seconds(row.log_seconds),
            seconds(row.sort_seconds),
            number(Some(*shadow_seconds), 2),
            number(Some(row.render_seconds), 2),
            number(simple.map(|simple| simple / row.render_seconds), 3),
        ]
    };
    group.entries.iter().map(line).collect()
}

/// Writes the pictures of a group, and returns the Markdown that shows them. The heat maps of a group
/// share their colours.
fn write_pictures(group: &Group, directory: &Path) -> Result<String, Failure> {
    let mut text = String::new();
    let Some(image) = &group.image else {
        return Ok(text);
    };
    let base = format!("{}-w{}", group.stem, group.width);
    image.write(directory.join(format!("{base}.exr")))?;
    image.write(directory.join(format!("{base}.png")))?;
    let _ = write!(text, "\n![{}]({base}.png)\n", group.scene);

    let maps: Vec<(&Entry, &[f32])> = group
        .entries
        .iter()
        .filter_map(|entry| Some((entry, entry.cost_map.as_deref()?)))
        .collect();
    let fields: Vec<&[f32]> = maps.iter().map(|&(_, map)| map).collect();
    let (min, max) = heatmap::shared_range(&fields, Range::Percentile(99.5))?;
    let options = heatmap::Options {
        range: Range::Fixed { min, max },
        ..Default::default()
    };
    text.push_str(
        "\nNode and primitive tests per shadow ray, pixel by pixel, in the same colours:\n",
    );
    let window = image.window();
    for (entry, map) in maps {
        let name = format!("{base}-tests-{}", order_stem(entry.order));
        let picture = heatmap::render(map, window.width(), window.height(), &options)?;
        picture.write(directory.join(format!("{name}.png")))?;
        values(map, image, window)?.write(directory.join(format!("{name}.exr")))?;
        let _ = write!(
            text,
            "\n{}:\n\n![{}]({name}.png)\n",
            entry.order, entry.order
        );
    }
    Ok(text)
}

/// A field as a grey image.
fn values(map: &[f32], image: &Image, window: Window) -> Result<Image, Failure> {
    let pixels = map.iter().map(|&value| [value; 3]).collect();
    Ok(Image::new(image.width(), image.height(), window, pixels)?)
}

/// An order's name as part of a file's name: signs are spelled out.
fn order_stem(order: Order) -> String {
    let name = order.name();
    match name.split_at(name.len() - 1) {
        (stem, "+") => format!("{stem}-plus"),
        (stem, "-") => format!("{stem}-minus"),
        _ => name.to_owned(),
    }
}
