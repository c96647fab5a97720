//! One environment: the episode that it drives, its expert and its reward.

use crate::course::Course;
use crate::reward::Reward;
use experiment::drive_digest::DriveDigest;
use experiment::drivers;
use expert::ScriptedExpert;
use sim::collision::BodyBox;
use sim::controller;
use sim::driver::{Decision, Driver as _, LookAheadPoint, Source};
use sim::episode::Episode;
use sim::frame::{Ending, Event, Frame};
use sim::seed::RootSeed;
use sim::sensing::{BEV_PIXELS, GRID_CELLS};
use sim::vehicle::VehicleCommand;

/// Cells of a grid.
pub(crate) const CELLS: usize = GRID_CELLS * GRID_CELLS;
/// Pixels of a bird's-eye view.
pub(crate) const PIXELS: usize = BEV_PIXELS * BEV_PIXELS;
/// Values of a state: speed, m/s, and road-wheel angle, radians.
pub(crate) const STATE: usize = 2;
/// Values of an action.
pub(crate) const ACTION: usize = 2;

/// What a driver is told besides its observation, value by value.
pub(crate) const INFO: [&str; 17] = [
    "near_collisions",
    "contacts",
    "stuck",
    "safe_ratio",
    "progress",
    "progress_m",
    "driven_m",
    "clearance_m",
    "clearance_min_m",
    "time_s",
    "x_m",
    "y_m",
    "heading_rad",
    "speed_mps",
    "steering_rad",
    "event",
    "episode_number",
];

/// What the two numbers of an action are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ActionKind {
    /// Look-ahead point: ahead and left of the rear axle, metres.
    LookAhead,
    /// Road-wheel angle, radians, positive to the left; speed, m/s.
    Steering,
}

/// Where the observation of one car goes. What is not asked for is `None`.
pub(crate) struct Seen<'a> {
    pub(crate) grid: &'a mut [u8],
    pub(crate) state: Option<&'a mut [f32]>,
    pub(crate) view: Option<&'a mut [u8]>,
    pub(crate) info: &'a mut [f64],
}

/// The result of an action.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Outcome {
    pub(crate) reward: f64,
    pub(crate) terminated: bool,
    pub(crate) truncated: bool,
}

/// Distance between body and non-drivable space now, metres.
fn clearance_m(episode: &Episode, body: &BodyBox) -> f32 {
    body.clearance_m(episode.map().distance_field(), episode.vehicle().pose)
}

/// One environment.
#[derive(Debug, Clone)]
pub(crate) struct Car {
    /// Seed of the episode that is next. The one under way may have another: a reset was interrupted.
    pub(crate) seed: RootSeed,
    /// Number of the episode that is next.
    pub(crate) next: u64,
    /// How many episodes on the one after it is.
    stride: u64,
    drive: Option<Drive>,
    digests: bool,
}

/// An episode under way.
#[derive(Debug, Clone)]
struct Drive {
    seed: RootSeed,
    number: u64,
    episode: Episode,
    /// Made when it is first asked.
    expert: Option<ScriptedExpert>,
    /// The expert's answer, and the tick that it is for.
    label: Option<(u32, LookAheadPoint)>,
    last: Option<Frame>,
    /// Distance between body and non-drivable space, metres: after the last tick, or where the car was put back from in it.
    clearance_m: f32,
    digest: Option<DriveDigest>,
}

impl Car {
    /// The `index`-th of `count` cars, which take the episodes in turn.
    pub(crate) fn new(seed: RootSeed, index: u64, count: u64, digests: bool) -> Self {
        Self { seed, next: index, stride: count, drive: None, digests }
    }

    /// Starts the next episode.
    ///
    /// # Errors
    /// If its lot cannot be driven.
    pub(crate) fn reset(&mut self, course: &Course) -> anyhow::Result<()> {
        let number = self.next;
        let mut episode = course.start(self.seed, number)?;
        episode.observe();
        let clearance_m = clearance_m(&episode, &course.body);
        self.next += self.stride;
        self.drive = Some(Drive {
            seed: self.seed,
            number,
            expert: None,
            label: None,
            last: None,
            clearance_m,
            digest: self.digests.then(DriveDigest::default),
            episode,
        });
        Ok(())
    }

    /// Whether an episode is under way.
    pub(crate) fn is_driving(&self) -> bool {
        self.drive.as_ref().is_some_and(|drive| drive.episode.ending().is_none())
    }

    /// The episode under way, or the one that ended last.
    pub(crate) fn episode(&self) -> Option<&Episode> {
        self.drive.as_ref().map(|drive| &drive.episode)
    }

    /// Seed and number of [`Self::episode`]; before the first one, of the next.
    pub(crate) fn place(&self) -> (RootSeed, u64) {
        self.drive.as_ref().map_or((self.seed, self.next), |drive| (drive.seed, drive.number))
    }

    /// The last tick.
    pub(crate) fn last(&self) -> Option<&Frame> {
        self.drive.as_ref().and_then(|drive| drive.last.as_ref())
    }

    /// The digest of the ticks of [`Self::episode`], if cars were to keep one.
    pub(crate) fn digest(&self) -> Option<String> {
        self.drive.as_ref()?.digest.as_ref().map(DriveDigest::hex)
    }

    /// Drives one control tick and takes the next observation.
    ///
    /// # Panics
    /// If no episode is under way, or the action is not finite.
    pub(crate) fn step(
        &mut self,
        kind: ActionKind,
        action: [f32; ACTION],
        reward: &Reward,
        course: &Course,
    ) -> Outcome {
        let drive = self.drive.as_mut().expect("an episode is under way");
        let Drive { episode, expert, last, clearance_m, digest, .. } = drive;
        let from_m = episode.progress_m();
        let frame = match kind {
            ActionKind::LookAhead => {
                let [ahead_m, left_m] = action;
                let look_ahead = LookAheadPoint { ahead_m, left_m };
                episode.apply(Decision { look_ahead, source: Source::Novice, spread: None, speed_limit_mps: None })
            }
            ActionKind::Steering => {
                let fastest_mps = episode.settings().controller.speed_max_mps;
                let [steering_rad, speed_mps] = [action[0], action[1].clamp(0.0, fastest_mps)];
                episode.apply_command(VehicleCommand { steering_rad, speed_mps }, Source::Novice)
            }
        };
        // Whoever asks for labels now and then may not ask at this very tick.
        if let Some(expert) = expert.as_mut().filter(|_| episode.was_reset()) {
            expert.reset();
        }
        // What is seen after the last tick is part of no drive; learners that bootstrap from it ask for it.
        episode.observe();
        if let Some(digest) = digest {
            digest.frame(&frame);
        }
        let gained_m = episode.progress_m() - from_m;
        // A car that was put back is free again; the frame tells how near it had come.
        *clearance_m = if episode.was_reset() { frame.clearance_m } else { self::clearance_m(episode, &course.body) };
        let reward = reward.of_tick(&frame, gained_m, *clearance_m, &episode.vehicle());
        let ending = episode.ending();
        let truncated = ending == Some(Ending::TimedOut);
        *last = Some(frame);
        Outcome { reward, terminated: ending.is_some() && !truncated, truncated }
    }

    /// The expert's answer to what is observed now, as an action. Asked at every tick, it is what the driver `expert`
    /// would answer. `None` after the end.
    pub(crate) fn label(&mut self, kind: ActionKind, course: &Course) -> Option<[f32; ACTION]> {
        let Drive { seed, number, episode, expert, label, .. } = self.drive.as_mut()?;
        if episode.ending().is_some() {
            return None;
        }
        let tick = episode.tick();
        let point = match *label {
            Some((of, point)) if of == tick => point,
            _ => {
                let settings = &course.settings;
                let seed = || course.trial(*seed, *number).episode_seed();
                let expert = expert.get_or_insert_with(|| drivers::expert(&settings.expert, &settings.episode, seed()));
                expert.decide(&episode.situation()).look_ahead
            }
        };
        *label = Some((tick, point));
        Some(match kind {
            ActionKind::LookAhead => [point.ahead_m, point.left_m],
            ActionKind::Steering => {
                let settings = episode.settings();
                let decision =
                    Decision { look_ahead: point, source: Source::Expert, spread: None, speed_limit_mps: None };
                let geometry = &settings.sensing.geometry;
                let command = controller::pursue(&settings.controller, &settings.vehicle, geometry, &decision);
                [command.steering_rad, command.speed_mps]
            }
        })
    }

    /// Where the route is, this far on, in the ego frame: ahead and left, metres.
    pub(crate) fn route_point(&self, ahead_m: f32) -> Option<[f32; 2]> {
        let episode = self.episode()?;
        let point = episode.map().path().pose_at(episode.progress_m() + ahead_m).position();
        let in_ego = episode.vehicle().pose.world_from_ego().inverse_point(point);
        Some([in_ego.x, in_ego.y])
    }

    /// Writes down what is observed now.
    pub(crate) fn write(&self, seen: &mut Seen<'_>) {
        let Some(Drive { number, episode, last, clearance_m, .. }) = &self.drive else { return };
        let (grid, vehicle) = (&episode.situation().observation.grid, episode.vehicle());
        for (row, cells) in seen.grid.chunks_exact_mut(GRID_CELLS).enumerate() {
            let bits = grid.row(row);
            for (col, cell) in cells.iter_mut().enumerate() {
                *cell = (bits >> col & 1) as u8;
            }
        }
        if let Some(state) = &mut seen.state {
            state.copy_from_slice(&[vehicle.speed_mps, vehicle.steering_rad]);
        }
        if let Some(view) = &mut seen.view {
            let perceived = episode.sensor().perceived_view(episode.map(), vehicle.pose, episode.tick());
            for (index, to) in view.iter_mut().enumerate() {
                *to = u8::from(perceived.is_occupied(index / BEV_PIXELS, index % BEV_PIXELS));
            }
        }
        let metrics = episode.metrics();
        let event = last.as_ref().map_or(0.0, |frame| match frame.event {
            Event::Drove => 0.0,
            Event::NearCollision { .. } => 1.0,
            Event::Stuck { .. } => 2.0,
            Event::ReachedEnd => 3.0,
        });
        let numbers: [f32; 15] = [
            metrics.near_collisions as f32,
            metrics.contacts as f32,
            metrics.stuck as f32,
            metrics.safe_ratio,
            episode.progress_m() / metrics.reference_m,
            episode.progress_m(),
            metrics.driven_m,
            *clearance_m,
            if last.is_some() { metrics.clearance_min_m } else { f32::NAN },
            metrics.duration_s,
            vehicle.pose.x_m,
            vehicle.pose.y_m,
            vehicle.pose.heading_rad,
            vehicle.speed_mps,
            vehicle.steering_rad,
        ];
        for (to, number) in seen.info.iter_mut().zip(numbers) {
            *to = f64::from(number);
        }
        seen.info[15..].copy_from_slice(&[event, *number as f64]);
    }
}
