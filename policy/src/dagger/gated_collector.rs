//! Algorithm 2, the data-sampling function: who drives this tick, and what is written down.

use super::disturbance::Disturbance;
use crate::dataset::{Round, Sample};
use crate::decision_rule::{DecisionRule, Evidence};
use crate::drivers::{Novice, novice_decision};
use crate::network::Predictor;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sim::driver::{Decision, Driver, Fleet, GroundTruth, Seat};
use sim::sensing::{GridGeometry, OccupancyGrid, Sensor};

/// Which labelled ticks enter the data set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Keep {
    /// Those the expert drove (paper).
    ExpertTicks,
    /// All, as in the original `DAgger` and `EnsembleDAgger`.
    EveryTick,
}

/// Novice and expert at the wheel of every seat of a batch.
pub struct GatedCollector {
    novice: Option<Novice>,
    experts: Vec<Box<dyn Driver + Send>>,
    rule: DecisionRule,
    keep: Keep,
    geometry: GridGeometry,
    /// `D_i`, by seat.
    seats: Vec<SeatRecord>,
    n_tot: u64,
    n_net: u64,
    tau_hat_sum: f64,
}

/// What is written down at one seat.
#[derive(Default)]
struct SeatRecord {
    samples: Vec<Sample>,
    /// Look at the scenes of the samples, too.
    augmenting_sensors: Vec<Sensor>,
    noise_augmentations: Vec<OccupancyGrid>,
    /// Nudges whoever drives.
    disturbance: Option<Disturbance>,
    /// Decisions so far.
    ticks: u32,
}

impl SeatRecord {
    /// Line 15, and further looks at the same scene.
    fn keep(&mut self, sample: Sample, truth: &GroundTruth<'_>) {
        self.samples.push(sample);
        let looks = self
            .augmenting_sensors
            .iter_mut()
            .map(|sensor| sensor.observe(truth.map, truth.vehicle.pose, self.ticks).grid);
        self.noise_augmentations.extend(looks);
    }
}

/// What Algorithm 2 returns.
#[derive(Debug, Clone, PartialEq)]
pub struct Collected {
    /// `D_i`: seat by seat, in order of time within a seat.
    pub round: Round,
    /// Executed actions.
    pub n_tot: u64,
    /// Executed actions of the network.
    pub n_net: u64,
    /// Sum of τ̂ over all ticks, stored or not.
    pub tau_hat_sum: f64,
}

impl GatedCollector {
    /// One expert per seat. Without a novice the experts drive and every tick is kept: behaviour cloning.
    pub fn new(
        novice: Option<Predictor>,
        experts: Vec<Box<dyn Driver + Send>>,
        rule: DecisionRule,
        keep: Keep,
        geometry: GridGeometry,
    ) -> Self {
        let seats = experts.iter().map(|_| SeatRecord::default()).collect(); // line 2: D_i ← ∅
        let novice = novice.map(|predictor| Novice::new(predictor, geometry));
        Self { novice, experts, rule, keep, geometry, seats, n_tot: 0, n_net: 0, tau_hat_sum: 0.0 } // line 3
    }

    /// Sensors of every seat that look at the kept ticks, too.
    #[must_use]
    pub fn with_augmenting_sensors(mut self, augmenting_sensors: Vec<Vec<Sensor>>) -> Self {
        for (seat, augmenting_sensors) in self.seats.iter_mut().zip(augmenting_sensors) {
            seat.augmenting_sensors = augmenting_sensors;
        }
        self
    }

    /// Nudges for the wheel of every seat.
    #[must_use]
    pub(super) fn with_disturbances(mut self, disturbances: Vec<Disturbance>) -> Self {
        for (seat, disturbance) in self.seats.iter_mut().zip(disturbances) {
            seat.disturbance = Some(disturbance);
        }
        self
    }

    /// Line 20. Samples are joined in the order of the seats.
    pub fn into_collected(self) -> Collected {
        let mut round = Round::default();
        for seat in self.seats {
            round.samples.extend(seat.samples);
            round.noise_augmentations.extend(seat.noise_augmentations);
        }
        Collected { round, n_tot: self.n_tot, n_net: self.n_net, tau_hat_sum: self.tau_hat_sum }
    }

    /// Line 6, for all seats at once; each expert sees only its own seat.
    fn ask_experts(&mut self, seats: &[Seat<'_>]) -> Vec<Decision> {
        at_seats(&mut self.experts, seats)
            .par_iter_mut()
            .map(|(expert, seat)| {
                if seat.was_reset {
                    expert.reset();
                }
                expert.decide(&seat.situation)
            })
            .collect()
    }

    /// Line 15 for all seats at once, with further looks.
    fn write_down(&mut self, seats: &[Seat<'_>], kept: &[Option<Sample>]) {
        at_seats(&mut self.seats, seats).par_iter_mut().zip(kept).for_each(|((record, seat), kept)| {
            if let Some(sample) = *kept {
                record.keep(sample, &seat.situation.truth);
            }
            record.ticks += 1;
        });
    }
}

/// What belongs to the episodes that wait for a decision, of what there is one of for every episode.
fn at_seats<'a, 's, T>(of_episodes: &'a mut [T], seats: &'a [Seat<'s>]) -> Vec<(&'a mut T, &'a Seat<'s>)> {
    let mut waiting = seats.iter().peekable();
    let found = of_episodes
        .iter_mut()
        .enumerate()
        .filter_map(|(episode, item)| Some((item, waiting.next_if(|seat| seat.episode == episode)?)))
        .collect();
    assert!(waiting.peek().is_none(), "seats come in the order of their episodes, one at most of each");
    found
}

impl Fleet for GatedCollector {
    fn decide(&mut self, seats: &[Seat<'_>], decisions: &mut Vec<Decision>) {
        let first = decisions.len();
        let predictions = self.novice.as_mut().map(|novice| novice.answers(seats)); // line 5
        let expert_decisions = self.ask_experts(seats); // line 6
        let mut kept: Vec<Option<Sample>> = Vec::with_capacity(seats.len());
        for (index, (seat, expert)) in seats.iter().zip(expert_decisions).enumerate() {
            let a_exp = expert.look_ahead.to_image_fraction(&self.geometry).map(|fraction| fraction.clamp(0.0, 1.0));
            let grid = seat.situation.observation.grid;
            self.n_tot += 1; // line 17
            let Some(predicted) = predictions.as_ref().map(|predictions| predictions[index]) else {
                kept.push(Some(Sample { grid, label: a_exp, tau_hat: 0.0 }));
                decisions.push(expert);
                continue;
            };
            let evidence = Evidence::new(&predicted, a_exp); // lines 7 and 8
            self.tau_hat_sum += f64::from(evidence.discrepancy);
            let trusts_novice = self.rule.trusts_novice(&evidence); // line 9
            if trusts_novice {
                decisions.push(novice_decision(&predicted, self.geometry)); // line 10
                self.n_net += 1; // line 11
            } else {
                decisions.push(expert); // line 14
            }
            // Line 15. τ̂ is a distance within the unit square, up to √2; the weight is meant for 0…1.
            let tau_hat = evidence.discrepancy.min(1.0);
            let is_kept = !trusts_novice || self.keep == Keep::EveryTick;
            kept.push(is_kept.then_some(Sample { grid, label: a_exp, tau_hat }));
        }
        self.write_down(seats, &kept);
        for (seat, decision) in seats.iter().zip(&mut decisions[first..]) {
            if let Some(disturbance) = &mut self.seats[seat.episode].disturbance {
                decision.look_ahead = disturbance.disturb(decision.look_ahead);
            }
        }
    }
}
