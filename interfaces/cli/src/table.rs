//! Tables for terminals.

use antumbra_lab::Table;
use comfy_table::{CellAlignment, LineStyle, TableStyle};

use crate::progress::line::{COLUMNS, wrapped};

/// Words over a thin line over the cells, nothing else.
const PLAIN: TableStyle =
    TableStyle::new().header_separator(LineStyle::none().fill('─').junction('─'));

/// Draws a table without its caption. The first column is text, the others are figures, aligned to the right. Every
/// word of a heading has a line of its own, so that the columns are narrow.
pub fn draw(header: &[&str], rows: &[Vec<String>]) -> String {
    let mut table = comfy_table::Table::new();
    table.load_style(PLAIN);
    table
        .set_header(header.iter().map(|text| text.replace(' ', "\n")))
        .add_rows(rows.to_vec());
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table.to_string()
}

/// Draws tables under their captions, each with an empty line after it. With `narrow`, a table that is wider than a
/// terminal goes on below, with its first column again.
pub fn draw_all(tables: &[Table], narrow: bool) -> String {
    let draw = |table: &Table| {
        if narrow {
            let cells = draw_narrow(&table.header, &table.rows);
            format!("{}\n{cells}\n\n", wrapped(&table.caption))
        } else {
            format!(
                "{}\n{}\n\n",
                table.caption,
                draw(&table.header, &table.rows)
            )
        }
    };
    tables.iter().map(draw).collect()
}

/// Draws a table in as many parts as it takes to fit a terminal.
fn draw_narrow(header: &[&str], rows: &[Vec<String>]) -> String {
    let columns = header.len();
    let part = |range: std::ops::Range<usize>| {
        let places = || std::iter::once(0).chain(range.clone());
        let header: Vec<_> = places().map(|place| header[place]).collect();
        let mut part = Vec::new();
        for row in rows {
            part.push(
                places()
                    .filter_map(|place| row.get(place).cloned())
                    .collect(),
            );
        }
        draw(&header, &part)
    };
    let fits = |text: &str| text.lines().all(|line| line.chars().count() <= COLUMNS);
    let (mut parts, mut first) = (Vec::new(), 1.min(columns));
    loop {
        let mut end = columns;
        // A column that does not fit by itself is drawn as it is.
        while end > first + 1 && !fits(&part(first..end)) {
            end -= 1;
        }
        parts.push(part(first..end));
        if end >= columns {
            return parts.join("\n\n");
        }
        first = end;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wide_tables_go_on_below() {
        let header: Vec<String> = (0..20).map(|i| format!("column {i}")).collect();
        let header: Vec<&str> = header.iter().map(String::as_str).collect();
        let rows = vec![(0..20).map(|i| format!("cell-{i}")).collect::<Vec<_>>(); 2];
        let text = draw_narrow(&header, &rows);
        assert!(text.lines().all(|line| line.chars().count() <= COLUMNS));
        assert_eq!(
            text.matches("cell-0").count(),
            2 * text.matches("\n\n").count() + 2
        );
        for column in 1..20 {
            let cell = format!("cell-{column}");
            let cells = text.split_whitespace().filter(|word| *word == cell);
            assert_eq!(cells.count(), 2, "{cell}");
        }
        let narrow = draw(&header[..3], &[rows[0][..3].to_vec()]);
        assert_eq!(draw_narrow(&header[..3], &[rows[0][..3].to_vec()]), narrow);
    }
}
