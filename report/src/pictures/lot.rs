//! Lots from above.

use super::drawing::{Drawing, Font, Rgb};
use sim::geometry::{Pose, Vec2};
use sim::map::Map;
use sim::scenario::{Obstacle, ObstacleClass};
use sim::vehicle::VehicleSettings;

/// Around the lot, metres.
const MARGIN_M: f32 = 3.0;
/// Longest side of a picture if no scale is asked for, pixels …
const SIDE_PX: f32 = 1600.0;
/// … within these pixels per metre: bollards stay visible, small lots do not become posters.
const SCALE_PX_PER_M: (f32, f32) = (4.0, 24.0);
/// Small things are drawn at least this wide, pixels.
const SMALLEST_PX: f32 = 5.0;
const FONT: Font = Font::Large;
/// Height of a line of text, pixels.
pub const LINE_PX: f32 = 34.0;

/// Around everything.
pub const GROUND: Rgb = [0xEE, 0xEC, 0xE6];
/// Drivable.
pub const ASPHALT: Rgb = [0xC6, 0xCA, 0xD0];
const BOUNDARY: Rgb = [0x5B, 0x61, 0x6B];
const ISLAND: Rgb = [0xA9, 0xC7, 0x9B];
const SPEED_BUMP: Rgb = [0xF0, 0xC2, 0x3C];
/// The reference path.
pub const ROUTE: Rgb = [0x1B, 0x7F, 0x4B];
const FINISH: Rgb = [0xC0, 0x2F, 0x2F];
/// Text.
pub const INK: Rgb = [0x22, 0x25, 0x2B];

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
        ObstacleClass::Wall => ([0x6B, 0x3A, 0x2E], "wall"),
    }
}

/// World metres on one side, pixels on the other.
#[derive(Debug, Clone, Copy)]
pub struct View {
    /// Pixels per metre.
    pub px_per_m: f32,
    /// Upper left corner of the picture in the world, metres.
    pub corner_m: Vec2,
    /// What the picture shows, metres.
    pub size_m: Vec2,
}

impl View {
    /// Everything of a map, with a margin.
    pub fn of_map(map: &Map, px_per_m: Option<f32>) -> Self {
        let (lowest, highest) = extent(map);
        let size_m = highest - lowest;
        let fitting = (SIDE_PX / size_m.max_element()).clamp(SCALE_PX_PER_M.0, SCALE_PX_PER_M.1);
        Self { px_per_m: px_per_m.unwrap_or(fitting), corner_m: Vec2::new(lowest.x, highest.y), size_m }
    }

    /// Everything of a map, as large as fits into a rectangle of pixels.
    pub fn fitting(map: &Map, size_px: Vec2) -> Self {
        let whole = Self::of_map(map, Some(1.0));
        let px_per_m = (size_px / whole.size_m).min_element();
        let centre = whole.corner_m + Vec2::new(0.5, -0.5) * whole.size_m;
        let size_m = size_px / px_per_m;
        Self { px_per_m, corner_m: centre + Vec2::new(-0.5, 0.5) * size_m, size_m }
    }

    /// A square of the world around a place.
    pub fn around(centre: Vec2, side_m: f32, side_px: f32) -> Self {
        let corner_m = centre + Vec2::new(-0.5, 0.5) * side_m;
        Self { px_per_m: side_px / side_m, corner_m, size_m: Vec2::splat(side_m) }
    }

    /// Pixels of the picture.
    pub fn size_px(&self) -> Vec2 {
        self.size_m * self.px_per_m
    }

    /// Where a place of the world lies in the picture.
    pub fn pixel(&self, world: Vec2) -> Vec2 {
        Vec2::new(world.x - self.corner_m.x, self.corner_m.y - world.y) * self.px_per_m
    }

    /// The same of several.
    pub fn pixels(&self, world: impl IntoIterator<Item = Vec2>) -> Vec<Vec2> {
        world.into_iter().map(|point| self.pixel(point)).collect()
    }
}

/// A top view with route, name, scale and legend.
///
/// # Errors
/// If the picture would be too large.
pub fn top_view(map: &Map, vehicle: &VehicleSettings, px_per_m: Option<f32>) -> anyhow::Result<Drawing> {
    let view = View::of_map(map, px_per_m);
    let legend = legend_of(map);
    let lot = view.size_px();
    let width = lot.x.max(400.0);
    let rows = layout(&legend, width);
    let mut drawing = Drawing::new(Vec2::new(width, lot.y + LINE_PX * (rows.len() as f32 + 2.0)), GROUND)?;
    draw_ground(&mut drawing, &view, map);
    draw_obstacles(&mut drawing, &view, map);
    draw_route(&mut drawing, &view, map, vehicle);
    let name = format!("{}, route {:.0} m", map.scenario().name, map.path().length_m());
    draw_caption(&mut drawing, &view, &name, lot.y);
    draw_legend(&mut drawing, &legend, &rows, lot.y + 1.5 * LINE_PX);
    Ok(drawing)
}

/// Lowest and highest corner of everything in the picture.
fn extent(map: &Map) -> (Vec2, Vec2) {
    let scenario = map.scenario();
    let outlines = scenario.obstacles.iter().flat_map(Obstacle::outline);
    let points = scenario.boundary.iter().copied().chain(outlines);
    let (low, high) = points.fold((Vec2::MAX, Vec2::MIN), |(low, high), point| (low.min(point), high.max(point)));
    (low - Vec2::splat(MARGIN_M), high + Vec2::splat(MARGIN_M))
}

/// What can be driven on, and what bounds it.
pub fn draw_ground(drawing: &mut Drawing, view: &View, map: &Map) {
    let scenario = map.scenario();
    let boundary = view.pixels(scenario.boundary.iter().copied());
    drawing.polygon(boundary.clone(), ASPHALT);
    for bump in &scenario.speed_bumps {
        let centre = Pose { x_m: bump.x_m, y_m: bump.y_m, heading_rad: bump.heading_deg.to_radians() };
        let outline = sim::geometry::rectangle(centre, bump.length_m, bump.width_m);
        drawing.polygon(view.pixels(outline), SPEED_BUMP);
    }
    for island in &scenario.islands {
        let outline = view.pixels(island.polygon.iter().copied());
        drawing.polygon(outline.clone(), ISLAND);
        drawing.outline(outline, BOUNDARY, 1.5);
    }
    drawing.outline(boundary, BOUNDARY, 2.0);
}

/// Obstacles on it.
pub fn draw_obstacles(drawing: &mut Drawing, view: &View, map: &Map) {
    for obstacle in &map.scenario().obstacles {
        draw_obstacle(drawing, view, obstacle);
    }
}

fn draw_obstacle(drawing: &mut Drawing, view: &View, obstacle: &Obstacle) {
    let (rgb, _) = look(obstacle.class);
    let [length_m, width_m, _] = obstacle.size_m();
    let centre = obstacle.centre();
    let smallest_m = SMALLEST_PX / view.px_per_m;
    if obstacle.class.is_round() {
        let radius_px = 0.5 * length_m.max(smallest_m) * view.px_per_m;
        drawing.disc(view.pixel(centre.position()), radius_px, rgb);
        return;
    }
    let (length_m, width_m) = (length_m.max(0.5 * smallest_m), width_m.max(0.5 * smallest_m));
    drawing.polygon(view.pixels(sim::geometry::rectangle(centre, length_m, width_m)), rgb);
    if obstacle.class.is_vehicle() {
        // A roof makes it a car and shows which way it stands.
        let roof = Pose::new(centre.position() - centre.ahead() * 0.06 * length_m, centre.heading_rad);
        let roof = sim::geometry::rectangle(roof, 0.5 * length_m, 0.78 * width_m);
        drawing.polygon(view.pixels(roof), lighter(rgb));
    }
}

fn lighter(rgb: Rgb) -> Rgb {
    rgb.map(|channel| channel + (255 - channel) / 3)
}

/// Outline of the car with its rear axle at a pose.
pub fn draw_car(drawing: &mut Drawing, view: &View, vehicle: &VehicleSettings, pose: Pose, rgb: Rgb, width_px: f32) {
    let world_from_ego = pose.world_from_ego();
    let body = vehicle.body_in_ego().map(|corner| world_from_ego.point(corner));
    drawing.outline(view.pixels(body), rgb, width_px);
}

fn draw_route(drawing: &mut Drawing, view: &View, map: &Map, vehicle: &VehicleSettings) {
    let path = map.path();
    drawing.dashed(view.pixels(path.poses().iter().map(|pose| pose.position())), ROUTE, 2.5, [12.0, 8.0]);
    let mut at_m = 12.0;
    while at_m < path.length_m() - 4.0 {
        let pose = path.pose_at(at_m);
        let size_m = 9.0 / view.px_per_m;
        let side = pose.ahead().perp();
        let tip = pose.position() + pose.ahead() * size_m;
        let arrow = [tip, pose.position() + side * 0.6 * size_m, pose.position() - side * 0.6 * size_m];
        drawing.polygon(view.pixels(arrow), ROUTE);
        at_m += 20.0;
    }
    draw_car(drawing, view, vehicle, map.start(), ROUTE, 3.0);
    drawing.disc(view.pixel(map.start().position()), 7.0, ROUTE);
    draw_finish(drawing, view, map);
}

/// The line across the end of the route.
pub fn draw_finish(drawing: &mut Drawing, view: &View, map: &Map) {
    let finish = map.path().pose_at(map.path().length_m());
    let side = finish.ahead().perp() * 1.3;
    drawing.line(view.pixels([finish.position() - side, finish.position() + side]), FINISH, 6.0);
}

/// A text and a scale bar below a lot; the text is shortened where both do not fit.
pub fn draw_caption(drawing: &mut Drawing, view: &View, text: &str, top_px: f32) {
    let y = top_px + 2.0;
    let bar_m = if view.size_m.x > 60.0 { 10.0 } else { 5.0 };
    let label = format!("{bar_m:.0} m");
    let right = drawing.size_px().x - 16.0;
    let label_px = FONT.width_px(&label);
    let (from, to) = (right - label_px - 12.0 - bar_m * view.px_per_m, right - label_px - 12.0);
    let letters = ((from - 40.0) / FONT.width_px("x")).max(0.0) as usize;
    drawing.text(shortened(text, letters), Vec2::new(16.0, y), FONT, INK);
    drawing.text(label, Vec2::new(right - label_px, y), FONT, INK);
    let middle = y + 13.0;
    for x in [from, to] {
        drawing.line(vec![Vec2::new(x, middle - 7.0), Vec2::new(x, middle + 7.0)], INK, 3.0);
    }
    drawing.line(vec![Vec2::new(from, middle), Vec2::new(to, middle)], INK, 3.0);
}

/// At most this many letters, the last two of them dots if any are missing.
pub fn shortened(text: &str, letters: usize) -> String {
    if text.chars().count() <= letters {
        return text.to_owned();
    }
    text.chars().take(letters.saturating_sub(2)).chain("..".chars()).collect()
}

/// The same, but of its beginning letters are missing: runs differ at their ends.
pub fn ending(text: &str, letters: usize) -> String {
    let count = text.chars().count();
    if count <= letters {
        return text.to_owned();
    }
    "..".chars().chain(text.chars().skip(count + 2 - letters)).collect()
}

/// A colour and its meaning.
pub type LegendEntry = (Rgb, String);

/// Colours, names and counts of what the lot contains.
fn legend_of(map: &Map) -> Vec<LegendEntry> {
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

/// Width that a legend needs for an entry of this name.
pub fn entry_px(name: &str) -> f32 {
    SWATCH_PX + 10.0 + FONT.width_px(name) + 26.0
}

/// Ranges of legend entries per row.
pub fn layout(legend: &[LegendEntry], width_px: f32) -> Vec<std::ops::Range<usize>> {
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

/// Swatches with names, in rows from [`layout`].
pub fn draw_legend(drawing: &mut Drawing, legend: &[LegendEntry], rows: &[std::ops::Range<usize>], top_px: f32) {
    for (index, row) in rows.iter().enumerate() {
        let y = top_px + index as f32 * LINE_PX;
        let mut x = 16.0;
        for (rgb, name) in &legend[row.clone()] {
            drawing.rectangle(Vec2::new(x, y + 3.0), Vec2::splat(SWATCH_PX), *rgb);
            drawing.text(name.clone(), Vec2::new(x + SWATCH_PX + 10.0, y), FONT, INK);
            x += entry_px(name);
        }
    }
}
