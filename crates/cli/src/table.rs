//! Tables for terminals.

use antumbra_lab::Table;
use comfy_table::{CellAlignment, LineStyle, TableStyle};

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

/// Draws tables under their captions, each with an empty line after it.
pub fn draw_all(tables: &[Table]) -> String {
    let draw = |table: &Table| {
        let cells = draw(&table.header, &table.rows);
        format!("{}\n{cells}\n\n", table.caption)
    };
    tables.iter().map(draw).collect()
}
