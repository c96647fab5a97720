//! Golden digests of lots and episodes: a change of physics, sensing, noise, lots or a driver cannot pass unseen.
//!
//! What is driven without a network, and how it is digested, is in the crate `digests`, which drives it on other platforms too
//! (`.ci/same-bytes`). `tests/goldens.toml` keeps the digests; `tests/golden-weights.toml` those of what the preset `smoke`
//! trains.
//!
//! After an intended change: `UPDATE_GOLDENS=1 cargo test -p tests goldens`, and say in the commit what changed and why.
//! Those of the network hold on x86-64 with AVX2 and FMA, all others everywhere.

use crate::bench::{root, scratch, succeed, xtask};
use digests::{Case, Goldens, drive_all, lot_c};
use policy::network::{InferenceSettings, NetworkArchitecture, Predictor, Weights};
use sim::driver::{Decision, Policy, SensorsOnly, Source};
use sim::seed::RootSeed;
use sim::sensing::{GridGeometry, Observation};
use std::collections::BTreeMap;
use storage::sums;

/// A network that has learned nothing: its weights are drawn from a seed.
struct Untrained(Predictor, GridGeometry);

impl Policy for Untrained {
    fn act(&mut self, observation: &Observation) -> Decision {
        let prediction = self.0.predict(&[&observation.grid])[0];
        let spread = Some(prediction.spread(self.1));
        Decision { look_ahead: prediction.look_ahead(self.1), source: Source::Novice, spread, speed_limit_mps: None }
    }
}

#[test]
fn goldens_of_every_layer_are_kept() {
    let mut driven = drive_all();
    for scene in lot_c() {
        let weights = Weights::init(NetworkArchitecture::compact(), RootSeed(1), 0);
        let predictor = Predictor::new(&weights, InferenceSettings::plain());
        let untrained = SensorsOnly(Untrained(predictor, scene.settings.sensing.geometry));
        driven.episodes.extend([Case::new("network", &scene, Box::new(untrained)).drive()]);
    }
    let file = root().join("tests/goldens.toml");
    if std::env::var_os("UPDATE_GOLDENS").is_some() {
        let head =
            "# Written by UPDATE_GOLDENS=1 cargo test -p tests goldens; digests/src/lib.rs says what is digested.\n\n";
        std::fs::write(&file, head.to_owned() + &toml::to_string(&driven).unwrap()).unwrap();
        return;
    }
    let changes = Goldens::kept().unwrap().differences(&driven);
    assert!(
        changes.is_empty(),
        "lots or episodes changed:\n{}\nIntended? UPDATE_GOLDENS=1 cargo test -p tests goldens, and say why in the commit",
        changes.join("\n")
    );
}

/// Data, and what is fitted to them: the same on every processor with AVX2 and FMA, whatever else it has, and on
/// ARM64.
#[test]
fn weights_of_a_short_training_are_kept() {
    #[cfg(target_arch = "x86_64")]
    let rounds_once = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
    #[cfg(not(target_arch = "x86_64"))]
    let rounds_once = cfg!(target_arch = "aarch64");
    if !rounds_once {
        return;
    }
    let run = scratch("golden-weights").join("run");
    succeed(xtask().args(["train-dagger", "--preset", "smoke", "--no-eval", "--out"]).arg(&run));
    let trained: BTreeMap<String, String> = ["round-00", "round-01"]
        .into_iter()
        .flat_map(|round| ["grids.npy", "labels.npy", "model.safetensors"].map(|file| format!("{round}/{file}")))
        .map(|file| (file.clone(), sums::digest(&std::fs::read(run.join(file)).unwrap())))
        .collect();
    let file = root().join("tests/golden-weights.toml");
    if std::env::var_os("UPDATE_GOLDENS").is_some() {
        let head =
            "# Written by UPDATE_GOLDENS=1 cargo test -p tests goldens: SHA-256 of what --preset smoke trains.\n\n";
        std::fs::write(&file, head.to_owned() + &toml::to_string(&trained).unwrap()).unwrap();
        return;
    }
    let kept: BTreeMap<String, String> = toml::from_str(&std::fs::read_to_string(&file).unwrap()).unwrap();
    assert_eq!(
        kept, trained,
        "data or weights changed. Intended? UPDATE_GOLDENS=1 cargo test -p tests goldens, and say why in the commit"
    );
}
