//! The trained network, or several as an ensemble, at the wheel: of many cars in lock-step, or of one.

use crate::action_smoothing;
use crate::checkpoint::Checkpoint;
use crate::network::{Ensemble, Prediction, Predictor};
use sim::action_smoothing::{ActionSmoothing, FleetSmoothing};
use sim::driver::{Decision, Fleet, Policy, Seat, Source};
use sim::sensing::{GridGeometry, Observation};

/// The network alone drives every seat; one call answers all of them.
#[derive(Debug, Clone)]
pub struct NetFleet {
    novice: Novice,
    geometry: GridGeometry,
}

impl NetFleet {
    /// Seats a network.
    pub fn new(checkpoint: &Checkpoint) -> Self {
        Self::ensemble(checkpoint, &[])
    }

    /// Seats several networks that answer as one. They should have been trained for the same patch of ground; the first
    /// one's action smoothing counts.
    pub fn ensemble(first: &Checkpoint, others: &[Checkpoint]) -> Self {
        Self { novice: Novice::new(first, others), geometry: first.geometry() }
    }
}

impl Fleet for NetFleet {
    fn decide(&mut self, seats: &[Seat<'_>], decisions: &mut Vec<Decision>) {
        let (answers, _) = self.novice.answers(seats);
        decisions.extend(answers.iter().map(|prediction| novice_decision(prediction, self.geometry)));
    }
}

/// The network as it answers at the wheel of many cars: with the action smoothing of each.
#[derive(Debug, Clone)]
pub(crate) struct Novice {
    ensemble: Ensemble,
    geometry: GridGeometry,
    smoothing: FleetSmoothing,
}

impl Novice {
    pub(crate) fn new(first: &Checkpoint, others: &[Checkpoint]) -> Self {
        let smoothing = FleetSmoothing::new(first.inference.smoothing_ticks);
        let others = others.iter().map(Checkpoint::predictor).collect();
        Self { ensemble: Ensemble::new(first.predictor(), others), geometry: first.geometry(), smoothing }
    }

    /// What it answers at every seat, smoothed, and how far the members of an ensemble disagree.
    pub(crate) fn answers(&mut self, seats: &[Seat<'_>]) -> (Vec<Prediction>, Vec<f32>) {
        let grids: Vec<_> = seats.iter().map(|seat| &seat.situation.observation.grid).collect();
        let (mut answers, disagreement) = self.ensemble.predict_with_disagreement(&grids);
        action_smoothing::smooth_all(&mut self.smoothing, seats, &mut answers, self.geometry);
        (answers, disagreement)
    }
}

/// The network alone drives one car. Answers the same bits as [`NetFleet`].
#[derive(Debug, Clone)]
pub struct NetPolicy {
    predictor: Predictor,
    geometry: GridGeometry,
    smoothing: ActionSmoothing,
}

impl NetPolicy {
    /// Seats a network.
    pub fn new(checkpoint: &Checkpoint) -> Self {
        let smoothing = ActionSmoothing::new(checkpoint.inference.smoothing_ticks);
        Self { predictor: checkpoint.predictor(), geometry: checkpoint.geometry(), smoothing }
    }
}

impl Policy for NetPolicy {
    fn act(&mut self, observation: &Observation) -> Decision {
        let prediction = self.predictor.predict(&[&observation.grid])[0];
        let smoothed = action_smoothing::smoothed(&mut self.smoothing, prediction, self.geometry);
        novice_decision(&smoothed, self.geometry)
    }

    fn reset(&mut self) {
        self.smoothing.reset();
    }
}

/// What the network's answer means to the controller.
pub fn novice_decision(prediction: &Prediction, geometry: GridGeometry) -> Decision {
    Decision {
        look_ahead: prediction.look_ahead(geometry),
        source: Source::Novice,
        spread: Some(prediction.spread(geometry)),
        speed_limit_mps: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conditions::Conditions;
    use crate::network::{InferenceSettings, NetworkArchitecture, Weights};
    use crate::test_data::lots;
    use sim::episode::EpisodeSettings;
    use sim::seed::RootSeed;

    #[test]
    fn a_policy_answers_what_the_network_says() {
        let weights = Weights::init(NetworkArchitecture::compact(), RootSeed(1), 0);
        let conditions = Conditions::of(&EpisodeSettings::paper());
        let geometry = conditions.geometry();
        let grid = lots(1)[0];
        let checkpoint = Checkpoint { weights, conditions, inference: InferenceSettings::smoothed() };
        let mut policy = NetPolicy::new(&checkpoint);
        let decision = policy.act(&Observation { grid });
        let prediction = checkpoint.predictor().predict(&[&grid])[0];
        assert_eq!(decision.source, Source::Novice);
        assert_eq!(decision.look_ahead.to_image_fraction(&geometry).map(round), prediction.clipped_mean().map(round));
        assert_eq!(decision.spread.unwrap().ahead_m, prediction.sigma[1] * geometry.side_m);
    }

    fn round(value: f32) -> i32 {
        (value * 1e4).round() as i32
    }
}
