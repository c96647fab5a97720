//! Numbers of the car, the sensor and the metrics that make no sense: they would not fail, they would measure nonsense.

use anyhow::{Context as _, ensure};
use policy::dagger::DisturbanceSettings;
use sim::episode::EpisodeConfig;

/// Lengths, times and gains that may also be zero: switched off. So may every layer of the noise.
const MAY_BE_ZERO: [&str; 10] = [
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
];

/// Everything is finite and none of it negative; what is divided by, waited for or driven over is not zero.
pub(super) fn check(episode: &EpisodeConfig) -> anyhow::Result<()> {
    let table = toml::Table::try_from(episode).context("settings are plain values")?;
    check_table("episode", &table)?;
    let (low, high) = (episode.controller.speed_min_mps, episode.controller.speed_max_mps);
    ensure!(
        low <= high,
        "episode.controller.speed_min_mps = {low} is more than episode.controller.speed_max_mps = {high}"
    );
    Ok(())
}

/// What is drawn from is not empty.
pub(super) fn check_disturbance(disturbance: &DisturbanceSettings) -> anyhow::Result<()> {
    let table = toml::Table::try_from(disturbance).context("settings are plain values")?;
    check_table("dagger.disturbance", &table)
}

fn check_table(path: &str, table: &toml::Table) -> anyhow::Result<()> {
    for (key, value) in table {
        let path = format!("{path}.{key}");
        let number = match value {
            toml::Value::Table(table) => {
                check_table(&path, table)?;
                continue;
            }
            toml::Value::Float(number) => *number,
            toml::Value::Integer(number) => *number as f64,
            _ => continue,
        };
        let may_be_zero = MAY_BE_ZERO.contains(&key.as_str()) || path.starts_with("episode.noise.");
        let needed = if may_be_zero { "not be negative" } else { "be more than 0" };
        ensure!(
            number.is_finite() && number >= 0.0 && (may_be_zero || number > 0.0),
            "{path} = {number} must {needed}"
        );
    }
    Ok(())
}
