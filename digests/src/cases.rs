//! What is driven: the expert and every planner, lots of every family, with and without noise, both ways.

use crate::{Golden, Goldens, drive};
use expert::{ExpertSettings, GridExpert, ScriptedExpert};
use planners::{PlannerContext, PlannerSpec};
use rayon::prelude::*;
use scenarios::reference::{ReferenceLot, lot};
use scenarios::split::{Family, Split};
use scenarios::{generator, load};
use sim::driver::{Decision, Driver, LookAheadPoint, Policy, SensorsOnly, Source};
use sim::episode::EpisodeSettings;
use sim::map::Map;
use sim::scenario::{Direction, NoiseLevel, Scenario};
use sim::seed::{RootSeed, Stream};
use sim::sensing::noise::NoiseSettings;
use sim::sensing::{GRID_CELLS, GridGeometry, Observation};
use std::sync::Arc;

/// Lots of every family whose files are digested; the first is driven.
const LOTS_PER_FAMILY: u64 = 3;

/// Where and how to drive.
#[derive(Debug, Clone)]
pub struct Scene {
    name: String,
    /// Its settings, noise included.
    pub settings: Arc<EpisodeSettings>,
    map: Arc<Map>,
}

/// Who drives where.
pub struct Case {
    name: String,
    scene: Scene,
    driver: Box<dyn Driver + Send>,
}

impl Scene {
    /// # Panics
    /// If the scenario is invalid.
    fn new(name: &str, scenario: Scenario, level: NoiseLevel, direction: Direction) -> Self {
        let settings = Arc::new(EpisodeSettings { noise: NoiseSettings::of(level), ..EpisodeSettings::paper() });
        let map = Map::build(direction.of(scenario), &settings.vehicle).expect("what is generated is valid");
        Self { name: format!("{name}{level:?}, {direction:?}").to_lowercase(), settings, map: Arc::new(map) }
    }

    fn is_noisy(&self) -> bool {
        self.settings.noise != NoiseSettings::of(NoiseLevel::Clean)
    }
}

impl Case {
    /// A driver on a scene.
    pub fn new(driver_name: &str, scene: &Scene, driver: Box<dyn Driver + Send>) -> Self {
        Self { name: format!("{driver_name}, {}", scene.name), scene: scene.clone(), driver }
    }

    /// The name of the case and its digests.
    pub fn drive(mut self) -> (String, Golden) {
        (self.name, drive(&self.scene.settings, self.scene.map, self.driver.as_mut()))
    }
}

/// Lot c, clean and with the paper's noise, both ways.
pub fn lot_c() -> Vec<Scene> {
    let scene = |level, direction| Scene::new("", lot(ReferenceLot::C, RootSeed(2)), level, direction);
    [NoiseLevel::Clean, NoiseLevel::Paper]
        .into_iter()
        .flat_map(|level| Direction::BOTH.map(|way| scene(level, way)))
        .collect()
}

/// Everything that drives without a network, driven; and lots of every family.
pub fn drive_all() -> Goldens {
    let numbers = Family::EVERY.into_iter().flat_map(|family| (0..LOTS_PER_FAMILY).map(move |index| (family, index)));
    let lots: Vec<Scenario> = numbers
        .collect::<Vec<_>>()
        .into_par_iter()
        .map(|(family, index)| generator::generate(&Split::Test, index, family).scenario)
        .collect();
    let cases = on_lot_c().into_iter().chain(lots.iter().step_by(LOTS_PER_FAMILY as usize).flat_map(on_generated));
    let episodes = cases.collect::<Vec<_>>().into_par_iter().map(Case::drive).collect();
    Goldens { lots: lots.iter().map(|lot| (lot.name.clone(), digest(&load::to_toml(lot)))).collect(), episodes }
}

fn on_lot_c() -> Vec<Case> {
    let mut cases = Vec::new();
    for scene in lot_c() {
        let context = PlannerContext::of(&scene.settings);
        let mut add = |name: &str, driver: Box<dyn Driver + Send>| cases.push(Case::new(name, &scene, driver));
        add("middle of the row", Box::new(SensorsOnly(MiddleOfTheRow(scene.settings.sensing.geometry))));
        add("expert", Box::new(expert(&scene.settings)));
        add("grid-expert", Box::new(SensorsOnly(grid_expert(&scene.settings))));
        // One planner shows what noise changes; the others differ in what they compute alone.
        for spec in PlannerSpec::all().iter().filter(|spec| scene.is_noisy() || spec.name() == "tentacle") {
            add(spec.name(), Box::new(SensorsOnly(spec.planner(&context))));
            for (reading, _, read) in spec.readings() {
                add(&format!("{}/{reading}", spec.name()), Box::new(SensorsOnly(read.planner(&context))));
            }
        }
    }
    cases
}

fn on_generated(lot: &Scenario) -> [Case; 2] {
    Direction::BOTH.map(|direction| {
        let scene = Scene::new(&format!("{}, ", lot.name), lot.clone(), NoiseLevel::Paper, direction);
        Case::new("expert", &scene, Box::new(expert(&scene.settings)))
    })
}

fn expert(settings: &EpisodeSettings) -> ScriptedExpert {
    ScriptedExpert::new(ExpertSettings::half_points(), settings, RootSeed(1).rng(Stream::Expert, 0))
}

fn grid_expert(settings: &EpisodeSettings) -> GridExpert {
    GridExpert::new(ExpertSettings::half_points(), settings, RootSeed(1).rng(Stream::Expert, 0))
}

fn digest(text: &str) -> String {
    storage::sums::digest(text.as_bytes())[..16].to_owned()
}

/// Heads for the middle of the free cells of one row: simple enough that its decisions change only if what it sees does.
struct MiddleOfTheRow(GridGeometry);

impl Policy for MiddleOfTheRow {
    fn act(&mut self, observation: &Observation) -> Decision {
        const ROW: usize = 16;
        let free: Vec<usize> = (0..GRID_CELLS).filter(|&col| !observation.grid.is_occupied(ROW, col)).collect();
        let left_m = |col: usize| self.0.cell_in_ego(ROW, col).y;
        let sum_m: f32 = free.iter().map(|&col| left_m(col)).sum();
        let look_ahead = LookAheadPoint {
            ahead_m: self.0.cell_in_ego(ROW, 0).x,
            left_m: if free.is_empty() { 0.0 } else { sum_m / free.len() as f32 },
        };
        Decision { look_ahead, source: Source::Planner, spread: None, speed_limit_mps: None }
    }
}
