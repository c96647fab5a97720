//! Maps made for other programs as lots: ROS `map_server` maps and TPCAP benchmark cases.
//!
//! A map says what is drivable, a [`MapLot`] says where to drive on it. It is a small TOML file, by custom
//! `NAME.lot.toml`; `examples/` has annotated ones. All of its coordinates are metres in the map's own frame, as RViz
//! shows them; `scale` then enlarges the whole about (0, 0), so that a map of a small robot's world fits a car.

mod centre_line;
mod contour;
mod frame;
mod ground;
pub mod parsers;
mod ros;
mod tpcap;

use crate::branches;
use crate::error::{LoadError, read_text};
use crate::note::{Loaded, Note, ShortCut};
use crate::solver;
use crate::solver::route::{self, Finish, NoRoute};
use frame::Frame;
use ground::{Ground, Numbers};
use serde::Deserialize;
use sim::distance_field::{DistanceField, NODE_M};
use sim::geometry::{Pose, Vec2};
use sim::limits::{
    ISLANDS_MAX, LOT_BYTES_MAX, MAP_COORDINATE_MAX_M, MAP_PIXEL_M, MAP_SCALE, OUTLINE_CORNERS_MAX, ROUTE_MAX_M,
    VERTICES_MAX,
};
use sim::map::Map;
use sim::scenario::{Island, LotNoise, Place, ReferencePath, Scenario, ScenarioError};
use sim::validate::{check_island, validate};
use sim::vehicle::VehicleSettings;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use storage::read;

/// A centre line turns by less than this at each of its points, radians: 170°, as a route may.
const TURN_MAX_RAD: f32 = 2.967;
/// Corners of a centre line are rounded with this radius, metres, as those of the reference lots (docs/methods.md 11).
const CENTRE_LINE_RADIUS_M: f32 = 5.0;
/// Height of what a map says is not drivable, metres: a lidar that saw it looks over kerbs, and most of what it sees, walls
/// and parked cars, is higher than the camera.
const WALL_HEIGHT_M: f32 = 2.0;
/// Height of islands where `wall_height_m` is 0, metres.
const PAINT_M: f32 = 0.01;
/// Smallest island, m² in the lot: a little more than [`validate`] asks for. Smaller specks are made as large.
const ISLAND_MIN_M2: f64 = 0.0105;
/// Things that are thinner than the spacing of [`DistanceField`]'s nodes, which may miss them, are made this thick, metres in
/// the lot: a little more than it, for outlines are rounded to whole millimetres.
const THICKNESS_M: f64 = 0.102;
/// How far simplification may move an outline, metres in the lot: less than the clearance that routes keep.
const SIMPLIFIED_M: f64 = 0.2;

/// A map and the route on it: the content of a `NAME.lot.toml`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MapLot {
    /// ROS map (`.yaml`) or TPCAP case (`.csv`), relative to this file; beside or below it.
    pub map: PathBuf,
    /// Name of the lot; by default that of the file.
    #[serde(default)]
    pub name: Option<String>,
    /// The lot is this many times as large as the map, within [`MAP_SCALE`].
    #[serde(default = "one")]
    pub scale: f64,
    /// Where the rear axle starts: x and y in metres, heading in degrees counter-clockwise from x.
    #[serde(default)]
    pub start: Option<[f64; 3]>,
    /// Where it is to arrive.
    #[serde(default)]
    pub goal: Option<[f64; 3]>,
    /// Instead of a goal: round a loop, back to the start.
    #[serde(default, rename = "loop")]
    pub is_loop: bool,
    /// Instead of all three: a CSV file with the route of the rear axle, x and y in metres, relative to this file;
    /// beside or below it.
    #[serde(default)]
    pub centre_line: Option<PathBuf>,
    /// Clearance that a route found automatically keeps around the body, 0…2 m in the lot; by default
    /// [`solver::CLEARANCE_M`]. A centre line is as near as it is drawn.
    #[serde(default)]
    pub clearance_m: Option<f32>,
    /// Height of what is not drivable, 0…5 m in the lot: above 0.15 it hides the ground behind it.
    #[serde(default = "wall_height_m")]
    pub wall_height_m: f32,
    /// Occupied specks up to this size are taken for free ground, 0…100 m² in the lot; of a TPCAP case 0.
    #[serde(default)]
    pub drop_specks_m2: f64,
    /// Whether ways that leave the route, and short cuts back to it, are closed with kerbs.
    #[serde(default)]
    pub close_branches: bool,
    /// Sensor noise of the lot.
    #[serde(default)]
    pub noise: LotNoise,
    /// Whether the image of a ROS map may lie elsewhere than beside or below its YAML file. No file can say so: it would
    /// be the one that is not trusted.
    #[serde(skip)]
    pub is_image_anywhere: bool,
    /// What is named in errors.
    #[serde(skip)]
    file: PathBuf,
}

fn one() -> f64 {
    1.0
}

fn wall_height_m() -> f32 {
    WALL_HEIGHT_M
}

/// Whether a map is a TPCAP case, by its extension.
fn is_case(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "csv")
}

/// Whether a path is that of a map this module reads, by its extension.
pub fn is_map(path: &Path) -> bool {
    path.extension().is_some_and(|extension| ["yaml", "yml", "csv"].iter().any(|known| extension == *known))
}

/// A map as read.
enum Source {
    Map(ros::Map),
    Case(tpcap::Case),
}

impl MapLot {
    /// Reads a `NAME.lot.toml`; of a map, the `NAME.lot.toml` beside it, if there is one.
    ///
    /// # Errors
    /// If the file cannot be read or says something else.
    pub fn read(path: &Path) -> Result<Self, LoadError> {
        if !is_map(path) {
            return Self::parse(&read_text(path, LOT_BYTES_MAX)?, path);
        }
        let beside = path.with_extension("lot.toml");
        // Whatever else is in its place is an error when it is read: without it the map would be another lot. (Its name
        // is longer than the map's, perhaps too long for a file.)
        let is_not_there = |kind: ErrorKind| {
            matches!(kind, ErrorKind::NotFound | ErrorKind::NotADirectory | ErrorKind::InvalidFilename)
        };
        if beside.symlink_metadata().is_err_and(|error| is_not_there(error.kind())) {
            return Ok(Self::of_map(path));
        }
        let lot = Self::read(&beside)?;
        let place = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
        if place(&lot.map) != place(path) {
            let problem = format!("it names the map {}, not {}", lot.map.display(), path.display());
            return Err(lot.fault("map", problem, "name the file that is meant with --lots"));
        }
        Ok(lot)
    }

    /// A map without further settings.
    fn of_map(map: &Path) -> Self {
        Self {
            map: map.to_owned(),
            name: None,
            scale: one(),
            start: None,
            goal: None,
            is_loop: false,
            centre_line: None,
            clearance_m: None,
            wall_height_m: wall_height_m(),
            drop_specks_m2: 0.0,
            close_branches: false,
            noise: LotNoise::default(),
            is_image_anywhere: false,
            file: map.to_owned(),
        }
    }

    fn parse(text: &str, path: &Path) -> Result<Self, LoadError> {
        let mut lot: Self = toml_edit::de::from_str(text).map_err(|error| {
            let offset = error.span().map_or(0, |span| span.start);
            let problem = error.message().trim().to_owned();
            let remedy = "docs/maps.md explains every key".to_owned();
            LoadError::faulty(&path.display().to_string(), text, offset, &problem, remedy)
        })?;
        let folder = path.parent().unwrap_or(Path::new(""));
        lot.map = folder.join(&lot.map);
        lot.centre_line = lot.centre_line.map(|file| folder.join(file));
        path.clone_into(&mut lot.file);
        for (key, file) in [("map", Some(&lot.map)), ("centre_line", lot.centre_line.as_ref())] {
            // What is missing is an error when it is read.
            if file.is_some_and(|file| read::is_below(folder, file).is_ok_and(|is_below| !is_below)) {
                let problem = "it is neither next to this file nor in a folder below".to_owned();
                let remedy = "put it there, or name the map itself with --lots of cargo xtask generate";
                return Err(lot.fault(key, problem, remedy));
            }
        }
        Ok(lot)
    }

    /// The lot, checked: a vehicle can drive it from its start to its finish.
    ///
    /// # Errors
    /// The first thing wrong with it, with file, place and remedy.
    pub fn scenario(&self, vehicle: &VehicleSettings) -> Result<Loaded, LoadError> {
        self.check()?;
        let is_case = is_case(&self.map);
        let mut notes = Vec::new();
        let mut files = vec![self.file.clone(), self.map.clone()];
        files.extend(self.centre_line.clone());
        let source = if is_case {
            Source::Case(tpcap::Case::read(&self.map)?)
        } else {
            let (map, image, unused) = ros::Map::read(&self.map, self.is_image_anywhere)?;
            files.push(image);
            notes.extend(unused);
            Source::Map(map)
        };
        let (start, goal) = match &source {
            Source::Case(case) => (self.start.or(Some(case.start)), self.goal.or(Some(case.goal))),
            Source::Map(_) => (self.start, self.goal),
        };
        let goal = goal.filter(|_| !self.is_loop);
        let centre_line = self.centre_line.as_deref().map(|file| centre_line::read(file, self.scale)).transpose()?;
        let seed = match (&centre_line, start, goal, self.is_loop) {
            (Some(points), ..) => points[0],
            (None, Some([x, y, _]), Some(_), false) | (None, Some([x, y, _]), None, true) => [x, y],
            _ => return Err(self.nothing_to_drive()),
        };
        let frame = Frame::around(seed, self.scale);
        notes.extend(frame.is_recentred().then_some(Note::Recentred { origin: frame.origin }));
        let ground = match &source {
            Source::Case(case) => case.ground(frame),
            Source::Map(map) => self.ros_ground(map, frame, seed, goal.map(|[x, y, _]| [x, y]), vehicle, &mut notes)?,
        };
        let mut scenario = self.outlines(&ground).with_obstacles(ground.obstacles);
        scenario.noise = self.noise.clone();
        let in_lot = |error| self.in_lot(error, frame, &ground.numbers);
        validate_ground(&scenario, vehicle).map_err(in_lot)?;
        scenario.reference_path = match (centre_line, start) {
            (Some(points), _) => self.checked_centre_line(&points, frame, &scenario, vehicle)?,
            (None, Some(start)) => {
                let start = frame.pose_in_lot(start);
                let finish = goal.map_or(Finish::Start, |goal| Finish::At(frame.pose_in_lot(goal)));
                route::find(&scenario, start, finish, vehicle, self.clearance_m())
                    .map_err(|reason| self.no_route(reason, frame, start, finish, vehicle))?
            }
            (None, None) => return Err(self.nothing_to_drive()),
        };
        validate(&scenario, vehicle).map_err(in_lot)?;
        let in_map = |mouths: Vec<Vec2>| mouths.into_iter().map(|mouth| frame.in_map(mouth)).collect::<Vec<_>>();
        if self.close_branches {
            let mouths = in_map(branches::close(&mut scenario, vehicle));
            notes.extend((!mouths.is_empty()).then_some(Note::Closed { mouths }));
        }
        let map = Map::build(scenario.clone(), vehicle).map_err(in_lot)?;
        let ways = branches::find(&map, vehicle);
        let mouths = in_map(ways.branches.into_iter().map(|branch| branch.mouth).collect());
        let is_asked_to_close = self.close_branches;
        notes.extend((!mouths.is_empty()).then_some(Note::Open { mouths, is_asked_to_close }));
        let noted = |way: branches::ShortCut| ShortCut { middle: frame.in_map(way.middle), joins_m: way.joins_m };
        let short_cuts: Vec<_> = ways.short_cuts.into_iter().map(noted).collect();
        notes.extend((!short_cuts.is_empty()).then_some(Note::ShortCuts { short_cuts, is_asked_to_close }));
        Ok(Loaded { scenario, files, notes, frame: frame.explained(), is_by_hand: false })
    }

    fn check(&self) -> Result<(), LoadError> {
        if !is_map(&self.map) {
            let problem = format!("{} is neither a ROS map nor a TPCAP case", self.map.display());
            return Err(self.fault("map", problem, "name a .yaml or a .csv file"));
        }
        if !MAP_SCALE.contains(&self.scale) {
            let remedy = format!(
                "write how many times as large as the map the lot is, {} to {}, e.g. 20",
                MAP_SCALE.start(),
                MAP_SCALE.end()
            );
            return Err(self.fault("scale", format!("it is {}", self.scale), &remedy));
        }
        if let Some(clearance_m) = self.clearance_m.filter(|clearance_m| !(0.0..=2.0).contains(clearance_m)) {
            let remedy = "write a number of metres from 0 to 2";
            return Err(self.fault("clearance_m", format!("it is {clearance_m}"), remedy));
        }
        if !(0.0..=5.0).contains(&self.wall_height_m) {
            let remedy = "write a number of metres from 0 to 5";
            return Err(self.fault("wall_height_m", format!("it is {}", self.wall_height_m), remedy));
        }
        if self.drop_specks_m2 > 0.0 && is_case(&self.map) {
            let remedy = "leave it out";
            return Err(self.fault("drop_specks_m2", "a TPCAP case has no pixels".to_owned(), remedy));
        }
        if !(0.0..=100.0).contains(&self.drop_specks_m2) {
            let remedy = "write a number of m² from 0 to 100";
            return Err(self.fault("drop_specks_m2", format!("it is {}", self.drop_specks_m2), remedy));
        }
        for (place, pose) in [("start", self.start), ("goal", self.goal)] {
            let is_far = |value: &f64| value.is_nan() || value.abs() > MAP_COORDINATE_MAX_M;
            if let Some(value) = pose.into_iter().flatten().find(is_far) {
                return Err(self.fault(place, format!("a number is {value}"), "write x, y in metres and degrees"));
            }
        }
        let also = [("goal", self.goal.is_some()), ("loop", self.is_loop), ("centre_line", self.centre_line.is_some())];
        let given: Vec<&str> = also.into_iter().filter_map(|(name, is_given)| is_given.then_some(name)).collect();
        if let [first, second, ..] = given[..] {
            return Err(self.fault(second, format!("{first} is given too"), "keep one of them"));
        }
        if self.centre_line.is_some() && self.start.is_some() {
            let remedy = "leave it out: the route starts at the first point of the centre line";
            return Err(self.fault("start", "centre_line is given too".to_owned(), remedy));
        }
        if self.centre_line.is_some() && self.clearance_m.is_some() {
            let remedy = "leave it out: it is for routes that are found, and a centre line is driven as it is";
            return Err(self.fault("clearance_m", "centre_line is given too".to_owned(), remedy));
        }
        Ok(())
    }

    fn clearance_m(&self) -> f32 {
        self.clearance_m.unwrap_or(solver::CLEARANCE_M)
    }

    fn name(&self) -> String {
        self.name.clone().unwrap_or_else(|| {
            let stem = self.file.file_stem().unwrap_or_default().to_string_lossy();
            stem.strip_suffix(".lot").unwrap_or(&stem).to_owned()
        })
    }

    /// The outlines of the drivable pixels around the seed, in the lot, as simple as they can be and stay sound.
    fn ros_ground(
        &self,
        map: &ros::Map,
        frame: Frame,
        seed: [f64; 2],
        goal: Option<[f64; 2]>,
        vehicle: &VehicleSettings,
        notes: &mut Vec<Note>,
    ) -> Result<Ground, LoadError> {
        let place = if self.centre_line.is_some() { "centre_line, point 1" } else { "start" };
        let drivable_pixel = |place: &str, [x, y]: [f64; 2]| {
            let pixel = map.pixel_at([x, y]);
            if map.drivable.at(pixel) {
                return Ok(pixel);
            }
            let problem = format!("({x:.2}, {y:.2}) is not drivable: {}", map.pixel_said(pixel));
            Err(self.fault(place, problem, "move it onto free pixels; x and y are metres in the map's frame"))
        };
        let pixel = drivable_pixel(place, seed)?;
        goal.map(|goal| drivable_pixel("goal", goal)).transpose()?;
        let pixel_m = map.resolution_m * self.scale;
        if !MAP_PIXEL_M.contains(&pixel_m) {
            let problem = format!("a pixel of the map is {pixel_m} m in the lot");
            let remedy = format!("let scale make it {} m to {} m", MAP_PIXEL_M.start(), MAP_PIXEL_M.end());
            return Err(self.fault("scale", problem, &remedy));
        }
        let in_px2 = |m2: f64| m2 / (pixel_m * pixel_m);
        let region = map.drivable.region_of(pixel);
        let corners = region.corners();
        if corners > OUTLINE_CORNERS_MAX {
            let problem = format!("the outlines of what is drivable have {corners} corners");
            let remedy = format!("smooth the image, or crop it, to at most {OUTLINE_CORNERS_MAX}");
            return Err(self.fault("map", problem, &remedy));
        }
        // A little more than is asked for: 0.0025 m² are, by a rounding, less than one pixel of 0.05 m.
        let (region, dropped) = region.without_specks(in_px2(self.drop_specks_m2) * (1.0 + 1e-9));
        let islands = region.islands();
        if islands > ISLANDS_MAX {
            let problem = format!("what is drivable encloses {islands} islands");
            let remedy = format!("smooth the image, or leave specks out with drop_specks_m2, to at most {ISLANDS_MAX}");
            return Err(self.fault("map", problem, &remedy));
        }
        let (region, padded) = region.with_large_specks(pixel, in_px2(ISLAND_MIN_M2));
        let up_to_m2 = self.drop_specks_m2;
        notes.extend((dropped > 0).then_some(Note::Dropped { specks: dropped, up_to_m2 }));
        notes.extend((padded > 0).then_some(Note::Padded { specks: padded }));
        let (region, thickened) = if (pixel_m as f32) < NODE_M {
            // Slanted outlines may lose half a pixel when they are simplified: steps of one, cut on both sides by three quarters.
            region.with_thick_walls(pixel, (THICKNESS_M / pixel_m + 0.5).ceil() as usize)
        } else {
            (region, 0)
        };
        notes.extend((thickened > 0).then_some(Note::Thickened { pixels: thickened }));
        if !region.at(pixel) {
            let [x, y] = seed;
            let problem = format!("({x:.2}, {y:.2}) lies within a speck or wall that was made larger");
            let remedy = "move it away from what is not drivable; drop_specks_m2 leaves specks out";
            return Err(self.fault(place, problem, remedy));
        }
        let rings = region.outlines();
        let in_lot = |point: [f64; 2]| {
            let point = frame.in_lot(map.point_at(point));
            // Whole millimetres keep lot files short; a map finer than that keeps what it has.
            if pixel_m > 0.02 { crate::corridor::to_millimetres(point) } else { point }
        };
        let (outer, inner): (Vec<_>, Vec<_>) = rings.iter().partition(|ring| contour::signed_area_px2(ring) > 0.0);
        let Some(outer) = outer.first() else {
            unreachable!("a region has an outline");
        };
        let mut tolerances_px =
            contour::TOLERANCES_PX.map(|tolerance_px| tolerance_px.min(SIMPLIFIED_M / pixel_m)).to_vec();
        tolerances_px.dedup();
        let closest = tolerances_px.len() - 1;
        let outline = |ring: &contour::Ring, step: usize| -> Vec<Vec2> {
            contour::simplified(ring, tolerances_px[step]).into_iter().map(in_lot).collect()
        };
        // An outline at fault is followed more closely; if an island's is exact already, so is the boundary.
        let mut steps = vec![0; inner.len()];
        let mut fault = None;
        for step in 0..=closest {
            let boundary = outline(outer, step);
            let (islands, obstacles, numbers) = (Vec::new(), Vec::new(), Numbers::default());
            let ground = Ground { boundary, is_walled: true, islands, obstacles, numbers };
            let islands = validate_ground(&self.outlines(&ground), vehicle).and_then(|()| {
                let mut vertices = ground.boundary.len();
                let mut islands = Vec::new();
                for (i, (ring, step)) in inner.iter().zip(&mut steps).enumerate() {
                    let room = VERTICES_MAX.saturating_sub(vertices);
                    let island =
                        self.sound_island(i, room, &ground.boundary, step, closest, |step| outline(ring, step))?;
                    vertices += island.len();
                    islands.push(island);
                    // The others need not be simplified any more: the lot is refused.
                    if vertices > VERTICES_MAX {
                        break;
                    }
                }
                Ok(islands)
            });
            // Of the boundary alone, if that has too many. A closer outline has no fewer.
            let in_islands = islands.as_ref().map_or(0, |islands| islands.iter().map(Vec::len).sum::<usize>());
            let vertices = ground.boundary.len() + in_islands;
            if vertices > VERTICES_MAX {
                let problem = format!("the outlines of what is drivable have {vertices} vertices, or more");
                let remedy = format!(
                    "smooth the image, crop it, or leave specks out with drop_specks_m2, to at most {VERTICES_MAX}"
                );
                return Err(self.fault("map", problem, &remedy));
            }
            match islands {
                Ok(islands) => return Ok(Ground { islands, ..ground }),
                Err(error) => fault = Some(error),
            }
        }
        Err(self.in_lot(fault.expect("there is a tolerance"), frame, &Numbers::default()))
    }

    /// An island with an outline as simple as it can be. `step`: how closely it is followed, and has to be, `closest` at last.
    /// One that has more vertices than there is `room` for is not checked: the lot is refused.
    fn sound_island(
        &self,
        index: usize,
        room: usize,
        boundary: &[Vec2],
        step: &mut usize,
        closest: usize,
        outline: impl Fn(usize) -> Vec<Vec2>,
    ) -> Result<Vec<Vec2>, ScenarioError> {
        loop {
            let island = self.island(outline(*step));
            if island.polygon.len() > room {
                return Ok(island.polygon);
            }
            match check_island(index, &island, boundary) {
                Ok(()) => return Ok(island.polygon),
                Err(error) if *step == closest => return Err(error),
                Err(_) => *step += 1,
            }
        }
    }

    /// Boundary and islands of a lot that has no route yet.
    fn outlines(&self, ground: &Ground) -> Scenario {
        let islands = ground.islands.iter().cloned().map(|polygon| self.island(polygon)).collect();
        let boundary_height_m = if ground.is_walled { self.wall_height_m } else { 0.0 };
        Scenario {
            islands,
            boundary_height_m,
            ..Scenario::new(self.name(), ground.boundary.iter().copied(), [Vec2::ZERO; 0])
        }
    }

    fn island(&self, polygon: Vec<Vec2>) -> Island {
        // What has no height of its own is painted: as low as the lowest kerb.
        Island { polygon, height_m: self.wall_height_m.max(PAINT_M) }
    }

    /// The car must find room along the whole line: half its width to either side.
    fn checked_centre_line(
        &self,
        points: &[[f64; 2]],
        frame: Frame,
        ground: &Scenario,
        vehicle: &VehicleSettings,
    ) -> Result<ReferencePath, LoadError> {
        let mut room = DistanceField::of_boundary(&ground.boundary);
        for island in &ground.islands {
            room.carve_polygon(&island.polygon);
        }
        for obstacle in &ground.obstacles {
            room.carve_polygon(&obstacle.outline());
        }
        let points: Vec<Vec2> = points.iter().map(|&point| frame.in_lot(point)).collect();
        let length_m: f32 = points.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
        if length_m > ROUTE_MAX_M {
            let problem = format!("it is {:.0} km long in the lot", length_m / 1000.0);
            return Err(self.fault("centre_line", problem, &format!("shorten it to at most {ROUTE_MAX_M} m")));
        }
        let back = points.windows(3).find(|three| {
            let turn_rad = (three[1] - three[0]).angle_to(three[2] - three[1]);
            turn_rad.abs() >= TURN_MAX_RAD
        });
        if let Some(three) = back {
            let problem = format!("it turns back at {}", frame.said(three[1]));
            return Err(self.fault(
                "centre_line",
                problem,
                "cars here do not reverse; leave out the points of the turn",
            ));
        }
        let line = ReferencePath { points, corner_radius_m: CENTRE_LINE_RADIUS_M };
        let path = sim::path::Path::new(&line);
        let half_width_m = 0.5 * vehicle.width_m;
        for (i, pose) in path.poses().iter().enumerate() {
            let room_m = room.at(pose.position());
            if room_m >= half_width_m {
                continue;
            }
            let along_m = f64::from(i as f32 * path.spacing_m()) / self.scale;
            let place = format!("centre_line, {along_m:.1} m from its start");
            let at = frame.said(pose.position());
            let remedy = "lead the line round it, or enlarge the lot with scale; corners are rounded with 5 m";
            let problem = if room_m <= 0.0 {
                format!("it runs through a wall at {at}")
            } else {
                format!(
                    "the passage is too narrow at {at}: {room_m:.2} m to the side, and half of the car is \
                         {half_width_m:.2} m"
                )
            };
            return Err(self.fault(&place, problem, remedy));
        }
        Ok(line)
    }

    fn fault(&self, place: &str, problem: String, remedy: &str) -> LoadError {
        LoadError::Map {
            file: self.file.display().to_string(),
            place: place.to_owned(),
            problem,
            remedy: remedy.to_owned(),
        }
    }

    /// An error of the lot made from the map. Whatever has a number in the file is an obstacle there.
    fn in_lot(&self, error: ScenarioError, frame: Frame, [of_islands, of_obstacles]: &Numbers) -> LoadError {
        let ScenarioError { place, problem, remedy } = error;
        let number = match place {
            Place::Island(i) => of_islands.get(i),
            Place::Obstacle(i) => of_obstacles.get(i),
            Place::Name | Place::Boundary(_) | Place::SpeedBump(_) | Place::ReferencePath(_) => None,
        };
        let place = number.map_or_else(|| place.to_string(), |number| format!("obstacle {number}"));
        let frame = frame.explained().map_or_else(String::new, |frame| format!(" ({frame})"));
        self.fault(&place, problem + &frame, &remedy)
    }

    fn nothing_to_drive(&self) -> LoadError {
        if self.start.is_some() {
            let remedy = "add goal (or --goal x,y,deg), or for a round tour loop = true (or --loop)";
            return self.fault("route", "a start is given, but not where to drive from there".to_owned(), remedy);
        }
        let name = self.map.with_extension("lot.toml");
        let remedy = format!(
            "write start and goal, start and loop, or centre_line into {}, or give --start x,y,deg with --goal x,y,deg \
             or --loop, or --centre-line FILE, to cargo xtask generate",
            name.display()
        );
        self.fault("route", "the map does not say where to drive".to_owned(), &remedy)
    }

    fn no_route(&self, reason: NoRoute, frame: Frame, start: Pose, finish: Finish, car: &VehicleSettings) -> LoadError {
        let clearance_m = self.clearance_m();
        // Of what a lidar saw a few stray pixels may be all that is in the way.
        let or_specks =
            if is_case(&self.map) { "" } else { "leave specks out with drop_specks_m2 (--drop-specks of generate), " };
        let blocked = |place: &str, pose: Pose| {
            let problem = format!(
                "the car ({:.2} m × {:.2} m, and {clearance_m} m around it) does not stand free at {}",
                car.length_m,
                car.width_m,
                frame.said(pose.position())
            );
            let remedy =
                format!("move or turn it away from what is not drivable, {or_specks}or enlarge the lot with scale");
            self.fault(place, problem, &remedy)
        };
        // Where the route ends, by which key, and what can be moved.
        let (end, given, movable) = match finish {
            Finish::At(_) => ("goal", "goal", "start and goal"),
            Finish::Start => ("end of the loop", "start", "the start"),
        };
        match (reason, finish) {
            (NoRoute::GoalBlocked, Finish::At(goal)) => blocked("goal", goal),
            (NoRoute::GoalBlocked, Finish::Start) => {
                let end = start.advanced_along_arc(0.0, -route::LOOP_GAP_M);
                blocked(&format!("end of the loop, {} m behind its start", route::LOOP_GAP_M), end)
            }
            (NoRoute::StartBlocked, _) => blocked("start", start),
            (NoRoute::Arrived, _) => {
                self.fault("goal", "the car stands there at the start".to_owned(), "move it farther ahead")
            }
            (NoRoute::Walled { at }, Finish::At(_)) => {
                let problem = format!("the goal cannot be reached: a wall is in the way near {}", frame.said(at));
                self.fault("route", problem, "open the map there, or put start and goal on the same side of it")
            }
            (NoRoute::Walled { at }, Finish::Start) => {
                let problem = format!("there is no loop: the way back to the start ends near {}", frame.said(at));
                self.fault("route", problem, "open the map there, or give a goal instead of loop")
            }
            (NoRoute::Narrow { at, width_m }, _) => {
                let need_m = car.width_m + 2.0 * clearance_m;
                let problem = format!(
                    "the passage near {} is too narrow: about {width_m:.1} m in the lot, and the car needs {need_m:.2} m",
                    frame.said(at)
                );
                let remedy = format!("widen it, {or_specks}enlarge the lot with scale, or lower clearance_m");
                self.fault("route", problem, &remedy)
            }
            (NoRoute::Askew { at, off_deg }, _) => {
                let problem = format!(
                    "the car gets to the {end}, but at best turned {off_deg:.0}° away from it, at {}",
                    frame.said(at)
                );
                let remedy = format!(
                    "turn the {given}, or move it to where the car can turn before it; headings are degrees \
                     counter-clockwise from x"
                );
                self.fault(given, problem, &remedy)
            }
            (NoRoute::Tight { reached, to_go_m }, _) => {
                let problem = format!(
                    "no drive forwards was found: it got to {}, about {to_go_m:.0} m of the lot before the {end}. The car \
                     does not reverse, and turns with a radius of {:.1} m or more",
                    frame.said(reached),
                    route::radius_min_m(car)
                );
                let remedy = format!(
                    "widen the map there, {or_specks}turn or move {movable}, enlarge the lot with scale, or lower \
                     clearance_m"
                );
                self.fault("route", problem, &remedy)
            }
        }
    }
}

/// Checks a scenario that has no route yet. Everything else is checked before the route.
fn validate_ground(scenario: &Scenario, vehicle: &VehicleSettings) -> Result<(), ScenarioError> {
    match validate(scenario, vehicle) {
        Err(ScenarioError { place: Place::ReferencePath(_), .. }) => Ok(()),
        other => other,
    }
}

#[cfg(test)]
mod tests;
