//! Recordings are read back with Rerun's own types.

use crate::drive::Drive;
use crate::layout::{self, Layout, View};
use crate::recording::{EVENT_TIME, Header, Moment, Recording};
use crate::{colours, legend, show_map, training};
use experiment::drive::Replay;
use experiment::drivers::{NamedDriver, shipped_network};
use experiment::lots::Lot;
use experiment::manifest::{Build, Request};
use experiment::progress::{Elapsed, Interrupted, Progress, Silent};
use experiment::run_dir::{Place, RunDir};
use experiment::settings::Settings;
use experiment::training as training_run;
use experiment::view_request::{DriveRequest, Show, Sink, ViewRequest};
use expert::ScriptedExpert;
use planners::explanation::Explanation;
use policy::dataset::Collection;
use policy::drivers::NetPolicy;
use rerun::external::re_log_encoding::DecoderApp;
use rerun::external::re_log_types::StoreKind;
use rerun::log::{Chunk, LogMsg};
use rerun::{
    ComponentDescriptor, EncodedImage, Points3D, Scalars, StateChange, TextDocument, TimelineName, Transform3D,
};
use sim::driver::{Decision, Driver, LookAheadPoint, Policy as _, Situation, Source, Spread};
use sim::episode::Episode;
use sim::frame::{Event, Frame};
use sim::map::Map;
use sim::seed::{Rng, RootSeed, Stream};
use sim::vehicle::VehicleSettings;
use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::BufReader;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use storage::sums;

/// Lot b with the obstacles of one trial.
pub(crate) fn map() -> Map {
    let vehicle = VehicleSettings::hyundai_hg300();
    let lots = Lot::parse_all(&["lot-b"], &vehicle).unwrap();
    Map::build(lots[0].draw(RootSeed(1)).scenario, &vehicle).unwrap()
}

/// A header that says nothing in particular.
pub(crate) fn header(event: Option<Moment>) -> Header {
    let layout = layout::of_lot(&map());
    Header { application: "test", title: "a test".to_owned(), layout, timeline: "sim_time", event }
}

/// What a recording holds.
pub(crate) struct Shown {
    chunks: Vec<Chunk>,
    /// Parts of its blueprint.
    of_blueprint: usize,
}

impl Shown {
    pub(crate) fn new(messages: impl IntoIterator<Item = LogMsg>) -> Self {
        let (mut chunks, mut of_blueprint) = (Vec::new(), 0);
        for message in messages {
            if let LogMsg::ArrowMsg(store, message) = message {
                match store.kind() {
                    StoreKind::Recording => chunks.push(Chunk::from_arrow_msg(&message).unwrap()),
                    StoreKind::Blueprint => of_blueprint += 1,
                }
            }
        }
        Self { chunks, of_blueprint }
    }

    /// What `show` shows.
    pub(crate) fn of(show: impl FnOnce(&Recording)) -> Self {
        let (recording, storage) = Recording::in_memory(&header(None));
        show(&recording);
        let shown = Self::new(storage.take());
        recording.end().unwrap();
        shown
    }

    fn of_file(path: &Path) -> Self {
        let messages = DecoderApp::decode_eager(BufReader::new(File::open(path).unwrap())).unwrap();
        Self::new(messages.map(Result::unwrap))
    }

    /// Everything that is shown, apart from properties of the recording itself.
    pub(crate) fn entities(&self) -> BTreeSet<String> {
        let paths = self.chunks.iter().map(Chunk::entity_path);
        let own = paths.filter(|path| !path.is_reserved());
        own.map(|path| path.to_string().trim_start_matches('/').to_owned()).collect()
    }

    fn chunks_of(&self, entity: &str) -> impl Iterator<Item = &Chunk> {
        let entity = rerun::EntityPath::from(entity);
        self.chunks.iter().filter(move |chunk| *chunk.entity_path() == entity)
    }

    /// Times at which an entity is given a component, in the order of the recording.
    fn times(&self, entity: &str, timeline: &'static str, component: &ComponentDescriptor) -> Vec<i64> {
        let timeline = TimelineName::from_static_str(timeline);
        let times = |chunk: &'_ Chunk| -> Vec<i64> {
            chunk.iter_component_indices(timeline, component.component).map(|(time, _)| time.as_i64()).collect()
        };
        self.chunks_of(entity).flat_map(times).collect()
    }

    /// Points, offsets or sizes of an entity, by control tick; the key of what is static is `i64::MIN`.
    pub(crate) fn points(&self, entity: &str, component: &ComponentDescriptor) -> BTreeMap<i64, Vec<[f32; 3]>> {
        let ticks = self.times(entity, "tick", component);
        let values = self.chunks_of(entity).flat_map(|chunk| {
            chunk.iter_slices::<[f32; 3]>(component.component).map(<[_]>::to_vec).collect::<Vec<_>>()
        });
        ticks.into_iter().chain(std::iter::repeat(i64::MIN)).zip(values).collect()
    }

    /// Values of a signal that are on a time line, by their times.
    fn signal(&self, entity: &str, timeline: &'static str) -> BTreeMap<i64, f64> {
        let (component, name) = (Scalars::descriptor_scalars().component, TimelineName::from_static_str(timeline));
        let on_it = self.chunks_of(entity).filter(|chunk| chunk.timelines().contains_key(&name));
        let values = |chunk: &'_ Chunk| -> Vec<(i64, f64)> {
            let times = chunk.iter_component_indices(name, component).map(|(time, _)| time.as_i64());
            times.zip(chunk.iter_slices::<f64>(component).map(|values| values[0])).collect()
        };
        on_it.flat_map(values).collect()
    }

    /// Pictures of an entity as PNG, by control tick, as indices into their palette.
    fn pictures(&self, entity: &str) -> BTreeMap<i64, Vec<u8>> {
        let component = EncodedImage::descriptor_blob();
        let blobs = self.chunks_of(entity).flat_map(|chunk| {
            let blobs = chunk.iter_component::<rerun::components::Blob>(component.component);
            blobs.map(|blobs| indices(&blobs.as_slice()[0].0)).collect::<Vec<_>>()
        });
        self.times(entity, "tick", &component).into_iter().zip(blobs).collect()
    }

    fn texts(&self, entity: &str, component: &ComponentDescriptor) -> Vec<String> {
        let texts = |chunk: &'_ Chunk| -> Vec<String> {
            let texts = chunk.iter_slices::<String>(component.component);
            texts.flatten().map(|text| text.to_string()).collect()
        };
        self.chunks_of(entity).flat_map(texts).collect()
    }
}

/// The pixels of a picture with 4 bits each.
fn indices(png: &[u8]) -> Vec<u8> {
    let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
    let mut packed = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut packed).unwrap();
    let (width, row_bytes) = (reader.info().width as usize, reader.info().raw_row_length() - 1);
    let pixels = |row: &[u8]| row.iter().flat_map(|byte| [byte >> 4, byte & 15]).take(width).collect::<Vec<u8>>();
    packed.chunks_exact(row_bytes).flat_map(pixels).collect()
}

fn hand() -> Rng {
    RootSeed(1).rng(Stream::Expert, 0)
}

/// The first ticks of a drive by whoever answers, with everything that is shown of it.
fn drive(ticks: usize, driver: &mut dyn Driver) -> (Vec<Frame>, Shown) {
    let settings = Settings::preset("smoke").unwrap();
    let mut episode = Episode::new(Arc::new(settings.episode.clone()), Arc::new(map()), RootSeed(2));
    let mut frames = Vec::new();
    let shown = Shown::of(|recording| {
        let mut drive = Drive::new(recording, "me", &episode, &settings, hand());
        drive.show_static();
        while frames.len() < ticks && episode.ending().is_none() {
            episode.observe();
            let decision = driver.decide(&episode.situation());
            let frame = episode.apply(decision);
            drive.frame(&frame);
            frames.push(frame);
        }
    });
    (frames, shown)
}

#[test]
fn every_frame_is_shown_as_it_was() {
    let settings = Settings::preset("smoke").unwrap();
    let (frames, shown) = drive(60, &mut ScriptedExpert::new(settings.expert.clone(), &settings.episode, hand()));
    let cars = shown.points("me/car", &Transform3D::descriptor_translation());
    let look_ahead = shown.points("me/car/look_ahead", &Points3D::descriptor_positions());
    let signal = |name: &str| shown.signal(&format!("me/signals/{name}"), "tick");
    let (speeds, ratios) = (signal("speed/actual"), signal("distance/safe_ratio"));
    let (clearances, grids) = (signal("distance/clearance"), shown.pictures("me/sensors/grid"));
    assert_eq!((cars.len(), speeds.len()), (frames.len(), frames.len()));
    for frame in &frames {
        let tick = i64::from(frame.tick);
        let (pose, point) = (frame.vehicle.pose, frame.decision.look_ahead);
        assert_eq!(cars[&tick], [[pose.x_m, pose.y_m, 0.0]]);
        assert_eq!(look_ahead[&tick][0][..2], [point.ahead_m, point.left_m]);
        assert_eq!(speeds[&tick], f64::from(frame.vehicle.speed_mps));
        assert_eq!(ratios[&tick], f64::from(frame.safe_ratio));
        assert_eq!(clearances[&tick], f64::from(frame.clearance_m));
        let grid = grids.get(&tick);
        assert_eq!(grid.is_some(), frame.tick % 4 == 0, "pictures come five times a second");
        if let Some(grid) = grid {
            let cells: Vec<(u8, u8)> = grid.iter().copied().zip(frame.observation.grid.cells()).collect();
            assert_eq!(cells.len(), 25 * 25);
            // Beyond the two colours of right cells come the layers of noise: those cells are wrong, either way.
            assert!(cells.iter().all(|(pixel, cell)| *pixel > 1 || pixel == cell), "tick {}", frame.tick);
            assert!(cells.iter().filter(|(pixel, _)| *pixel > 1).count() < 200, "most of the grid is right");
        }
    }
    let plans = shown.times("me/expert_plan", "tick", &rerun::LineStrips3D::descriptor_strips());
    assert_eq!(plans, (0..60).step_by(4).collect::<Vec<i64>>(), "candidates come with the pictures");
    // A frame is shown when it was observed: the time of the frame before.
    let times = shown.times("me/car", "sim_time", &Transform3D::descriptor_translation());
    let observed = std::iter::once(0.0).chain(frames.iter().map(|frame| f64::from(frame.time_s)));
    for (nanos, observed_s) in times.iter().zip(observed) {
        assert!((*nanos as f64 * 1e-9 - observed_s).abs() < 1e-6, "{nanos} ns, {observed_s} s");
    }
    assert_eq!(shown.texts("me/driver", &StateChange::descriptor_state()), ["expert"]);
}

/// Somebody who always heads a little to the left of straight on, and so into something.
struct Leftwards;

impl Driver for Leftwards {
    fn decide(&mut self, _: &Situation<'_>) -> Decision {
        let look_ahead = LookAheadPoint { ahead_m: 7.0, left_m: 1.5 };
        let spread = Some(Spread { ahead_m: 0.6, left_m: 1.2 });
        Decision { look_ahead, source: Source::Novice, spread, speed_limit_mps: None }
    }
}

#[test]
fn a_network_is_compared_with_the_expert_and_its_failures_stay() {
    let (frames, shown) = drive(400, &mut Leftwards);
    let failed: Vec<usize> =
        (0..frames.len()).filter(|&i| matches!(frames[i].event, Event::NearCollision { .. })).collect();
    assert!(!failed.is_empty(), "it runs into something within 20 s");
    let points = |entity: &str| shown.points(entity, &Points3D::descriptor_positions());
    let (experts, near_collisions) = (points("me/car/expert_point"), points("me/near_collisions"));
    let (at, scale) = (Transform3D::descriptor_translation(), Transform3D::descriptor_scale());
    let (ellipse_at, ellipse_scale) = (shown.points("me/car/spread", &at), shown.points("me/car/spread", &scale));
    let signal = |name: &str| shown.signal(&format!("me/signals/{name}"), "tick");
    let (tau_hat, across, ahead) = (signal("discrepancy/tau_hat"), signal("doubt/across"), signal("doubt/ahead"));
    for i in 0..frames.len() {
        let tick = i as i64;
        let [[expert_ahead_m, expert_left_m, _]] = experts[&tick][..] else { panic!("one point of the expert") };
        let apart_m = (expert_ahead_m - 7.0).hypot(expert_left_m - 1.5);
        assert!((tau_hat[&tick] - f64::from(apart_m / 12.0)).abs() < 1e-5, "τ̂ is a share of 12 m");
        assert!((across[&tick] - 0.1).abs() < 1e-6 && (ahead[&tick] - 0.05).abs() < 1e-6);
        assert_eq!(ellipse_at[&tick][0][..2], [7.0, 1.5]);
        assert_eq!(ellipse_scale[&tick], [[0.6, 1.2, 1.0]]);
        let so_far = failed.iter().filter(|&&failed| failed <= i).count();
        let shown = near_collisions.get(&tick).map_or(0, Vec::len);
        assert_eq!(shown, if failed.contains(&i) { so_far } else { 0 }, "tick {i}");
    }
}

/// The point of whoever did not drive stayed beside the car when it took the wheel.
#[test]
fn the_point_beside_the_drivers_is_that_of_the_other_one_at_this_tick() {
    let settings = Settings::preset("smoke").unwrap();
    let network = shipped_network("trained:default").unwrap().unwrap();
    let mut episode = Episode::new(Arc::new(settings.episode.clone()), Arc::new(map()), RootSeed(2));
    let shown = Shown::of(|recording| {
        let drive = Drive::new(recording, "me", &episode, &settings, hand());
        let mut drive = drive.with_novice(Some(NetPolicy::new(&network)));
        for source in [Source::Expert, Source::Novice, Source::Expert] {
            episode.observe();
            let decision = Decision { source, ..Leftwards.decide(&episode.situation()) };
            drive.frame(&episode.apply(decision));
        }
    });
    let counts = |entity: &str| -> Vec<usize> {
        shown.points(entity, &Points3D::descriptor_positions()).values().map(Vec::len).collect()
    };
    assert_eq!(counts("me/car/network_point"), [1, 0, 1]);
    assert_eq!(counts("me/car/expert_point"), [0, 1, 0]);
}

/// All views of a layout.
fn views(layout: &Layout) -> Vec<&View> {
    match layout {
        Layout::Columns(parts) | Layout::Rows(parts) => parts.iter().flat_map(|(_, part)| views(part)).collect(),
        Layout::Tabs(parts) => parts.iter().flat_map(views).collect(),
        Layout::View(view) => vec![view],
    }
}

/// Every entity that a layout names.
fn named(layout: &Layout) -> BTreeSet<String> {
    let names = views(layout).into_iter().flat_map(|view| view.contents.iter().chain(&view.trails));
    names.map(|name| name.trim_start_matches('-').trim_end_matches("/**").to_owned()).collect()
}

#[test]
fn the_first_view_shows_what_is_recorded() {
    let (_, drive) = drive(200, &mut Leftwards);
    let map = map();
    let lot = Shown::of(|recording| show_map(&map, legend::DRIVE, recording));
    let entities: BTreeSet<String> = drive.entities().into_iter().chain(lot.entities()).collect();
    for drivers in [1, 2] {
        for path in named(&layout::of_drives(&map, &vec!["me".to_owned(); drivers])) {
            let is_there = entities.iter().any(|entity| *entity == path || entity.starts_with(&format!("{path}/")));
            assert!(is_there, "{path} is not recorded: {entities:?}");
        }
    }
    assert!(drive.of_blueprint > 4, "a layout is sent along: {} parts", drive.of_blueprint);
}

#[test]
fn an_entity_keeps_its_kind_of_shape() {
    let (_, shown) = drive(200, &mut Leftwards);
    let mut kinds: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for chunk in shown.chunks.iter().filter(|chunk| !chunk.is_static()) {
        let archetypes = chunk.components().component_descriptors().filter_map(|component| component.archetype);
        kinds.entry(chunk.entity_path().to_string()).or_default().extend(archetypes.map(|name| name.to_string()));
    }
    assert!(kinds.len() > 20 && kinds.values().all(|kinds| kinds.len() == 1), "{kinds:?}");
}

fn scratch(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("viewer-test-{}-{name}", std::process::id()))
}

/// The drive of a key, in a folder.
fn request(key: &str, folder: &Path) -> ViewRequest {
    let drive = DriveRequest { file: "a".to_owned(), title: key.to_owned(), keys: vec![key.parse().unwrap()] };
    let settings = Box::new(Settings::preset("smoke").unwrap());
    ViewRequest { sink: Sink::Folder(folder.to_owned()), show: vec![Show::Drives { settings, drives: vec![drive] }] }
}

#[test]
fn a_replayed_drive_is_whole_small_and_on_both_time_lines() {
    let folder = scratch("whole");
    let request = request("vvf@lot-b@forward@0@paper@1@0", &folder);
    let mut files = Vec::new();
    crate::show(&request, &Silent, &mut files).unwrap();
    assert_eq!(files, [folder.join("a.rrd")]);
    let found = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().file_name());
    assert_eq!(found.collect::<Vec<_>>(), ["a.rrd"]);
    let Show::Drives { settings, drives } = &request.show[0] else { unreachable!("a drive was asked for") };
    let replay = Replay::new(&drives[0].keys[0], &settings.episode).unwrap();
    let driver = drives[0].keys[0].driver.clone().load(settings).unwrap();
    let report = replay.drive(&settings.episode, &driver, |_| ControlFlow::Continue(())).unwrap().unwrap();
    let (ticks, near_collisions) = (i64::from(report.metrics.ticks), report.metrics.near_collisions);
    let (file, bytes) = (folder.join("a.rrd"), std::fs::metadata(folder.join("a.rrd")).unwrap().len());
    let shown = Shown::of_file(&file);
    std::fs::remove_dir_all(folder).unwrap();
    for entity in ["vvf/car", "vvf/car/wheels/front_left"] {
        let component = Transform3D::descriptor_translation();
        assert_eq!(shown.times(entity, "tick", &component), (0..ticks).collect::<Vec<i64>>(), "{entity}");
        assert_eq!(shown.times(entity, "sim_time", &component).len() as i64, ticks, "{entity}");
    }
    let failures = shown.points("vvf/near_collisions", &Points3D::descriptor_positions());
    assert_eq!(failures.len(), near_collisions as usize);
    let chunks = shown.chunks_of("vvf/signals/speed/actual").filter(|chunk| !chunk.is_static()).count();
    assert!(chunks <= 3, "moments are written in batches, not in {chunks} chunks");
    assert!(bytes < 5_000_000, "139 m take {:.1} MB", bytes as f64 / 1e6);
    let timelines: BTreeSet<String> =
        shown.chunks.iter().flat_map(|chunk| chunk.timelines().keys()).map(ToString::to_string).collect();
    assert_eq!(timelines, BTreeSet::from(["sim_time".to_owned(), "tick".to_owned()]), "no wall clock");
}

/// The viewer starts where a time line does: one second before the event, with all shapes in place.
#[test]
fn a_moment_begins_a_second_before_it_on_a_time_line_of_its_own() {
    let folder = scratch("moment");
    let event_s = 15.0;
    let key = "expert@lot-b@forward@0@paper@1@300";
    crate::show(&request(key, &folder), &Silent, &mut Vec::new()).unwrap();
    let shown = Shown::of_file(&folder.join("a.rrd"));
    std::fs::remove_dir_all(folder).unwrap();
    let seconds = |nanos: i64| nanos as f64 * 1e-9;
    let speed = |timeline| shown.signal("expert/signals/speed/actual", timeline);
    let (all, around) = (speed("sim_time"), speed(EVENT_TIME));
    let first = |values: &BTreeMap<i64, f64>| seconds(*values.keys().next().unwrap());
    let last = |values: &BTreeMap<i64, f64>| seconds(*values.keys().next_back().unwrap());
    assert!((first(&all) - (event_s - 10.0)).abs() < 0.06 && (last(&all) - (event_s + 5.0)).abs() < 0.06);
    assert!((first(&around) - (event_s - 1.0)).abs() < 0.06, "{}", first(&around));
    assert_eq!(last(&around), last(&all));
    for (nanos, value) in &around {
        assert_eq!(value, &all[nanos], "the same at {nanos} ns");
    }
    let swept = shown.times("expert/swept", EVENT_TIME, &rerun::LineStrips3D::descriptor_strips());
    let before = swept.iter().filter(|nanos| seconds(**nanos) < event_s - 0.99).count();
    assert!(before > 10, "the way up to there is shown from the start: {swept:?}");
}

/// The expert beside the driver began to think where the recording does: it had forgotten what it saw before.
#[test]
fn what_is_said_around_a_moment_is_what_is_said_in_the_whole_drive() {
    let folder = scratch("memory");
    let points = |tick: u32| {
        let mut request = request(&format!("vvf@lot-b@forward@0@paper@1@{tick}"), &folder);
        let Show::Drives { settings, .. } = &mut request.show[0] else { unreachable!("a drive was asked for") };
        (settings.expert.label_jitter, settings.episode.metrics.timeout_s) = (0.01, 60.0);
        crate::show(&request, &Silent, &mut Vec::new()).unwrap();
        Shown::of_file(&folder.join("a.rrd")).points("vvf/car/expert_point", &Points3D::descriptor_positions())
    };
    let (whole, around) = (points(0), points(300));
    std::fs::remove_dir_all(&folder).unwrap();
    assert!(around.len() > 200 && around.keys().all(|tick| *tick > 90), "ten seconds before and five after");
    for (tick, point) in around {
        assert_eq!(point, whole[&tick], "tick {tick}");
    }
}

/// Asks to stop after so many reports.
struct StopAfter(Cell<u32>);

impl Progress for StopAfter {
    fn begin(&self, _: &'static str, _: &str) {}

    fn at(&self, _: f64, _: &mut dyn FnMut(Elapsed) -> String) {
        self.0.set(self.0.get().saturating_sub(1));
    }

    fn end(&self, _: &str) {}

    fn is_cancelled(&self) -> bool {
        self.0.get() == 0
    }
}

#[test]
fn what_is_interrupted_leaves_a_whole_recording() {
    let folder = scratch("interrupted");
    let mut files = Vec::new();
    let request = request("expert@lot-b@forward@0@paper@1@0", &folder);
    let error = crate::show(&request, &StopAfter(Cell::new(50)), &mut files).unwrap_err();
    assert!(error.is::<Interrupted>());
    let shown = Shown::of_file(&files[0]);
    std::fs::remove_dir_all(folder).unwrap();
    let ticks = shown.times("expert/car", "tick", &Transform3D::descriptor_translation());
    assert_eq!(ticks, (0..50).collect::<Vec<i64>>());
}

#[test]
fn what_cannot_be_shown_is_named() {
    let message = |key: &str, folder: &Path| {
        format!("{:#}", crate::show(&request(key, folder), &Silent, &mut Vec::new()).unwrap_err())
    };
    let key = "expert@lot-b@forward@0@paper@1@0";
    assert!(message(key, Path::new("/proc/no-such-folder")).contains("/proc/no-such-folder"));
    assert!(
        message("net:/no/such@lot-b@forward@0@paper@1@0", Path::new("/tmp"))
            .contains("/no/such lists no finished model")
    );
    assert!(message("expert@reference@forward@0@paper@1@0", Path::new("/tmp")).contains("3 lots"));
    let mut two_runs = request(key, Path::new("/tmp"));
    let Show::Drives { drives, .. } = &mut two_runs.show[0] else { unreachable!("a drive was asked for") };
    drives[0].keys.push("vvf@lot-b@forward@1@paper@1@0".parse().unwrap());
    let error = crate::show(&two_runs, &Silent, &mut Vec::new()).unwrap_err();
    assert!(format!("{error:#}").contains("different runs"));
    let mut one_file = request(key, Path::new("/tmp"));
    one_file.sink = Sink::File("x.rrd".into());
    one_file.show.push(Show::Training { run: "runs/x".into() });
    let error = crate::show(&one_file, &Silent, &mut Vec::new()).unwrap_err();
    assert!(format!("{error:#}").contains("x.rrd: several recordings need a folder"));
}

/// A folder as a training leaves it, two rounds of two points each.
#[test]
fn a_training_is_read_from_its_folder() {
    let run = scratch("training");
    let _ = std::fs::remove_dir_all(&run);
    let settings = Settings::preset("smoke").unwrap();
    for round in 0..2 {
        let folder = run.join(format!("round-{round:02}"));
        std::fs::create_dir_all(&folder).unwrap();
        let collection = format!(
            "schema = 2\nround = {round}\nsamples = {}\nnoise_augmentations = 0\nticks = 1000\nnovice_ticks = {}\n\
             tau_hat_sum = 1.0\ndriven_s = 50.0\nnear_collisions = 1\ndriven_m = 50.0\nepisodes = []\n",
            500 - 100 * round,
            600 * round
        );
        sums::write(&folder, "round.toml", collection.as_bytes()).unwrap();
        let point = |step: u32| {
            format!(
                "[[curve]]\nstep = {step}\nlearning_rate = 0.25\ntraining = {{ misfit = 1.5, log_variance = -2.0, total = -0.5 }}\n\
                 validation = {{ samples = 9, loss = -1.0, nll = -1.25, rmse_m = 0.75 }}\n"
            )
        };
        let head = "schema = 2\ntraining_samples = 90\nvalidation_samples = 9\nsteps = 100\nkept_step = 100\nstopped = false\n";
        let fit = format!("{head}{}{}", point(50), point(100));
        sums::write(&folder, "fit.toml", fit.as_bytes()).unwrap();
        if round == 1 {
            // The training after the last round.
            std::fs::create_dir_all(run.join("final")).unwrap();
            sums::write(&run.join("final"), "fit.toml", fit.as_bytes()).unwrap();
        }
    }
    sums::write(&run, "settings.toml", settings.to_toml().as_bytes()).unwrap();
    sums::write(&run, "table1.md", b"| the table |").unwrap();

    let shown = Shown::of(|recording| training::show(&run, recording).unwrap());
    std::fs::remove_dir_all(&run).unwrap();
    assert_eq!(shown.texts("tables/table1", &TextDocument::descriptor_text()), ["| the table |"]);
    let steps = |entity: &str| shown.signal(entity, "step");
    let points = [50, 100, 150, 200, 250, 300].map(|step| (step, 1.5));
    assert_eq!(steps("training/loss/misfit"), BTreeMap::from(points), "the final training, too");
    assert_eq!(steps("training/validation_error/rmse")[&200], 0.75);
    assert_eq!(steps("rounds/eta_hat/eta_hat"), BTreeMap::from([(100, 0.6)]), "behaviour cloning has none");
    assert_eq!(steps("rounds/samples/dataset"), BTreeMap::from([(0, 500.0), (100, 900.0)]));
    assert_eq!(steps("rounds/near_collisions")[&0], 2.0, "per 100 m");
    assert_eq!(shown.signal("rounds/samples/new", "round"), BTreeMap::from([(0, 500.0), (1, 400.0)]));
    assert_eq!(steps("training/learning_rate")[&200], 0.25);
    let entities = shown.entities();
    for path in named(&layout::of_training()) {
        assert!(entities.iter().any(|entity| entity.starts_with(&path)), "{path} is not recorded: {entities:?}");
    }
}

/// With disturbances and noise augmentations: the network drives as often, and fails as often, as in the training.
#[test]
fn episodes_of_a_training_are_driven_again_as_they_were() {
    let run = scratch("rollouts");
    let _ = std::fs::remove_dir_all(&run);
    let mut settings = Settings::preset("smoke").unwrap();
    settings.training.lots = vec!["lot-b".to_owned()];
    let build = Build { program: "test".to_owned(), ..Build::default() };
    let place = Place { build: &build, out: Some(&run), overwrite: false, command: "test", preset: "smoke", seed: 1 };
    let folder = RunDir::create(&place, &settings, &Request::default()).unwrap();
    let outcome = training_run::train(&settings, &folder, &Silent).unwrap();
    assert_eq!(outcome.rows.len(), 2);
    let request = ViewRequest {
        sink: Sink::Folder(run.join("recordings")),
        show: vec![Show::Rollouts { run: run.clone(), episodes: usize::MAX }],
    };
    let mut files = Vec::new();
    crate::show(&request, &Silent, &mut files).unwrap();
    let collection = Collection::read(&run.join("round-01")).unwrap().unwrap();
    let shown: Vec<Shown> = files.iter().filter(|file| is_round(file, 1)).map(|file| Shown::of_file(file)).collect();
    std::fs::remove_dir_all(&run).unwrap();
    assert_eq!(shown.len(), collection.episodes.len());
    let speeds = shown.iter().map(|shown| shown.signal("dagger/signals/speed/actual", "tick").len() as u64);
    assert_eq!(speeds.sum::<u64>(), collection.ticks);
    let failures = shown
        .iter()
        .map(|shown| shown.points("dagger/near_collisions", &Points3D::descriptor_positions()).len() as u32);
    assert_eq!(failures.sum::<u32>(), collection.near_collisions);
    assert!(collection.near_collisions > 0, "this network still fails");
}

fn is_round(file: &Path, round: u32) -> bool {
    file.file_name().is_some_and(|name| name.to_string_lossy().starts_with(&format!("round-{round:02}")))
}

/// The paths drawn are those that were weighed: the chosen one is the cheapest, and leads where the planner steers.
#[test]
fn a_planner_shows_what_it_weighed() {
    let settings = Settings::preset("smoke").unwrap();
    for name in ["tentacle", "vvf", "apf"] {
        let driver = &NamedDriver::load_all(&[name], &settings).unwrap()[0];
        let mut planner = driver.to_planner(&settings.episode).unwrap();
        let mut episode = Episode::new(Arc::new(settings.episode.clone()), Arc::new(map()), RootSeed(2));
        for _ in 0..10 {
            episode.observe();
            let observation = *episode.situation().observation;
            let decision = planner.act(&observation);
            match planner.explain(&observation).unwrap() {
                Explanation::Paths(paths) => {
                    let chosen: Vec<_> = paths.iter().filter(|path| path.is_chosen).collect();
                    assert_eq!((paths.len(), chosen.len()), (81, 1));
                    assert!(paths.iter().all(|path| path.cost >= chosen[0].cost));
                    let end = chosen[0].points.last().unwrap();
                    let turns = decision.look_ahead.left_m.abs() > 0.5;
                    assert!(!turns || end.y.signum() == decision.look_ahead.left_m.signum(), "{end} {decision:?}");
                }
                Explanation::Field(samples) => {
                    assert!(samples.len() > 20 && samples.iter().all(|sample| sample.field.is_finite()));
                }
            }
            episode.apply(decision);
        }
    }
}

/// In the view of the whole lot the trails of two planners were both green.
#[test]
fn trails_of_several_drivers_have_colours_of_their_own() {
    let settings = Settings::preset("smoke").unwrap();
    let trail_of = |colour| {
        let mut episode = Episode::new(Arc::new(settings.episode.clone()), Arc::new(map()), RootSeed(2));
        let shown = Shown::of(|recording| {
            let mut drive = Drive::new(recording, "me", &episode, &settings, hand()).among_others(colour);
            for _ in 0..10 {
                episode.observe();
                let decision = Leftwards.decide(&episode.situation());
                drive.frame(&episode.apply(decision));
            }
        });
        let component = rerun::LineStrips3D::descriptor_colors().component;
        let colours_of = |chunk: &Chunk| chunk.iter_slices::<u32>(component).flatten().copied().collect::<Vec<_>>();
        shown.chunks_of("me/driven").flat_map(colours_of).collect::<BTreeSet<u32>>()
    };
    let [one, other] = [colours::PLANNER, colours::PATCH].map(trail_of);
    assert!(one.len() == 1 && other.len() == 1 && one != other, "{one:?} {other:?}");
}

#[test]
fn drivers_of_a_kind_are_told_apart_by_colour() {
    let colours = colours::of_drivers(&[Source::Expert, Source::Planner, Source::Novice, Source::Planner]);
    assert_eq!(colours, [colours::EXPERT, colours::PLANNER, colours::NOVICE, colours::PATCH]);
}

/// Otherwise everything that both workspaces depend on is compiled twice, or judged by different rules.
#[test]
fn both_workspaces_have_the_same_profile_and_lints() {
    let profile = |manifest: &str| {
        let manifest: toml::Table = manifest.parse().unwrap();
        let mut profile = manifest["profile"]["dev"].as_table().unwrap().clone();
        let packages = profile.remove("package").unwrap().as_table().unwrap().clone();
        // Members of the root workspace are compiled for each workspace anyway.
        let is_shared = |name: &&String| !Path::new("..").join(name.as_str()).join("Cargo.toml").is_file();
        let shared: BTreeMap<String, toml::Value> =
            packages.keys().filter(is_shared).map(|name| (name.clone(), packages[name].clone())).collect();
        (profile, shared)
    };
    let (root_manifest, own_manifest) = (include_str!("../../Cargo.toml"), include_str!("../Cargo.toml"));
    let table = |manifest: &str| manifest.parse::<toml::Table>().unwrap();
    assert_eq!(table(own_manifest)["lints"], table(root_manifest)["workspace"]["lints"]);
    let (root, root_packages) = profile(root_manifest);
    let (own, own_packages) = profile(own_manifest);
    assert_eq!(own, root);
    let lock = include_str!("../Cargo.lock");
    let is_used = |name: &str| name == "*" || lock.contains(&format!("name = \"{name}\"\n"));
    for (name, settings) in root_packages.iter().filter(|(name, _)| is_used(name)) {
        assert_eq!(own_packages.get(name), Some(settings), "{name}");
    }
}
