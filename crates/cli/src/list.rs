//! `antumbra list`: orders, builders, collapses, levels and widths, from the kernel's lists.

use antumbra::{Builder, Collapse, Isa, Level, Order, Width};
use antumbra_lab::Table;
use antumbra_render::Options;
use clap::ValueEnum;
use serde::Serialize;
use serde_json::{Map, Value};

use crate::args::{ListArgs, ListName};
use crate::exit::{Failure, print};
use crate::json::{self, Destination};
use crate::output;
use crate::table::draw_all;
use crate::version::VERSION;

/// One row of a list. A sentence and a citation belong here as soon as the kernel's table has them: to add one, add a
/// field, fill it in [`entries`] and give it a column in [`table`].
#[derive(Serialize)]
struct Entry {
    name: String,
    /// Whether `render` chooses it on this machine.
    default: bool,
    /// Whether this machine can use it.
    available: bool,
}

/// Runs the command.
pub fn run(args: &ListArgs) -> Result<(), Failure> {
    if let Some(path) = args.json.as_ref().and_then(Destination::file) {
        output::check_file(path)?;
    }
    let lists: Vec<ListName> = match args.list {
        Some(list) => vec![list],
        None => ListName::value_variants().to_vec(),
    };
    let lists: Vec<_> = lists
        .iter()
        .map(|&list| (title(list), entries(list)))
        .collect();
    if args.json.is_some() {
        return json::write(&document(&lists)?, args.json.as_ref());
    }
    let tables: Vec<Table> = lists
        .iter()
        .map(|(title, list)| table(title, list))
        .collect();
    print(draw_all(&tables).trim_end())
}

/// The rows of a list.
fn entries(list: ListName) -> Vec<Entry> {
    let default = Options::default();
    match list {
        ListName::Orders => rows(&Order::ALL, default.order),
        ListName::Builders => rows(&Builder::ALL, default.builder),
        ListName::Collapses => rows(&Collapse::ALL, default.collapse),
        ListName::Levels => {
            let mut rows = rows(&Level::ALL, Isa::best().level());
            for (row, level) in rows.iter_mut().zip(Level::ALL) {
                row.available = level.is_available();
            }
            rows
        }
        ListName::Widths => rows(&Width::ALL, default.width),
    }
}

fn rows<T: ToString + PartialEq>(all: &[T], default: T) -> Vec<Entry> {
    let row = |item: &T| Entry {
        name: item.to_string(),
        default: *item == default,
        available: true,
    };
    all.iter().map(row).collect()
}

/// The heading of a list, and its name in the document.
fn title(list: ListName) -> &'static str {
    match list {
        ListName::Orders => "orders",
        ListName::Builders => "builders",
        ListName::Collapses => "collapses",
        ListName::Levels => "levels",
        ListName::Widths => "widths",
    }
}

fn table(title: &str, list: &[Entry]) -> Table {
    let note = |entry: &Entry| match entry {
        Entry { default: true, .. } => "default",
        Entry {
            available: false, ..
        } => "not on this CPU",
        _ => "",
    };
    Table {
        caption: title.to_owned(),
        header: vec!["name", "note"],
        rows: list
            .iter()
            .map(|entry| vec![entry.name.clone(), note(entry).to_owned()])
            .collect(),
    }
}

fn document(lists: &[(&str, Vec<Entry>)]) -> Result<Value, Failure> {
    let mut document = Map::new();
    document.insert("schema".into(), "antumbra.list/1".into());
    document.insert("version".into(), VERSION.into());
    for (title, list) in lists {
        let list = serde_json::to_value(list).map_err(Failure::work)?;
        document.insert((*title).to_owned(), list);
    }
    Ok(document.into())
}
