//! Episodes of a training, driven again as they were collected: round by round, by the expert and the network of the time.

use crate::drive::Drive;
use crate::recording::{Header, Recording};
use crate::{Context, layout, legend, result_of, show_map};
use anyhow::{Context as _, ensure};
use experiment::lots::Lot;
use experiment::settings::Settings;
use experiment::trained;
use experiment::training::{episodes_of, hand};
use policy::dagger::{Learned, Rollouts, RoundEpisode};
use policy::dataset::store::Store;
use policy::drivers::NetPolicy;
use std::path::Path;

/// Entity of the car.
const ROOT: &str = "dagger";

/// Records the first episodes of every round that is finished.
pub(crate) fn show(run: &Path, episodes: usize, context: &mut Context<'_>) -> anyhow::Result<()> {
    let settings = trained::settings_of(run)?;
    let lots = Lot::parse_all(&settings.training.lots, &settings.episode.vehicle)?;
    let store = Store::open(run)?;
    ensure!(store.has_round(0)?, "{}: no round is collected there yet", run.display());
    for round in 0.. {
        if !store.has_round(round)? {
            break;
        }
        let before = (round > 0).then(|| Learned::of_round(&settings.dagger, &store, round));
        let learned = before.transpose().with_context(|| format!("the policy that collected round {round}"))?;
        let mut first = episodes_of(&settings, &lots, round)?;
        first.truncate(episodes);
        Round { settings: &settings, number: round, learned }.record(first, context)?;
    }
    Ok(())
}

/// A round of a training.
struct Round<'a> {
    settings: &'a Settings,
    /// 0 = behaviour cloning.
    number: u32,
    /// What collects beside the expert; `None` while the expert drives alone.
    learned: Option<Learned>,
}

impl Round<'_> {
    fn record(&self, episodes: Vec<RoundEpisode>, context: &mut Context<'_>) -> anyhow::Result<()> {
        let begin = |RoundEpisode { index, episode, .. }: &RoundEpisode| {
            let (index, lot) = (index.episode(), &episode.map().scenario().name);
            let header = Header {
                application: "drive",
                title: format!("round {:02}, episode {index}, {lot}", self.number),
                layout: layout::of_drives(episode.map(), &[ROOT.to_owned()]),
                timeline: "sim_time",
                event: None,
            };
            let recording = context.begin(&format!("round-{:02}-episode-{index}-{lot}", self.number), &header)?;
            show_map(episode.map(), legend::DRIVE, &recording);
            Ok(recording)
        };
        let recordings = episodes.iter().map(begin).collect::<anyhow::Result<Vec<Recording>>>()?;
        let watched = |(recording, start): (_, &RoundEpisode)| {
            let learned = self.learned.as_ref();
            let novice = learned.map(|learned| NetPolicy::new(learned.policy()));
            let drive =
                Drive::new(recording, ROOT, &start.episode, self.settings, hand(self.settings.seed, start.index))
                    .with_novice(novice);
            drive.show_static();
            drive
        };
        let mut drives: Vec<Drive<'_>> = recordings.iter().zip(&episodes).map(watched).collect();
        let length_m: f32 = episodes.iter().map(|start| start.episode.map().path().length_m()).sum();
        let mut progress_m = vec![0.0; episodes.len()];
        context.progress.begin("recording", &format!("recording: round {}", self.number));
        let Settings { dagger, seed, .. } = self.settings;
        let rollouts = Rollouts::of_round(dagger, *seed, self.learned.as_ref(), episodes);
        let collected = rollouts.drive(&mut |place, frame| {
            // Drives that are cancelled are driven on: recording takes nearly all of their time.
            if !context.progress.is_cancelled() {
                drives[place].frame(frame);
                progress_m[place] = frame.progress_m;
                let driven_m: f32 = progress_m.iter().sum();
                let status = &mut |_| format!("{driven_m:.0} of {length_m:.0} m");
                context.progress.at(f64::from(driven_m / length_m), status);
            }
        })?;
        drop(drives);
        let results: Vec<String> = collected.reports.iter().map(|report| result_of(&report.metrics)).collect();
        context.progress.end(&results.join("; "));
        recordings.into_iter().try_for_each(|recording| context.end(recording))
    }
}
