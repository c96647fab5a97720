//! Algorithm 2, the data-sampling function: who drives this tick, and which ticks are kept.

use crate::dagger::critic;
use crate::dagger::disturbance::Disturbance;
use crate::dataset::Sample;
use crate::decision_rule::{Evidence, Gate, GateTick};
use crate::drivers::{Novice, novice_decision};
use crate::network::{Prediction, Predictor};
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

/// Novice and expert at the wheel of every seat of a batch. Without a novice the experts drive and every tick is kept:
/// behaviour cloning.
pub(crate) struct GatedCollector {
    pub(crate) novice: Option<Novice>,
    /// Warns of states that the network does not master.
    pub(crate) critic: Option<Predictor>,
    pub(crate) keep: Keep,
    pub(crate) geometry: GridGeometry,
    /// Seats by episode.
    pub(crate) seats: Vec<CollectorSeat>,
    /// Executed actions.
    pub(crate) n_tot: u64,
    /// Executed actions of the network.
    pub(crate) n_net: u64,
    /// Sum of τ̂ over all ticks, kept or not.
    pub(crate) tau_hat_sum: f64,
    /// Times the expert took the wheel.
    pub(crate) interventions: u64,
}

/// What belongs to one episode.
pub(crate) struct CollectorSeat {
    pub(crate) expert: Box<dyn Driver + Send>,
    /// Decides who drives.
    pub(crate) gate: Box<dyn Gate>,
    /// Each observes the scene of every sample with noise of its own.
    pub(crate) augmenting_sensors: Vec<Sensor>,
    /// Disturbs whoever drives.
    pub(crate) disturbance: Option<Disturbance>,
    /// What was kept so far: `D_i` of this seat.
    pub(crate) kept: Kept,
    /// τ̂ and the label of every tick, kept or not; nothing in behaviour cloning.
    pub(crate) answers: Vec<(f32, [f32; 2])>,
    /// Whether the expert drove the last tick.
    is_experts: bool,
    /// Decisions so far.
    ticks: u32,
}

/// The kept ticks of one episode.
#[derive(Default)]
pub(crate) struct Kept {
    pub(crate) samples: Vec<Sample>,
    /// Which decisions they were, counted from 0.
    pub(crate) ticks: Vec<u32>,
    pub(crate) noise_augmentations: Vec<OccupancyGrid>,
}

impl CollectorSeat {
    pub(crate) fn new(
        expert: Box<dyn Driver + Send>,
        gate: Box<dyn Gate>,
        augmenting_sensors: Vec<Sensor>,
        disturbance: Option<Disturbance>,
    ) -> Self {
        let (kept, answers) = (Kept::default(), Vec::new()); // line 2: D_i ← ∅
        Self { expert, gate, augmenting_sensors, disturbance, kept, answers, is_experts: false, ticks: 0 }
    }

    /// Line 15, with the noise augmentations of the sample.
    fn keep(&mut self, sample: Sample, truth: &GroundTruth<'_>) {
        self.kept.samples.push(sample);
        self.kept.ticks.push(self.ticks);
        let grids = self
            .augmenting_sensors
            .iter_mut()
            .map(|sensor| sensor.observe(truth.map, truth.vehicle.pose, self.ticks).grid);
        self.kept.noise_augmentations.extend(grids);
    }
}

impl GatedCollector {
    pub(crate) fn new(
        novice: Option<Novice>,
        critic: Option<Predictor>,
        keep: Keep,
        geometry: GridGeometry,
        seats: Vec<CollectorSeat>,
    ) -> Self {
        let (n_tot, n_net, interventions) = (0, 0, 0); // line 3
        Self { novice, critic, keep, geometry, seats, n_tot, n_net, tau_hat_sum: 0.0, interventions }
    }

    /// Line 6, for all seats at once; each expert sees only its own seat.
    fn ask_experts(&mut self, seats: &[Seat<'_>]) -> Vec<Decision> {
        at_seats(&mut self.seats, seats)
            .par_iter_mut()
            .map(|(CollectorSeat { expert, .. }, seat)| {
                if seat.was_reset {
                    expert.reset();
                }
                expert.decide(&seat.situation)
            })
            .collect()
    }

    /// What a critic warns of at every seat, 0…1: the ahead axis of its answers, which mirror images share. `None` without
    /// one.
    fn alarms(&self, seats: &[Seat<'_>]) -> Option<Vec<f32>> {
        let predictor = self.critic.as_ref()?;
        let grids: Vec<_> = seats.iter().map(|seat| &seat.situation.observation.grid).collect();
        Some(predictor.predict(&grids).iter().map(critic::alarm).collect())
    }

    /// Lines 7 to 9: who drives a seat, and with which τ̂.
    fn ask_gate(&mut self, seat: &Seat<'_>, predicted: &Prediction, evidence: Evidence) -> bool {
        let collector = &mut self.seats[seat.episode];
        if seat.was_reset {
            collector.gate.reset();
            collector.is_experts = false;
        }
        let novice = predicted.look_ahead(self.geometry);
        let trusts_novice = collector.gate.trusts_novice(&GateTick { evidence, novice, situation: &seat.situation });
        self.interventions += u64::from(!trusts_novice && !collector.is_experts);
        collector.is_experts = !trusts_novice;
        trusts_novice
    }

    /// Line 15 for all seats at once.
    fn store(&mut self, seats: &[Seat<'_>], kept: &[Option<Sample>]) {
        at_seats(&mut self.seats, seats).par_iter_mut().zip(kept).for_each(|((collector, seat), kept)| {
            if seat.was_reset {
                collector.augmenting_sensors.iter_mut().for_each(Sensor::forget);
            }
            if let Some(sample) = *kept {
                collector.keep(sample, &seat.situation.truth);
            }
            collector.ticks += 1;
        });
    }
}

/// The items of the episodes that wait for a decision; `of_episodes` has one item per episode of the batch.
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
        let alarms = self.alarms(seats);
        let expert_decisions = self.ask_experts(seats); // line 6
        let mut kept: Vec<Option<Sample>> = Vec::with_capacity(seats.len());
        for (index, (seat, expert)) in seats.iter().zip(expert_decisions).enumerate() {
            let a_exp = expert.look_ahead.to_image_fraction(&self.geometry).map(|fraction| fraction.clamp(0.0, 1.0));
            let grid = seat.situation.observation.grid;
            self.n_tot += 1; // line 17
            let Some((predicted, disagreement)) =
                predictions.as_ref().map(|(means, spread)| (means[index], spread[index]))
            else {
                kept.push(Some(Sample { grid, label: a_exp, tau_hat: 0.0 }));
                decisions.push(expert);
                continue;
            };
            // Lines 7 and 8.
            let alarm = alarms.as_ref().map_or(0.0, |alarms| alarms[index]);
            let evidence = Evidence { disagreement, alarm, ..Evidence::new(&predicted, a_exp) };
            self.tau_hat_sum += f64::from(evidence.discrepancy);
            self.seats[seat.episode].answers.push((evidence.discrepancy, a_exp));
            let novice = novice_decision(&predicted, self.geometry);
            // Compared with NaN, a gate would call the expert; the loop that drives refuses such an answer.
            let trusts_novice = self.ask_gate(seat, &predicted, evidence) || !novice.is_finite(); // line 9
            if trusts_novice {
                decisions.push(novice); // line 10
                self.n_net += 1; // line 11
            } else {
                decisions.push(expert); // line 14
            }
            // Line 15. τ̂ is a distance within the unit square, up to √2; the weight is meant for 0…1.
            let tau_hat = evidence.discrepancy.min(1.0);
            let is_kept = !trusts_novice || self.keep == Keep::EveryTick;
            kept.push(is_kept.then_some(Sample { grid, label: a_exp, tau_hat }));
        }
        self.store(seats, &kept);
        for (seat, decision) in seats.iter().zip(&mut decisions[first..]) {
            if let Some(disturbance) = &mut self.seats[seat.episode].disturbance {
                decision.look_ahead = disturbance.disturb(decision.look_ahead, &seat.situation.truth);
            }
        }
    }
}
