use super::animation::{Camera, Layout, Scene, Take};
use super::drawing::{Drawing, Font, Rgb};
use super::encode::Format;
use super::lot::{ASPHALT, GROUND, View};
use super::trajectories::{ColourBy, Point, Trajectory};
use super::{contact_sheet, file_name, grids, lot, noise, trajectories};
use experiment::drive::Replay;
use experiment::drivers::DriverSpec;
use experiment::lots::Lot;
use experiment::replay_key::ReplayKey;
use experiment::settings::{NoiseChoice, Settings};
use experiment::trials::{Purpose, Trial};
use sim::driver::{LookAheadPoint, Source, Spread};
use sim::frame::{Event, Frame};
use sim::geometry::Vec2;
use sim::map::Map;
use sim::scenario::Direction;
use sim::seed::RootSeed;
use sim::sensing::noise::Layer;
use sim::sensing::{GRID_CELLS, GridGeometry, OccupancyGrid};
use sim::vehicle::VehicleSettings;
use std::ops::ControlFlow;
use tiny_skia::Pixmap;

fn at(pixmap: &Pixmap, place: Vec2) -> Rgb {
    let pixel = pixmap.pixel(place.x as u32, place.y as u32).unwrap();
    [pixel.red(), pixel.green(), pixel.blue()]
}

/// A recording of a dozen drivers could not be written: the name of its file was longer than file systems allow.
#[test]
fn names_of_files_are_short_and_differ() {
    let name_of = |last: &str| file_name(&format!("lot b/{}{last}", "run:runs/é-".repeat(40)));
    let (one, other) = (name_of("1"), name_of("2"));
    assert!(one.len() <= 200 && one.starts_with("lot-b-run-runs-é-") && one != other, "{one}, {other}");
    assert_eq!(file_name("lot-b"), "lot-b");
}

fn map_of(spec: &str) -> Map {
    let settings = Settings::preset("default").unwrap();
    let lots = Lot::parse_all(&[spec], &settings.episode.vehicle).unwrap();
    let trial = Trial::all(RootSeed(1), Purpose::Pictures, &lots, 1, &[Direction::Forward]).next().unwrap();
    trial.map(&settings.episode).unwrap()
}

#[test]
fn shapes_lie_where_they_are_put_in_png_and_svg() {
    let mut drawing = Drawing::new(Vec2::new(60.0, 40.0), [255; 3]).unwrap();
    drawing.rectangle(Vec2::new(10.0, 5.0), Vec2::new(20.0, 10.0), [200, 0, 0]);
    drawing.disc(Vec2::new(45.0, 20.0), 5.0, [0, 0, 200]);
    let mut inset = Drawing::new(Vec2::splat(10.0), [0, 200, 0]).unwrap();
    inset.disc(Vec2::splat(10.0), 40.0, [9, 9, 9]);
    drawing.inset(inset, Vec2::new(0.0, 30.0));
    drawing.text("a<b & c", Vec2::new(2.0, 22.0), Font::Small, [1, 2, 3]);
    let pixmap = drawing.pixmap();
    assert_eq!((pixmap.width(), pixmap.height()), (60, 40));
    for (x, y, rgb) in [
        (11.0, 6.0, [200, 0, 0]),
        (29.0, 14.0, [200, 0, 0]),
        (31.0, 14.0, [255; 3]),
        (45.0, 20.0, [0, 0, 200]),
        (9.0, 39.0, [9, 9, 9]),
        (12.0, 35.0, [255; 3]), // an inset ends at its edges
    ] {
        assert_eq!(at(&pixmap, Vec2::new(x, y)), rgb, "({x}, {y})");
    }
    let svg = drawing.to_svg();
    let document = roxmltree::Document::parse(&svg).unwrap();
    let root = document.root_element();
    assert_eq!((root.attribute("width"), root.attribute("viewBox")), (Some("60"), Some("0 0 60 40")));
    let text = document.descendants().find(|node| node.has_tag_name("text")).unwrap();
    assert_eq!(text.text(), Some("a<b & c"));
    let disc = document.descendants().find(|node| node.has_tag_name("circle")).unwrap();
    assert_eq!((disc.attribute("cx"), disc.attribute("fill")), (Some("45.00"), Some("#0000c8")));
}

#[test]
fn pictures_that_cannot_be_are_refused() {
    let error = Drawing::new(Vec2::new(20_000.0, 10.0), [0; 3]).unwrap_err().to_string();
    assert!(error.contains("20000") && error.contains("--pixels-per-metre"), "{error}");
    assert!(Drawing::new(Vec2::new(0.4, 10.0), [0; 3]).is_err());
}

#[test]
fn a_top_view_shows_the_ground_where_it_is() {
    let map = map_of("lot-b");
    let vehicle = VehicleSettings::hyundai_hg300();
    let drawing = lot::top_view(&map, &vehicle, Some(6.0)).unwrap();
    let (view, pixmap) = (View::of_map(&map, Some(6.0)), drawing.pixmap());
    assert_eq!(pixmap.width(), (view.size_m.x * 6.0) as u32);
    assert_eq!(at(&pixmap, Vec2::splat(2.0)), GROUND, "the margin");
    // The start: a green dot. Beside the route, where nothing stands: asphalt.
    assert_eq!(at(&pixmap, view.pixel(map.start().position())), lot::ROUTE);
    let free = (0..200)
        .map(|i| map.path().pose_at(0.5 * i as f32))
        .map(|pose| pose.position() + 0.9 * pose.ahead().perp())
        .filter(|&place| map.signed_distance_m(place) > 0.6 && place.distance(map.start().position()) > 8.0);
    let (mut asphalt, mut all) = (0, 0);
    for place in free {
        asphalt += u32::from(at(&pixmap, view.pixel(place)) == ASPHALT);
        all += 1;
    }
    // Arrows of the route are wider than 0.9 m here and there.
    assert!(all > 50 && asphalt > all * 8 / 10, "{asphalt} of {all} places beside the route are asphalt");
}

#[test]
fn a_drive_has_the_colour_of_who_drove_and_its_near_collisions_are_crossed() {
    let map = map_of("lot-a");
    let point = |s_m: f32, source| Point {
        at: map.path().pose_at(s_m).position(),
        speed_mps: 1.1,
        source,
        is_last: false,
        near_collision: (s_m == 50.0).then(|| map.path().pose_at(50.0).position()),
    };
    let points = (0..80).map(|s| point(s as f32, if s < 40 { Source::Expert } else { Source::Novice })).collect();
    let driven = [Trajectory { name: "network".to_owned(), points }];
    let draw = |by| trajectories::picture(&map, &driven, by, "drive", Some(8.0)).unwrap().pixmap();
    let view = View::of_map(&map, Some(8.0));
    let place = |s_m: f32| view.pixel(map.path().pose_at(s_m).position());
    let by_source = draw(ColourBy::Source);
    assert_eq!(at(&by_source, place(20.0)), trajectories::of_source(Source::Expert));
    assert_eq!(at(&by_source, place(70.0)), trajectories::of_source(Source::Novice));
    assert_eq!(at(&by_source, place(50.0)), trajectories::NEAR_COLLISION);
    assert_eq!(at(&draw(ColourBy::Speed), place(70.0)), trajectories::of_speed(1.1));
    assert_eq!(at(&draw(ColourBy::Driver), place(70.0)), trajectories::rgb(0));
    assert_ne!(trajectories::of_speed(0.0), trajectories::of_speed(2.0));
}

/// Texts of a picture that reach beyond its right edge.
fn clipped(drawing: &Drawing) -> Vec<String> {
    let svg = drawing.to_svg();
    let document = roxmltree::Document::parse(&svg).unwrap();
    let texts = document.root_element().children().filter(|node| node.has_tag_name("text"));
    let number = |node: roxmltree::Node<'_, '_>, key: &str| node.attribute(key).unwrap().parse::<f32>().unwrap();
    let is_clipped =
        |node: &roxmltree::Node<'_, '_>| number(*node, "x") + number(*node, "textLength") > drawing.size_px().x;
    texts.filter(is_clipped).map(|node| node.text().unwrap_or_default().to_owned()).collect()
}

/// The legend of a narrow lot ended at `tuned:tentacle: 0 near-collision`.
#[test]
fn no_name_of_a_driver_is_clipped_in_a_narrow_picture() {
    let map = map_of("lot-a");
    let points = |s_m: f32| Point {
        at: map.path().pose_at(s_m).position(),
        speed_mps: 1.0,
        source: Source::Planner,
        is_last: false,
        near_collision: None,
    };
    for name in ["tuned:tentacle", "run:/home/somebody/runs/train-dagger-default-with-a-long-name-of-a-folder-s1/bc"] {
        let driven = [Trajectory { name: name.to_owned(), points: [1.0, 2.0].map(points).to_vec() }];
        let drawing = trajectories::picture(&map, &driven, ColourBy::Driver, "drive", Some(1.0)).unwrap();
        assert_eq!(clipped(&drawing), [""; 0]);
        assert!(drawing.to_svg().contains(&format!("{}: 0 near-collisions</text>", lot::ending(name, 60))));
    }
}

/// The lines of sixteen drivers were as wide as their lane.
#[test]
fn many_lines_on_one_another_are_no_wider_than_five() {
    let widths = |drivers: usize| (0..drivers).map(move |driver| trajectories::width_px(driver, drivers, [4.0, 2.5]));
    assert!(widths(2).eq([6.5, 4.0]) && widths(5).eq([14.0, 11.5, 9.0, 6.5, 4.0]));
    let many: Vec<f32> = widths(200).collect();
    assert!(many[0] <= 14.01 && many.windows(2).all(|pair| pair[0] > pair[1]), "{many:?}");
}

/// `Überland` was ` berland`.
#[test]
fn a_letter_that_the_font_lacks_is_no_gap() {
    for letter in ["Ü", "ż", "日"] {
        let mut drawing = Drawing::new(Vec2::splat(24.0), [255; 3]).unwrap();
        drawing.text(letter, Vec2::ZERO, Font::Small, [0; 3]);
        assert!(drawing.pixmap().data().chunks_exact(4).any(|rgba| rgba[0] < 128), "{letter}");
    }
}

#[test]
fn a_grid_shows_wrong_cells_in_the_colour_of_their_layer() {
    let mut cells = OccupancyGrid::free();
    cells.set_occupied(0, 0);
    cells.set_occupied(3, 24);
    let wrong = |row, col| match (row, col) {
        (3, 24) => Some(Layer::Blob),
        (24, 0) => Some(Layer::FalseFree),
        _ => None,
    };
    let pixmap = grids::grid(&cells, 10.0, wrong).unwrap().pixmap();
    assert_eq!(pixmap.width() as usize, 10 * GRID_CELLS);
    let cell = |row: usize, col: usize| Vec2::new(col as f32 * 10.0 + 5.0, row as f32 * 10.0 + 5.0);
    assert_eq!(at(&pixmap, cell(0, 0)), grids::OCCUPIED);
    assert_eq!(at(&pixmap, cell(3, 24)), grids::of_layer(Layer::Blob));
    assert_eq!(at(&pixmap, cell(24, 0)), grids::FREE, "the middle of a cell wrongly free");
    assert_eq!(at(&pixmap, cell(24, 0) - Vec2::splat(4.5)), grids::of_layer(Layer::FalseFree), "its frame");
    assert_eq!(at(&pixmap, cell(12, 12)), grids::FREE);
}

#[test]
fn points_lie_in_the_patch_as_in_the_paper() {
    let geometry = GridGeometry::paper();
    let mut drawing = grids::grid(&OccupancyGrid::free(), 8.0, |_, _| None).unwrap();
    let far_left = LookAheadPoint { ahead_m: geometry.near_edge_ahead_m + 9.0, left_m: 3.0 };
    let near_right = LookAheadPoint { ahead_m: geometry.near_edge_ahead_m + 3.0, left_m: -3.0 };
    grids::draw_label(&mut drawing, far_left, &geometry);
    grids::draw_prediction(&mut drawing, near_right, Some(Spread { ahead_m: 1.0, left_m: 0.5 }), &geometry);
    let pixmap = drawing.pixmap();
    assert_eq!(at(&pixmap, Vec2::new(50.0, 50.0)), grids::LABEL);
    assert_eq!(at(&pixmap, Vec2::new(150.0, 150.0)), grids::PREDICTION);
    // One σ ahead of it: 1 m = 16.7 pixels.
    assert_ne!(at(&pixmap, Vec2::new(150.0, 133.0)), grids::FREE);
}

#[test]
fn a_contact_sheet_has_a_tile_per_lot() {
    let maps = ["lot-a", "lot-b", "lot-c"].map(map_of);
    let sheet = contact_sheet::picture(&maps).unwrap();
    assert!(sheet.size_px().x <= 700.0 && sheet.size_px().y <= 700.0, "{:?}", sheet.size_px());
    let svg = sheet.to_svg();
    let document = roxmltree::Document::parse(&svg).unwrap();
    let names: Vec<&str> =
        document.descendants().filter(|node| node.has_tag_name("text")).filter_map(|node| node.text()).collect();
    assert_eq!(names.len(), 3);
    assert!(names[1].starts_with("lot-b, 1"), "{names:?}");
}

#[test]
fn noise_is_shown_per_level() {
    let settings = Settings::preset("default").unwrap();
    let lots = Lot::parse_all(&["lot-a"], &settings.episode.vehicle).unwrap();
    let trial = Trial::all(RootSeed(1), Purpose::Pictures, &lots, 1, &[Direction::Forward]).next().unwrap();
    let map = trial.map(&settings.episode).unwrap();
    let inspected = |level: NoiseChoice| (level.name(), noise::inspect(&settings.episode, &trial, &map, level, 60.0));
    let levels = [inspected(NoiseChoice::Clean), inspected(NoiseChoice::Hard)];
    assert!(Layer::ALL.iter().all(|&layer| levels[0].1.count_cells(layer) == 0), "clean is clean");
    assert!(Layer::ALL.iter().any(|&layer| levels[1].1.count_cells(layer) > 0));
    assert_eq!(clipped(&noise::picture(&"a long name ".repeat(12), &levels).unwrap()), [""; 0]);
    let sheet = noise::picture("lot-a", &levels).unwrap();
    assert_eq!(sheet.size_px().x, 2.0 * 400.0 + 3.0 * 16.0);
}

/// Expert and planner on one lot: a second of it, at both layouts and all cameras.
#[test]
fn an_animation_shows_every_driver_and_has_the_same_bytes_twice() {
    let settings = Settings::preset("default").unwrap();
    let key: ReplayKey = "expert@lot-b@forward@0@paper@1@0".parse().unwrap();
    let replay = Replay::new(&key, &settings.episode).unwrap();
    let take = |spec: &str| {
        let driver = spec.parse::<DriverSpec>().unwrap().load(&settings).unwrap();
        let until = |frame: &Frame| if frame.tick < 100 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) };
        Take::of(&replay, &settings.episode, &driver, until).unwrap()
    };
    let takes = [take("expert"), take("vvf")];
    assert_eq!(takes[0].frames.len(), 101);
    let times: Vec<f32> = (0..8).map(|i| 3.0 + 0.1 * i as f32).collect();
    let scene = |count: usize, camera, layout| {
        Scene::new(&replay, &settings.episode, takes[..count].to_vec(), &times, (camera, layout), "lot-b")
    };
    let place = Camera::Place(takes[0].frames[60].vehicle.pose.position());
    for (count, camera, layout) in
        [(2, Camera::Lot, Layout::Below), (1, Camera::Follow, Layout::Beside), (1, place, Layout::Below)]
    {
        let scene = scene(count, camera, layout);
        let background = scene.background(0).unwrap();
        let svg = background.to_svg();
        assert_eq!(clipped(&background), [""; 0]);
        let names: Vec<&str> = takes[..count].iter().map(|take| take.name.as_str()).collect();
        assert!(names.iter().all(|name| svg.contains(&format!(">{name}</text>"))), "{names:?}");
        let overlay = scene.overlay(7).unwrap().to_svg();
        assert_eq!(overlay.matches(" m/s</text>").count(), count);
        assert!(overlay.contains(">0 near-collisions</text>") && overlay.contains(">3.7 s</text>"), "{overlay}");
        for svg in [svg, overlay] {
            roxmltree::Document::parse(&svg).unwrap();
        }
    }
    // The fourth driver is white, and so is the sheet: its swatch was not to be seen.
    let four = vec![takes[0].clone(); 4];
    let four = Scene::new(&replay, &settings.episode, four, &times[..1], (Camera::Lot, Layout::Below), "lot-b");
    let svg = four.background(0).unwrap().to_svg();
    let is_edge = |line: &&str| line.starts_with("<polygon") && line.contains("fill=\"#22252b\"");
    assert_eq!(svg.lines().filter(is_edge).count(), 4);
    let encoded = || scene(2, Camera::Lot, Layout::Below).reel().unwrap().encode(1, 10, Format::Gif).unwrap();
    let bytes = encoded();
    assert!(bytes == encoded());
    let mut decoder = gif::DecodeOptions::new().read_info(bytes.as_slice()).unwrap();
    let mut frames = 0;
    while decoder.read_next_frame().unwrap().is_some() {
        frames += 1;
    }
    assert_eq!(frames, times.len());
    assert!(bytes.len() < 100_000, "{} bytes for 8 frames: 320 must fit into 3 MB", bytes.len());
}

/// A picture was taken for as many ticks old as it had periods: seconds after a few near-collisions it showed what came
/// seconds later.
#[test]
fn pictures_after_a_near_collision_show_what_happens_at_their_time() {
    let settings = Settings::preset("default").unwrap();
    let key: ReplayKey = "tentacle@lot-b@forward@0@hard@1@0".parse().unwrap();
    let replay = Replay::new(&key, &settings.episode).unwrap();
    let driver = key.driver.load(&settings).unwrap();
    let is_near = |frame: &Frame| matches!(frame.event, Event::NearCollision { .. });
    let mut ticks_left = u32::MAX;
    let take = Take::of(&replay, &settings.episode, &driver, |frame| {
        ticks_left = if is_near(frame) { ticks_left.min(20) } else { ticks_left };
        ticks_left -= 1;
        if ticks_left > 0 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    });
    let take = take.unwrap();
    let near = take.frames.iter().position(is_near).expect("this lot has one; choose another");
    let [begun_s, stands_s] = [near, near + 1].map(|index| take.observed_at_s(index));
    let period_s = settings.episode.control_period_s();
    assert!(stands_s - begun_s > 2.0 * period_s, "braking takes {begun_s} s to {stands_s} s");
    for (time_s, index) in [
        (0.0, 0),
        (begun_s - period_s, near - 1),
        (begun_s, near),
        (stands_s - 0.02, near),
        (stands_s, near + 1),
        (stands_s + 3.0 * period_s, near + 4),
        (1e6, take.frames.len() - 1),
    ] {
        assert_eq!(take.index_at(time_s), index, "at {time_s} s");
    }
}

#[test]
fn squares_of_a_row_are_dashes_of_one_line() {
    let mut drawing = Drawing::new(Vec2::new(40.0, 20.0), [255; 3]).unwrap();
    let corners = [(0.0, 0.0), (8.0, 0.0), (24.0, 0.0), (8.0, 8.0)].map(|(x, y)| Vec2::new(x, y)).to_vec();
    drawing.squares(corners, [7.0, 8.0], [9, 9, 9]);
    let svg = drawing.to_svg();
    assert!(svg.contains("d=\"M0 3.5h15M24 3.5h7M8 11.5h7\"") && svg.contains("stroke-dasharray=\"7 1\""), "{svg}");
    let pixmap = drawing.pixmap();
    for (x, y, rgb) in [(3.0, 3.0, [9; 3]), (7.0, 3.0, [255; 3]), (10.0, 12.0, [9; 3]), (20.0, 3.0, [255; 3])] {
        assert_eq!(at(&pixmap, Vec2::new(x, y)), rgb, "({x}, {y})");
    }
}
