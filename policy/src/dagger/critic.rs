//! A second network that sees what the first one sees and predicts one number, 0…1: that the first one is far off
//! (`SafeDAgger`, `LazyDAgger`), or how near a near-collision is (`ThriftyDAgger`).
//!
//! It is a network of the same kind, trained the same way on other labels: what it predicts is in place of w, which a
//! mirror image leaves as it is; u is ½.

use crate::dataset::{Dataset, Round, Sample, Tick};
use crate::decision_rule::{CriticTarget, Evidence};
use crate::fit::{Budget, FitSettings};
use crate::loss::LossSettings;
use crate::network::{Ensemble, Prediction};
use sim::maths;
use sim::sensing::OccupancyGrid;

/// What a critic's answer warns of.
pub(crate) fn alarm(answer: &Prediction) -> f32 {
    answer.mean[1].clamp(0.0, 1.0)
}

/// What the critic of a trained network learns from the data that the network was trained on.
pub(crate) fn dataset(target: CriticTarget, d: &Dataset, network: &Ensemble, control_period_s: f32) -> Dataset {
    let mut labelled = Dataset::default();
    for round in d.rounds() {
        let targets = match target {
            CriticTarget::IsOff { tau } => {
                let grids: Vec<&OccupancyGrid> = round.samples.iter().map(|sample| &sample.grid).collect();
                let off = discrepancies(&round.samples, &network.predict(&grids));
                off.iter().map(|&off| f32::from(u8::from(off > tau))).collect()
            }
            CriticTarget::Risk { discount } => risks(&round.ticks, discount, control_period_s),
        };
        let samples = round.samples.iter().zip(targets);
        let samples = samples.map(|(sample, target)| Sample { grid: sample.grid, label: [0.5, target], tau_hat: 0.0 });
        labelled.push(Round {
            samples: samples.collect(),
            ticks: round.ticks.clone(),
            noise_augmentations: round.noise_augmentations.clone(),
        });
    }
    labelled
}

/// How a critic is trained: as the network, but with plain likelihood and for a quarter of the time (chosen).
pub(crate) fn fit_settings(fit: &FitSettings) -> FitSettings {
    let budget = match fit.budget {
        Budget::Steps(steps) => Budget::Steps(steps.div_ceil(4)),
        Budget::Epochs(epochs) => Budget::Epochs(0.25 * epochs),
    };
    FitSettings { budget, loss: LossSettings::unweighted(), ..fit.clone() }
}

/// τ̂ of a network's answers to samples.
pub(crate) fn discrepancies(samples: &[Sample], answers: &[Prediction]) -> Vec<f32> {
    answers.iter().zip(samples).map(|(answer, sample)| Evidence::new(answer, sample.label).discrepancy).collect()
}

/// `discount` to the power of the ticks until the next near-collision of the episode; 0 if none follows. Between ticks that
/// follow each other more time passes than a control period only where the car was stopped and put back. Where ticks between them
/// were not kept, in which of them it was is not known: it counts as the last one's, which is the least risk. A stop that ends
/// within half a control period of its tick is not seen; nor is a near-collision that ends a drive, which has no tick after it.
fn risks(ticks: &[Tick], discount: f32, control_period_s: f32) -> Vec<f32> {
    let mut risks = vec![0.0; ticks.len()];
    let mut next_stop: Option<(u32, u32)> = None;
    for (at, tick) in ticks.iter().enumerate().rev() {
        let follower = ticks.get(at + 1).filter(|next| next.episode == tick.episode);
        let stop_before = follower.filter(|next| {
            let ticks_between = (next.tick - tick.tick) as f32;
            next.time_s - tick.time_s > (ticks_between + 0.5) * control_period_s
        });
        if let Some(next) = stop_before {
            next_stop = Some((tick.episode, next.tick - 1));
        }
        if let Some((episode, stop)) = next_stop
            && episode == tick.episode
        {
            risks[at] = maths::pow(discount, (stop - tick.tick) as f32);
        }
    }
    risks
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::{InferenceSettings, NetworkArchitecture, Predictor, Weights};
    use crate::test_data::collected;
    use sim::seed::RootSeed;

    #[test]
    fn risk_grows_towards_a_stop_and_ends_with_it() {
        let (round, _) = collected(40, 0);
        // Two episodes of 20 ticks; in the first the car was stopped in tick 9, for two seconds.
        let mut ticks = round.ticks;
        for tick in &mut ticks {
            tick.time_s = 0.05 * tick.tick as f32;
            if tick.episode == 0 && tick.tick > 9 {
                tick.time_s += 2.0;
            }
        }
        let found = risks(&ticks, 0.5, 0.05);
        assert_eq!(found[6..12], [0.125, 0.25, 0.5, 1.0, 0.0, 0.0]);
        assert!(found[10..].iter().all(|&risk| risk == 0.0), "the other episode has no stop");
        // Without every second tick the stop is still there, and as far from each of the others.
        let thinned: Vec<Tick> = ticks.iter().step_by(2).copied().collect();
        assert_eq!(risks(&thinned, 0.5, 0.05)[3..6], [0.125, 0.5, 0.0]);
    }

    /// The tick at which the expert had handed over was taken for the near-collision itself, however much later that was.
    #[test]
    fn a_stop_while_the_network_drove_is_no_risk_of_the_experts_ticks_long_before() {
        let (round, _) = collected(20, 0);
        let mut ticks = round.ticks;
        for tick in &mut ticks {
            tick.time_s = 0.05 * tick.tick as f32 + if tick.tick > 14 { 2.0 } else { 0.0 };
        }
        // The expert drove the first four ticks and the last two.
        ticks.retain(|tick| !(4..18).contains(&tick.tick));
        let after = |ticks: f32| maths::pow(0.5, ticks);
        assert_eq!(risks(&ticks, 0.5, 0.05)[2..], [after(15.0), after(14.0), 0.0, 0.0]);
    }

    #[test]
    fn a_critic_learns_where_its_network_is_off() {
        let weights = Weights::init(NetworkArchitecture::compact(), RootSeed(1), 0);
        let predictor = Predictor::new(&weights, InferenceSettings::plain());
        let network = Ensemble::new(predictor, Vec::new());
        let (round, _) = collected(30, 1);
        let grids: Vec<&OccupancyGrid> = round.samples.iter().map(|sample| &sample.grid).collect();
        let off = discrepancies(&round.samples, &network.predict(&grids));
        let tau = off.iter().sum::<f32>() / 30.0;
        let mut d = Dataset::default();
        d.push(round);
        let labelled = dataset(CriticTarget::IsOff { tau }, &d, &network, 0.05);
        let found: Vec<f32> = labelled.rounds()[0].samples.iter().map(|sample| sample.label[1]).collect();
        assert_eq!(found, off.iter().map(|&off| if off > tau { 1.0 } else { 0.0 }).collect::<Vec<_>>());
        assert_eq!(labelled.rounds()[0].noise_augmentations, d.rounds()[0].noise_augmentations);
    }

    /// u of a critic's labels is always ½: read there, no state would ever be told from another.
    #[test]
    fn a_critic_warns_by_what_it_answers_for_w() {
        let warns = |mean: [f32; 2]| alarm(&Prediction { mean, sigma: [0.1; 2] });
        assert_eq!([[0.5, 0.2], [0.9, 1.3], [0.1, -0.4]].map(warns), [0.2, 1.0, 0.0]);
    }
}
