//! What all plots have in common: palette, sizes, axes, legend.

use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::ops::Range;

/// Width of every plot: scaled down to a phone's 390 pixels its text still has nine.
pub const WIDTH_PX: u32 = 640;
/// Height where the number of rows does not decide it.
pub const HEIGHT_PX: u32 = 380;
const TEXT_PX: f64 = 15.0;
const TITLE_PX: f64 = 17.0;
/// plotters divides font sizes by this when it writes SVG.
const PLOTTERS_FONT: f64 = 1.24;
const FONT: &str = "sans-serif";
/// Mean width of a letter of a sans-serif font in ems, on the safe side: there is no font to measure.
const LETTER_EM: f64 = 0.58;
const EDGE_PX: i32 = 12;
const LEGEND_LINE_PX: i32 = 22;
/// Rows of a legend that a height has room for; more make a picture higher.
const LEGEND_ROWS: usize = 4;

/// Text and axes.
pub const INK: RGBColor = RGBColor(0x22, 0x25, 0x2B);
/// What is only there for comparison.
pub const FAINT: RGBColor = RGBColor(0x8A, 0x8F, 0x98);
const GRID: RGBColor = RGBColor(0xE3, 0xE5, 0xE8);

/// The palette of Okabe and Ito ("Color Universal Design", 2008) without its yellow, which is too pale on white.
const PALETTE: [RGBColor; 7] = [
    RGBColor(0x00, 0x72, 0xB2), // blue
    RGBColor(0xD5, 0x5E, 0x00), // vermillion
    RGBColor(0x00, 0x9E, 0x73), // bluish green
    RGBColor(0xCC, 0x79, 0xA7), // reddish purple
    RGBColor(0xE6, 0x9F, 0x00), // orange
    RGBColor(0x56, 0xB4, 0xE9), // sky blue
    RGBColor(0x00, 0x00, 0x00), // black
];

/// Colour of the n-th series; they repeat after seven.
pub fn colour(series: usize) -> RGBColor {
    PALETTE[series % PALETTE.len()]
}

/// Never fails: plots are drawn into memory.
pub(super) type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;
pub(super) type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;
type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// An axis.
pub(super) struct Axis<'a> {
    /// Quantity and unit.
    pub(super) label: &'a str,
    pub(super) range: Range<f64>,
    /// Labelled values, about.
    pub(super) ticks: usize,
    pub(super) labels: Labels<'a>,
}

/// Label and ticks of an axis.
pub(super) enum Labels<'a> {
    /// Numbers with so many decimals.
    Numbers(usize),
    /// Names at 0, 1, ….
    Names(&'a [String]),
}

impl Labels<'_> {
    fn at(&self, value: f64) -> String {
        match self {
            Self::Numbers(decimals) => number(value, *decimals),
            Self::Names(names) if value.fract() == 0.0 && value >= 0.0 => {
                names.get(value as usize).cloned().unwrap_or_default()
            }
            Self::Names(_) => String::new(),
        }
    }
}

/// A line of the legend.
pub(super) struct Key {
    pub(super) name: String,
    pub(super) colour: RGBColor,
    pub(super) look: Look,
}

/// How a series is drawn.
#[derive(Debug, Clone, Copy)]
pub(super) enum Look {
    Dashes,
    /// A line with the marker of the n-th series.
    Marked(usize),
}

/// A picture with a title, one pair of axes and a legend above them.
pub(super) struct Figure<'a> {
    pub(super) title: &'a str,
    pub(super) height_px: u32,
    pub(super) x: Axis<'a>,
    pub(super) y: Axis<'a>,
    /// Room for labels on the left, pixels.
    pub(super) left_px: u32,
    pub(super) legend: Vec<Key>,
}

impl Figure<'_> {
    /// Draws axes and legend, then what `draw` adds.
    pub(super) fn svg(&self, draw: impl FnOnce(&mut Chart<'_, '_>) -> Drawn) -> String {
        let more_rows = legend_rows(&self.legend, WIDTH_PX as i32).len().saturating_sub(LEGEND_ROWS);
        let height_px = self.height_px + LEGEND_LINE_PX as u32 * more_rows as u32;
        picture(self.title, height_px, |root| self.draw(root, draw))
    }

    /// The same as one part of a larger picture.
    pub(super) fn draw(&self, area: &Area<'_>, draw: impl FnOnce(&mut Chart<'_, '_>) -> Drawn) -> Drawn {
        area.fill(&WHITE)?;
        let (width, _) = area.dim_in_pixel();
        let rows = legend_rows(&self.legend, width as i32);
        let head_px = EDGE_PX + 26 + LEGEND_LINE_PX * rows.len() as i32 + 8;
        let (head, body) = area.split_vertically(head_px);
        let title = fitting_title(self.title, f64::from(width) - 2.0 * f64::from(EDGE_PX));
        text(&head, &title, (EDGE_PX, EDGE_PX), TITLE_PX, INK, Pos::new(HPos::Left, VPos::Top))?;
        for (index, row) in rows.iter().enumerate() {
            let y = EDGE_PX + 26 + LEGEND_LINE_PX * index as i32 + LEGEND_LINE_PX / 2;
            for (x, key) in row {
                draw_key(&head, key, *x, y)?;
            }
        }
        let mut chart = ChartBuilder::on(&body)
            .margin_right(30)
            .margin_bottom(6)
            .margin_left(6)
            .x_label_area_size(46)
            .y_label_area_size(self.left_px)
            .build_cartesian_2d(self.x.range.clone(), self.y.range.clone())?;
        let is_numbers = matches!(self.y.labels, Labels::Numbers(_));
        let mut mesh = chart.configure_mesh();
        if !is_numbers {
            mesh.disable_y_mesh();
        }
        mesh.light_line_style(TRANSPARENT)
            .bold_line_style(GRID)
            .axis_style(FAINT)
            .set_tick_mark_size(LabelAreaPosition::Bottom, 4)
            .set_tick_mark_size(LabelAreaPosition::Left, 4)
            .x_labels(self.x.ticks)
            .y_labels(self.y.ticks)
            .x_label_formatter(&|value| self.x.labels.at(*value))
            .y_label_formatter(&|value| self.y.labels.at(*value))
            .label_style(style(TEXT_PX, INK))
            .axis_desc_style(style(TEXT_PX, INK))
            .x_desc(self.x.label)
            .y_desc(self.y.label)
            .draw()?;
        draw(&mut chart)
    }
}

/// Two figures side by side as one picture.
pub(super) fn side_by_side(title: &str, height_px: u32, draw: impl FnOnce(&[Area<'_>; 2]) -> Drawn) -> String {
    picture(title, height_px, |root| draw(&root.split_horizontally(WIDTH_PX / 2).into()))
}

/// Areas of equal height, one above the other, as one picture.
pub(super) fn stacked(title: &str, count: usize, height_px: u32, draw: impl FnOnce(&[Area<'_>]) -> Drawn) -> String {
    picture(title, count as u32 * height_px, |root| draw(&root.split_evenly((count, 1))))
}

fn picture(title: &str, height_px: u32, draw: impl FnOnce(&Area<'_>) -> Drawn) -> String {
    let mut svg = String::new();
    let written = {
        let root = SVGBackend::with_string(&mut svg, (WIDTH_PX, height_px)).into_drawing_area();
        draw(&root).and_then(|()| root.present())
    };
    written.expect("drawing into memory does not fail");
    accessible(&svg, title)
}

/// Names the picture for screen readers.
fn accessible(svg: &str, title: &str) -> String {
    let title = title.replace('&', "&amp;").replace('<', "&lt;");
    svg.replacen("<svg ", "<svg role=\"img\" ", 1).replacen(">\n", &format!(">\n<title>{title}</title>\n"), 1)
}

/// A number as on an axis: without a fraction that says nothing, thousands apart.
pub(super) fn number(value: f64, decimals: usize) -> String {
    let value = if value.abs() < 1e-12 { 0.0 } else { value };
    let mut text = format!("{value:.decimals$}");
    if decimals > 0 || value.abs() < 10_000.0 {
        return text;
    }
    let first_digit = usize::from(value < 0.0);
    let mut at = text.len();
    while at > first_digit + 3 {
        at -= 3;
        text.insert(at, '\u{202f}');
    }
    text
}

/// Width a text needs, pixels.
pub(super) fn text_px(text: &str) -> f64 {
    text.chars().count() as f64 * LETTER_EM * TEXT_PX
}

/// A name that fits, shortened at its beginning: runs differ at their ends.
pub(super) fn fitting(name: &str, width_px: f64) -> String {
    let letters = (width_px / (LETTER_EM * TEXT_PX)) as usize;
    let count = name.chars().count();
    if count <= letters {
        return name.to_owned();
    }
    std::iter::once('…').chain(name.chars().skip(count + 1 - letters.max(2))).collect()
}

/// A title that fits: of a long one, such as that of a lot with a long name, the middle is left out.
fn fitting_title(title: &str, width_px: f64) -> String {
    let letters = ((width_px / (LETTER_EM * TITLE_PX)) as usize).max(3);
    let count = title.chars().count();
    if count <= letters {
        return title.to_owned();
    }
    let head = letters / 3;
    let tail = title.chars().skip(count + 1 + head - letters);
    title.chars().take(head).chain(std::iter::once('…')).chain(tail).collect()
}

pub(super) fn style(size_px: f64, colour: RGBColor) -> TextStyle<'static> {
    let font = (FONT, size_px * PLOTTERS_FONT).into_font();
    TextStyle { font, color: colour.to_backend_color(), pos: Pos::default() }
}

/// Text at a pixel.
fn text(area: &Area<'_>, words: &str, at: (i32, i32), size_px: f64, colour: RGBColor, pos: Pos) -> Drawn {
    area.draw(&Text::new(words.to_owned(), at, style(size_px, colour).pos(pos)))
}

/// Text at a value, in the size of labels.
pub(super) fn label(chart: &Chart<'_, '_>, words: &str, at: (f64, f64), colour: RGBColor, pos: Pos) -> Drawn {
    chart.plotting_area().draw(&Text::new(words.to_owned(), at, style(TEXT_PX, colour).pos(pos)))
}

/// A line through values.
pub(super) fn line(chart: &mut Chart<'_, '_>, points: Vec<(f64, f64)>, colour: RGBColor, width_px: u32) -> Drawn {
    let element = PathElement::new(points, colour.stroke_width(width_px));
    chart.draw_series(std::iter::once(element)).map(|_| ())
}

/// A dashed straight line.
pub(super) fn dashes(chart: &mut Chart<'_, '_>, from: (f64, f64), to: (f64, f64), colour: RGBColor) -> Drawn {
    let pixel = |at: &(f64, f64)| chart.plotting_area().map_coordinate(at);
    let ((x0, y0), (x1, y1)) = (pixel(&from), pixel(&to));
    let dashes = (libm::hypot(f64::from(x1 - x0), f64::from(y1 - y0)) / DASH_PX).ceil().max(1.0);
    let at = |share: f64| (from.0 + share * (to.0 - from.0), from.1 + share * (to.1 - from.1));
    let dash = |i: u32| {
        let share = f64::from(i) / dashes;
        PathElement::new(vec![at(share), at(share + 0.6 / dashes)], colour.stroke_width(2))
    };
    chart.draw_series((0..dashes as u32).map(dash)).map(|_| ())
}

/// A dash and the gap after it.
const DASH_PX: f64 = 10.0;

/// The marker of the n-th series at a value: shapes repeat after three.
pub(super) fn marker(chart: &mut Chart<'_, '_>, series: usize, at: (f64, f64), colour: RGBColor) -> Drawn {
    let area = chart.plotting_area();
    let outside = area.strip_coord_spec();
    let (base_x, base_y) = outside.get_base_pixel();
    let (x, y) = area.map_coordinate(&at);
    marker_px(&outside, series, (x - base_x, y - base_y), colour)
}

fn marker_px(area: &Area<'_>, series: usize, (x, y): (i32, i32), colour: RGBColor) -> Drawn {
    match series % 3 {
        0 => area.draw(&Circle::new((x, y), 5, colour.filled())),
        1 => area.draw(&Polygon::new(vec![(x - 6, y + 5), (x + 6, y + 5), (x, y - 6)], colour)),
        _ => area.draw(&Rectangle::new([(x - 5, y - 5), (x + 5, y + 5)], colour.filled())),
    }
}

const KEY_PX: i32 = 26;

fn key_px(key: &Key) -> i32 {
    KEY_PX + 8 + text_px(&key.name) as i32 + 18
}

/// Rows of the legend, every key with its left edge.
fn legend_rows(legend: &[Key], width_px: i32) -> Vec<Vec<(i32, &Key)>> {
    let mut rows: Vec<Vec<(i32, &Key)>> = Vec::new();
    let mut x = width_px;
    for key in legend {
        if x + key_px(key) > width_px - EDGE_PX + 18 {
            rows.push(Vec::new());
            x = EDGE_PX;
        }
        if let Some(row) = rows.last_mut() {
            row.push((x, key));
        }
        x += key_px(key);
    }
    rows
}

fn draw_key(area: &Area<'_>, key: &Key, x: i32, y: i32) -> Drawn {
    let stroke = key.colour.stroke_width(2);
    match key.look {
        Look::Dashes => {
            for part in 0..3 {
                let from = x + part * 10;
                area.draw(&PathElement::new(vec![(from, y), (from + 6, y)], stroke))?;
            }
        }
        Look::Marked(series) => {
            area.draw(&PathElement::new(vec![(x, y), (x + KEY_PX, y)], stroke))?;
            marker_px(area, series, (x + KEY_PX / 2, y), key.colour)?;
        }
    }
    let at = (x + KEY_PX + 8, y);
    text(area, &key.name, at, TEXT_PX, INK, Pos::new(HPos::Left, VPos::Center))
}

/// A round number at least as large, so that an axis ends on a tick.
pub(super) fn round_up(value: f64) -> f64 {
    if value <= 0.0 {
        return 1.0;
    }
    let power = libm::pow(10.0, libm::log10(value).floor());
    let steps = [1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0];
    power * steps.into_iter().find(|step| step * power >= value * (1.0 - 1e-9)).unwrap_or(10.0)
}

/// Decimals that tell the ticks of an axis apart.
pub(super) fn decimals(span: f64) -> usize {
    match span {
        span if span > 8.0 => 0,
        span if span > 0.8 => 1,
        span if span > 0.08 => 2,
        span if span > 0.008 => 3,
        span if span > 0.0008 => 4,
        _ => 5,
    }
}
