//! What the fuzz targets share: a folder in memory, and files that are sound except for the one that is made up.

use policy::checkpoint::Checkpoint;
use policy::conditions::Conditions;
use policy::dataset::store::Store;
use policy::dataset::{Collection, EpisodeRecord, Round, Sample, Tick};
use policy::network::{ConvLayer, InferenceSettings, NetworkArchitecture, Weights};
use sim::driver::Source;
use sim::episode::EpisodeSettings;
use sim::scenario::Direction;
use sim::seed::RootSeed;
use sim::sensing::OccupancyGrid;
use sim::vehicle::VehicleSettings;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Mutex};
use storage::sums;

/// Planners that have parameters.
pub const PLANNERS: [&str; 7] = ["tentacle", "vvf", "dwa", "cvm", "apf", "vff", "mppi"];

/// A folder of this process in memory.
pub fn folder() -> &'static Path {
    static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
        let memory = Path::new("/dev/shm");
        let base = if memory.is_dir() { memory.to_owned() } else { std::env::temp_dir() };
        let folder = base.join(format!("lotpilot-fuzz-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("a folder in memory");
        folder
    });
    &FOLDER
}

/// Writes a file into [`folder()`].
pub fn write(name: &str, content: &[u8]) -> PathBuf {
    let path = folder().join(name);
    fs::write(&path, content).expect("there is memory left");
    path
}

/// The file of a lot that has something of everything. As small as a car can drive in: what is accepted becomes a raster.
pub const YARD: &str = include_str!("yard.toml");

/// The YAML file of a map.
pub const MAP: &str = "image: map.pgm\nresolution: 1.0\norigin: [0.0, 0.0, 0.0]\nmode: trinary\n";
/// A centre line on it.
pub const LINE: &str = "3,4\n10,4\n";
/// A lot on both.
pub const LOT: &str = "map = \"map.yaml\"\ncentre_line = \"line.csv\"\n";
/// A lot on the map whose route is found.
pub const FOUND: &str = "map = \"map.yaml\"\nstart = [3, 4, 0]\ngoal = [10, 4, 0]\nscale = 1.0\nclearance_m = 0.2\n\
                         wall_height_m = 1.0\ndrop_specks_m2 = 0.5\n";
/// A TPCAP case. It has 20 m of ground around it, whatever it is.
pub const CASE: &str = "0,0,0,8,0,0,1,4,2,3,5,3,5,6,2,6";

/// The image of the map: 16 × 8 m of free ground, and an island of 2 × 1 m beside the centre line. An import takes as long
/// as its map is large.
pub fn image() -> Vec<u8> {
    let pixel = |at: usize| if [28, 29].contains(&at) { 0 } else { 254 };
    b"P5\n16 8\n255\n".iter().copied().chain((0..16 * 8).map(pixel)).collect()
}

/// A file of an import.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Imported {
    /// [`MAP`]
    Map,
    /// [`image`]
    Image,
    /// [`LINE`]
    Line,
    /// [`LOT`]
    Lot,
    /// [`CASE`]
    Case,
}

impl Imported {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Map, Self::Image, Self::Line, Self::Lot, Self::Case];

    /// Its name in [`folder`].
    fn name(self) -> &'static str {
        match self {
            Self::Map => "map.yaml",
            Self::Image => "map.pgm",
            Self::Line => "line.csv",
            Self::Lot => "map.lot.toml",
            Self::Case => "case.csv",
        }
    }

    /// The file, sound.
    pub fn sound(self) -> Vec<u8> {
        match self {
            Self::Map => MAP.into(),
            Self::Image => image(),
            Self::Line => LINE.into(),
            Self::Lot => LOT.into(),
            Self::Case => CASE.into(),
        }
    }
}

/// Imports a lot that is sound except for one file, whatever the outcome.
pub fn import(made_up: Imported, content: &[u8]) {
    /// The file that was made up before; all others are there, and sound.
    static BEFORE: Mutex<Option<Imported>> = Mutex::new(None);
    let write = |file: Imported, content: &[u8]| write(file.name(), content);
    match BEFORE.lock().expect("one thread").replace(made_up) {
        Some(before) if before == made_up => {}
        Some(before) => drop(write(before, &before.sound())),
        None => Imported::ALL.into_iter().for_each(|file| drop(write(file, &file.sound()))),
    }
    let made_up_file = write(made_up, content);
    let lot = if made_up == Imported::Case { made_up_file } else { folder().join(Imported::Lot.name()) };
    drop(scenarios::load::load(&lot, &VehicleSettings::hyundai_hg300()));
}

/// The files of a folder that is sound.
pub type Files = Vec<(String, Vec<u8>)>;

/// As small a network as there can be with layers of every kind, untrained: a residual layer more is 9 kB more to be read.
pub fn checkpoint() -> Checkpoint {
    let network = NetworkArchitecture {
        conv1: ConvLayer { channels: 16, kernel: 3 },
        conv2: ConvLayer { channels: 16, kernel: 2 },
        residual2: 1,
        hidden: 1,
        ..NetworkArchitecture::compact()
    };
    Checkpoint {
        weights: Weights::init(network, RootSeed(1), 0),
        conditions: Conditions::of(&EpisodeSettings::paper()),
        inference: InferenceSettings::plain(),
    }
}

/// The files of a network.
pub fn network_files() -> Files {
    let folder = folder().join("sound-network");
    fs::create_dir_all(&folder).expect("there is memory left");
    checkpoint().save(&folder).expect("there is memory left");
    let mut files = files_in(&folder);
    let (_, model) = files.iter_mut().find(|(name, _)| name == "model.toml").expect("it was written");
    *model = without_prose(model);
    files
}

/// The file of a network without what people read in it: most of a checkpoint's time is spent on reading TOML.
fn without_prose(model: &[u8]) -> Vec<u8> {
    let mut model: toml::Table = std::str::from_utf8(model).expect("it is text").parse().expect("it is TOML");
    for prose in ["input", "output"] {
        model.insert(prose.to_owned(), toml::Value::String(String::new()));
    }
    toml::to_string(&model).expect("it was TOML").into_bytes()
}

/// The files of a round of three samples, with two noise augmentations each.
pub fn round_files() -> Files {
    let mut round: Round = vec![Sample { grid: OccupancyGrid::free(), label: [0.5, 0.4], tau_hat: 0.1 }; 3].into();
    let tick = |tick: u32| Tick {
        episode: 0,
        tick,
        time_s: 0.05 * tick as f32,
        x_m: 1.0,
        y_m: 2.0,
        heading_rad: 0.1,
        speed_mps: 1.5,
        steering_rad: 0.02,
        command_steering_rad: 0.03,
        command_speed_mps: 1.6,
        driver: Source::Expert,
    };
    round.ticks = (0..3).map(tick).collect();
    round.noise_augmentations = vec![OccupancyGrid::free(); 6];
    let episode = EpisodeRecord {
        lot: "lane".to_owned(),
        direction: Direction::Forward,
        samples: 3,
        near_collisions: 0,
        driven_m: 30.0,
    };
    let collection = Collection {
        round: 0,
        samples: 3,
        noise_augmentations: 2,
        ticks: 3,
        novice_ticks: 0,
        tau_hat_sum: 0.3,
        driven_s: 0.15,
        near_collisions: 0,
        driven_m: 30.0,
        effort: None,
        agreement: None,
        episodes: vec![episode],
    };
    let store = Store::open(&folder().join("sound-run")).expect("there is memory left");
    if !store.round_folder(0).exists() {
        store.write_round(&round, &collection).expect("there is memory left");
    }
    files_in(&store.round_folder(0))
}

fn files_in(folder: &Path) -> Files {
    let mut files: Files = fs::read_dir(folder)
        .expect("it is there")
        .map(|entry| entry.expect("it is there"))
        .map(|entry| (entry.file_name().to_string_lossy().into_owned(), fs::read(entry.path()).expect("it is there")))
        .filter(|(name, _)| name != sums::FILE)
        .collect();
    files.sort();
    files
}

/// A folder within [`folder()`] whose files are sound except for one.
#[derive(Debug)]
pub struct Sound {
    folder: PathBuf,
    files: Files,
    digests: Vec<String>,
    made_up: Option<usize>,
}

impl Sound {
    /// The folder with all files sound, and listed.
    pub fn new(name: &str, files: Files) -> Self {
        let folder = folder().join(name);
        fs::create_dir_all(&folder).expect("there is memory left");
        let digests = files.iter().map(|(_, content)| sums::digest(content)).collect();
        let sound = Self { folder, files, digests, made_up: None };
        sound.files.iter().for_each(|(name, content)| sound.write(name, content));
        sound.list(|index| &sound.digests[index]);
        sound
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.folder
    }

    /// Makes up one file, and lists it as whole: damage is another test's. The first byte says which, the rest is its content.
    /// The one that was made up before is sound again.
    pub fn make_up(&mut self, data: &[u8]) {
        let (which, content) = data.split_first().unwrap_or((&0, &[]));
        let which = usize::from(*which) % self.files.len();
        if let Some(before) = self.made_up.replace(which).filter(|before| *before != which) {
            let (name, content) = &self.files[before];
            self.write(name, content);
        }
        self.write(&self.files[which].0, content);
        let made_up = sums::digest(content);
        self.list(|index| if index == which { &made_up } else { &self.digests[index] });
    }

    fn list<'a>(&'a self, digest: impl Fn(usize) -> &'a String) {
        let line = |(index, (name, _)): (usize, &(String, Vec<u8>))| format!("{}  {name}\n", digest(index));
        self.write(sums::FILE, self.files.iter().enumerate().map(line).collect::<String>().as_bytes());
    }

    fn write(&self, name: &str, content: &[u8]) {
        fs::write(self.folder.join(name), content).expect("there is memory left");
    }
}
