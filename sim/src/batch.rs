//! Many episodes in lock-step.
//!
//! A fleet that answers for cars together is called once per tick ([`run_lockstep`]). Where the cars can be parted, each
//! part with a fleet of its own ([`run_fleets`]), threads meet once in many ticks instead. Observers see no difference.

use crate::driver::{Decision, Fleet};
use crate::episode::{Episode, EpisodeReport};
use crate::frame::Frame;
use crate::vehicle::VehicleState;
use rayon::prelude::*;
use std::ops::ControlFlow;

/// A value that is not finite, and that would have been driven with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("episode {episode}, tick {tick}: {what} is not a finite number")]
pub struct NotFinite {
    /// Index of the episode among those of all fleets.
    pub episode: usize,
    /// Its control tick, from 0.
    pub tick: u32,
    /// The driver's answer, or the state of the car after the tick.
    pub what: &'static str,
}

/// Drives episodes in lock-step until all have ended. Each tick is one call of the fleet for all that still run.
///
/// Reports come in the order of the episodes. `on_frame(episode, frame)` is called in that order within a tick.
///
/// # Errors
/// If an answer of the fleet is not finite, or the state of a car after a tick.
///
/// # Panics
/// If the fleet answers for more or fewer cars than it is asked for.
pub fn run_lockstep(
    episodes: Vec<Episode>,
    fleet: &mut dyn Fleet,
    on_frame: &mut dyn FnMut(usize, &Frame),
) -> Result<Vec<EpisodeReport>, NotFinite> {
    let reports = run_lockstep_until(episodes, fleet, &mut |episode, frame| {
        on_frame(episode, frame);
        ControlFlow::Continue(())
    })?;
    Ok(all_of(reports))
}

fn all_of(reports: Vec<Option<EpisodeReport>>) -> Vec<EpisodeReport> {
    reports.into_iter().map(|report| report.expect("nothing stopped them")).collect()
}

/// Like [`run_lockstep`], but stops all episodes after the tick in which `on_frame` breaks. `None` stands for an episode
/// that had not ended by then.
///
/// # Errors
/// See [`run_lockstep`].
pub fn run_lockstep_until(
    mut episodes: Vec<Episode>,
    fleet: &mut dyn Fleet,
    on_frame: &mut dyn FnMut(usize, &Frame) -> ControlFlow<()>,
) -> Result<Vec<Option<EpisodeReport>>, NotFinite> {
    let mut decisions: Vec<Decision> = Vec::with_capacity(episodes.len());
    let mut frames: Vec<(usize, Frame)> = Vec::with_capacity(episodes.len());
    let mut running = running(&mut episodes);
    running.par_iter_mut().for_each(|(_, episode)| episode.observe());
    while !running.is_empty() {
        decide(&running, fleet, &mut decisions)?;
        // Each car takes its next observation at once, so that threads meet once per tick.
        running
            .par_iter_mut()
            .zip(&decisions)
            .map(|((index, episode), &decision)| {
                let frame = episode.apply(decision);
                if episode.ending().is_none() {
                    episode.observe();
                }
                (*index, frame)
            })
            .collect_into_vec(&mut frames);
        for ((index, episode), (_, frame)) in running.iter().zip(&frames) {
            check_state(*index, frame.tick, episode.vehicle())?;
        }
        // Every frame of the tick is passed on, even after a break: callers never see half a tick.
        if frames.iter().filter(|(index, frame)| on_frame(*index, frame).is_break()).count() > 0 {
            break;
        }
        running.retain(|(_, episode)| episode.ending().is_none());
    }
    Ok(episodes.iter().map(Episode::report).collect())
}

/// Cars and the fleet that drives them, and them only.
pub struct SeatedFleet {
    fleet: Box<dyn Fleet + Send>,
    episodes: Vec<Episode>,
    /// The index of each of them among the episodes of all fleets.
    indices: Vec<usize>,
    /// For each tick since they were last passed on, a frame of each car that drove, with its index among all.
    frames: [Vec<(usize, Frame)>; TICKS_AT_ONCE],
    /// What ended its drive, and the place of its tick among those of `frames`.
    refused: Option<(usize, NotFinite)>,
}

/// Ticks that a fleet drives before its frames are passed on.
const TICKS_AT_ONCE: usize = 16;

impl SeatedFleet {
    /// A fleet in the cars of some episodes, each with its index among those of all fleets. The fleet knows each by its
    /// place among its own.
    pub fn new(fleet: Box<dyn Fleet + Send>, episodes: Vec<(usize, Episode)>) -> Self {
        let (indices, episodes) = episodes.into_iter().unzip();
        Self { fleet, episodes, indices, frames: Default::default(), refused: None }
    }

    /// Seats fleets in all cars, each in up to `cars_each` of them. `fleet` is called with the indices of its cars.
    ///
    /// Cars are dealt out one by one: neighbours are often of the same lot, and so the fleets end at about the same time.
    ///
    /// # Panics
    /// If `cars_each` is 0.
    pub fn in_all(
        episodes: Vec<Episode>,
        cars_each: usize,
        mut fleet: impl FnMut(&[usize]) -> Box<dyn Fleet + Send>,
    ) -> Vec<Self> {
        let fleets = episodes.len().div_ceil(cars_each);
        let mut dealt: Vec<Vec<(usize, Episode)>> = (0..fleets).map(|_| Vec::with_capacity(cars_each)).collect();
        for (index, episode) in episodes.into_iter().enumerate() {
            dealt[index % fleets].push((index, episode));
        }
        let seated = |episodes: Vec<(usize, Episode)>| {
            let cars: Vec<usize> = episodes.iter().map(|(index, _)| *index).collect();
            Self::new(fleet(&cars), episodes)
        };
        dealt.into_iter().map(seated).collect()
    }

    /// The cars with their indices among those of all fleets.
    fn cars(&self) -> impl Iterator<Item = (&usize, &Episode)> {
        self.indices.iter().zip(&self.episodes)
    }

    /// Drives on for [`TICKS_AT_ONCE`], or until all have ended or something is refused.
    fn drive(&mut self) {
        let Self { fleet, episodes, indices, frames, refused } = self;
        let mut decisions: Vec<Decision> = Vec::with_capacity(episodes.len());
        let mut running = running(episodes);
        frames.iter_mut().for_each(Vec::clear);
        for (place, of_tick) in frames.iter_mut().enumerate() {
            for (_, episode) in &mut running {
                episode.observe();
            }
            if let Err(found) = decide(&running, &mut **fleet, &mut decisions) {
                *refused = Some((place, NotFinite { episode: indices[found.episode], ..found }));
                return;
            }
            for ((car, episode), &decision) in running.iter_mut().zip(&decisions) {
                let frame = episode.apply(decision);
                if let Err(found) = check_state(indices[*car], frame.tick, episode.vehicle()) {
                    *refused = Some((place, found));
                    return;
                }
                of_tick.push((indices[*car], frame));
            }
            running.retain(|(_, episode)| episode.ending().is_none());
        }
    }
}

/// Drives fleets in lock-step until all episodes have ended. Episodes are ordered by their index among those of all
/// fleets; otherwise as [`run_lockstep`].
///
/// # Errors
/// See [`run_lockstep`].
pub fn run_fleets(
    fleets: Vec<SeatedFleet>,
    on_frame: &mut dyn FnMut(usize, &Frame),
) -> Result<Vec<EpisodeReport>, NotFinite> {
    let reports = run_fleets_until(fleets, &mut |episode, frame| {
        on_frame(episode, frame);
        ControlFlow::Continue(())
    })?;
    Ok(all_of(reports))
}

/// Like [`run_fleets`], but stops as [`run_lockstep_until`] does.
///
/// # Errors
/// See [`run_lockstep`].
pub fn run_fleets_until(
    mut fleets: Vec<SeatedFleet>,
    on_frame: &mut dyn FnMut(usize, &Frame) -> ControlFlow<()>,
) -> Result<Vec<Option<EpisodeReport>>, NotFinite> {
    // Fleets may drive on beyond the tick in which `on_frame` breaks; only frames that were passed on count.
    let mut passed_on: Vec<u32> = vec![0; fleets.iter().map(|fleet| fleet.episodes.len()).sum()];
    for (&index, episode) in fleets.iter().flat_map(SeatedFleet::cars) {
        passed_on[index] = episode.tick();
    }
    'driving: loop {
        fleets.par_iter_mut().for_each(SeatedFleet::drive);
        let mut of_tick: Vec<&(usize, Frame)> = Vec::with_capacity(passed_on.len());
        for place in 0..TICKS_AT_ONCE {
            // A fleet may have driven into it beyond the tick in which `on_frame` breaks: it counts when its tick has come.
            let refused = fleets.iter().filter_map(|fleet| fleet.refused.filter(|(at, _)| *at == place));
            if let Some((_, first)) = refused.min_by_key(|(_, found)| (found.tick, found.episode)) {
                return Err(first);
            }
            of_tick.clear();
            of_tick.extend(fleets.iter().flat_map(|fleet| &fleet.frames[place]));
            of_tick.sort_by_key(|(index, _)| *index);
            let mut is_over = of_tick.is_empty();
            for (index, frame) in &of_tick {
                is_over |= on_frame(*index, frame).is_break();
                passed_on[*index] += 1;
            }
            if is_over {
                break 'driving;
            }
        }
    }
    let mut reports: Vec<Option<EpisodeReport>> = vec![None; passed_on.len()];
    for (&index, episode) in fleets.iter().flat_map(SeatedFleet::cars) {
        reports[index] = episode.report().filter(|_| episode.tick() == passed_on[index]);
    }
    Ok(reports)
}

/// The episodes that have not ended, with their indices.
fn running(episodes: &mut [Episode]) -> Vec<(usize, &mut Episode)> {
    episodes.iter_mut().enumerate().filter(|(_, episode)| episode.ending().is_none()).collect()
}

/// Asks a fleet for the decisions of cars that have observed.
fn decide(
    cars: &[(usize, &mut Episode)],
    fleet: &mut dyn Fleet,
    decisions: &mut Vec<Decision>,
) -> Result<(), NotFinite> {
    let seats: Vec<_> = cars.iter().map(|(index, episode)| episode.seat(*index)).collect();
    decisions.clear();
    if !seats.is_empty() {
        fleet.decide(&seats, decisions);
    }
    assert_eq!(decisions.len(), seats.len(), "a fleet answers every seat");
    match decisions.iter().position(|decision| !decision.is_finite()) {
        Some(at) => {
            let (index, episode) = &cars[at];
            Err(NotFinite { episode: *index, tick: episode.tick(), what: "the driver's answer" })
        }
        None => Ok(()),
    }
}

/// Refuses a tick after which the car is nowhere.
fn check_state(episode: usize, tick: u32, at: VehicleState) -> Result<(), NotFinite> {
    let state = [at.pose.x_m, at.pose.y_m, at.pose.heading_rad, at.speed_mps, at.steering_rad];
    if state.iter().all(|value| value.is_finite()) {
        return Ok(());
    }
    Err(NotFinite { episode, tick, what: "the state of the car" })
}
