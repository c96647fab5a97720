//! Tables that are both readable in a terminal and Markdown.

use comfy_table::{ContentArrangement, Table, presets};

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

/// The text for a terminal: cells of tables that are wider than `width` columns, and other lines, are wrapped. Files keep
/// the text as it is, because a row of Markdown is one line.
pub fn fit(text: &str, width: usize) -> String {
    let lines: Vec<&str> = text.lines().collect();
    let is_row = |line: &str| line.starts_with('|');
    let mut fitted = Vec::new();
    for block in lines.chunk_by(|a, b| is_row(a) == is_row(b)) {
        if !is_row(block[0]) {
            fitted.extend(block.iter().map(|line| wrap(line, width)));
        } else if block.iter().all(|line| line.chars().count() <= width) {
            fitted.extend(block.iter().map(|&line| line.to_owned()));
        } else {
            fitted.push(fit_table(block, width));
        }
    }
    fitted.join("\n")
}

fn fit_table(rows: &[&str], width: usize) -> String {
    let cells =
        |row: &str| -> Vec<String> { row.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect() };
    // The second row of Markdown is the rule below the header.
    let mut table = with_header(cells(rows[0]));
    table.set_content_arrangement(ContentArrangement::Dynamic).set_width(u16::try_from(width).unwrap_or(u16::MAX));
    for row in rows.iter().skip(2) {
        table.add_row(cells(row));
    }
    table.to_string()
}

/// Breaks a line at spaces.
fn wrap(line: &str, width: usize) -> String {
    let mut wrapped = String::new();
    let mut column = 0;
    for word in line.split(' ') {
        let length = word.chars().count();
        if column > 0 && column + 1 + length > width {
            wrapped.push('\n');
            column = 0;
        } else if !wrapped.is_empty() {
            wrapped.push(' ');
            column += 1;
        }
        wrapped.push_str(word);
        column += length;
    }
    wrapped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_fits_stays_and_what_does_not_is_wrapped_without_losing_a_word() {
        let mut table = table_of(&["driver", "what was found"]);
        table.add_row(["one", "a few words"]);
        let text = format!("Title\n\n{table}\n\nA sentence of a few more words.");
        assert_eq!(fit(&text, 100), text);
        let narrow = fit(&text, 20);
        assert!(narrow.lines().all(|line| line.chars().count() <= 20), "{narrow}");
        let words = |text: &str| -> Vec<String> {
            let mut words: Vec<String> = text.split([' ', '|', '\n', '-']).map(str::to_owned).collect();
            words.retain(|word| !word.is_empty());
            words.sort();
            words
        };
        assert_eq!(words(&narrow), words(&text));
    }
}
