//! Learning rate over time.

use serde::{Deserialize, Serialize};

/// Learning rate over time: linear warm-up, then a shape.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LearningRate {
    /// Highest value.
    pub peak: f32,
    /// Value at the end; not used by [`ScheduleShape::Constant`].
    pub floor: f32,
    /// Steps from 0 to the peak.
    pub warm_up_steps: u32,
    /// Course after the warm-up.
    pub shape: ScheduleShape,
}

/// Learning rate after the warm-up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ScheduleShape {
    /// The peak.
    Constant,
    /// Half a cosine from the peak to the floor.
    Cosine,
}

impl LearningRate {
    /// The same value always.
    pub fn constant(value: f32) -> Self {
        Self { peak: value, floor: value, warm_up_steps: 0, shape: ScheduleShape::Constant }
    }

    /// Value in step `step` of `steps`, from 0.
    pub fn at(&self, step: u32, steps: u32) -> f32 {
        if step < self.warm_up_steps {
            return self.peak * (step + 1) as f32 / self.warm_up_steps as f32;
        }
        match self.shape {
            ScheduleShape::Constant => self.peak,
            ScheduleShape::Cosine => {
                let span = steps.saturating_sub(self.warm_up_steps + 1).max(1);
                let share = ((step - self.warm_up_steps) as f32 / span as f32).min(1.0);
                self.floor + 0.5 * (self.peak - self.floor) * (1.0 + (std::f32::consts::PI * share).cos())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cosine_with_warm_up_by_table() {
        let rate = LearningRate { peak: 1.0, floor: 0.1, warm_up_steps: 4, shape: ScheduleShape::Cosine };
        for (step, expected) in [(0, 0.25), (3, 1.0), (4, 1.0), (9, 0.55), (14, 0.1), (20, 0.1)] {
            assert!((rate.at(step, 15) - expected).abs() < 1e-6, "step {step}: {}", rate.at(step, 15));
        }
        assert_eq!(LearningRate::constant(0.3).at(7, 10), 0.3);
    }
}
