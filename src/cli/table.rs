//! Tables on standard output, fitted to the terminal.

use comfy_table::{
    CellAlignment, ColumnConstraint, ContentArrangement, LineStyle, Row, Table, TableStyle, Width,
    presets::NOTHING,
};
use textwrap::core::display_width;

use super::terminal;

/// Table style with rules above the header, below it and at the end.
const RULED: TableStyle = TableStyle::new()
    .top_border(LineStyle::none().fill('─').junction('─'))
    .header_separator(LineStyle::none().fill('─').junction('─'))
    .bottom_border(LineStyle::none().fill('─').junction('─'));

/// Empty table with rules.
pub(super) fn ruled<T: Into<Row>>(header: T) -> Table {
    let mut table = Table::new();
    table.load_style(RULED).set_header(header);
    table
}

/// Empty table without rules.
pub(super) fn plain<T: Into<Row>>(header: T) -> Table {
    let mut table = Table::new();
    table.load_style(NOTHING).set_header(header);
    table
}

/// Table of names and descriptions, without a header.
pub(super) fn list(rows: impl IntoIterator<Item = [String; 2]>) -> Table {
    let mut table = Table::new();
    table.load_style(NOTHING).add_rows(rows);
    for column in table.column_iter_mut() {
        column.set_padding((0, 2));
    }
    table
}

/// Aligns columns to the right.
pub(super) fn align_right(table: &mut Table, columns: std::ops::Range<usize>) {
    for column in table.column_iter_mut().skip(columns.start).take(columns.len()) {
        column.set_cell_alignment(CellAlignment::Right);
    }
}

/// Formats a table for standard output: as wide as its contents, at most as wide as the terminal.
pub(super) fn fit(table: Table) -> String {
    fit_within(table, terminal::stdout_columns())
}

/// Formats a table within a number of columns. Cells are wrapped between words; if that does not
/// suffice and there is a header, each row becomes a block of lines, one per cell.
fn fit_within(mut table: Table, columns: Option<u16>) -> String {
    let whole = table.trim_fmt();
    let width = table.lines().map(|line| display_width(&line)).max().unwrap_or_default();
    let Some(columns) = columns.filter(|columns| width > usize::from(*columns)) else {
        return whole;
    };
    // Padding and space between columns.
    let contents: u16 = table.column_max_content_widths().iter().sum();
    let between = width.saturating_sub(contents.into());
    let narrowest = narrowest(&table);
    let is_too_narrow = usize::from(narrowest.iter().sum::<u16>()) + between > usize::from(columns);
    if is_too_narrow && table.header().is_some() {
        return blocks(&table, columns);
    }
    table.set_content_arrangement(ContentArrangement::Dynamic).set_width(columns);
    let widest = table.column_max_content_widths();
    for ((column, min), max) in table.column_iter_mut().zip(narrowest).zip(widest) {
        let width = Width::Fixed(min + column.padding_width());
        column.set_constraint(match max <= min {
            true => ColumnConstraint::ContentWidth,
            false => ColumnConstraint::LowerBoundary(width),
        });
    }
    table.trim_fmt()
}

fn rows(table: &Table) -> impl Iterator<Item = &Row> {
    table.header().into_iter().chain(table.row_iter())
}

/// Width of the longest word of each column.
fn narrowest(table: &Table) -> Vec<u16> {
    let mut widths = vec![0; table.column_iter().count()];
    for row in rows(table) {
        for (width, cell) in widths.iter_mut().zip(row.cell_iter()) {
            let content = cell.content();
            let words = content.split_whitespace().map(display_width);
            *width = words.fold(*width, |width, word| width.max(word as u16));
        }
    }
    widths
}

/// Formats each row as lines `HEADER  CELL`, with an empty line between rows.
fn blocks(table: &Table, columns: u16) -> String {
    let header: Vec<String> =
        table.header().into_iter().flat_map(Row::cell_iter).map(|cell| cell.content()).collect();
    let widths = header.iter().map(|name| display_width(name));
    let indent = widths.max().unwrap_or_default() + 2;
    let room = usize::from(columns).saturating_sub(indent).max(10);
    let block = |row: &Row| {
        let mut text = String::new();
        for (name, cell) in header.iter().zip(row.cell_iter()) {
            let content = cell.content();
            for (number, line) in textwrap::wrap(&content, room).iter().enumerate() {
                let name = if number == 0 { name.as_str() } else { "" };
                let gap = indent - display_width(name);
                text += &format!("{name}{:gap$}{line}", "");
                text.truncate(text.trim_end().len());
                text.push('\n');
            }
        }
        text
    };
    let blocks: Vec<String> = table.row_iter().map(block).collect();
    blocks.join("\n").trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Table {
        let mut table = ruled(["range", "path"]);
        table.add_row(["0.8270 m", "south wall, north wall, south wall"]);
        table.add_row(["1.2 m", "east wall"]);
        align_right(&mut table, 0..1);
        table
    }

    fn widest(text: &str) -> usize {
        text.lines().map(display_width).max().unwrap_or_default()
    }

    #[test]
    fn whole_without_a_terminal() {
        let text = fit_within(sample(), None);
        assert!(text.contains(" 0.8270 m   south wall, north wall, south wall\n"), "{text}");
        assert!(text.lines().all(|line| !line.ends_with(' ')), "{text}");
    }

    #[test]
    fn words_wrap_in_a_terminal() {
        for columns in [24, 30, 40, 45] {
            let text = fit_within(sample(), Some(columns));
            assert!(widest(&text) <= usize::from(columns), "{columns}: {text}");
            for word in ["0.8270", "north", "east", "wall"] {
                assert!(text.contains(word), "{columns}: {text}");
            }
        }
    }

    #[test]
    fn blocks_in_a_narrow_terminal() {
        let mut table = sample();
        table.add_row(["a-word-that-is-longer-than-the-terminal", ""]);
        let text = fit_within(table, Some(30));
        assert!(text.starts_with("range  0.8270 m\npath   south wall, north"), "{text}");
        assert!(text.contains("\n\nrange  1.2 m\n"), "{text}");
        assert!(widest(&text) <= 30, "{text}");
    }
}
