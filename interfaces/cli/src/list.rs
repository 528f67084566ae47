//! `antumbra list`: orders, builders, collapses, levels, presets and widths.

use std::fmt::Write;

use antumbra::recipe::{Level, Preset};
use antumbra::{Isa, Recipe, Width};
use antumbra_trees::{BUILDERS, COLLAPSES, ORDERS};
use clap::ValueEnum;
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

use crate::args::{ListArgs, ListName};
use crate::exit::Failure;
use crate::json;
use crate::output;
use crate::version::VERSION;

/// One row of a list.
#[derive(Serialize)]
struct Entry {
    name: &'static str,
    /// One sentence, without a full stop.
    sentence: &'static str,
    /// Authors and year of the paper it comes from.
    source: Option<&'static str>,
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
    if let Some(json) = &args.json {
        output::check_file(json.path())?;
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
    /// The rows of a list.
    macro_rules! rows {
        ($list:expr, $default:expr) => {
            $list.map(|row| Entry {
                name: row.name(),
                sentence: row.sentence(),
                source: row.source(),
                default: row == $default,
                available: true,
            })
        };
    }
    let default = Recipe::default();
    match list {
        ListName::Orders => rows!(ORDERS, default.order).into(),
        ListName::Builders => rows!(BUILDERS, default.builder).into(),
        ListName::Collapses => rows!(COLLAPSES, default.collapse).into(),
        ListName::Levels => Level::ALL.iter().map(level).collect(),
        ListName::Presets => rows!(Preset::ALL, Preset::default()).into(),
        ListName::Widths => rows!(Width::ALL, default.engine.width()).into(),
    }
}

fn level(level: &Level) -> Entry {
    Entry {
        name: level.name(),
        sentence: level.sentence(),
        source: None,
        default: *level == Isa::best().level(),
        available: level.is_available(),
    }
}

/// The heading of a list, and its name in the document.
fn title(list: ListName) -> &'static str {
    match list {
        ListName::Orders => "orders",
        ListName::Builders => "builders",
        ListName::Collapses => "collapses",
        ListName::Levels => "levels",
        ListName::Presets => "presets",
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
            let mut line = format!("  {:widest$}  {}", entry.name, entry.sentence);
            if let Some(source) = entry.source {
                let _ = write!(line, " ({source})");
            }
            if entry.default {
                line.push_str(" [default]");
            }
            if !entry.available {
                line.push_str(" [not on this CPU]");
            }
            let _ = writeln!(text, "{line}");
        }
        text.push('\n');
    }
    text
}
