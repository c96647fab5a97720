//! Any fleet of drivers behind filters.

use crate::filter::SafetyFilter;
use crate::settings::SafetySettings;
use sim::driver::{Decision, Fleet, Seat};
use sim::episode::EpisodeSettings;

/// A fleet whose answers pass a filter in each car.
pub struct FilteredFleet {
    inner: Box<dyn Fleet + Send>,
    /// By episode.
    filters: Vec<SafetyFilter>,
}

impl FilteredFleet {
    /// Puts filters before a fleet in this many cars.
    pub fn new(
        inner: Box<dyn Fleet + Send>,
        settings: &SafetySettings,
        episode: &EpisodeSettings,
        cars: usize,
    ) -> Self {
        Self { inner, filters: vec![SafetyFilter::new(settings, episode); cars] }
    }
}

impl Fleet for FilteredFleet {
    fn decide(&mut self, seats: &[Seat<'_>], decisions: &mut Vec<Decision>) {
        let first = decisions.len();
        self.inner.decide(seats, decisions);
        for (seat, decision) in seats.iter().zip(&mut decisions[first..]) {
            let filter = &mut self.filters[seat.episode];
            if seat.was_reset {
                filter.reset();
            }
            *decision = filter.filtered(seat.situation.observation, *decision);
        }
    }
}
