//! `HG-DAgger`: a person watches and takes over at will (Kelly et al. 2019, "`HG-DAgger`: Interactive Imitation Learning
//! with Human Experts"). The scripted expert is the person; what its will is, is written down here.
//!
//! It watches the ground, not the network: the body of the car is swept along the arc to the network's point, at the
//! present speed. Below `takeover_s` to a near-collision there, for `reaction_s` on end, it takes the wheel; it hands it
//! back once the network's arc has been free for `release_s` of driving during `hold_s` on end.

use crate::decision_rule::gate::{Gate, GateTick, Wheel};
use serde::{Deserialize, Serialize};
use sim::collision::BodyBox;
use sim::episode::EpisodeSettings;

/// Settings of `HG-DAgger`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct HgDaggerSettings {
    /// The expert takes over where the network's arc is free for less than this, seconds …
    pub takeover_s: f32,
    /// … for as long as a person needs to react, seconds.
    pub reaction_s: f32,
    /// It hands back where the network's arc is free for at least this, seconds …
    pub release_s: f32,
    /// … during this time, seconds.
    pub hold_s: f32,
}

impl Default for HgDaggerSettings {
    /// 1.5 s: encounters with less time to a collision are critical (van der Horst and Hogema 1993). 0.75 s: braking at
    /// an expected signal (Green 2000). 2.0 s: less than the 2.24 s ahead at which the expert's own points lie. 1.0 s:
    /// chosen.
    fn default() -> Self {
        Self { takeover_s: 1.5, reaction_s: 0.75, release_s: 2.0, hold_s: 1.0 }
    }
}

impl HgDaggerSettings {
    pub(crate) fn gate(self, episode: &EpisodeSettings) -> HgDaggerGate {
        HgDaggerGate {
            settings: self,
            episode: episode.clone(),
            body: BodyBox::new(&episode.vehicle),
            wheel: Wheel::default(),
            critical_s: 0.0,
            free_s: 0.0,
        }
    }
}

pub(crate) struct HgDaggerGate {
    settings: HgDaggerSettings,
    episode: EpisodeSettings,
    body: BodyBox,
    wheel: Wheel,
    /// How long the network's arc has been critical, and how long it has been free.
    critical_s: f32,
    free_s: f32,
}

impl HgDaggerGate {
    /// Whether the car could drive on along the network's arc without a near-collision, for some seconds.
    fn is_free(&self, tick: &GateTick<'_>, ahead_s: f32) -> bool {
        let truth = &tick.situation.truth;
        let (metrics, slowest_mps) = (&self.episode.metrics, self.episode.controller.speed_min_mps);
        let travel_m = truth.vehicle.speed_mps.max(slowest_mps) * ahead_s + metrics.near_collision_m;
        let (distance, collision) = (truth.map.distance_field(), truth.map.collision());
        let curvature_per_m = tick.novice.curvature_per_m();
        !self.body.sweep_hits(distance, collision, metrics.obstacle_set, truth.vehicle.pose, curvature_per_m, travel_m)
    }
}

impl Gate for HgDaggerGate {
    fn trusts_novice(&mut self, tick: &GateTick<'_>) -> bool {
        let HgDaggerSettings { takeover_s, reaction_s, release_s, hold_s } = self.settings;
        let lasts = |holds: bool, so_far_s: f32| if holds { so_far_s + self.episode.control_period_s() } else { 0.0 };
        let critical_s = lasts(!self.is_free(tick, takeover_s), self.critical_s);
        let free_s = lasts(self.is_free(tick, release_s), self.free_s);
        (self.critical_s, self.free_s) = (critical_s, free_s);
        // In whole ticks: sums of 0.05 s are not exact.
        let is_over = |duration_s: f32, limit_s: f32| duration_s > limit_s - 0.5 * self.episode.control_period_s();
        let takes = critical_s > 0.0 && is_over(critical_s, reaction_s);
        self.wheel.turn(takes, free_s > 0.0 && is_over(free_s, hold_s))
    }

    fn reset(&mut self) {
        (self.wheel, self.critical_s, self.free_s) = (Wheel::default(), 0.0, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decision_rule::evidence::Evidence;
    use crate::decision_rule::test_ticks::{with_car_at, with_situation};
    use sim::driver::LookAheadPoint;

    /// In a straight lane a point straight ahead is safe, one at full lock drives into the kerb.
    #[test]
    fn the_expert_takes_over_after_its_reaction_and_hands_back_after_a_while() {
        let episode = EpisodeSettings::paper();
        let mut gate = HgDaggerSettings::default().gate(&episode);
        let evidence = Evidence { discrepancy: 0.0, doubt: [0.0; 2], disagreement: 0.0, alarm: 0.0 };
        let mut novice_ticks = |ticks: u32, left_m: f32| {
            with_situation(&episode, |situation| {
                let tick = GateTick { evidence, novice: LookAheadPoint { ahead_m: 4.5, left_m }, situation };
                (0..ticks).filter(|_| gate.trusts_novice(&tick)).count()
            })
        };
        assert_eq!(novice_ticks(40, 0.0), 40, "nothing is wrong");
        assert_eq!(novice_ticks(40, 4.5), 14, "0.75 s are 15 ticks, in the last of which the expert drives");
        assert_eq!(novice_ticks(40, 0.0), 21, "1.0 s are 20 ticks, in the last of which the network drives");
    }

    /// At 1.4 m/s, with the 0.5 m of a near-collision: 2.6 m in 1.5 s are critical, 3.3 m in 2.0 s are free. In between nothing
    /// changes hands.
    #[test]
    fn what_is_critical_and_what_is_free_lie_apart_and_a_reset_forgets_both() {
        let episode = EpisodeSettings::paper();
        let evidence = Evidence { discrepancy: 0.0, doubt: [0.0; 2], disagreement: 0.0, alarm: 0.0 };
        // The bumper so far from the wall at the end of the lane, the network straight on.
        let novice_ticks = |gate: &mut HgDaggerGate, ticks: u32, gap_m: f32| {
            with_car_at(56.0 - gap_m - episode.vehicle.front_m(), &episode, |situation| {
                let tick = GateTick { evidence, novice: LookAheadPoint { ahead_m: 8.0, left_m: 0.0 }, situation };
                (0..ticks).filter(|_| gate.trusts_novice(&tick)).count()
            })
        };
        let mut gate = HgDaggerSettings::default().gate(&episode);
        assert_eq!(novice_ticks(&mut gate, 40, 2.7), 40, "not critical");
        assert_eq!(novice_ticks(&mut gate, 40, 2.5), 14, "critical: the expert drives from the 15th tick on");
        assert_eq!(novice_ticks(&mut gate, 40, 3.2), 0, "not critical any more, but not free");
        assert_eq!(novice_ticks(&mut gate, 40, 3.4), 21, "free: the network drives from the 20th tick on");
        assert_eq!(novice_ticks(&mut gate, 10, 2.5), 10, "half of the expert's reaction");
        gate.reset();
        assert_eq!(novice_ticks(&mut gate, 40, 2.5), 14, "it begins anew");
        gate.reset();
        assert_eq!(novice_ticks(&mut gate, 5, 2.7), 5, "put back, the network drives");
    }
}
