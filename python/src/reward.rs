//! What an environment is rewarded for: terms of the metrics (docs/methods.md 8), each with a weight.

use sim::frame::{Event, Frame};
use sim::vehicle::VehicleState;
use std::collections::BTreeMap;

/// A near-collision is something within half a metre: nearer than that, clearance costs.
const CLEARANCE_WANTED_M: f32 = 0.5;

/// Weights of the terms, all of one control tick. Weights are positive; costs are subtracted.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Reward {
    /// Per metre of progress along the route; none in a tick in which the car was put back.
    progress: f64,
    /// Per near-collision.
    near_collision: f64,
    /// Each time the car is stuck.
    stuck: f64,
    /// Per contact.
    contact: f64,
    /// Per metre that the clearance is below half a metre at the end of the tick, or where the car was put back from.
    clearance: f64,
    /// Per radian by which the road wheels turned in the tick; none in one in which the car was put back.
    smoothness: f64,
}

impl Reward {
    /// Weights by name.
    ///
    /// # Errors
    /// If there is no such term, or a weight is missing or not a finite number.
    pub(crate) fn of(mut weights: BTreeMap<String, f64>) -> anyhow::Result<Self> {
        let mut weight = |term: &str| {
            let weight =
                weights.remove(term).ok_or_else(|| anyhow::anyhow!("reward: the weight {term:?} is missing"))?;
            anyhow::ensure!(weight.is_finite(), "reward: the weight {term:?} is {weight}");
            Ok(weight)
        };
        let reward = Self {
            progress: weight("progress")?,
            near_collision: weight("near_collision")?,
            stuck: weight("stuck")?,
            contact: weight("contact")?,
            clearance: weight("clearance")?,
            smoothness: weight("smoothness")?,
        };
        match weights.keys().next() {
            Some(unknown) => anyhow::bail!("reward: there is no term {unknown:?}"),
            None => Ok(reward),
        }
    }

    /// The reward of a tick: of what its action did. A frame tells what was there before it, so what was there after it
    /// comes beside it: `gained_m`, progress; `clearance_m`; `after`, the car.
    pub(crate) fn of_tick(&self, frame: &Frame, gained_m: f32, clearance_m: f32, after: &VehicleState) -> f64 {
        let (near_collision, stuck) = match frame.event {
            Event::NearCollision { .. } => (1.0, 0.0),
            Event::Stuck { .. } => (0.0, 1.0),
            Event::Drove | Event::ReachedEnd => (0.0, 0.0),
        };
        // Nobody drove back onto the route, nor straightened the wheels there.
        let was_put_back = near_collision + stuck > 0.0;
        let progress_m = if was_put_back { 0.0 } else { f64::from(gained_m) };
        let turned_rad =
            if was_put_back { 0.0 } else { f64::from((after.steering_rad - frame.vehicle.steering_rad).abs()) };
        let missing_m = f64::from((CLEARANCE_WANTED_M - clearance_m).max(0.0));
        self.progress * progress_m
            - self.near_collision * near_collision
            - self.stuck * stuck
            - self.contact * f64::from(frame.contacts)
            - self.clearance * missing_m
            - self.smoothness * turned_rad
    }
}
