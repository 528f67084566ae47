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

/// A figure with the least and the most of its repetitions, which are equal for counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    pub value: f64,
    pub range: [f64; 2],
}

impl Measured {
    /// A count, which has no spread.
    pub fn exact(value: f64) -> Self {
        Self {
            value,
            range: [value; 2],
        }
    }

    /// A median of rounds. A single one may be anything: nothing beats it, and it beats nothing.
    pub fn of_rounds(value: Option<f64>, range: Option<[f64; 2]>, rounds: u32) -> Option<Self> {
        let whole = [f64::NEG_INFINITY, f64::INFINITY];
        let range = range.filter(|_| rounds > 1).unwrap_or(whole);
        value.map(|value| Self { value, range })
    }

    /// Whether all repetitions of this are better than all of the other.
    pub fn beats(&self, other: &Self, most: bool) -> bool {
        match most {
            true => self.range[0] > other.range[1],
            false => self.range[1] < other.range[0],
        }
    }
}

/// A line of figures that are not marked.
pub fn plain_line(name: String, values: &[Option<f64>], decimals: usize) -> Line {
    let cell = |value: &Option<f64>| Cell::number(*value, decimals);
    Line::new(name, values.iter().map(cell).collect())
}

/// A line in which the best figure is marked, with all that are printed alike or whose spread overlaps its own. Nothing is
/// marked unless the best one beats another beyond their spread.
pub fn marked_line(name: String, values: &[Option<Measured>], decimals: usize, most: bool) -> Line {
    let better = |a: Measured, b: Measured| match most {
        true if b.value > a.value => b,
        false if b.value < a.value => b,
        _ => a,
    };
    let text = |value: Option<f64>| number(value, decimals);
    let best = values.iter().flatten().copied().reduce(better);
    let beaten = |one: &Measured| {
        best.is_some_and(|best| {
            best.beats(one, most) && text(Some(best.value)) != text(Some(one.value))
        })
    };
    let any = values.iter().flatten().any(beaten);
    let cell = |value: &Option<Measured>| Cell {
        best: any && value.as_ref().is_some_and(|one| !beaten(one)),
        ..Cell::plain(text(value.map(|one| one.value)))
    };
    Line::new(name, values.iter().map(cell).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn marks(values: &[Option<Measured>], decimals: usize, most: bool) -> Vec<bool> {
        let line = marked_line(String::new(), values, decimals, most);
        line.cells.iter().map(|cell| cell.best).collect()
    }

    #[test]
    fn marks_are_where_a_difference_is_beyond_its_spread() {
        let exact = |value| Some(Measured::exact(value));
        assert_eq!(
            marks(&[exact(2.0), exact(1.0), None], 2, false),
            [false, true, false]
        );
        assert_eq!(marks(&[exact(2.0), exact(1.0)], 2, true), [true, false]);
        // Figures that are printed alike are equally good, and nothing is best of equals.
        let three = [exact(1.001), exact(1.002), exact(3.0)];
        assert_eq!(marks(&three, 2, false), [true, true, false]);
        assert_eq!(
            marks(&[exact(1.001), exact(1.002)], 2, false),
            [false, false]
        );
        assert_eq!(marks(&[exact(1.0)], 2, false), [false]);
        // Times: the fastest median is not the best where the rounds overlap.
        let time = |value, low, high| {
            Some(Measured {
                value,
                range: [low, high],
            })
        };
        let close = [time(1.0, 0.9, 1.2), time(1.1, 1.0, 1.3)];
        assert_eq!(marks(&close, 2, false), [false, false]);
        let apart = [close[0], close[1], time(1.5, 1.4, 1.6)];
        assert_eq!(marks(&apart, 2, false), [true, true, false]);
    }
}
