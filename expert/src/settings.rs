//! Settings of the scripted expert.

use serde::{Deserialize, Serialize};

/// Which ground the expert may plan over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sees {
    /// All of the clean map.
    #[default]
    WholeMap,
    /// Ground outside the bird's-eye patch, or hidden behind tall things, is unknown, and taken for free. Ground beside
    /// and behind the car counts as known.
    PatchOnly,
}

/// How plans are scored: free travel in units of [`Self::unit_m`], and the weights of everything else.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanWeights {
    /// Free travel that is worth 1, metres (docs/methods.md 3.2: side of the patch).
    pub unit_m: f32,
    /// Mean obstacle load along the plan (docs/methods.md 3.2; insensitive between .35 and .7, docs/methods.md E5).
    pub load: f32,
    /// Curvature index of the first arc, 0…1 (docs/methods.md E5.1).
    pub first_curvature: f32,
    /// Curvature index of the second arc, 0…1 (docs/methods.md E5.1).
    pub second_curvature: f32,
    /// Free travel of the first arc alone: longer first arcs are faster by 10 % (docs/methods.md E5.1).
    pub first_free: f32,
    /// Change of the curvature index since the last label, 0…2 (docs/methods.md E5.1).
    pub change: f32,
}

/// How the way ahead is smoothed. All chosen, and tuned on lot a for labels that move little when the car is moved by
/// 5 cm (`examples/label_sources`): the paper says only that the distance to obstacles is kept as large as possible.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ElasticBandSettings {
    /// Rounds of relaxation: enough that the band hardly depends on the plan it came from.
    pub iterations: u32,
    /// Obstacles nearer than this push the band away, metres: half the width of the widest lane with a middle.
    pub comfort_m: f32,
    /// Share of the way to the middle taken per round where one metre is missing on one side.
    pub middle_gain: f32,
    /// A point is drawn to the middle of the points this far before and behind it: bends are rounded over that, metres.
    pub stiffness_m: f32,
    /// Share of the way to straightness taken per round.
    pub straight_gain: f32,
    /// Longest move per round, metres.
    pub step_max_m: f32,
    /// The point moves nearer where the arc to it strays from the band by more than this, metres …
    pub aside_from_m: f32,
    /// … and no point lies where it strays by this.
    pub aside_to_m: f32,
    /// No point lies where the band comes nearer to a boundary than this, metres …
    pub gap_from_m: f32,
    /// … and it moves nearer where the band comes nearer than this.
    pub gap_to_m: f32,
    /// The point lies this share of the open way ahead of the bumper: 1 is "as far as possible"; 0.5 takes the paper's
    /// half "for safety reasons" from the point instead of the speed (see `SpeedLaw`). The knob for the speed.
    pub reach_share: f32,
    /// … and at most this far ahead of the bumper, metres.
    pub reach_max_m: f32,
    /// The car is steered at the point of the band this far ahead of the axle, metres; nearer where that is not safe.
    pub steer_m: f32,
    /// And not nearer than this, metres …
    pub steer_near_m: f32,
    /// … which it is where the band turns by this, radians: pursuit of a far point cuts corners.
    pub steer_bend_rad: f32,
    /// Length of the forecast that checks whether steering at the point is safe, metres.
    pub forecast_m: f32,
    /// The point moves nearer where the band bends more than this on the way to it …
    pub bend_from_rad: f32,
    /// … and no point lies beyond a bend of this, radians.
    pub bend_to_rad: f32,
    /// A nearer point, and at last the plan's own arc, takes over where that forecast keeps less than this …
    pub trust_to_m: f32,
    /// … and wholly below this, metres.
    pub trust_from_m: f32,
}

/// Settings of [`crate::ScriptedExpert`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExpertSettings {
    /// Which ground it may plan over.
    pub sees: Sees,
    /// Decisions are this late, seconds (realism; 0 = off).
    pub reaction_delay_s: f32,
    /// Standard deviation of white noise on labels, image fractions per axis (realism; 0 = off).
    pub label_jitter: f32,

    /// Tightest arc of a label, 1/m. The tightest circle that meets the patch at all has 1/4.30 m = .2326, but there
    /// the label's sideways place has infinite slope in the curvature (docs/methods.md E5.6).
    pub curvature_max_per_m: f32,
    /// Tightest second arc, 1/m: those are never labels (docs/methods.md E5.1).
    pub second_curvature_max_per_m: f32,
    /// Travels along the first arc at which second arcs branch off, metres, increasing (docs/methods.md E5.1).
    pub branch_travels_m: [f32; 5],
    /// Length of a forecast, metres (docs/methods.md E5.1; insensitive between 14 and 18).
    pub horizon_m: f32,
    /// Step along first arcs, metres (docs/methods.md E5.1).
    pub first_step_m: f32,
    /// Step along second arcs, metres (docs/methods.md E5.1).
    pub second_step_m: f32,

    /// Clearance a forecast must keep, metres: the comfortable one first, then what is relaxed to when no plan is
    /// left (docs/methods.md E5.3: .30 leaves nothing in lanes of 2.7 to 3.0 m).
    pub clearances_m: [f32; 3],
    /// A plan that is free for less than this does not avoid what is ahead, metres (chosen: the shortest stop from
    /// 0.5 m/s plus the 0.5 m of a near-collision plus a nose margin, with a metre to steer).
    pub avoidable_m: f32,
    /// Within this travel the present clearance is good enough: else a tight start kills every arc, metres
    /// (docs/methods.md E5.3).
    pub tight_start_m: f32,
    /// The body is lengthened by this at the nose, metres: mirrors the near-collision rule (docs/methods.md E5.4).
    pub nose_margin_m: f32,
    /// A little less than half of what the covering discs overstate the half-width by is given back, metres
    /// (docs/methods.md E5.4: radius 1.034 m, clearance = distance − 0.987 m).
    pub disc_relief_m: f32,
    /// Something nearer than this is an obstacle load, metres (docs/methods.md 3.2).
    pub load_range_m: f32,
    /// What makes a plan good.
    pub weights: PlanWeights,
    /// How the way ahead is smoothed.
    pub elastic_band: ElasticBandSettings,
    /// A plan must gain this share of its travel along the route: no turning back (docs/methods.md 3.2).
    pub progress_share: f32,

    /// Clearance of the point and of the way to it, metres (docs/methods.md E5.2).
    pub point_clearance_m: f32,
    /// Free travel along the first arc below which an obstacle is "ahead", metres (docs/methods.md 3.2.5). For counting.
    pub obstacle_ahead_m: f32,

    /// A label lies at most this far round its circle, radians, or where the circle enters the patch if that is farther
    /// round. Farther round, the point moves by metres when the curvature changes a little, and beyond π/2 a farther point
    /// would mean a lower speed.
    pub label_turn_max_rad: f32,
    /// Largest change of a label's curvature per tick, 1/m (docs/methods.md E5.5; the steering manages .006) …
    pub label_curvature_step_per_m: f32,
    /// … and largest sideways move it may cause at the last range, metres (docs/methods.md E5.5).
    pub label_lateral_step_m: f32,
    /// Largest growth of a label's range per tick, metres (docs/methods.md E5.5).
    pub label_advance_step_m: f32,
    /// Largest drop of a label's range per tick, metres (docs/methods.md E5.5).
    pub label_retreat_step_m: f32,
}

impl ExpertSettings {
    /// With the delay and the unsteadiness of a person who points (docs/methods.md 3.3).
    #[must_use]
    pub fn with_hand_of_a_person(self) -> Self {
        Self { reaction_delay_s: 0.3, label_jitter: 0.0097, ..self }
    }

    /// The paper's three rules as printed, points "as far as possible" (rule three), with the measured recipe of
    /// docs/methods.md E5: the paper itself gives no number. What the paper halves is the speed
    /// (`sim::controller::SpeedLaw::Halved`).
    pub fn paper() -> Self {
        Self {
            sees: Sees::WholeMap,
            reaction_delay_s: 0.0,
            label_jitter: 0.0,
            curvature_max_per_m: 0.215,
            second_curvature_max_per_m: 0.2326,
            branch_travels_m: [0.8, 2.0, 3.6, 5.4, 7.6],
            horizon_m: 14.0,
            first_step_m: 0.2,
            second_step_m: 0.3,
            clearances_m: [0.20, 0.10, 0.03],
            avoidable_m: 3.0,
            tight_start_m: 2.5,
            nose_margin_m: 0.5,
            disc_relief_m: 0.047,
            load_range_m: 1.2,
            weights: PlanWeights {
                unit_m: 12.0,
                load: 0.35,
                first_curvature: 0.05,
                second_curvature: 0.025,
                first_free: 0.3,
                change: 0.1,
            },
            elastic_band: ElasticBandSettings {
                iterations: 60,
                comfort_m: 2.2,
                middle_gain: 0.5,
                stiffness_m: 0.6,
                straight_gain: 0.5,
                step_max_m: 0.15,
                aside_from_m: 0.6,
                aside_to_m: 1.5,
                gap_from_m: 0.5,
                gap_to_m: 0.9,
                reach_share: 1.0,
                reach_max_m: 9.3,
                steer_m: 7.0,
                steer_near_m: 2.7,
                steer_bend_rad: 0.4,
                forecast_m: 6.0,
                bend_from_rad: 0.6,
                bend_to_rad: 1.5,
                trust_to_m: 0.4,
                trust_from_m: 0.1,
            },
            progress_share: 0.3,
            point_clearance_m: 0.1,
            obstacle_ahead_m: 8.0,
            label_turn_max_rad: 0.8,
            label_curvature_step_per_m: 0.012,
            label_lateral_step_m: 0.5,
            label_advance_step_m: 0.4,
            label_retreat_step_m: 0.8,
        }
    }

    /// Our reading, which is not in the paper: points at half of the open way, driven at without halving the speed
    /// (`sim::controller::SpeedLaw::Full`). The car drives about the same, labels are easier to learn (docs/paper.md,
    /// "Points at half of the open way"). Ranges and their steps are halved.
    pub fn half_points() -> Self {
        let paper = Self::paper();
        Self {
            elastic_band: ElasticBandSettings { reach_share: 0.5, reach_max_m: 4.65, ..paper.elastic_band },
            label_advance_step_m: 0.2,
            label_retreat_step_m: 0.4,
            ..paper
        }
    }
}
