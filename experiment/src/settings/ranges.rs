//! Numbers of the car, the sensor, the metrics and the expert that make no sense: they would not fail, they would measure
//! nonsense.

use anyhow::{Context as _, ensure};
use expert::ExpertSettings;
use policy::dagger::DisturbanceSettings;
use sim::episode::EpisodeSettings;

/// Lengths, times and gains that may also be zero: switched off. So may every layer of the noise
/// and every weight of the expert's plans.
const MAY_BE_ZERO: [&str; 17] = [
    "dead_time_s",
    "drivetrain_lag_s",
    "integral_max_mps2",
    "near_edge_ahead_m",
    "rear_overhang_m",
    "refractory_s",
    "resume_free_m",
    "speed_gain_i_per_s2",
    "speed_min_mps",
    "camera_ahead_m",
    "reaction_delay_s",
    "label_jitter",
    "clearances_m",
    "nose_margin_m",
    "disc_relief_m",
    "progress_share",
    "trust_from_m",
];

/// Everything is finite and none of it negative; what is divided by, waited for or driven over is not zero.
pub(super) fn check(episode: &EpisodeSettings) -> anyhow::Result<()> {
    let table = toml::Table::try_from(episode).context("settings are plain values")?;
    check_table("episode", &table)?;
    let (low, high) = (episode.controller.speed_min_mps, episode.controller.speed_max_mps);
    ensure!(
        low <= high,
        "episode.controller.speed_min_mps = {low} is more than episode.controller.speed_max_mps = {high}"
    );
    Ok(())
}

/// The same of the expert.
pub(super) fn check_expert(expert: &ExpertSettings) -> anyhow::Result<()> {
    let table = toml::Table::try_from(expert).context("settings are plain values")?;
    check_table("expert", &table)
}

/// What is drawn from is not empty.
pub(super) fn check_disturbance(disturbance: &DisturbanceSettings) -> anyhow::Result<()> {
    let table = toml::Table::try_from(disturbance).context("settings are plain values")?;
    check_table("dagger.disturbance", &table)
}

fn check_table(path: &str, table: &toml::Table) -> anyhow::Result<()> {
    for (key, value) in table {
        check_value(&format!("{path}.{key}"), key, value)?;
    }
    Ok(())
}

fn check_value(path: &str, key: &str, value: &toml::Value) -> anyhow::Result<()> {
    let number = match value {
        toml::Value::Table(table) => return check_table(path, table),
        toml::Value::Array(values) => return values.iter().try_for_each(|value| check_value(path, key, value)),
        toml::Value::Float(number) => *number,
        toml::Value::Integer(number) => *number as f64,
        _ => return Ok(()),
    };
    let is_switch = ["episode.noise.", "expert.weights."].iter().any(|section| path.starts_with(section));
    let may_be_zero = is_switch || MAY_BE_ZERO.contains(&key);
    let needed = if may_be_zero { "not be negative" } else { "be more than 0" };
    // As it was written: single precision has more digits when it is widened.
    let written = number as f32;
    let is_sound = number.is_finite() && number >= 0.0 && (may_be_zero || number > 0.0);
    ensure!(is_sound, "{path} = {written} must {needed}");
    Ok(())
}
