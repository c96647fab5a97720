//! Drives over a lot, coloured by speed or by who drove.

use super::drawing::{Drawing, Rgb};
use super::lot::{self, LINE_PX, LegendEntry, View};
use crate::plots::style::colour;
use sim::driver::Source;
use sim::frame::{Event, Frame};
use sim::geometry::Vec2;
use sim::map::Map;

/// One tick of a drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Rear axle in the world, metres.
    pub at: Vec2,
    /// Metres per second.
    pub speed_mps: f32,
    /// Whose answer was driven.
    pub source: Source,
    /// Where the car was put back on the path after this tick: the next point does not follow from this one.
    pub is_last: bool,
    /// Where a near-collision was counted in this tick.
    pub near_collision: Option<Vec2>,
}

impl Point {
    /// The point of a frame.
    pub fn of(frame: &Frame) -> Self {
        let near_collision = match frame.event {
            Event::NearCollision { at, .. } => Some(at.position()),
            Event::Drove | Event::Stuck { .. } | Event::ReachedEnd => None,
        };
        Self {
            at: frame.vehicle.pose.position(),
            speed_mps: frame.vehicle.speed_mps,
            source: frame.decision.source,
            is_last: frame.event != Event::Drove,
            near_collision,
        }
    }
}

/// One drive.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    /// Its name in the legend.
    pub name: String,
    /// Tick by tick.
    pub points: Vec<Point>,
}

/// What colours mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColourBy {
    /// How fast.
    Speed,
    /// Which of several drivers.
    Driver,
    /// Expert or network: who of the two was at the wheel.
    Source,
}

/// Speeds from this on have the last colour, m/s.
const SPEED_MAX_MPS: f32 = 2.2;
/// Shades of speed.
const SHADES: usize = 12;
/// Letters of a driver's name in the legend.
const NAME_LETTERS: usize = 60;
/// A cross at every near-collision.
pub const NEAR_COLLISION: Rgb = [0xD0, 0x00, 0x00];

/// Five points of viridis (van der Walt and Smith), evenly spaced: ordered in lightness, so that print and all eyes can
/// read it.
const VIRIDIS: [Rgb; 5] =
    [[0x44, 0x01, 0x54], [0x3B, 0x52, 0x8B], [0x21, 0x91, 0x8C], [0x5E, 0xC9, 0x62], [0xFD, 0xE7, 0x25]];

/// Colour of a speed.
pub fn of_speed(speed_mps: f32) -> Rgb {
    let shade = (speed_mps / SPEED_MAX_MPS).clamp(0.0, 1.0) * (SHADES - 1) as f32;
    let at = shade.round() / (SHADES - 1) as f32 * 4.0;
    let below = (at as usize).min(3);
    let part = at - below as f32;
    std::array::from_fn(|i| {
        let (low, high) = (f32::from(VIRIDIS[below][i]), f32::from(VIRIDIS[below + 1][i]));
        (low + part * (high - low)).round() as u8
    })
}

/// Colour of who drove.
pub fn of_source(source: Source) -> Rgb {
    rgb(match source {
        Source::Expert => 0,
        Source::Novice => 1,
        Source::Planner => 3,
    })
}

/// Colour of the n-th driver.
pub fn rgb(series: usize) -> Rgb {
    let colour = colour(series);
    [colour.0, colour.1, colour.2]
}

/// Drives over their lot.
///
/// # Errors
/// If the picture would be too large.
pub fn picture(
    map: &Map,
    trajectories: &[Trajectory],
    by: ColourBy,
    title: &str,
    px_per_m: Option<f32>,
) -> anyhow::Result<Drawing> {
    let view = View::of_map(map, px_per_m);
    let legend = legend(trajectories, by);
    let size = view.size_px();
    let widest_px = legend.iter().map(|(_, name)| lot::entry_px(name)).fold(0.0, f32::max);
    let width = size.x.max(400.0).max(16.0 + widest_px);
    let rows = lot::layout(&legend, width);
    let mut drawing = Drawing::new(Vec2::new(width, size.y + LINE_PX * (rows.len() as f32 + 2.0)), lot::GROUND)?;
    lot::draw_ground(&mut drawing, &view, map);
    lot::draw_obstacles(&mut drawing, &view, map);
    lot::draw_finish(&mut drawing, &view, map);
    draw(&mut drawing, &view, trajectories, by);
    lot::draw_caption(&mut drawing, &view, title, size.y);
    lot::draw_legend(&mut drawing, &legend, &rows, size.y + 1.5 * LINE_PX);
    Ok(drawing)
}

/// The driven lines, and a cross at every near-collision.
pub fn draw(drawing: &mut Drawing, view: &View, trajectories: &[Trajectory], by: ColourBy) {
    let width_px = |index| width_px(index, trajectories.len(), [4.0, 2.5]);
    let colour = |index, point: &Point| match by {
        ColourBy::Speed => of_speed(point.speed_mps),
        ColourBy::Driver => rgb(index),
        ColourBy::Source => of_source(point.source),
    };
    if by == ColourBy::Speed {
        // Fast is light: on asphalt it needs an edge.
        draw_lines(drawing, view, trajectories, |index| width_px(index) + 2.5, |_, _| lot::INK);
    }
    draw_lines(drawing, view, trajectories, width_px, colour);
    draw_crosses(drawing, view, trajectories);
}

/// Width of the line of a driver, pixels: later ones are thinner, so that where all drive the same line, all are seen. `px`: the
/// thinnest, and by how much one before it is wider; of more than five drivers by less, or their lines would hide the lot.
pub fn width_px(driver: usize, drivers: usize, [thinnest_px, step_px]: [f32; 2]) -> f32 {
    let (after, others) = (drivers - 1 - driver, drivers - 1);
    thinnest_px + step_px * after as f32 * (4.0 / others.max(4) as f32)
}

/// The driven lines, in widths and colours by the number of the driver.
pub fn draw_lines(
    drawing: &mut Drawing,
    view: &View,
    trajectories: &[Trajectory],
    width_px: impl Fn(usize) -> f32,
    colour: impl Fn(usize, &Point) -> Rgb,
) {
    for (index, trajectory) in trajectories.iter().enumerate() {
        for drive in trajectory.points.split_inclusive(|point| point.is_last) {
            let mut from = 0;
            while from + 1 < drive.len() {
                let rgb = colour(index, &drive[from]);
                let same = drive[from..].iter().take_while(|point| colour(index, point) == rgb).count();
                // To the first point of the next colour, so that no gap is left.
                let to = (from + same).min(drive.len() - 1);
                drawing.line(view.pixels(drive[from..=to].iter().map(|point| point.at)), rgb, width_px(index));
                from = to;
            }
        }
    }
}

/// A cross at every near-collision.
pub fn draw_crosses(drawing: &mut Drawing, view: &View, trajectories: &[Trajectory]) {
    let near = trajectories.iter().flat_map(|trajectory| &trajectory.points).filter_map(|point| point.near_collision);
    for at in near {
        cross(drawing, view.pixel(at));
    }
}

/// Marks a near-collision.
pub fn cross(drawing: &mut Drawing, at: Vec2) {
    for (rgb, width_px) in [([0xFF; 3], 7.0), (NEAR_COLLISION, 4.0)] {
        for corner in [Vec2::new(8.0, 8.0), Vec2::new(8.0, -8.0)] {
            drawing.line(vec![at - corner, at + corner], rgb, width_px);
        }
    }
}

fn legend(trajectories: &[Trajectory], by: ColourBy) -> Vec<LegendEntry> {
    let points = || trajectories.iter().flat_map(|trajectory| &trajectory.points);
    let mut legend: Vec<LegendEntry> = match by {
        ColourBy::Speed => [0.0, 0.5, 1.0, 1.5, 2.0].map(|mps| (of_speed(mps), format!("{mps:.1} m/s"))).to_vec(),
        ColourBy::Driver => {
            let near =
                |trajectory: &Trajectory| trajectory.points.iter().filter(|p| p.near_collision.is_some()).count();
            let plural = |count| if count == 1 { "" } else { "s" };
            let name = |t: &Trajectory| {
                let near = near(t);
                format!("{}: {near} near-collision{}", lot::ending(&t.name, NAME_LETTERS), plural(near))
            };
            trajectories.iter().enumerate().map(|(i, trajectory)| (rgb(i), name(trajectory))).collect()
        }
        ColourBy::Source => Source::ALL
            .into_iter()
            .filter_map(|source| {
                let ticks = points().filter(|point| point.source == source).count();
                let share = 100.0 * ticks as f32 / points().count().max(1) as f32;
                (ticks > 0).then(|| (of_source(source), format!("{} {share:.0} %", source.name())))
            })
            .collect(),
    };
    if points().any(|point| point.near_collision.is_some()) {
        legend.push((NEAR_COLLISION, "x near-collision".to_owned()));
    }
    legend
}
