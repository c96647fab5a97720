use super::*;
use crate::export::{self, export};
use policy::checkpoint::Checkpoint;
use policy::conditions::Conditions;
use policy::network::{InferenceSettings, NetworkArchitecture, OUTPUTS, Weights};
use rten_onnx::onnx::{AttributeProto, AttributeType, DataType as ElementType, TensorProto};
use sim::episode::EpisodeSettings;
use sim::seed::RootSeed;
use std::path::PathBuf;

/// Free ground with blocks here and there.
fn grids(count: usize) -> Vec<OccupancyGrid> {
    let grid = |index: usize| {
        let mut grid = OccupancyGrid::free();
        for row in 0..25 {
            let blocks = 0x1F0_003F_u32.rotate_left((7 * index) as u32) ^ (0x0030_0C00 >> (index % 5));
            grid.occupy_row(row, if (row + index) % 9 < 6 { blocks & 0x1FF_FFFF } else { 0 });
        }
        grid
    };
    (0..count).map(grid).collect()
}

/// Both presets' networks, one with an even kernel, with and without mirror averaging; one with residual layers; and others of
/// one mode and of three.
fn checkpoints() -> [Checkpoint; 5] {
    let of = |architecture, inference| Checkpoint {
        weights: Weights::init(architecture, RootSeed(8), 0),
        conditions: Conditions::of(&EpisodeSettings::paper()),
        inference,
    };
    [
        of(NetworkArchitecture::paper(), InferenceSettings::plain()),
        of(NetworkArchitecture::compact(), InferenceSettings::smoothed()),
        of(
            NetworkArchitecture { residual1: 1, residual2: 2, ..NetworkArchitecture::compact() },
            InferenceSettings::plain(),
        ),
        of(NetworkArchitecture { modes: 1, ..NetworkArchitecture::compact() }, InferenceSettings::smoothed()),
        of(NetworkArchitecture { modes: 3, ..NetworkArchitecture::compact() }, InferenceSettings::plain()),
    ]
}

/// As cars are seated.
fn pool() -> Arc<ThreadPool> {
    Arc::new(ThreadPool::with_num_threads(1))
}

fn file(name: &str, bytes: &[u8]) -> PathBuf {
    let path = std::env::temp_dir().join(format!("onnx-test-{}-{name}", std::process::id()));
    std::fs::write(&path, bytes).unwrap();
    path
}

fn load(name: &str, bytes: &[u8]) -> Result<OnnxNetwork, String> {
    let path = file(name, bytes);
    let network = OnnxNetwork::load(&path).map_err(|error| error.to_string());
    std::fs::remove_file(path).unwrap();
    network
}

#[test]
fn what_is_exported_answers_as_the_network_itself() {
    let grids = grids(40);
    let grids: Vec<_> = grids.iter().collect();
    for checkpoint in checkpoints() {
        let network = load("exported", &export(&checkpoint)).unwrap();
        assert_eq!(network.about(), Some(&About::new(checkpoint.inference, checkpoint.conditions.clone())));
        let expected = checkpoint.predictor().predict(&grids);
        let found = network.predict(&grids, checkpoint.inference.mirror_averaging, &pool());
        let mut farthest = 0.0_f32;
        for (found, expected) in found.into_iter().zip(&expected) {
            for (found, expected) in
                [found.mean, found.sigma].iter().flatten().zip([expected.mean, expected.sigma].iter().flatten())
            {
                farthest = farthest.max((found - expected).abs());
            }
        }
        assert!(farthest < 1e-5, "{farthest}");
        assert!(expected.windows(2).any(|pair| (pair[0].mean[0] - pair[1].mean[0]).abs() > 1e-3), "one answer for all");
    }
}

/// The property that makes closed-loop results independent of how many cars are still on the road, and of threads.
#[test]
fn an_answer_does_not_depend_on_the_other_grids() {
    let grids = grids(37);
    let grids: Vec<_> = grids.iter().collect();
    let mut network = load("alone", &export(&checkpoints()[0])).unwrap();
    // As the file leaves it open, and as if it asked for as many.
    for batch in [BATCH, 16] {
        network.batch = batch;
        let together = network.rows(&grids, &pool());
        for start in [1, 7, 15, 36] {
            assert_eq!(
                network.rows(&grids[start..], &pool())[..],
                together[OUTPUTS * start..],
                "from {start}, {batch} at once"
            );
        }
    }
}

/// Which cars shared a call depended on the number of threads, and with it what was driven.
#[test]
fn a_network_that_mixes_the_grids_of_a_batch_is_refused() {
    let [checkpoint, ..] = checkpoints();
    let mut nodes = export::layers(checkpoint.weights.architecture());
    let answer = nodes.last_mut().unwrap();
    answer.output = vec!["alone".to_owned()];
    nodes.push(export::node("Softmax", &["alone"], OUTPUT, vec![export::integer("axis", 0)]));
    let mut network = load("mixing", &export::file(&checkpoint, None, nodes)).unwrap();
    assert_eq!(network.batch, 1, "alone, a grid has nothing to be mixed with");
    // As if the file asked for as many.
    network.batch = 16;
    let error = network.check_independence().unwrap_err();
    assert!(error.contains("when others stand beside it in the batch"), "{error}");
}

/// Its place in a batch depends on the number of threads as well, and others beside it were all that was looked at.
#[test]
fn a_network_that_answers_by_the_place_in_the_batch_is_refused() {
    let [checkpoint, ..] = checkpoints();
    // Two grids at once, the second of which has a number added to its answers.
    let with_second_raised_by = |number: f32| {
        let mut nodes = export::layers(checkpoint.weights.architecture());
        nodes.last_mut().unwrap().output = vec!["alike".to_owned()];
        let tensor = TensorProto {
            dims: vec![2, 1],
            data_type: Some(ElementType::FLOAT),
            float_data: vec![0.0, number],
            ..TensorProto::default()
        };
        let value = AttributeProto {
            name: Some("value".to_owned()),
            t: Some(tensor),
            r#type: Some(AttributeType::TENSOR),
            ..AttributeProto::default()
        };
        nodes.push(export::node("Constant", &[], "by_place", vec![value]));
        nodes.push(export::node("Add", &["alike", "by_place"], OUTPUT, Vec::new()));
        load("by place", &export::file(&checkpoint, Some(2), nodes))
    };
    assert_eq!(with_second_raised_by(0.0).unwrap().batch, 2);
    let error = with_second_raised_by(1.0).unwrap_err();
    assert!(error.contains("in another place of the batch"), "{error}");
}

#[test]
fn what_is_no_such_network_is_refused_with_what_it_is_instead() {
    let exported = export(&checkpoints()[1]);
    // Names and numbers of the same length, so that the file stays well-formed.
    let with = |from: &[u8], to: &[u8]| {
        assert_eq!(from.len(), to.len());
        let mut bytes = exported.clone();
        let places: Vec<usize> = (0..bytes.len() - from.len()).filter(|&at| bytes[at..].starts_with(from)).collect();
        assert!(!places.is_empty(), "{from:?}");
        for at in places {
            bytes[at..at + from.len()].copy_from_slice(to);
        }
        bytes
    };
    // A field that nobody knows, skipped backwards by 12 bytes: read for ever, if anybody reads it.
    let backwards = [&exported[..], &[0x7A, 0xF4], &[0xFF; 8], &[0x01]].concat();
    for (what, bytes, part) in [
        ("backwards", backwards, "longer than what holds it"),
        ("nothing", Vec::new(), "not a network"),
        ("text", b"hello".to_vec(), "not a network"),
        ("half", exported[..exported.len() / 2].to_vec(), "not a network"),
        ("input", with(b"grid", b"gird"), "input \"gird\", not \"grid\""),
        ("output", with(b"point", b"pt_uw"), "outputs pt_uw, not point"),
        ("operator", with(b"Flatten", b"Fluffen"), "not a network"),
        ("metadata", with(b"schema = 1", b"schema = 7"), "schema 7"),
        ("smoothing", with(b"smoothing_ticks = 8.0", b"smoothing_ticks = -80"), "smoothing_ticks"),
    ] {
        let error = load(what, &bytes).unwrap_err();
        assert!(error.contains(part) && error.contains(what) && error.contains("docs/formats.md"), "{what}: {error}");
    }
}

/// A file from elsewhere ends in an error or in a network, never in a panic.
#[test]
fn a_damaged_file_is_refused_or_answers() {
    let exported = export(&checkpoints()[1]);
    // The graph is before and after the tensors; they alone are large.
    let places = (0..600).chain((exported.len() - 1500)..exported.len()).step_by(19);
    for at in places {
        let mut bytes = exported.clone();
        bytes[at] ^= 1 << (at % 8);
        if let Ok(network) = load("damaged", &bytes) {
            network.predict(&grids(3).iter().collect::<Vec<_>>(), true, &pool());
        }
    }
}
