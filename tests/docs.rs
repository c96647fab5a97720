//! What the docs name exists: links, sections, commands, flags, settings, paths.
//!
//! Faults are printed as `file:line: what`, all of them at once.

use crate::bench::{root, succeed, xtask};
use crate::tidy::each_source;
use pulldown_cmark::{CodeBlockKind, Event, Options, Parser, Tag, TagEnd};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Display;
use std::path::Path;

/// Folders whose paths are checked when the docs name them.
const FOLDERS: [&str; 22] = [
    "sim/",
    "storage/",
    "scenarios/",
    "expert/",
    "planners/",
    "policy/",
    "onnx/",
    "experiment/",
    "evaluation/",
    "report/",
    "benchmark/",
    "torture/",
    "digests/",
    "viewer/",
    "python/",
    "xtask/",
    "fuzz/src/",
    "fuzz/targets/",
    "tests/",
    "docs/",
    ".ci/",
    ".github/",
];
/// Tells what used to be; only its links are checked.
const HISTORY: &str = "CHANGELOG.md";

/// What `cargo xtask render results` writes by default, whatever run it is of.
const MADE: &str = "docs/results-COMMAND.md";

/// A piece of code in a page.
struct Code {
    line: usize,
    text: String,
}

/// A page of the docs.
struct Page {
    /// Relative to the root.
    name: String,
    /// What links to a heading: its slug on GitHub.
    anchors: BTreeSet<String>,
    /// Titles of headings.
    headings: Vec<String>,
    /// Targets of links and pictures.
    links: Vec<(usize, String)>,
    /// What stands in back-ticks.
    inline: Vec<Code>,
    /// Lines of code blocks, lines that are continued with a backslash joined.
    blocks: Vec<Code>,
}

impl Page {
    fn read(name: &str) -> Self {
        let text = std::fs::read_to_string(root().join(name)).unwrap();
        Self::parse(name, &text)
    }

    fn parse(name: &str, text: &str) -> Self {
        let mut page = Self {
            name: name.to_owned(),
            anchors: BTreeSet::new(),
            headings: Vec::new(),
            links: Vec::new(),
            inline: Vec::new(),
            blocks: Vec::new(),
        };
        let mut heading: Option<String> = None;
        let mut is_commands = false;
        for (event, range) in Parser::new_ext(text, Options::ENABLE_TABLES).into_offset_iter() {
            let line = line_of(text, range.start);
            match event {
                Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => {
                    page.links.push((line, dest_url.into_string()));
                }
                Event::Start(Tag::Heading { .. }) => heading = Some(String::new()),
                Event::End(TagEnd::Heading(_)) => {
                    let title = heading.take().unwrap_or_default();
                    page.anchors.insert(unused_slug(&title, &page.anchors));
                    page.headings.push(title);
                }
                Event::Start(Tag::CodeBlock(kind)) => {
                    is_commands = !matches!(&kind, CodeBlockKind::Fenced(language)
                        if !["", "sh", "bash", "console", "text"].contains(&language.as_ref()));
                }
                Event::End(TagEnd::CodeBlock) => is_commands = false,
                Event::Text(part) if is_commands => page.add_block(line, &part),
                Event::Text(part) => heading.iter_mut().for_each(|title| title.push_str(&part)),
                Event::Code(code) => {
                    if let Some(title) = &mut heading {
                        title.push_str(&code);
                    }
                    page.inline.push(Code { line, text: code.replace('\n', " ") });
                }
                _ => {}
            }
        }
        page
    }

    fn add_block(&mut self, first_line: usize, text: &str) {
        let mut continued: Option<Code> = None;
        for (line, part) in (first_line..).zip(text.lines()) {
            let mut code = continued.take().unwrap_or(Code { line, text: String::new() });
            if let Some(part) = part.strip_suffix('\\') {
                code.text.push_str(part);
                continued = Some(code);
            } else {
                code.text.push_str(part);
                self.blocks.push(code);
            }
        }
    }
}

/// Counted from 1.
fn line_of(text: &str, offset: usize) -> usize {
    text[..offset].matches('\n').count() + 1
}

/// GitHub's name of a heading's anchor.
fn slug(title: &str) -> String {
    let kept = title.trim().chars().filter(|&c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
    kept.flat_map(char::to_lowercase).map(|c| if c == ' ' { '-' } else { c }).collect()
}

fn unused_slug(title: &str, used: &BTreeSet<String>) -> String {
    let slug = slug(title);
    let numbered = (1..).map(|n| format!("{slug}-{n}"));
    std::iter::once(slug.clone()).chain(numbered).find(|candidate| !used.contains(candidate)).unwrap()
}

/// Every page, by its name.
fn pages() -> BTreeMap<String, Page> {
    let docs = ["docs", "docs/notebook"].into_iter().flat_map(|folder| {
        let entries = std::fs::read_dir(root().join(folder)).unwrap().map(|entry| entry.unwrap().file_name());
        entries.filter_map(move |name| Some(format!("{folder}/{}", name.to_str()?)))
    });
    let names = ["README.md", "CONTRIBUTING.md", HISTORY].map(str::to_owned).into_iter().chain(docs);
    let names = names.filter(|name| Path::new(name).extension().is_some_and(|extension| extension == "md"));
    names.map(|name| (name.clone(), Page::read(&name))).collect()
}

/// Pages that say what is, not what was.
fn of_today(pages: &BTreeMap<String, Page>) -> impl Iterator<Item = &Page> {
    pages.values().filter(|page| page.name != HISTORY)
}

/// Collects what is wrong, and says where.
#[derive(Default)]
struct Faults {
    seen: usize,
    faults: Vec<String>,
}

impl Faults {
    fn check(&mut self, is_right: bool, name: impl Display, line: usize, problem: impl FnOnce() -> String) {
        self.seen += 1;
        if !is_right {
            self.faults.push(format!("{name}:{line}: {}", problem()));
        }
    }

    /// Fails if something is wrong, or if so little was looked at that the check itself must be.
    fn report(self, at_least: usize) {
        assert!(self.faults.is_empty(), "\n{}\n", self.faults.join("\n"));
        assert!(self.seen >= at_least, "only {} were looked at", self.seen);
    }
}

/// A path without `.` and `..`, relative to the root; `None` if it leaves it.
fn normalised(path: &str) -> Option<String> {
    let mut parts: Vec<&str> = Vec::new();
    for part in path.split('/') {
        match part {
            "" | "." => {}
            ".." => {
                parts.pop()?;
            }
            part => parts.push(part),
        }
    }
    Some(parts.join("/"))
}

#[test]
fn every_link_leads_somewhere() {
    let pages = pages();
    let mut faults = Faults::default();
    for page in pages.values() {
        let folder = page.name.rsplit_once('/').map_or("", |(folder, _)| folder);
        for (line, target) in page.links.iter().filter(|(_, target)| !target.contains("://")) {
            let (path, anchor) = target.split_once('#').unwrap_or((target, ""));
            let path = if path.is_empty() { Some(page.name.clone()) } else { normalised(&format!("{folder}/{path}")) };
            let exists = path.as_ref().is_some_and(|path| root().join(path).exists());
            faults.check(exists, &page.name, *line, || format!("{target} leads to no file"));
            let linked = path.and_then(|path| pages.get(&path)).filter(|_| exists && !anchor.is_empty());
            if let Some(linked) = linked {
                let is_there = linked.anchors.contains(anchor);
                faults.check(is_there, &page.name, *line, || format!("{target}: {} has no such heading", linked.name));
            }
        }
    }
    faults.report(50);
}

/// Sections named after `methods.md`: `8.3`, `2.1 and 2.3`, `2.4, 2.5`, `6–7`, `E5.1`, also across the lines of a comment.
fn sections(after: &str) -> Vec<String> {
    let is_blank = |c: char| c.is_whitespace() || matches!(c, '/' | '!');
    let mut sections = Vec::new();
    let mut rest = after;
    loop {
        let start = rest.trim_start_matches(is_blank);
        if sections.is_empty() && start.len() == rest.len() {
            break;
        }
        let length = start.find(|c: char| !(c.is_ascii_digit() || c == '.' || c == 'E')).unwrap_or(start.len());
        let section = start[..length].trim_end_matches('.');
        if !section.trim_start_matches('E').starts_with(|c: char| c.is_ascii_digit()) {
            break;
        }
        sections.push(section.to_owned());
        let tail = start[section.len()..].trim_start_matches(is_blank);
        let next = [", ", "and ", "or ", "to ", "–"].iter().find_map(|separator| tail.strip_prefix(separator));
        let Some(next) = next else { break };
        rest = next;
    }
    sections
}

#[test]
fn sections_are_read_from_citations() {
    let table: [(&str, &[&str]); 7] = [
        (" 8.3).", &["8.3"]),
        (" 2.1 and 2.3.", &["2.1", "2.3"]),
        (" 2.4, 2.5).", &["2.4", "2.5"]),
        (" 3 and E5. The", &["3", "E5"]),
        (" 2.1–2.3", &["2.1", "2.3"]),
        ("\n    /// 4.4, as a", &["4.4"]),
        (": the planners", &[]),
    ];
    for (text, expected) in table {
        assert_eq!(sections(text), expected, "{text:?}");
    }
}

#[test]
fn every_cited_section_exists() {
    let pages = pages();
    let known: BTreeSet<&str> =
        pages["docs/methods.md"].headings.iter().filter_map(|title| title.split(' ').next()).collect();
    let mut faults = Faults::default();
    let mut look = |name: &str, text: &str, is_code: bool| {
        for (offset, cited) in text.match_indices("methods.md") {
            let line = line_of(text, offset);
            // A link is relative to its page.
            if is_code && !text[..offset].ends_with("](") {
                let has_folder = text[..offset].ends_with("docs/");
                faults.check(has_folder, name, line, || "write docs/methods.md".to_owned());
            }
            for section in sections(&text[offset + cited.len()..]) {
                let problem = || format!("docs/methods.md has no section {section}");
                faults.check(known.contains(section.as_str()), name, line, problem);
            }
        }
        for (offset, _) in text.match_indices(concat!("expert", "-findings")) {
            let problem = || "cite docs/methods.md E, with the section".to_owned();
            faults.check(false, name, line_of(text, offset), problem);
        }
        // Other pages that code refers to.
        for (offset, _) in text.match_indices("docs/").filter(|_| is_code) {
            let length = text[offset..].find(|c: char| !(c.is_alphanumeric() || "/.-_".contains(c)));
            let path = text[offset..].get(..length.unwrap_or(text.len() - offset)).unwrap().trim_end_matches('.');
            if Path::new(path).extension().is_some_and(|extension| extension == "md") {
                let exists = path == MADE || root().join(path).exists();
                let problem = || format!("there is no {path}");
                faults.check(exists, name, line_of(text, offset), problem);
            }
        }
    };
    for folder in FOLDERS.iter().filter(|folder| root().join(folder).is_dir()) {
        each_source(&root().join(folder), &mut |path, text| {
            if path != root().join("tests/docs.rs") {
                look(&path.strip_prefix(root()).unwrap().to_string_lossy(), text, true);
            }
        });
    }
    for page in of_today(&pages) {
        look(&page.name, &std::fs::read_to_string(root().join(&page.name)).unwrap(), false);
    }
    faults.report(100);
}

/// The help of commands, asked once each.
#[derive(Default)]
struct Helps(BTreeMap<Vec<String>, String>);

impl Helps {
    fn of(&mut self, command: &[&str]) -> &str {
        let key = command.iter().map(|&word| word.to_owned()).collect();
        self.0.entry(key).or_insert_with(|| succeed(xtask().args(command).arg("--help")))
    }

    /// Names of the commands below a command.
    fn commands(&mut self, command: &[&str]) -> BTreeSet<String> {
        let help = self.of(command);
        let listed = help.lines().skip_while(|line| *line != "Commands:").skip(1);
        let listed = listed.take_while(|line| line.starts_with("  "));
        // Wrapped descriptions are indented farther.
        let names = listed.filter(|line| !line.starts_with("   ")).filter_map(|line| line.split_whitespace().next());
        names.map(str::to_owned).collect()
    }

    fn has_flag(&mut self, command: &[&str], flag: &str) -> bool {
        let is_end = |c: char| !(c.is_alphanumeric() || c == '-');
        let ends = |rest: &str| rest.is_empty() || rest.starts_with(is_end);
        let help = self.of(command);
        let mut options = help.lines().map(str::trim_start).filter(|line| line.starts_with('-'));
        options.any(|line| line.match_indices(flag).any(|(at, _)| ends(&line[at + flag.len()..])))
    }
}

/// `NAME`, `<LOT>`, `…`: stands for something.
fn is_placeholder(word: &str) -> bool {
    word.contains(['<', '…', '[', '*', '{']) || word.chars().all(|c| c.is_uppercase() || c == '_' || c == ':')
}

/// The words of each `cargo xtask` in a line, without comment and whatever follows in the shell.
fn command_lines(line: &str) -> Vec<Vec<&str>> {
    let line = line.split(" # ").next().unwrap_or(line);
    let calls = line.split("cargo xtask").skip(1);
    calls
        .map(|call| {
            let words = call.split_whitespace().take_while(|word| !["|", "&&", ";", ">", "#"].contains(word));
            words.map(|word| word.trim_matches(['\'', '"', '[', ']'])).collect()
        })
        .collect()
}

#[test]
fn every_command_and_flag_exists() {
    let pages = pages();
    let keys = settings_keys();
    let mut helps = Helps::default();
    let mut faults = Faults::default();
    for page in of_today(&pages) {
        for code in page.inline.iter().chain(&page.blocks) {
            for words in command_lines(&code.text) {
                // Flags of every command may stand before its name, as in `--threads 1 evaluate`.
                let is_name = |word: &&str| !word.starts_with('-') && word.parse::<u32>().is_err();
                let at = words.iter().position(is_name).unwrap_or(0);
                let Some(&command) = words.get(at).filter(|word| !is_placeholder(word)) else { continue };
                let mut called: Vec<&str> = Vec::new();
                if !command.starts_with('-') {
                    let is_there = helps.commands(&[]).contains(command);
                    faults.check(is_there, &page.name, code.line, || format!("there is no command {command}"));
                    if !is_there {
                        continue;
                    }
                    called.push(command);
                    let below = helps.commands(&called);
                    if let Some(&sub) = words.get(at + 1).filter(|word| !below.is_empty() && !is_placeholder(word)) {
                        let is_there = below.contains(sub) || sub.starts_with('-');
                        faults.check(is_there, &page.name, code.line, || format!("there is no {command} {sub}"));
                        called.extend(below.contains(sub).then_some(sub));
                    }
                }
                for (i, word) in words.iter().enumerate().filter(|(_, word)| word.starts_with("--")) {
                    let flag = word.split('=').next().unwrap();
                    let problem = || format!("cargo xtask {} has no {flag}", called.join(" "));
                    faults.check(helps.has_flag(&called, flag), &page.name, code.line, problem);
                    let key = words.get(i + 1).filter(|_| flag == "--set").and_then(|change| change.split('=').next());
                    if let Some(key) = key.filter(|key| !is_placeholder(key)) {
                        let problem = || format!("there is no setting {key}");
                        faults.check(keys.contains(key), &page.name, code.line, problem);
                    }
                }
            }
        }
    }
    faults.report(40);
}

#[test]
fn command_lines_are_cut_where_the_shell_cuts_them() {
    let lines = command_lines("cargo xtask lots && cargo xtask evaluate --driver x | less # cargo xtask nothing");
    assert_eq!(lines, [vec!["lots"], vec!["evaluate", "--driver", "x"]]);
}

/// Every setting and section of any preset.
fn settings_keys() -> BTreeSet<String> {
    fn collect(prefix: &str, table: &toml::Table, keys: &mut BTreeSet<String>) {
        for (name, value) in table {
            let key = if prefix.is_empty() { name.clone() } else { format!("{prefix}.{name}") };
            if let toml::Value::Table(table) = value {
                collect(&key, table, keys);
            }
            keys.insert(key);
        }
    }
    let mut keys = BTreeSet::new();
    for preset in ["default", "paper", "smoke"] {
        let text = succeed(xtask().args(["settings", "--all", "--preset", preset]));
        collect("", &text.parse().unwrap(), &mut keys);
    }
    keys
}

#[test]
fn every_setting_exists() {
    let pages = pages();
    let keys = settings_keys();
    let mut faults = Faults::default();
    for page in of_today(&pages) {
        for code in &page.inline {
            let key = code.text.split(['=', ' ']).next().unwrap();
            let Some((section, rest)) = key.split_once('.') else { continue };
            let is_file = ["toml", "rs", "md", "csv", "json", "py"].contains(&rest);
            let is_settings = ["training", "evaluation", "dagger", "expert", "episode"].contains(&section) && !is_file;
            if is_settings && !is_placeholder(rest) {
                let problem = || format!("there is no setting {key}");
                faults.check(keys.contains(key), &page.name, code.line, problem);
            }
        }
    }
    faults.report(30);
}

#[test]
fn every_path_exists() {
    let pages = pages();
    let mut faults = Faults::default();
    for page in of_today(&pages) {
        for code in page.inline.iter().chain(&page.blocks) {
            for word in code.text.split([' ', '=', ',']) {
                let word = word.trim_end_matches(['.', ';', ')', ':']);
                let is_placeholder = word.contains(['*', '{', '<', '…', '$'])
                    || word.split('/').any(|part| part.starts_with("NAME") || part.starts_with("DIR"));
                if FOLDERS.iter().any(|folder| word.starts_with(folder)) && !is_placeholder {
                    let problem = || format!("there is no {word}");
                    faults.check(root().join(word).exists(), &page.name, code.line, problem);
                }
            }
        }
    }
    faults.report(40);
}

/// Whoever trains the default again compares it with this one.
#[test]
fn the_digest_of_the_network_that_ships_is_in_the_docs() {
    let sums = std::fs::read_to_string(root().join("policy/trained/default/sha256sums")).unwrap();
    let digest = sums.lines().find_map(|line| line.strip_suffix("  model.safetensors")).unwrap();
    let page = std::fs::read_to_string(root().join("docs/reliability.md")).unwrap();
    assert!(page.contains(digest), "docs/reliability.md has another digest than {digest} of the network that ships");
}

#[test]
fn a_page_is_read_as_people_see_it() {
    let text = "# One `two`\n\nSee [three](docs/x.md#four), `five.six`.\n\n```\ncargo xtask a \\\n  --b\n```\n\n```rust\ncargo xtask no\n\
                ```\n\n## One two\n\n| a |\n|---|\n| [t](t.md) `x \\| y` |\n";
    let page = Page::parse("page.md", text);
    assert_eq!(page.anchors, ["one-two", "one-two-1"].map(str::to_owned).into());
    assert_eq!(page.links, [(3, "docs/x.md#four".to_owned()), (18, "t.md".to_owned())]);
    let inline: Vec<(usize, &str)> = page.inline.iter().map(|code| (code.line, code.text.as_str())).collect();
    assert_eq!(inline, [(1, "two"), (3, "five.six"), (18, "x | y")]);
    let blocks: Vec<(usize, &str)> = page.blocks.iter().map(|code| (code.line, code.text.as_str())).collect();
    assert_eq!(blocks, [(6, "cargo xtask a   --b")]);
}
