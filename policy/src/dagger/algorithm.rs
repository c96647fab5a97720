//! Algorithms 1 and 2, in their order and with their line numbers.

use crate::checkpoint::Checkpoint;
use crate::conditions::Conditions;
use crate::dagger::critic;
use crate::dagger::iteration_row::IterationRow;
use crate::dagger::learned::{self, Learned};
use crate::dagger::progress::{DaggerError, Hooks, Outcome, Progress, Stop};
use crate::dagger::rollouts::Rollouts;
use crate::dagger::run_file::RunFile;
use crate::dagger::settings::{DaggerSettings, StartFrom};
use crate::dataset::store::Store;
use crate::dataset::{Collection, Dataset, Round, Tick};
use crate::files::{self, Format as _};
use crate::fit::learning;
use crate::fit::{self, FitContext, FitError, FitOutcome, FitProgress, FitReport, FitSettings};
use crate::network::{NetworkArchitecture, Weights};
use sim::seed::{RootSeed, Stream};
use std::ops::ControlFlow;
use std::path::Path;
use storage::{sums, whole};

/// Behaviour cloning, then Algorithm 1. Rounds found in `store` are read instead of made again, so that a run that was
/// interrupted continues, with the same result. `conditions`: those of all episodes.
///
/// # Errors
/// If the store holds another run, or a file cannot be read or written.
pub fn run(
    settings: &DaggerSettings,
    conditions: &Conditions,
    store: &Store,
    seed: RootSeed,
    hooks: &mut Hooks<'_>,
) -> Result<Outcome, DaggerError> {
    settings.network.validate()?;
    settings.inference.validate()?;
    RunFile { seed, geometry: conditions.geometry(), settings: settings.clone() }.claim(store.folder())?;
    let mut run = Run { settings, conditions, store, seed, hooks, rows: Vec::new() };
    let (policy, stop) = match run.dagger() {
        Ok((policy, stop)) => (Some(policy), stop),
        Err(Halt::Interrupted(policy)) => (policy, Stop::Interrupted),
        Err(Halt::Failed(error)) => return Err(error),
    };
    let policy = policy.map(|weights| run.checkpoint(weights));
    Ok(Outcome { policy, rows: run.rows, stop })
}

/// One run in progress.
struct Run<'r, 'h> {
    settings: &'r DaggerSettings,
    conditions: &'r Conditions,
    store: &'r Store,
    seed: RootSeed,
    hooks: &'r mut Hooks<'h>,
    rows: Vec<IterationRow>,
}

/// Why the algorithm ended early.
enum Halt {
    /// Interrupted, with the policy finished last.
    Interrupted(Option<Weights>),
    Failed(DaggerError),
}

impl<E: Into<DaggerError>> From<E> for Halt {
    fn from(error: E) -> Self {
        Self::Failed(error.into())
    }
}

impl Run<'_, '_> {
    /// Algorithm 1.
    fn dagger(&mut self) -> Result<(Weights, Stop), Halt> {
        let (d_bc, collected) = self.data_sampling_function(None, 0)?;
        let mut d = Dataset::default(); // line 3: D ← D_BC
        self.aggregate(&mut d, d_bc, 0, &collected, None)?;
        let mut policy = self.train(None, &d, 0, &collected)?; // line 2: π_net,1 ← π_BC
        let mut eta_hat = 0.0; // line 4
        let mut i = 1;
        // Line 5: while η̂ ≤ η. Unrounded, where the paper prints 0.90 (docs/methods.md 12, item 15).
        while eta_hat <= self.settings.eta || i <= self.settings.iterations_min {
            if i > self.settings.iterations_max {
                return Ok((self.finish(policy, &d)?, Stop::IterationCap));
            }
            let (d_i, collected) = self.data_sampling_function(Some((&policy, &d)), i)?; // line 6
            eta_hat = collected.eta_hat();
            self.aggregate(&mut d, d_i, i, &collected, Some(&policy))?; // line 7
            policy = self.train(Some(policy), &d, i, &collected)?; // line 8
            i += 1; // line 9
        }
        Ok((self.finish(policy, &d)?, Stop::EtaReached)) // line 11
    }

    /// Algorithm 2 over the episodes of a round, or what an earlier run found there. Behaviour cloning (`policy` =
    /// `None`) is the same with the expert at the wheel and every tick kept.
    fn data_sampling_function(
        &mut self,
        trained: Option<(&Weights, &Dataset)>,
        round: u32,
    ) -> Result<(Round, Collection), Halt> {
        if self.store.has_round(round)? {
            return Ok(self.store.read_round(round)?);
        }
        let episodes = (self.hooks.episodes)(round).map_err(|source| DaggerError::Episodes { round, source })?;
        let policy = trained.map(|(policy, _)| policy);
        self.report(&Progress::Collecting { round, episodes: episodes.len() }, policy)?;
        let novice = trained.map(|(policy, d)| {
            Learned::with_parts(self.settings, self.store, round - 1, self.checkpoint(policy.clone()), d)
        });
        let novice = novice.transpose()?;
        let rollouts = Rollouts::of_round(self.settings, self.seed, novice.as_ref(), episodes);
        let on_frame = &mut *self.hooks.on_frame;
        let collected = rollouts.drive(&mut |episode, frame| on_frame(round, episode, frame));
        let collected = collected.map_err(|source| DaggerError::Driving { round, source })?;
        check_finite(round, &collected.round)?;
        let collected = collected.thinned(self.settings.samples_per_round as usize);
        let collection = collected.record(round);
        self.store.write_round(&collected.round, &collection)?;
        Ok((collected.round, collection))
    }

    /// Line 7: D ← D ∪ `D_i`.
    fn aggregate(
        &mut self,
        d: &mut Dataset,
        d_i: Round,
        round: u32,
        collection: &Collection,
        policy: Option<&Weights>,
    ) -> Result<(), Halt> {
        d.push(d_i);
        self.report(&Progress::Collected { round, collection, dataset: d.len() }, policy)
    }

    /// Line 8: trains on D, or reads what an earlier run trained.
    fn train(
        &mut self,
        previous: Option<Weights>,
        d: &Dataset,
        round: u32,
        collection: &Collection,
    ) -> Result<Weights, Halt> {
        let settings = self.settings;
        let folder = self.store.round_folder(round);
        let start = match (settings.start, &previous) {
            (StartFrom::Previous, Some(weights)) => weights.clone(),
            _ => Weights::init(settings.network, self.seed, u64::from(round)),
        };
        let fit = settings.fit_of_round(round);
        let trained = self.trained_in(&folder, &start, d, &fit, Some(round), 0)?;
        let Some((weights, fit)) = trained else {
            return Err(Halt::Interrupted(previous));
        };
        if !self.train_beside(&weights, d, round)? {
            return Err(Halt::Interrupted(previous));
        }
        let row = IterationRow::new(collection, d.len(), &fit);
        self.report(&Progress::Finished { row: &row, fit: &fit }, Some(&weights))?;
        self.rows.push(row);
        Ok(weights)
    }

    /// What the decision rule needs besides the network: an ensemble's other members, then a critic. `false` if
    /// interrupted.
    fn train_beside(&mut self, policy: &Weights, d: &Dataset, round: u32) -> Result<bool, Halt> {
        let (settings, store) = (self.settings, self.store);
        let fit = settings.fit_of_round(round);
        for member in 1..settings.rule.members() {
            let start = match (settings.start, round.checked_sub(1)) {
                (StartFrom::Previous, Some(before)) => {
                    store.checkpoint(&learned::member_folder(store, before, member))?.weights
                }
                _ => Weights::init(settings.network, self.seed, index_of(Some(round), member)),
            };
            let folder = learned::member_folder(store, round, member);
            if self.trained_in(&folder, &start, d, &fit, Some(round), member)?.is_none() {
                return Ok(false);
            }
        }
        let Some(target) = settings.rule.critic() else { return Ok(true) };
        let novice = Learned::uncritical(settings, store, round, self.checkpoint(policy.clone()))?;
        let control_period_s = 1e-3 * self.conditions.control_period_ms as f32;
        let d = critic::dataset(target, d, &novice.ensemble(), control_period_s);
        // It answers one number, of which there are no ways to choose between.
        let architecture = NetworkArchitecture { modes: 1, ..settings.network };
        let start = Weights::init(architecture, self.seed, index_of(Some(round), CRITIC));
        let folder = learned::critic_folder(store, round);
        Ok(self.trained_in(&folder, &start, &d, &critic::fit_settings(&fit), Some(round), CRITIC)?.is_some())
    }

    /// The optional longer training at the end.
    fn finish(&mut self, policy: Weights, d: &Dataset) -> Result<Weights, Halt> {
        let Some(settings) = self.settings.final_fit() else {
            return Ok(policy);
        };
        let start = match self.settings.start {
            StartFrom::Previous => policy.clone(),
            StartFrom::Scratch => Weights::init(self.settings.network, self.seed, FINAL),
        };
        let trained = self.trained_in(&self.store.final_folder(), &start, d, &settings, None, 0)?;
        trained.map(|(weights, _)| weights).ok_or(Halt::Interrupted(Some(policy)))
    }

    /// Trains into a folder, unless that was done before. `None` if interrupted. `part`: 0 = the network, then what is
    /// trained beside it.
    fn trained_in(
        &mut self,
        folder: &Path,
        start: &Weights,
        d: &Dataset,
        settings: &FitSettings,
        round: Option<u32>,
        part: usize,
    ) -> Result<Option<(Weights, FitReport)>, Halt> {
        let unfinished = folder.join(fit::UNFINISHED);
        if Checkpoint::exists(folder)? {
            self.store.check_trained(folder)?;
            self.store.finish(folder)?;
            whole::remove(&unfinished)?;
            return Ok(Some((self.store.checkpoint(folder)?.weights, files::read(folder)?)));
        }
        files::create_folder(folder)?;
        let seed = self.seed.child(Stream::Shuffle, index_of(round, part));
        let progress = &mut *self.hooks.progress;
        let [from, to] = self.settings.part_of_round(round, part, d.len());
        let mut on_step = |fit: &FitProgress| {
            let share = from + (to - from) * f64::from(fit.step) / f64::from(fit.steps);
            progress(&Progress::Fitting { round, share, fit })
        };
        let DaggerSettings { inference, device, .. } = *self.settings;
        let context = FitContext { geometry: self.conditions.geometry(), inference, device, seed };
        let FitOutcome { weights, report, steps } =
            fit::fit(start, d, settings, context, Some(&unfinished), &mut on_step).map_err(|source| match source {
                // Where there is space again, it goes on.
                FitError::File(error) => DaggerError::File(error),
                source => DaggerError::Fit { round, source },
            })?;
        if report.stopped {
            return Ok(None);
        }
        // They are listed together: where one is finished, all are.
        files::write(folder, &report)?;
        learning::write(folder, &steps, &report)?;
        let checkpoint = self.checkpoint(weights);
        checkpoint.write(folder)?;
        let [model, numbers] = Checkpoint::FILES;
        let files = [FitReport::NAME, learning::FILE, model, numbers];
        self.store.claim(folder, &files)?;
        sums::list(folder, &files)?;
        self.store.finish(folder)?;
        whole::remove(&unfinished)?;
        Ok(Some((checkpoint.weights, report)))
    }

    fn checkpoint(&self, weights: Weights) -> Checkpoint {
        Checkpoint { weights, conditions: self.conditions.clone(), inference: self.settings.inference }
    }

    fn report(&mut self, progress: &Progress<'_>, policy: Option<&Weights>) -> Result<(), Halt> {
        match (self.hooks.progress)(progress) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Halt::Interrupted(policy.cloned())),
        }
    }
}

impl DaggerSettings {
    /// The shares of the steps of a round, 0…1, at which the training of a part begins and ends.
    fn part_of_round(&self, round: Option<u32>, part: usize, samples: usize) -> [f64; 2] {
        // The final training is of one network.
        let Some(round) = round else { return [0.0, 1.0] };
        let steps: Vec<f64> = self.fits_of_round(round).iter().map(|fit| f64::from(fit.steps(samples))).collect();
        // A critic, whose number is beyond all members, is the last.
        let index = part.min(steps.len() - 1);
        let share = |steps_done: &[f64]| steps_done.iter().sum::<f64>() / steps.iter().sum::<f64>();
        [share(&steps[..index]), share(&steps[..=index])]
    }
}

/// Refuses values that are not finite in what is about to be learned from.
fn check_finite(round: u32, collected: &Round) -> Result<(), DaggerError> {
    for (sample, at) in collected.samples.iter().zip(&collected.ticks) {
        let label = [sample.label[0], sample.label[1], sample.tau_hat];
        let is_label_finite = label.iter().all(|value| value.is_finite());
        // All that is refused when it is read again.
        let is_state_finite = Tick::FLOATS.iter().all(|(_, value_of)| value_of(at).is_finite());
        for (what, is_finite) in [("the label", is_label_finite), ("the state of the car", is_state_finite)] {
            if !is_finite {
                return Err(DaggerError::NotFinite { round, drive: at.episode, tick: at.tick, what });
            }
        }
    }
    Ok(())
}

/// Index of the final training among the seeds of the rounds.
const FINAL: u64 = 0xFFFF;
/// Number of a critic among the parts of a round; the members of an ensemble come before it.
const CRITIC: usize = 0x100;

/// Index of a training among the seeds of all.
fn index_of(round: Option<u32>, part: usize) -> u64 {
    let round = round.map_or(FINAL, u64::from);
    assert!(round <= FINAL, "a training has fewer than {FINAL} rounds");
    ((part as u64) << 16) | round
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_data::collected;
    use std::collections::BTreeSet;

    /// What two trainings share, the order of samples and dropout, they would have in common.
    #[test]
    fn every_training_of_a_run_has_a_seed_of_its_own() {
        // As many rounds and members as there can be, of both the first, some and the last.
        let rounds = [0, 1, 2, 0xFFFE].map(Some).into_iter();
        let parts = (0..=usize::from(u8::MAX)).chain([CRITIC]);
        let of_rounds = rounds.flat_map(|round| parts.clone().map(move |part| index_of(round, part)));
        let indices: Vec<u64> = of_rounds.chain([index_of(None, 0)]).collect();
        let different: BTreeSet<u64> = indices.iter().copied().collect();
        assert_eq!(different.len(), indices.len());
    }

    /// A commanded speed was not looked at: the round was written, and refused as damaged when it was read again.
    #[test]
    fn a_round_that_could_not_be_read_again_is_never_written() {
        check_finite(1, &collected(3, 0).0).unwrap();
        let changes: [fn(&mut Round); 11] = [
            |round| round.samples[2].label[0] = f32::NAN,
            |round| round.samples[2].label[1] = f32::NAN,
            |round| round.samples[2].tau_hat = f32::NAN,
            |round| round.ticks[2].time_s = f32::NAN,
            |round| round.ticks[2].x_m = f32::NAN,
            |round| round.ticks[2].y_m = f32::NAN,
            |round| round.ticks[2].heading_rad = f32::NAN,
            |round| round.ticks[2].speed_mps = f32::NAN,
            |round| round.ticks[2].steering_rad = f32::NAN,
            |round| round.ticks[2].command_steering_rad = f32::NAN,
            |round| round.ticks[2].command_speed_mps = f32::INFINITY,
        ];
        for (index, change) in changes.iter().enumerate() {
            let (mut round, _) = collected(3, 0);
            change(&mut round);
            let error = check_finite(1, &round).unwrap_err();
            let is_of_tick = matches!(error, DaggerError::NotFinite { round: 1, drive: 0, tick: 2, .. });
            assert!(is_of_tick, "change {index}: {error}");
        }
    }
}
