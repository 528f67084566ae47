//! Parts of the page: plots and tables with a title.

use serde::Serialize;

use crate::study::Kind;
use crate::table::number;

/// A table: names above, and lines of cells.
#[derive(Serialize)]
pub struct Table {
    pub head: Vec<String>,
    pub lines: Vec<Line>,
}

#[derive(Serialize)]
pub struct Line {
    pub name: String,
    pub cells: Vec<Cell>,
    /// Whether the line quotes the paper.
    pub quoted: bool,
}

#[derive(Serialize)]
pub struct Cell {
    pub text: String,
    pub best: bool,
    /// How good it is within its table, from 0 to 1; negative for cells without a colour.
    pub shade: f64,
}

/// A plot or a table with its title and what it shows.
#[derive(Serialize)]
pub struct Block {
    pub title: String,
    pub text: String,
    pub svg: Option<String>,
    pub table: Option<Table>,
    /// Wants the whole width of the page.
    pub wide: bool,
}

impl Cell {
    /// A text that is not marked.
    pub fn plain(text: String) -> Self {
        Self {
            text,
            best: false,
            shade: -1.0,
        }
    }

    /// A number that is not marked.
    pub fn number(value: Option<f64>, decimals: usize) -> Self {
        Self::plain(number(value, decimals))
    }
}

impl Line {
    /// A line of our own figures.
    pub fn new(name: impl Into<String>, cells: Vec<Cell>) -> Self {
        Self {
            name: name.into(),
            quoted: false,
            cells,
        }
    }
}

impl Block {
    /// A plot.
    pub fn plot(title: impl Into<String>, text: impl Into<String>, svg: String) -> Self {
        Self {
            title: title.into(),
            text: text.into(),
            svg: Some(svg),
            table: None,
            wide: false,
        }
    }

    /// A table.
    pub fn table(
        title: impl Into<String>,
        text: impl Into<String>,
        head: impl IntoIterator<Item = impl ToString>,
        lines: Vec<Line>,
    ) -> Self {
        let head = head.into_iter().map(|name| name.to_string());
        Self {
            title: title.into(),
            text: text.into(),
            svg: None,
            table: Some(Table {
                head: head.collect(),
                lines,
            }),
            wide: false,
        }
    }

    /// The block on the whole width of the page.
    pub fn wide(self) -> Self {
        Self { wide: true, ..self }
    }
}

/// Words for a kind of rays.
pub fn words(kind: Kind) -> &'static str {
    match kind {
        Kind::Shadow => "shadow rays",
        Kind::Ao => "ambient occlusion rays",
    }
}

/// A line whose best value is marked.
pub fn marked_line(name: String, values: &[Option<f64>], decimals: usize, most: bool) -> Line {
    let better = |a: f64, b: f64| if most { a.max(b) } else { a.min(b) };
    let best = values.iter().flatten().copied().reduce(better);
    // What is printed alike is equally good.
    let text = |value: Option<f64>| number(value, decimals);
    let cell = |value: &Option<f64>| Cell {
        best: value.is_some() && text(*value) == text(best) && values.len() > 1,
        ..Cell::plain(text(*value))
    };
    Line::new(name, values.iter().map(cell).collect())
}
