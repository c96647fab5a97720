//! The one place where the drives of a round are set up, in a training and when a round is driven again.

use crate::agreement::Agreement;
use crate::checkpoint::Checkpoint;
use crate::dagger::disturbance::Disturbance;
use crate::dagger::gated_collector::{CollectorSeat, GatedCollector, Keep};
use crate::dagger::learned::Learned;
use crate::dagger::settings::DaggerSettings;
use crate::dataset::{Collection, Effort, EpisodeRecord, Round, Tick, kept_places};
use crate::decision_rule::PAPER_TAU;
use crate::decision_rule::{DecisionRule, GateContext};
use rayon::prelude::*;
use sim::batch::{NotFinite, run_lockstep};
use sim::controller::bumper_to_patch_m;
use sim::driver::Driver;
use sim::episode::{Episode, EpisodeReport};
use sim::frame::Frame;
use sim::scenario::Direction;
use sim::seed::{EpisodeIndex, RootSeed, Stream};
use sim::sensing::{GridGeometry, Sensor};

/// An episode at its start, and the expert that labels it.
pub struct RoundEpisode {
    /// Which one of which round: its disturbances and noise augmentations are drawn from streams of this index.
    pub index: EpisodeIndex,
    /// Which way the lot is driven; for the record, the episode's map is turned already.
    pub direction: Direction,
    /// The episode.
    pub episode: Episode,
    /// Its expert, freshly made.
    pub expert: Box<dyn Driver + Send>,
}

/// Drives that samples are collected from, at their start.
pub struct Rollouts {
    collector: GatedCollector,
    rule: DecisionRule,
    episodes: Vec<Episode>,
    origins: Vec<(EpisodeIndex, Direction)>,
}

/// What the drives gave: the result of Algorithm 2, with its record by episode.
#[derive(Debug, Clone, PartialEq)]
pub struct Collected {
    /// `D_i`: episode by episode, in order of time within an episode.
    pub round: Round,
    /// Lot, direction and counts of each episode.
    pub episodes: Vec<EpisodeRecord>,
    /// Metrics of each episode.
    pub reports: Vec<EpisodeReport>,
    /// Executed actions.
    pub n_tot: u64,
    /// Executed actions of the network.
    pub n_net: u64,
    /// Sum of τ̂ over all ticks, stored or not.
    pub tau_hat_sum: f64,
    /// What it cost.
    pub effort: Effort,
    /// How network and expert agree; `None` in behaviour cloning and [on policy](Rollouts::on_policy).
    pub agreement: Option<Agreement>,
    /// Executed actions in seconds.
    pub driven_s: f64,
}

impl Rollouts {
    /// Episodes of a training round, or some of them: network and expert in turn, as the decision rule says, with the
    /// disturbances and noise augmentations of the training with root seed `seed`. An episode is driven the same whichever
    /// others are with it. Without a `novice` the experts drive: behaviour cloning.
    pub fn of_round(
        settings: &DaggerSettings,
        seed: RootSeed,
        novice: Option<&Learned>,
        episodes: Vec<RoundEpisode>,
    ) -> Self {
        let augmenting_sensors = |index: EpisodeIndex, episode: &Episode| -> Vec<Sensor> {
            let sensor = |part| episode.another_sensor(seed.child(Stream::NoiseAugmentation, index.part(part)));
            (0..settings.noise_augmentations).map(sensor).collect()
        };
        let disturbance = |index: EpisodeIndex, episode: &Episode| {
            let is_disturbed = settings.disturbance.enabled && index.round() > 0;
            is_disturbed.then(|| {
                let rng = seed.rng(Stream::Disturbance, index.stream());
                Disturbance::new(settings.disturbance, &episode.settings().vehicle, rng)
            })
        };
        let DaggerSettings { rule, keep, .. } = *settings;
        Self::new(novice, seed, (rule, keep), episodes, &augmenting_sensors, &disturbance)
    }

    /// On-policy labelled rollouts: the network alone drives, undisturbed, and the expert labels every tick.
    pub fn on_policy(novice: &Checkpoint, episodes: Vec<RoundEpisode>) -> Self {
        // Every discrepancy is below infinity: the network always drives. Nothing is drawn at random.
        let how = (DecisionRule::TauOnly { tau: f32::INFINITY }, Keep::EveryTick);
        let novice = Learned::alone(novice.clone());
        Self::new(Some(&novice), RootSeed(0), how, episodes, &|_, _| Vec::new(), &|_, _| None)
    }

    fn new(
        novice: Option<&Learned>,
        seed: RootSeed,
        (rule, keep): (DecisionRule, Keep),
        episodes: Vec<RoundEpisode>,
        augmenting_sensors: &(dyn Fn(EpisodeIndex, &Episode) -> Vec<Sensor> + Sync),
        disturbance: &dyn Fn(EpisodeIndex, &Episode) -> Option<Disturbance>,
    ) -> Self {
        let (mut origins, mut starts, mut experts) = (Vec::new(), Vec::new(), Vec::new());
        for RoundEpisode { index, direction, episode, expert } in episodes {
            origins.push((index, direction));
            starts.push(episode);
            experts.push(expert);
        }
        // A sensor draws what it needs of its noise at once: milliseconds each.
        let sensors: Vec<Vec<Sensor>> = (origins.par_iter(), &starts)
            .into_par_iter()
            .map(|(&(index, _), episode)| augmenting_sensors(index, episode))
            .collect();
        let thresholds = novice.map(|novice| novice.thresholds).unwrap_or_default();
        let gate = |index: EpisodeIndex, episode: &Episode| {
            let rng = seed.rng(Stream::DecisionRule, index.stream());
            rule.gate(GateContext { round: index.round(), episode: episode.settings(), thresholds, rng })
        };
        let seats = experts
            .into_iter()
            .zip(sensors)
            .zip(origins.iter().zip(&starts))
            .map(|((expert, sensors), (&(index, _), episode))| {
                CollectorSeat::new(expert, gate(index, episode), sensors, disturbance(index, episode))
            })
            .collect();
        let geometry = starts.first().map_or_else(GridGeometry::paper, |start| start.settings().sensing.geometry);
        let critic = novice.and_then(Learned::critic);
        let novice = novice.map(Learned::novice);
        let collector = GatedCollector::new(novice, critic, keep, geometry, seats);
        Self { collector, rule, episodes: starts, origins }
    }

    /// Drives all episodes to their ends. `on_frame` is called with the place of the episode among those given, from 0.
    ///
    /// # Errors
    /// If an answer of the network is not finite.
    pub fn drive(self, on_frame: &mut dyn FnMut(usize, &Frame)) -> Result<Collected, NotFinite> {
        let Self { mut collector, rule, episodes, origins } = self;
        let bumper_to_patch_m = episodes.first().map_or(0.0, |episode| {
            let settings = episode.settings();
            bumper_to_patch_m(&settings.vehicle, &settings.sensing.geometry)
        });
        let lots: Vec<String> = episodes.iter().map(|episode| episode.map().scenario().name.clone()).collect();
        let control_period_s = episodes.first().map_or(0.0, |episode| episode.settings().control_period_s());
        let mut ticks: Vec<Vec<Tick>> = vec![Vec::new(); episodes.len()];
        let mut time_s = vec![0.0; episodes.len()];
        let reports = run_lockstep(episodes, &mut collector, &mut |place, frame| {
            ticks[place].push(Tick::new(origins[place].0.episode(), time_s[place], frame));
            time_s[place] = frame.time_s;
            on_frame(place, frame);
        })?;

        let GatedCollector { seats, n_tot, n_net, tau_hat_sum, interventions, geometry, .. } = collector;
        let (tau_hats, labels): (Vec<f32>, Vec<[f32; 2]>) =
            seats.iter().flat_map(|seat| seat.answers.iter().copied()).unzip();
        let tau = rule.tau().unwrap_or(PAPER_TAU);
        // Where the network always drives, nobody asks how often the two agree.
        let agreement =
            if tau.is_finite() { Agreement::new(tau, &tau_hats, &labels, &geometry, bumper_to_patch_m) } else { None };
        let expert_ticks = n_tot - n_net;
        let effort = Effort {
            // Behaviour cloning labels everything.
            queries: if tau_hats.is_empty() || rule.asks_at_every_tick() { n_tot } else { expert_ticks },
            interventions,
            expert_ticks,
            contacts: reports.iter().map(|report| report.metrics.contacts).sum(),
        };
        let mut round = Round::default(); // line 20
        let mut records = Vec::with_capacity(seats.len());
        for (place, seat) in seats.into_iter().enumerate() {
            let kept = seat.kept;
            let EpisodeReport { metrics, .. } = &reports[place];
            records.push(EpisodeRecord {
                lot: lots[place].clone(),
                direction: origins[place].1,
                samples: kept.samples.len(),
                near_collisions: metrics.near_collisions,
                driven_m: metrics.driven_m,
            });
            round.ticks.extend(kept.ticks.iter().map(|&tick| ticks[place][tick as usize]));
            round.samples.extend(kept.samples);
            round.noise_augmentations.extend(kept.noise_augmentations);
        }
        let driven_s = n_tot as f64 * f64::from(control_period_s);
        Ok(Collected { round, episodes: records, reports, n_tot, n_net, tau_hat_sum, effort, agreement, driven_s })
    }
}

impl Collected {
    /// The same with at most this many samples, spread evenly over all of them; 0 = all.
    #[must_use]
    pub(crate) fn thinned(self, at_most: usize) -> Self {
        if at_most == 0 || self.round.samples.len() <= at_most {
            return self;
        }
        let mut places = kept_places(self.round.samples.len(), at_most).peekable();
        let mut episodes = self.episodes;
        let mut end = 0;
        for record in &mut episodes {
            end += record.samples;
            record.samples = std::iter::from_fn(|| places.next_if(|&place| place < end)).count();
        }
        Self { round: self.round.thinned(at_most), episodes, ..self }
    }

    /// The record of these drives as those of a round.
    pub(crate) fn record(&self, round: u32) -> Collection {
        Collection {
            round,
            samples: self.round.samples.len(),
            noise_augmentations: self.round.augmentations_each(),
            ticks: self.n_tot,
            novice_ticks: self.n_net,
            tau_hat_sum: self.tau_hat_sum,
            driven_s: self.driven_s,
            near_collisions: self.reports.iter().map(|report| report.metrics.near_collisions).sum(),
            driven_m: self.reports.iter().map(|report| f64::from(report.metrics.driven_m)).sum(),
            effort: Some(self.effort),
            agreement: self.agreement,
            episodes: self.episodes.clone(),
        }
    }
}
