//! The car an expert drives: what it takes from the settings of the episode.

use sim::episode::EpisodeSettings;
use sim::sensing::{GridGeometry, SensingSettings};
use sim::vehicle::VehicleSettings;

/// The parts of an episode's settings that decisions depend on.
#[derive(Debug, Clone)]
pub(crate) struct ExpertContext {
    /// Dimensions and limits.
    pub(crate) vehicle: VehicleSettings,
    /// Camera and bird's-eye patch.
    pub(crate) sensing: SensingSettings,
    /// Between two decisions, seconds.
    pub(crate) control_period_s: f32,
    /// Slowest speed the controller commands, m/s.
    pub(crate) speed_min_mps: f32,
}

impl ExpertContext {
    /// The car of an episode.
    pub(crate) fn of(settings: &EpisodeSettings) -> Self {
        Self {
            vehicle: settings.vehicle.clone(),
            sensing: settings.sensing.clone(),
            control_period_s: settings.control_period_s(),
            speed_min_mps: settings.controller.speed_min_mps,
        }
    }

    /// Where look-ahead points may lie.
    pub(crate) fn geometry(&self) -> &GridGeometry {
        &self.sensing.geometry
    }
}
