//! Velocity vector field (paper, "VVF Algorithm"; docs/methods.md 7.1): pushed off by the nearest obstacle, drawn forward.
//!
//! "The repulsive, attractive, and velocity fields were set to a ratio of 1:0:0.5" (paper): no goal, so no attraction.
//!
//! V = F̂ + 0.5·(1 − μ·m(ρ))·f̂, with ρ the distance to the nearest occupied cell, f̂ straight ahead, and m = 1 where
//! ρ < ρ_0 = 2.3 m, 0 elsewhere. F̂ is the repulsion limited to |F̂| < 1 by F/(1 + |F|), because 1/ρ³ would outweigh
//! all else (*chosen*). The look-ahead point is where a walk along V from the front bumper ends.

use crate::context::{PlannerContext, head_for};
use crate::explanation::{FieldSample, sample};
use crate::field::{DISTANCE_FLOOR_M, WALK_AHEAD_MIN_M, khatib_repulsion, walk_along_field};
use crate::method::{Method, Reading, within};
use crate::nearest::Nearest;
use crate::search::{Dimension, Span};
use serde::{Deserialize, Serialize};
use sim::driver::{Decision, Policy};
use sim::geometry::Vec2;
use sim::sensing::{Observation, OccupancyGrid};
use std::sync::Arc;

/// Parameters of the velocity vector field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Params {
    /// Form of the repulsion. Default Khatib's (*chosen*; the cited work contains no "VVF").
    pub repulsion: Repulsion,
    /// Range ρ_0 of the repulsion, metres: 2.3 (*paper*).
    pub range_m: f32,
    /// Weight of the velocity field, that of the repulsion being 1: 0.5 (*paper*).
    pub velocity_weight: f32,
    /// μ: by how much the velocity field is masked within the range, 0…1. "Only the repulsive field was applied around
    /// obstacles with a range of 2.3 m" (*paper*) reads as 1, the ratio 1:0:0.5 as 0; 0.5 (*chosen*), because in a lane
    /// under 4.6 m μ = 1 leaves no forward field.
    pub mask: f32,
    /// Longest walk along the field, metres: 6 (*chosen*).
    pub walk_m: f32,
    /// The look-ahead point is at least this far ahead of the rear axle, metres: 2.3 (*chosen*).
    pub ahead_min_m: f32,
}

/// How the repulsion falls with the distance ρ.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Repulsion {
    /// (1/ρ − 1/ρ_0)/ρ² (Khatib 1986; Ge and Cui 2000 without their goal).
    Khatib,
    /// 1/ρ within the range: what is left of Wang 2015's field for things at rest (*recalled*).
    InverseR,
}

impl Repulsion {
    const OPTIONS: [Self; 2] = [Self::Khatib, Self::InverseR];

    /// F at a distance, not squashed.
    fn at(self, distance_m: f32, range_m: f32) -> f32 {
        match self {
            Self::Khatib => khatib_repulsion(distance_m, range_m),
            Self::InverseR if distance_m < range_m => 1.0 / distance_m,
            Self::InverseR => 0.0,
        }
    }
}

impl Params {
    /// V, from the nearest occupied cell within the range.
    fn field(&self, nearest: Option<Nearest>) -> Vec2 {
        let Some(Nearest { distance_m, away }) = nearest else {
            return self.velocity_weight * Vec2::X;
        };
        let repulsion = self.repulsion.at(distance_m.max(DISTANCE_FLOOR_M), self.range_m);
        repulsion / (1.0 + repulsion) * away + self.velocity_weight * (1.0 - self.mask) * Vec2::X
    }
}

impl Params {
    /// The literal sentence: no wish to go ahead within the range.
    fn masked() -> Self {
        Self { mask: 1.0, ..Self::paper() }
    }

    /// The literal ratio: 1 : 0 : 0.5 everywhere.
    fn sum() -> Self {
        Self { mask: 0.0, ..Self::paper() }
    }
}

impl Method for Params {
    const NAME: &'static str = "vvf";
    const ABOUT: &'static str = "repulsion of the nearest obstacle plus a field pointing ahead; the paper's parameters";
    const SEARCH: &'static [Dimension<Self>] = &[
        Dimension {
            name: "range_m",
            span: Span::Linear(0.8, 4.0),
            get: |p| p.range_m,
            set: |p, value| p.range_m = value,
        },
        Dimension {
            name: "velocity_weight",
            span: Span::Log(0.05, 2.0),
            get: |p| p.velocity_weight,
            set: |p, value| p.velocity_weight = value,
        },
        Dimension { name: "mask", span: Span::Linear(0.0, 1.0), get: |p| p.mask, set: |p, value| p.mask = value },
        Dimension {
            name: "walk_m",
            span: Span::Linear(1.0, 12.0),
            get: |p| p.walk_m,
            set: |p, value| p.walk_m = value,
        },
        Dimension {
            name: "repulsion",
            span: Span::Choice(2),
            get: |p| f32::from(u8::from(p.repulsion == Repulsion::InverseR)),
            set: |p, index| p.repulsion = Repulsion::OPTIONS[index as usize],
        },
    ];
    const READINGS: &'static [Reading<Self>] = &[
        Reading {
            name: "masked",
            about: "within the range only the repulsion counts, as printed",
            params: Params::masked,
        },
        Reading { name: "sum", about: "the fields are added everywhere", params: Params::sum },
    ];
    type Planner = VelocityVectorField;

    fn paper() -> Self {
        Self {
            repulsion: Repulsion::Khatib,
            range_m: 2.3,
            velocity_weight: 0.5,
            mask: 0.5,
            walk_m: 6.0,
            ahead_min_m: WALK_AHEAD_MIN_M,
        }
    }

    fn check(&self) -> Result<(), String> {
        within("range_m", self.range_m, 0.3, 12.0)?;
        within("velocity_weight", self.velocity_weight, 0.0, 100.0)?;
        within("mask", self.mask, 0.0, 1.0)?;
        within("walk_m", self.walk_m, 0.1, 20.0)?;
        within("ahead_min_m", self.ahead_min_m, 0.2, 12.0)
    }

    fn planner(&self, context: &PlannerContext) -> VelocityVectorField {
        VelocityVectorField { params: self.clone(), context: Arc::new(context.clone()) }
    }
}

/// The velocity vector field at the wheel.
#[derive(Debug, Clone)]
pub struct VelocityVectorField {
    params: Params,
    context: Arc<PlannerContext>,
}

impl VelocityVectorField {
    /// The field over the patch.
    pub(crate) fn sampled(&self, grid: &OccupancyGrid) -> Vec<FieldSample> {
        sample(grid, &self.context, self.params.range_m, |_, nearest| self.params.field(nearest))
    }
}

impl Policy for VelocityVectorField {
    fn act(&mut self, observation: &Observation) -> Decision {
        let Params { range_m, walk_m, ahead_min_m, .. } = self.params;
        let field = |_, nearest| self.params.field(nearest);
        let end = walk_along_field(&observation.grid, &self.context, range_m, walk_m, field);
        head_for(Vec2::new(end.x.max(ahead_min_m), end.y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{context, grid_with};

    /// At ρ = 1 m to the left: F = (1 − 1/2.3)/1 = .5652, squashed .3611 to the right; forward .5·(1 − .5).
    #[test]
    fn the_field_is_the_weighted_sum() {
        let left = Some(Nearest { distance_m: 1.0, away: -Vec2::Y });
        let paper = Params::paper();
        assert!(paper.field(left).distance(Vec2::new(0.25, -0.3611)) < 1e-4, "{}", paper.field(left));
        assert_eq!(paper.field(None), Vec2::new(0.5, 0.0));
        let literal = Params { mask: 1.0, ..Params::paper() };
        assert_eq!(literal.field(left).x, 0.0, "only the repulsive field");
        let sum = Params { mask: 0.0, ..Params::paper() };
        assert_eq!(sum.field(left).x, 0.5);
        let mild = Params { repulsion: Repulsion::InverseR, ..Params::paper() };
        assert!((mild.field(left).y + 0.5).abs() < 1e-6, "1/1 squashed is 1/2");
        // At the range's end the repulsion is gone; nearer than half a cell it no longer grows.
        assert_eq!(khatib_repulsion(2.3, 2.3), 0.0);
        let at = |distance_m| paper.field(Some(Nearest { distance_m, away: Vec2::Y })).y;
        assert_eq!(at(0.1), at(0.24));
    }

    #[test]
    fn free_ground_is_driven_straight_for_the_whole_walk() {
        let mut planner = Params::paper().planner(&context());
        let answer = planner.act(&Observation { grid: OccupancyGrid::free() }).look_ahead;
        assert!((answer.ahead_m - 9.8).abs() < 1e-3 && answer.left_m == 0.0, "{answer:?}");
    }

    /// A wall slants across 0.5 m ahead of the bumper, as after a resume in a right-hand corner. It pushes back and to the
    /// right; the walk slides along it to where it ends: a hard turn to the right, not "straight on".
    #[test]
    fn a_wall_at_the_bumper_is_turned_away_from() {
        let mut planner = Params::paper().planner(&context());
        let mut grid = OccupancyGrid::free();
        for row in 0..25 {
            // Columns up to 11 in row 24 (X 4.30…4.78), one more to the right per row farther away.
            grid.occupy_row(row, u32::MAX >> (31 - (35 - row).min(24)));
        }
        let answer = planner.act(&Observation { grid }).look_ahead;
        assert!(answer.left_m < -2.0, "{answer:?}");
    }

    /// In a straight lane the pushes of both sides are equal and opposite: straight on. A cell more on the left side
    /// turns it to the right.
    #[test]
    fn a_lane_is_kept_and_an_obstacle_pushes_away() {
        let mut planner = Params::paper().planner(&context());
        let mut grid = OccupancyGrid::free();
        for row in 0..25 {
            grid.occupy_row(row, 0x1FF_01FF);
        }
        let answer = planner.act(&Observation { grid }).look_ahead;
        assert!(answer.left_m.abs() < 1e-4 && answer.ahead_m > 9.0, "{answer:?}");
        let grid = grid_with(&[(16, 11), (17, 11)]);
        assert!(planner.act(&Observation { grid }).look_ahead.left_m < -0.5);
    }
}
