//! Watches episodes as they are driven, and keeps what is needed to explain a near-collision: how the car got there.

use sim::episode::EpisodeSettings;
use sim::frame::{Event, Frame};
use sim::geometry::Pose;
use sim::metrics::steering_reversals;
use sim::vehicle::VehicleState;
use std::collections::VecDeque;

/// How long before a near-collision the driving can be changed, seconds, the longest first (chosen).
pub const LOOK_BACKS_S: [f32; 7] = [24.0, 12.0, 6.0, 3.0, 2.0, 1.0, 0.5];
/// The one of [`LOOK_BACKS_S`] that decides what a near-collision hangs on: 6 s are about the 8 m in which the place comes
/// into view.
pub const LOOK_BACK: usize = 2;
/// Steering reversals are counted over the last seconds (chosen).
pub const OSCILLATION_S: f32 = 5.0;

/// Where the car was before a near-collision.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Before {
    /// The car.
    pub vehicle: VehicleState,
    /// Along the route, metres.
    pub progress_m: f32,
    /// How long before, seconds.
    pub before_s: f32,
    /// How much longer nothing was counted after a resume, seconds.
    pub refractory_s: f32,
}

/// A near-collision when it happened.
#[derive(Debug, Clone, Copy)]
pub struct Incident {
    /// Index of the episode within its group.
    pub episode: usize,
    /// Control tick.
    pub tick: u32,
    /// Rear-axle pose when it was counted.
    pub at: Pose,
    /// Along the route, metres.
    pub route_m: f32,
    /// Speed at the last observation, m/s.
    pub speed_mps: f32,
    /// Steering reversals in the last [`OSCILLATION_S`], but not before the last resume.
    pub reversals_before: u32,
    /// Route since the car was last put back on it after a near-collision, metres; `None` before the first one.
    pub since_resume_m: Option<f32>,
    /// The state at each of [`LOOK_BACKS_S`], but no earlier than the last resume or the start.
    pub before: [Before; LOOK_BACKS_S.len()],
}

/// Where along the route an episode was put back after a near-collision. That it is also put back where it was stuck does not
/// make what follows one more failure at a place where it had failed before.
#[derive(Debug, Clone, Copy)]
enum Resume {
    /// It never was.
    Never,
    /// The next frame shows where.
    Due,
    /// The last time, metres.
    At(f32),
}

/// Remembers the last seconds of every episode of a group; its size does not depend on how long they last.
#[derive(Debug)]
pub struct IncidentMonitor {
    control_period_s: f32,
    refractory_s: f32,
    recent: Vec<VecDeque<(VehicleState, f32)>>,
    /// Per episode, frames since it was last put back, after whatever; `None` before the first time.
    since_put_back: Vec<Option<usize>>,
    resumes: Vec<Resume>,
    incidents: Vec<Incident>,
}

impl IncidentMonitor {
    /// A monitor of this many episodes.
    pub fn new(episodes: usize, episode: &EpisodeSettings) -> Self {
        let control_period_s = episode.control_period_s();
        let kept = ticks(LOOK_BACKS_S[0], control_period_s) + 1;
        Self {
            control_period_s,
            refractory_s: episode.metrics.refractory_s,
            recent: vec![VecDeque::with_capacity(kept); episodes],
            since_put_back: vec![None; episodes],
            resumes: vec![Resume::Never; episodes],
            incidents: Vec::new(),
        }
    }

    /// Adds one frame.
    pub fn frame(&mut self, episode: usize, frame: &Frame) {
        let (recent, resume) = (&mut self.recent[episode], &mut self.resumes[episode]);
        let since_put_back = &mut self.since_put_back[episode];
        if matches!(resume, Resume::Due) {
            *resume = Resume::At(frame.progress_m);
        }
        if recent.len() > ticks(LOOK_BACKS_S[0], self.control_period_s) {
            recent.pop_front();
        }
        recent.push_back((frame.vehicle, frame.progress_m));
        *since_put_back = since_put_back.map(|frames| frames + 1);
        if let Event::NearCollision { at, progress_m } = frame.event {
            let before = |look_back_s| {
                let before = before(recent, look_back_s, self.control_period_s);
                let after_s = |frames: usize| frames as f32 * self.control_period_s - before.before_s;
                let refractory_s = since_put_back.map_or(0.0, |frames| (self.refractory_s - after_s(frames)).max(0.0));
                Before { refractory_s, ..before }
            };
            let last = recent.iter().skip(recent.len().saturating_sub(ticks(OSCILLATION_S, self.control_period_s)));
            self.incidents.push(Incident {
                episode,
                tick: frame.tick,
                at,
                route_m: progress_m,
                speed_mps: frame.vehicle.speed_mps,
                reversals_before: steering_reversals(last.map(|(vehicle, _)| vehicle.steering_rad)),
                since_resume_m: match *resume {
                    Resume::At(resumed_at_m) => Some(progress_m - resumed_at_m),
                    Resume::Never | Resume::Due => None,
                },
                before: LOOK_BACKS_S.map(before),
            });
            *resume = Resume::Due;
        }
        if matches!(frame.event, Event::NearCollision { .. } | Event::Stuck { .. }) {
            recent.clear();
            *since_put_back = Some(0);
        }
    }

    /// The near-collisions seen, episode by episode.
    pub fn into_incidents(mut self) -> Vec<Incident> {
        self.incidents.sort_by_key(|incident| (incident.episode, incident.tick));
        self.incidents
    }
}

fn ticks(seconds: f32, control_period_s: f32) -> usize {
    (seconds / control_period_s).round() as usize
}

/// The state so long before the last one, or the first; as if the car had never been put back.
fn before(recent: &VecDeque<(VehicleState, f32)>, look_back_s: f32, control_period_s: f32) -> Before {
    let index = recent.len().saturating_sub(ticks(look_back_s, control_period_s) + 1);
    let (vehicle, progress_m) = recent[index];
    Before { vehicle, progress_m, before_s: (recent.len() - index) as f32 * control_period_s, refractory_s: 0.0 }
}

#[cfg(test)]
mod tests;
