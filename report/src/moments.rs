//! A near-collision as a picture: driven again from its replay key.

use crate::pictures::drawing::{Drawing, Font};
use crate::pictures::grids::{self, PREDICTION, of_layer};
use crate::pictures::lot::{self, INK, View};
use crate::pictures::trajectories::{self, ColourBy, NEAR_COLLISION, Point, Trajectory};
use anyhow::Context as _;
use experiment::drive::Replay;
use experiment::replay_key::ReplayKey;
use experiment::settings::Settings;
use sim::frame::{Event, Frame};
use sim::geometry::{Pose, Vec2};
use sim::map::Map;
use sim::sensing::noise::Layer;
use sim::sensing::{GRID_CELLS, Inspection, Sensor};
use std::ops::ControlFlow;
use std::sync::Arc;

/// What the top view shows, metres.
const SIDE_M: f32 = 28.0;
/// Its side, pixels.
const SIDE_PX: f32 = 616.0;
const CELL_PX: f32 = 12.0;
const GAP_PX: f32 = 16.0;
/// Time before the near-collision that is drawn, seconds.
const BEFORE_S: f32 = 12.0;
const FONT: Font = Font::Small;

/// A moment of a drive.
struct Moment {
    map: Arc<Map>,
    settings: Settings,
    driven: Trajectory,
    frame: Frame,
    /// Where the near-collision was counted.
    at: Pose,
    inspection: Inspection,
}

/// Top view around the place with the driven line; under it the grid that was shown and the clean one. As PNG.
///
/// # Errors
/// If it cannot be driven again: the network or the lot has moved away or changed.
pub fn picture(key: &str, settings: &Settings) -> anyhow::Result<Vec<u8>> {
    let moment = drive_again(&key.parse()?, settings)?;
    let grid_px = CELL_PX * GRID_CELLS as f32;
    let line = FONT.height_px() + 6.0;
    let legend = moment.legend();
    let (_, legend_px) = grids::small_legend(SIDE_PX, &legend);
    let height = GAP_PX + SIDE_PX + 6.0 + line + legend_px + 6.0 + line + grid_px + GAP_PX;
    let mut sheet = Drawing::new(Vec2::new(SIDE_PX + 2.0 * GAP_PX, height), [0xFF; 3])?;
    let mut y = GAP_PX;
    sheet.inset(moment.top_view()?, Vec2::new(GAP_PX, y));
    y += SIDE_PX + 6.0;
    sheet.text(format!("{SIDE_M:.0} m x {SIDE_M:.0} m, the last {BEFORE_S:.0} s"), Vec2::new(GAP_PX, y), FONT, INK);
    y += line;
    y += grids::draw_small_legend(&mut sheet, Vec2::new(GAP_PX, y), SIDE_PX, &legend) + 6.0;
    let inspection = &moment.inspection;
    let shown = grids::grid(&inspection.shown_grid, CELL_PX, |row, col| inspection.cell(row, col))?;
    let clean = grids::grid(&inspection.clean_grid, CELL_PX, |_, _| None)?;
    for (x, name, mut grid) in [(GAP_PX, "grid as shown", shown), (2.0 * GAP_PX + grid_px, "clean grid", clean)] {
        let decision = moment.frame.decision;
        let geometry = &moment.settings.episode.sensing.geometry;
        grids::draw_prediction(&mut grid, decision.look_ahead, decision.spread, geometry);
        sheet.text(name, Vec2::new(x, y), FONT, INK);
        sheet.inset(grid, Vec2::new(x, y + line));
    }
    sheet.to_png()
}

fn drive_again(key: &ReplayKey, settings: &Settings) -> anyhow::Result<Moment> {
    let replay = Replay::new(key, &settings.episode)?;
    let driver = key.driver.clone().load(&settings.expert, settings.dagger.device)?;
    let (mut points, mut last) = (Vec::new(), None);
    replay.drive(&settings.episode, &driver, |frame| {
        points.push(Point::of(frame));
        last = Some(*frame);
        if frame.tick < key.tick { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    });
    let found = last.filter(|frame| frame.tick == key.tick).and_then(|frame| match frame.event {
        Event::NearCollision { at, .. } => Some((frame, at)),
        Event::Drove | Event::Stuck { .. } | Event::ReachedEnd => None,
    });
    let (frame, at) = found.context("driven again, it does not happen: was the network trained anew since?")?;
    let episode = replay.episode_settings(&settings.episode);
    let ticks = (BEFORE_S / episode.control_period_s()) as usize;
    let points = points.split_off(points.len().saturating_sub(ticks));
    let sensor = Sensor::new(&replay.map, episode.sensing, &episode.noise, replay.trial().episode_seed());
    let inspection = sensor.inspect(&replay.map, frame.vehicle.pose, frame.tick, &frame.observation);
    let driven = Trajectory { name: driver.name.clone(), points };
    let map = Arc::clone(&replay.map);
    Ok(Moment { map, settings: settings.clone(), driven, frame, at, inspection })
}

impl Moment {
    fn top_view(&self) -> anyhow::Result<Drawing> {
        let map = &self.map;
        let centre = self.at.position() + 3.0 * self.at.ahead();
        let view = View::around(centre, SIDE_M, SIDE_PX);
        let vehicle = &self.settings.episode.vehicle;
        let mut drawing = Drawing::new(Vec2::splat(SIDE_PX), lot::GROUND)?;
        lot::draw_ground(&mut drawing, &view, map);
        lot::draw_obstacles(&mut drawing, &view, map);
        let route = map.path().poses().iter().map(|pose| pose.position());
        drawing.dashed(view.pixels(route), lot::ROUTE, 2.0, [10.0, 8.0]);
        let patch = self.patch();
        drawing.dashed(view.pixels(patch), INK, 1.5, [3.0, 5.0]);
        trajectories::draw(&mut drawing, &view, std::slice::from_ref(&self.driven), ColourBy::Speed);
        lot::draw_car(&mut drawing, &view, vehicle, self.at, NEAR_COLLISION, 3.0);
        let look_ahead = self.frame.decision.look_ahead;
        let world_from_ego = self.frame.vehicle.pose.world_from_ego();
        let target = view.pixel(world_from_ego.point(Vec2::new(look_ahead.ahead_m, look_ahead.left_m)));
        drawing.disc(target, 7.5, [0xFF; 3]);
        drawing.disc(target, 6.0, PREDICTION);
        Ok(drawing)
    }

    /// The outline of what the grid shows, closed.
    fn patch(&self) -> [Vec2; 5] {
        let geometry = &self.settings.episode.sensing.geometry;
        let (near, far, half) = (geometry.near_edge_ahead_m, geometry.far_edge_ahead_m(), 0.5 * geometry.side_m);
        let world_from_ego = self.frame.vehicle.pose.world_from_ego();
        [(near, half), (far, half), (far, -half), (near, -half), (near, half)]
            .map(|(ahead, left)| world_from_ego.point(Vec2::new(ahead, left)))
    }

    fn legend(&self) -> Vec<lot::LegendEntry> {
        let mut legend = vec![
            (NEAR_COLLISION, "car".to_owned()),
            (PREDICTION, "look-ahead point".to_owned()),
            (lot::ROUTE, "route".to_owned()),
            (trajectories::of_speed(0.3), "0.3".to_owned()),
            (trajectories::of_speed(1.0), "1.0".to_owned()),
            (trajectories::of_speed(2.0), "2.0 m/s".to_owned()),
        ];
        let wrong = Layer::ALL.into_iter().filter(|&layer| self.inspection.count_cells(layer) > 0);
        legend.extend(wrong.map(|layer| (of_layer(layer), format!("wrong: {}", layer.name()))));
        legend
    }
}
