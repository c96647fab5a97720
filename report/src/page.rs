//! A report as Markdown with its figures beside it, and as one HTML page that loads nothing: no font, no file, nothing
//! from the network, which its content security policy forbids. Its only script plays pictures; without it they stand
//! still.
//!
//! ```
//! use report::page::{Image, Page};
//! let mut page = Page::new("Near-collisions");
//! page.section("Rates", "| driver | per 100 m |\n|---|---|\n| expert | 0.00 |");
//! page.figure("rates", "Rates with intervals of 95 %.", Image::Svg("<svg viewBox='0 0 1 1'/>".to_owned()));
//! assert!(page.to_html().contains("<table>"));
//! assert!(page.to_markdown().contains("](figures/rates.svg)"));
//! ```

use crate::markdown::escaped as escaped_markdown;
use crate::pictures::file_name;
use anyhow::Context as _;
use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use experiment::run_dir::RunDir;
use pulldown_cmark::{CowStr, Event, Options, Parser, Tag, TagEnd, html};
use sha2::{Digest as _, Sha256};
use std::borrow::Cow;
use std::fmt::Write as _;
use std::path::Path;
use storage::sums;

/// What made the page.
const PROGRAM: &str = concat!("lotpilot ", env!("CARGO_PKG_VERSION"));
/// Folder of the figures, beside the Markdown.
const FIGURES: &str = "figures";

/// A report, part by part in the order of reading.
#[derive(Debug, Clone)]
pub struct Page {
    title: String,
    parts: Vec<Part>,
}

/// A picture.
#[derive(Debug, Clone)]
pub enum Image {
    /// The text of an SVG file.
    Svg(String),
    /// The bytes of a PNG file.
    Png(Vec<u8>),
    /// Pictures to be played.
    Player(Player),
}

/// Pictures over one background, with a button and a slider; a still where no script runs.
#[derive(Debug, Clone)]
pub struct Player {
    /// What it shows, for who does not see it.
    pub title: String,
    /// Width and height.
    pub size_px: [f32; 2],
    /// SVG elements under every picture.
    pub background: String,
    /// What is written beside the slider, and SVG elements.
    pub frames: Vec<(String, String)>,
    /// The picture that is shown first, and where no script runs.
    pub still: usize,
    /// Pictures per second.
    pub rate_per_s: f32,
}

impl Player {
    fn svg(&self, frames: &str) -> String {
        let [width, height] = self.size_px;
        format!(
            "<svg role=\"img\" xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\">\n<title>{}</title>\n\
             {}{frames}</svg>\n",
            escaped(&self.title),
            self.background
        )
    }

    /// The still as a file.
    fn to_svg(&self) -> String {
        self.svg(self.frames.get(self.still).map_or("", |(_, elements)| elements.as_str()))
    }

    fn to_html(&self) -> String {
        let mut frames = String::new();
        for (index, (label, elements)) in self.frames.iter().enumerate() {
            let display = if index == self.still { "" } else { " display=\"none\"" };
            let _ =
                write!(frames, "<g class=\"frame\" data-label=\"{}\"{display}>\n{elements}</g>\n", attribute(label));
        }
        format!(
            "<div class=\"player\" data-period-ms=\"{:.0}\">{}<div class=\"controls\" hidden>\
             <button type=\"button\">Play</button>\
             <input type=\"range\" min=\"0\" max=\"{}\" value=\"{}\" aria-label=\"time\"><output></output></div></div>",
            1000.0 / self.rate_per_s,
            self.svg(&frames),
            self.frames.len().saturating_sub(1),
            self.still
        )
    }
}

#[derive(Debug, Clone)]
enum Part {
    /// Heading of the second level; its place is the anchor of the table of contents.
    Heading(String),
    Markdown(String),
    Figure {
        name: String,
        caption: String,
        image: Image,
    },
}

impl Page {
    /// An empty page.
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), parts: Vec::new() }
    }

    /// Adds Markdown, tables included; HTML in it is shown as text, pictures as their description.
    pub fn text(&mut self, markdown: impl Into<String>) -> &mut Self {
        self.parts.push(Part::Markdown(markdown.into()));
        self
    }

    /// Adds a heading, which the table of contents lists, with Markdown under it.
    pub fn section(&mut self, title: impl Into<String>, markdown: impl Into<String>) -> &mut Self {
        self.parts.push(Part::Heading(title.into()));
        let markdown = markdown.into();
        if markdown.is_empty() { self } else { self.text(markdown) }
    }

    /// Whether there is a picture of this name.
    pub fn has_figure(&self, wanted: &str) -> bool {
        self.parts.iter().any(|part| matches!(part, Part::Figure { name, .. } if name == wanted))
    }

    /// Adds a picture. `name`: its file without ending; `caption`: Markdown.
    pub fn figure(&mut self, name: impl Into<String>, caption: impl Into<String>, image: Image) -> &mut Self {
        self.parts.push(Part::Figure { name: name.into(), caption: caption.into(), image });
        self
    }

    /// Writes `STEM.md`, `STEM.html` and `figures/` into the folder of a run, and lists them.
    ///
    /// # Errors
    /// If a file cannot be written, or the folder was deleted or moved meanwhile.
    pub fn write(&self, run: &RunDir, stem: &str) -> anyhow::Result<()> {
        let figures = self.parts.iter().filter_map(|part| match part {
            Part::Figure { name, image, .. } => Some((image.file(name), image.bytes().into_owned())),
            _ => None,
        });
        run.ensure_held()?;
        sums::write_folder(run.path(), FIGURES, figures)?;
        run.write(&format!("{stem}.md"), self.to_markdown().as_bytes())?;
        run.write(&format!("{stem}.html"), self.to_html().as_bytes())
    }

    /// Writes Markdown alone, as a file of a repository; figures go to `pictures` beside it, into a folder called as the page.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write_markdown(&self, path: &Path) -> anyhow::Result<()> {
        let folder = path.parent().unwrap_or(Path::new("."));
        let figures = format!("pictures/{}", file_name(&path.file_stem().unwrap_or_default().to_string_lossy()));
        let into = folder.join(&figures);
        std::fs::create_dir_all(&into).with_context(|| format!("{}: cannot be created", into.display()))?;
        for part in &self.parts {
            if let Part::Figure { name, image, .. } = part {
                storage::whole::write(&into.join(image.file(name)), &image.bytes())?;
            }
        }
        Ok(storage::whole::write(path, self.markdown_with(&figures).as_bytes())?)
    }

    /// Markdown that names the figures as files beside it.
    pub fn to_markdown(&self) -> String {
        self.markdown_with(FIGURES)
    }

    fn markdown_with(&self, figures: &str) -> String {
        let mut text = format!("# {}\n", escaped_markdown(&self.title));
        for part in &self.parts {
            let _ = match part {
                Part::Heading(title) => write!(text, "\n## {title}\n"),
                Part::Markdown(markdown) => write!(text, "\n{}\n", markdown.trim_end()),
                Part::Figure { name, caption, image } => {
                    write!(text, "\n![{name}]({figures}/{})\n\n{}\n", image.file(name), caption.trim_end())
                }
            };
        }
        text
    }

    /// One page with everything in it.
    pub fn to_html(&self) -> String {
        let mut body = format!("<p class=\"program\">{PROGRAM}</p>\n<h1>{}</h1>\n", escaped(&self.title));
        let headings = self.parts.iter().filter(|part| matches!(part, Part::Heading(_))).count();
        if headings > 2 {
            body += &self.contents();
        }
        for (index, part) in self.parts.iter().enumerate() {
            let _ = match part {
                Part::Heading(title) => writeln!(body, "<h2 id=\"part-{index}\">{}</h2>", escaped(title)),
                Part::Markdown(markdown) => writeln!(body, "{}", html_of(markdown)),
                Part::Figure { caption, image, .. } => writeln!(
                    body,
                    "<figure><div class=\"scroll\">{}</div><figcaption>{}</figcaption></figure>",
                    image.to_html(),
                    html_of(caption)
                ),
            };
        }
        let title = escaped(&self.title);
        let plays = self.parts.iter().any(|part| matches!(part, Part::Figure { image: Image::Player(_), .. }));
        let (policy, script) = if plays {
            let hash = BASE64_STANDARD.encode(Sha256::digest(SCRIPT));
            (format!("; script-src 'sha256-{hash}'"), format!("<script>{SCRIPT}</script>\n"))
        } else {
            (String::new(), String::new())
        };
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; \
             style-src 'unsafe-inline'{policy}\">\n<meta name=\"generator\" content=\"{PROGRAM}\">\n<title>{title} – {PROGRAM}</title>\n\
             <style>{STYLE}</style>\n</head>\n<body>\n{body}{script}</body>\n</html>\n"
        )
    }

    fn contents(&self) -> String {
        let mut list = "<nav><ul>\n".to_owned();
        for (index, part) in self.parts.iter().enumerate() {
            if let Part::Heading(title) = part {
                let _ = writeln!(list, "<li><a href=\"#part-{index}\">{}</a></li>", escaped(title));
            }
        }
        list + "</ul></nav>\n"
    }
}

impl Image {
    /// The file of a picture of this name.
    fn file(&self, name: &str) -> String {
        let ending = match self {
            Self::Svg(_) | Self::Player(_) => "svg",
            Self::Png(_) => "png",
        };
        format!("{name}.{ending}")
    }

    fn bytes(&self) -> Cow<'_, [u8]> {
        match self {
            Self::Svg(text) => text.as_bytes().into(),
            Self::Png(bytes) => bytes.into(),
            Self::Player(player) => player.to_svg().into_bytes().into(),
        }
    }

    fn to_html(&self) -> String {
        match self {
            // In HTML there is no XML declaration.
            Self::Svg(text) => text.find("<svg").map_or_else(String::new, |start| text[start..].to_owned()),
            Self::Png(bytes) => {
                format!("<img alt=\"\" src=\"data:image/png;base64,{}\">", BASE64_STANDARD.encode(bytes))
            }
            Self::Player(player) => player.to_html(),
        }
    }
}

/// Markdown as HTML that loads nothing and leads nowhere else: links go to places of the page itself, of HTML there are
/// only anchors. Tables are in boxes of their own; their cells know their column, for narrow screens.
fn html_of(markdown: &str) -> String {
    let (mut columns, mut column, mut in_head) = (Vec::<String>::new(), 0, false);
    let mut is_link_kept = Vec::new();
    let parser = Parser::new_ext(markdown, Options::ENABLE_TABLES).flat_map(|event| match event {
        Event::Start(Tag::Table(_)) => {
            columns.clear();
            vec![Event::Html(CowStr::Borrowed("<div class=\"scroll\">")), event]
        }
        Event::End(TagEnd::Table) => vec![event, Event::Html(CowStr::Borrowed("</div>\n"))],
        Event::Start(Tag::TableHead) => {
            in_head = true;
            vec![event]
        }
        Event::End(TagEnd::TableHead) => {
            in_head = false;
            vec![event]
        }
        Event::Start(Tag::TableRow) => {
            column = 0;
            vec![event]
        }
        Event::Start(Tag::TableCell) if in_head => {
            columns.push(String::new());
            vec![event]
        }
        Event::Start(Tag::TableCell) => {
            let label = columns.get(column).map_or("", String::as_str);
            column += 1;
            vec![Event::Html(format!("<td data-label=\"{}\">", attribute(label)).into())]
        }
        Event::End(TagEnd::TableCell) if !in_head => vec![Event::Html(CowStr::Borrowed("</td>"))],
        Event::Text(ref text) => {
            if let Some(label) = columns.last_mut().filter(|_| in_head) {
                *label += text;
            }
            vec![event]
        }
        Event::Start(Tag::Link { ref dest_url, .. }) => {
            let is_kept = dest_url.starts_with('#');
            is_link_kept.push(is_kept);
            if is_kept { vec![event] } else { Vec::new() }
        }
        Event::End(TagEnd::Link) => {
            if is_link_kept.pop() == Some(true) {
                vec![event]
            } else {
                Vec::new()
            }
        }
        Event::Html(ref text) | Event::InlineHtml(ref text) if is_anchor(text) => vec![event],
        Event::Html(text) | Event::InlineHtml(text) => vec![Event::Text(text)],
        Event::Start(Tag::Image { .. }) | Event::End(TagEnd::Image) => Vec::new(),
        other => vec![other],
    });
    let mut out = String::new();
    html::push_html(&mut out, parser);
    out
}

/// Whether HTML is the beginning or the end of an anchor as a glossary has it, and nothing else.
fn is_anchor(html: &str) -> bool {
    let name = html.strip_prefix("<a id=\"").and_then(|rest| rest.strip_suffix("\">"));
    html == "</a>" || name.is_some_and(|name| name.chars().all(|c| c.is_ascii_lowercase() || c == '-'))
}

fn escaped(text: &str) -> String {
    let mut out = String::new();
    html::push_html(&mut out, std::iter::once(Event::Text(text.into())));
    out
}

/// Text as the value of an attribute, between double quotes.
fn attribute(text: &str) -> String {
    escaped(text).replace('"', "&quot;")
}

/// Button and slider of every player.
const SCRIPT: &str = "
for (const player of document.querySelectorAll('.player')) {
  const frames = player.querySelectorAll('.frame');
  const controls = player.querySelector('.controls');
  const [button, slider, label] = controls.children;
  let timer = null;
  const show = (index) => {
    frames.forEach((frame, i) => frame.setAttribute('display', i === index ? 'inline' : 'none'));
    slider.value = index;
    label.value = frames[index].dataset.label;
    slider.setAttribute('aria-valuetext', label.value);
  };
  const stop = () => { clearInterval(timer); timer = null; button.textContent = 'Play'; };
  const step = () => {
    const next = Number(slider.value) + 1;
    if (next < frames.length) { show(next); } else { stop(); }
  };
  button.addEventListener('click', () => {
    if (timer !== null) { stop(); return; }
    if (Number(slider.value) + 1 >= frames.length) { show(0); }
    timer = setInterval(step, Number(player.dataset.periodMs));
    button.textContent = 'Pause';
  });
  slider.addEventListener('input', () => { stop(); show(Number(slider.value)); });
  controls.hidden = false;
  show(Number(slider.value));
}
";

/// Screens from 320 px, light and dark, and paper. Pictures are on white cards in the dark, too: their colours mean things.
const STYLE: &str = "
:root { color-scheme: light dark; --ground: #fff; --ink: #1a1a1a; --soft: #444; --rule: #ccc; --faint: #ddd;
  --band: #f6f6f6; --code: #f2f2f2; --link: #0b57a4; }
@media (prefers-color-scheme: dark) { :root { --ground: #16181c; --ink: #e6e6e6; --soft: #b4b8be; --rule: #4a4f57;
  --faint: #34383e; --band: #1d2025; --code: #262a30; --link: #86b9f2; } }
body { max-width: 62rem; margin: 0 auto; padding: 1.5rem 1rem 4rem; background: var(--ground); color: var(--ink);
  font: 16px/1.5 system-ui, -apple-system, 'Segoe UI', 'Noto Sans', sans-serif; overflow-wrap: break-word; }
a { color: var(--link); }
a[title] { color: inherit; text-decoration: underline dotted; text-underline-offset: .2em; }
.program { margin: 0; color: var(--soft); font-size: .9rem; }
h1 { font-size: 1.7rem; line-height: 1.2; margin-top: .2rem; }
h2 { font-size: 1.3rem; margin-top: 2.5rem; padding-bottom: .2rem; border-bottom: 1px solid var(--rule); }
h3 { font-size: 1.05rem; margin-top: 1.8rem; }
nav ul { padding-left: 1.2rem; columns: 18rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: .875rem; font-variant-numeric: tabular-nums; margin: .5rem 0 1rem; }
th, td { padding: .25rem .6rem; border-bottom: 1px solid var(--faint); text-align: left; vertical-align: top;
  white-space: nowrap; overflow-wrap: normal; }
th { border-bottom: 2px solid var(--rule); }
td:last-child { white-space: normal; }
tbody tr:nth-child(even) { background: var(--band); }
figure { margin: 1.5rem 0; }
figure svg, figure img { display: block; width: 100%; max-width: 46rem; height: auto; background: #fff;
  border-radius: .4rem; }
figure .player svg { max-width: 30rem; }
.controls { display: flex; gap: .6rem; align-items: center; max-width: 30rem; margin-top: .4rem; }
.controls[hidden] { display: none; }
.controls button { font: inherit; min-width: 5rem; padding: .2rem .6rem; }
.controls input { flex: 1; min-width: 0; }
.controls output { min-width: 4rem; text-align: right; font-variant-numeric: tabular-nums; }
figcaption { font-size: .9rem; color: var(--soft); }
code { font: .9em ui-monospace, 'Noto Sans Mono', monospace; background: var(--code); padding: .05em .25em; }
pre { white-space: pre-wrap; overflow-wrap: anywhere; background: var(--code); padding: .6rem; }
pre code { padding: 0; }
@media screen and (max-width: 44rem) { body { font-size: 15px; }
  table, tbody, tr, td { display: block; } thead { display: none; } table { margin: .5rem 0; }
  tr { padding: .35rem .5rem; border-bottom: 1px solid var(--rule); }
  td, td:last-child { display: flex; justify-content: space-between; gap: 1rem; padding: 0; border: 0;
    white-space: normal; text-align: right; overflow-wrap: anywhere; }
  td::before { content: attr(data-label); color: var(--soft); text-align: left; overflow-wrap: normal; }
  td:first-child { font-weight: 600; justify-content: start; text-align: left; }
  td:first-child::before, td:empty { display: none; } }
@media print { :root { color-scheme: light; } body { max-width: none; padding: 0; font-size: 10pt; background: #fff;
  color: #000; } nav, .controls { display: none; }
  .scroll { overflow: visible; } table { font-size: 7.5pt; } th, td { white-space: normal; padding: .15rem .3rem; }
  figure svg, figure img { width: auto; max-width: 100%; max-height: 9cm; } figure .player svg { max-height: 13cm; }
  pre { font-size: 6.5pt; columns: 2; } figure, tr { break-inside: avoid; } h2, h3 { break-after: avoid; } }
";

#[cfg(test)]
mod tests {
    use super::*;

    fn page() -> Page {
        let mut page = Page::new("Drivers <&> lots");
        page.text("All of *it*.");
        page.section(
            "Rates",
            "| driver | rate |\n|---|---|\n| a<b | 1 |\n\n<script src=\"https://x.y/z.js\"></script>",
        );
        page.text("![seen](https://x.y/z.png) and <img src='z.png'>, [a link](https://x.y)");
        page.figure(
            "bars",
            "Bars **with** intervals.",
            Image::Svg("<?xml version=\"1.0\"?>\n<svg viewBox=\"0 0 2 1\"><rect/></svg>".to_owned()),
        );
        page.figure("view", "A view.", Image::Png(b"\x89PNG".to_vec()));
        page
    }

    #[test]
    fn the_page_loads_nothing() {
        let html = page().to_html();
        for (found, why) in [
            ("<script", "scripts where nothing plays"),
            ("<link", "files"),
            ("@import", "styles"),
            ("url(", "styles"),
            ("<?xml", "XML"),
            ("<a href=\"http", "links"),
        ] {
            assert!(!html.contains(found), "no {why}: {html}");
        }
        // What is between < and > of a tag; text has its < escaped.
        let tags = html.split('<').skip(1).map(|tag| tag.split('>').next().unwrap());
        let sources: Vec<&str> = tags.filter(|tag| tag.contains("src=")).collect();
        assert_eq!(sources, ["img alt=\"\" src=\"data:image/png;base64,iVBORw==\""], "{html}");
        assert!(html.contains("Drivers &lt;&amp;&gt; lots") && html.contains("a&lt;b"), "{html}");
        assert!(html.contains("<div class=\"scroll\"><table>") && html.contains("</table>\n</div>"), "{html}");
        assert!(html.contains("name=\"viewport\"") && html.contains("@media print"), "{html}");
        assert!(html.contains("default-src 'none'; img-src data:; style-src 'unsafe-inline'\">"), "{html}");
        assert!(html.contains(">a link<") || html.contains(", a link"), "the words of a link stay: {html}");
        let program = format!("lotpilot {}", env!("CARGO_PKG_VERSION"));
        assert!(html.contains(&format!("<title>Drivers &lt;&amp;&gt; lots – {program}</title>")), "{html}");
    }

    #[test]
    fn cells_know_their_column_on_narrow_screens() {
        let html = page().to_html();
        assert!(
            html.contains("<tr><td data-label=\"driver\">a&lt;b</td><td data-label=\"rate\">1</td></tr>"),
            "{html}"
        );
        assert!(html.contains("prefers-color-scheme: dark"), "{html}");
    }

    /// A lot called `" onmouseover="…` was a heading, and wrote attributes of its own.
    #[test]
    fn a_quotation_mark_in_a_heading_ends_no_attribute() {
        let mut page = Page::new("x");
        page.text("| driver | b\" id=\"c |\n|---|---|\n| expert | 1 |");
        let mut playing = player();
        playing.frames[0].0 = "0.0 s\" id=\"c".to_owned();
        page.figure("moment", "A moment.", Image::Player(playing));
        let html = page.to_html();
        assert!(html.contains("<td data-label=\"b&quot; id=&quot;c\">1</td>"), "{html}");
        assert!(html.contains("data-label=\"0.0 s&quot; id=&quot;c\""), "{html}");
    }

    fn player() -> Player {
        let frame = |i: usize| (format!("{i}.0 s"), format!("<circle cx=\"{i}\" cy=\"1\" r=\"1\"/>\n"));
        Player {
            title: "lot <b>".to_owned(),
            size_px: [9.0, 4.0],
            background: "<rect width=\"9\" height=\"4\"/>\n".to_owned(),
            frames: (0..5).map(frame).collect(),
            still: 3,
            rate_per_s: 4.0,
        }
    }

    #[test]
    fn a_player_stands_still_without_its_script_and_allows_no_other() {
        let mut page = Page::new("x");
        page.figure("moment", "A moment.", Image::Player(player()));
        let html = page.to_html();
        let hidden: Vec<bool> =
            html.split("<g class=\"frame\"").skip(1).map(|frame| frame.contains("display=\"none\"")).collect();
        assert_eq!(hidden, [true, true, true, false, true], "only the still is shown");
        assert!(html.contains("class=\"controls\" hidden") && html.contains("max=\"4\" value=\"3\""), "{html}");
        assert!(html.contains("data-period-ms=\"250\""), "{html}");
        assert!(html.contains("<svg role=\"img\"") && html.contains("<title>lot &lt;b&gt;</title>"), "{html}");
        assert!(
            html.contains("setAttribute('aria-valuetext', label.value)"),
            "a slider says seconds, not pictures: {html}"
        );
        let script = html.split("<script>").nth(1).unwrap().split("</script>").next().unwrap();
        let hash = BASE64_STANDARD.encode(Sha256::digest(script));
        assert!(html.contains(&format!("script-src 'sha256-{hash}'\">")), "{html}");
        assert!(!script.contains("fetch") && !script.contains("http") && !script.contains("import"), "{script}");
    }

    #[test]
    fn in_markdown_a_player_is_its_still() {
        let still = player().to_svg();
        let document = roxmltree::Document::parse(&still).unwrap();
        let circles: Vec<_> = document.descendants().filter(|node| node.has_tag_name("circle")).collect();
        assert_eq!(circles.len(), 1);
        assert_eq!(circles[0].attribute("cx"), Some("3"));
    }

    #[test]
    fn markdown_names_its_figures_and_files_are_written() {
        let folder = std::env::temp_dir().join(format!("xtask-test-{}-page", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        // A folder with a list is a run.
        sums::write(&folder, "settings.toml", b"").unwrap();
        let run = RunDir::reopen(&folder, "render").unwrap();
        page().write(&run, "report").unwrap();
        let markdown = std::fs::read_to_string(folder.join("report.md")).unwrap();
        assert!(markdown.starts_with("# Drivers \\<\\&> lots\n\nAll of *it*.\n\n## Rates\n"), "{markdown}");
        assert!(markdown.contains("\n![bars](figures/bars.svg)\n\nBars **with** intervals.\n"), "{markdown}");
        assert!(folder.join("figures/bars.svg").is_file() && folder.join("figures/view.png").is_file());
        assert_eq!(std::fs::read_to_string(folder.join("report.html")).unwrap(), page().to_html());
        std::fs::remove_dir_all(&folder).unwrap();
        let refused = page().write(&run, "report").unwrap_err().to_string();
        assert!(
            refused.contains("was deleted or moved") && !folder.exists(),
            "a deleted run came back half: {refused}"
        );
    }

    #[test]
    fn longer_reports_have_a_table_of_contents() {
        let mut page = Page::new("x");
        page.section("One", "1").section("Two", "2");
        assert!(!page.to_html().contains("<nav>"));
        page.section("Three & more", "");
        assert!(!page.to_markdown().contains("\n\n\n"), "a heading without text leaves no gap");
        assert!(page.to_html().contains("<a href=\"#part-4\">Three &amp; more</a>"), "{}", page.to_html());
        assert!(page.to_html().contains("<h2 id=\"part-4\">"));
    }
}
