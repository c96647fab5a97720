//! The families of generated lots: one file each, and what they share.
//!
//! | module | |
//! |---|---|
//! | [`corridor`] | easy, medium, hard: corridors between parked cars |
//! | [`lane`] | one width, bends that are not widened |
//! | [`rooms`] | corridors of a building between thin walls |
//! | [`street`] | kerbs, parked cars on both sides |
//! | [`aisles`] | parallel aisles of a car park |
//! | [`track`] | closed bands |
//! | [`open`] | open ground on which things leave one way |
//! | [`strip`] | the ground: a centre line of straight pieces, arcs and corners, its edges and their notches |
//! | [`course`] | how centre lines are drawn |
//! | [`walls`] | walls and kerbs along outlines, with free ground behind |
//! | [`things`] | what stands in the way and what it leaves free |
//! | [`route`] | the reference path through that |

mod aisles;
mod corridor;
mod course;
mod lane;
mod open;
mod rooms;
mod route;
mod street;
mod strip;
mod things;
mod track;
mod walls;

use crate::split::Family;
use corridor::DifficultySettings;
use rand::RngExt as _;
use sim::scenario::{LotNoise, ObstacleClass, Scenario};
use sim::seed::Rng;
use strip::{Mouth, Strip};
use things::Things;
use walls::Wall;

/// Straight ground before the start and behind the finish, metres, so that no wall is close there.
const RUN_OUT_M: f32 = 18.0;
/// Nothing stands in the way this close to start and finish, metres.
const END_CLEAR_M: f32 = 9.0;

/// Draws a lot without a name; `None` if the draw came to nothing.
pub(crate) fn draw(family: Family, layout: &mut Rng, obstacles: &mut Rng) -> Option<Scenario> {
    match family {
        Family::Easy => Some(corridor::draw(&DifficultySettings::easy(), layout, obstacles)),
        Family::Medium => Some(corridor::draw(&DifficultySettings::medium(), layout, obstacles)),
        Family::Hard => Some(corridor::draw(&DifficultySettings::hard(), layout, obstacles)),
        Family::Lane => lane::draw(layout, obstacles),
        Family::Rooms => rooms::draw(layout, obstacles),
        Family::Street => street::draw(layout, obstacles),
        Family::Aisles => aisles::draw(layout, obstacles),
        Family::Track => track::draw(layout, obstacles),
        Family::Open => open::draw(layout, obstacles),
    }
}

/// Clearance around the body that lots of a family leave, metres.
pub(crate) fn clearance_m(family: Family) -> f32 {
    match family {
        // A lane of 2.8 m leaves 0.47 m beside the car, and half of that in a bend.
        Family::Lane => 0.15,
        _ => crate::solver::CLEARANCE_M,
    }
}

/// The stretch of an axis that is driven.
fn driven_m(strip: &Strip) -> (f32, f32) {
    (RUN_OUT_M, strip.length_m() - RUN_OUT_M)
}

/// Obstacles for the stretch of an axis on which some may stand in the way.
fn things_on(strip: &Strip) -> Things<'_> {
    let (from_m, to_m) = driven_m(strip);
    Things::new(strip, (from_m + END_CLEAR_M, to_m - END_CLEAR_M))
}

/// Closes the mouth of a side road by a row of cones or bollards, or by a barrier.
fn close(things: &mut Things<'_>, (a, b): Mouth, rng: &mut Rng) {
    /// The car is 1.86 m wide.
    const SPACING_M: f32 = 1.2;
    let class = match rng.random_range(0..4) {
        0 | 1 => ObstacleClass::Cone,
        2 => ObstacleClass::Bollard,
        _ => {
            things.obstacles.extend(Wall::low(rng).straight(a, b));
            return;
        }
    };
    let count = (a.distance(b) / SPACING_M).ceil();
    for k in 0..count as usize {
        things.stand(things::obstacle(class, a.lerp(b, (k as f32 + 0.5) / count), 0.0));
    }
}

/// Puts a lot together.
fn lot(strip: &Strip, boundary: Vec<sim::geometry::Vec2>, things: Things<'_>) -> Scenario {
    Scenario {
        name: String::new(),
        boundary,
        boundary_height_m: 0.0,
        reference_path: route::along(strip, driven_m(strip), &things.narrowings),
        noise: LotNoise::default(),
        islands: Vec::new(),
        obstacles: things.obstacles,
        speed_bumps: Vec::new(),
    }
}
