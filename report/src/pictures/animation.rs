//! Drives as moving pictures: the lot from above, and for every driver the grid it was shown, with its answer.
//!
//! A [`Scene`] is drawn in two parts: a background, and an overlay per moment. As pixels they become an animation
//! ([`super::encode`]), as SVG the player of a report ([`crate::page::Player`]).

use super::drawing::{Drawing, Font, Rgb};
use super::encode::Reel;
use super::grids::{self, FREE, LINE, OCCUPIED, PREDICTION, of_layer};
use super::lot::{self, INK, LegendEntry, View};
use super::trajectories::{self, NEAR_COLLISION, Point, Trajectory};
use crate::page::Player;
use experiment::drive::Replay;
use experiment::drivers::NamedDriver;
use rayon::prelude::*;
use sim::episode::EpisodeSettings;
use sim::frame::{Event, Frame};
use sim::geometry::Vec2;
use sim::map::Map;
use sim::sensing::noise::Layer;
use sim::sensing::{GRID_CELLS, Sensor};
use std::ops::ControlFlow;
use std::sync::Arc;
use tiny_skia::Pixmap;

/// What the top view shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Camera {
    /// The whole lot.
    Lot,
    /// [`SIDE_M`] around the first driver's car.
    Follow,
    /// [`SIDE_M`] around a place.
    Place(Vec2),
}

/// Where the grids are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// Right of the top view.
    Beside,
    /// Under the top view: for wide lots, and for narrow screens.
    Below,
}

impl Layout {
    /// What leaves least empty around a whole lot.
    pub fn fitting(map: &Map) -> Self {
        let size_m = View::of_map(map, Some(1.0)).size_m;
        if size_m.x > 1.4 * size_m.y { Self::Below } else { Self::Beside }
    }
}

/// Side of a top view that does not show the whole lot, metres.
pub const SIDE_M: f32 = 28.0;
const SIDE_PX: f32 = 420.0;
const LOT_PX_PER_M_MAX: f32 = 14.0;
const GAP_PX: f32 = 12.0;
const FONT: Font = Font::Small;
const LINE_PX: f32 = 21.0;
/// Letters beside a grid.
const LETTERS: usize = 17;
/// A near-collision is announced for so long, seconds.
const ANNOUNCED_S: f32 = 1.5;

/// The drive of one driver.
#[derive(Debug, Clone)]
pub struct Take {
    /// Shown beside its grid.
    pub name: String,
    /// Tick by tick from the start.
    pub frames: Vec<Frame>,
}

/// Drives of one trial, ready to be drawn at any time.
#[derive(Debug)]
pub struct Scene {
    map: Arc<Map>,
    episode: EpisodeSettings,
    takes: Vec<Take>,
    trajectories: Vec<Trajectory>,
    camera: Camera,
    layout: Layout,
    title: String,
    /// What is drawn: times from the start of the drive, and for each what every driver was shown.
    moments: Vec<(f32, Vec<Shown>)>,
}

/// What a driver was shown: cells that are occupied and right, and cells that a noise layer made wrong.
#[derive(Debug)]
struct Shown {
    occupied: Vec<(usize, usize)>,
    wrong: Vec<(usize, usize, Layer)>,
}

impl Take {
    /// Drives the trial again, as long as `seen`, which is told of every frame, does not break.
    ///
    /// # Errors
    /// See [`Replay::drive`].
    pub fn of(
        replay: &Replay,
        episode: &EpisodeSettings,
        driver: &NamedDriver,
        mut seen: impl FnMut(&Frame) -> ControlFlow<()>,
    ) -> anyhow::Result<Self> {
        let mut frames = Vec::new();
        replay.drive(episode, driver, |frame| {
            frames.push(*frame);
            seen(frame)
        })?;
        Ok(Self { name: driver.name.clone(), frames })
    }

    /// When a tick was observed, seconds of simulated time: not a number of periods, for the tick of a near-collision lasts
    /// until the car stands on the path again.
    pub fn observed_at_s(&self, index: usize) -> f32 {
        index.checked_sub(1).map_or(0.0, |before| self.frames[before].time_s)
    }

    /// The tick under way at a time; the last one after the end.
    pub fn index_at(&self, time_s: f32) -> usize {
        /// More than times are rounded by, and less than a tick, seconds.
        const ROUNDED_S: f32 = 1e-3;
        let over = self.frames.partition_point(|frame| frame.time_s <= time_s + ROUNDED_S);
        over.min(self.frames.len() - 1)
    }
}

impl Scene {
    /// Takes of the replayed trial at some times, seconds from the start.
    pub fn new(
        replay: &Replay,
        episode: &EpisodeSettings,
        takes: Vec<Take>,
        times_s: &[f32],
        (camera, layout): (Camera, Layout),
        title: impl Into<String>,
    ) -> Self {
        let episode = replay.episode_settings(episode);
        let sensor = Sensor::new(&replay.map, episode.sensing.clone(), &episode.noise, replay.trial().episode_seed());
        let shown = |take: &Take, time_s: f32| {
            let frame = &take.frames[take.index_at(time_s)];
            let inspection = sensor.inspect(&replay.map, frame.vehicle.pose, frame.tick, &frame.observation);
            let grid = &inspection.shown_grid;
            let cells = || (0..GRID_CELLS * GRID_CELLS).map(|i| (i / GRID_CELLS, i % GRID_CELLS));
            let wrong = |(row, col)| inspection.cell(row, col).map(|layer| (row, col, layer));
            Shown {
                occupied: cells().filter(|&(row, col)| grid.is_occupied(row, col)).collect(),
                wrong: cells().filter_map(wrong).collect(),
            }
        };
        let moment = |&time_s: &f32| (time_s, takes.iter().map(|take| shown(take, time_s)).collect());
        let moments = times_s.par_iter().map(moment).collect();
        let points = |take: &Take| take.frames.iter().map(Point::of).collect();
        let trajectories =
            takes.iter().map(|take| Trajectory { name: take.name.clone(), points: points(take) }).collect();
        let map = Arc::clone(&replay.map);
        Self { map, episode, takes, trajectories, camera, layout, title: title.into(), moments }
    }

    /// Number of pictures.
    pub fn len(&self) -> usize {
        self.moments.len()
    }

    /// Whether there is nothing to show.
    pub fn is_empty(&self) -> bool {
        self.moments.is_empty()
    }

    /// All pictures as one reel.
    ///
    /// # Errors
    /// If a picture would be too large.
    pub fn reel(&self) -> anyhow::Result<Reel> {
        let background = self.background(0)?.pixmap();
        // Every picture has the size of the background, which could be made.
        Ok(Reel::draw(self.len(), |moment| self.pixmap(moment, &background).unwrap_or_else(|_| background.clone())))
    }

    /// A picture as pixels, over the background as pixels.
    ///
    /// # Errors
    /// If the picture would be too large.
    pub fn pixmap(&self, moment: usize, background: &Pixmap) -> anyhow::Result<Pixmap> {
        let mut pixmap =
            if self.camera == Camera::Follow { self.background(moment)?.pixmap() } else { background.clone() };
        self.overlay(moment)?.draw_on(&mut pixmap);
        Ok(pixmap)
    }

    /// All pictures as a player, which shows one of them where no script runs. `rate_per_s`: pictures per second.
    ///
    /// # Errors
    /// If a picture would be too large.
    pub fn player(&self, still: usize, rate_per_s: f32) -> anyhow::Result<Player> {
        let background = self.background(0)?;
        let frame = |(moment, (time_s, _)): (usize, &(f32, Vec<Shown>))| {
            Ok((format!("{time_s:.1} s"), self.overlay(moment)?.svg_elements()))
        };
        Ok(Player {
            title: self.title.clone(),
            size_px: background.size_px().into(),
            background: background.svg_elements(),
            frames: self.moments.iter().enumerate().map(frame).collect::<anyhow::Result<_>>()?,
            still,
            rate_per_s,
        })
    }

    /// What stays: ground, obstacles, route, names, legend. Only a camera that follows makes it differ.
    ///
    /// # Errors
    /// If the picture would be too large.
    pub fn background(&self, moment: usize) -> anyhow::Result<Drawing> {
        let places = self.places();
        let mut sheet = Drawing::new(places.size_px, [0xFF; 3])?;
        let view = self.view(moment);
        let mut top = Drawing::new(view.size_px(), lot::GROUND)?;
        lot::draw_ground(&mut top, &view, &self.map);
        lot::draw_obstacles(&mut top, &view, &self.map);
        let route = self.map.path().poses().iter().map(|pose| pose.position());
        top.dashed(view.pixels(route), lot::ROUTE, 1.5, [7.0, 6.0]);
        lot::draw_finish(&mut top, &view, &self.map);
        sheet.inset(top, places.top_view);
        let letters = ((view.size_px().x - 80.0) / FONT.width_px("x")) as usize;
        sheet.text(lot::shortened(&self.title, letters), places.caption, FONT, INK);
        for (index, (take, panel)) in self.takes.iter().zip(&places.panels).enumerate() {
            let mut grid = Drawing::new(Vec2::splat(places.cell_px * GRID_CELLS as f32), LINE)?;
            let all = (0..GRID_CELLS * GRID_CELLS).map(|i| (i / GRID_CELLS, i % GRID_CELLS));
            draw_cells(&mut grid, all, FREE);
            sheet.inset(grid, *panel);
            let at = places.words(*panel);
            // On the white sheet a white swatch needs an edge.
            sheet.rectangle(at + Vec2::new(0.0, 2.0), Vec2::splat(12.0), INK);
            sheet.rectangle(at + Vec2::new(1.0, 3.0), Vec2::splat(10.0), colour(index));
            sheet.text(lot::ending(&take.name, LETTERS - 2), at + Vec2::new(18.0, 0.0), FONT, INK);
        }
        grids::draw_small_legend(&mut sheet, places.legend, places.size_px.x - 2.0 * GAP_PX, &self.legend());
        Ok(sheet)
    }

    /// What moves: cars, lines, grids, numbers.
    ///
    /// # Errors
    /// If the picture would be too large.
    pub fn overlay(&self, moment: usize) -> anyhow::Result<Drawing> {
        let places = self.places();
        let (time_s, shown) = &self.moments[moment];
        let view = self.view(moment);
        let mut sheet = Drawing::new(places.size_px, [0xFF; 3])?.overlay();
        let mut top = Drawing::new(view.size_px(), lot::GROUND)?.overlay();
        let indices_at = |time_s: f32| self.takes.iter().map(move |take| take.index_at(time_s));
        let indices: Vec<usize> = indices_at(*time_s).collect();
        // What was driven before the first picture would only hide the ground.
        let shown_from = indices_at(self.moments[0].0);
        let driven: Vec<Trajectory> = self
            .trajectories
            .iter()
            .zip(shown_from.zip(&indices))
            .map(|(all, (first, &index))| Trajectory {
                name: String::new(),
                points: all.points[first..=index].to_vec(),
            })
            .collect();
        if let [only] = driven.as_slice() {
            trajectories::draw_lines(&mut top, &view, std::slice::from_ref(only), |_| 2.5, |_, point| of_speed(point));
        } else {
            let width_px = |index| trajectories::width_px(index, driven.len(), [2.0, 2.0]);
            trajectories::draw_lines(&mut top, &view, &driven, width_px, |index, _| colour(index));
        }
        for (index, take) in self.takes.iter().enumerate() {
            self.draw_car(&mut top, &view, &take.frames[indices[index]], colour(index));
        }
        trajectories::draw_crosses(&mut top, &view, &driven);
        sheet.inset(top, places.top_view);
        let time = format!("{time_s:.1} s");
        let right = places.caption.x + view.size_px().x - FONT.width_px(&time);
        sheet.text(time, Vec2::new(right, places.caption.y), FONT, INK);
        for (index, (take, panel)) in self.takes.iter().zip(&places.panels).enumerate() {
            let frames = &take.frames[..=indices[index]];
            sheet.inset(self.grid(&frames[indices[index]], &shown[index], places.cell_px)?, *panel);
            self.draw_words(&mut sheet, places.words(*panel), frames);
        }
        Ok(sheet)
    }

    fn view(&self, moment: usize) -> View {
        match self.camera {
            Camera::Lot => View::fitting(&self.map, self.top_px()),
            Camera::Place(place) => View::around(place, SIDE_M, SIDE_PX),
            Camera::Follow => {
                let take = &self.takes[0];
                let pose = take.frames[take.index_at(self.moments[moment].0)].vehicle.pose;
                View::around(pose.position() + 4.0 * pose.ahead(), SIDE_M, SIDE_PX)
            }
        }
    }

    fn top_px(&self) -> Vec2 {
        if self.camera != Camera::Lot {
            return Vec2::splat(SIDE_PX);
        }
        let size_m = View::of_map(&self.map, Some(1.0)).size_m;
        let largest_px = match self.layout {
            Layout::Beside => Vec2::new(560.0, 540.0),
            Layout::Below => Vec2::new(880.0, 540.0),
        };
        (size_m * (largest_px / size_m).min_element().min(LOT_PX_PER_M_MAX)).floor()
    }

    fn grid(&self, frame: &Frame, shown: &Shown, cell_px: f32) -> anyhow::Result<Drawing> {
        let mut grid = Drawing::new(Vec2::splat(cell_px * GRID_CELLS as f32), LINE)?.overlay();
        draw_cells(&mut grid, shown.occupied.iter().copied(), OCCUPIED);
        for layer in Layer::ALL {
            let of_layer = |&&(_, _, other): &&(usize, usize, Layer)| other == layer;
            let cells = shown.wrong.iter().filter(of_layer).map(|&(row, col, _)| (row, col));
            if cells.clone().count() > 0 {
                draw_cells(&mut grid, cells, grids::of_layer(layer));
            }
        }
        // Wrongly free: only a frame has the colour.
        let free = shown.wrong.iter().filter(|(row, col, _)| !frame.observation.grid.is_occupied(*row, *col));
        let frame_px = (0.2 * cell_px).ceil();
        let inner: Vec<Vec2> =
            free.map(|&(row, col, _)| Vec2::new(col as f32, row as f32) * cell_px + Vec2::splat(frame_px)).collect();
        if !inner.is_empty() {
            grid.squares(inner, [cell_px - 1.0 - 2.0 * frame_px, cell_px], FREE);
        }
        let geometry = &self.episode.sensing.geometry;
        grids::draw_prediction(&mut grid, frame.decision.look_ahead, frame.decision.spread, geometry);
        Ok(grid)
    }

    fn draw_car(&self, top: &mut Drawing, view: &View, frame: &Frame, rgb: Rgb) {
        let pose = match frame.event {
            Event::NearCollision { at, .. } => at,
            Event::Drove | Event::Stuck { .. } | Event::ReachedEnd => frame.vehicle.pose,
        };
        let world_from_ego = pose.world_from_ego();
        let place = |in_ego: Vec2| view.pixel(world_from_ego.point(in_ego));
        if self.camera != Camera::Lot {
            let geometry = &self.episode.sensing.geometry;
            let (near, far, half) = (geometry.near_edge_ahead_m, geometry.far_edge_ahead_m(), 0.5 * geometry.side_m);
            let patch = [(near, half), (far, half), (far, -half), (near, -half), (near, half)];
            top.dashed(patch.map(|(x, y)| place(Vec2::new(x, y))).to_vec(), INK, 1.0, [2.0, 4.0]);
        }
        let body = self.episode.vehicle.body_in_ego().map(place).to_vec();
        top.polygon(body.clone(), rgb);
        lot::draw_car(top, view, &self.episode.vehicle, pose, if is_near(frame) { NEAR_COLLISION } else { INK }, 1.5);
        let target = place(Vec2::new(frame.decision.look_ahead.ahead_m, frame.decision.look_ahead.left_m));
        top.line(vec![place(Vec2::ZERO), target], INK, 1.0);
        top.disc(target, 4.5, [0xFF; 3]);
        top.disc(target, 3.5, if self.takes.len() == 1 { PREDICTION } else { rgb });
    }

    /// Numbers beside a grid, of the last frame and of all so far.
    fn draw_words(&self, sheet: &mut Drawing, at: Vec2, frames: &[Frame]) {
        let Some(now) = frames.last() else { return };
        let near = frames.iter().filter(|frame| is_near(frame)).count();
        let contacts: u32 = frames.iter().map(|frame| frame.contacts).sum();
        let recent = (ANNOUNCED_S / self.episode.control_period_s()) as usize;
        let is_announced = frames.iter().rev().take(recent.max(1)).any(is_near);
        let plural = |count: usize, what: &str| format!("{count} {what}{}", if count == 1 { "" } else { "s" });
        let mut lines = vec![
            (format!("{:.2} m/s", now.vehicle.speed_mps), INK),
            (format!("{:.2} m clear", now.clearance_m.max(0.0)), INK),
            (plural(near, "near-collision"), if is_announced { NEAR_COLLISION } else { INK }),
        ];
        if contacts > 0 {
            lines.push((plural(contacts as usize, "contact"), INK));
        }
        if now.event == Event::ReachedEnd {
            lines.push(("finished".to_owned(), lot::ROUTE));
        }
        for (index, (words, rgb)) in lines.into_iter().enumerate() {
            sheet.text(words, at + Vec2::new(0.0, LINE_PX * (index + 1) as f32), FONT, rgb);
        }
    }

    fn legend(&self) -> Vec<LegendEntry> {
        let mut legend = vec![(lot::ROUTE, "route".to_owned())];
        if self.takes.len() == 1 {
            legend.push((PREDICTION, "look-ahead point".to_owned()));
            legend.extend([0.3, 1.0, 2.0].map(|mps| (trajectories::of_speed(mps), format!("{mps:.1} m/s"))));
        }
        if self.takes.iter().flat_map(|take| &take.frames).any(is_near) {
            legend.push((NEAR_COLLISION, "near-collision".to_owned()));
        }
        legend.push((OCCUPIED, "grid: not drivable".to_owned()));
        let shown = || self.moments.iter().flat_map(|(_, shown)| shown).flat_map(|shown| &shown.wrong);
        let wrong = Layer::ALL.into_iter().filter(|layer| shown().any(|(_, _, other)| other == layer));
        legend.extend(wrong.map(|layer| (of_layer(layer), format!("wrong: {}", layer.name()))));
        legend
    }

    fn places(&self) -> Places {
        let top_px = self.top_px();
        let count = self.takes.len();
        let cell_px = match (self.layout, count) {
            (Layout::Beside, 1) => 10.0,
            (Layout::Below, 1 | 2) | (Layout::Beside, 2) => 8.0,
            _ => 6.0,
        };
        let grid_px = cell_px * GRID_CELLS as f32;
        let panel_px = Vec2::new(grid_px + GAP_PX + FONT.width_px("x") * LETTERS as f32, grid_px);
        let top_view = Vec2::splat(GAP_PX);
        let caption = top_view + Vec2::new(0.0, top_px.y + 4.0);
        let under_caption = caption.y + LINE_PX + 4.0;
        let first = match self.layout {
            Layout::Beside => Vec2::new(2.0 * GAP_PX + top_px.x, GAP_PX),
            Layout::Below => Vec2::new(GAP_PX, under_caption),
        };
        let step = panel_px + Vec2::splat(GAP_PX);
        let (columns, width) = match self.layout {
            Layout::Beside => (1, first.x + step.x),
            Layout::Below => {
                let columns = (((top_px.x + GAP_PX) / step.x) as usize).clamp(1, count);
                (columns, GAP_PX + (top_px.x + GAP_PX).max(columns as f32 * step.x))
            }
        };
        let cell = |i: usize| Vec2::new((i % columns) as f32, (i / columns) as f32);
        let panels = (0..count).map(|i| first + cell(i) * step).collect();
        let panels_end = first.y + count.div_ceil(columns) as f32 * step.y;
        let legend_top = panels_end.max(under_caption);
        let (_, legend_px) = grids::small_legend(width - 2.0 * GAP_PX, &self.legend());
        Places {
            size_px: Vec2::new(width, legend_top + legend_px + GAP_PX).ceil(),
            top_view,
            caption,
            panels,
            cell_px,
            legend: Vec2::new(GAP_PX, legend_top),
        }
    }
}

/// Upper left corners, pixels.
struct Places {
    size_px: Vec2,
    top_view: Vec2,
    caption: Vec2,
    panels: Vec<Vec2>,
    cell_px: f32,
    legend: Vec2,
}

impl Places {
    /// The corner of the words beside a grid.
    fn words(&self, panel: Vec2) -> Vec2 {
        panel + Vec2::new(self.cell_px * GRID_CELLS as f32 + GAP_PX, 0.0)
    }
}

/// Colour of a driver: bright, as nothing that is parked. From the ninth on they come again, darker; after sixteen they repeat.
fn colour(index: usize) -> Rgb {
    const BRIGHT: [Rgb; 8] = [
        [0xFF, 0xC4, 0x00],
        [0x00, 0xD0, 0xE8],
        [0xF0, 0x50, 0xF0],
        [0xFF, 0xFF, 0xFF],
        [0x80, 0xF0, 0x20],
        [0x30, 0x60, 0xFF],
        [0x8A, 0x20, 0xF0],
        [0xFF, 0xA0, 0x90],
    ];
    let bright = BRIGHT[index % BRIGHT.len()];
    let is_darker = (index / BRIGHT.len()) % 2 == 1;
    if is_darker { bright.map(|part| part / 5 * 3) } else { bright }
}

fn draw_cells(grid: &mut Drawing, cells: impl Iterator<Item = (usize, usize)>, rgb: Rgb) {
    let cell_px = grid.size_px().x / GRID_CELLS as f32;
    let corners = cells.map(|(row, col)| Vec2::new(col as f32, row as f32) * cell_px).collect();
    grid.squares(corners, [cell_px - 1.0, cell_px], rgb);
}

fn of_speed(point: &Point) -> Rgb {
    trajectories::of_speed(point.speed_mps)
}

fn is_near(frame: &Frame) -> bool {
    matches!(frame.event, Event::NearCollision { .. })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The fifth driver was as yellow as the first.
    #[test]
    fn sixteen_drivers_can_be_told_apart_by_their_colours() {
        let colours: Vec<Rgb> = (0..16).map(colour).collect();
        for (index, one) in colours.iter().enumerate() {
            for other in colours[..index].iter().chain([&NEAR_COLLISION]) {
                let apart: u32 = one.iter().zip(other).map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
                assert!(apart > 60, "{one:?} {other:?}");
            }
        }
    }
}
