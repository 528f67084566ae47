//! Tables: a caption over cells, drawn as Markdown here and on a terminal by whoever has one.

use comfy_table::{CellAlignment, presets};

/// A table of text. The first column is words, the others are figures.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Table {
    /// Subject of the table, in one line.
    pub caption: String,
    /// Heading of every column.
    pub header: Vec<&'static str>,
    /// Cells, as many per row as there are columns.
    pub rows: Vec<Vec<String>>,
}

/// Heading of a column, and the cell of a row.
pub(crate) type Column<'a, T> = (&'static str, &'a dyn Fn(&T) -> String);

impl Table {
    /// A table of rows by columns.
    pub(crate) fn of<'r, T: 'r>(
        caption: String,
        rows: impl IntoIterator<Item = &'r T>,
        columns: &[Column<T>],
    ) -> Self {
        let cells = |row: &T| columns.iter().map(|(_, cell)| cell(row)).collect();
        Self {
            caption,
            header: columns.iter().map(|(name, _)| *name).collect(),
            rows: rows.into_iter().map(cells).collect(),
        }
    }

    /// The table as Markdown, without its caption. Figures are aligned to the right.
    pub fn markdown(&self) -> String {
        let mut table = comfy_table::Table::new();
        table.load_style(presets::ASCII_MARKDOWN);
        table
            .set_header(self.header.iter().copied())
            .add_rows(self.rows.iter().cloned());
        for column in table.column_iter_mut().skip(1) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        table.to_string()
    }
}

/// A number with so many decimals, or a dash.
pub fn number(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(|| "-".to_owned(), |value| format!("{value:.decimals$}"))
}

/// A count with its thousands apart: `1 234 567`.
pub fn count(value: u64) -> String {
    let digits = value.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(' ');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thousands_stand_apart() {
        for (value, text) in [
            (0, "0"),
            (999, "999"),
            (1000, "1 000"),
            (1234567, "1 234 567"),
        ] {
            assert_eq!(count(value), text);
        }
    }

    #[test]
    fn a_markdown_table_has_as_many_bars_in_every_line() {
        let table = Table {
            caption: "Orders".into(),
            header: vec!["order", "cost"],
            rows: vec![
                vec!["sort+".into(), "1.5".into()],
                vec!["simple".into(), "-".into()],
            ],
        };
        let text = table.markdown();
        assert_eq!(text.lines().count(), 4);
        assert!(
            text.lines().all(|line| line.matches('|').count() == 3),
            "{text}"
        );
    }
}
