//! Artificial potential field (paper, introduction; docs/methods.md 7.1; Khatib 1986, Ge and Cui 2000): repulsion of the nearest
//! obstacle plus attraction of a goal. The paper did not run it, for want of a goal; here the goal is local ([`Goal`]).
//!
//! U_rep = ½η(1/ρ − 1/ρ_0)²·ρ_goal^n and U_att = ½ξρ_goal² (Ge and Cui; with n > 0 the goal stays the minimum even beside
//! an obstacle). The walk from the front bumper follows −∇(U_rep + U_att) to the look-ahead point.

use crate::context::{PlannerContext, head_for};
use crate::explanation::{FieldSample, sample};
use crate::field::{DISTANCE_FLOOR_M, WALK_AHEAD_MIN_M, khatib_repulsion, walk_along_field};
use crate::goal::{Goal, LinesOfSight};
use crate::method::{Method, within};
use crate::nearest::Nearest;
use crate::search::{Dimension, Span};
use serde::{Deserialize, Serialize};
use sim::driver::{Decision, Policy};
use sim::geometry::Vec2;
use sim::maths;
use sim::sensing::{Observation, OccupancyGrid};
use std::sync::Arc;

/// Parameters of the artificial potential field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Params {
    /// Where the goal lies. Default straight ahead (*chosen*, as the paper did for the VVF).
    pub goal: Goal,
    /// Range ρ_0 of the repulsion, metres: 2.3, that of the paper's VVF (*chosen*).
    pub range_m: f32,
    /// η, that of the attraction ξ being 1: 1 (*recalled* from Ge and Cui's examples).
    pub repulsion_gain: f32,
    /// n: 2 (*recalled*); 0 is Khatib's plain form.
    pub goal_power: f32,
    /// Longest walk along the field, metres: 6, as for the VVF (*chosen*).
    pub walk_m: f32,
}

impl Params {
    /// −∇U at a point, from its nearest occupied cell within the range and the way to the goal.
    fn field(&self, nearest: Option<Nearest>, to_goal: Vec2) -> Vec2 {
        let Some(Nearest { distance_m, away }) = nearest else {
            return to_goal;
        };
        let distance_m = distance_m.max(DISTANCE_FLOOR_M);
        let goal_m = to_goal.length().max(DISTANCE_FLOOR_M);
        let off = khatib_repulsion(distance_m, self.range_m) * maths::pow(goal_m, self.goal_power);
        let gap = (1.0 / distance_m - 1.0 / self.range_m).max(0.0);
        let on = 0.5 * self.goal_power * gap * gap * maths::pow(goal_m, self.goal_power - 1.0);
        self.repulsion_gain * (off * away + on * to_goal / goal_m) + to_goal
    }
}

impl Method for Params {
    const NAME: &'static str = "apf";
    const ABOUT: &'static str =
        "artificial potential field of Ge and Cui with a goal straight ahead; literature parameters";
    const SEARCH: &'static [Dimension<Self>] = &[
        Dimension {
            name: "range_m",
            span: Span::Linear(0.8, 4.0),
            get: |p| p.range_m,
            set: |p, value| p.range_m = value,
        },
        Dimension {
            name: "repulsion_gain",
            span: Span::Log(0.01, 100.0),
            get: |p| p.repulsion_gain,
            set: |p, value| p.repulsion_gain = value,
        },
        Dimension {
            name: "goal_power",
            span: Span::Linear(0.0, 2.0),
            get: |p| p.goal_power,
            set: |p, value| p.goal_power = value,
        },
        Dimension {
            name: "walk_m",
            span: Span::Linear(1.0, 12.0),
            get: |p| p.walk_m,
            set: |p, value| p.walk_m = value,
        },
        Dimension {
            name: "goal",
            span: Span::Choice(2),
            get: |p| f32::from(u8::from(p.goal == Goal::FarthestVisible)),
            set: |p, index| p.goal = Goal::from_index(index),
        },
    ];
    type Planner = PotentialField;

    fn paper() -> Self {
        Self { goal: Goal::Ahead, range_m: 2.3, repulsion_gain: 1.0, goal_power: 2.0, walk_m: 6.0 }
    }

    fn check(&self) -> Result<(), String> {
        within("range_m", self.range_m, 0.3, 12.0)?;
        within("repulsion_gain", self.repulsion_gain, 0.0, 1e6)?;
        within("goal_power", self.goal_power, 0.0, 4.0)?;
        within("walk_m", self.walk_m, 0.1, 20.0)
    }

    fn planner(&self, context: &PlannerContext) -> PotentialField {
        PotentialField {
            params: self.clone(),
            sight: Arc::new(LinesOfSight::new(context)),
            context: Arc::new(context.clone()),
        }
    }
}

/// The artificial potential field at the wheel.
#[derive(Debug, Clone)]
pub struct PotentialField {
    params: Params,
    context: Arc<PlannerContext>,
    sight: Arc<LinesOfSight>,
}

impl PotentialField {
    /// The field over the patch.
    pub(crate) fn sampled(&self, grid: &OccupancyGrid) -> Vec<FieldSample> {
        let goal = self.sight.goal(self.params.goal, grid);
        sample(grid, &self.context, self.params.range_m, |point, nearest| self.params.field(nearest, goal - point))
    }
}

impl Policy for PotentialField {
    fn act(&mut self, observation: &Observation) -> Decision {
        let goal = self.sight.goal(self.params.goal, &observation.grid);
        let field = |point, nearest| self.params.field(nearest, goal - point);
        let end = walk_along_field(&observation.grid, &self.context, self.params.range_m, self.params.walk_m, field);
        head_for(Vec2::new(end.x.max(WALK_AHEAD_MIN_M), end.y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{context, grid_with};

    /// The field is the slope of the potential, by finite differences around an obstacle at the origin.
    #[test]
    fn the_field_is_minus_the_gradient_of_the_potential() {
        let params = Params { repulsion_gain: 1.7, goal_power: 1.5, ..Params::paper() };
        let goal = Vec2::new(5.0, -2.0);
        let potential = |point: Vec2| {
            let (gap, goal_m) = (1.0 / point.length() - 1.0 / params.range_m, point.distance(goal));
            0.5 * params.repulsion_gain * maths::pow(gap.max(0.0), 2.0) * maths::pow(goal_m, params.goal_power)
                + 0.5 * goal_m * goal_m
        };
        for point in [Vec2::new(1.0, 0.5), Vec2::new(-0.4, 1.1), Vec2::new(0.3, -1.9)] {
            let slope = |step: Vec2| (potential(point - step) - potential(point + step)) / 0.02;
            let expected = Vec2::new(slope(Vec2::X * 0.01), slope(Vec2::Y * 0.01));
            let nearest = Nearest { distance_m: point.length(), away: point.normalize() };
            let found = params.field(Some(nearest), goal - point);
            assert!(found.distance(expected) < 0.02 * expected.length(), "{point}: {found} instead of {expected}");
        }
        assert_eq!(params.field(None, goal), goal);
    }

    #[test]
    fn free_ground_is_driven_straight_and_an_obstacle_pushes_away() {
        let mut planner = Params::paper().planner(&context());
        assert_eq!(planner.act(&Observation { grid: OccupancyGrid::free() }).look_ahead.left_m, 0.0);
        let grid = grid_with(&[(16, 11), (17, 11)]);
        assert!(planner.act(&Observation { grid }).look_ahead.left_m < -0.3);
    }
}
