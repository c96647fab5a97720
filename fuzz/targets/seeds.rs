//! No target: before it begins, writes a corpus for the others, sound inputs of each, into `corpus/`. It is built as one
//! because what is instrumented links with libFuzzer only.
#![no_main]

use experiment::settings::Settings;
use fuzz::{Files, LINE, MAP, PLANNERS};
use libfuzzer_sys::fuzz_target;
use scenarios::reference::{self, ReferenceLot};
use sim::seed::RootSeed;
use std::path::Path;

fuzz_target!(init: write().expect("the corpus can be written"), |_bytes: &[u8]| {});

fn write() -> std::io::Result<()> {
    let lots = ReferenceLot::ALL.map(|lot| scenarios::load::to_toml(&reference::lot(lot, RootSeed(1))).into_bytes());
    let settings = ["default", "paper", "smoke"].map(|name| Settings::preset(name).expect("a preset").to_toml().into());
    let planner = |(index, name): (usize, &&str)| {
        let text = experiment::drivers::PlannerFile::text_of(name).expect("it has parameters");
        [&[index as u8][..], text.as_bytes()].concat()
    };
    let words = |words: &[&str]| words.iter().map(|word| word.as_bytes().to_vec()).collect();
    let one_of = |files: Files| {
        files.into_iter().enumerate().map(|(index, (_, content))| [&[index as u8][..], &content].concat()).collect()
    };
    let network = fuzz::network_files();
    let list: String =
        network.iter().map(|(name, content)| format!("{}  {name}\n", storage::sums::digest(content))).collect();
    let targets: [(&str, Vec<Vec<u8>>); 14] = [
        ("scenario", lots.to_vec()),
        ("settings", settings.to_vec()),
        ("set", words(&["seed=2", "dagger.eta=0.8", "training.lots=[\"lot-a\"]", "dagger.rule.tau_only.tau=0.1"])),
        ("map", vec![MAP.to_vec()]),
        ("image", vec![fuzz::image()]),
        ("centre_line", vec![LINE.to_vec()]),
        ("tpcap", words(&["8,12,0,40,12,0,1,4,20,20,24,20,24,24,20,24"])),
        ("planner", PLANNERS.iter().enumerate().map(planner).collect()),
        (
            "names",
            words(&["lot-a,test:3:hard", "sealed:spring:2:lane", "run:a/bc", "tuned:vvf", "dwa/fox", "lots/a.toml"]),
        ),
        ("replay_key", words(&["tentacle@lot-b@forward@0@paper@1@842", "run:a/bc@test-hard-7@reverse@3@1.5@7@0"])),
        ("checkpoint", one_of(network)),
        ("round", one_of(fuzz::round_files())),
        ("list", vec![list.into_bytes()]),
        ("onnx", vec![onnx::export::export(&fuzz::checkpoint()).expect("one mode")]),
    ];
    for (target, seeds) in targets {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(target);
        std::fs::create_dir_all(&folder)?;
        for (index, seed) in seeds.iter().enumerate() {
            std::fs::write(folder.join(format!("seed-{index}")), seed)?;
        }
    }
    Ok(())
}
