//! Drivers: how they are named, and how they get to the wheel.

mod planner_file;
mod shipped;
mod spec;

pub use planner_file::{Parameters, PlannerFile, tuned_specs};
pub use spec::{DriverSpec, never_in_a_name, specs};

use crate::settings::{Layers, Settings, Smoothing};
use crate::trained::{self, TrainedOn, Training};
use anyhow::{Context as _, bail, ensure};
use expert::{ExpertSettings, GridExpert, ScriptedExpert, Sees};
use onnx::fleet::OnnxFleet;
use onnx::network::OnnxNetwork;
use planner_file::planner;
use planners::{Planner, PlannerContext, PlannerSpec};
use policy::checkpoint::Checkpoint;
use policy::conditions::Conditions;
use policy::drivers::NetFleet;
use policy::network::InferenceSettings;
use sim::action_smoothing::SmoothedFleet;
use sim::driver::{Fleet, OneDriverEach, SensorsOnly, Source};
use sim::episode::EpisodeSettings;
use sim::seed::{Rng, RootSeed, Stream};
use std::cell::OnceCell;
use std::fmt;
use std::path::Path;
use std::sync::Arc;
use storage::sums;

impl DriverSpec {
    /// Refuses a policy of a training that was interrupted, in an ensemble as well.
    ///
    /// # Errors
    /// If there is one, or no run where one is named.
    pub fn ensure_whole(&self) -> anyhow::Result<()> {
        match self {
            Self::Run { folder } => trained::ensure_whole(folder).with_context(|| format!("driver {self}")),
            Self::Ensemble { members } => members.iter().try_for_each(Self::ensure_whole),
            Self::Expert
            | Self::GridExpert
            | Self::Checkpoint { .. }
            | Self::Shipped { .. }
            | Self::Onnx { .. }
            | Self::Planner { .. }
            | Self::Callback { .. } => Ok(()),
        }
    }

    /// The networks it names, read from their files.
    fn checkpoints(&self) -> anyhow::Result<Vec<Checkpoint>> {
        match self {
            Self::Run { folder } => {
                trained::driving_folders(folder)?.iter().map(|folder| Ok(Checkpoint::load(folder)?)).collect()
            }
            Self::Checkpoint { folder } => {
                ensure!(
                    Checkpoint::exists(folder)?,
                    "{} lists no finished model.safetensors in sha256sums; name the folder of a round, as in \
                     net:runs/NAME/round-03",
                    folder.display()
                );
                trained::ensure_run_of_network(folder)?;
                Ok(vec![Checkpoint::load(folder)?])
            }
            Self::Shipped { name } => Ok(vec![shipped::network(name)?]),
            Self::Ensemble { members } => {
                let networks = members.iter().map(Self::checkpoints).collect::<anyhow::Result<Vec<_>>>()?;
                let first = &networks[0][0];
                for (member, network) in members.iter().zip(&networks) {
                    ensure!(
                        (&network[0].conditions, network[0].inference) == (&first.conditions, first.inference),
                        "{member} was trained or drives with other settings than {}; members of an ensemble must agree \
                         (compare their model.toml)",
                        members[0]
                    );
                }
                Ok(networks.concat())
            }
            Self::Expert | Self::GridExpert | Self::Onnx { .. } | Self::Planner { .. } | Self::Callback { .. } => {
                Ok(Vec::new())
            }
        }
    }

    /// The lots that its networks were trained on, as far as the runs that they lie in say.
    fn trained_on(&self) -> anyhow::Result<TrainedOn> {
        match self {
            Self::Run { folder } => trained::trained_on(folder),
            Self::Checkpoint { folder } => trained::network_trained_on(folder),
            Self::Shipped { name } => shipped::trained_on(name),
            Self::Ensemble { members } => {
                let mut all = TrainedOn::default();
                for member in members {
                    all.extend(member.trained_on()?);
                }
                Ok(all)
            }
            Self::Expert | Self::GridExpert | Self::Onnx { .. } | Self::Planner { .. } | Self::Callback { .. } => {
                Ok(TrainedOn::default())
            }
        }
    }

    /// Reads the files it names. It drives with the action smoothing that `evaluation.smoothing` asks for.
    ///
    /// # Errors
    /// If they are not what they should be.
    pub fn load(self, settings: &Settings) -> anyhow::Result<NamedDriver> {
        let name = self.to_string();
        let mut tuned_on = Vec::new();
        let model = match &self {
            Self::Expert => Model::Expert(settings.expert.clone()),
            Self::GridExpert => Model::GridExpert(settings.expert.clone()),
            Self::Run { .. } | Self::Checkpoint { .. } | Self::Shipped { .. } | Self::Ensemble { .. } => {
                let networks = self.checkpoints().with_context(|| format!("driver {name:?}"))?;
                Model::Network(networks)
            }
            Self::Onnx { file } => {
                let network = OnnxNetwork::load(file).with_context(|| format!("driver {name:?}"))?;
                let inference = network.about().map_or(settings.dagger.inference, |about| about.inference);
                Model::Onnx(network, inference)
            }
            Self::Planner { name, parameters } => {
                let (planner, lots) = planner(name, parameters)?;
                tuned_on = lots;
                Model::Planner(planner)
            }
            Self::Callback { .. } => bail!("driver {name:?} is a function of another program"),
        };
        let training = match &self {
            Self::Run { folder } => match trained::training_of(folder) {
                Ok(training) => Some(training),
                Err(error) if storage::is_of_disk(error.as_ref()) => return Err(error),
                // Of a run whose settings this version cannot read, the network alone can be used.
                Err(_) => None,
            },
            _ => None,
        };
        let mut trained_on = self.trained_on().with_context(|| format!("driver {name:?}"))?;
        trained_on.lots.extend(tuned_on);
        let driver = NamedDriver { training, trained_on, ..NamedDriver::new(name, self, model) };
        Ok(driver.smoothed(settings.evaluation.smoothing))
    }
}

/// The network that ships, by its name as a driver, `trained:NAME`; `None` of a text that does not begin so.
///
/// # Errors
/// If none ships under this name.
pub fn shipped_network(text: &str) -> anyhow::Result<Option<Checkpoint>> {
    if !text.starts_with("trained:") {
        return Ok(None);
    }
    let spec: DriverSpec = text.parse()?;
    Ok(spec.checkpoints()?.pop())
}

/// The settings that a comparison of drivers begins with, unless the layers name others: those of the first training run
/// among them, with its folder. `None` if there is no run.
///
/// # Errors
/// If a run's settings cannot be read, or runs were trained with another car, sensor or metrics.
pub fn settings_of_runs<'s>(specs: &'s [DriverSpec], layers: &Layers) -> anyhow::Result<Option<(Settings, &'s Path)>> {
    let mut runs = specs.iter().filter_map(|spec| Some((spec, spec.run()?)));
    let Some((spec, path)) = runs.next().filter(|_| !layers.names_a_base()) else { return Ok(None) };
    let of_run = trained::settings_of(path).with_context(|| format!("driver {spec}"))?;
    for (other, path) in runs {
        let of_other = trained::settings_of(path).with_context(|| format!("driver {other}"))?;
        ensure!(
            of_other.episode == of_run.episode,
            "drivers {spec} and {other} were trained with different settings of episode (car, sensor, metrics), so neither \
             run's settings are fair to both; choose other settings (--config or --preset)"
        );
    }
    Ok(Some((of_run, path)))
}

/// A driver that can take the wheel.
#[derive(Clone)]
pub struct NamedDriver {
    /// Its name in tables.
    pub name: String,
    /// As named on the command line, for replay keys.
    pub spec: DriverSpec,
    /// The training of a whole run that it comes from; `None` for any other driver.
    pub training: Option<Training>,
    /// The lots that its networks were trained on, or its parameters tuned; none where nobody knows.
    pub trained_on: TrainedOn,
    /// The method that it is a training of, where whoever asks says so; otherwise what [`Self::training`] has in common with
    /// others counts.
    pub method: Option<String>,
    model: Model,
    /// Time constant of the action smoothing of drivers that do not smooth by themselves, control ticks; 0 = off.
    smoothing_ticks: f32,
    /// What its files say, where it drives with other action smoothing than that.
    digest_of_files: Option<String>,
}

/// Makes fleets of a driver that this crate does not know: a function of the program that calls this library.
pub trait Callback: Send + Sync {
    /// Seats it in this many cars.
    fn fleet(&self, cars: usize) -> Box<dyn Fleet + Send>;
}

#[derive(Clone)]
enum Model {
    Expert(ExpertSettings),
    GridExpert(ExpertSettings),
    /// One network, or the members of an ensemble, which share geometry and settings of inference.
    Network(Vec<Checkpoint>),
    /// A network from an ONNX file, and how its answers are used.
    Onnx(OnnxNetwork, InferenceSettings),
    Planner(PlannerSpec),
    Callback(Arc<dyn Callback>),
}

impl fmt::Debug for NamedDriver {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "NamedDriver({})", self.spec)
    }
}

impl NamedDriver {
    /// Reads several; each is named as it is written.
    ///
    /// # Errors
    /// If nothing is named so, its files are not what they should be, a training is not finished, or one is named twice.
    pub fn load_all<S: AsRef<str>>(texts: &[S], settings: &Settings) -> anyhow::Result<Vec<Self>> {
        let load = |spec: DriverSpec| {
            spec.ensure_whole()?;
            spec.load(settings)
        };
        DriverSpec::parse_all(texts)?.into_iter().map(load).collect()
    }

    /// The scripted expert.
    pub fn expert(settings: &ExpertSettings) -> Self {
        let model = Model::Expert(settings.clone());
        Self::new("expert".to_owned(), DriverSpec::Expert, model)
    }

    /// The same expert, but it may plan over no more ground than the camera sees of the clean patch.
    pub fn expert_of_patch(settings: &ExpertSettings) -> Self {
        Self::expert(&ExpertSettings { sees: Sees::PatchOnly, ..settings.clone() })
    }

    /// A network that is loaded already.
    pub fn network(name: &str, spec: DriverSpec, checkpoint: Checkpoint) -> Self {
        let model = Model::Network(vec![checkpoint]);
        Self::new(name.to_owned(), spec, model)
    }

    /// A planner with parameters of the caller's.
    pub fn planner(planner: PlannerSpec) -> Self {
        let name = planner.name().to_owned();
        let spec = DriverSpec::Planner { name: name.clone(), parameters: Parameters::Published };
        Self::new(name, spec, Model::Planner(planner))
    }

    /// A function of the calling program, which sees the grid only and is asked for all cars of a batch at once.
    pub fn callback(name: &str, callback: Arc<dyn Callback>) -> Self {
        let spec = DriverSpec::Callback { name: name.to_owned() };
        Self::new(name.to_owned(), spec, Model::Callback(callback))
    }

    /// As its files have it, of no training.
    fn new(name: String, spec: DriverSpec, model: Model) -> Self {
        Self {
            name,
            spec,
            training: None,
            trained_on: TrainedOn::default(),
            method: None,
            model,
            smoothing_ticks: 0.0,
            digest_of_files: None,
        }
    }

    /// The same with other action smoothing. Networks smooth by themselves, as they were trained to.
    #[must_use]
    pub fn smoothed(mut self, smoothing: Smoothing) -> Self {
        if let Smoothing::Ticks(ticks) = smoothing {
            self.digest_of_files = self.digest();
            match &mut self.model {
                Model::Network(networks) => {
                    for network in networks {
                        network.inference.smoothing_ticks = ticks;
                    }
                }
                Model::Onnx(_, inference) => inference.smoothing_ticks = ticks,
                Model::Expert(_) | Model::GridExpert(_) | Model::Planner(_) | Model::Callback(_) => {
                    self.smoothing_ticks = ticks;
                }
            }
        }
        self
    }

    /// The same with another name in tables.
    #[must_use]
    pub fn renamed(self, name: &str) -> Self {
        Self { name: name.to_owned(), ..self }
    }

    /// SHA-256 of what its files say; `None` for one that ships.
    pub fn digest(&self) -> Option<String> {
        if self.digest_of_files.is_some() {
            return self.digest_of_files.clone();
        }
        match (&self.model, &self.spec) {
            (Model::Network(networks), _) => {
                let mut bytes = Vec::new();
                for network in networks {
                    bytes.extend(format!("{:?} {:?}", network.conditions, network.inference).into_bytes());
                    bytes.extend(network.weights.values().iter().flat_map(|value| value.to_le_bytes()));
                }
                Some(sums::digest(&bytes))
            }
            (Model::Onnx(network, inference), _) => {
                Some(sums::digest(format!("{inference:?} {}", network.sha256()).as_bytes()))
            }
            (Model::Planner(planner), DriverSpec::Planner { parameters: Parameters::File(_), .. }) => {
                Some(sums::digest(planner.parameters().to_string().as_bytes()))
            }
            (Model::Expert(_) | Model::GridExpert(_) | Model::Planner(_) | Model::Callback(_), _) => None,
        }
    }

    /// Who it is, as decisions say it.
    pub fn source(&self) -> Source {
        match &self.model {
            Model::Expert(_) => Source::Expert,
            Model::Network(..) | Model::Onnx(..) | Model::Callback(_) => Source::Novice,
            Model::GridExpert(_) | Model::Planner(_) => Source::Planner,
        }
    }

    /// Whether it can drive with these settings.
    ///
    /// # Errors
    /// If it was trained for another patch of ground; or with another controller, sensor or control period, unless
    /// `evaluation.untrained_conditions` allows that.
    pub fn check(&self, settings: &Settings) -> anyhow::Result<()> {
        let trained = match &self.model {
            Model::Network(networks) => Some(&networks[0].conditions),
            // Of a network from elsewhere nobody knows.
            Model::Onnx(network, _) => network.about().map(|about| &about.conditions),
            Model::Expert(_) | Model::GridExpert(_) | Model::Planner(_) | Model::Callback(_) => None,
        };
        let Some(trained) = trained else { return Ok(()) };
        let here = Conditions::of(&settings.episode);
        let is_same_patch = trained.geometry() == here.geometry();
        if is_same_patch && settings.evaluation.untrained_conditions {
            return Ok(());
        }
        let differences = trained.differences(&here);
        let listed: Vec<String> =
            differences.iter().map(|(trained, here)| format!("{trained} (here {here})")).collect();
        let allow = if is_same_patch { ", or allow it with --set evaluation.untrained_conditions=true" } else { "" };
        let settings = match &self.spec {
            DriverSpec::Shipped { name } => format!("--preset {name}"),
            _ => "--config RUN/settings.toml".to_owned(),
        };
        ensure!(
            differences.is_empty(),
            "driver {:?} was trained with {}; use the settings it was trained with ({settings}){allow}",
            self.name,
            listed.join(", ")
        );
        Ok(())
    }

    /// A separate planner that can be asked what it weighed; `None` for drivers that are not planners.
    pub fn to_planner(&self, episode: &EpisodeSettings) -> Option<Planner> {
        match &self.model {
            Model::Planner(planner) => Some(planner.planner(&PlannerContext::of(episode))),
            Model::Expert(_) | Model::GridExpert(_) | Model::Network(..) | Model::Onnx(..) | Model::Callback(_) => None,
        }
    }

    /// How many of some cars, which are driven in lock-step, one fleet drives best: a network answers for a thread's
    /// share of them in one call; others answer for each car alone.
    pub fn cars_per_fleet(&self, cars: usize) -> usize {
        match &self.model {
            Model::Network(..) | Model::Onnx(..) => cars.div_ceil(rayon::current_num_threads()).max(1),
            Model::Callback(_) => cars.max(1),
            Model::Expert(_) | Model::GridExpert(_) | Model::Planner(_) => 1,
        }
    }

    /// Seats it in cars that are driven in lock-step, of which each has the seed of its episode. What all fleets share,
    /// such as the tables of a planner, is computed once.
    pub fn seating<'a>(&'a self, episode: &'a EpisodeSettings) -> impl Fn(&[RootSeed]) -> Box<dyn Fleet + Send> + 'a {
        let shared = OnceCell::new();
        move |seeds| {
            let (cars, ticks) = (seeds.len(), self.smoothing_ticks);
            match &self.model {
                Model::Expert(settings) => {
                    let drivers = seeds.iter().map(|&seed| expert(settings, episode, seed)).collect();
                    smoothed(OneDriverEach(drivers), ticks)
                }
                Model::GridExpert(settings) => {
                    let on_grid = |&seed: &RootSeed| GridExpert::new(settings.clone(), episode, hand(seed));
                    smoothed(OneDriverEach(seeds.iter().map(on_grid).map(SensorsOnly).collect()), ticks)
                }
                Model::Network(networks) => Box::new(NetFleet::ensemble(&networks[0], &networks[1..])),
                Model::Onnx(network, inference) => {
                    Box::new(OnnxFleet::new(network, *inference, episode.sensing.geometry))
                }
                Model::Planner(planner) => {
                    let planner = shared.get_or_init(|| planner.planner(&PlannerContext::of(episode)));
                    smoothed(OneDriverEach(vec![SensorsOnly(planner.clone()); cars]), ticks)
                }
                Model::Callback(callback) => smoothed(callback.fleet(cars), ticks),
            }
        }
    }
}

fn smoothed(fleet: impl Fleet + Send + 'static, ticks: f32) -> Box<dyn Fleet + Send> {
    if ticks > 0.0 { Box::new(SmoothedFleet::new(fleet, ticks)) } else { Box::new(fleet) }
}

/// A fresh expert for an episode with this seed.
pub fn expert(settings: &ExpertSettings, episode: &EpisodeSettings, seed: RootSeed) -> ScriptedExpert {
    ScriptedExpert::new(settings.clone(), episode, hand(seed))
}

/// The stream of the expert's label jitter in an episode of an evaluation with this seed.
pub fn hand(seed: RootSeed) -> Rng {
    seed.rng(Stream::Expert, 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use policy::network::Weights;
    use sim::controller::SpeedLaw;
    use sim::driver::{GroundTruth, Seat, Situation};
    use sim::map::Map;
    use sim::scenario::Scenario;
    use sim::seed::RootSeed;
    use sim::sensing::Observation;
    use sim::vehicle::VehicleState;

    /// `net:DIR` has no run whose settings could be taken: the default preset's must not drive it at another speed.
    #[test]
    fn a_network_does_not_silently_drive_with_another_speed_law() {
        let mut settings = Settings::preset("smoke").unwrap();
        let weights = Weights::init(settings.dagger.network, RootSeed(1), 0);
        let conditions = Conditions::of(&settings.episode);
        let folder = std::env::temp_dir().join(format!("lotpilot-conditions-{}", std::process::id()));
        Checkpoint { weights, conditions, inference: settings.dagger.inference }.save(&folder).unwrap();
        let driver = format!("net:{}", folder.display()).parse::<DriverSpec>().unwrap().load(&settings).unwrap();
        driver.check(&settings).unwrap();
        settings.episode.controller.speed_law = SpeedLaw::Halved;
        let error = driver.check(&settings).unwrap_err().to_string();
        for part in ["net:", "speed_law = \"full\" (here \"halved\")", "--config RUN", "untrained_conditions=true"] {
            assert!(error.contains(part), "{error}");
        }
        settings.evaluation.untrained_conditions = true;
        driver.check(&settings).unwrap();
        settings.episode.sensing.geometry.side_m = 10.0;
        let error = driver.check(&settings).unwrap_err().to_string();
        assert!(error.contains("side_m = 12 (here 10)") && !error.contains("untrained"), "another patch: {error}");
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn every_driver_can_be_smoothed_and_a_network_unsmoothed() {
        let mut settings = Settings::preset("smoke").unwrap();
        let weights = Weights::init(settings.dagger.network, RootSeed(1), 0);
        let inference = settings.dagger.inference;
        let checkpoint = Checkpoint { weights, conditions: Conditions::of(&settings.episode), inference };
        let network = NamedDriver::network("network", DriverSpec::Expert, checkpoint);
        let ticks = |driver: &NamedDriver| match &driver.model {
            Model::Network(networks) => networks[0].inference.smoothing_ticks,
            Model::Onnx(_, inference) => inference.smoothing_ticks,
            Model::Expert(_) | Model::GridExpert(_) | Model::Planner(_) | Model::Callback(_) => driver.smoothing_ticks,
        };
        for (smoothing, of_planner, of_network) in [
            (Smoothing::Own, 0.0, inference.smoothing_ticks),
            (Smoothing::Ticks(0.0), 0.0, 0.0),
            (Smoothing::Ticks(8.0), 8.0, 8.0),
        ] {
            settings.evaluation.smoothing = smoothing;
            let planner = "vvf".parse::<DriverSpec>().unwrap().load(&settings).unwrap();
            let smoothed = network.clone().smoothed(smoothing);
            assert_eq!((ticks(&planner), ticks(&smoothed)), (of_planner, of_network));
            assert_eq!(smoothed.digest(), network.digest(), "its files are the same");
        }
    }

    /// A wall to the left, then to the right: a smoothed planner has not yet turned when the plain one has.
    #[test]
    fn a_smoothed_planner_follows_with_a_lag() {
        let settings = Settings::preset("smoke").unwrap();
        let map = Map::build(Scenario::lane(-20.0..=60.0, 9.0, -5.0..=50.0), &settings.episode.vehicle).unwrap();
        let planner = NamedDriver::planner(PlannerSpec::named("tentacle").unwrap());
        let left_m = |smoothing: Smoothing| {
            let smoothed = planner.clone().smoothed(smoothing);
            let mut fleet = smoothed.seating(&settings.episode)(&[RootSeed(1)]);
            let truth = GroundTruth { map: &map, vehicle: VehicleState::at_rest(map.start()), progress_m: 0.0 };
            let masks = [!0 << 13, (1 << 12) - 1];
            masks.map(|mask| {
                let mut observation = Observation::default();
                (8..14).for_each(|row| observation.grid.occupy_row(row, mask));
                let seat =
                    Seat { episode: 0, was_reset: false, situation: Situation { observation: &observation, truth } };
                let mut decisions = Vec::new();
                fleet.decide(&[seat], &mut decisions);
                decisions[0].look_ahead.left_m
            })
        };
        let (plain, smoothed) = (left_m(Smoothing::Own), left_m(Smoothing::Ticks(8.0)));
        assert!((plain[0] - smoothed[0]).abs() < 1e-4, "the first answer is taken at once");
        assert!(plain[1] < smoothed[1] && smoothed[1] < smoothed[0], "{plain:?} and {smoothed:?}");
    }

    /// The first one's controller and smoothing would drive the others, which were trained with their own.
    #[test]
    fn members_of_an_ensemble_that_were_trained_otherwise_are_refused() {
        let settings = Settings::preset("smoke").unwrap();
        let folder = std::env::temp_dir().join(format!("lotpilot-members-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let network = |name: &str, seed: u64, change: fn(&mut Checkpoint)| {
            let weights = Weights::init(settings.dagger.network, RootSeed(seed), 0);
            let (conditions, inference) = (Conditions::of(&settings.episode), settings.dagger.inference);
            let mut checkpoint = Checkpoint { weights, conditions, inference };
            change(&mut checkpoint);
            checkpoint.save(&folder.join(name)).unwrap();
            format!("net:{}", folder.join(name).display())
        };
        let first = network("first", 1, |_| {});
        let load = |other: &str| format!("ensemble:{first},{other}").parse::<DriverSpec>().unwrap().load(&settings);
        load(&network("second", 2, |_| {})).unwrap();
        for other in [
            network("steady", 3, |checkpoint| checkpoint.inference.smoothing_ticks += 1.0),
            network("slow", 4, |checkpoint| checkpoint.conditions.controller.speed_law = SpeedLaw::Halved),
        ] {
            let error = format!("{:#}", load(&other).unwrap_err());
            assert!(
                error.contains(&format!("{other} was trained or drives with other settings than {first}")),
                "{error}"
            );
        }
        std::fs::remove_dir_all(folder).unwrap();
    }
}
