//! Who drives one car, tick by tick: what all rules have in common.

use crate::decision_rule::evidence::Evidence;
use sim::driver::{LookAheadPoint, Situation};

/// One tick of one car, before it is decided who drives it.
pub(crate) struct GateTick<'a> {
    pub(crate) evidence: Evidence,
    /// What the network would drive at.
    pub(crate) novice: LookAheadPoint,
    pub(crate) situation: &'a Situation<'a>,
}

/// Decides who drives one car.
pub(crate) trait Gate: Send {
    /// Whether the network drives this tick.
    fn trusts_novice(&mut self, tick: &GateTick<'_>) -> bool;

    /// Forgets the past; called when the car was put back on the path.
    fn reset(&mut self) {}
}

/// Who has the wheel, where taking it and handing it back follow different conditions.
#[derive(Debug, Default)]
pub(crate) struct Wheel {
    is_experts: bool,
}

impl Wheel {
    /// Goes on by a tick in which the expert `takes` the wheel from the network, or `returns` it; says whether the network
    /// drives then.
    pub(crate) fn turn(&mut self, takes: bool, returns: bool) -> bool {
        self.is_experts = if self.is_experts { !returns } else { takes };
        !self.is_experts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wheel_is_kept_between_taking_and_returning() {
        let mut wheel = Wheel::default();
        let steps = [(false, false, true), (true, false, false), (false, false, false), (true, true, true)];
        for (takes, returns, is_novices) in steps {
            assert_eq!(wheel.turn(takes, returns), is_novices, "{takes} {returns}");
        }
    }
}
