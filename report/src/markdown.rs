//! Tables that are both readable in a terminal and Markdown.

use comfy_table::{Table, presets};
use std::collections::BTreeSet;

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

/// The text for a terminal, without the backslashes of [`escaped`]: cells of tables that are wider than `width` columns, and
/// other lines, are wrapped. Files keep the text as it is, because a row of Markdown is one line.
pub fn fit(text: &str, width: usize) -> String {
    let lines: Vec<String> = text.lines().map(unescaped).collect();
    let is_row = |line: &str| line.starts_with('|');
    let mut fitted = Vec::new();
    for block in lines.chunk_by(|a, b| is_row(a) == is_row(b)) {
        if !is_row(&block[0]) {
            fitted.extend(block.iter().flat_map(|line| wrap(line, width)));
        } else if block.iter().all(|line| length(line) <= width) {
            fitted.extend_from_slice(block);
        } else {
            fitted.extend(fit_table(block, width));
        }
    }
    fitted.join("\n")
}

/// A table without its empty columns, with cells of several lines.
fn fit_table(rows: &[String], width: usize) -> Vec<String> {
    let mut rows: Vec<Vec<String>> = rows.iter().map(|row| cells(row)).collect();
    // The second row of Markdown is the rule below the header.
    rows.remove(1);
    let columns = rows.iter().map(Vec::len).min().unwrap_or(0);
    let is_used = |&column: &usize| rows.iter().skip(1).any(|row| !row[column].is_empty());
    let used: Vec<usize> = (0..columns).filter(is_used).collect();
    let columns: Vec<Vec<String>> = used
        .iter()
        .map(|&column| {
            let cells: Vec<&str> = rows.iter().map(|row| row[column].as_str()).collect();
            with_short_paths(&cells)
        })
        .collect();
    let rows: Vec<Vec<String>> =
        (0..rows.len()).map(|row| columns.iter().map(|column| column[row].clone()).collect()).collect();
    let widths = widths(&rows, width);
    let mut lines = Vec::new();
    for (index, row) in rows.iter().enumerate() {
        let cells: Vec<Vec<String>> = row.iter().zip(&widths).map(|(cell, &width)| wrap(cell, width)).collect();
        for line in 0..cells.iter().map(Vec::len).max().unwrap_or(0) {
            let part = |(cell, &width): (&Vec<String>, &usize)| {
                let text = cell.get(line).map_or("", String::as_str);
                format!(" {text}{} ", " ".repeat(width.saturating_sub(length(text))))
            };
            lines.push(format!("|{}|", cells.iter().zip(&widths).map(part).collect::<Vec<_>>().join("|")));
        }
        if index == 0 {
            let rule: Vec<String> = widths.iter().map(|width| "-".repeat(width + 2)).collect();
            lines.push(format!("|{}|", rule.join("|")));
        }
    }
    lines
}

/// The cells of a row; what is [`escaped`] in one ends none.
fn cells(row: &str) -> Vec<String> {
    let row = row.strip_prefix('|').unwrap_or(row);
    let row = row.strip_suffix('|').unwrap_or(row);
    let mut before = ' ';
    let ends_cell = |letter| std::mem::replace(&mut before, letter) != '\\' && letter == '|';
    row.split(ends_cell).map(|cell| cell.trim().to_owned()).collect()
}

/// The cells of a column without the first folders of paths, as in `run:…/mine/bc`; cells that differ still do.
fn with_short_paths(cells: &[&str]) -> Vec<String> {
    let different = |cells: &mut dyn Iterator<Item = String>| cells.collect::<BTreeSet<_>>().len();
    let all = different(&mut cells.iter().map(|&cell| cell.to_owned()));
    let longest = cells.iter().map(|cell| cell.split('/').count()).max().unwrap_or(0);
    let short = |folders: usize| cells.iter().map(move |cell| with_short_path(cell, folders));
    let folders = (2..longest).find(|&folders| different(&mut short(folders)) == all);
    short(folders.unwrap_or(longest)).collect()
}

/// A driver's path with no more than its last parts; other text, such as a replay key or a file, as it is: it is copied.
fn with_short_path(cell: &str, parts: usize) -> String {
    let Some((kind, path)) = cell.split_once(':').filter(|_| !cell.contains([' ', ',', '@'])) else {
        return cell.to_owned();
    };
    let names: Vec<&str> = path.split('/').collect();
    if names.len() <= parts {
        return cell.to_owned();
    }
    format!("{kind}:…/{}", names[names.len() - parts..].join("/"))
}

/// Widths of the columns that make a table `width` wide: the widest become narrower first, none narrower than its longest
/// word as long as another one can, and then none narrower than its longest piece.
fn widths(rows: &[Vec<String>], width: usize) -> Vec<usize> {
    const BROKEN: usize = 8;
    let of = |measure: &dyn Fn(&str) -> usize| -> Vec<usize> {
        (0..rows[0].len()).map(|column| rows.iter().map(|row| measure(&row[column])).max().unwrap_or(0)).collect()
    };
    let mut widths = of(&length);
    let least = [
        of(&|cell| words(cell).map(length).max().unwrap_or(0)),
        of(&|cell| pieces(cell).map(length).max().unwrap_or(0)),
        vec![BROKEN; widths.len()],
    ];
    let room = width.saturating_sub(3 * widths.len() + 1);
    while widths.iter().sum::<usize>() > room {
        let widest = |least: &Vec<usize>| {
            (0..widths.len()).filter(|&column| widths[column] > least[column]).max_by_key(|&column| widths[column])
        };
        let Some(column) = least.iter().find_map(widest) else { break };
        widths[column] -= 1;
    }
    widths
}

/// Parts of a text between which a line may end: at spaces, but not within brackets.
fn words(text: &str) -> impl Iterator<Item = &str> {
    let mut depth = 0_u32;
    text.split(move |c: char| {
        depth = match c {
            '[' | '(' => depth + 1,
            ']' | ')' => depth.saturating_sub(1),
            _ => depth,
        };
        c == ' ' && depth == 0
    })
}

/// What a line of a word that is too long may end with.
const BREAKS: [char; 3] = ['/', ':', '-'];

/// Parts of a text between which a line may end where words are too long: at any space, and behind [`BREAKS`].
fn pieces(text: &str) -> impl Iterator<Item = &str> {
    text.split(' ').flat_map(|word| word.split_inclusive(BREAKS))
}

/// Lines of at most `width`. What is longer is broken, if it can be between its pieces.
fn wrap(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    let within = |text| if length(text) <= width { vec![text] } else { text.split(' ').collect() };
    for word in words(text).flat_map(within) {
        let line = lines.last_mut().expect("there is one from the start");
        if line.is_empty() {
            line.push_str(word);
        } else if length(line) + 1 + length(word) <= width {
            line.push(' ');
            line.push_str(word);
        } else {
            lines.push(word.to_owned());
        }
        while let Some(line) = lines.last_mut()
            && length(line) > width
            && let Some((end, _)) = line.char_indices().nth(width.max(1))
        {
            let is_next_whole = |at: usize| pieces(&line[at..]).next().is_some_and(|next| length(next) <= width);
            // What is broken anyway leaves no short line behind.
            let between = line[..end].rfind(BREAKS).map(|at| at + 1);
            let between = between.filter(|&at| 2 * at > end || is_next_whole(at));
            let end = between.unwrap_or(end);
            let rest = line.split_off(end);
            lines.push(rest);
        }
    }
    lines
}

/// Columns of a terminal, near enough: combining marks, as in η̂, take none.
fn length(text: &str) -> usize {
    text.chars().filter(|c| !('\u{300}'..='\u{36f}').contains(c)).count()
}

/// What [`escaped`] always puts a backslash before, beside bars …
const ALWAYS: [char; 10] = ['\\', '`', '*', '[', ']', '<', '~', '&', '!', '@'];
/// … and now and then.
const SOMETIMES: [char; 3] = ['_', ':', '.'];

/// A line without the backslashes of [`escaped`]; bars keep theirs, by which they are told from the edges of cells. A cell is
/// filled up by what it loses, so that columns stay below each other.
fn unescaped(line: &str) -> String {
    let is_row = line.starts_with('|');
    let mut out = String::with_capacity(line.len());
    let mut lost = 0;
    let mut rest = line.chars().peekable();
    while let Some(letter) = rest.next() {
        match (letter, rest.peek().copied()) {
            ('\\', Some('|')) => {
                out.push_str("\\|");
                rest.next();
            }
            ('\\', Some(next)) if ALWAYS.contains(&next) || SOMETIMES.contains(&next) => {
                out.push(next);
                lost += 1;
                rest.next();
            }
            ('|', _) if is_row => {
                out.extend(std::iter::repeat_n(' ', lost));
                out.push('|');
                lost = 0;
            }
            _ => out.push(letter),
        }
    }
    out
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
            _ if letter == '|' || ALWAYS.contains(&letter) => true,
            '_' => !(is_inner(before) && is_inner(rest.peek().copied())),
            // What some renderers make links of by themselves; a driver's path has one slash.
            ':' => rest.clone().take(2).eq(['/', '/']),
            '.' => out.to_lowercase().ends_with("www"),
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
    fn what_fits_stays_and_what_does_not_is_wrapped_without_losing_a_word() {
        let mut table = table_of(&["driver", "empty", "what was found", "interval"]);
        table.add_row(["one", "", "a few words", "0.00 [0.00, 2.65]"]);
        let text = format!("Title\n\n{table}\n\nA sentence of a few more words than fit here.");
        assert_eq!(fit(&text, 100), text);
        let expected = "\
Title

| driver | what was    | interval     |
|        | found       |              |
|--------|-------------|--------------|
| one    | a few words | 0.00         |
|        |             | [0.00, 2.65] |

A sentence of a few more words than fit
here.";
        assert_eq!(fit(&text, 39), expected);
        let broken = fit("| header |\n|--------|\n| run:runs/a-long-name |", 13);
        assert_eq!(broken, "| header    |\n|-----------|\n| run:runs/ |\n| a-long-   |\n| name      |");
        assert_eq!(fit("more (than one line has room for) of it", 20), "more (than one line\nhas room for) of it");
    }

    /// Figures of a driver whose path has a bar stood under other headings.
    #[test]
    fn a_bar_in_a_name_moves_no_other_cell() {
        let mut table = table_of(&["driver", "rate"]);
        table.add_row([escaped("run:a|b"), "0.12".to_owned()]);
        let expected = "\
| driver | rate |
|--------|------|
| run:   | 0.12 |
| a\\|b   |      |";
        assert_eq!(fit(&table.to_string(), 15), expected);
    }

    /// A terminal showed `run:\_mine\_`, and `\*` for a mark.
    #[test]
    fn a_terminal_shows_names_without_backslashes() {
        let mut table = table_of(&["driver", "rate"]);
        table.add_row([escaped("run:_mine_"), "0.12".to_owned()]);
        table.add_row(["expert", "0.01"]);
        let expected = "\
| driver       | rate |
|--------------|------|
| run:_mine_   | 0.12 |
| expert       | 0.01 |";
        assert_eq!(fit(&table.to_string(), 100), expected);
        let narrow = "\
| driver | rate |
|--------|------|
| run:   | 0.12 |
| _mine_ |      |
| expert | 0.01 |";
        assert_eq!(fit(&table.to_string(), 17), narrow);
        let name = "_x_ *y* `z` <w> a|b c\\d ~!@[&] www.a.b https://c";
        let sentence = format!("differs \\* from {}", escaped(name));
        assert_eq!(fit(&sentence, 100), format!("differs * from {}", name.replace('|', "\\|")));
    }

    /// `trained:default` was broken behind its `d`, and `reversals` before its last letter, where the pieces had room.
    #[test]
    fn words_are_not_torn_apart_where_the_table_fits_otherwise() {
        let mut table = table_of(&["driver", "least clearance m", "reversals /100 m"]);
        table.add_row(["trained:default", "0.20", "31.6"]);
        let expected = "\
| driver   | least     | reversals |
|          | clearance | /100 m    |
|          | m         |           |
|----------|-----------|-----------|
| trained: | 0.20      | 31.6      |
| default  |           |           |";
        assert_eq!(fit(&table.to_string(), 36), expected);
        assert_eq!(wrap("run:train-dagger-default-s1", 14), ["run:train-", "dagger-", "default-s1"]);
        assert_eq!(wrap("a:bbbbbbbbbbbb", 6), ["a:bbbb", "bbbbbb", "bb"], "no line for a letter");
    }

    #[test]
    fn long_paths_are_shown_by_their_ends_as_long_as_these_differ() {
        let short = |cells: &[&str]| with_short_paths(cells).join(" ");
        assert_eq!(
            short(&["run:/work/runs/a", "run:/work/runs/a/bc", "dwa:/work/tuned/dwa.toml", "dwa/fox", "run:runs/b"]),
            "run:…/runs/a run:…/a/bc dwa:…/tuned/dwa.toml dwa/fox run:runs/b"
        );
        assert_eq!(short(&["run:/x/1/runs/a", "run:/x/2/runs/a"]), "run:…/1/runs/a run:…/2/runs/a");
        for copied in ["steering rad/100 m of a/b/c", "lots/of/mine.toml", "run:runs/a/b@lot-b@forward@0@paper@1@0"] {
            assert_eq!(short(&[copied]), copied);
        }
    }

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
            "a \"b\"",
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
        for plain in ["run:runs/my_lot-2.toml", "run:/work/runs/a", "DAgger, α = 0"] {
            assert_eq!(escaped(plain), plain, "plain names stay readable");
        }
    }
}
