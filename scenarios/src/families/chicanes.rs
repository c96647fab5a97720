//! Roads on which barriers from either side in turn make traffic wind: pieces of wall, containers, parked lorries, rows of
//! cones, planters; at check points, on building sites, in streets where traffic is calmed.

use super::parts::driven_m;
use super::strip::Strip;
use super::things::{self, Rules, Things, side};
use super::winding::Winding;
use crate::clutter::{draw_car, yaw_rad};
use crate::corridor::{Side, to_millimetres};
use rand::RngExt as _;
use sim::geometry::{Pose, rectangle};
use sim::scenario::{Island, ObstacleClass, Scenario};
use sim::seed::Rng;
use std::f32::consts::FRAC_PI_2;
use std::ops::Range;

const ROAD: Winding = Winding {
    width_m: 5.5..12.0,
    first_m: 20.0..60.0,
    straight_m: 20.0..60.0,
    bend_share: 0.5,
    turn_deg: 10.0..60.0,
    radius_m: 25.0..80.0,
    solid_of_ten: 4,
};
/// What barriers leave free on a road of barriers that leave little, and of others, metres.
const NARROW_M: Range<f32> = 3.0..3.8;
const WIDE_M: Range<f32> = 3.8..5.5;
/// The car changes from one side to the other in arcs of this radius, metres.
const WEAVING_RADIUS_M: Range<f32> = 8.0..16.0;
/// And drives on for so long before it changes back, metres.
const BETWEEN_M: Range<f32> = 4.0..14.0;

/// What barriers are made of.
#[derive(Clone, Copy)]
enum Barrier {
    Wall,
    Container,
    Parked,
    Cones,
    Planter,
}

pub(super) fn draw(layout: &mut Rng, obstacles: &mut Rng) -> Option<(Scenario, Strip)> {
    ROAD.draw(layout, obstacles, |things, strip, rng| {
        let (from_m, to_m) = driven_m(strip);
        barriers(things, strip, from_m..to_m, rng);
    })
}

/// On a stretch of one width, one behind the other, mostly from the other side than the one before.
pub(super) fn barriers(things: &mut Things<'_>, strip: &Strip, stretch_m: Range<f32>, rng: &mut Rng) {
    use Barrier::{Cones, Container, Parked, Planter, Wall};
    let palette: &[Barrier] = match rng.random_range(0..5) {
        0 | 1 => &[Wall],
        2 => &[Container, Parked],
        3 => &[Planter, Cones],
        _ => &[Wall, Container, Parked, Cones, Planter],
    };
    let gap_m = if rng.random_bool(0.6) { NARROW_M } else { WIDE_M };
    let width_m = 2.0 * strip.half_width_m(stretch_m.start);
    let mut side = side(rng);
    let mut at_m = stretch_m.start + rng.random_range(9.0..20.0);
    while at_m < stretch_m.end {
        let gap_m = rng.random_range(gap_m.clone());
        let kind = palette[rng.random_range(0..palette.len())];
        let along_m = match kind {
            Wall => rng.random_range(0.2..1.0),
            Container => rng.random_range(2.4..8.0),
            Parked => 4.6,
            Cones => 0.4,
            Planter => rng.random_range(1.0..5.0),
        };
        stand(things, strip, &Stand { kind, side, from_m: at_m, along_m, protrusion_m: width_m - gap_m }, rng);
        if rng.random_bool(0.85) {
            side = side.opposite();
        }
        // From gap to gap in two arcs, one turned against the other.
        let aside_m = (width_m - gap_m).max(0.5);
        let radius_m = rng.random_range(WEAVING_RADIUS_M);
        let weaving_m = (aside_m * (4.0 * radius_m - aside_m)).max(0.0).sqrt();
        at_m += along_m + weaving_m + rng.random_range(BETWEEN_M);
    }
}

/// A barrier and where it stands.
struct Stand {
    kind: Barrier,
    side: Side,
    /// Where it begins along the axis, metres.
    from_m: f32,
    /// Its length along the axis, metres.
    along_m: f32,
    /// How far it reaches from the edge into the road, metres.
    protrusion_m: f32,
}

/// Puts a barrier up if it leaves a way.
fn stand(things: &mut Things<'_>, strip: &Strip, stand: &Stand, rng: &mut Rng) {
    /// Too narrow to be a way between barrier and edge, metres.
    const BESIDE_M: Range<f32> = 0.0..0.6;
    const CONES_APART_M: f32 = 1.2;
    let Stand { kind, side, from_m, along_m, protrusion_m } = *stand;
    let rules = Rules { gap_m: NARROW_M.start - 0.1, apart_m: 5.0, corner_clear_m: 0.0 };
    let at_m = from_m + 0.5 * along_m;
    let beside_m: f32 = if rng.random_bool(0.6) { 0.0 } else { rng.random_range(BESIDE_M) };
    let across_m = protrusion_m - beside_m;
    if across_m < 0.4 {
        return;
    }
    let d_m = side.sign() * (strip.half_width_m(at_m) - beside_m - 0.5 * across_m);
    let pose = Pose::new(strip.point(at_m, d_m), strip.pose(at_m).heading_rad + yaw_rad(rng, 12.0));
    match kind {
        Barrier::Wall | Barrier::Container => {
            let height_m = if matches!(kind, Barrier::Wall) { rng.random_range(0.4..2.5) } else { 2.6 };
            let size_m = [along_m, across_m, height_m];
            let block = things::sized(ObstacleClass::Wall, pose.position(), pose.heading_rad, size_m);
            things.narrow(block, side, at_m, &rules);
        }
        Barrier::Parked => {
            // As many abreast as there is room for, across or along the road.
            let class = draw_car(rng);
            let [length_m, width_m, _] = class.default_size_m();
            let is_across = rng.random_bool(0.5) && across_m > length_m;
            let (turn_rad, takes_m) = if is_across { (FRAC_PI_2, length_m) } else { (0.0, width_m + 0.3) };
            for k in 0..(across_m / takes_m).max(1.0) as usize {
                let from_edge_m = beside_m + (k as f32 + 0.5) * takes_m;
                let d_m = side.sign() * (strip.half_width_m(at_m) - from_edge_m);
                let heading_rad = strip.pose(at_m).heading_rad + turn_rad + yaw_rad(rng, 4.0);
                things.narrow(things::obstacle(class, strip.point(at_m, d_m), heading_rad), side, at_m, &rules);
            }
        }
        Barrier::Cones => {
            for k in 0..=(across_m / CONES_APART_M) as usize {
                let d_m = side.sign() * (strip.half_width_m(at_m) - 0.2 - k as f32 * CONES_APART_M);
                let s_m = at_m + rng.random_range(-0.2..0.2);
                things.narrow(things::obstacle(ObstacleClass::Cone, strip.point(s_m, d_m), 0.0), side, s_m, &rules);
            }
        }
        Barrier::Planter => {
            let polygon = rectangle(pose, along_m, across_m).map(to_millimetres).to_vec();
            let height_m = if rng.random_bool(0.6) { 0.15 } else { 0.8 };
            things.narrow(Island { polygon, height_m }, side, at_m, &rules);
        }
    }
}
