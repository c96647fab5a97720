//! Recordings are read back with Rerun's own decoder.

use crate::record;
use protocol::{
    Area, Arrow, Block, Clock, Dot, Eye, Header, Layout, Mark, Message, Picture, Pose, Shape, Sink, Strip, View,
    ViewKind,
};
use rerun::external::re_log_encoding::DecoderApp;
use rerun::external::re_log_types::StoreKind;
use rerun::log::{Chunk, LogMsg};
use rerun::{EncodedImage, LineStrips3D, Points3D, Scalars, StateChange, Transform3D};
use std::fs::File;
use std::io::BufReader;
use std::path::PathBuf;

const TICKS: i64 = 2500;

fn header(path: &str) -> Header {
    let scene = ViewKind::Scene(Eye {
        position: [0.0, -5.0, 20.0],
        target: [0.0; 3],
        up: [0.0, 0.0, 1.0],
        follows: Some("me/car".to_owned()),
    });
    let view = |name: &str, kind| View {
        name: name.to_owned(),
        kind,
        contents: vec!["me/**".to_owned(), "-me/sensors/**".to_owned()],
        trails: vec!["me/swept".to_owned()],
    };
    let signals = view("signals", ViewKind::Signals { range: Some([0.0, 1.0]) });
    let layout = Layout::Columns(vec![(2.0, view("scene", scene).into()), (1.0, Layout::Tabs(vec![signals.into()]))]);
    Header {
        application: "test".to_owned(),
        name: "a drive".to_owned(),
        sink: Sink::File(path.to_owned()),
        layout,
        timeline: "sim_time".to_owned(),
        focus_s: Some([1.0, 2.0]),
    }
}

fn always() -> Vec<Mark> {
    let block = |is_round| Block {
        centre: [1.0, 2.0, 0.5],
        size_m: [4.0, 2.0, 1.0],
        yaw_rad: 0.3,
        is_round,
        colour: [1, 2, 3, 255],
    };
    let area = Area { rectangles: vec![[0.0, 0.0, 2.0, 1.0]; 3], z_m: 0.0, colour: [9, 9, 9, 255] };
    let arrow = Arrow { from: [0.0; 3], vector: [1.0, 0.0, 0.0], colour: [255; 4] };
    let signal = Shape::Signal { name: "speed, m/s".to_owned(), colour: [255; 4], dotted: false };
    vec![
        Mark::new("lot/obstacles", Shape::Blocks(vec![block(false), block(true)])),
        Mark::new("lot/drivable", Shape::Area(area)),
        Mark::new("me/arrows", Shape::Arrows(vec![arrow])),
        Mark::new("me/signals/speed", signal),
        Mark::new("me/driver", Shape::States(vec![("expert".to_owned(), [1, 2, 3, 255])])),
        Mark::new("legend", Shape::Document("# What you see".to_owned())),
    ]
}

fn moment(tick: i64) -> (Clock, Vec<Mark>) {
    let x = tick as f32;
    let pose = Pose { at: [x, 2.0 * x, 0.0], yaw_rad: 0.5, scale: [1.0, 2.0, 3.0] };
    let dot = |label: &str| Dot { at: [x, 0.0, 0.0], radius_pt: 3.0, colour: [9, 8, 7, 255], label: label.to_owned() };
    let strip = |n: i64| Strip { points: vec![[n as f32, 0.0, 0.0]; 4], radius_pt: 1.0, colour: [255; 4] };
    let mut marks = vec![
        Mark::new("me/car", Shape::Pose(pose)),
        Mark::new("me/signals/speed", Shape::Value(0.5 * tick as f64)),
        Mark::new("me/dots", Shape::Dots((0..tick % 3).map(|_| dot("here")).collect())),
        Mark::new("me/swept", Shape::Strips((0..tick % 4).map(strip).collect())),
    ];
    if tick % 100 == 0 {
        let pixels = (0..200 * 200).map(|i| ((i / 8 + tick) % 4) as u8).collect();
        let palette = vec![[0, 0, 0], [255, 255, 255], [255, 0, 0], [0, 0, 255]];
        marks.push(Mark::new("me/sensors/view", Shape::Picture(Picture { width: 200, pixels, palette })));
        marks.push(Mark::new("me/driver", Shape::State(format!("driver {tick}"))));
        marks.push(Mark::new("me/events", Shape::Line { text: "something".to_owned(), is_warning: true }));
    }
    (Clock::Episode { tick, time_s: 0.05 * tick as f64 }, marks)
}

fn scratch(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("recorder-test-{}-{name}.rrd", std::process::id()))
}

/// Records what the bench would send. Without `End`, as when the bench is killed.
fn recorded(name: &str, is_ended: bool) -> PathBuf {
    let path = scratch(name);
    let mut messages = vec![
        Message::Begin { recording: 7, header: Box::new(header(&path.display().to_string())) },
        Message::Always { recording: 7, marks: always() },
    ];
    messages.extend((0..TICKS).map(|tick| {
        let (clock, marks) = moment(tick);
        Message::At { recording: 7, clock, marks }
    }));
    if is_ended {
        messages.push(Message::End { recording: 7 });
    }
    let mut pipe = Vec::new();
    messages.iter().for_each(|message| protocol::write(&mut pipe, message).unwrap());
    record(pipe.as_slice()).unwrap();
    path
}

/// Chunks of the recording, and how many of the blueprint.
fn read_back(path: &PathBuf) -> (Vec<Chunk>, usize) {
    let messages = DecoderApp::decode_eager(BufReader::new(File::open(path).unwrap())).unwrap();
    let (mut chunks, mut of_blueprint) = (Vec::new(), 0);
    for message in messages {
        if let LogMsg::ArrowMsg(store, message) = message.unwrap() {
            match store.kind() {
                StoreKind::Recording => chunks.push(Chunk::from_arrow_msg(&message).unwrap()),
                StoreKind::Blueprint => of_blueprint += 1,
            }
        }
    }
    std::fs::remove_file(path).unwrap();
    (chunks, of_blueprint)
}

fn of<'a>(chunks: &'a [Chunk], entity: &str) -> Vec<&'a Chunk> {
    let entity = rerun::EntityPath::from(entity);
    chunks.iter().filter(|chunk| *chunk.entity_path() == entity && !chunk.is_static()).collect()
}

/// Ticks and nanoseconds at which an entity is given a shape.
fn times(chunks: &[&Chunk]) -> (Vec<i64>, Vec<i64>) {
    let of = |timeline: &'static str| {
        chunks
            .iter()
            .flat_map(|chunk| chunk.timelines()[&rerun::TimelineName::from_static_str(timeline)].times_raw().to_vec())
            .collect()
    };
    (of("tick"), of("sim_time"))
}

#[test]
fn a_recording_holds_every_moment_on_both_time_lines() {
    let (chunks, _) = read_back(&recorded("moments", true));
    for entity in ["me/car", "me/signals/speed", "me/dots", "me/swept"] {
        let (ticks, nanos) = times(&of(&chunks, entity));
        assert_eq!(ticks, (0..TICKS).collect::<Vec<i64>>(), "{entity}");
        assert!(ticks.iter().zip(&nanos).all(|(tick, nanos)| tick * 50_000_000 == *nanos), "{entity}");
    }
    let (ticks, _) = times(&of(&chunks, "me/sensors/view"));
    assert_eq!(ticks, (0..TICKS).step_by(100).collect::<Vec<i64>>());
}

#[test]
fn values_are_those_that_were_sent() {
    let (chunks, _) = read_back(&recorded("values", true));
    let speed: Vec<f64> = of(&chunks, "me/signals/speed")
        .iter()
        .flat_map(|chunk| chunk.iter_slices::<f64>(Scalars::descriptor_scalars().component).flatten().copied())
        .collect();
    assert_eq!(speed, (0..TICKS).map(|tick| 0.5 * tick as f64).collect::<Vec<f64>>());
    let places: Vec<[f32; 3]> = of(&chunks, "me/car")
        .iter()
        .flat_map(|chunk| {
            chunk.iter_slices::<[f32; 3]>(Transform3D::descriptor_translation().component).flatten().copied()
        })
        .collect();
    assert_eq!(places, (0..TICKS).map(|tick| [tick as f32, 2.0 * tick as f32, 0.0]).collect::<Vec<_>>());
    let dots: Vec<usize> = of(&chunks, "me/dots")
        .iter()
        .flat_map(|chunk| chunk.iter_slices::<[f32; 3]>(Points3D::descriptor_positions().component).map(<[_]>::len))
        .collect();
    assert_eq!(dots, (0..TICKS).map(|tick| (tick % 3) as usize).collect::<Vec<_>>(), "none is a value, too");
    let swept = of(&chunks, "me/swept");
    assert!(swept.iter().all(|chunk| chunk.components().get(LineStrips3D::descriptor_strips().component).is_some()));
    let states: Vec<String> = of(&chunks, "me/driver")
        .iter()
        .flat_map(|chunk| {
            let states = chunk.iter_slices::<String>(StateChange::descriptor_state().component);
            states.flatten().map(|state| state.to_string()).collect::<Vec<_>>()
        })
        .collect();
    assert_eq!(states[1], "driver 100");
}

#[test]
fn pictures_keep_their_pixels_and_stay_small() {
    let (chunks, _) = read_back(&recorded("pictures", true));
    let blobs: Vec<Vec<u8>> = of(&chunks, "me/sensors/view")
        .iter()
        .flat_map(|chunk| {
            chunk
                .iter_component::<rerun::components::Blob>(EncodedImage::descriptor_blob().component)
                .map(|blobs| blobs.as_slice()[0].0.to_vec())
                .collect::<Vec<_>>()
        })
        .collect();
    assert!(blobs.iter().all(|blob| blob.len() < 2000), "{} bytes", blobs[0].len());
    let mut decoder = png::Decoder::new(std::io::Cursor::new(&blobs[1]));
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().unwrap();
    let mut rgb = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut rgb).unwrap();
    assert_eq!(rgb.len(), 200 * 200 * 3);
    let colours = [[0, 0, 0], [255, 255, 255], [255, 0, 0], [0, 0, 255]];
    for (i, pixel) in rgb.as_chunks::<3>().0.iter().enumerate() {
        assert_eq!(*pixel, colours[(i / 8 + 100) % 4], "pixel {i}");
    }
}

#[test]
fn what_stands_still_is_there_once() {
    let (chunks, of_blueprint) = read_back(&recorded("static", true));
    for entity in ["lot/drivable", "legend", "me/arrows"] {
        let path = rerun::EntityPath::from(entity);
        let found: Vec<&Chunk> = chunks.iter().filter(|chunk| *chunk.entity_path() == path).collect();
        assert_eq!(found.len(), 1, "{entity}");
        assert!(found[0].is_static() && found[0].num_rows() == 1, "{entity}");
    }
    assert!(of_blueprint > 8, "the first look is laid out: {of_blueprint} parts");
}

/// A few chunks per entity, not one per moment.
#[test]
fn moments_are_sent_in_batches() {
    let (chunks, _) = read_back(&recorded("batches", true));
    assert!(of(&chunks, "me/signals/speed").len() <= 3, "{} chunks", of(&chunks, "me/signals/speed").len());
}

#[test]
fn a_bench_that_is_killed_leaves_a_whole_recording() {
    let (chunks, _) = read_back(&recorded("killed", false));
    assert_eq!(times(&of(&chunks, "me/car")).0.len() as i64, TICKS);
}

#[test]
fn what_cannot_be_recorded_is_said() {
    let mut pipe = Vec::new();
    protocol::write(&mut pipe, &Message::End { recording: 1 }).unwrap();
    assert!(record(pipe.as_slice()).unwrap_err().to_string().contains("never begun"));
    let mut pipe = Vec::new();
    let header = header("/no/such/folder/x.rrd");
    protocol::write(&mut pipe, &Message::Begin { recording: 1, header: Box::new(header) }).unwrap();
    assert!(format!("{:#}", record(pipe.as_slice()).unwrap_err()).contains("/no/such/folder/x.rrd"));
}
