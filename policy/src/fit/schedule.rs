//! Learning rate over time.

use burn::lr_scheduler::cosine::CosineAnnealingLrSchedulerConfig;
use burn::lr_scheduler::linear::LinearLrSchedulerConfig;
use burn::lr_scheduler::module_lr_scheduler::ModuleLrScheduler;
use burn::lr_scheduler::sequential::SequentialLrSchedulerConfig;
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

    /// burn's scheduler for a training of `steps` steps.
    ///
    /// # Errors
    /// If a value is outside of what burn accepts: the peak above 0 and at most 1, the floor from 0 to the peak.
    pub fn scheduler(&self, steps: u32) -> Result<ModuleLrScheduler, String> {
        let (peak, floor) = (f64::from(self.peak), f64::from(self.floor));
        let shape = match self.shape {
            ScheduleShape::Constant => LinearLrSchedulerConfig::new(peak, peak, 1).into(),
            ScheduleShape::Cosine => {
                let span = steps.saturating_sub(self.warm_up_steps + 1).max(1);
                CosineAnnealingLrSchedulerConfig::new(peak, span as usize).with_min_lr(floor).into()
            }
        };
        let warm_up = match self.warm_up_steps {
            0 => return SequentialLrSchedulerConfig::new(vec![shape], Vec::new()).init(),
            1 => LinearLrSchedulerConfig::new(peak, peak, 1),
            steps => LinearLrSchedulerConfig::new(peak / f64::from(steps), peak, steps as usize - 1),
        };
        SequentialLrSchedulerConfig::new(vec![warm_up.into(), shape], vec![self.warm_up_steps as usize]).init()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn first(rate: LearningRate, steps: u32) -> Vec<f64> {
        let mut scheduler = rate.scheduler(steps).unwrap();
        (0..steps).map(|_| scheduler.step().base()).collect()
    }

    #[test]
    fn cosine_with_warm_up_by_table() {
        let rate = LearningRate { peak: 1.0, floor: 0.1, warm_up_steps: 4, shape: ScheduleShape::Cosine };
        let found = first(rate, 15);
        for (step, expected) in [(0, 0.25), (3, 1.0), (4, 1.0), (9, 0.55), (14, 0.1)] {
            assert!((found[step] - expected).abs() < 1e-6, "step {step}: {}", found[step]);
        }
        for warm_up_steps in [0, 1] {
            let found = first(LearningRate { warm_up_steps, ..rate }, 15);
            assert_eq!((found[0], found[1] <= 1.0), (1.0, true), "{found:?}");
        }
    }

    #[test]
    fn a_constant_rate_stays() {
        assert!(first(LearningRate::constant(0.3), 10).iter().all(|rate| (rate - 0.3).abs() < 1e-6));
    }
}
