//! The reference path: an arc-length parametrised route of the rear axle. Metrics and resets use it; policies never.

use crate::geometry::{Pose, Vec2, wrap_angle};
use crate::maths;
use crate::scenario::ReferencePath;

/// Spacing of the samples, metres. Chords of a 5 m corner deviate from the arc by 0.4 mm.
const SAMPLE_M: f32 = 0.125;

/// A route sampled at (nearly) equal arc lengths.
#[derive(Debug, Clone)]
pub struct Path {
    poses: Vec<Pose>,
    spacing_m: f32,
    length_m: f32,
}

impl Path {
    /// Rounds the interior vertices of a polyline and samples it.
    ///
    /// # Panics
    /// If there are fewer than two points, or coincident ones: [`crate::validate::validate`] refuses those.
    pub fn new(reference: &ReferencePath) -> Self {
        let pieces = rounded(&reference.points, reference.corner_radius_m);
        let length_m: f32 = pieces.iter().map(|piece| piece.length_m).sum();
        assert!(length_m > 0.0, "a reference path has a length");
        let samples = (length_m / SAMPLE_M).ceil() as usize;
        let spacing_m = length_m / samples as f32;
        let mut poses = Vec::with_capacity(samples + 1);
        let (mut piece, mut piece_start_m) = (0, 0.0);
        for i in 0..=samples {
            let s_m = (i as f32 * spacing_m).min(length_m);
            while piece + 1 < pieces.len() && s_m > piece_start_m + pieces[piece].length_m {
                piece_start_m += pieces[piece].length_m;
                piece += 1;
            }
            let Piece { start, curvature_per_m, .. } = pieces[piece];
            poses.push(start.advanced_along_arc(curvature_per_m, s_m - piece_start_m));
        }
        Self { poses, spacing_m, length_m }
    }

    /// Arc length from start to finish, metres.
    pub fn length_m(&self) -> f32 {
        self.length_m
    }

    /// Samples from start to finish, evenly spaced by [`Self::spacing_m`].
    pub fn poses(&self) -> &[Pose] {
        &self.poses
    }

    /// Distance between two samples, metres.
    pub fn spacing_m(&self) -> f32 {
        self.spacing_m
    }

    /// Pose at an arc length, clamped to the path.
    pub fn pose_at(&self, s_m: f32) -> Pose {
        let position = (s_m / self.spacing_m).clamp(0.0, (self.poses.len() - 1) as f32);
        let i = (position as usize).min(self.poses.len() - 2);
        let t = position - i as f32;
        let (a, b) = (self.poses[i], self.poses[i + 1]);
        let heading_rad = wrap_angle(a.heading_rad + t * wrap_angle(b.heading_rad - a.heading_rad));
        Pose::new(a.position().lerp(b.position(), t), heading_rad)
    }

    /// Arc length of the nearest point of the whole path, metres.
    pub fn project_m(&self, point: Vec2) -> f32 {
        self.project_between_m(point, 0, self.poses.len() - 1)
    }

    /// Arc length of the nearest point within `[near_m − behind_m, near_m + ahead_m]`, metres. A local search, so that
    /// a route that comes close to itself does not make progress jump.
    pub fn project_near_m(&self, point: Vec2, near_m: f32, behind_m: f32, ahead_m: f32) -> f32 {
        let last = self.poses.len() - 1;
        let index = |s_m: f32| ((s_m / self.spacing_m).max(0.0) as usize).min(last);
        self.project_between_m(point, index(near_m - behind_m), (index(near_m + ahead_m) + 1).min(last))
    }

    fn project_between_m(&self, point: Vec2, first: usize, last: usize) -> f32 {
        let distances = self.poses[first..=last].iter().map(|pose| pose.position().distance_squared(point));
        let (nearest, _) = (first..)
            .zip(distances)
            .fold((first, f32::INFINITY), |nearest, other| if other.1 < nearest.1 { other } else { nearest });
        // Refine along the tangent of the nearest sample.
        let pose = self.poses[nearest];
        let along_m = (point - pose.position()).dot(pose.ahead()).clamp(-self.spacing_m, self.spacing_m);
        (nearest as f32 * self.spacing_m + along_m).clamp(0.0, self.length_m)
    }
}

/// A straight (curvature 0) or a circular arc.
struct Piece {
    start: Pose,
    curvature_per_m: f32,
    length_m: f32,
}

/// Lines and fillets. A fillet's radius shrinks where its tangents would take more than half of a segment.
fn rounded(points: &[Vec2], radius_m: f32) -> Vec<Piece> {
    assert!(points.len() >= 2, "a reference path has at least two points");
    let mut pieces = Vec::with_capacity(2 * points.len());
    let mut cursor = points[0];
    for i in 1..points.len() {
        let direction = (points[i] - points[i - 1]).normalize();
        let heading_rad = maths::angle_rad(direction);
        let next = points.get(i + 1).map(|&next| next - points[i]);
        let turn_rad = next.map_or(0.0, |next| wrap_angle(maths::angle_rad(next) - heading_rad));
        let half_tan = maths::tan(0.5 * turn_rad.abs());
        let room_m = 0.5 * (points[i] - points[i - 1]).length().min(next.map_or(f32::INFINITY, Vec2::length));
        let tangent_m = if next.is_some() { (radius_m * half_tan).min(room_m) } else { 0.0 };
        let line_end = points[i] - direction * tangent_m;
        let length_m = (line_end - cursor).dot(direction);
        if length_m > 0.0 {
            pieces.push(Piece { start: Pose::new(cursor, heading_rad), curvature_per_m: 0.0, length_m });
        }
        cursor = line_end;
        if tangent_m > 1e-4 && turn_rad.abs() > 1e-4 {
            let radius_m = tangent_m / half_tan;
            let start = Pose::new(line_end, heading_rad);
            let length_m = radius_m * turn_rad.abs();
            let arc = Piece { start, curvature_per_m: turn_rad.signum() / radius_m, length_m };
            cursor = start.advanced_along_arc(arc.curvature_per_m, length_m).position();
            pieces.push(arc);
        }
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rounded_right_angle_has_the_closed_form_length() {
        let points = vec![Vec2::ZERO, Vec2::new(20.0, 0.0), Vec2::new(20.0, 30.0)];
        let path = Path::new(&ReferencePath { points, corner_radius_m: 5.0 });
        let expected_m = 15.0 + 25.0 + 5.0 * std::f32::consts::FRAC_PI_2;
        assert!((path.length_m() - expected_m).abs() < 1e-3, "{} m, expected {expected_m} m", path.length_m());
        let end = path.pose_at(path.length_m());
        assert!(end.position().distance(Vec2::new(20.0, 30.0)) < 1e-3);
        assert!((end.heading_rad - std::f32::consts::FRAC_PI_2).abs() < 1e-3);
        // The middle of the corner lies on the circle around (15, 5).
        let middle = path.pose_at(15.0 + 2.5 * std::f32::consts::FRAC_PI_2);
        assert!((middle.position().distance(Vec2::new(15.0, 5.0)) - 5.0).abs() < 1e-3);
    }

    #[test]
    fn projecting_a_pose_of_the_path_returns_its_arc_length() {
        let points = vec![Vec2::ZERO, Vec2::new(20.0, 0.0), Vec2::new(20.0, 30.0), Vec2::new(-5.0, 30.0)];
        let path = Path::new(&ReferencePath { points, corner_radius_m: 5.0 });
        for s_m in [0.0, 3.3, 17.0, 21.9, 40.0, path.length_m()] {
            let offset = path.pose_at(s_m).world_from_ego().point(Vec2::new(0.0, 0.4));
            assert!((path.project_m(offset) - s_m).abs() < 0.02, "at {s_m} m: {}", path.project_m(offset));
            assert!((path.project_near_m(offset, s_m + 1.0, 5.0, 5.0) - s_m).abs() < 0.02);
        }
    }

    #[test]
    fn corners_tighten_on_short_segments_and_the_way_back_is_not_taken_for_the_way_there() {
        let points = vec![Vec2::ZERO, Vec2::new(20.0, 0.0), Vec2::new(20.0, 6.0), Vec2::new(0.0, 6.0)];
        let path = Path::new(&ReferencePath { points, corner_radius_m: 5.0 });
        // Two quarter turns of 3 m, half of the short segment.
        let length_m = 17.0 + 3.0 * std::f32::consts::PI + 17.0;
        assert!((path.length_m() - length_m).abs() < 1e-3, "{} m, expected {length_m} m", path.length_m());
        let nearer_the_way_back = Vec2::new(5.0, 3.5);
        assert!((path.project_m(nearer_the_way_back) - (length_m - 5.0)).abs() < 0.02);
        assert!((path.project_near_m(nearer_the_way_back, 5.0, 5.0, 5.0) - 5.0).abs() < 0.02);
    }
}
