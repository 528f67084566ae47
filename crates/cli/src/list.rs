//! `antumbra list`: orders, builders, collapses, levels and widths, from the kernel's lists.

use std::fmt::Write;

use antumbra::{Builder, Collapse, Isa, Level, Order, Width};
use antumbra_render::Options;
use clap::ValueEnum;
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

use crate::args::{ListArgs, ListName};
use crate::exit::Failure;
use crate::json::{self, Destination};
use crate::output;
use crate::version::VERSION;

/// One row of a list. A sentence and a citation belong here as soon as the kernel's table has them: to add one, add a
/// field, fill it in [`rows`] and print it in [`text`].
#[derive(Serialize)]
struct Entry {
    name: String,
    /// Whether `render` chooses it on this machine.
    default: bool,
    /// Whether this machine can use it.
    available: bool,
}

/// The JSON document: every list under its title.
struct Document(Vec<(&'static str, Vec<Entry>)>);

impl Serialize for Document {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("schema", "antumbra.list/1")?;
        map.serialize_entry("version", VERSION)?;
        for (title, list) in &self.0 {
            map.serialize_entry(title, list)?;
        }
        map.end()
    }
}

/// Runs the command.
pub fn run(args: &ListArgs) -> Result<(), Failure> {
    if let Some(path) = args.json.as_ref().and_then(Destination::file) {
        output::check_file(path)?;
    }
    let lists = match args.list {
        Some(list) => vec![list],
        None => ListName::value_variants().to_vec(),
    };
    let lists = lists.into_iter().map(|list| (title(list), entries(list)));
    let document = Document(lists.collect());
    json::write(&document, args.json.as_ref())?;
    json::print_beside(args.json.as_ref(), text(&document).trim_end())
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

/// All lists, for people.
fn text(Document(lists): &Document) -> String {
    let mut text = String::new();
    for (title, list) in lists {
        let widest = list.iter().map(|entry| entry.name.len()).max().unwrap_or(0);
        let _ = writeln!(text, "{title}");
        for entry in list {
            let note = match entry {
                Entry { default: true, .. } => "(default)",
                Entry {
                    available: false, ..
                } => "(not on this CPU)",
                _ => "",
            };
            let line = format!("  {:widest$}  {note}", entry.name);
            let _ = writeln!(text, "{}", line.trim_end());
        }
        text.push('\n');
    }
    text
}
