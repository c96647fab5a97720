//! What `docs/formats.md` shows for Python is what lies in `tests/python/`, and it answers as Rust does.
//!
//! `PYTHON` names the interpreter, `python3` if it is not set. Without numpy (or torch) there is nothing to compare, which
//! is a failure where `CI` is set (for numpy).

use crate::bench::{root, scratch, succeed, text, xtask};
use ndarray::{Array2, Array3};
use policy::checkpoint::Checkpoint;
use policy::conditions::Conditions;
use policy::dataset::store::Store;
use policy::network::modes::likeliest_of;
use policy::network::{InferenceSettings, NetworkArchitecture, Prediction, Weights};
use sim::episode::EpisodeSettings;
use sim::seed::RootSeed;
use sim::sensing::OccupancyGrid;
use std::path::Path;
use std::process::Command;

fn python() -> Command {
    Command::new(std::env::var_os("PYTHON").unwrap_or_else(|| "python3".into()))
}

fn can_import(modules: &str) -> bool {
    python().args(["-c", &format!("import {modules}")]).output().is_ok_and(|output| output.status.success())
}

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

/// Runs a script on a checkpoint and grids; one row per grid.
fn answers(script: &str, checkpoint: &Checkpoint, grids: &[OccupancyGrid], folder: &Path) -> Array2<f32> {
    checkpoint.save(folder).unwrap();
    let cells = grids.iter().flat_map(OccupancyGrid::cells).collect();
    let cells = Array3::from_shape_vec([grids.len(), 25, 25], cells).unwrap();
    let (input, output) = (folder.join("grids.npy"), folder.join("answers.npy"));
    ndarray_npy::write_npy(&input, &cells).unwrap();
    let output_of = python().arg(root().join("tests/python").join(script)).args([folder, &input, &output]).output();
    let ran = output_of.unwrap();
    assert!(ran.status.success(), "{script}: {:?}", text(&ran));
    ndarray_npy::read_npy(output).unwrap()
}

/// Both presets' networks, one with an even kernel, with and without mirror averaging; one with residual layers; and others of
/// two and three modes.
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
        of(NetworkArchitecture { modes: 2, ..NetworkArchitecture::compact() }, InferenceSettings::smoothed()),
        of(NetworkArchitecture { modes: 3, ..NetworkArchitecture::compact() }, InferenceSettings::plain()),
    ]
}

/// Of the raw outputs of every grid, the likeliest answer.
fn likeliest(outputs: &Array2<f32>, checkpoint: &Checkpoint) -> Array2<f32> {
    let modes = checkpoint.weights.architecture().modes;
    let rows = outputs.rows().into_iter().flat_map(|row| likeliest_of(&row.to_vec(), modes));
    Array2::from_shape_vec([outputs.nrows(), 4], rows.collect()).unwrap()
}

fn assert_near(found: &Array2<f32>, expected: &[[f32; 4]], what: &str) {
    assert_eq!(found.dim(), (expected.len(), 4));
    let differences = found.iter().zip(expected.iter().flatten()).map(|(a, b)| (a - b).abs());
    let farthest = differences.fold(0.0, f32::max);
    eprintln!("{what}: answers of {} grids differ by {farthest:.1e} at most", expected.len());
    assert!(farthest < 1e-5, "{what}: {farthest}");
    let differ = expected.windows(2).filter(|pair| (pair[0][0] - pair[1][0]).abs() > 1e-3).count();
    assert!(differ > expected.len() / 2, "{what}: grids with one answer compare nothing");
}

#[test]
fn numpy_answers_as_rust_does() {
    if !can_import("numpy, tomllib") {
        assert!(std::env::var_os("CI").is_none(), "numpy and Python 3.11 are needed; PYTHON names an interpreter");
        eprintln!("skipped: no numpy");
        return;
    }
    let (grids, folder) = (grids(40), scratch("numpy"));
    for checkpoint in checkpoints() {
        let expected = checkpoint.predictor().predict(&grids.iter().collect::<Vec<_>>());
        let expected: Vec<_> =
            expected.iter().map(|Prediction { mean, sigma }| [mean[0], mean[1], sigma[0], sigma[1]]).collect();
        assert_near(&answers("numpy_forward.py", &checkpoint, &grids, &folder), &expected, "numpy");
    }
}

#[test]
fn torch_answers_as_rust_does() {
    if !can_import("torch, numpy, safetensors, tomllib") {
        eprintln!("skipped: no torch");
        return;
    }
    let (grids, folder) = (grids(40), scratch("torch"));
    for checkpoint in checkpoints() {
        // The module gives raw outputs: no mirror averaging, which is a property of its use.
        let plain = Checkpoint { inference: InferenceSettings::plain(), ..checkpoint };
        let expected = plain.predictor().raw(&grids.iter().collect::<Vec<_>>());
        let found = likeliest(&answers("torch_module.py", &plain, &grids, &folder), &plain);
        assert_near(&found, &expected, "torch");
    }
}

/// The file that `export onnx` writes, in another runtime. That lotpilot's own runtime answers alike is tested in `onnx`.
#[test]
fn onnxruntime_answers_as_rust_does() {
    if !can_import("onnx, onnxruntime, numpy") {
        eprintln!("skipped: no onnxruntime");
        return;
    }
    let (grids, folder) = (grids(40), scratch("onnxruntime"));
    for checkpoint in checkpoints() {
        let plain = Checkpoint { inference: InferenceSettings::plain(), ..checkpoint };
        let expected = plain.predictor().raw(&grids.iter().collect::<Vec<_>>());
        std::fs::write(folder.join("policy.onnx"), onnx::export::export(&plain)).unwrap();
        let found = likeliest(&answers("onnx_answers.py", &plain, &grids, &folder), &plain);
        assert_near(&found, &expected, "onnxruntime");
    }
}

#[test]
fn the_docs_show_the_scripts_word_for_word() {
    let docs = std::fs::read_to_string(root().join("docs/formats.md")).unwrap();
    for script in ["numpy_forward.py", "torch_module.py"] {
        let code = std::fs::read_to_string(root().join("tests/python").join(script)).unwrap();
        assert!(docs.contains(&format!("```python\n{code}```")), "docs/formats.md shows another {script}");
    }
}

/// What `docs/formats.md` shows to unpack the grids of a round gives the grids that lotpilot reads.
#[test]
fn the_docs_unpack_the_grids_of_a_round() {
    if !can_import("numpy") {
        assert!(std::env::var_os("CI").is_none(), "numpy is needed; PYTHON names an interpreter");
        eprintln!("skipped: no numpy");
        return;
    }
    let run = scratch("unpacked").join("run");
    succeed(xtask().args(["train-bc", "--preset", "smoke", "--no-eval", "--out"]).arg(&run));
    let (round, _) = Store::open(&run).unwrap().read_round(0).unwrap();
    assert!(!round.noise_augmentations.is_empty());
    let docs = std::fs::read_to_string(root().join("docs/formats.md")).unwrap();
    let folder = run.join("round-00");
    let unpacked = |name: &str, array: &str| {
        let section = docs.split("\n### ").find(|section| section.starts_with(&format!("`{name}`\n"))).unwrap();
        let code = section.split("```").nth(1).unwrap().strip_prefix("python\n").unwrap();
        let code = format!("{code}np.save('cells.npy', {array}.reshape(-1, 625))");
        let ran = python().args(["-c", &code]).current_dir(&folder).output().unwrap();
        assert!(ran.status.success(), "{name}: {:?}", text(&ran));
        let cells: Array2<u8> = ndarray_npy::read_npy(folder.join("cells.npy")).unwrap();
        cells.outer_iter().map(|cells| OccupancyGrid::from_cells(&cells.to_vec())).collect::<Vec<_>>()
    };
    let expected: Vec<_> = round.samples.iter().map(|sample| sample.grid).collect();
    assert!(unpacked("grids.npy", "grids") == expected);
    assert!(unpacked("noise_augmentations.npz", "augmentations") == round.noise_augmentations);
}

/// Every key of every TOML file that a training round leaves has its row, and so has every column of `ticks.npz`.
#[test]
fn the_docs_name_every_key_of_a_round() {
    let run = scratch("documented").join("run");
    succeed(xtask().args(["train-bc", "--preset", "smoke", "--no-eval", "--out"]).arg(&run));
    let docs = std::fs::read_to_string(root().join("docs/formats.md")).unwrap();
    let section = |name: &str| {
        let heading = format!("`{name}`\n");
        docs.split("\n### ").find(|section| section.starts_with(&heading)).unwrap()
    };
    for name in ["round.toml", "model.toml", "fit.toml"] {
        let file: toml::Table = std::fs::read_to_string(run.join("round-00").join(name)).unwrap().parse().unwrap();
        assert!(file.contains_key("schema"), "{name}");
        for key in file.keys() {
            assert!(section(name).contains(&format!("`{key}")), "docs/formats.md says nothing of {key} in {name}");
        }
    }
    let file = std::fs::File::open(run.join("round-00/ticks.npz")).unwrap();
    let columns = ndarray_npy::NpzReader::new(file).unwrap().names().unwrap();
    assert_eq!(columns.len(), 11);
    for column in columns {
        assert!(section("ticks.npz").contains(&format!("`{column}`")), "docs/formats.md says nothing of {column}");
    }
    let header = std::fs::read_to_string(run.join("round-00/learning.csv")).unwrap();
    for column in header.lines().next().unwrap().split(',') {
        assert!(section("learning.csv").contains(&format!("`{column}`")), "docs/formats.md says nothing of {column}");
    }
}
