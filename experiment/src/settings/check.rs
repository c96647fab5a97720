//! What makes settings wrong as a whole: checked before a run folder exists.

use super::reference;
use super::schema::Settings;
use anyhow::{Context as _, bail, ensure};
use policy::fit::{Budget, ScheduleShape};
use scenarios::LotSpec;
use sim::limits::{DRIVES_AT_ONCE_MAX, NOISE_LEVELS_MAX, RUNS_MAX};
use sim::scenario::NoiseLevel;
use sim::sensing::noise::NoiseSettings;

/// Largest strength of a layer of noise at the strongest level that is asked for: shadows and blobs are held in memory.
const STRENGTH_MAX: f32 = 100.0;
/// Largest range of the safe ratio, in sides of the patch: it is measured in pixels of the patch.
const SAFE_RANGE_SIDES_MAX: f32 = 4.0;

impl Settings {
    /// Checks ranges, and what no single section can know.
    ///
    /// # Errors
    /// Naming the key, its value and what is possible.
    pub fn check(&self) -> anyhow::Result<()> {
        for (key, seed) in [("seed", self.seed), ("evaluation.seed", self.evaluation.seed)] {
            ensure!(
                i64::try_from(seed.0).is_ok(),
                "{key} = {}: TOML integers end at {}; choose a smaller seed",
                seed.0,
                i64::MAX
            );
        }
        reference::check(&toml::Table::try_from(self).context("settings are plain values")?, "")?;
        self.check_ways()?;
        self.check_noise()?;
        self.check_episode()?;
        self.check_dagger()?;
        self.check_expert()?;
        self.check_lots()
    }

    /// Checks that something is driven, each way once.
    fn check_ways(&self) -> anyhow::Result<()> {
        for (section, lots, directions) in [
            ("training", &self.training.lots, &self.training.directions),
            ("evaluation", &self.evaluation.lots, &self.evaluation.directions),
        ] {
            ensure!(!lots.is_empty(), "{section}.lots is empty; name at least one lot (cargo xtask lots)");
            ensure!(!directions.is_empty(), "{section}.directions is empty; name \"forward\", \"reverse\" or both");
            for (i, direction) in directions.iter().enumerate() {
                ensure!(
                    !directions[..i].contains(direction),
                    "{section}.directions names {} twice; the same drive again adds nothing",
                    direction.name()
                );
            }
        }
        Ok(())
    }

    /// Checks the levels of noise that are compared.
    fn check_noise(&self) -> anyhow::Result<()> {
        let noise = &self.evaluation.noise;
        ensure!(
            !noise.is_empty(),
            "evaluation.noise is empty; name at least one level (clean, paper, hard, lot, 0.5 …)"
        );
        ensure!(
            noise.len() <= NOISE_LEVELS_MAX,
            "evaluation.noise names {} levels; at most {NOISE_LEVELS_MAX} are possible",
            noise.len()
        );
        for (i, level) in noise.iter().enumerate() {
            if let Some(same) = noise[..i].iter().find(|other| level.is_same_as(**other)) {
                ensure!(same != level, "evaluation.noise names {level} twice; results are told apart by level");
                bail!("evaluation.noise names {same} and {level}, which are the same; name one of them");
            }
        }
        Ok(())
    }

    /// Checks steps of time, speeds, the strength of noise and the pixels of the safe ratio.
    fn check_episode(&self) -> anyhow::Result<()> {
        let (physics, control) = (self.episode.physics_step_ms, self.episode.control_period_ms);
        ensure!(
            control.is_multiple_of(physics),
            "episode.control_period_ms = {control} is not a multiple of episode.physics_step_ms = {physics}"
        );
        let (low, high) = (self.episode.controller.speed_min_mps, self.episode.controller.speed_max_mps);
        ensure!(
            low <= high,
            "episode.controller.speed_min_mps = {low} is more than episode.controller.speed_max_mps = {high}"
        );
        let NoiseSettings { intensity, boundary, shadow, speed_bump, false_free, blob, stain, flicker, dropout } =
            &self.episode.noise;
        // A lot asks for `hard` at most.
        let levels = self.evaluation.noise.iter().chain([&self.training.noise]);
        let strongest = levels.map(|level| level.intensity(NoiseLevel::Hard)).fold(1.0, f32::max);
        for (key, layer) in [
            ("boundary", boundary),
            ("shadow", shadow),
            ("speed_bump", speed_bump),
            ("false_free", false_free),
            ("blob", blob),
            ("stain", stain),
            ("flicker", flicker),
            ("dropout", dropout),
        ] {
            let strength = intensity * layer * strongest;
            ensure!(
                strength <= STRENGTH_MAX,
                "episode.noise.intensity = {intensity} times episode.noise.{key} = {layer}, times {strongest} for the \
                 strongest of training.noise and evaluation.noise, is {strength}; at most {STRENGTH_MAX} is possible"
            );
        }
        let (range_m, side_m) = (self.episode.metrics.safe_range_m, self.episode.sensing.geometry.side_m);
        ensure!(
            range_m <= SAFE_RANGE_SIDES_MAX * side_m,
            "episode.metrics.safe_range_m = {range_m} is more than {SAFE_RANGE_SIDES_MAX} times \
             episode.sensing.geometry.side_m = {side_m}, in whose pixels it is measured"
        );
        Ok(())
    }

    /// Checks the network and how it is trained.
    fn check_dagger(&self) -> anyhow::Result<()> {
        self.dagger.network.validate().context("dagger.network")?;
        let rate = &self.dagger.fit.learning_rate;
        ensure!(
            rate.floor <= rate.peak || rate.shape == ScheduleShape::Constant,
            "dagger.fit.learning_rate.floor = {} is more than dagger.fit.learning_rate.peak = {}",
            rate.floor,
            rate.peak
        );
        ensure!(
            self.dagger.fit.validation.every != 1,
            "dagger.fit.validation.every = 1 holds every block back; nothing is left to train on"
        );
        for (key, budget) in [
            ("dagger.fit.budget", self.dagger.fit.budget),
            ("dagger.cloning_budget", self.dagger.cloning_budget),
            ("dagger.final_budget", self.dagger.final_budget),
        ] {
            // Of epochs, the samples decide.
            if let Budget::Steps(steps) = budget {
                self.dagger.fit.check_length(steps).with_context(|| format!("{key}.steps = {steps}"))?;
            }
        }
        Ok(())
    }

    /// Checks orders and steps of the expert's plans.
    fn check_expert(&self) -> anyhow::Result<()> {
        let travels = &self.expert.branch_travels_m;
        ensure!(travels.is_sorted_by(|a, b| a < b), "expert.branch_travels_m = {travels:?} is not increasing");
        let clearances = &self.expert.clearances_m;
        ensure!(
            clearances.is_sorted_by(|a, b| a >= b),
            "expert.clearances_m = {clearances:?} increases; write the comfortable one first"
        );
        let band = &self.expert.elastic_band;
        for (from_key, from, to_key, to) in [
            ("trust_from_m", band.trust_from_m, "trust_to_m", band.trust_to_m),
            ("aside_from_m", band.aside_from_m, "aside_to_m", band.aside_to_m),
            ("gap_from_m", band.gap_from_m, "gap_to_m", band.gap_to_m),
            ("bend_from_rad", band.bend_from_rad, "bend_to_rad", band.bend_to_rad),
        ] {
            ensure!(from < to, "expert.elastic_band.{from_key} = {from} is not less than {to_key} = {to}");
        }
        let step_m = self.expert.first_step_m;
        let steps = (expert::WAY_SPACING_M / step_m).round();
        ensure!(
            steps >= 1.0 && (steps * step_m - expert::WAY_SPACING_M).abs() < 1e-3,
            "expert.first_step_m = {step_m} does not divide {} m, at which a plan's way is sampled",
            expert::WAY_SPACING_M
        );
        // Either step is taken along arcs of either stage.
        let steps = [("first_step_m", self.expert.first_step_m), ("second_step_m", self.expert.second_step_m)];
        let arcs = [
            ("curvature_max_per_m", self.expert.curvature_max_per_m),
            ("second_curvature_max_per_m", self.expert.second_curvature_max_per_m),
        ];
        for (step_key, step_m) in steps {
            for (arc_key, arc_per_m) in arcs {
                let turn_rad = step_m * arc_per_m;
                ensure!(
                    turn_rad <= expert::STEP_TURN_MAX_RAD,
                    "expert.{step_key} = {step_m} along expert.{arc_key} = {arc_per_m} turns by {turn_rad:.2} rad; \
                     forecasts hold up to {} rad",
                    expert::STEP_TURN_MAX_RAD
                );
            }
        }
        Ok(())
    }

    /// Checks that each of [`Self::training_seeds`] can be written down as its root seed.
    ///
    /// # Errors
    /// If one cannot.
    pub fn check_training_seeds(&self, trainings: u64) -> anyhow::Result<()> {
        let last = self.seed.0.checked_add(trainings.saturating_sub(1));
        ensure!(
            last.is_some_and(|last| i64::try_from(last).is_ok()),
            "seed {} leaves no room for {trainings} trainings; choose a smaller one",
            self.seed.0
        );
        Ok(())
    }

    /// Checks that on-policy rollouts can be driven, which hold the map of every lot of the evaluation, each way.
    ///
    /// # Errors
    /// If these are too many to be held at once.
    pub fn check_rollouts(&self) -> anyhow::Result<()> {
        let Self { evaluation, .. } = self;
        let drives = drives_of("evaluation.lots", &evaluation.lots, &|_| 1)? * evaluation.directions.len();
        ensure!(
            drives <= DRIVES_AT_ONCE_MAX,
            "evaluation.lots and directions: {drives} drives, all of which on-policy rollouts hold at once; at most \
             {DRIVES_AT_ONCE_MAX} are possible: name fewer lots there, and the others with --unseen"
        );
        Ok(())
    }

    /// Checks names of lots, and counts the drives they make. Files are not looked at.
    fn check_lots(&self) -> anyhow::Result<()> {
        let Self { training, evaluation, .. } = self;
        // A generated lot is another one in every round, and driven once.
        let trials =
            |lot: &LotSpec| if matches!(lot, LotSpec::Generated { .. }) { 1 } else { training.trials as usize };
        let drives = drives_of("training.lots", &training.lots, &trials)? * training.directions.len();
        ensure!(
            drives <= DRIVES_AT_ONCE_MAX,
            "training.lots, trials and directions: {drives} drives a round; at most {DRIVES_AT_ONCE_MAX} are possible"
        );
        let trials_and_levels = evaluation.trials as usize * evaluation.noise.len();
        for (key, names, others, times) in [
            ("evaluation.lots", &evaluation.lots, ", trials, directions and noise", trials_and_levels),
            // Once each way, at the first level.
            ("evaluation.elsewhere", &evaluation.elsewhere, " and directions", 1),
        ] {
            let runs = drives_of(key, names, &|_| times)? * evaluation.directions.len();
            ensure!(runs <= RUNS_MAX, "{key}{others}: {runs} runs; at most {RUNS_MAX} are possible");
        }
        Ok(())
    }
}

/// Drives each way of the lots of a setting: as often as `times` says of each lot.
fn drives_of(key: &str, names: &[String], times: &dyn Fn(&LotSpec) -> usize) -> anyhow::Result<usize> {
    let lots = names.iter().map(|name| Ok(scenarios::suite(name)?.iter().map(times).sum::<usize>()));
    lots.sum::<anyhow::Result<usize>>().with_context(|| key.to_owned())
}
