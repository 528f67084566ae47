//! Tables for terminals and Markdown, from the same cells.

use comfy_table::{CellAlignment, LineStyle, Table, TableStyle, presets};

/// How a table is drawn.
#[derive(Clone, Copy, Debug)]
pub enum Form {
    Terminal,
    Markdown,
}

/// Words over a thin line over the cells, nothing else.
const PLAIN: TableStyle =
    TableStyle::new().header_separator(LineStyle::none().fill('─').junction('─'));

/// Draws a table. The first column is text, the others are figures, aligned to the right. On a terminal
/// every word of a heading has a line of its own, so that the columns are narrow.
pub fn draw(form: Form, header: &[&str], rows: &[Vec<String>]) -> String {
    let mut table = Table::new();
    table.load_style(match form {
        Form::Terminal => PLAIN,
        Form::Markdown => presets::ASCII_MARKDOWN,
    });
    let heading = |text: &&str| match form {
        Form::Terminal => text.replace(' ', "\n"),
        Form::Markdown => (*text).to_owned(),
    };
    table
        .set_header(header.iter().map(heading))
        .add_rows(rows.to_vec());
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table.to_string()
}

/// A number with so many decimals, or a dash.
pub fn number(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(|| "-".to_owned(), |value| format!("{value:.decimals$}"))
}

/// A count with its thousands apart.
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
        let rows = [
            vec!["sort+".into(), "1.5".into()],
            vec!["simple".into(), "-".into()],
        ];
        let text = draw(Form::Markdown, &["order", "cost"], &rows);
        assert_eq!(text.lines().count(), 4);
        assert!(
            text.lines().all(|line| line.matches('|').count() == 3),
            "{text}"
        );
    }
}
