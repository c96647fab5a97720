//! Top views of lots.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};
use sim::geometry::{Pose, Vec2};
use sim::map::Map;
use sim::scenario::{Obstacle, ObstacleClass};
use sim::vehicle::VehicleParams;
use tiny_skia::{Color, FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, Stroke, StrokeDash, Transform};

/// Around the lot, metres.
const MARGIN_M: f32 = 3.0;
/// Longest side of a picture if no scale is asked for, pixels …
const SIDE_PX: f32 = 1600.0;
/// … within these pixels per metre: bollards stay visible, small lots do not become posters.
const SCALE_PX_PER_M: (f32, f32) = (4.0, 24.0);
/// Small things are drawn at least this wide, pixels.
const SMALLEST_PX: f32 = 5.0;
const FONT: RasterHeight = RasterHeight::Size24;
const LINE_PX: f32 = 34.0;

type Rgb = [u8; 3];
const GROUND: Rgb = [0xEE, 0xEC, 0xE6];
const ASPHALT: Rgb = [0xC6, 0xCA, 0xD0];
const BOUNDARY: Rgb = [0x5B, 0x61, 0x6B];
const ISLAND: Rgb = [0xA9, 0xC7, 0x9B];
const SPEED_BUMP: Rgb = [0xF0, 0xC2, 0x3C];
const ROUTE: Rgb = [0x1B, 0x7F, 0x4B];
const FINISH: Rgb = [0xC0, 0x2F, 0x2F];
const INK: Rgb = [0x22, 0x25, 0x2B];

/// Colour of a class and its name in the legend.
fn look(class: ObstacleClass) -> (Rgb, &'static str) {
    match class {
        ObstacleClass::Sedan => ([0x4C, 0x72, 0xB0], "sedan"),
        ObstacleClass::Suv => ([0x2F, 0x4B, 0x7C], "SUV"),
        ObstacleClass::Compact => ([0x8F, 0xAE, 0xDB], "compact"),
        ObstacleClass::Van => ([0x7A, 0x5F, 0xA8], "van"),
        ObstacleClass::Truck => ([0x8C, 0x56, 0x4B], "truck"),
        ObstacleClass::Cone => ([0xFF, 0x7F, 0x0E], "cone"),
        ObstacleClass::Bollard => ([0xD6, 0x27, 0x28], "bollard"),
        ObstacleClass::Curb => ([0x8D, 0x8D, 0x8D], "curb"),
        ObstacleClass::WheelStop => ([0xB8, 0xA9, 0x7E], "wheel stop"),
        ObstacleClass::Pillar => ([0x3A, 0x3A, 0x3A], "pillar"),
        ObstacleClass::Cart => ([0x17, 0xA2, 0x98], "cart"),
        ObstacleClass::Person => ([0xE3, 0x3C, 0x96], "person"),
    }
}

/// A top view, encoded as PNG.
///
/// # Errors
/// If the picture would be too large.
pub fn top_view(map: &Map, vehicle: &VehicleParams, px_per_m: Option<f32>) -> anyhow::Result<Vec<u8>> {
    let legend = legend_of(map);
    let (lowest, highest) = extent(map);
    let size_m = highest - lowest;
    let fitting = (SIDE_PX / size_m.max_element()).clamp(SCALE_PX_PER_M.0, SCALE_PX_PER_M.1);
    let scale = px_per_m.unwrap_or(fitting);
    let width = (size_m.x * scale).max(400.0);
    let legend_rows = layout(&legend, width);
    let lot_height = size_m.y * scale;
    let height = lot_height + LINE_PX * (legend_rows.len() as f32 + 2.0);
    let pixmap = Pixmap::new(width as u32, height as u32)
        .filter(|pixmap| pixmap.width().max(pixmap.height()) <= 16_384)
        .ok_or_else(|| {
            anyhow::anyhow!("{width:.0}×{height:.0} pixels are too many; choose a smaller --pixels-per-metre")
        })?;
    let mut canvas = Canvas { pixmap, scale, lowest, top_m: highest.y };
    canvas.pixmap.fill(colour(GROUND));
    draw_ground(&mut canvas, map);
    for obstacle in &map.scenario().obstacles {
        draw_obstacle(&mut canvas, obstacle);
    }
    draw_route(&mut canvas, map, vehicle);
    draw_caption(&mut canvas, map, lot_height);
    draw_legend(&mut canvas, &legend, &legend_rows, lot_height + 1.5 * LINE_PX);
    Ok(canvas.pixmap.encode_png()?)
}

/// Lowest and highest corner of everything in the picture.
fn extent(map: &Map) -> (Vec2, Vec2) {
    let scenario = map.scenario();
    let outlines = scenario.obstacles.iter().flat_map(Obstacle::outline);
    let points = scenario.boundary.iter().copied().chain(outlines);
    let (low, high) = points.fold((Vec2::MAX, Vec2::MIN), |(low, high), point| (low.min(point), high.max(point)));
    (low - Vec2::splat(MARGIN_M), high + Vec2::splat(MARGIN_M))
}

/// World metres on one side, pixels on the other.
struct Canvas {
    pixmap: Pixmap,
    scale: f32,
    lowest: Vec2,
    top_m: f32,
}

impl Canvas {
    fn pixel(&self, world: Vec2) -> Vec2 {
        Vec2::new(world.x - self.lowest.x, self.top_m - world.y) * self.scale
    }

    fn path(&self, world: impl IntoIterator<Item = Vec2>, closed: bool) -> Option<Path> {
        let mut builder = PathBuilder::new();
        for (index, point) in world.into_iter().enumerate() {
            let pixel = self.pixel(point);
            if index == 0 { builder.move_to(pixel.x, pixel.y) } else { builder.line_to(pixel.x, pixel.y) }
        }
        if closed {
            builder.close();
        }
        builder.finish()
    }

    fn fill(&mut self, world: &[Vec2], rgb: Rgb) {
        if let Some(path) = self.path(world.iter().copied(), true) {
            self.fill_path(&path, rgb);
        }
    }

    fn fill_path(&mut self, path: &Path, rgb: Rgb) {
        self.pixmap.fill_path(path, &paint(rgb), FillRule::Winding, Transform::identity(), None);
    }

    fn line(&mut self, world: impl IntoIterator<Item = Vec2>, closed: bool, rgb: Rgb, width_px: f32, dash_px: &[f32]) {
        let stroke = Stroke {
            width: width_px,
            line_cap: LineCap::Round,
            line_join: LineJoin::Round,
            dash: StrokeDash::new(dash_px.to_vec(), 0.0),
            ..Stroke::default()
        };
        if let Some(path) = self.path(world, closed) {
            self.pixmap.stroke_path(&path, &paint(rgb), &stroke, Transform::identity(), None);
        }
    }

    fn disc_px(&mut self, centre_px: Vec2, radius_px: f32, rgb: Rgb) {
        if let Some(path) = PathBuilder::from_circle(centre_px.x, centre_px.y, radius_px) {
            self.fill_path(&path, rgb);
        }
    }

    /// Writes ASCII text with its upper left corner at a pixel.
    fn text(&mut self, text: &str, at_px: Vec2, rgb: Rgb) {
        let width = self.pixmap.width() as usize;
        for (index, letter) in text.chars().enumerate() {
            let Some(raster) = get_raster(letter, FontWeight::Regular, FONT) else { continue };
            let left = at_px.x as usize + index * raster.width();
            for (y, row) in raster.rows().enumerate() {
                for (x, &cover) in row.iter().enumerate().filter(|(x, cover)| **cover > 0 && left + x < width) {
                    let at = (at_px.y as usize + y) * width + left + x;
                    let Some(pixel) = self.pixmap.pixels_mut().get_mut(at) else { continue };
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
}

fn colour([r, g, b]: Rgb) -> Color {
    Color::from_rgba8(r, g, b, 255)
}

fn paint(rgb: Rgb) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color(colour(rgb));
    paint
}

fn draw_ground(canvas: &mut Canvas, map: &Map) {
    let scenario = map.scenario();
    canvas.fill(&scenario.boundary, ASPHALT);
    for bump in &scenario.speed_bumps {
        let centre = Pose { x_m: bump.x_m, y_m: bump.y_m, heading_rad: bump.heading_deg.to_radians() };
        let outline = sim::geometry::rectangle(centre, bump.length_m, bump.width_m);
        canvas.fill(&outline, SPEED_BUMP);
    }
    for island in &scenario.islands {
        canvas.fill(&island.polygon, ISLAND);
        canvas.line(island.polygon.iter().copied(), true, BOUNDARY, 1.5, &[]);
    }
    canvas.line(scenario.boundary.iter().copied(), true, BOUNDARY, 2.0, &[]);
}

fn draw_obstacle(canvas: &mut Canvas, obstacle: &Obstacle) {
    let (rgb, _) = look(obstacle.class);
    let [length_m, width_m, _] = obstacle.size_m();
    let centre = obstacle.centre();
    let smallest_m = SMALLEST_PX / canvas.scale;
    if obstacle.class.is_round() {
        let radius_px = 0.5 * length_m.max(smallest_m) * canvas.scale;
        canvas.disc_px(canvas.pixel(centre.position()), radius_px, rgb);
        return;
    }
    let (length_m, width_m) = (length_m.max(0.5 * smallest_m), width_m.max(0.5 * smallest_m));
    canvas.fill(&sim::geometry::rectangle(centre, length_m, width_m), rgb);
    if obstacle.class.is_vehicle() {
        // A roof makes it a car and shows which way it stands.
        let roof = Pose::new(centre.position() - centre.ahead() * 0.06 * length_m, centre.heading_rad);
        canvas.fill(&sim::geometry::rectangle(roof, 0.5 * length_m, 0.78 * width_m), lighter(rgb));
    }
}

fn lighter(rgb: Rgb) -> Rgb {
    rgb.map(|channel| channel + (255 - channel) / 3)
}

fn draw_route(canvas: &mut Canvas, map: &Map, vehicle: &VehicleParams) {
    let path = map.path();
    canvas.line(path.poses().iter().map(|pose| pose.position()), false, ROUTE, 2.5, &[12.0, 8.0]);
    let mut at_m = 12.0;
    while at_m < path.length_m() - 4.0 {
        let pose = path.pose_at(at_m);
        let size_m = 9.0 / canvas.scale;
        let side = pose.ahead().perp();
        let tip = pose.position() + pose.ahead() * size_m;
        canvas.fill(&[tip, pose.position() + side * 0.6 * size_m, pose.position() - side * 0.6 * size_m], ROUTE);
        at_m += 20.0;
    }
    let world_from_ego = map.start().world_from_ego();
    let car: Vec<Vec2> = vehicle.body_in_ego().iter().map(|&corner| world_from_ego.point(corner)).collect();
    canvas.line(car, true, ROUTE, 3.0, &[]);
    canvas.disc_px(canvas.pixel(map.start().position()), 7.0, ROUTE);
    let finish = path.pose_at(path.length_m());
    let side = finish.ahead().perp() * 1.3;
    canvas.line([finish.position() - side, finish.position() + side], false, FINISH, 6.0, &[]);
}

/// Name, length, and a scale bar.
fn draw_caption(canvas: &mut Canvas, map: &Map, top_px: f32) {
    let y = top_px + 2.0;
    let text = format!("{}, route {:.0} m", map.scenario().name, map.path().length_m());
    canvas.text(&text, Vec2::new(16.0, y), INK);
    let bar_m = if canvas.pixmap.width() as f32 / canvas.scale > 60.0 { 10.0 } else { 5.0 };
    let label = format!("{bar_m:.0} m");
    let label_px = (label.len() * get_raster_width(FontWeight::Regular, FONT)) as f32;
    let right = canvas.pixmap.width() as f32 - 16.0;
    canvas.text(&label, Vec2::new(right - label_px, y), INK);
    let (from, to) = (right - label_px - 12.0 - bar_m * canvas.scale, right - label_px - 12.0);
    let middle = y + 13.0;
    for (x, y0, y1) in [(from, middle - 7.0, middle + 7.0), (to, middle - 7.0, middle + 7.0)] {
        stroke_px(canvas, [Vec2::new(x, y0), Vec2::new(x, y1)]);
    }
    stroke_px(canvas, [Vec2::new(from, middle), Vec2::new(to, middle)]);
}

fn stroke_px(canvas: &mut Canvas, [a, b]: [Vec2; 2]) {
    let mut builder = PathBuilder::new();
    builder.move_to(a.x, a.y);
    builder.line_to(b.x, b.y);
    if let Some(path) = builder.finish() {
        let stroke = Stroke { width: 3.0, ..Stroke::default() };
        canvas.pixmap.stroke_path(&path, &paint(INK), &stroke, Transform::identity(), None);
    }
}

/// Colours and names of what is in the lot, with counts.
fn legend_of(map: &Map) -> Vec<(Rgb, String)> {
    let scenario = map.scenario();
    let classes = ObstacleClass::ALL.into_iter().filter_map(|class| {
        let count = scenario.obstacles.iter().filter(|obstacle| obstacle.class == class).count();
        let (rgb, name) = look(class);
        (count > 0).then(|| (rgb, format!("{name} {count}")))
    });
    let ground = [
        (ASPHALT, "drivable".to_owned(), true),
        (ISLAND, format!("island {}", scenario.islands.len()), !scenario.islands.is_empty()),
        (SPEED_BUMP, format!("speed bump {}", scenario.speed_bumps.len()), !scenario.speed_bumps.is_empty()),
        (ROUTE, "start and route".to_owned(), true),
        (FINISH, "finish".to_owned(), true),
    ];
    let ground = ground.into_iter().filter(|(_, _, is_there)| *is_there).map(|(rgb, name, _)| (rgb, name));
    ground.chain(classes).collect()
}

const SWATCH_PX: f32 = 20.0;

fn entry_px(name: &str) -> f32 {
    SWATCH_PX + 10.0 + (name.len() * get_raster_width(FontWeight::Regular, FONT)) as f32 + 26.0
}

/// Ranges of entries per row.
fn layout(legend: &[(Rgb, String)], width_px: f32) -> Vec<std::ops::Range<usize>> {
    let mut rows = Vec::new();
    let (mut from, mut used_px) = (0, 16.0);
    for (index, (_, name)) in legend.iter().enumerate() {
        if used_px + entry_px(name) > width_px && index > from {
            rows.push(from..index);
            (from, used_px) = (index, 16.0);
        }
        used_px += entry_px(name);
    }
    rows.push(from..legend.len());
    rows
}

fn draw_legend(canvas: &mut Canvas, legend: &[(Rgb, String)], rows: &[std::ops::Range<usize>], top_px: f32) {
    for (index, row) in rows.iter().enumerate() {
        let y = top_px + index as f32 * LINE_PX;
        let mut x = 16.0;
        for (rgb, name) in &legend[row.clone()] {
            if let Some(swatch) = tiny_skia::Rect::from_xywh(x, y + 3.0, SWATCH_PX, SWATCH_PX) {
                canvas.fill_path(&PathBuilder::from_rect(swatch), *rgb);
            }
            canvas.text(name, Vec2::new(x + SWATCH_PX + 10.0, y), INK);
            x += entry_px(name);
        }
    }
}
