//! From an arc to a look-ahead point: how far along (which decides the speed), and how fast it may move.

use crate::context::{ExpertContext, Scene};
use crate::elastic_band::{self, ElasticBand};
use crate::line_of_sight::LineOfSight;
use crate::search::FIRST_EXPONENT;
use crate::settings::ExpertSettings;
use sim::driver::LookAheadPoint;
use sim::geometry::{Pose, Vec2};
use sim::maths;

/// Step along a label's arc, metres.
const MARCH_M: f32 = 0.2;
/// Step from arc to arc in search of one that enters the patch on drivable ground, 1/m: 2 cm at the patch's lower edge.
const TURN_PER_M: f32 = 0.002;

/// A look-ahead point as pure pursuit follows it: a circle through the rear axle and a place on it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Label {
    /// Curvature of the circle, 1/m, positive to the left.
    pub(crate) curvature_per_m: f32,
    /// Arc length from the rear axle, metres.
    pub(crate) arc_length_m: f32,
}

impl Label {
    /// The label through a point ahead in the ego frame.
    fn through(in_ego: Vec2) -> Self {
        let curvature_per_m = LookAheadPoint { ahead_m: in_ego.x, left_m: in_ego.y }.curvature_per_m();
        let half_turn = maths::angle_rad(in_ego);
        let chord_m = in_ego.length();
        let arc_length_m = if half_turn.abs() < 1e-3 { chord_m } else { chord_m * half_turn / maths::sin(half_turn) };
        Self { curvature_per_m, arc_length_m }
    }

    /// The point in the ego frame.
    pub(crate) fn point(self) -> LookAheadPoint {
        let in_ego = on_arc(self.curvature_per_m, self.arc_length_m);
        LookAheadPoint { ahead_m: in_ego.x, left_m: in_ego.y }
    }

    /// Curvature index of the label, −1…1, on the scale of the first arcs.
    pub(crate) fn index(self, settings: &ExpertSettings) -> f32 {
        let share = (self.curvature_per_m / settings.curvature_max_per_m).clamp(-1.0, 1.0);
        maths::pow(share.abs(), 1.0 / FIRST_EXPONENT).copysign(share)
    }

    /// Moves from the last label towards this one, within the limits of a tick. The steering rate limits the car anyway;
    /// these limits keep the labels of neighbouring ticks from contradicting each other.
    pub(crate) fn smoothed(self, last: Self, settings: &ExpertSettings) -> Self {
        let lateral_per_m = 2.0 * settings.label_lateral_step_m / (last.arc_length_m * last.arc_length_m);
        let step_per_m = settings.label_curvature_step_per_m.min(lateral_per_m);
        let curvature_per_m =
            self.curvature_per_m.clamp(last.curvature_per_m - step_per_m, last.curvature_per_m + step_per_m);
        let arc_length_m = self.arc_length_m.clamp(
            last.arc_length_m - settings.label_retreat_step_m,
            last.arc_length_m + settings.label_advance_step_m,
        );
        Self { curvature_per_m, arc_length_m }
    }
}

/// Where a point may lie.
#[derive(Debug)]
pub(crate) struct Ground<'a> {
    pub(crate) settings: &'a ExpertSettings,
    pub(crate) context: &'a ExpertContext,
    pub(crate) scene: &'a Scene<'a>,
    pub(crate) sight: &'a LineOfSight,
}

impl Ground<'_> {
    /// How far along a band a point can be seen and reached over open ground, metres from the rear axle: the paper's
    /// third rule. Where the arc to a point comes near a boundary, it fades.
    pub(crate) fn open_way_m(&self, band: &ElasticBand) -> f32 {
        let near_m = self.context.geometry().near_edge_ahead_m;
        let mut reach_m = near_m;
        let mut open = 1.0_f32;
        let mut travel_m = near_m + elastic_band::SPACING_M;
        let settings = &self.settings.elastic_band;
        let (mut low, mut high) = (0.0_f32, 0.0_f32);
        let reference = self.scene.vehicle.pose.ahead();
        while travel_m <= band.length_m() && open > 0.0 {
            let turn_rad = reference.angle_to(band.heading_at(travel_m));
            (low, high) = (low.min(turn_rad), high.max(turn_rad));
            let straightness = (settings.bend_to_rad - (high - low)) / (settings.bend_to_rad - settings.bend_from_rad);
            open = open.min(straightness).min(self.openness(band, travel_m)).max(0.0);
            reach_m += open * elastic_band::SPACING_M;
            travel_m += elastic_band::SPACING_M;
        }
        reach_m
    }

    /// The label through a world point.
    pub(crate) fn label_at(&self, in_world: Vec2) -> Label {
        Label::through(self.scene.vehicle.pose.world_from_ego().inverse_point(in_world))
    }

    /// Whether the point after some travel lies in the open and the arc to it follows the band, 0…1.
    ///
    /// How near the arc comes to a boundary does not count: in a lane that would depend on centimetres that no grid of
    /// half-metre cells shows.
    fn openness(&self, band: &ElasticBand, travel_m: f32) -> f32 {
        let target = band.at(travel_m);
        if !self.sight.knows(target) {
            return 0.0;
        }
        let curvature_per_m = self.label_at(target).curvature_per_m;
        let world_from_ego = self.scene.vehicle.pose.world_from_ego();
        let aside_m = band
            .until(travel_m)
            .map(|point| distance_to_arc_m(curvature_per_m, world_from_ego.inverse_point(point)))
            .fold(0.0, f32::max);
        let gap_m = self.scene.field.at(target);
        let settings = &self.settings.elastic_band;
        let follows = (settings.aside_to_m - aside_m) / (settings.aside_to_m - settings.aside_from_m);
        let is_open = (gap_m - settings.gap_from_m) / (settings.gap_to_m - settings.gap_from_m);
        follows.min(is_open).clamp(0.0, 1.0)
    }

    /// The nearest point of an arc: the slowest.
    pub(crate) fn nearest_label_on(&self, curvature_per_m: f32) -> Label {
        Label { curvature_per_m, arc_length_m: self.arc_lengths_in_patch_m(curvature_per_m).0 }
    }

    /// Rule one: the point lies inside drivable space, and inside the patch. Where the arc of the label enters the patch on
    /// ground that is not drivable, the next arc to it that does not is taken; if every arc does, the label stays on its own.
    pub(crate) fn kept_drivable(&self, label: Label) -> Label {
        let max_per_m = self.settings.curvature_max_per_m;
        let label = Label { curvature_per_m: label.curvature_per_m.clamp(-max_per_m, max_per_m), ..label };
        let label = Label { curvature_per_m: self.nearest_open_arc_per_m(label.curvature_per_m), ..label };
        let (near_m, far_m) = self.arc_lengths_in_patch_m(label.curvature_per_m);
        let drivable_m = if label.arc_length_m <= near_m { near_m } else { self.drivable_arc_length_m(label) };
        Label { arc_length_m: label.arc_length_m.min(drivable_m).clamp(near_m, far_m), ..label }
    }

    /// The nearest curvature whose arc enters the patch on drivable ground, 1/m; this one if there is none.
    fn nearest_open_arc_per_m(&self, curvature_per_m: f32) -> f32 {
        let max_per_m = self.settings.curvature_max_per_m;
        let steps = (2.0 * max_per_m / TURN_PER_M) as u32;
        let nearest_first = (0..=steps).flat_map(|step| [1.0, -1.0].map(|side| side * step as f32 * TURN_PER_M));
        nearest_first
            .map(|turn_per_m| curvature_per_m + turn_per_m)
            .filter(|curvature_per_m| curvature_per_m.abs() <= max_per_m)
            .find(|&curvature_per_m| self.is_drivable(curvature_per_m, self.arc_lengths_in_patch_m(curvature_per_m).0))
            .unwrap_or(curvature_per_m)
    }

    /// How far along the arc of a label every point keeps its clearance, metres from the rear axle, within the patch: as far
    /// as the label lies, and up to a step farther.
    fn drivable_arc_length_m(&self, Label { curvature_per_m, arc_length_m: wanted_m }: Label) -> f32 {
        let (near_m, far_m) = self.arc_lengths_in_patch_m(curvature_per_m);
        let mut arc_length_m = near_m;
        while arc_length_m < far_m.min(wanted_m) {
            let next_m = (arc_length_m + MARCH_M).min(far_m);
            if !self.is_drivable(curvature_per_m, next_m) {
                break;
            }
            arc_length_m = next_m;
        }
        arc_length_m
    }

    /// Whether the point at an arc length keeps its clearance and can be known.
    fn is_drivable(&self, curvature_per_m: f32, arc_length_m: f32) -> bool {
        let in_world = self.scene.vehicle.pose.world_from_ego().point(on_arc(curvature_per_m, arc_length_m));
        self.scene.field.at(in_world) >= self.settings.point_clearance_m && self.sight.knows(in_world)
    }

    /// Arc lengths at which an arc enters the patch, and at which it leaves it or has turned as far as a label may.
    fn arc_lengths_in_patch_m(&self, curvature_per_m: f32) -> (f32, f32) {
        // X = sin(κs)/κ and |Y| = (1 − cos(κs))/|κ|, kept a millimetre inside.
        let kappa = curvature_per_m.abs().max(1e-5);
        let geometry = self.context.geometry();
        let (near_x, far_x) = (geometry.near_edge_ahead_m + 1e-3, geometry.far_edge_ahead_m() - 1e-3);
        let half_y = 0.5 * geometry.side_m - 1e-3;
        let arc_length_at_x = |x_m: f32| maths::asin((kappa * x_m).min(1.0)) / kappa;
        let arc_length_at_y = |y_m: f32| maths::acos((1.0 - kappa * y_m).max(-1.0)) / kappa;
        let near_m = arc_length_at_x(near_x);
        let far_m = arc_length_at_x(far_x).min(arc_length_at_y(half_y)).min(self.settings.label_turn_max_rad / kappa);
        (near_m, far_m.max(near_m))
    }
}

/// Distance of a point to the circle of an arc, ego frame, metres.
fn distance_to_arc_m(curvature_per_m: f32, in_ego: Vec2) -> f32 {
    // |p − c| − R with c = (0, 1/κ), written so that it holds for κ = 0.
    let excess = curvature_per_m * in_ego.length_squared() - 2.0 * in_ego.y;
    (excess / (1.0 + (1.0 + curvature_per_m * excess).max(0.0).sqrt())).abs()
}

/// The point at an arc length along a circle through the rear axle, ego frame.
fn on_arc(curvature_per_m: f32, arc_length_m: f32) -> Vec2 {
    Pose::default().advanced_along_arc(curvature_per_m, arc_length_m).position()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::episode::EpisodeSettings;
    use sim::map::Map;
    use sim::scenario::{Obstacle, ObstacleClass, Scenario};
    use sim::vehicle::VehicleState;

    #[test]
    fn labels_move_within_the_limits_of_a_tick() {
        let settings = ExpertSettings::half_points();
        let last = Label { curvature_per_m: 0.0, arc_length_m: 6.0 };
        let wanted = Label { curvature_per_m: 0.2, arc_length_m: 14.0 };
        let smoothed = wanted.smoothed(last, &settings);
        assert_eq!(smoothed, Label { curvature_per_m: 0.012, arc_length_m: 6.2 });
        let back = Label { curvature_per_m: -0.2, arc_length_m: 4.0 }.smoothed(wanted, &settings);
        assert!((back.arc_length_m - 13.6).abs() < 1e-6);
        // 2 · 0.5 / 14² = .0051: half a metre sideways at 14 m.
        assert!((0.2 - back.curvature_per_m - 0.0051).abs() < 1e-4);
        assert_eq!(wanted.smoothed(wanted, &settings), wanted);
    }

    /// Heads for the edge of a lane, which lies between bumper and patch: the arc to the label, and its nearest station, are
    /// on the far side of it.
    #[test]
    fn a_label_whose_nearest_station_is_blocked_is_turned_onto_drivable_ground() {
        let (episode, settings) = (EpisodeSettings::paper(), ExpertSettings::half_points());
        let context = ExpertContext::of(&episode);
        let map = Map::build(Scenario::lane(-20.0..=60.0, 6.0, -5.0..=50.0), &episode.vehicle).unwrap();
        let pose = Pose::new(Vec2::new(0.0, 1.0), 0.5);
        let scene = Scene { field: map.distance_field(), vehicle: VehicleState::at_rest(pose), route: None };
        let sight = LineOfSight::new(settings.sees, &map, pose, &context.sensing);
        let ground = Ground { settings: &settings, context: &context, scene: &scene, sight: &sight };
        let clearance_m = |label: Label| {
            let LookAheadPoint { ahead_m, left_m } = label.point();
            map.distance_field().at(pose.world_from_ego().point(Vec2::new(ahead_m, left_m)))
        };
        let straight = Label { curvature_per_m: 0.0, arc_length_m: 6.0 };
        assert!(clearance_m(ground.nearest_label_on(0.0)) < 0.0, "the patch begins beyond the edge");
        let kept = ground.kept_drivable(straight);
        assert!(clearance_m(kept) >= settings.point_clearance_m - 1e-3, "{kept:?}: {} m", clearance_m(kept));
        assert!(kept.curvature_per_m < 0.0, "away from the edge: {kept:?}");
        let turned_less = Label { curvature_per_m: kept.curvature_per_m + TURN_PER_M, ..kept };
        assert!(clearance_m(ground.nearest_label_on(turned_less.curvature_per_m)) < settings.point_clearance_m);
        // Nothing that can be reached is drivable: the label stays on its arc.
        let outside = Pose::new(Vec2::new(0.0, 9.0), 1.5);
        let scene = Scene { vehicle: VehicleState::at_rest(outside), ..scene };
        let kept = Ground { scene: &scene, ..ground }.kept_drivable(straight);
        assert_eq!(kept.curvature_per_m, 0.0);
    }

    /// A pillar whose near side is 9.65 m ahead: the last step of 0.2 m from the patch's lower edge on that keeps 0.1 m from it
    /// ends at 9.50 m. Nothing beyond the label counts.
    #[test]
    fn a_label_stays_where_its_arc_is_drivable_and_ends_where_it_is_not() {
        let (episode, settings) = (EpisodeSettings::paper(), ExpertSettings::half_points());
        let context = ExpertContext::of(&episode);
        let pillar = Obstacle::new(ObstacleClass::Pillar, Pose::new(Vec2::new(10.0, 0.1), 0.0));
        let lane = Scenario::lane(-20.0..=60.0, 6.0, -5.0..=5.0).with_obstacles([pillar]);
        let map = Map::build(lane, &episode.vehicle).unwrap();
        let scene = Scene { field: map.distance_field(), vehicle: VehicleState::at_rest(Pose::default()), route: None };
        let sight = LineOfSight::of_everything();
        let ground = Ground { settings: &settings, context: &context, scene: &scene, sight: &sight };
        let kept_m = |arc_length_m| ground.kept_drivable(Label { curvature_per_m: 0.0, arc_length_m }).arc_length_m;
        let last_m = kept_m(16.0);
        assert!((last_m - 9.5).abs() < 0.01, "{last_m} m");
        for step in 0..60_u8 {
            let wanted_m = 4.4 + 0.2 * f32::from(step);
            assert_eq!(kept_m(wanted_m), wanted_m.min(last_m));
        }
    }

    #[test]
    fn the_index_undoes_the_spacing_of_the_arcs() {
        let settings = ExpertSettings::half_points();
        for index in [-1.0_f32, -0.3, 0.0, 0.5] {
            let curvature_per_m =
                settings.curvature_max_per_m * maths::pow(index.abs(), FIRST_EXPONENT).copysign(index);
            assert!((Label { curvature_per_m, arc_length_m: 5.0 }.index(&settings) - index).abs() < 1e-5);
        }
    }
}
