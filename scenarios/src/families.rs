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
//! | [`halls`] | aisles between racks, other aisles closed |
//! | [`yards`] | wide ground on which things stand apart |
//! | [`chicanes`] | roads with barriers from either side in turn |
//! | [`cones`] | ways between rows of cones or bollards on open ground |
//! | [`mixed`] | ways whose edges, width and furniture change as they go |
//! | [`slanted`] | aisles of a car park whose stalls are at a slant |
//! | [`strip`] | the ground: a centre line of straight pieces, arcs and corners, its edges and their notches |
//! | [`course`] | how centre lines are drawn |
//! | [`winding`] | what yards and chicanes have in common: ground of one width that winds, and its edge |
//! | [`walls`] | walls and kerbs along outlines, with free ground behind |
//! | [`things`] | what stands in the way and what it leaves free |
//! | [`route`] | the reference path through that |
//! | [`parts`] | what lots on strips share: run-outs, closed mouths, the lot as a whole |

mod aisles;
mod chicanes;
mod cones;
mod corridor;
mod course;
mod halls;
mod lane;
mod mixed;
mod open;
mod parts;
mod rooms;
mod route;
mod slanted;
mod street;
mod strip;
mod things;
mod track;
mod walls;
mod winding;
mod yards;

use crate::split::Family;
use corridor::DifficultySettings;
use sim::scenario::Scenario;
use sim::seed::Rng;

/// Draws a lot without a name; `None` if the draw failed.
pub(crate) fn draw(family: Family, layout: &mut Rng, obstacles: &mut Rng) -> Option<Scenario> {
    let on_strip = match family {
        Family::Easy => return Some(corridor::draw(&DifficultySettings::easy(), layout, obstacles)),
        Family::Medium => return Some(corridor::draw(&DifficultySettings::medium(), layout, obstacles)),
        Family::Hard => return Some(corridor::draw(&DifficultySettings::hard(), layout, obstacles)),
        Family::Lane => lane::draw(layout, obstacles),
        Family::Rooms => rooms::draw(layout, obstacles),
        Family::Street => street::draw(layout, obstacles),
        Family::Aisles => aisles::draw(layout, obstacles),
        Family::Track => track::draw(layout, obstacles),
        Family::Open => open::draw(layout, obstacles),
        Family::Halls => halls::draw(layout, obstacles),
        Family::Yards => yards::draw(layout, obstacles),
        Family::Chicanes => chicanes::draw(layout, obstacles),
        Family::Cones => cones::draw(layout, obstacles),
        Family::Slanted => slanted::draw(layout, obstacles),
        Family::Mixed => mixed::draw(layout, obstacles),
    };
    on_strip.map(|(scenario, _)| scenario)
}

/// Clearance around the body that lots of a family leave, metres.
pub(crate) fn clearance_m(family: Family) -> f32 {
    match family {
        // A lane of 2.8 m leaves 0.47 m beside the car, and half of that in a bend.
        Family::Lane => 0.15,
        _ => crate::solver::CLEARANCE_M,
    }
}

#[cfg(test)]
mod tests {
    use super::strip::Strip;
    use super::*;
    use crate::corridor::STALL_DEPTH_M;
    use crate::split::Split;
    use sim::geometry::{Vec2, polygon_contains};
    use sim::map::Map;
    use sim::scenario::ObstacleClass;
    use sim::seed::Stream;
    use sim::vehicle::VehicleSettings;
    use std::collections::BTreeSet;

    type Is<'a> = dyn Fn(&Scenario, &Strip) -> bool + 'a;
    type Draw = fn(&mut Rng, &mut Rng) -> Option<(Scenario, Strip)>;
    const DRAWS: [(Family, Draw); 12] = [
        (Family::Lane, lane::draw),
        (Family::Rooms, rooms::draw),
        (Family::Street, street::draw),
        (Family::Aisles, aisles::draw),
        (Family::Track, track::draw),
        (Family::Open, open::draw),
        (Family::Halls, halls::draw),
        (Family::Yards, yards::draw),
        (Family::Chicanes, chicanes::draw),
        (Family::Cones, cones::draw),
        (Family::Slanted, slanted::draw),
        (Family::Mixed, mixed::draw),
    ];

    /// A car that does not know the route must not find another way. Ground that a disc a little wider than the car can
    /// get to is flooded: it ends at the edges of the strip and before what closes side roads.
    #[test]
    fn only_one_way_is_open() {
        for (family, draw) in DRAWS {
            let mut looked_at = 0;
            for index in 0..10 {
                let seed = Split::Test.seed(family, index);
                let drawn = draw(&mut seed.rng(Stream::Layout, 0), &mut seed.rng(Stream::Obstacles, 0));
                let Some((scenario, strip)) = drawn else { continue };
                let scenario = Scenario { name: family.name().to_owned(), ..scenario };
                let outline = strip.outline(0.0);
                // Anything no deeper than a stall is not a way.
                let stall_m = if family == Family::Slanted { slanted::DEPTH_MAX_M } else { STALL_DEPTH_M };
                let sides = strip.notches.iter().map(|notch| strip.mouth(notch));
                let mouths: Vec<_> = sides.chain(strip.stub_mouths()).filter(|mouth| mouth.depth_m > stall_m).collect();
                let Ok(map) = Map::build(scenario, &VehicleSettings::hyundai_hg300()) else { continue };
                let reached = flooded(&map, 1.05);
                if family != Family::Track {
                    let stray = reached.iter().find(|&&cell| !polygon_contains(&outline, place(cell)));
                    assert!(stray.is_none(), "{family:?} {index}: a way out at {:?}", stray.map(|&cell| place(cell)));
                }
                for mouth in mouths {
                    let at_its_end = mouth.a.midpoint(mouth.b) + (mouth.depth_m - 1.4) * mouth.outward();
                    let cell = (at_its_end / CELL_M).round().as_ivec2().into();
                    assert!(!reached.contains(&cell), "{family:?} {index}: the way at {mouth:?} is open");
                }
                looked_at += 1;
            }
            assert!(looked_at > 5, "{family:?}: only {looked_at} of 10 lots were drawn");
        }
    }

    /// Where stalls are at a slant, ground is left beside the first and the last one.
    #[test]
    fn nothing_gets_in_beside_the_ends_of_slanted_rows() {
        let mut looked_at = 0;
        for index in 0..12 {
            let seed = Split::Test.seed(Family::Slanted, index);
            let drawn = slanted::draw(&mut seed.rng(Stream::Layout, 0), &mut seed.rng(Stream::Obstacles, 0));
            let Some((scenario, strip)) = drawn else { continue };
            let scenario = Scenario { name: Family::Slanted.name().to_owned(), ..scenario };
            let Ok(map) = Map::build(scenario, &VehicleSettings::hyundai_hg300()) else { continue };
            let reached = flooded(&map, 1.05);
            for notch in &strip.notches {
                for s_m in [notch.from_m + 1.2, notch.to_m - 1.2] {
                    for away_m in [1.5, 2.5, 3.5] {
                        let at = strip.point(s_m, notch.side.sign() * (strip.half_width_m(s_m) + away_m));
                        let cell = (at / CELL_M).round().as_ivec2().into();
                        assert!(!reached.contains(&cell), "{index}: beside the row at {at}");
                    }
                }
            }
            looked_at += 1;
        }
        assert!(looked_at > 5, "only {looked_at} of 12 lots were drawn");
    }

    /// Rows of anything let nothing through that is as wide as the car.
    #[test]
    fn nothing_gets_out_between_the_things_of_a_row() {
        let mut looked_at = 0;
        for index in 0..60 {
            let seed = Split::Test.seed(Family::Mixed, index);
            let drawn = mixed::draw(&mut seed.rng(Stream::Layout, 0), &mut seed.rng(Stream::Obstacles, 0));
            let Some((scenario, strip)) = drawn else { continue };
            let scenario = Scenario { name: Family::Mixed.name().to_owned(), ..scenario };
            let Ok(map) = Map::build(scenario, &VehicleSettings::hyundai_hg300()) else { continue };
            let outline = strip.outline(0.0);
            let stray = flooded(&map, 0.95).into_iter().find(|&cell| !polygon_contains(&outline, place(cell)));
            assert!(stray.is_none(), "{index}: a way out at {:?}", stray.map(place));
            looked_at += 1;
        }
        assert!(looked_at > 30, "only {looked_at} of 60 lots were drawn");
    }

    /// Families are what the docs say (docs/maps.md).
    #[test]
    fn families_are_varied() {
        let lots = |family: Family| {
            let draw = DRAWS.iter().find(|(other, _)| *other == family).expect("a family on strips").1;
            let drawn = move |index| {
                let seed = Split::Train.seed(family, index);
                draw(&mut seed.rng(Stream::Layout, 0), &mut seed.rng(Stream::Obstacles, 0))
            };
            (0..60).filter_map(drawn).collect::<Vec<_>>()
        };
        let share = |lots: &[(Scenario, Strip)], is: &Is<'_>| {
            lots.iter().filter(|(scenario, strip)| is(scenario, strip)).count() as f32 / lots.len() as f32
        };
        let has = |scenario: &Scenario, class| scenario.obstacles.iter().any(|obstacle| obstacle.class == class);
        let is_walled = |scenario: &Scenario, heights_m: std::ops::RangeInclusive<f32>| {
            let is_such = |wall: &&sim::scenario::Obstacle| {
                wall.class == ObstacleClass::Wall && heights_m.contains(&wall.size_m()[2])
            };
            scenario.obstacles.iter().filter(is_such).count() > 20
        };
        let is_obstructed = |scenario: &Scenario, strip: &Strip| {
            let (outline, ends) = (strip.outline(-0.2), [0.0, strip.length_m()].map(|s_m| strip.point(s_m, 0.0)));
            scenario
                .obstacles
                .iter()
                .map(|obstacle| obstacle.centre().position())
                .any(|at| polygon_contains(&outline, at) && ends.iter().all(|end| end.distance(at) > 10.0))
        };
        let is_of_several_widths = |strip: &Strip| {
            let widths_m = strip.straights().into_iter().map(|(from_m, _)| strip.half_width_m(from_m + 0.01));
            widths_m.clone().fold(0.0, f32::max) > widths_m.fold(f32::INFINITY, f32::min) + 0.5
        };
        // Walls around a way are as many as its outline has edges.
        let is_on_open_ground = |scenario: &Scenario, strip: &Strip| {
            scenario.boundary.len() == 4 && strip.notches.is_empty() && scenario.obstacles.len() > 60
        };
        // Family, what, share of its lots: at least and at most.
        let all: [(Family, &str, &Is<'_>, f32, f32); 32] = [
            (Family::Lane, "narrower than 3.8 m", &|_, strip| strip.half_width_m(0.0) < 1.9, 0.35, 0.65),
            (Family::Lane, "narrower than 3.0 m", &|_, strip| strip.half_width_m(0.0) < 1.5, 0.03, 0.3),
            (Family::Lane, "wider than 6 m", &|_, strip| strip.half_width_m(0.0) > 3.0, 0.05, 0.4),
            (Family::Lane, "behind walls", &|lot, _| is_walled(lot, 0.3..=3.0), 0.2, 0.6),
            (Family::Rooms, "between tall walls", &|lot, _| is_walled(lot, 3.0..=3.0), 0.5, 0.8),
            (Family::Rooms, "between low walls", &|lot, _| is_walled(lot, 0.3..=1.0), 0.2, 0.5),
            (Family::Rooms, "with pillars", &|lot, _| has(lot, ObstacleClass::Pillar), 0.2, 0.9),
            (Family::Street, "with kerbs", &|lot, _| has(lot, ObstacleClass::Curb), 1.0, 1.0),
            (Family::Street, "with parked cars", &|lot, _| has(lot, ObstacleClass::Sedan), 0.9, 1.0),
            (Family::Aisles, "with rows of stalls", &|_, strip| strip.notches.len() > 3, 0.9, 1.0),
            (Family::Aisles, "with more than two aisles", &|_, strip| strip.straights().len() > 3, 0.2, 0.9),
            (Family::Track, "around an island", &|lot, _| !lot.islands.is_empty(), 0.3, 0.7),
            (Family::Track, "between walls", &|lot, _| is_walled(lot, 0.3..=3.0), 0.3, 0.7),
            (Family::Open, "with planters", &|lot, _| lot.islands.len() > 3, 0.6, 1.0),
            (Family::Street, "with pavements built out or refuges", &|lot, _| !lot.islands.is_empty(), 0.3, 0.7),
            (Family::Aisles, "between hidden rows", &|lot, _| lot.boundary_height_m > 1.0, 0.15, 0.5),
            (Family::Halls, "that hide what is behind", &|lot, _| lot.boundary_height_m > 1.0, 0.4, 0.8),
            (Family::Halls, "narrower than 4.4 m", &|_, strip| strip.half_width_m(0.0) < 2.2, 0.3, 0.7),
            (Family::Chicanes, "with planters", &|lot, _| !lot.islands.is_empty(), 0.2, 0.6),
            (Family::Chicanes, "narrower than 8 m", &|_, strip| strip.half_width_m(0.0) < 4.0, 0.2, 0.6),
            (Family::Yards, "with fountains", &|lot, _| !lot.islands.is_empty(), 0.6, 1.0),
            (Family::Cones, "narrower than 4.4 m", &|_, strip| strip.half_width_m(0.0) < 2.2, 0.3, 0.7),
            (Family::Cones, "without bollards", &|lot, _| !has(lot, ObstacleClass::Bollard), 0.3, 0.7),
            (Family::Cones, "with kerbs", &|lot, _| has(lot, ObstacleClass::Curb), 0.03, 0.25),
            (Family::Cones, "with something in the lane", &is_obstructed, 0.3, 0.7),
            (Family::Slanted, "with rows of stalls", &|_, strip| strip.notches.len() > 3, 0.9, 1.0),
            (Family::Slanted, "with three aisles", &|_, strip| strip.straights().len() > 3, 0.2, 0.8),
            (Family::Slanted, "with islands", &|lot, _| !lot.islands.is_empty(), 0.2, 0.6),
            (Family::Mixed, "of several widths", &|_, strip| is_of_several_widths(strip), 0.7, 1.0),
            (Family::Mixed, "marked by rows alone", &|lot, strip| is_on_open_ground(lot, strip), 0.15, 0.45),
            (Family::Mixed, "with recesses", &|_, strip| strip.notches.len() > 3, 0.4, 0.8),
            (Family::Mixed, "with something in the lane", &is_obstructed, 0.6, 1.0),
        ];
        for (family, what, is, least, most) in all {
            let share = share(&lots(family), is);
            assert!((least..=most).contains(&share), "{family:?} {what}: {share}");
        }
    }

    const CELL_M: f32 = 0.25;

    fn place((x, y): (i32, i32)) -> Vec2 {
        Vec2::new(x as f32, y as f32) * CELL_M
    }

    /// Cells of the ground around the start that are joined to it by a passage of twice so much.
    fn flooded(map: &Map, clear_m: f32) -> BTreeSet<(i32, i32)> {
        let start: (i32, i32) = (map.start().position() / CELL_M).round().as_ivec2().into();
        let mut reached = BTreeSet::from([start]);
        let mut open = vec![start];
        while let Some((x, y)) = open.pop() {
            for next in [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)] {
                if map.signed_distance_m(place(next)) > clear_m && reached.insert(next) {
                    open.push(next);
                }
            }
        }
        reached
    }
}
