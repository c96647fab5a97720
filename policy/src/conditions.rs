//! What a network was trained with besides lots and noise.

use serde::{Deserialize, Serialize};
use sim::controller::ControllerSettings;
use sim::episode::EpisodeSettings;
use sim::sensing::{GridGeometry, SensingSettings};
use toml::{Table, Value};

/// What turns a network's answers into driving, and scenes into its grids. With others the same weights drive differently: at
/// another speed, for one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Conditions {
    /// Between two answers, milliseconds: action smoothing counts in them.
    pub control_period_ms: u32,
    /// How an answer is turned into a command.
    pub controller: ControllerSettings,
    /// What the grids show.
    pub sensing: SensingSettings,
}

/// The setting that does not matter to a network.
const OTHERS_LAW: &str = "episode.controller.planner_speed_law";

impl Conditions {
    /// Those of an episode.
    pub fn of(episode: &EpisodeSettings) -> Self {
        Self {
            control_period_ms: episode.control_period_ms,
            controller: episode.controller.clone(),
            sensing: episode.sensing.clone(),
        }
    }

    /// The patch of ground that the grids show and the answers are fractions of.
    pub fn geometry(&self) -> GridGeometry {
        self.sensing.geometry
    }

    /// The settings in which others differ, each as `KEY = VALUE` of these and the value of the others.
    pub fn differences(&self, others: &Self) -> Vec<(String, String)> {
        let [ours, theirs] = [self, others].map(|conditions| {
            let mut values = Vec::new();
            let table = Table::try_from(conditions).expect("conditions are plain values");
            collect(&table, "episode.", &mut values);
            values
        });
        let differing =
            ours.into_iter().zip(theirs).filter(|((key, ours), (_, theirs))| key != OTHERS_LAW && ours != theirs);
        differing.map(|((key, ours), (_, theirs))| (format!("{key} = {}", written(&ours)), written(&theirs))).collect()
    }
}

/// The values of a table and its tables, by their whole keys.
fn collect(table: &Table, prefix: &str, into: &mut Vec<(String, Value)>) {
    for (key, value) in table {
        let key = format!("{prefix}{key}");
        match value {
            Value::Table(section) => collect(section, &format!("{key}."), into),
            value => into.push((key, value.clone())),
        }
    }
}

/// As in settings: single precision has more digits when it is widened.
fn written(value: &Value) -> String {
    match value {
        Value::Float(number) => (*number as f32).to_string(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::controller::SpeedLaw;

    #[test]
    fn differences_name_settings_but_not_the_law_of_planners() {
        let ours = Conditions::of(&EpisodeSettings::paper());
        let mut episode = EpisodeSettings::paper();
        episode.controller.planner_speed_law = SpeedLaw::Halved;
        assert_eq!(ours.differences(&Conditions::of(&episode)), []);
        episode.controller.speed_law = SpeedLaw::Halved;
        episode.sensing.geometry.side_m = 10.4;
        let expected = [
            ("episode.controller.speed_law = \"full\"", "\"halved\""),
            ("episode.sensing.geometry.side_m = 12", "10.4"),
        ];
        let expected = expected.map(|(ours, theirs)| (ours.to_owned(), theirs.to_owned()));
        assert_eq!(ours.differences(&Conditions::of(&episode)), expected);
    }
}
