//! No target: before it begins, writes a corpus for the others, sound inputs of each, and dictionaries of words that are
//! hardly found by chance, into `corpus/`. It is built as one because what is instrumented links with libFuzzer only.
#![no_main]

use experiment::settings::{Settings, reference};
use fuzz::{CASE, FOUND, Files, Imported, LINE, MAP, PLANNERS, YARD};
use libfuzzer_sys::fuzz_target;
use std::fs;
use std::path::Path;

/// Two by two pixels in every format that is read.
const IMAGES: [&[u8]; 6] = [
    b"P5\n2 2\n255\n\x00\xfe\xcd\xfe",
    b"P2\n2 2\n255\n0 254\n205 254\n",
    b"P1\n2 2\n0 1\n1 0\n",
    b"P6\n2 2\n255\n\x00\x00\x00\xfe\xfe\xfe\xcd\xcd\xcd\xfe\xfe\xfe",
    b"P7\nWIDTH 2\nHEIGHT 2\nDEPTH 1\nMAXVAL 255\nTUPLTYPE GRAYSCALE\nENDHDR\n\x00\xfe\xcd\xfe",
    b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x02\0\0\0\x02\x08\0\0\0\0W\xddR\xf8\0\0\0\x0eIDATx\x9cc\xf8\xc7\xc0p\xf6\x1f\0\x07\x94\x02\xca\
      \xe1\x95\xf5A\0\0\0\0IEND\xaeB`\x82",
];

/// Keys and words of lots and maps. Those of settings are in their reference.
const WORDS_OF_LOTS: [&str; 37] = [
    "name = ",
    "boundary = ",
    "boundary_height_m = ",
    "[reference_path]",
    "points = ",
    "corner_radius_m = ",
    "[noise]",
    "level = ",
    "clean",
    "paper",
    "hard",
    "[[island]]",
    "polygon = ",
    "height_m = ",
    "[[obstacle]]",
    "class = ",
    "wheel_stop",
    "x_m = ",
    "y_m = ",
    "heading_deg = ",
    "length_m = ",
    "width_m = ",
    "[[speed_bump]]",
    "scale = ",
    "start = ",
    "goal = ",
    "loop = true",
    "clearance_m = ",
    "wall_height_m = ",
    "drop_specks_m2 = ",
    "close_branches = true",
    "negate: 1",
    "occupied_thresh: ",
    "free_thresh: ",
    "mode: scale",
    "mode: raw",
    "resolution: ",
];

fuzz_target!(init: write().expect("the corpus can be written"), |_bytes: &[u8]| {});

fn write() -> std::io::Result<()> {
    // By tables: what is read in a tenth of the time is tried ten times as often.
    let settings = Settings::preset("default").expect("a preset").to_toml();
    let tables = settings.split_inclusive("\n\n").map(|table| table.as_bytes().to_vec()).collect();
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
    let imported = |(index, file): (usize, Imported)| [&[index as u8][..], &file.sound()].concat();
    let found = [&[Imported::Lot as u8][..], FOUND.as_bytes()].concat();
    let targets: [(&str, Vec<Vec<u8>>); 15] = [
        ("scenario", words(&[YARD])),
        ("settings", tables),
        ("set", words(&["seed=2", "dagger.eta=0.8", "training.lots=[\"lot-a\"]", "dagger.rule.tau_only.tau=0.1"])),
        ("map", words(&[MAP])),
        ("image", IMAGES.map(<[u8]>::to_vec).to_vec()),
        ("centre_line", words(&[LINE])),
        ("tpcap", words(&[CASE])),
        ("import", Imported::ALL.into_iter().enumerate().map(imported).chain([found]).collect()),
        ("planner", PLANNERS.iter().enumerate().map(planner).collect()),
        (
            "names",
            words(&["lot-a,test:3:hard", "sealed:spring:2:lane", "run:a/bc", "tuned:vvf", "dwa/fox", "lots/a.toml"]),
        ),
        ("replay_key", words(&["tentacle@lot-b@forward@0@paper@1@842", "run:a/bc@test-hard-7@reverse@3@1.5@7@0"])),
        ("checkpoint", one_of(network)),
        ("round", one_of(fuzz::round_files())),
        ("list", vec![list.into_bytes()]),
        ("onnx", vec![onnx::export::export(&fuzz::checkpoint())]),
    ];
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus");
    for (target, seeds) in targets {
        let folder = corpus.join(target);
        fs::create_dir_all(&folder)?;
        for (index, seed) in seeds.iter().enumerate() {
            fs::write(folder.join(format!("seed-{index}")), seed)?;
        }
    }
    let entries = reference::entries();
    let choices = || entries.iter().flat_map(|entry| &entry.choices).cloned();
    let last_part = |key: &str| key.rsplit('.').next().unwrap_or_default().to_owned();
    let of_lots = || WORDS_OF_LOTS.map(str::to_owned).to_vec();
    let dictionaries: [(&str, Vec<String>); 4] = [
        ("set", entries.iter().map(|entry| format!("{}=", entry.key)).chain(choices()).collect()),
        ("settings", entries.iter().map(|entry| format!("{} = ", last_part(&entry.key))).chain(choices()).collect()),
        ("scenario", of_lots()),
        ("import", of_lots()),
    ];
    for (target, mut words) in dictionaries {
        words.sort();
        words.dedup();
        let lines: String = words.iter().map(|word| format!("\"{word}\"\n")).collect();
        fs::write(corpus.join(format!("{target}.dict")), lines)?;
    }
    Ok(())
}
