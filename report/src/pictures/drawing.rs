//! A picture as a list of shapes, which becomes PNG or SVG.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};
use sim::geometry::Vec2;
use std::fmt::Write as _;
use tiny_skia::{
    Color, FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, PixmapPaint, Rect, Stroke, StrokeDash,
    Transform,
};

/// Red, green, blue.
pub type Rgb = [u8; 3];

/// Longest side that is drawn, pixels: 16384² pixels are a gigabyte.
pub(crate) const SIDE_MAX_PX: f32 = 16_384.0;

/// Sizes of letters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Font {
    /// 16 pixels high.
    Small,
    /// 24 pixels high.
    Large,
}

impl Font {
    fn raster(self) -> RasterHeight {
        match self {
            Self::Small => RasterHeight::Size16,
            Self::Large => RasterHeight::Size24,
        }
    }

    /// Height of a letter, pixels.
    pub fn height_px(self) -> f32 {
        self.raster().val() as f32
    }

    /// Width of a text, pixels: all letters are equally wide.
    pub fn width_px(self, text: &str) -> f32 {
        (text.chars().count() * get_raster_width(FontWeight::Regular, self.raster())) as f32
    }
}

/// Shapes on a ground, in pixels from the upper left corner, drawn in order.
#[derive(Debug, Clone)]
pub struct Drawing {
    width_px: f32,
    height_px: f32,
    ground: Option<Rgb>,
    shapes: Vec<Shape>,
}

#[derive(Debug, Clone)]
enum Shape {
    Polygon { points: Vec<Vec2>, rgb: Rgb },
    Line { points: Vec<Vec2>, closed: bool, rgb: Rgb, width_px: f32, dash_px: Vec<f32> },
    Disc { centre: Vec2, radius_px: f32, rgb: Rgb },
    Squares { corners: Vec<Vec2>, side_px: f32, pitch_px: f32, rgb: Rgb },
    Text { text: String, at: Vec2, font: Font, rgb: Rgb },
    Inset { drawing: Drawing, at: Vec2 },
}

impl Drawing {
    /// An empty picture.
    ///
    /// # Errors
    /// If it would be too large.
    pub fn new(size_px: Vec2, ground: Rgb) -> anyhow::Result<Self> {
        let (width_px, height_px) = (size_px.x.floor(), size_px.y.floor());
        anyhow::ensure!(
            width_px >= 1.0 && height_px >= 1.0 && width_px.max(height_px) <= SIDE_MAX_PX,
            "{width_px:.0}×{height_px:.0} pixels are too many or too few; choose another --pixels-per-metre, or less to draw"
        );
        Ok(Self { width_px, height_px, ground: Some(ground), shapes: Vec::new() })
    }

    /// An empty picture that hides nothing: what changes from frame to frame, to be laid over a picture of this size.
    #[must_use]
    pub fn overlay(&self) -> Self {
        Self { ground: None, shapes: Vec::new(), ..*self }
    }

    /// Width and height, pixels.
    pub fn size_px(&self) -> Vec2 {
        Vec2::new(self.width_px, self.height_px)
    }

    /// A filled polygon.
    pub fn polygon(&mut self, points: Vec<Vec2>, rgb: Rgb) {
        self.shapes.push(Shape::Polygon { points, rgb });
    }

    /// A filled upright rectangle.
    pub fn rectangle(&mut self, corner: Vec2, size_px: Vec2, rgb: Rgb) {
        let far = corner + size_px;
        self.polygon(vec![corner, Vec2::new(far.x, corner.y), far, Vec2::new(corner.x, far.y)], rgb);
    }

    /// A line through points.
    pub fn line(&mut self, points: Vec<Vec2>, rgb: Rgb, width_px: f32) {
        self.shapes.push(Shape::Line { points, closed: false, rgb, width_px, dash_px: Vec::new() });
    }

    /// A dashed line through points.
    pub fn dashed(&mut self, points: Vec<Vec2>, rgb: Rgb, width_px: f32, dash_px: [f32; 2]) {
        self.shapes.push(Shape::Line { points, closed: false, rgb, width_px, dash_px: dash_px.to_vec() });
    }

    /// The edge of a polygon.
    pub fn outline(&mut self, points: Vec<Vec2>, rgb: Rgb, width_px: f32) {
        self.shapes.push(Shape::Line { points, closed: true, rgb, width_px, dash_px: Vec::new() });
    }

    /// A filled disc.
    pub fn disc(&mut self, centre: Vec2, radius_px: f32, rgb: Rgb) {
        self.shapes.push(Shape::Disc { centre, radius_px, rgb });
    }

    /// Filled upright squares of one size and colour: cells of a grid, row by row. A pitch is the way from one square of a
    /// row to the next.
    pub fn squares(&mut self, corners: Vec<Vec2>, [side_px, pitch_px]: [f32; 2], rgb: Rgb) {
        self.shapes.push(Shape::Squares { corners, side_px, pitch_px, rgb });
    }

    /// Text with its upper left corner at a point. In pixels, letters that the font lacks are question marks: it has those of
    /// Latin scripts.
    pub fn text(&mut self, text: impl Into<String>, at: Vec2, font: Font, rgb: Rgb) {
        self.shapes.push(Shape::Text { text: text.into(), at, font, rgb });
    }

    /// Another picture with its upper left corner at a point; nothing of it reaches beyond its edges.
    pub fn inset(&mut self, drawing: Self, at: Vec2) {
        self.shapes.push(Shape::Inset { drawing, at });
    }

    /// As PNG.
    ///
    /// # Errors
    /// If it cannot be encoded.
    pub fn to_png(&self) -> anyhow::Result<Vec<u8>> {
        Ok(self.pixmap().encode_png()?)
    }

    /// As SVG.
    pub fn to_svg(&self) -> String {
        let mut svg = String::new();
        let (width, height) = (self.width_px, self.height_px);
        let _ = writeln!(
            svg,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\">"
        );
        self.write_svg(&mut svg);
        svg.push_str("</svg>\n");
        svg
    }

    /// The picture as pixels.
    ///
    /// # Panics
    /// Never: sizes are checked when a drawing is made.
    pub fn pixmap(&self) -> Pixmap {
        let mut pixmap = Pixmap::new(self.width_px as u32, self.height_px as u32).expect("the size is checked in new");
        if let Some(ground) = self.ground {
            pixmap.fill(colour(ground));
        }
        self.draw_on(&mut pixmap);
        pixmap
    }

    /// Draws the shapes over pixels that are already there.
    pub fn draw_on(&self, pixmap: &mut Pixmap) {
        for shape in &self.shapes {
            shape.draw(pixmap);
        }
    }

    /// The elements of the SVG without the `svg` around them.
    pub fn svg_elements(&self) -> String {
        let mut svg = String::new();
        self.write_svg(&mut svg);
        svg
    }

    fn write_svg(&self, svg: &mut String) {
        let (width, height) = (self.width_px, self.height_px);
        if let Some(ground) = self.ground {
            let _ = writeln!(svg, "<rect width=\"{width}\" height=\"{height}\" fill=\"{}\"/>", hex(ground));
        }
        for shape in &self.shapes {
            shape.write_svg(svg);
        }
    }
}

impl Shape {
    fn draw(&self, pixmap: &mut Pixmap) {
        match self {
            Self::Polygon { points, rgb } => {
                if let Some(path) = path(points, true) {
                    pixmap.fill_path(&path, &paint(*rgb), FillRule::Winding, Transform::identity(), None);
                }
            }
            Self::Line { points, closed, rgb, width_px, dash_px } => {
                let stroke = Stroke {
                    width: *width_px,
                    line_cap: LineCap::Round,
                    line_join: LineJoin::Round,
                    dash: StrokeDash::new(dash_px.clone(), 0.0),
                    ..Stroke::default()
                };
                if let Some(path) = path(points, *closed) {
                    pixmap.stroke_path(&path, &paint(*rgb), &stroke, Transform::identity(), None);
                }
            }
            Self::Disc { centre, radius_px, rgb } => {
                if let Some(path) = PathBuilder::from_circle(centre.x, centre.y, *radius_px) {
                    pixmap.fill_path(&path, &paint(*rgb), FillRule::Winding, Transform::identity(), None);
                }
            }
            Self::Squares { corners, side_px, rgb, .. } => {
                let mut builder = PathBuilder::new();
                for corner in corners {
                    if let Some(square) = Rect::from_xywh(corner.x, corner.y, *side_px, *side_px) {
                        builder.push_rect(square);
                    }
                }
                if let Some(path) = builder.finish() {
                    pixmap.fill_path(&path, &paint(*rgb), FillRule::Winding, Transform::identity(), None);
                }
            }
            Self::Text { text, at, font, rgb } => draw_text(pixmap, text, *at, *font, *rgb),
            Self::Inset { drawing, at } => {
                let (x, y) = (at.x as i32, at.y as i32);
                let inset = drawing.pixmap();
                pixmap.draw_pixmap(x, y, inset.as_ref(), &PixmapPaint::default(), Transform::identity(), None);
            }
        }
    }

    fn write_svg(&self, svg: &mut String) {
        let _ = match self {
            Self::Polygon { points, rgb } => {
                writeln!(svg, "<polygon points=\"{}\" fill=\"{}\"/>", coordinates(points), hex(*rgb))
            }
            Self::Line { points, closed, rgb, width_px, dash_px } => {
                let name = if *closed { "polygon" } else { "polyline" };
                let dash: Vec<String> = dash_px.iter().map(ToString::to_string).collect();
                let dash =
                    if dash.is_empty() { String::new() } else { format!(" stroke-dasharray=\"{}\"", dash.join(" ")) };
                writeln!(
                    svg,
                    "<{name} points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{width_px}\" \
                     stroke-linecap=\"round\" stroke-linejoin=\"round\"{dash}/>",
                    coordinates(points),
                    hex(*rgb)
                )
            }
            Self::Disc { centre, radius_px, rgb } => writeln!(
                svg,
                "<circle cx=\"{:.2}\" cy=\"{:.2}\" r=\"{radius_px:.2}\" fill=\"{}\"/>",
                centre.x,
                centre.y,
                hex(*rgb)
            ),
            // Neighbours of a row are the dashes of one line: a tenth of the bytes of squares.
            Self::Squares { corners, side_px, pitch_px, rgb } => {
                let is_next = |a: &Vec2, b: &Vec2| a.y == b.y && (b.x - a.x - pitch_px).abs() < 1e-3;
                let line = |row: &[Vec2]| {
                    let length_px = (row.len() - 1) as f32 * pitch_px + side_px;
                    format!("M{} {}h{length_px}", row[0].x, row[0].y + 0.5 * side_px)
                };
                let lines: String = corners.chunk_by(is_next).map(line).collect();
                writeln!(
                    svg,
                    "<path d=\"{lines}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{side_px}\" \
                     stroke-dasharray=\"{side_px} {}\"/>",
                    hex(*rgb),
                    pitch_px - side_px
                )
            }
            Self::Text { text, at, font, rgb } => {
                let escaped = text.replace('&', "&amp;").replace('<', "&lt;");
                // The letters of the bitmap font are 0.86 of their height; any monospace font is fitted to their width.
                writeln!(
                    svg,
                    "<text x=\"{:.2}\" y=\"{:.2}\" font-family=\"monospace\" font-size=\"{:.1}\" fill=\"{}\" \
                     textLength=\"{}\" lengthAdjust=\"spacingAndGlyphs\" xml:space=\"preserve\">{escaped}</text>",
                    at.x,
                    at.y + 0.8 * font.height_px(),
                    0.86 * font.height_px(),
                    hex(*rgb),
                    font.width_px(text)
                )
            }
            Self::Inset { drawing, at } => {
                let (width, height) = (drawing.width_px, drawing.height_px);
                let (x, y) = (at.x, at.y);
                let _ = writeln!(svg, "<svg x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\">");
                drawing.write_svg(svg);
                writeln!(svg, "</svg>")
            }
        };
    }
}

fn path(points: &[Vec2], closed: bool) -> Option<Path> {
    let mut builder = PathBuilder::new();
    for (index, point) in points.iter().enumerate() {
        if index == 0 { builder.move_to(point.x, point.y) } else { builder.line_to(point.x, point.y) }
    }
    if closed {
        builder.close();
    }
    builder.finish()
}

fn draw_text(pixmap: &mut Pixmap, text: &str, at: Vec2, font: Font, rgb: Rgb) {
    let (width, height) = (pixmap.width() as usize, pixmap.height() as usize);
    for (index, letter) in text.chars().enumerate() {
        let raster = |letter| get_raster(letter, FontWeight::Regular, font.raster());
        let Some(raster) = raster(letter).or_else(|| raster('?')) else { continue };
        let left = at.x.max(0.0) as usize + index * raster.width();
        for (y, row) in raster.rows().enumerate() {
            let line = at.y.max(0.0) as usize + y;
            for (x, &cover) in
                row.iter().enumerate().filter(|(x, cover)| **cover > 0 && left + x < width && line < height)
            {
                let pixel = &mut pixmap.pixels_mut()[line * width + left + x];
                let mix = |below: u8, ink: u8| {
                    ((u16::from(below) * (255 - u16::from(cover)) + u16::from(ink) * u16::from(cover)) / 255) as u8
                };
                let (r, g, b) = (mix(pixel.red(), rgb[0]), mix(pixel.green(), rgb[1]), mix(pixel.blue(), rgb[2]));
                if let Some(mixed) = tiny_skia::PremultipliedColorU8::from_rgba(r, g, b, 255) {
                    *pixel = mixed;
                }
            }
        }
    }
}

fn colour([r, g, b]: Rgb) -> Color {
    Color::from_rgba8(r, g, b, 255)
}

fn paint(rgb: Rgb) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color(colour(rgb));
    paint
}

fn hex([r, g, b]: Rgb) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

fn coordinates(points: &[Vec2]) -> String {
    let pair = |point: &Vec2| format!("{:.2},{:.2}", point.x, point.y);
    points.iter().map(pair).collect::<Vec<_>>().join(" ")
}
