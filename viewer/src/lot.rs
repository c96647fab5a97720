//! A lot as shapes: all of it is static.

use crate::colours::{self, Colour};
use crate::recording::Recording;
use crate::shapes::{self, Block, Dot, Point, Strip};
use sim::geometry::Vec2;
use sim::map::Map;
use sim::scenario::{Island, Obstacle, ObstacleClass};

/// Pixel of the drivable area, metres.
const AREA_STEP_M: f32 = 0.2;
/// Distance from an end of the route to its name, metres: more than the car extends beyond its rear axle.
const NAME_M: f32 = 5.5;
/// Height of the ground, metres: low enough to stay below the lines on the screen.
const GROUND_Z_M: f32 = -0.02;
/// Height at which lines are drawn, metres: above the ground, which would hide them.
pub(crate) const LINE_Z_M: f32 = 0.02;

/// Shows a lot.
pub(crate) fn show(map: &Map, recording: &Recording) {
    let scenario = map.scenario();
    recording.log_static("lot/drivable", &shapes::area(&drivable(map), GROUND_Z_M, colours::ASPHALT));
    recording.log_static("lot/outline", &shapes::strips(&outlines(&scenario.boundary, &scenario.islands)));
    recording.log_static("lot/reference_path", &shapes::strips(&[route(map)]));
    recording.log_static("lot/ends", &shapes::dots(&ends(map)));
    recording.log_static("lot/ends/names", &shapes::dots(&names_of_ends(map)));
    if !scenario.islands.is_empty() {
        let raised = scenario.islands.iter().map(|island| outline(&island.polygon, island.height_m, colours::EDGE));
        recording.log_static("lot/islands", &shapes::strips(&raised.collect::<Vec<_>>()));
    }
    if !scenario.speed_bumps.is_empty() {
        let bumps = scenario.speed_bumps.iter().map(|bump| Block {
            centre: [bump.x_m, bump.y_m, 0.03],
            size_m: [bump.length_m, bump.width_m, 0.06],
            yaw_rad: bump.heading_deg.to_radians(),
            colour: colours::BUMP,
        });
        recording.log_static("lot/speed_bumps", &shapes::boxes(&bumps.collect::<Vec<_>>()));
    }
    for class in ObstacleClass::ALL {
        let of_class = scenario.obstacles.iter().filter(|obstacle| obstacle.class == class);
        let blocks: Vec<Block> = of_class.map(block).collect();
        match (blocks.is_empty(), class.is_round()) {
            (true, _) => {}
            (false, true) => recording.log_static(&entity_of(class), &shapes::cylinders(&blocks)),
            (false, false) => recording.log_static(&entity_of(class), &shapes::boxes(&blocks)),
        }
    }
}

/// Where obstacles of a class are found: each can be switched off in the viewer.
fn entity_of(class: ObstacleClass) -> String {
    format!("lot/obstacles/{}", format!("{class:?}").to_lowercase())
}

/// Centre of the lot, and width and height of the rectangle around it, metres.
pub(crate) fn extent(map: &Map) -> (Vec2, Vec2) {
    let boundary = &map.scenario().boundary;
    let low = boundary.iter().copied().fold(Vec2::INFINITY, Vec2::min);
    let high = boundary.iter().copied().fold(Vec2::NEG_INFINITY, Vec2::max);
    (0.5 * (low + high), high - low)
}

/// A ground point at a height.
pub(crate) fn raised(point: Vec2, z_m: f32) -> Point {
    [point.x, point.y, z_m]
}

/// A closed polygon as a line.
pub(crate) fn outline(polygon: &[Vec2], z_m: f32, colour: Colour) -> Strip {
    let points = polygon.iter().chain(polygon.first()).map(|&point| raised(point, z_m)).collect();
    Strip { points, radius_pt: 1.2, colour }
}

fn outlines(boundary: &[Vec2], islands: &[Island]) -> Vec<Strip> {
    let rings = std::iter::once(boundary).chain(islands.iter().map(|island| island.polygon.as_slice()));
    rings.map(|ring| outline(ring, LINE_Z_M, colours::EDGE)).collect()
}

fn route(map: &Map) -> Strip {
    // Every half metre: a corner of 5 m deviates by 6 mm.
    let points = map.path().poses().iter().step_by(4).map(|pose| raised(pose.position(), LINE_Z_M)).collect();
    Strip { points, radius_pt: 1.0, colour: colours::ROUTE }
}

/// Start and finish.
fn ends(map: &Map) -> [Dot; 2] {
    [0.0, map.path().length_m()].map(|s_m| Dot {
        at: raised(map.path().pose_at(s_m).position(), LINE_Z_M),
        radius_pt: 5.0,
        colour: colours::ROUTE,
        label: String::new(),
    })
}

/// Their names, beyond the ends of the route, so that they do not cover a car that stands there.
fn names_of_ends(map: &Map) -> [Dot; 2] {
    let (start, finish) = (map.path().pose_at(0.0), map.path().pose_at(map.path().length_m()));
    let name = |at: Vec2, label: &str| Dot {
        at: raised(at, LINE_Z_M),
        radius_pt: 0.0,
        colour: colours::ROUTE,
        label: label.to_owned(),
    };
    [
        name(start.position() - NAME_M * start.ahead(), "start"),
        name(finish.position() + NAME_M * finish.ahead(), "finish"),
    ]
}

fn block(obstacle: &Obstacle) -> Block {
    let size_m = obstacle.size_m();
    Block {
        centre: raised(obstacle.centre().position(), 0.5 * size_m[2]),
        size_m,
        yaw_rad: obstacle.centre().heading_rad,
        colour: colours::of_class(obstacle.class),
    }
}

/// The drivable area as the simulator knows it, obstacles cut out: pixels, joined to rectangles.
fn drivable(map: &Map) -> Vec<[f32; 4]> {
    let (centre, size) = extent(map);
    let origin = centre - 0.5 * size;
    let cells = |metres: f32| (metres / AREA_STEP_M).ceil() as usize;
    let (cols, rows) = (cells(size.x), cells(size.y));
    let is_free = |row: usize, col: usize| {
        map.signed_distance_m(origin + AREA_STEP_M * Vec2::new(col as f32 + 0.5, row as f32 + 0.5)) > 0.0
    };
    // Runs of the row before, by their first and last column, with the row they began in.
    let mut open: Vec<(usize, usize, usize)> = Vec::new();
    let mut rectangles = Vec::new();
    for row in 0..=rows {
        let runs = if row < rows { runs(cols, |col| is_free(row, col)) } else { Vec::new() };
        let (kept, closed): (Vec<_>, Vec<_>) =
            open.iter().copied().partition(|&(first, last, _)| runs.contains(&(first, last)));
        rectangles.extend(closed.iter().map(|&(first, last, since)| {
            let low = origin + AREA_STEP_M * Vec2::new(first as f32, since as f32);
            let high = origin + AREA_STEP_M * Vec2::new(last as f32 + 1.0, row as f32);
            [low.x, low.y, high.x, high.y]
        }));
        let since = |run: &(usize, usize)| {
            kept.iter().find(|&&(first, last, _)| (first, last) == *run).map_or(row, |&(_, _, since)| since)
        };
        open = runs.iter().map(|run| (run.0, run.1, since(run))).collect();
    }
    rectangles
}

/// First and last column of every run of free cells.
fn runs(cols: usize, is_free: impl Fn(usize) -> bool) -> Vec<(usize, usize)> {
    let mut runs: Vec<(usize, usize)> = Vec::new();
    for col in (0..cols).filter(|&col| is_free(col)) {
        match runs.last_mut() {
            Some((_, last)) if *last + 1 == col => *last = col,
            _ => runs.push((col, col)),
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{Shown, map};
    use rerun::{Boxes3D, Cylinders3D};

    #[test]
    fn the_drivable_area_is_that_of_the_map() {
        let map = map();
        let rectangles = drivable(&map);
        let shown_m2: f32 = rectangles.iter().map(|[left, low, right, high]| (right - left) * (high - low)).sum();
        let (centre, size) = extent(&map);
        let n = 400;
        let free = (0..n * n)
            .map(|i| Vec2::new((i % n) as f32 + 0.5, (i / n) as f32 + 0.5) / n as f32 - 0.5)
            .filter(|share| map.signed_distance_m(centre + *share * size) > 0.0);
        let expected_m2 = free.count() as f32 / (n * n) as f32 * size.x * size.y;
        assert!((shown_m2 / expected_m2 - 1.0).abs() < 0.01, "{shown_m2} m², expected {expected_m2} m²");
        for pose in map.path().poses().iter().step_by(8) {
            let is_shown = rectangles.iter().any(|[left, low, right, high]| {
                (*left..=*right).contains(&pose.x_m) && (*low..=*high).contains(&pose.y_m)
            });
            assert!(is_shown, "the route at {pose:?} is drivable");
        }
    }

    #[test]
    fn every_obstacle_is_shown_once_with_its_class() {
        let map = map();
        let shown = Shown::of(|recording| show(&map, recording));
        let mut count = 0;
        for entity in shown.entities().iter().filter(|entity| entity.starts_with("lot/obstacles/")) {
            let boxes = shown.points(entity, &Boxes3D::descriptor_half_sizes());
            let cylinders = shown.points(entity, &Cylinders3D::descriptor_centers());
            let found: usize = boxes.values().chain(cylinders.values()).map(Vec::len).sum();
            let of_class = map.scenario().obstacles.iter().filter(|obstacle| entity_of(obstacle.class) == *entity);
            assert_eq!(found, of_class.count(), "{entity}");
            count += found;
        }
        assert_eq!(count, map.scenario().obstacles.len());
    }
}
