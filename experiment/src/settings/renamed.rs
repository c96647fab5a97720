//! Keys of earlier versions and what became of them.

/// Old key or section, new one.
pub(super) const RENAMED: [(&str, &str); 11] = [
    ("dagger.relooks", "dagger.noise_augmentations"),
    ("dagger.network.symmetric", "dagger.inference.mirror_averaging"),
    ("dagger.network.mirror_averaging", "dagger.inference.mirror_averaging"),
    ("dagger.network.memory_ticks", "dagger.inference.smoothing_ticks"),
    ("dagger.network.smoothing_ticks", "dagger.inference.smoothing_ticks"),
    ("dagger.disturbance.lasts_ticks", "dagger.disturbance.duration_ticks"),
    ("dagger.fit_iteration", "dagger.fit"),
    ("expert.band", "expert.elastic_band"),
    ("expert.load_band_m", "expert.load_range_m"),
    ("expert.label_sideways_step_m", "expert.label_lateral_step_m"),
    ("episode.sensing.smear", "episode.sensing.occlusion"),
];

/// Old key or section, and why it is gone.
pub(super) const REMOVED: [(&str, &str); 6] = [
    ("dagger.fit.shards", "the result does not depend on how a batch is cut for threads; leave it out"),
    ("dagger.geometry", "the grid is that of episode.sensing.geometry"),
    (
        "dagger.fit_cloning",
        "every training has the settings dagger.fit; behaviour cloning differs in dagger.cloning_budget",
    ),
    ("dagger.fit_final", "every training has the settings dagger.fit; the last one differs in dagger.final_budget"),
    ("expert.station_share", "its range was discarded; set expert.elastic_band.reach_share"),
    ("episode.vehicle.steering_ratio", "nothing read it; set steering_max_rad and steering_rate_max_radps"),
];

/// What became of an old key, or of the section that it is in.
pub(super) fn hint(key: &str) -> Option<String> {
    let is_in = |old: &str| key.strip_prefix(old).filter(|rest| rest.is_empty() || rest.starts_with('.'));
    let renamed = RENAMED.iter().find_map(|(old, new)| {
        let rest = is_in(old)?;
        Some(format!("{old} is {new} now; write {new}{rest}"))
    });
    let removed = || REMOVED.iter().find_map(|(old, why)| is_in(old).map(|_| format!("{old} is gone: {why}")));
    renamed.or_else(removed)
}
