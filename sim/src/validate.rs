//! Checks a scenario before it becomes a map, so that nothing behind [`crate::map::Map::build`] has to.
//!
//! The order is from plain numbers to relations between things: later checks rely on earlier ones.

use crate::geometry::{Pose, Vec2, bounds, distance_to_segment_m, edges, polygon_contains, signed_area_m2};
use crate::limits::{
    COORDINATE_MAX_M, ISLANDS_MAX, LOT_EXTENT_MAX_M, NAME_BYTES_MAX, NAME_CHARS_MAX, OBSTACLES_MAX, OUTLINES_MAX_M,
    ROUTE_MAX_M, ROUTE_POINTS_MAX, SPEED_BUMPS_MAX, VERTICES_MAX,
};
use crate::maths;
use crate::path::Path;
use crate::scenario::{Island, Obstacle, Place, ReferencePath, Scenario, ScenarioError};
use crate::vehicle::VehicleSettings;
use glam::DVec2;

/// An object farther than this from the lot is a typing error, metres.
const STRAY_M: f32 = 50.0;
/// Points nearer than this count as one, metres.
const COINCIDENT_M: f32 = 1e-3;
/// A route shorter than about a car's length measures nothing, metres.
const PATH_MIN_M: f32 = 5.0;
/// The route is tested in chords of about this length, metres: a chord of a 5 m corner strays by 6 mm.
const CHORD_M: f32 = 0.5;
/// The longest edge that fits into a lot, metres: its diagonal.
const EDGE_MAX_M: f32 = std::f32::consts::SQRT_2 * LOT_EXTENT_MAX_M;
/// Chords tested together against one bounding box.
const CHORDS_PER_BLOCK: usize = 16;

/// Refuses a scenario that cannot be driven.
///
/// # Errors
/// The first problem found, with its place and a remedy.
pub fn validate(scenario: &Scenario, vehicle: &VehicleSettings) -> Result<(), ScenarioError> {
    check_name(&scenario.name)?;
    check_counts(scenario)?;
    check_near_origin(&scenario.boundary)?;
    check_lengths(scenario)?;
    check_polygon(&scenario.boundary, Place::Boundary)?;
    check_extent(&scenario.boundary)?;
    if scenario.boundary_height_m != 0.0 {
        check_size(Place::Boundary(None), "boundary_height_m", scenario.boundary_height_m, 5.0)?;
    }
    let lot = bounds(&scenario.boundary);
    for (i, island) in scenario.islands.iter().enumerate() {
        check_island(i, island, &scenario.boundary)?;
    }
    for (i, obstacle) in scenario.obstacles.iter().enumerate() {
        check_obstacle(Place::Obstacle(i), obstacle)?;
        check_near(Place::Obstacle(i), obstacle.centre().position(), lot)?;
    }
    for (i, bump) in scenario.speed_bumps.iter().enumerate() {
        let place = Place::SpeedBump(i);
        check_finite(place, &[("x_m", bump.x_m), ("y_m", bump.y_m), ("heading_deg", bump.heading_deg)])?;
        check_near(place, Vec2::new(bump.x_m, bump.y_m), lot)?;
        check_size(place, "length_m", bump.length_m, 30.0)?;
        check_size(place, "width_m", bump.width_m, 30.0)?;
    }
    check_path_points(&scenario.reference_path, lot)?;
    let length_m: f32 = scenario.reference_path.points.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
    if length_m > ROUTE_MAX_M {
        let problem = format!("the route is {:.0} km long", length_m / 1000.0);
        return fault(Place::ReferencePath(None), problem, format!("end it within {ROUTE_MAX_M} m"));
    }
    let path = Path::new(&scenario.reference_path);
    if path.length_m() < PATH_MIN_M {
        let problem = format!("the route is {:.2} m long", path.length_m());
        return fault(Place::ReferencePath(None), problem, format!("make it at least {PATH_MIN_M} m"));
    }
    check_start(scenario, vehicle, path.pose_at(0.0))?;
    check_route(scenario, &Route::new(&path))
}

/// Refuses an island that is not a sound outline within the boundary. `index`: its number, from 0.
///
/// # Errors
/// The first problem found, with a remedy.
pub fn check_island(index: usize, island: &Island, boundary: &[Vec2]) -> Result<(), ScenarioError> {
    check_polygon(&island.polygon, |_| Place::Island(index))?;
    check_size(Place::Island(index), "height_m", island.height_m, 5.0)?;
    check_island_inside(index, &island.polygon, boundary)
}

fn fault<T>(place: Place, problem: impl Into<String>, remedy: impl Into<String>) -> Result<T, ScenarioError> {
    Err(ScenarioError { place, problem: problem.into(), remedy: remedy.into() })
}

fn check_name(name: &str) -> Result<(), ScenarioError> {
    if name.trim().is_empty() {
        return fault(Place::Name, "the name is empty", "give the lot a name; tables and files are labelled with it");
    }
    let length = name.chars().count();
    if length > NAME_CHARS_MAX {
        let start: String = name.chars().take(20).collect();
        let problem = format!("the name {start:?} … has {length} characters");
        return fault(Place::Name, problem, format!("shorten it to at most {NAME_CHARS_MAX}"));
    }
    if name.len() > NAME_BYTES_MAX {
        let start: String = name.chars().take(20).collect();
        let problem = format!("the name {start:?} … has {} bytes", name.len());
        return fault(
            Place::Name,
            problem,
            format!("shorten it to at most {NAME_BYTES_MAX}; files are named after it"),
        );
    }
    if let Some(bad) = name.chars().find(|&c| matches!(c, '/' | '\\' | '|') || is_hidden(c)) {
        let problem = format!("the name {name:?} contains {bad:?}");
        return fault(
            Place::Name,
            problem,
            "use letters, digits, '-' and '_'; files are named after it, and tables hold it",
        );
    }
    Ok(())
}

/// Whether a letter has no shape of its own: what a terminal obeys, what shows nothing, and what turns the direction of writing.
/// Two names that look the same must be the same.
pub fn is_hidden(c: char) -> bool {
    let is_invisible = matches!(
        c,
        '\u{ad}'
            | '\u{61c}'
            | '\u{180e}'
            | '\u{200b}'..='\u{200f}'
            | '\u{2028}'..='\u{202e}'
            | '\u{2060}'..='\u{206f}'
            | '\u{feff}'
            | '\u{fff9}'..='\u{fffb}'
            | '\u{e0000}'..='\u{e007f}'
    );
    c.is_control() || is_invisible
}

/// Before anything is compared with everything else.
fn check_counts(scenario: &Scenario) -> Result<(), ScenarioError> {
    let Scenario { boundary, islands, obstacles, speed_bumps, reference_path, .. } = scenario;
    let vertices = boundary.len() + islands.iter().map(|island| island.polygon.len()).sum::<usize>();
    let counts = [
        (Place::Boundary(None), "vertices, islands included", vertices, VERTICES_MAX),
        (Place::Island(ISLANDS_MAX), "islands", islands.len(), ISLANDS_MAX),
        (Place::Obstacle(OBSTACLES_MAX), "obstacles", obstacles.len(), OBSTACLES_MAX),
        (Place::SpeedBump(SPEED_BUMPS_MAX), "speed bumps", speed_bumps.len(), SPEED_BUMPS_MAX),
        (Place::ReferencePath(None), "points", reference_path.points.len(), ROUTE_POINTS_MAX),
    ];
    match counts.into_iter().find(|(_, _, count, max)| count > max) {
        Some((place, what, count, max)) => {
            fault(place, format!("there are {count} {what}"), format!("leave some out: at most {max} fit"))
        }
        None => Ok(()),
    }
}

fn check_finite(place: Place, numbers: &[(&str, f32)]) -> Result<(), ScenarioError> {
    match numbers.iter().find(|(_, value)| !value.is_finite()) {
        Some((name, value)) => fault(place, format!("{name} is {value}"), "write a finite number"),
        None => Ok(()),
    }
}

fn check_size(place: Place, name: &str, value: f32, max: f32) -> Result<(), ScenarioError> {
    check_finite(place, &[(name, value)])?;
    if value <= 0.0 || value > max {
        let remedy = format!("write a number of metres above 0 and up to {max}");
        return fault(place, format!("{name} is {value}"), remedy);
    }
    Ok(())
}

fn check_near(place: Place, point: Vec2, lot: (Vec2, Vec2)) -> Result<(), ScenarioError> {
    if boxes_meet((point, point), (lot.0 - STRAY_M, lot.1 + STRAY_M)) {
        return Ok(());
    }
    let problem = format!("it stands at {}, more than {STRAY_M} m from the lot", at(point));
    fault(place, problem, "move it nearer; coordinates are in metres")
}

fn check_obstacle(place: Place, obstacle: &Obstacle) -> Result<(), ScenarioError> {
    let numbers = [("x_m", obstacle.x_m), ("y_m", obstacle.y_m), ("heading_deg", obstacle.heading_deg)];
    check_finite(place, &numbers)?;
    let [length_m, width_m, height_m] = obstacle.size_m();
    check_size(place, "length_m", length_m, 30.0)?;
    check_size(place, "width_m", width_m, 30.0)?;
    check_size(place, "height_m", height_m, 20.0)
}

/// A simple polygon with some area.
fn check_polygon(polygon: &[Vec2], place: impl Fn(Option<usize>) -> Place) -> Result<(), ScenarioError> {
    for (i, vertex) in polygon.iter().enumerate() {
        check_finite(place(Some(i)), &[("x", vertex.x), ("y", vertex.y)])?;
    }
    if polygon.len() < 3 {
        let problem = format!("{} vertices enclose no ground", polygon.len());
        return fault(place(None), problem, "give at least 3 vertices");
    }
    for (i, (a, b)) in edges(polygon).enumerate() {
        if a.distance(b) < COINCIDENT_M {
            let second = (i + 1) % polygon.len();
            let problem = format!("vertices {} and {} are the same point, {}", i + 1, second + 1, at(a));
            let remedy = "delete one of them; the last vertex joins the first by itself";
            return fault(place(Some(i.max(second))), problem, remedy);
        }
    }
    if let Some((i, j)) = first_crossing(polygon) {
        let next = |i: usize| (i + 1) % polygon.len() + 1;
        let problem = format!(
            "the edge from vertex {} to {} meets the edge from vertex {} to {} near {}",
            i + 1,
            next(i),
            j + 1,
            next(j),
            at(meeting_point(polygon, i, j))
        );
        return fault(place(Some(i)), problem, "reorder or move the vertices so that no edges cross");
    }
    let area_m2 = signed_area_m2(polygon).abs();
    if area_m2 < 0.01 {
        let problem = format!("the outline encloses {area_m2:.4} m²");
        return fault(place(None), problem, "spread the vertices out; coordinates are in metres");
    }
    Ok(())
}

fn check_extent(boundary: &[Vec2]) -> Result<(), ScenarioError> {
    let (low, high) = bounds(boundary);
    let size = high - low;
    if size.max_element() > LOT_EXTENT_MAX_M {
        let problem = format!("the lot spans {:.0} m × {:.0} m", size.x, size.y);
        let remedy = format!("keep it within {LOT_EXTENT_MAX_M} m; coordinates are in metres");
        return fault(Place::Boundary(None), problem, remedy);
    }
    Ok(())
}

/// A comb of few vertices may be thousands of kilometres long: to compare its edges takes seconds, and what is made of its
/// walls gigabytes. Edges longer than a lot, or without a length, have errors of their own.
fn check_lengths(Scenario { boundary, islands, .. }: &Scenario) -> Result<(), ScenarioError> {
    let outlines = std::iter::once(boundary).chain(islands.iter().map(|island| &island.polygon));
    let length_m: f64 =
        outlines.flat_map(|outline| edges(outline)).map(|(a, b)| f64::from(a.distance(b).min(EDGE_MAX_M))).sum();
    if length_m > OUTLINES_MAX_M {
        let problem = format!("the outlines of boundary and islands are {:.0} km long", length_m / 1000.0);
        let remedy = format!("leave some out: at most {:.0} km fit", OUTLINES_MAX_M / 1000.0);
        return fault(Place::Boundary(None), problem, remedy);
    }
    Ok(())
}

/// Before anything else: far away, different points become the same.
fn check_near_origin(boundary: &[Vec2]) -> Result<(), ScenarioError> {
    let (low, high) = bounds(boundary);
    let far = low.abs().max(high.abs()).max_element();
    if far > COORDINATE_MAX_M && far.is_finite() {
        let problem = format!("a coordinate is {far:.0} m from the origin");
        return fault(Place::Boundary(None), problem, "move the lot near (0, 0)");
    }
    Ok(())
}

fn check_island_inside(index: usize, island: &[Vec2], boundary: &[Vec2]) -> Result<(), ScenarioError> {
    let remedy = "move it inside the boundary, or cut the boundary there instead";
    let (low, high) = bounds(island);
    let is_near = |(a, b): &(Vec2, Vec2)| boxes_meet((a.min(*b), a.max(*b)), (low, high));
    let near: Vec<(usize, (Vec2, Vec2))> = edges(boundary).enumerate().filter(|(_, edge)| is_near(edge)).collect();
    // Where no edge of the boundary is near, one vertex speaks for all: there may be thousands of islands.
    let vertices = if near.is_empty() { &island[..1] } else { island };
    if let Some(i) = vertices.iter().position(|&vertex| !polygon_contains(boundary, vertex)) {
        let problem = format!("its vertex {}, {}, lies outside the boundary", i + 1, at(island[i]));
        return fault(Place::Island(index), problem, remedy);
    }
    for (i, (a, b)) in near {
        if edges(island).any(|(c, d)| segments_meet(a, b, c, d)) {
            let problem = format!("it crosses the boundary's edge from vertex {}", i + 1);
            return fault(Place::Island(index), problem, remedy);
        }
    }
    Ok(())
}

fn check_path_points(path: &ReferencePath, lot: (Vec2, Vec2)) -> Result<(), ScenarioError> {
    for (i, point) in path.points.iter().enumerate() {
        let place = Place::ReferencePath(Some(i));
        check_finite(place, &[("x", point.x), ("y", point.y)])?;
        if !boxes_meet((*point, *point), lot) {
            let problem = format!("the point {} lies outside the lot", at(*point));
            return fault(place, problem, "move it inside the boundary");
        }
    }
    let place = Place::ReferencePath(None);
    if path.points.len() < 2 {
        let problem = format!("the route has {} points", path.points.len());
        return fault(place, problem, "give at least a start and a finish");
    }
    if let Some(i) = path.points.windows(2).position(|pair| pair[0].distance(pair[1]) < COINCIDENT_M) {
        let problem = format!("points {} and {} are the same, {}", i + 1, i + 2, at(path.points[i]));
        return fault(Place::ReferencePath(Some(i + 1)), problem, "delete one of them");
    }
    for (i, three) in path.points.windows(3).enumerate() {
        let turn_deg = (three[1] - three[0]).angle_to(three[2] - three[1]).to_degrees().abs();
        if turn_deg > 170.0 {
            let problem = format!("the route turns by {turn_deg:.0}° at {}", at(three[1]));
            return fault(
                Place::ReferencePath(Some(i + 1)),
                problem,
                "cars here do not reverse; turn by less than 170°",
            );
        }
    }
    check_finite(place, &[("corner_radius_m", path.corner_radius_m)])?;
    if !(0.0..=100.0).contains(&path.corner_radius_m) {
        let problem = format!("corner_radius_m is {}", path.corner_radius_m);
        return fault(place, problem, "write a number of metres from 0 to 100");
    }
    Ok(())
}

/// The body at the start must stand on free ground.
fn check_start(scenario: &Scenario, vehicle: &VehicleSettings, start: Pose) -> Result<(), ScenarioError> {
    let place = Place::ReferencePath(Some(0));
    let world_from_ego = start.world_from_ego();
    let body = vehicle.body_in_ego().map(|corner| world_from_ego.point(corner));
    let outlines = std::iter::once(&scenario.boundary).chain(scenario.islands.iter().map(|island| &island.polygon));
    let (low, high) = bounds(&body);
    let crosses_line = outlines.flat_map(|outline| edges(outline)).any(|(a, b)| {
        boxes_meet((a.min(b), a.max(b)), (low, high)) && edges(&body).any(|(c, d)| segments_meet(a, b, c, d))
    });
    let stands_outside = body.iter().any(|&corner| {
        !polygon_contains(&scenario.boundary, corner)
            || scenario.islands.iter().any(|island| polygon_contains(&island.polygon, corner))
    });
    // Where no lines cross, one vertex tells whether an island lies beneath the car.
    let stands_over_island = scenario.islands.iter().any(|island| polygon_contains(&body, island.polygon[0]));
    if crosses_line || stands_outside || stands_over_island {
        let (length_m, width_m) = (vehicle.length_m, vehicle.width_m);
        let problem =
            format!("the car ({length_m:.2} m × {width_m:.2} m) does not fit at the start, {}", at(start.position()));
        let remedy = format!(
            "leave {:.2} m behind, {:.2} m ahead of and {:.2} m beside the first point drivable",
            vehicle.rear_overhang_m,
            vehicle.front_m(),
            0.5 * width_m
        );
        return fault(place, problem, remedy);
    }
    for (i, obstacle) in scenario.obstacles.iter().enumerate() {
        if obstacle_overlaps(obstacle, &body) {
            let problem = format!("the {} stands where the car starts", name_of(obstacle));
            return fault(Place::Obstacle(i), problem, "move it or the start of the reference path");
        }
    }
    Ok(())
}

/// The centre line must be drivable ground: a car is put back onto it after a near-collision.
fn check_route(scenario: &Scenario, route: &Route) -> Result<(), ScenarioError> {
    for (a, b) in edges(&scenario.boundary) {
        if let Some(chord) = route.first_chord_near(&Strip::of_edge(a, b), |c, d| segments_meet(a, b, c, d)) {
            let problem = format!("the route leaves the boundary {}", route.place_of(chord));
            let remedy = "move that point, or the boundary; mind that corner_radius_m rounds corners";
            return fault(route.vertex_near(chord, &scenario.reference_path), problem, remedy);
        }
    }
    for (i, island) in scenario.islands.iter().enumerate() {
        // The car starts beside it, so that the route meets an edge where it first gets there. Edge by edge: a route of 20 km
        // may wind through the box around an island of 20 000 vertices.
        let meets_edge = |(a, b)| route.first_chord_near(&Strip::of_edge(a, b), |c, d| segments_meet(a, b, c, d));
        if let Some(chord) = edges(&island.polygon).filter_map(meets_edge).min() {
            let problem = format!("the route runs into island {} {}", i + 1, route.place_of(chord));
            return fault(route.vertex_near(chord, &scenario.reference_path), problem, "lead it around the island");
        }
    }
    for (i, obstacle) in scenario.obstacles.iter().enumerate() {
        let (centre, radius_m) = (obstacle.centre().position(), 0.5 * obstacle.size_m()[0]);
        let outline = obstacle.outline();
        let meets_obstacle = |c: Vec2, d: Vec2| {
            if obstacle.class.is_round() {
                return distance_to_segment_m(centre, c, d) < radius_m;
            }
            polygon_contains(&outline, d) || edges(&outline).any(|(a, b)| segments_meet(a, b, c, d))
        };
        if let Some(chord) = route.first_chord_near(&Strip::of_obstacle(obstacle), meets_obstacle) {
            let problem = format!("the {} stands on the reference path {}", name_of(obstacle), route.place_of(chord));
            return fault(Place::Obstacle(i), problem, "move it aside, or lead the path around it");
        }
    }
    Ok(())
}

/// The rounded route in chords, with bounding boxes of runs of them.
struct Route {
    points: Vec<Vec2>,
    spacing_m: f32,
    blocks: Vec<(Vec2, Vec2)>,
}

impl Route {
    fn new(path: &Path) -> Self {
        let count = (path.length_m() / CHORD_M).ceil() as usize;
        let spacing_m = path.length_m() / count as f32;
        let points: Vec<_> = (0..=count).map(|i| path.pose_at(i as f32 * spacing_m).position()).collect();
        let blocks = (0..count)
            .step_by(CHORDS_PER_BLOCK)
            .map(|first| bounds(&points[first..=(first + CHORDS_PER_BLOCK).min(count)]))
            .collect();
        Self { points, spacing_m, blocks }
    }

    /// The first chord that passes `test` among those that may be near something.
    fn first_chord_near(&self, strip: &Strip, test: impl Fn(Vec2, Vec2) -> bool) -> Option<usize> {
        let near_blocks = self.blocks.iter().enumerate().filter(|(_, block)| strip.may_meet(**block));
        let chords = self.points.len() - 1;
        near_blocks.flat_map(|(i, _)| i * CHORDS_PER_BLOCK..((i + 1) * CHORDS_PER_BLOCK).min(chords)).find(|&chord| {
            let (a, b) = (self.points[chord], self.points[chord + 1]);
            strip.may_meet((a.min(b), a.max(b))) && test(a, b)
        })
    }

    fn place_of(&self, chord: usize) -> String {
        format!("at {}, {:.1} m from the start", at(self.points[chord]), chord as f32 * self.spacing_m)
    }

    /// The vertex of the unrounded path that is nearest in the plane and along it: a route may cross itself, or come back beside
    /// itself.
    fn vertex_near(&self, chord: usize, path: &ReferencePath) -> Place {
        let mut along_m = vec![0.0];
        along_m.extend(path.points.windows(2).scan(0.0, |sum_m, pair| {
            *sum_m += pair[0].distance(pair[1]);
            Some(*sum_m)
        }));
        // The path is longer than the route, which cuts its corners.
        let chord_along_m = along_m[path.points.len() - 1] * chord as f32 / (self.points.len() - 1) as f32;
        let apart_m = |i: &usize| path.points[*i].distance(self.points[chord]) + (along_m[*i] - chord_along_m).abs();
        Place::ReferencePath((0..path.points.len()).min_by(|a, b| apart_m(a).total_cmp(&apart_m(b))))
    }
}

/// The ground of an edge or an obstacle, for a first look: a rectangle along it, and the box around that. The box alone is
/// near half a route where a wall stands slantwise.
struct Strip {
    bounds: (Vec2, Vec2),
    middle: Vec2,
    /// Unit vector.
    along: Vec2,
    /// Half its length and width, and a little, metres.
    half_m: Vec2,
}

impl Strip {
    /// More than is lost to rounding, metres: single precision resolves 1 mm at the farthest coordinates.
    const SLACK_M: f32 = 0.01;

    fn of_edge(a: Vec2, b: Vec2) -> Self {
        let half_m = Vec2::new(0.5 * a.distance(b), 0.0) + Self::SLACK_M;
        Self { bounds: (a.min(b), a.max(b)), middle: a.midpoint(b), along: (b - a).normalize_or(Vec2::X), half_m }
    }

    fn of_obstacle(obstacle: &Obstacle) -> Self {
        let [length_m, width_m, _] = obstacle.size_m();
        let (centre, half_m) = (obstacle.centre(), 0.5 * Vec2::new(length_m, width_m));
        let (middle, reach) = (centre.position(), Vec2::splat(maths::hypot(half_m.x, half_m.y)));
        let bounds = (middle - reach, middle + reach);
        Self { bounds, middle, along: centre.ahead(), half_m: half_m + Self::SLACK_M }
    }

    /// Whether a box may share ground with it: surely if it does.
    fn may_meet(&self, (low, high): (Vec2, Vec2)) -> bool {
        if !boxes_meet((low, high), self.bounds) {
            return false;
        }
        // As seen along the strip and across it.
        let (to_middle, half) = (low.midpoint(high) - self.middle, 0.5 * (high - low));
        let is_apart = |axis: Vec2, half_m: f32| to_middle.dot(axis).abs() > half.dot(axis.abs()) + half_m;
        !is_apart(self.along, self.half_m.x) && !is_apart(self.along.perp(), self.half_m.y)
    }
}

/// The first two edges of a closed polygon that meet anywhere but at a shared vertex, in order of the first edge.
fn first_crossing(polygon: &[Vec2]) -> Option<(usize, usize)> {
    let count = polygon.len();
    let edge = |i: usize| (polygon[i], polygon[(i + 1) % count]);
    let axis = axis_across(polygon);
    // More than is lost to rounding.
    let slack = 1e-12 * polygon.iter().map(|vertex| f64::from(vertex.abs().max_element())).fold(0.0, f64::max);
    let spans: Vec<(f64, f64)> = edges(polygon)
        .map(|(a, b)| (a.as_dvec2().dot(axis), b.as_dvec2().dot(axis)))
        .map(|(a, b)| (a.min(b), a.max(b) + slack))
        .collect();
    // Edges sorted by their lower end: only those that share a range are compared.
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|&i, &j| spans[i].0.total_cmp(&spans[j].0));
    let mut first: Option<(usize, usize)> = None;
    for (rank, &i) in order.iter().enumerate() {
        for &j in order[rank + 1..].iter().take_while(|&&j| spans[j].0 <= spans[i].1) {
            let (low, high) = (i.min(j), i.max(j));
            let ((a, b), (c, d)) = (edge(low), edge(high));
            let meet = if high == low + 1 {
                folds_back(a, b, d)
            } else if low == 0 && high == count - 1 {
                folds_back(c, d, b)
            } else {
                segments_meet(a, b, c, d)
            };
            if meet && first.is_none_or(|known| (low, high) < known) {
                first = Some((low, high));
            }
        }
    }
    first
}

/// The direction along which the edges of a polygon are shortest, all in all: along another one the teeth of a comb would all
/// overlap. Of Σ e eᵀ/|e| over its edges e the eigenvector of the smaller eigenvalue: by their squares a few long sides would
/// outweigh thousands of short teeth.
fn axis_across(polygon: &[Vec2]) -> DVec2 {
    let (mut difference, mut product) = (0.0, 0.0);
    for (a, b) in edges(polygon) {
        let edge = b.as_dvec2() - a.as_dvec2();
        let length = edge.length().max(f64::MIN_POSITIVE);
        difference += 0.5 * (edge.x * edge.x - edge.y * edge.y) / length;
        product += edge.x * edge.y / length;
    }
    let root = (difference * difference + product * product).sqrt();
    // Of the two rows that say the same, the one with less cancellation.
    let across = if difference > 0.0 {
        DVec2::new(-product, difference + root)
    } else {
        DVec2::new(root - difference, -product)
    };
    across.normalize_or(DVec2::X)
}

/// Where two edges that meet do so.
fn meeting_point(polygon: &[Vec2], i: usize, j: usize) -> Vec2 {
    let edge = |i: usize| (polygon[i], polygon[(i + 1) % polygon.len()] - polygon[i]);
    let ((a, ab), (c, cd)) = (edge(i), edge(j));
    let denominator = ab.perp_dot(cd);
    // Parallel edges that meet overlap: any common point will do.
    if denominator == 0.0 { c } else { a + ab * ((c - a).perp_dot(cd) / denominator).clamp(0.0, 1.0) }
}

/// Whether the edge b→c returns along the edge a→b.
fn folds_back(a: Vec2, b: Vec2, c: Vec2) -> bool {
    orientation(a, b, c) == 0.0 && (b - a).dot(c - b) < 0.0
}

/// Whether two segments share a point; touching counts.
fn segments_meet(a: Vec2, b: Vec2, c: Vec2, d: Vec2) -> bool {
    if !boxes_meet((a.min(b), a.max(b)), (c.min(d), c.max(d))) {
        return false;
    }
    orientation(a, b, c) * orientation(a, b, d) <= 0.0 && orientation(c, d, a) * orientation(c, d, b) <= 0.0
}

/// Positive when a, b, c turn left. In double precision, where differences and products of `f32` lose next to nothing.
fn orientation(a: Vec2, b: Vec2, c: Vec2) -> f64 {
    (b.as_dvec2() - a.as_dvec2()).perp_dot(c.as_dvec2() - a.as_dvec2())
}

fn boxes_meet(a: (Vec2, Vec2), b: (Vec2, Vec2)) -> bool {
    a.0.cmple(b.1).all() && b.0.cmple(a.1).all()
}

/// Whether an obstacle and a convex counter-clockwise body share ground.
fn obstacle_overlaps(obstacle: &Obstacle, body: &[Vec2; 4]) -> bool {
    if obstacle.class.is_round() {
        let centre = obstacle.centre().position();
        let radius_m = 0.5 * obstacle.size_m()[0];
        return polygon_contains(body, centre)
            || edges(body).any(|(a, b)| distance_to_segment_m(centre, a, b) < radius_m);
    }
    let outline = obstacle.outline();
    !has_separating_edge(&outline, body) && !has_separating_edge(body, &outline)
}

/// Whether an edge of a counter-clockwise convex polygon has all of the other one on its outer side.
fn has_separating_edge(polygon: &[Vec2], other: &[Vec2]) -> bool {
    edges(polygon).any(|(a, b)| other.iter().all(|&p| orientation(a, b, p) <= 0.0))
}

fn name_of(obstacle: &Obstacle) -> String {
    format!("{:?} at {}", obstacle.class, at(obstacle.centre().position())).to_lowercase()
}

fn at(point: Vec2) -> String {
    format!("({:.2}, {:.2})", point.x, point.y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::{Island, ObstacleClass, SpeedBump};

    /// A straight lane, 40 m × 6 m, driven from (5, 0) to (30, 0).
    fn lane() -> Scenario {
        Scenario::lane(0.0..=40.0, 6.0, 5.0..=30.0)
            .with_corner_radius_m(5.0)
            .with_obstacles([obstacle(ObstacleClass::Sedan, 20.0, 2.5)])
            .with_speed_bumps([SpeedBump { x_m: 12.0, y_m: 0.0, heading_deg: 0.0, length_m: 0.5, width_m: 6.0 }])
    }

    fn obstacle(class: ObstacleClass, x_m: f32, y_m: f32) -> Obstacle {
        Obstacle::new(class, Pose { x_m, y_m, heading_rad: 0.0 })
    }

    fn island(corners: &[(f32, f32)]) -> Island {
        Island { polygon: corners.iter().map(|&(x, y)| Vec2::new(x, y)).collect(), height_m: 0.15 }
    }

    #[test]
    fn a_sound_lane_is_accepted() {
        assert_eq!(validate(&lane(), &VehicleSettings::hyundai_hg300()), Ok(()));
    }

    /// In products of such coordinates nothing is left of half a square metre.
    #[test]
    fn a_pillar_far_from_the_origin_is_accepted() {
        let mut far = lane();
        far.islands.push(island(&[(24.0, 2.0), (24.7, 2.0), (24.7, 2.7), (24.0, 2.7)]));
        far.speed_bumps.clear();
        far.obstacles.clear();
        let by = Vec2::new(4500.3, 4000.7);
        let outlines =
            std::iter::once(&mut far.boundary).chain(far.islands.iter_mut().map(|island| &mut island.polygon));
        outlines.flatten().chain(&mut far.reference_path.points).for_each(|point| *point += by);
        assert_eq!(validate(&far, &VehicleSettings::hyundai_hg300()), Ok(()));
        let area_m2 = signed_area_m2(&far.islands[0].polygon);
        assert!((area_m2 - 0.49).abs() < 0.01, "{area_m2}");
    }

    #[test]
    fn every_fault_is_named_with_its_place_value_and_remedy() {
        type Break = fn(&mut Scenario);
        // What breaks it, and what the message must contain.
        let table: &[(Break, &str)] = &[
            (|s| s.name.clear(), "name: the name is empty"),
            (|s| s.name = "a/b".to_owned(), "name: the name \"a/b\" contains '/'"),
            (|s| s.name = "a|b".to_owned(), "name: the name \"a|b\" contains '|'"),
            (|s| s.boundary[2].x = f32::NAN, "boundary, vertex 3: x is NaN"),
            (|s| s.boundary.truncate(2), "boundary: 2 vertices enclose no ground; give at least 3"),
            (
                |s| s.boundary.swap(1, 2),
                "boundary, vertex 1: the edge from vertex 1 to 2 meets the edge from vertex 3 to 4 near (20.00, 0.00)",
            ),
            (|s| s.boundary.push(Vec2::new(0.0, -3.0)), "boundary, vertex 5: vertices 5 and 1 are the same point"),
            (
                |s| s.boundary.insert(1, Vec2::new(50.0, -3.0)),
                "boundary, vertex 1: the edge from vertex 1 to 2 meets the edge from vertex 2 to 3 near (50.00, -3.00)",
            ),
            (|s| s.boundary[1].x = 4000.0, "boundary: the lot spans 4000 m"),
            (|s| s.boundary_height_m = 7.5, "boundary: boundary_height_m is 7.5; write a number of metres above 0"),
            (|s| s.boundary.iter_mut().for_each(|p| p.x += 5e6), "boundary: a coordinate is 5000040 m from the origin"),
            (|s| s.boundary.iter_mut().for_each(|p| p.y += 9000.0), "boundary: a coordinate is 9003 m from the origin"),
            (
                |s| s.boundary.iter_mut().for_each(|p| *p *= 1e-3),
                "boundary: the outline encloses 0.0002 m²; spread the vertices out",
            ),
            (|s| s.islands.push(island(&[(8.0, 1.0), (9.0, 1.0)])), "island 1: 2 vertices"),
            (
                |s| s.islands.push(island(&[(6.9, 0.4), (7.1, 0.4), (7.1, 0.6), (6.9, 0.6)])),
                "reference_path, point 1: the car (4.91 m × 1.86 m) does not fit at the start",
            ),
            (
                |s| s.islands.push(island(&[(8.0, 2.0), (9.0, 2.0), (9.0, 4.0)])),
                "island 1: its vertex 3, (9.00, 4.00), lies outside",
            ),
            (
                |s| s.islands.push(island(&[(8e6, 2.0), (9e6, 2.0), (9e6, 4.0)])),
                "island 1: its vertex 1, (8000000.00, 2.00), lies outside",
            ),
            (
                |s| s.islands.push(island(&[(24.0, -1.0), (26.0, -1.0), (26.0, 1.0), (24.0, 1.0)])),
                "reference_path, point 2: the route runs into island 1 at",
            ),
            (
                |s| s.islands.push(Island { height_m: -0.1, ..island(&[(8.0, 2.0), (9.0, 2.0), (9.0, 2.5)]) }),
                "island 1: height_m is -0.1; write a number of metres above 0",
            ),
            (|s| s.obstacles[0].x_m = f32::INFINITY, "obstacle 1: x_m is inf; write a finite number"),
            (|s| s.obstacles[0].length_m = Some(0.0), "obstacle 1: length_m is 0; write"),
            (|s| s.obstacles[0].width_m = Some(185.0), "obstacle 1: width_m is 185; write"),
            (|s| s.obstacles[0].height_m = Some(f32::NAN), "obstacle 1: height_m is NaN"),
            (|s| s.speed_bumps[0].length_m = -1.0, "speed_bump 1: length_m is -1"),
            (|s| s.reference_path.points.truncate(1), "reference_path: the route has 1 points; give at least"),
            (|s| s.reference_path.points[1].y = f32::NEG_INFINITY, "reference_path, point 2: y is -inf"),
            (
                |s| s.reference_path.points.insert(1, Vec2::new(5.0, 0.0)),
                "reference_path, point 2: points 1 and 2 are the same, (5.00, 0.00); delete",
            ),
            (|s| s.reference_path.points[1].x = 8.0, "reference_path: the route is 3.00 m long; make it at least 5 m"),
            (|s| s.reference_path.points.push(Vec2::new(5.0, 0.1)), "reference_path, point 2: the route turns by 180°"),
            (|s| s.reference_path.corner_radius_m = -5.0, "reference_path: corner_radius_m is -5"),
            (|s| s.reference_path.points[1].x = 1e30, "reference_path, point 2: the point (1000000"),
            (
                |s| s.reference_path.points[1].x = 45.0,
                "reference_path, point 2: the point (45.00, 0.00) lies outside the lot",
            ),
            (
                // The lane narrows to nothing at its end, beside the route's last metres.
                |s| s.boundary[1].y = 2.9,
                "reference_path, point 2: the route leaves the boundary at (20.00, 0.00), 15.0 m from the start",
            ),
            (|s| s.obstacles[0].y_m = -60.0, "obstacle 1: it stands at (20.00, -60.00), more than 50 m from the lot"),
            (|s| s.speed_bumps[0].x_m = 91.0, "speed_bump 1: it stands at (91.00, 0.00), more than 50 m from"),
            (|s| s.reference_path.points[0].x = 1.0, "reference_path, point 1: the car (4.91 m × 1.86 m) does not fit"),
            (|s| s.reference_path.points[0].y = 2.2, "reference_path, point 1: the car"),
            (|s| s.reference_path.points[0].x = -9.0, "reference_path, point 1: the point (-9.00, 0.00) lies outside"),
            (
                |s| s.obstacles.push(obstacle(ObstacleClass::Cone, 8.9, 0.9)),
                "obstacle 2: the cone at (8.90, 0.90) stands where the car starts; move it",
            ),
            (|s| s.obstacles.push(obstacle(ObstacleClass::Bollard, 6.0, 0.0)), "obstacle 2: the bollard"),
            (
                |s| s.obstacles.push(obstacle(ObstacleClass::Van, 20.0, -0.9)),
                "obstacle 2: the van at (20.00, -0.90) stands on the reference path at (17.00, 0.00), 12.0 m from the start",
            ),
            (|s| s.obstacles.push(obstacle(ObstacleClass::Person, 20.0, 0.2)), "obstacle 2: the person at"),
        ];
        for (break_it, expected) in table {
            let mut scenario = lane();
            break_it(&mut scenario);
            match validate(&scenario, &VehicleSettings::hyundai_hg300()) {
                Ok(()) => panic!("accepted, expected: {expected}"),
                Err(error) => {
                    let message = error.to_string();
                    assert!(message.starts_with(expected), "got:      {message}\nexpected: {expected}");
                    assert!(!error.remedy.is_empty());
                }
            }
        }
    }

    /// Its edges were compared first, each with all that it crosses.
    #[test]
    fn a_comb_whose_teeth_cross_each_other_is_refused_for_its_length() {
        let mut scenario = lane();
        let tooth = |i: u16| [(0.25 * f32::from(i), 0.0), (125.0 - 0.1 * f32::from(i), 400.0)];
        scenario.boundary = (0..500).flat_map(tooth).map(Vec2::from).collect();
        let error = validate(&scenario, &VehicleSettings::hyundai_hg300()).expect_err("crosses").to_string();
        assert!(error.starts_with("boundary: the outlines of boundary and islands are 40"), "{error}");
    }

    fn turned(points: &[Vec2], by_rad: f32) -> Vec<Vec2> {
        let rotation = maths::unit(by_rad);
        points.iter().map(|&point| rotation.rotate(point)).collect()
    }

    /// The teeth of a comb that lay aslant were compared each with each.
    #[test]
    fn a_comb_is_swept_across_its_teeth_however_it_lies() {
        let tooth = |i: u16| [(0.2 * f32::from(i), 0.0), (0.2 * f32::from(i) + 0.1, 50.0)];
        let comb: Vec<Vec2> = (0..100).flat_map(tooth).map(Vec2::from).chain([Vec2::new(30.0, -1.0)]).collect();
        let mut tangled = comb.clone();
        tangled.swap(101, 151);
        for eighth in 0..16_u8 {
            let by_rad = f32::from(eighth) * std::f32::consts::FRAC_PI_8;
            let (comb, tangled) = (turned(&comb, by_rad), turned(&tangled, by_rad));
            let axis = axis_across(&comb);
            let length_m = edges(&comb).map(|(a, b)| (b - a).as_dvec2().dot(axis).abs()).sum::<f64>();
            assert!(length_m < 200.0, "turned by {eighth} eighths: {length_m} m of 10 km");
            assert_eq!(first_crossing(&comb), None, "turned by {eighth} eighths");
            let count = tangled.len();
            let edge = |i: usize| (tangled[i], tangled[(i + 1) % count]);
            let meet = |i: usize, j: usize| segments_meet(edge(i).0, edge(i).1, edge(j).0, edge(j).1);
            let apart = |i: usize| (i + 2..count).filter(move |j| (i, *j) != (0, count - 1)).map(move |j| (i, j));
            let expected = (0..count).flat_map(apart).find(|&(i, j)| meet(i, j));
            assert_eq!(first_crossing(&tangled), expected, "turned by {eighth} eighths");
            assert!(expected.is_some());
        }
    }

    #[test]
    fn a_few_long_sides_outweigh_no_thousands_of_short_teeth() {
        let tooth = |i: u16| [(500.0 - 0.25 * f32::from(i), 102.0), (499.9 - 0.25 * f32::from(i), 100.0)];
        let sides = [(0.0, 0.0), (500.0, 0.0), (500.0, 100.0)].into_iter();
        let lot: Vec<Vec2> = sides.chain((1..1990).flat_map(tooth)).chain([(0.0, 100.0)]).map(Vec2::from).collect();
        assert!(axis_across(&lot).x.abs() > 0.9, "{}", axis_across(&lot));
        assert_eq!(first_crossing(&lot), None);
    }

    fn wall(centre: Pose, length_m: f32) -> Obstacle {
        Obstacle { length_m: Some(length_m), ..Obstacle::new(ObstacleClass::Wall, centre) }
    }

    /// Of the route, 30 m lie in the box around it.
    #[test]
    fn a_wall_aslant_is_compared_with_the_chords_it_may_meet_alone() {
        let points = vec![Vec2::ZERO, Vec2::new(100.0, 0.0)];
        let route = Route::new(&Path::new(&ReferencePath { points, corner_radius_m: 0.0 }));
        let n_compared = |y_m: f32| {
            let n = std::cell::Cell::new(0);
            let wall = wall(Pose::new(Vec2::new(50.0, y_m), std::f32::consts::FRAC_PI_4), 30.0);
            let none = route.first_chord_near(&Strip::of_obstacle(&wall), |_, _| {
                n.set(n.get() + 1);
                false
            });
            assert_eq!(none, None);
            n.get()
        };
        // Its lower end is 10.6 m below its middle.
        assert_eq!([12.0, 9.0].map(n_compared), [0, 2]);
    }

    #[test]
    fn no_chord_that_meets_a_wall_is_passed_over() {
        let lane = |i: u8| {
            let ends = if i.is_multiple_of(2) { [0.0, 40.0] } else { [40.0, 0.0] };
            ends.map(|y| Vec2::new(4.0 * f32::from(i), y))
        };
        let points = (0..11).flat_map(lane).collect();
        let route = Route::new(&Path::new(&ReferencePath { points, corner_radius_m: 1.5 }));
        let mut n_met = 0;
        for i in 0..600_u16 {
            let centre = Vec2::new(f32::from(i * 7 % 41), f32::from(i * 11 % 43));
            let wall = wall(Pose::new(centre, 0.1 * f32::from(i)), 0.5 + f32::from(i % 30));
            let outline = wall.outline();
            let meets = |c: Vec2, d: Vec2| edges(&outline).any(|(a, b)| segments_meet(a, b, c, d));
            let expected = route.points.windows(2).position(|chord| meets(chord[0], chord[1]));
            assert_eq!(route.first_chord_near(&Strip::of_obstacle(&wall), meets), expected, "{wall:?}");
            let (a, b) = (outline[0], outline[2]);
            let meets = |c: Vec2, d: Vec2| segments_meet(a, b, c, d);
            let expected = route.points.windows(2).position(|chord| meets(chord[0], chord[1]));
            assert_eq!(route.first_chord_near(&Strip::of_edge(a, b), meets), expected, "{a} {b}");
            n_met += usize::from(expected.is_some());
        }
        assert!((200..600).contains(&n_met), "{n_met}");
    }

    /// Where a route crosses itself the error named the nearest point of the other leg.
    #[test]
    fn a_fault_on_a_route_names_a_point_of_its_own_leg() {
        let points = [(0.0, 0.0), (10.0, 0.0), (20.0, 0.0), (40.0, 0.0), (40.0, 20.0), (20.0, 20.0), (20.0, -30.0)];
        let points = points.map(|(x, y)| Vec2::new(x, y)).to_vec();
        let path = ReferencePath { points, corner_radius_m: 5.0 };
        let route = Route::new(&Path::new(&path));
        let vertex_at = |point: Vec2, nth: usize| {
            let passes = |i: &usize| route.points[*i].distance(point) < 0.6 * route.spacing_m;
            let chord = (0..route.points.len()).filter(passes).nth(nth).expect("the route passes there");
            route.vertex_near(chord, &path)
        };
        let crossing = Vec2::new(20.0, 0.0);
        assert_eq!(vertex_at(crossing, 0), Place::ReferencePath(Some(2)));
        let back = vertex_at(crossing, 1);
        assert!([5, 6].map(|i| Place::ReferencePath(Some(i))).contains(&back), "{back}");
        assert_eq!(vertex_at(Vec2::new(20.0, -29.0), 0), Place::ReferencePath(Some(6)));
    }

    /// A car beside the path or behind the boundary is not a fault: lots are full of them.
    #[test]
    fn neighbours_of_the_route_are_accepted() {
        let mut scenario = lane();
        scenario.obstacles.push(obstacle(ObstacleClass::Person, 20.0, -0.3));
        scenario.obstacles.push(obstacle(ObstacleClass::Cone, 8.9, 1.2));
        scenario.obstacles.push(obstacle(ObstacleClass::Truck, 20.0, 9.0));
        assert_eq!(validate(&scenario, &VehicleSettings::hyundai_hg300()), Ok(()));
    }

    /// An island need not contain a vertex of the boundary to cross it: a notch of the boundary can reach into it.
    #[test]
    fn an_island_pierced_by_a_notch_of_the_boundary_is_refused() {
        let mut scenario = lane();
        let notch = [(32.0, 3.0), (31.9, 1.5), (31.8, 3.0)].map(|(x, y)| Vec2::new(x, y));
        scenario.boundary.splice(3..3, notch);
        scenario.islands.push(island(&[(31.0, 1.0), (33.0, 1.0), (33.0, 2.0), (31.0, 2.0)]));
        let error = validate(&scenario, &VehicleSettings::hyundai_hg300()).expect_err("crosses");
        assert!(error.to_string().starts_with("island 1: it crosses the boundary's edge from vertex 4"), "{error}");
    }
}
