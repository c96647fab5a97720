//! Maps small enough to know their outlines by heart, and every way in which a map can be wrong.

use super::*;
use crate::load::{check_direction, load, load_with_notes};
use sim::scenario::{Direction, NoiseLevel};
use sim::seed::RootSeed;
use sim::sensing::noise::NoiseSettings;
use sim::sensing::{SensingSettings, Sensor};
use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;

fn car() -> VehicleSettings {
    VehicleSettings::hyundai_hg300()
}

/// A fresh folder with files in it.
fn folder(name: &str, files: &[(&str, &str)]) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("parking-import-{}", std::process::id())).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    for (file, text) in files {
        std::fs::write(folder.join(file), text).unwrap();
    }
    folder
}

/// A plain PGM of a drawing, top row first: `.` free, `#` occupied, `?` unknown.
fn pgm(rows: &[String]) -> String {
    let pixels: Vec<String> = rows
        .iter()
        .flat_map(|row| row.chars())
        .map(|pixel| match pixel {
            '.' => "254".to_owned(),
            '#' => "0".to_owned(),
            _ => "205".to_owned(),
        })
        .collect();
    format!("P2\n# drawn by a test\n{} {}\n255\n{}\n", rows[0].len(), rows.len(), pixels.join("\n"))
}

fn yaml(resolution: &str, origin: &str) -> String {
    format!(
        "image: map.pgm\nmode: trinary\nresolution: {resolution}\norigin: {origin}\nnegate: 0\n\
         occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
}

fn vertices(points: &[(f32, f32)]) -> Vec<Vec2> {
    points.iter().map(|&(x, y)| Vec2::new(x, y)).collect()
}

/// A U of free pixels around an occupied and an unknown one.
fn small_map(name: &str, origin: &str) -> MapLot {
    let rows = ["..#?", "..#.", "...."].map(str::to_owned);
    let folder = folder(name, &[("map.yaml", &yaml("0.5", origin)), ("map.pgm", &pgm(&rows))]);
    MapLot::of_map(&folder.join("map.yaml"))
}

/// `seed`: in the map's frame.
fn ground(lot: &MapLot, seed: [f64; 2]) -> Ground {
    let (map, ..) = ros::Map::read(&lot.map, false).unwrap();
    lot.ros_ground(&map, Frame::around(seed, lot.scale), seed, None, &car(), &mut Vec::new()).unwrap()
}

#[test]
fn a_small_map_has_the_outline_computed_by_hand() {
    let lot = small_map("outline", "[1.0, 2.0, 0.0]");
    let ground = ground(&lot, [1.2, 2.2]);
    let expected = [(3.0, 2.0), (3.0, 3.0), (2.5, 3.0), (2.5, 2.5), (2.0, 2.5), (2.0, 3.5), (1.0, 3.5), (1.0, 2.0)];
    assert_eq!(ground.boundary, vertices(&expected));
    assert!(ground.islands.is_empty());
}

#[test]
fn a_turned_origin_turns_the_map_about_its_lower_left_corner() {
    let lot = small_map("turned", &format!("[1.0, 2.0, {FRAC_PI_2}]"));
    // Along the rows is +y now, up the columns −x.
    let ground = ground(&lot, [0.8, 2.2]);
    let expected = [(1.0, 4.0), (0.0, 4.0), (0.0, 3.5), (0.5, 3.5), (0.5, 3.0), (-0.5, 3.0), (-0.5, 2.0), (1.0, 2.0)];
    assert_eq!(ground.boundary, vertices(&expected));
}

#[test]
fn the_scale_enlarges_everything_about_the_origin_of_the_frame() {
    let lot = MapLot { scale: 20.0, ..small_map("scaled", "[1.0, 2.0, 0.0]") };
    let ground = ground(&lot, [1.2, 2.2]);
    let expected = [
        (60.0, 40.0),
        (60.0, 60.0),
        (50.0, 60.0),
        (50.0, 50.0),
        (40.0, 50.0),
        (40.0, 70.0),
        (20.0, 70.0),
        (20.0, 40.0),
    ];
    assert_eq!(ground.boundary, vertices(&expected));
}

/// A lane of 5 m along x, 60 m long, with a wall of `gap` free pixels across it at x = 30; one pixel is a metre.
fn lane(name: &str, gap: usize) -> MapLot {
    let rows: Vec<String> = (0..7)
        .map(|row| {
            let pixel = |col| {
                let is_wall = row == 0 || row == 6 || col == 0 || col == 59 || (col == 30 && row > gap);
                if is_wall { '#' } else { '.' }
            };
            (0..60).map(pixel).collect()
        })
        .collect();
    let folder = folder(name, &[("map.yaml", &yaml("1.0", "[0.0, 0.0, 0.0]")), ("map.pgm", &pgm(&rows))]);
    let mut lot = MapLot::of_map(&folder.join("map.yaml"));
    lot.start = Some([5.0, 3.5, 0.0]);
    lot.goal = Some([45.0, 3.5, 0.0]);
    lot
}

fn refusal(lot: &MapLot) -> String {
    lot.scenario(&car()).expect_err("it cannot be driven").to_string()
}

#[test]
fn a_route_is_found_from_start_to_goal() {
    let scenario = lane("found", 5).scenario(&car()).unwrap().scenario;
    assert_eq!(scenario.name, "map");
    let path = sim::path::Path::new(&scenario.reference_path);
    assert!(path.pose_at(0.0).position().distance(Vec2::new(5.0, 3.5)) < 1e-3);
    let end = path.pose_at(path.length_m());
    assert!((45.0..45.3).contains(&end.x_m) && (end.y_m - 3.5).abs() < 1.0, "{end:?}");
    assert!((40.0..41.0).contains(&path.length_m()), "a straight lane: {} m", path.length_m());
}

/// The same lane drawn for a robot a tenth as large.
#[test]
fn a_small_map_is_driven_when_it_is_scaled() {
    let mut lot = lane("scaled-lane", 5);
    std::fs::write(&lot.map, yaml("0.1", "[0.0, 0.0, 0.0]")).unwrap();
    lot.start = Some([0.5, 0.35, 0.0]);
    lot.goal = Some([4.5, 0.35, 0.0]);
    assert!(refusal(&lot).contains("start: the car (4.91 m × 1.86 m"), "{}", refusal(&lot));
    lot.scale = 10.0;
    let route = lot.scenario(&car()).unwrap().scenario.reference_path;
    assert_eq!(route, lane("scaled-reference", 5).scenario(&car()).unwrap().scenario.reference_path);
}

#[test]
fn no_route_is_explained_with_its_place_and_a_remedy() {
    let wall = refusal(&lane("wall", 0));
    assert!(wall.contains("map.yaml: route: the goal cannot be reached: a wall is in the way near (29.88, "), "{wall}");
    assert!(wall.contains("; open the map there"), "{wall}");

    let narrow = refusal(&lane("narrow", 2));
    assert!(narrow.contains("route: the passage near (30."), "{narrow}");
    assert!(narrow.contains("too narrow: about 1.8 m in the lot, and the car needs 2.36 m; widen it"), "{narrow}");
    assert!(narrow.contains("leave specks out with drop_specks_m2 (--drop-specks of generate), enlarge"), "{narrow}");

    let mut lot = lane("turn", 5);
    lot.goal = Some([40.0, 3.5, 180.0]);
    let askew = refusal(&lot);
    assert!(askew.contains("goal: the car gets to the goal, but at best turned 157° away from it, at (39."), "{askew}");
    assert!(askew.contains("; turn the goal, or move it"), "{askew}");

    let mut lot = lane("tight", 5);
    // An alcove that the car would have to turn into on the spot.
    let rows: Vec<String> = (0..14)
        .map(|row| {
            let is_free =
                |col: usize| (1..59).contains(&col) && (8..13).contains(&row) || (29..32).contains(&col) && row > 0;
            (0..60).map(|col| if is_free(col) && row < 13 { '.' } else { '#' }).collect()
        })
        .collect();
    std::fs::write(lot.map.with_file_name("map.pgm"), pgm(&rows)).unwrap();
    lot.goal = Some([30.5, 8.0, 90.0]);
    let tight = refusal(&lot);
    assert!(tight.contains("route: no drive forwards was found: it got to ("), "{tight}");
    assert!(!tight.contains("about 0 m"), "{tight}");

    let mut lot = lane("blocked", 5);
    lot.goal = Some([57.0, 3.5, 0.0]);
    assert!(refusal(&lot).contains("goal: the car (4.91 m × 1.86 m, and 0.25 m around it)"), "{}", refusal(&lot));
    lot.goal = Some([59.5, 3.5, 0.0]);
    assert!(refusal(&lot).contains("goal: (59.50, 3.50) is not drivable: pixel (59, 3)"), "{}", refusal(&lot));
    lot.start = Some([30.0, 0.5, 0.0]);
    let occupied = refusal(&lot);
    assert!(
        occupied.contains("start: (30.00, 0.50) is not drivable: pixel (30, 6) of the image, from its upper left, is"),
        "{occupied}"
    );
    lot.start = Some([-8.0, 0.5, 0.0]);
    assert!(refusal(&lot).contains("the map spans x 0.00 to 60.00 and y 0.00 to 7.00"), "{}", refusal(&lot));

    // Where the car stands already, and a metre behind it: the route of one point was called too short.
    for x in [5.0, 4.0] {
        let mut lot = lane("arrived", 5);
        lot.goal = Some([x, 3.5, 0.0]);
        let arrived = refusal(&lot);
        assert!(arrived.ends_with("goal: the car stands there at the start; move it farther ahead"), "{arrived}");
    }

    let mut lot = lane("no-loop", 5);
    // The loop would end 3 m behind the start: far enough from the wall for the car to stand there.
    lot.start = Some([12.0, 3.5, 0.0]);
    (lot.goal, lot.is_loop) = (None, true);
    assert!(refusal(&lot).contains("route: there is no loop"), "{}", refusal(&lot));
}

#[test]
fn a_centre_line_must_have_room_for_the_car() {
    let with_line = |name: &str, gap: usize, line: &str| {
        let mut lot = lane(name, gap);
        let file = lot.map.with_file_name("line.csv");
        std::fs::write(&file, line).unwrap();
        (lot.start, lot.goal, lot.centre_line) = (None, None, Some(file));
        lot
    };
    let line = "x_m, y_m, width\n5.0, 3.5, 2\n 5.0, 3.5, 2\n45.0, 3.5, 2\n";
    let scenario = with_line("line", 5, line).scenario(&car()).unwrap().scenario;
    assert_eq!(scenario.reference_path.points, vertices(&[(5.0, 3.5), (45.0, 3.5)]));

    let wall = refusal(&with_line("line-wall", 0, line));
    assert!(wall.contains("centre_line, 24."), "the car's side meets the wall about 1 m before it: {wall}");
    assert!(wall.contains("too narrow at (29."), "{wall}");
    // 0.93 m from the wall at y = 1 is passed at y = 1.93: 87 % of the way down to 1.7.
    let skew = refusal(&with_line("line-skew", 5, "5.0,3.5\n45.0,1.7\n"));
    assert!(skew.contains("centre_line, 35.") || skew.contains("centre_line, 34."), "{skew}");
    assert!(skew.contains("0.93 m to the side, and half of the car is 0.93 m"), "{skew}");
    for (line, expected) in [
        ("5.0,3.5\n45.0;3.5\n", "line.csv:2: \"45.0;3.5\" is not a point; write one point per line"),
        ("5.0,3.5\n45.0,nan\n", "line.csv:2: \"45.0,nan\" is not a point"),
        ("y,x\n3.5,5.0\n3.5,45.0\n", "line.csv:1: the header has \"y\" in column 1; y is read from column 2"),
        // Time and speed were taken for the route.
        ("t,v,x,y\n0.0,1.2,5.0,3.5\n", "line.csv:1: the header has \"x\" in column 3; x is read from column 1"),
        ("id,name,lat,lon\n1,2,5.0,3.5\n", "line.csv:1: the header has \"lat\", which is in degrees"),
        ("heading,X [m],Y [m]\n0,5.0,3.5\n0,45.0,3.5\n", "\"X [m]\" in column 2; x is read from column 1"),
        ("pos_y,pos_x\n3.5,5.0\n3.5,45.0\n", "\"pos_y\" in column 1; y is read from column 2"),
        ("lat,lon\n5.0,3.5\n45.0,3.5\n", "\"lat\", which is in degrees"),
        ("north_m,east_m\n3.5,5.0\n3.5,45.0\n", "\"north_m\" in column 1; y is read from column 2"),
        // As numpy.savetxt writes a header; what it says was not looked at.
        ("# by hand, twice\n# y,x\n3.5,5.0\n3.5,45.0\n", "line.csv:2: the header has \"y\" in column 1"),
        ("# s_m,x_m,y_m\n0.0,5.0,3.5\n40.0,45.0,3.5\n", "line.csv:1: the header has \"x_m\" in column 2"),
        // Behind a mark of the order of bytes it was not looked at.
        ("\u{feff}# y,x\n3.5,5.0\n3.5,45.0\n", "line.csv:1: the header has \"y\" in column 1"),
        // The line of what stands before it was named, be it the LF of a CRLF.
        ("5.0,3.5\r\n45.0;3.5\r\n", "line.csv:2: \"45.0;3.5\" is not a point"),
        ("5.0,3.5\n# by hand\n\n45.0;3.5\n", "line.csv:4: \"45.0;3.5\" is not a point"),
        ("# a lane\r\n\r\ny,x\r\n3.5,5.0\r\n", "line.csv:3: the header has \"y\" in column 1"),
        ("x,y\n5.0,3.5\n", "line.csv: centre line: the line has 1 points; give at least"),
    ] {
        let message = refusal(&with_line("line-faulty", 5, line));
        assert!(message.contains(expected), "got:      {message}\nexpected: {expected}");
    }
}

#[test]
fn faults_of_the_files_are_named() {
    let sound = yaml("1.0", "[0.0, 0.0, 0.0]");
    let table = [
        (
            "resolution: 1.0",
            "resolution: 0.0",
            "map.yaml:3: resolution: it is 0; write metres per pixel, 0.0001 to 1000",
        ),
        ("resolution: 1.0", "resolution: -0.05", "map.yaml:3: resolution: it is -0.05; write"),
        ("resolution: 1.0", "resolution: .nan", "map.yaml:3: resolution: it is NaN; write"),
        ("resolution: 1.0", "resolution: fine", "map.yaml:3: "),
        ("resolution: 1.0\n", "", ": missing field `resolution`; a map needs image, resolution, origin"),
        ("[0.0, 0.0, 0.0]", "[0.0, 0.0]", "map.yaml:4: "),
        ("[0.0, 0.0, 0.0]", "[0.0, .inf, 0.0]", "map.yaml:4: origin: a number is inf; write [x, y, yaw]"),
        ("mode: trinary", "mode: binary", "map.yaml:2: "),
        ("free_thresh: 0.196", "free_thresh: 0.7", "map.yaml:7: free_thresh: it is 0.7, above occupied_thresh"),
        // It is not in the file: line 1 was blamed.
        (
            "occupied_thresh: 0.65\nfree_thresh: 0.196\n",
            "occupied_thresh: 0.1\n",
            "map.yaml:6: occupied_thresh: it is 0.1, below free_thresh, 0.196",
        ),
        ("occupied_thresh: 0.65", "occupied_thresh: 65", "map.yaml:6: occupied_thresh: it is 65; write an occupancy"),
        ("image: map.pgm", "image: [", "map.yaml:"),
    ];
    let lot = lane("faults", 5);
    for (original, replacement, expected) in table {
        assert_eq!(sound.matches(original).count(), 1, "{original:?} must occur once");
        std::fs::write(&lot.map, sound.replacen(original, replacement, 1)).unwrap();
        let message = refusal(&lot);
        assert!(message.contains(expected), "{replacement:?}\ngot:      {message}\nexpected: {expected}");
        assert!(!message.contains('\n'), "one line: {message}");
    }
    std::fs::write(&lot.map, sound.replacen("map.pgm", "other.pgm", 1)).unwrap();
    let message = refusal(&lot);
    assert!(
        message.contains("map.yaml: image ") && message.contains("other.pgm: cannot be read: No such file"),
        "{message}"
    );
    std::fs::write(&lot.map, &sound).unwrap();
    std::fs::write(lot.map.with_file_name("map.pgm"), "P2\n60 7\n255\n1 2 3\n").unwrap();
    assert!(refusal(&lot).contains("map.pgm: not a readable image: "), "{}", refusal(&lot));
}

/// A centre line may end where the car cannot turn round to drive back: a metre before a wall.
#[test]
fn a_map_that_cannot_be_driven_in_reverse_is_refused_with_the_line_of_its_route() {
    let lot = lane("reverse", 5);
    let file = lot.map.with_file_name("map.lot.toml");
    std::fs::write(lot.map.with_file_name("line.csv"), "5, 3.5\n58, 3.5\n").unwrap();
    for (scale, frame) in [("1", ""), ("1.1", "(coordinates are the map's times 1.1)")] {
        std::fs::write(&file, format!("map = 'map.yaml'\nscale = {scale}\ncentre_line = 'line.csv'\n")).unwrap();
        for named in [&file, &lot.map] {
            let loaded = load_with_notes(named, &car()).unwrap();
            assert_eq!(check_direction(named, &loaded, Direction::Forward, &car()), Ok(()));
            let error = check_direction(named, &loaded, Direction::Reverse, &car()).unwrap_err().to_string();
            let expected =
                format!("{}:3: the lot cannot be driven in reverse: reference_path, point 2: the car", file.display());
            assert!(error.starts_with(&expected) && error.contains(frame), "{error}");
            assert_eq!(error.contains("coordinates are"), !frame.is_empty(), "{error}");
        }
    }
}

#[test]
fn faults_of_the_lot_file_are_named() {
    let lot = lane("lot-faults", 5);
    let file = lot.map.with_file_name("map.lot.toml");
    let message = |text: &str| {
        std::fs::write(&file, text).unwrap();
        load(&file, &car()).map_or_else(|error| error.to_string(), |scenario| scenario.name)
    };
    assert_eq!(message("map = 'map.yaml'\nstart = [5, 3.5, 0]\ngoal = [45, 3.5, 0]\n"), "map");
    assert_eq!(message("map = 'map.yaml'\nname = 'lane'\nstart = [5, 3.5, 0]\ngoal = [45, 3.5, 0]\n"), "lane");
    assert_eq!(load(&lot.map, &car()).unwrap().name, "lane", "the file beside the map is found");
    for (text, expected) in [
        (
            "map = 'map.yaml'\nstart = [5, 3.5, 0]\n",
            "map.lot.toml: route: a start is given, but not where to drive from there; add goal",
        ),
        ("map = 'map.yaml'\n", "map.lot.toml: route: the map does not say where to drive; write start"),
        ("map = 'map.yaml'\nstart = [5, 3.5]\n", "map.lot.toml:2: invalid length 2"),
        ("map = 'map.yaml'\nstrat = [5, 3.5, 0]\n", "map.lot.toml:2: unknown field `strat`"),
        ("map = 'map.jpg'\n", "map.lot.toml: map: "),
        ("map = 'none.yaml'\nstart = [5, 3.5, 0]\ngoal = [45, 3.5, 0]\n", "none.yaml: cannot be read: No such file"),
        ("map = 'map.yaml'\nscale = 0\n", "map.lot.toml: scale: it is 0; write how many times"),
        ("map = 'map.yaml'\nscale = -2\n", "map.lot.toml: scale: it is -2; write"),
        ("map = 'map.yaml'\nclearance_m = 5\n", "map.lot.toml: clearance_m: it is 5; write"),
        ("map = 'map.yaml'\nstart = [nan, 0, 0]\n", "map.lot.toml: start: a number is NaN"),
        ("map = 'map.yaml'\ngoal = [1, 0, 0]\nloop = true\n", "map.lot.toml: loop: goal is given too; keep one"),
    ] {
        let message = message(text);
        assert!(message.contains(expected), "{text}\ngot:      {message}\nexpected: {expected}");
    }
    std::fs::write(&file, "map = 'other.yaml'\n").unwrap();
    let message = MapLot::read(&lot.map).expect_err("another map").to_string();
    assert!(message.contains("map.lot.toml: map: it names the map"), "{message}");
}

/// A pipe, a folder or a dangling link in the place of the lot file was passed over, and the map was read without it.
#[test]
fn a_lot_file_that_cannot_be_read_is_an_error_and_not_passed_over() {
    let lot = lane("lot-unreadable", 5);
    assert_eq!(MapLot::read(&lot.map), Ok(MapLot::of_map(&lot.map)), "there is none");
    let file = lot.map.with_file_name("map.lot.toml");
    std::fs::create_dir(&file).unwrap();
    let refused = || MapLot::read(&lot.map).expect_err("it cannot be read").to_string();
    assert!(refused().contains("map.lot.toml: cannot be read: it is a folder"), "{}", refused());
    std::fs::remove_dir(&file).unwrap();
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("nowhere.toml", &file).unwrap();
        assert!(refused().contains("map.lot.toml: cannot be read: No such file"), "{}", refused());
    }
    // The name of a lot file that is too long for the disk is that of none.
    let long = lot.map.with_file_name("m".repeat(250) + ".yaml");
    assert_eq!(MapLot::read(&long), Ok(MapLot::of_map(&long)));
}

/// One way round the example, in the direction of the start.
#[test]
fn a_loop_leads_back_to_its_start() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/car-park-loop.lot.toml");
    let scenario = load(&file, &car()).unwrap();
    let path = sim::path::Path::new(&scenario.reference_path);
    let (start, end) = (path.pose_at(0.0), path.pose_at(path.length_m()));
    assert!(start.position().distance(end.position()) < 3.0, "{start:?} {end:?}");
    assert!(end.ahead().dot(start.ahead()) > 0.86, "{end:?}");
    // The middle of the aisle is a rectangle of 46 m × 28 m, and corners are cut.
    assert!((115.0..150.0).contains(&path.length_m()), "{} m", path.length_m());
    let area_m2 = sim::geometry::signed_area_m2(&scenario.reference_path.points);
    assert!(area_m2 > 900.0, "counter-clockwise round the block: {area_m2} m²");
}

/// The car turned round twice on the near side of the wall, over the gate ahead of its start in one step; the way round the
/// wall, 2.5 m wide, was said to be too narrow for 2.36 m where the gate held.
#[test]
fn a_loop_that_only_turns_round_on_the_spot_is_none() {
    let rows: Vec<String> = (0..66)
        .rev()
        .map(|y| {
            let is_wall = |x: usize| !(1..127).contains(&x) || !(1..65).contains(&y);
            let is_between = |x: usize| (53..55).contains(&y) && (12..116).contains(&x);
            (0..128).map(|x| if is_wall(x) || is_between(x) { '#' } else { '.' }).collect()
        })
        .collect();
    let folder = folder("no-way-round", &[("map.yaml", &yaml("0.25", "[0, 0, 0]")), ("map.pgm", &pgm(&rows))]);
    let lot = MapLot { start: Some([12.0, 4.0, 0.0]), is_loop: true, ..MapLot::of_map(&folder.join("map.yaml")) };
    let refusal = refusal(&lot);
    assert!(refusal.contains("route: no drive forwards was found: it got to ("), "{refusal}");
    assert!(refusal.contains(" m of the lot before the end of the loop.") && !refusal.contains("goal"), "{refusal}");
}

#[test]
fn a_case_is_read_in_one_row_or_one_column() {
    let numbers = "0,0,0,30,0,3.14159265,2,4,3,8,-4,12.6,-4,12.6,-2.2,8,-2.2,10,3,14,3,12,6";
    let row = folder("tpcap", &[("case.csv", numbers), ("column.csv", &numbers.replace(',', "\n"))]);
    let case = tpcap::Case::read(&row.join("case.csv")).unwrap();
    assert_eq!(case, tpcap::Case::read(&row.join("column.csv")).unwrap());
    assert_eq!(case.start, [0.0, 0.0, 0.0]);
    assert!((case.goal[2] - 180.0).abs() < 1e-3, "degrees: {:?}", case.goal);
    let ground = case.ground(Frame::around([0.0, 0.0], 1.0));
    // Everything lies within x 0…30, y −4…6; 20 m are added.
    assert_eq!(ground.boundary, vertices(&[(-20.0, -24.0), (50.0, -24.0), (50.0, 26.0), (-20.0, 26.0)]));
    assert_eq!(ground.islands, [vertices(&[(10.0, 3.0), (14.0, 3.0), (12.0, 6.0)])]);
    let [car] = &ground.obstacles[..] else { panic!("{:?}", ground.obstacles) };
    let [length_m, width_m, _] = car.size_m();
    assert!((length_m - 4.6).abs() < 1e-5 && (width_m - 1.8).abs() < 1e-5, "{car:?}");
    assert!(car.centre().position().distance(Vec2::new(10.3, -3.1)) < 1e-5, "{car:?}");

    for (text, expected) in [
        ("0,0,0,30,0", "case.csv:1: the file ends after 5 numbers, before the goal (x, y, theta); a TPCAP case is"),
        ("0,0,0,30,0,0,1,2,0,0", "case.csv:1: number 8, the number of vertices of obstacle 1, is 2; a TPCAP"),
        ("0,0,0,30,0,0,1.5", "case.csv:1: number 7, the number of obstacles, is 1.5"),
        ("0,0,0\n30,0,0\n1\n3\n5,5,6,5,6", "case.csv:5: the file ends after 13 numbers, before a vertex of obstacle 1"),
        ("0,0,0,30,0,0,0\n7", "case.csv:2: 1 numbers are left over after the last obstacle"),
        ("x,y\n1,2", "case.csv:1: \"x\" is not a number of metres; a TPCAP case holds numbers only"),
        ("", "case.csv:1: the file ends after 0 numbers, before the start"),
    ] {
        let folder = folder("tpcap-faulty", &[("case.csv", text)]);
        let message = tpcap::Case::read(&folder.join("case.csv")).expect_err(text).to_string();
        assert!(message.contains(expected), "{text}\ngot:      {message}\nexpected: {expected}");
    }
}

/// It was the number among the islands: a car before it was not counted.
#[test]
fn a_fault_of_a_case_is_named_by_the_number_of_the_obstacle_in_the_file() {
    let case = "0,0,0,30,0,0,2,4,4,8,-5,12.6,-5,12.6,-3.2,8,-3.2,20,5,24,9,24,5,20,9";
    let folder = folder("tpcap-crossed", &[("case.csv", case)]);
    let refusal = refusal(&MapLot::of_map(&folder.join("case.csv")));
    assert!(refusal.contains("case.csv: obstacle 2: the edge from vertex 1 to 2 meets"), "{refusal}");
}

/// Nothing tested that a case in UTM coordinates is the lot that it is beside the origin.
#[test]
fn a_case_far_from_its_origin_is_the_same_lot_about_its_start() {
    // A car of 4.5 m and a triangle. Eighths of a metre are exact, however far away.
    let case = |x: f64, y: f64| {
        let mut numbers = vec![x, y, 0.0, x + 30.0, y, 0.0, 2.0, 4.0, 3.0];
        for (ahead, left) in
            [(8.0, -4.0), (12.5, -4.0), (12.5, -2.25), (8.0, -2.25), (10.0, 3.125), (14.0, 3.125), (12.0, 6.0)]
        {
            numbers.extend([x + ahead, y + left]);
        }
        let text: Vec<String> = numbers.iter().map(ToString::to_string).collect();
        let folder = folder("tpcap-far", &[("case.csv", &text.join(","))]);
        MapLot::of_map(&folder.join("case.csv")).scenario(&car()).unwrap()
    };
    let (near, far) = (case(0.0, 0.0), case(4_432_000.0, 5_413_000.0));
    assert_eq!((near.scenario.islands.len(), near.scenario.obstacles.len()), (1, 1));
    assert_eq!(near.scenario, far.scenario);
    assert_eq!(far.notes[0], Note::Recentred { origin: [4_432_000.0, 5_413_000.0] });
    assert_eq!(far.frame.as_deref(), Some("coordinates are the map's less (4432000, 5413000)"));
}

#[test]
fn the_example_case_becomes_a_lot() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/open-lot.csv");
    let scenario = load(&file, &car()).unwrap();
    assert_eq!((scenario.name.as_str(), scenario.islands.len(), scenario.obstacles.len()), ("open-lot", 3, 2));
    let end = *scenario.reference_path.points.last().unwrap();
    assert!(end.distance(Vec2::new(30.0, 6.0)) < 1.3, "{end}");
}

/// A lane of 5 m, 60 m long; one pixel is 10 cm. With what is drawn into it: `(x, y)` in pixels is occupied.
fn fine_lane(name: &str, is_occupied: impl Fn(usize, usize) -> bool) -> MapLot {
    let rows: Vec<String> = (0..52)
        .rev()
        .map(|y| {
            let is_wall = |x| !(1..599).contains(&x) || !(1..51).contains(&y) || is_occupied(x, y);
            (0..600).map(|x| if is_wall(x) { '#' } else { '.' }).collect()
        })
        .collect();
    let folder = folder(name, &[("map.yaml", &yaml("0.1", "[0, 0, 0]")), ("map.pgm", &pgm(&rows))]);
    let mut lot = MapLot::of_map(&folder.join("map.yaml"));
    (lot.start, lot.goal) = (Some([8.0, 2.6, 0.0]), Some([42.0, 2.6, 0.0]));
    lot
}

#[test]
fn a_speck_becomes_the_smallest_island_or_is_left_out_as_asked() {
    // At 5 cm per pixel a pixel is a quarter of the smallest island.
    let mut lot = fine_lane("specks", |x, y| {
        [(300, 8), (310, 44), (333, 44)].contains(&(x, y)) || (400..403).contains(&x) && y == 9
    });
    std::fs::write(&lot.map, yaml("0.05", "[0, 0, 0]")).unwrap();
    lot.scale = 2.0;
    (lot.start, lot.goal) = (Some([4.0, 1.3, 0.0]), Some([21.0, 1.3, 0.0]));
    let areas = |scenario: &Scenario| -> Vec<f32> {
        let area = |island: &Island| sim::geometry::signed_area_m2(&island.polygon).abs();
        scenario.islands.iter().map(area).collect()
    };
    // 10 cm squares in the lot are just as large as islands must be, and a little more is asked for.
    let loaded = lot.scenario(&car()).unwrap();
    assert_eq!(loaded.notes, [Note::Padded { specks: 3 }]);
    let said = loaded.notes[0].to_string();
    assert!(said.contains("drop_specks_m2 (--drop-specks of cargo xtask generate) leaves out such specks"), "{said}");
    let sizes = areas(&loaded.scenario);
    assert_eq!(sizes.len(), 4);
    assert!(sizes.iter().all(|&area_m2| (0.0105..0.031).contains(&area_m2)), "{sizes:?}");
    for (x, y) in [(30.05, 0.85), (31.05, 4.45), (33.35, 4.45), (40.15, 0.95)] {
        let is_inside = |island: &Island| sim::geometry::polygon_contains(&island.polygon, Vec2::new(x, y));
        assert!(loaded.scenario.islands.iter().any(is_inside), "({x}, {y}) stays occupied");
    }
    lot.drop_specks_m2 = 0.02;
    let loaded = lot.scenario(&car()).unwrap();
    assert_eq!(loaded.notes, [Note::Dropped { specks: 3, up_to_m2: 0.02 }]);
    assert_eq!(areas(&loaded.scenario).len(), 1, "what is larger stays");
}

/// Of specks as large as one pixel none was left out at 5, 10 and 20 cm per pixel.
#[test]
fn a_speck_that_is_just_as_large_as_asked_for_is_left_out() {
    for (resolution_m, drop_specks_m2) in [(0.05, 0.0025), (0.1, 0.01), (0.2, 0.04), (0.25, 0.0625)] {
        let lot = MapLot { drop_specks_m2, ..fine_lane("speck-of-a-pixel", |x, y| (x, y) == (300, 26)) };
        std::fs::write(&lot.map, yaml(&resolution_m.to_string(), "[0, 0, 0]")).unwrap();
        let (map, ..) = ros::Map::read(&lot.map, false).unwrap();
        let (seed, mut notes) = ([80.5 * resolution_m, 26.5 * resolution_m], Vec::new());
        let ground = lot.ros_ground(&map, Frame::around(seed, 1.0), seed, None, &car(), &mut notes).unwrap();
        assert_eq!(notes, [Note::Dropped { specks: 1, up_to_m2: drop_specks_m2 }]);
        assert!(ground.islands.is_empty(), "{resolution_m} m: {:?}", ground.islands);
    }
}

/// A start beside a speck, on a pixel that is free, was said to be "occupied or unknown".
#[test]
fn a_start_that_a_larger_speck_covers_is_said_to_lie_within_it() {
    // At 10 cm per pixel of the lot a speck grows by the pixel to its right.
    let mut lot = fine_lane("covered", |x, y| (x, y) == (420, 26));
    std::fs::write(&lot.map, yaml("0.05", "[0, 0, 0]")).unwrap();
    lot.scale = 2.0;
    (lot.start, lot.goal) = (Some([21.07, 1.32, 0.0]), Some([28.0, 1.3, 0.0]));
    let refusal = refusal(&lot);
    let expected = "start: (21.07, 1.32) lies within a speck or wall that was made larger; move it";
    assert!(refusal.contains(expected), "{refusal}");
}

/// Kerbs of one pixel lay between two rows of the sensor's distances at half of the places that they could have: no cell showed
/// them, and they were driven over.
#[test]
fn a_thin_kerb_is_seen_in_every_cell_that_it_crosses() {
    // At 5 cm per pixel, on ground of 20 m × 12 m.
    let kerbs: [fn(usize, usize) -> bool; 5] = [
        |x, _| x == 250,
        |x, y| x == 230 + y / 7,
        |x, y| x == 160 + y,
        |x, y| x == 160 + 3 * y / 2,
        |x, y| y == 121 && (150..380).contains(&x),
    ];
    for (kerb, is_drawn) in kerbs.into_iter().enumerate() {
        for offset in 0..4 {
            let is_kerb =
                |x: usize, y: usize| (40..200).contains(&y) && x >= offset && is_drawn(x - offset, y + offset);
            let is_occupied = |x, y| !(1..399).contains(&x) || !(1..239).contains(&y) || is_kerb(x, y);
            let row = |y| (0..400).map(|x| if is_occupied(x, y) { '#' } else { '.' }).collect();
            let rows: Vec<String> = (0..240).rev().map(row).collect();
            let folder = folder("thin", &[("map.yaml", &yaml("0.05", "[0.012, 0, 0]")), ("map.pgm", &pgm(&rows))]);
            let lot = MapLot { wall_height_m: 0.15, ..MapLot::of_map(&folder.join("map.yaml")) };
            let (map, ..) = ros::Map::read(&lot.map, false).unwrap();
            let (seed, mut notes) = ([3.0, 1.0], Vec::new());
            let ground = lot.ros_ground(&map, Frame::around(seed, 1.0), seed, None, &car(), &mut notes).unwrap();
            assert!(matches!(notes[..], [.., Note::Thickened { pixels: 100.. }]), "{notes:?}");

            let reference_path = ReferencePath { points: vertices(&[(3.0, 1.0), (17.0, 1.0)]), corner_radius_m: 0.0 };
            let built = Map::build(Scenario { reference_path, ..lot.outlines(&ground) }, &car()).unwrap();
            let (settings, pose) = (SensingSettings::paper(), Pose::new(Vec2::new(2.0, 6.0), 0.0));
            let geometry = settings.geometry;
            let sensor = Sensor::new(&built, settings, &NoiseSettings::of(NoiseLevel::Clean), RootSeed(0));
            let grid = sensor.clean_view(&built, pose).to_grid();
            let mut crossed = BTreeMap::new();
            for (x, y) in (40..200).flat_map(|y| (0..400).map(move |x| (x, y))).filter(|&(x, y)| is_kerb(x, y)) {
                let [x_m, y_m] = map.point_at([x, y].map(|pixel| pixel as f64 + 0.5)).map(|metres| metres as f32);
                let in_ego = Vec2::new(x_m, y_m) - pose.position();
                if geometry.contains(in_ego) {
                    let row = ((geometry.far_edge_ahead_m() - in_ego.x) / geometry.cell_m()) as usize;
                    let col = ((0.5 * geometry.side_m - in_ego.y) / geometry.cell_m()) as usize;
                    *crossed.entry((row, col)).or_insert(0) += 1;
                }
            }
            // Of the corner of a cell, and the end of a kerb, less is there than a pixel of the sensor.
            crossed.retain(|_, pixels| *pixels > 2);
            assert!(crossed.len() > 9, "kerb {kerb} crosses {crossed:?}");
            for (row, col) in crossed.into_keys() {
                assert!(grid.is_occupied(row, col), "kerb {kerb}, {offset} pixels on: cell {row}, {col} is free");
            }
        }
    }
}

/// A speck in the corner between wall and lane becomes part of the wall, not an island across the boundary.
#[test]
fn a_speck_beside_a_wall_grows_into_it() {
    // At 2 cm per pixel it grows by two pixels to either side.
    let lot = MapLot { scale: 0.2, ..fine_lane("speck-at-wall", |x, y| (x, y) == (300, 2)) };
    let (map, ..) = ros::Map::read(&lot.map, false).unwrap();
    let (seed, mut notes) = ([8.0, 2.6], Vec::new());
    let ground = lot.ros_ground(&map, Frame::around(seed, 0.2), seed, None, &car(), &mut notes).unwrap();
    assert_eq!(notes, [Note::Padded { specks: 1 }]);
    assert!(ground.islands.is_empty() && ground.boundary.len() > 4, "{:?}", ground.boundary);
}

#[test]
fn walls_are_as_high_as_the_lot_says_and_hide_ground_unless_they_are_kerbs() {
    let mut lot =
        fine_lane("walls", |x, y| (250..260).contains(&x) && y < 9 || (300..310).contains(&x) && (36..44).contains(&y));
    for (wall_height_m, hides) in [(None, true), (Some(0.15), false), (Some(0.0), false)] {
        lot.wall_height_m = wall_height_m.unwrap_or(lot.wall_height_m);
        let scenario = lot.scenario(&car()).unwrap().scenario;
        assert_eq!(scenario.boundary_height_m.to_bits(), lot.wall_height_m.to_bits());
        let text = crate::load::to_toml(&scenario);
        assert_eq!(crate::load::parse(&text, "written.toml", &car()).unwrap(), scenario, "heights are written");
        let map = Map::build(scenario, &car()).unwrap();
        assert_eq!(!map.occluders().is_empty(), hides, "{wall_height_m:?}");
    }
}

/// The advice was to leave vertices out, of a file that nobody has written.
#[test]
fn a_map_with_too_many_vertices_is_refused_with_what_helps_for_an_image() {
    // 52 × 52 stairs of six pixels, of eight corners each.
    let is_occupied =
        |x: usize, y: usize| (8..268).contains(&x) && (8..268).contains(&y) && (x - 8) % 5 + (y - 8) % 5 < 3;
    let rows: Vec<String> =
        (0..276).rev().map(|y| (0..276).map(|x| if is_occupied(x, y) { '#' } else { '.' }).collect()).collect();
    let folder = folder("vertices", &[("map.yaml", &yaml("1.0", "[0, 0, 0]")), ("map.pgm", &pgm(&rows))]);
    let mut lot = MapLot::of_map(&folder.join("map.yaml"));
    (lot.start, lot.goal) = (Some([4.0, 4.0, 0.0]), Some([272.0, 272.0, 0.0]));
    let refusal = refusal(&lot);
    assert!(refusal.contains("map: the outlines of what is drivable have 200"), "{refusal}");
    assert!(refusal.contains(" vertices, or more; smooth the image, crop it, or leave specks out"), "{refusal}");
}

/// UTM coordinates of some yard: the same lot as beside the origin.
#[test]
fn a_map_far_from_its_origin_is_the_same_lot_about_its_start() {
    let near = fine_lane("near", |x, y| (300..310).contains(&x) && y < 12);
    let mut far = fine_lane("far", |x, y| (300..310).contains(&x) && y < 12);
    std::fs::write(&far.map, yaml("0.1", "[4431992.0, 5412997.4, 0.0]")).unwrap();
    (far.start, far.goal) = (Some([4_432_000.0, 5_413_000.0, 0.0]), Some([4_432_034.0, 5_413_000.0, 0.0]));
    let mut far_file = far.clone();
    let (near, far) = (near.scenario(&car()).unwrap(), far.scenario(&car()).unwrap());
    assert_eq!(near.notes, []);
    assert_eq!(far.notes, [Note::Recentred { origin: [4_432_000.0, 5_413_000.0] }]);
    let moved = Vec2::new(8.0, 2.6);
    assert_eq!(near.scenario.boundary.len(), far.scenario.boundary.len());
    for (a, b) in near.scenario.boundary.iter().zip(&far.scenario.boundary) {
        assert!(a.distance(*b + moved) < 2e-3, "{a} {b}");
    }
    let said = far.notes[0].to_string();
    assert_eq!(said, "the map is far from its origin; (0, 0) of the lot is (4432000, 5413000) of the map");
    // An error named a place that nobody could find on the map.
    let line = far_file.map.with_file_name("line.csv");
    std::fs::write(&line, "4431993.1,5413000\n4432034,5413000\n").unwrap();
    (far_file.start, far_file.goal, far_file.centre_line) = (None, None, Some(line));
    let error = far_file.scenario(&car()).unwrap_err().to_string();
    assert!(error.contains("(coordinates are the map's less (4431993, 5413000))"), "{error}");
}

#[test]
fn junctions_of_a_map_are_named_and_closed_when_asked() {
    // The lane with a side street of 5 m at x = 25, 30 m long.
    let rows: Vec<String> = (0..352)
        .rev()
        .map(|y| {
            let is_free = |x: usize| {
                (1..599).contains(&x) && (1..51).contains(&y) || (225..275).contains(&x) && (51..351).contains(&y)
            };
            (0..600).map(|x| if is_free(x) { '.' } else { '#' }).collect()
        })
        .collect();
    let mut lot = fine_lane("junction", |_, _| false);
    std::fs::write(lot.map.with_file_name("map.pgm"), pgm(&rows)).unwrap();
    let loaded = lot.scenario(&car()).unwrap();
    let [Note::Open { mouths, is_asked_to_close: false }] = &loaded.notes[..] else { panic!("{:?}", loaded.notes) };
    assert!(mouths.len() == 1 && (mouths[0][0] - 25.0).abs() < 2.5, "{mouths:?}");
    assert!(loaded.notes[0].to_string().starts_with("the route has 1 junction, near (2"), "{}", loaded.notes[0]);
    lot.close_branches = true;
    let loaded = lot.scenario(&car()).unwrap();
    let [Note::Closed { mouths }] = &loaded.notes[..] else { panic!("{:?}", loaded.notes) };
    assert_eq!((mouths.len(), loaded.scenario.islands.len()), (1, 1));
    // What no kerb closes is not answered with the advice to close it.
    let left = Note::Open { mouths: mouths.clone(), is_asked_to_close: true }.to_string();
    assert!(left.contains("no kerb closes what is left") && !left.contains("--close-branches"), "{left}");
    assert!(left.contains("or beyond 40 kerbs"), "it was said of ways that a 41st would close, too: {left}");
}

/// Nothing on such a way is far from the route: it was neither named nor closed.
#[test]
fn a_gap_between_two_legs_on_a_map_is_named_and_closed_when_asked() {
    // Ground of 76 m by 20 m with a wall along its middle, which leaves 10 m free at its end, and a gap of 5 m.
    let is_wall = |x: usize, y: usize| {
        let is_middle = (98..102).contains(&y) && x < 650 && !(350..400).contains(&x);
        !(1..759).contains(&x) || !(1..201).contains(&y) || is_middle
    };
    let rows: Vec<String> =
        (0..202).rev().map(|y| (0..760).map(|x| if is_wall(x, y) { '#' } else { '.' }).collect()).collect();
    let line = "10,5\n70,5\n70,15\n10,15\n";
    let folder =
        folder("short-cut", &[("map.yaml", &yaml("0.1", "[0, 0, 0]")), ("map.pgm", &pgm(&rows)), ("line.csv", line)]);
    let mut lot = MapLot::of_map(&folder.join("map.yaml"));
    lot.centre_line = Some(folder.join("line.csv"));
    let loaded = lot.scenario(&car()).unwrap();
    let [note @ Note::ShortCuts { short_cuts, is_asked_to_close: false }] = &loaded.notes[..] else {
        panic!("{:?}", loaded.notes)
    };
    let [ShortCut { middle: [x, y], joins_m: [from_m, to_m] }] = short_cuts[..] else { panic!("{short_cuts:?}") };
    assert!((x - 37.5).abs() < 2.0 && (y - 10.0).abs() < 0.5, "({x}, {y})");
    // The route has 55 m, a bend of 15.7 m and 55 m.
    assert!((from_m - 27.5).abs() < 2.5 && (to_m - 98.2).abs() < 2.5, "{from_m} {to_m}");
    assert!(note.to_string().contains("the shorter way; close_branches = true (--close-branches"), "{note}");
    let walls = loaded.scenario.islands.len();
    lot.close_branches = true;
    let loaded = lot.scenario(&car()).unwrap();
    let [Note::Closed { mouths }] = &loaded.notes[..] else { panic!("{:?}", loaded.notes) };
    assert_eq!((mouths.len(), loaded.scenario.islands.len()), (1, walls + 1));
}

#[test]
fn an_image_without_pixels_is_refused() {
    let lot = lane("no-pixels", 5);
    std::fs::write(lot.map.with_file_name("map.pgm"), "P5\n0 0\n255\n").unwrap();
    let message = refusal(&lot);
    assert!(message.contains("map.pgm: ") && message.contains("save the map"), "{message}");
}

/// On a coarse map too: nothing that is blocked becomes drivable by more than 0.2 m, by exact polygons.
#[test]
fn blocked_ground_stays_blocked_to_a_fifth_of_a_metre() {
    use geo::{Contains, Distance, Euclidean, LineString, Point, Polygon};
    for pixel_m in [0.05, 0.25, 1.0, 2.5] {
        let size = 60;
        // A disc with a crooked island and a slanted wall.
        let is_free = |x: f64, y: f64| {
            let island = libm::hypot(x - 22.0, y - 31.0) < 7.0 + 2.0 * libm::sin(0.9 * x);
            let wall = (y - 0.31 * x - 29.0).abs() < 1.2 && x > 33.0;
            libm::hypot(x - 30.0, y - 30.0) < 27.0 && !island && !wall
        };
        let rows: Vec<String> = (0..size)
            .rev()
            .map(|y| (0..size).map(|x| if is_free(f64::from(x), f64::from(y)) { '.' } else { '#' }).collect())
            .collect();
        let folder =
            folder("coarse", &[("map.yaml", &yaml(&pixel_m.to_string(), "[0, 0, 0]")), ("map.pgm", &pgm(&rows))]);
        let lot = MapLot::of_map(&folder.join("map.yaml"));
        let (map, ..) = ros::Map::read(&lot.map, false).unwrap();
        let ground = ground(&lot, [30.0 * pixel_m, 12.0 * pixel_m]);
        let polygon = |outline: &[Vec2]| -> Polygon<f64> {
            let ring = outline.iter().map(|p| (f64::from(p.x), f64::from(p.y))).collect::<LineString<f64>>();
            Polygon::new(ring, Vec::new())
        };
        let (boundary, islands) =
            (polygon(&ground.boundary), ground.islands.iter().map(|island| polygon(island)).collect::<Vec<_>>());
        let mut deepest_m = 0.0_f64;
        for i in 0..(4 * size) * (4 * size) {
            // Four samples per pixel and axis.
            let at = [f64::from(i % (4 * size)), f64::from(i / (4 * size))].map(|k| (k + 0.5) / 4.0);
            let point = Point::from((at[0] * pixel_m, at[1] * pixel_m));
            let is_drivable = boundary.contains(&point) && !islands.iter().any(|island| island.contains(&point));
            let pixel = [at[0] as i32, at[1] as i32];
            if !is_drivable || map.drivable.at(pixel) {
                continue;
            }
            // How deep in blocked ground: to the nearest free pixel.
            let to_free = |col: i32, row: i32| {
                let [x, y] = [col, row].map(|k| f64::from(k) * pixel_m);
                let side = geo::Rect::new((x, y), (x + pixel_m, y + pixel_m)).to_polygon();
                Euclidean.distance(&point, &side)
            };
            let around = (-2..=2).flat_map(|dy| (-2..=2).map(move |dx| (pixel[0] + dx, pixel[1] + dy)));
            let free = around.filter(|&(col, row)| map.drivable.at([col, row]));
            let depth_m = free.map(|(col, row)| to_free(col, row)).fold(f64::INFINITY, f64::min);
            deepest_m = deepest_m.max(depth_m);
        }
        // Whole millimetres on top.
        assert!(deepest_m <= SIMPLIFIED_M.min(0.75 * pixel_m) + 2e-3, "{deepest_m} m at {pixel_m} m per pixel");
        assert!(pixel_m < 0.1 || deepest_m > 0.0 || pixel_m > 0.3, "outlines are simplified at all");
    }
}

/// Whoever sends a map must not decide which files are read.
#[test]
fn an_image_that_is_not_beside_its_map_is_refused_unless_it_may_be_anywhere() {
    let rows = ["..#?", "..#.", "...."].map(str::to_owned);
    let outer = folder("elsewhere", &[("secret.pgm", &pgm(&rows))]);
    let inner = outer.join("map/below");
    std::fs::create_dir_all(&inner).unwrap();
    std::fs::copy(outer.join("secret.pgm"), inner.join("map.pgm")).unwrap();
    let path = outer.join("map/map.yaml");
    let read = |image: &str, is_anywhere: bool| {
        std::fs::write(&path, yaml("0.5", "[0, 0, 0]").replace("map.pgm", image)).unwrap();
        ros::Map::read(&path, is_anywhere).map(drop).map_err(|error| error.to_string())
    };
    assert_eq!(read("below/map.pgm", false), Ok(()));
    let absolute = outer.join("secret.pgm").display().to_string();
    for image in ["../secret.pgm", "below/../../secret.pgm", &absolute] {
        let error = read(image, false).unwrap_err();
        assert!(error.contains("neither next to the YAML file nor") && error.contains("--image-anywhere"), "{error}");
        assert_eq!(read(image, true), Ok(()), "{image}");
    }
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(outer.join("secret.pgm"), outer.join("map/link.pgm")).unwrap();
        assert!(read("link.pgm", false).is_err_and(|error| error.contains("neither next to")), "a link leads out, too");
    }
}

#[test]
fn a_map_or_centre_line_that_is_not_beside_its_lot_file_is_refused() {
    let outer = folder("lot-elsewhere", &[("secret.yaml", ""), ("secret.csv", "")]);
    std::fs::create_dir(outer.join("lots")).unwrap();
    std::fs::write(outer.join("lots/map.yaml"), "").unwrap();
    let file = outer.join("lots/map.lot.toml");
    for (text, place) in [
        ("map = '../secret.yaml'\n", "map: it is neither next to this file nor"),
        ("map = '/etc/hostname.yaml'\n", "/etc/hostname.yaml: cannot be read"),
        ("map = 'map.yaml'\ncentre_line = '../secret.csv'\n", "centre_line: it is neither next to this file nor"),
    ] {
        std::fs::write(&file, text).unwrap();
        let error = load(&file, &car()).unwrap_err().to_string();
        assert!(error.contains(place), "{text}: {error}");
    }
    // Whoever names the file on the command line may name any.
    let mut lot = MapLot::of_map(&outer.join("lots/map.yaml"));
    lot.centre_line = Some(outer.join("secret.csv"));
    assert!(!lot.scenario(&car()).unwrap_err().to_string().contains("neither next to"));
}

/// `negate: 7` was read as 1.
#[test]
fn negate_is_yes_or_no() {
    let lot = small_map("negate", "[0, 0, 0]");
    std::fs::write(&lot.map, yaml("0.5", "[0, 0, 0]").replace("negate: 0", "negate: 7")).unwrap();
    let refusal = ros::Map::read(&lot.map, false).unwrap_err().to_string();
    assert!(refusal.contains("negate: 7 is neither 0 nor 1"), "{refusal}");
}

/// `negat: 1` was read as a map that is not negated.
#[test]
fn keys_that_mean_nothing_are_named_in_a_note() {
    let mut lot = small_map("unused", "[0, 0, 0]");
    let text = yaml("0.5", "[0, 0, 0]") + "negat: 1\nZ: [2]\n";
    std::fs::write(&lot.map, text).unwrap();
    lot.scale = 10.0;
    let (.., notes) = ros::Map::read(&lot.map, false).unwrap();
    assert_eq!(notes, [Note::Unused { keys: vec!["Z".to_owned(), "negat".to_owned()] }]);
    assert!(notes[0].to_string().contains("\"negat\""), "{}", notes[0]);
}

/// All but the first six were left out without a word.
#[test]
fn keys_that_are_not_named_in_a_note_are_counted() {
    let keys = ["a", "b", "c", "d", "e", "f", "g", "h"].map(str::to_owned).to_vec();
    let said = Note::Unused { keys }.to_string();
    assert!(said.contains("\"e\", \"f\" and 2 more, which mean nothing here"), "{said}");
    let said = Note::Unused { keys: vec!["negat".to_owned()] }.to_string();
    assert!(said.contains("has \"negat\", which means nothing here"), "{said}");
}

/// The saver of ROS 2 writes `free_thresh: 0.25`, with which its own grey for unknown ground is free: nothing said so.
#[test]
fn unknown_ground_that_counts_as_free_is_named_in_a_note() {
    let lot = small_map("unknown-free", "[0, 0, 0]");
    let notes = || ros::Map::read(&lot.map, false).unwrap().2;
    assert_eq!(notes(), []);
    let text = yaml("0.5", "[0, 0, 0]").replace("free_thresh: 0.196", "free_thresh: 0.25");
    std::fs::write(&lot.map, &text).unwrap();
    assert_eq!(notes(), [Note::UnknownIsFree { free_thresh: 0.25 }]);
    assert!(notes()[0].to_string().contains("write free_thresh: 0.196"), "{}", notes()[0]);
    // Nothing is unknown in a map without that grey.
    std::fs::write(lot.map.with_extension("pgm"), pgm(&["....", "....", "...."].map(str::to_owned))).unwrap();
    assert_eq!(notes(), []);
}

/// With `mode: scale` the same grey is free at every threshold that savers write, and no note said so.
#[test]
fn unknown_ground_that_counts_as_free_in_mode_scale_is_named_in_a_note() {
    let lot = small_map("unknown-scaled", "[0, 0, 0]");
    for free_thresh in ["0.196", "0.25"] {
        let text = yaml("0.5", "[0, 0, 0]").replace("mode: trinary", "mode: scale");
        std::fs::write(&lot.map, text.replace("free_thresh: 0.196", &format!("free_thresh: {free_thresh}"))).unwrap();
        let notes = ros::Map::read(&lot.map, false).unwrap().2;
        assert_eq!(notes, [Note::UnknownIsScaled]);
        // A lower threshold alone would not help.
        assert!(notes[0].to_string().contains("write mode: trinary and free_thresh: 0.196"), "{}", notes[0]);
    }
}

/// In mode `raw` map_server of ROS 1 negates and that of ROS 2 does not; here `negate` had no effect, without a word.
#[test]
fn a_raw_map_that_is_negated_is_refused() {
    let lot = small_map("raw-negated", "[0, 0, 0]");
    let raw = yaml("0.5", "[0, 0, 0]").replace("mode: trinary", "mode: raw");
    for negate in ["1", "true"] {
        std::fs::write(&lot.map, raw.replace("negate: 0", &format!("negate: {negate}"))).unwrap();
        let refusal = ros::Map::read(&lot.map, false).unwrap_err().to_string();
        assert!(refusal.contains("map.yaml:5: negate: it is set, and mode is raw"), "{refusal}");
        assert!(refusal.contains("write 0"), "{refusal}");
    }
    std::fs::write(&lot.map, &raw).unwrap();
    assert!(ros::Map::read(&lot.map, false).is_ok());
}

/// The YAML reader's own words were shown: "untagged enum Flag", and "set DuplicateKeyPolicy in Options".
#[test]
fn errors_of_the_yaml_file_do_not_speak_of_the_program() {
    let lot = small_map("yaml-words", "[0, 0, 0]");
    let sound = yaml("0.5", "[0, 0, 0]");
    for (text, expected) in [
        (sound.replace("negate: 0", "negate: maybe"), "negate: write 0, 1, false or true; a map needs image"),
        (sound.clone() + "negate: 1\n", "duplicate mapping key: negate; a map needs image"),
    ] {
        std::fs::write(&lot.map, text).unwrap();
        let refusal = ros::Map::read(&lot.map, false).unwrap_err().to_string();
        assert!(refusal.contains(expected), "{refusal}");
    }
}

/// A first point with a letter in it was taken for a header, and the route began at the second.
#[test]
fn a_first_line_with_a_number_in_it_is_no_header() {
    let points_of = |text: &str| centre_line::parse(text, "line.csv", 1.0).map(|points| points.len());
    assert_eq!(points_of("x,y\n1,2\n3,4\n").unwrap(), 2);
    for before in
        ["# x [m], y [m]", "# from lat/lon, by hand", "# north up, x right", "# y,x,v", "# y\n#", "# y,x\nx,y"]
    {
        assert_eq!(points_of(&format!("{before}\n1,2\n3,4\n")).unwrap(), 2, "{before}");
    }
    for text in ["-15.O,-13.2\n1,2\n3,4\n", "1,y\n1,2\n3,4\n", "8;12\n20,12\n40,12\n", "8 12\n1,2\n3,4\n"] {
        assert!(points_of(text).unwrap_err().to_string().contains("is not a point"), "{text}");
    }
}

/// Behind the first point they were refused, and before it taken for a header, so that the header was refused.
#[test]
fn an_indented_comment_and_a_line_of_blanks_are_passed_over() {
    let points_of = |text: &str| centre_line::parse(text, "line.csv", 1.0);
    for text in [
        "1,2\n  # by hand\n3,4\n",
        "1,2\n\t# \"by hand\n3,4\n",
        "1,2\n   \n3,4\n \t",
        "  # by hand\n \r\nx,y\r\n1,2\r\n3,4\r\n",
    ] {
        assert_eq!(points_of(text), Ok(vec![[1.0, 2.0], [3.0, 4.0]]), "{text:?}");
    }
    let error = points_of("1,2\n  # by hand\n \n3;4\n").unwrap_err().to_string();
    assert!(error.starts_with("line.csv:4: \"3;4\" is not a point"), "{error}");
}

/// They were quoted whole.
#[test]
fn numbers_of_hundreds_of_digits_are_quoted_in_part() {
    let text = format!("1,2\n{},4\n", "9".repeat(300));
    let error = centre_line::parse(&text, "line.csv", 1.0).unwrap_err().to_string();
    assert!(error.starts_with("line.csv:2: \"999999999999… (300 digits),4\" is not a point"), "{error}");
}

#[test]
fn a_start_beside_a_centre_line_is_refused() {
    let mut lot = small_map("start-and-line", "[0, 0, 0]");
    (lot.start, lot.centre_line) = (Some([1.0, 1.0, 0.0]), Some(lot.map.with_file_name("line.csv")));
    let error = lot.scenario(&car()).unwrap_err().to_string();
    assert!(error.contains("start") && error.contains("centre_line is given too"), "{error}");
}
