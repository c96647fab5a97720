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

/// Free text, such as the name of a lot or a driver, as Markdown that shows it letter by letter: nothing in it becomes
/// emphasis, a link or a column.
pub fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut before = None;
    let mut rest = text.chars().peekable();
    while let Some(letter) = rest.next() {
        // Within a word, as in `my_lot`, an underscore means nothing.
        let is_inner = |c: Option<char>| c.is_some_and(char::is_alphanumeric);
        let is_special = match letter {
            '\\' | '`' | '*' | '[' | ']' | '<' | '|' | '~' | '&' | '!' => true,
            '_' => !(is_inner(before) && is_inner(rest.peek().copied())),
            // What some renderers make links of by themselves.
            ':' => rest.peek() == Some(&'/'),
            '.' => out.to_lowercase().ends_with("www"),
            '@' => true,
            _ => false,
        };
        if is_special {
            out.push('\\');
        }
        // A line of its own could be a heading or a list.
        out.push(if letter.is_control() { ' ' } else { letter });
        before = Some(letter);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::page::Page;

    #[test]
    fn names_are_shown_as_they_are_and_never_become_links() {
        for name in [
            "run:runs/my_lot",
            "_x_ *y* `z`",
            "[here](https://x.y)",
            "<https://x.y>",
            "https://x.y/z",
            "www.x.y",
            "a|b",
            "a\\|b",
            "![seen](z.png)",
            "&lt;b&gt;",
            "me@x.y",
            "~~no~~",
        ] {
            let mut page = Page::new("x");
            page.text(format!("driver {} drove\n\n| driver |\n|---|\n| {} |", escaped(name), escaped(name)));
            let html = page.to_html();
            let shown = name.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
            let (text, table) = (format!("<p>driver {shown} drove</p>"), format!(">{shown}</td>"));
            assert!(html.contains(&text) && html.contains(&table), "{name}: {html}");
            assert!(!html.contains("<a ") && !html.contains("<img"), "{name}: {html}");
        }
        assert_eq!(escaped("run:runs/my_lot-2.toml"), "run:runs/my_lot-2.toml", "plain names stay readable");
    }
}
