//! Many episodes in lock-step.

use crate::driver::{Decision, Fleet};
use crate::episode::{Episode, EpisodeReport};
use crate::frame::Frame;
use rayon::prelude::*;
use std::ops::ControlFlow;

/// Drives episodes in lock-step until all have ended. Each tick is one call of the fleet for all that still run.
///
/// Reports come in the order of the episodes. `on_frame(episode, frame)` is called in that order within a tick.
pub fn run_lockstep(
    episodes: Vec<Episode>,
    fleet: &mut dyn Fleet,
    on_frame: &mut dyn FnMut(usize, &Frame),
) -> Vec<EpisodeReport> {
    let reports = run_lockstep_until(episodes, fleet, &mut |episode, frame| {
        on_frame(episode, frame);
        ControlFlow::Continue(())
    });
    reports.into_iter().map(|report| report.expect("nothing stopped them")).collect()
}

/// Like [`run_lockstep`], but stops all episodes after the tick in which `on_frame` breaks. `None` stands for an episode
/// that had not ended by then.
pub fn run_lockstep_until(
    mut episodes: Vec<Episode>,
    fleet: &mut dyn Fleet,
    on_frame: &mut dyn FnMut(usize, &Frame) -> ControlFlow<()>,
) -> Vec<Option<EpisodeReport>> {
    let mut decisions: Vec<Decision> = Vec::with_capacity(episodes.len());
    let mut frames: Vec<(usize, Frame)> = Vec::with_capacity(episodes.len());
    loop {
        let mut running: Vec<(usize, &mut Episode)> =
            episodes.iter_mut().enumerate().filter(|(_, episode)| episode.ending().is_none()).collect();
        if running.is_empty() {
            break;
        }
        running.par_iter_mut().for_each(|(_, episode)| episode.observe());
        let seats: Vec<_> = running.iter().map(|(index, episode)| episode.seat(*index)).collect();
        decisions.clear();
        fleet.decide(&seats, &mut decisions);
        assert_eq!(decisions.len(), seats.len(), "a fleet answers every seat");
        drop(seats);
        running
            .par_iter_mut()
            .zip(&decisions)
            .map(|((index, episode), &decision)| (*index, episode.apply(decision)))
            .collect_into_vec(&mut frames);
        // Every frame of the tick is passed on, even after a break: callers never see half a tick.
        if frames.iter().filter(|(index, frame)| on_frame(*index, frame).is_break()).count() > 0 {
            break;
        }
    }
    episodes.iter().map(|episode| episode.ending().map(|_| episode.report())).collect()
}
