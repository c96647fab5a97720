//! The families of generated lots: one file each, and what they share.
//!
//! | module | |
//! |---|---|
//! | [`corridor`] | easy, medium, hard: corridors between parked cars |
//! | [`lane`] | one width, bends that are not widened |
//! | [`strip`] | the ground: a centre line of straight pieces, arcs and corners, its edges and their notches |
//! | [`course`] | how centre lines are drawn |
//! | [`walls`] | walls and kerbs along outlines, with free ground behind |
//! | [`things`] | what stands in the way and what it leaves free |
//! | [`route`] | the reference path through that |

mod corridor;
mod course;
mod lane;
mod route;
mod strip;
mod things;
mod walls;

use crate::split::Family;
use corridor::DifficultySettings;
use sim::scenario::{LotNoise, Scenario};
use sim::seed::Rng;
use strip::Strip;
use things::Things;

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
    }
}

/// Clearance around the body that lots of a family leave, metres.
pub(crate) fn clearance_m(family: Family) -> f32 {
    match family {
        // A lane of 2.8 m leaves 0.47 m beside the car, and half of that in a bend.
        Family::Lane => 0.15,
        Family::Easy | Family::Medium | Family::Hard => crate::solver::CLEARANCE_M,
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
