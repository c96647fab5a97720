//! The car an expert drives, and what a decision is made from.

use sim::distance_field::DistanceField;
use sim::driver::GroundTruth;
use sim::episode::EpisodeSettings;
use sim::path::Path;
use sim::sensing::{GridGeometry, SensingSettings};
use sim::vehicle::{VehicleSettings, VehicleState};

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

/// What a decision is made from, apart from what of it is known.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scene<'a> {
    /// Distances to what is not drivable.
    pub(crate) field: &'a DistanceField,
    /// The car.
    pub(crate) vehicle: VehicleState,
    /// The route and how far along it the car is, metres: against turning back. Without one, any way will do.
    pub(crate) route: Option<(&'a Path, f32)>,
}

impl<'a> From<&GroundTruth<'a>> for Scene<'a> {
    fn from(truth: &GroundTruth<'a>) -> Self {
        Self {
            field: truth.map.distance_field(),
            vehicle: truth.vehicle,
            route: Some((truth.map.path(), truth.progress_m)),
        }
    }
}
