//! Tables that are both readable in a terminal and Markdown.

use comfy_table::{Table, presets};

/// A table with this header.
pub fn with_header(header: Vec<String>) -> Table {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN).set_header(header);
    table
}

/// The same of fixed titles.
pub fn table_of(header: &[&str]) -> Table {
    with_header(header.iter().map(|&title| title.to_owned()).collect())
}
