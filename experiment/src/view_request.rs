//! What the viewer program (`viewer/`) is asked to show: JSON on its standard input.
//!
//! Only names and replay keys are passed on: the viewer simulates every run again.

use crate::replay_key::ReplayKey;
use crate::settings::Settings;
use serde::{Deserialize, Serialize};
use sim::seed::RootSeed;
use std::path::PathBuf;

/// What to show, and where.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ViewRequest {
    /// Where the recordings go.
    pub sink: Sink,
    /// One after the other.
    pub show: Vec<Show>,
}

/// Where recordings go.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sink {
    /// An `.rrd` file, for a single recording.
    File(PathBuf),
    /// A file per recording in a folder, which is created if need be.
    Folder(PathBuf),
    /// A viewer of this machine, started if none runs.
    Spawn,
    /// A viewer that runs, `rerun+http://HOST:PORT/proxy`; `None` = this machine's.
    Connect(Option<String>),
}

/// What can be shown.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Show {
    /// A lot.
    Lot {
        /// As on the command line; stands for a single lot.
        lot: String,
        /// Seed of its obstacles, as in `generate`.
        seed: RootSeed,
    },
    /// Drives, a recording each.
    Drives {
        /// The settings of the evaluation that the keys come from.
        settings: Box<Settings>,
        /// What to record.
        drives: Vec<DriveRequest>,
    },
    /// The learning curves of a training.
    Training {
        /// Its folder.
        run: PathBuf,
    },
    /// The first episodes of every round of a training, with the expert, network and disturbances of the time.
    Rollouts {
        /// Its folder.
        run: PathBuf,
        /// Episodes per round.
        episodes: usize,
    },
}

/// A recording of one run, or of the same run by several drivers side by side.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriveRequest {
    /// Name of its file in a folder, without `.rrd`.
    pub file: String,
    /// Shown in the viewer's list of recordings.
    pub title: String,
    /// Keys that differ in their driver only. From a tick other than 0 on, the seconds around it are recorded.
    pub keys: Vec<ReplayKey>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::PRESETS;

    #[test]
    fn every_request_is_read_back() {
        let key: ReplayKey = "run:runs/a b@lot-b@reverse@3@0.5@1@842".parse().unwrap();
        let drive = DriveRequest { file: "a".to_owned(), title: "ä, b".to_owned(), keys: vec![key] };
        let presets = PRESETS.iter().map(|preset| Settings::preset(preset.name).unwrap());
        let mut show: Vec<Show> = presets
            .map(|settings| Show::Drives { settings: Box::new(settings), drives: vec![drive.clone()] })
            .collect();
        show.push(Show::Lot { lot: "lot-a".to_owned(), seed: RootSeed(u64::MAX) });
        show.push(Show::Training { run: "runs/x".into() });
        show.push(Show::Rollouts { run: "runs/x".into(), episodes: 2 });
        for sink in [Sink::File("x.rrd".into()), Sink::Folder("y".into()), Sink::Spawn, Sink::Connect(None)] {
            let request = ViewRequest { sink, show: show.clone() };
            let json = serde_json::to_string(&request).unwrap();
            assert_eq!(serde_json::from_str::<ViewRequest>(&json).unwrap(), request, "{json}");
        }
    }
}
