//! `visualise`: lots, drives, failures and trainings as Rerun recordings.
//!
//! | file | what |
//! |---|---|
//! | [`drive`] | a drive as shapes and signals, frame by frame |
//! | [`lot`] | a lot as shapes |
//! | [`sensors`] | the views behind a grid |
//! | [`training`] | the curves of a training |
//! | [`live`] | `--record`: some runs of an evaluation or a training while it goes on |
//! | [`layout`], [`legend`], [`colours`] | the first look |

pub mod colours;
pub mod drive;
pub mod layout;
pub mod legend;
pub mod live;
pub mod lot;
pub mod sensors;
pub mod training;

use crate::cli::{EpisodeArgs, EvaluateArgs, FailuresArgs, LayerArgs, SinkArgs, VisualiseArgs, VisualiseLotArgs, What};
use crate::drivers::DriverSpec;
use crate::evaluate;
use crate::interrupt;
use crate::lots::Lot;
use crate::progress::Work;
use crate::recorder::{RERUN_VERSION, Recorder};
use crate::replay_key::ReplayKey;
use crate::report;
use crate::settings::Settings;
use crate::trials::{self, Purpose, Trial};
use anyhow::{Context as _, ensure};
use drive::{Detail, Drive};
use protocol::{Header, Layout, Mark, Message, Shape, Sink};
use sim::batch::run_lockstep_until;
use sim::driver::Source;
use sim::episode::Episode;
use sim::map::Map;
use sim::scenario::Direction;
use sim::seed::RootSeed;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Seconds before and after a moment of interest that are played again and again.
const FOCUS_S: [f64; 2] = [6.0, 3.0];
/// Seconds before and after a moment of interest that are recorded.
const AROUND_S: [f64; 2] = [10.0, 5.0];

/// The command.
///
/// # Errors
/// If something named does not exist, the recorder cannot be built, or the recording cannot be written.
pub fn run(args: &VisualiseArgs) -> anyhow::Result<()> {
    match &args.what {
        What::Lot(lot) => of_lot(lot, &args.sink),
        What::Episode(episode) => of_episode(episode, &args.sink),
        What::Replay(replay) => of_key(&replay.key.parse()?, &replay.layers, &args.sink),
        What::Run(run) => of_run(&run.run, &args.sink),
        What::Failures(failures) => of_failures(failures, &args.sink),
    }
}

fn of_lot(args: &VisualiseLotArgs, sink: &SinkArgs) -> anyhow::Result<()> {
    let settings = Settings::resolve(&LayerArgs::default(), None)?;
    let lots = Lot::parse_all(std::slice::from_ref(&args.lot))?;
    let lot = only(&lots, &args.lot)?;
    let seed = trials::trial_seed(RootSeed(args.seed), Purpose::Pictures, 0);
    let map = Trial { lot, direction: Direction::Forward, trial: 0, seed }.map(&settings.episode)?;
    let name = format!("{} seed {}", lot.name(), args.seed);
    let target = Target::of(sink, &format!("lot-{}-s{}", lot.name(), args.seed))?;
    let header = target.header("lot", name, layout::of_lot(&map), None);
    let mut recorder = Recorder::start()?;
    recorder.send(Message::Begin { recording: 0, header: Box::new(header) });
    recorder.send(Message::Always { recording: 0, marks: lot_marks(&map, legend::LOT) });
    recorder.finish()?;
    target.report()
}

/// The only lot that a spec stands for.
fn only<'a>(lots: &'a [Lot], spec: &str) -> anyhow::Result<&'a Lot> {
    let [lot] = lots else {
        anyhow::bail!("lot {spec:?}: {} lots are named so; name one, as in test-hard-7", lots.len())
    };
    Ok(lot)
}

fn lot_marks(map: &Map, legend: &str) -> Vec<Mark> {
    let mut marks = lot::marks(map);
    marks.push(Mark::new("legend", Shape::Document(legend.to_owned())));
    marks
}

fn of_episode(args: &EpisodeArgs, sink: &SinkArgs) -> anyhow::Result<()> {
    let asked = EvaluateArgs {
        drivers: args.drivers.clone(),
        lots: vec![args.lot.clone()],
        trials: Some(args.trial + 1),
        noise: args.noise.iter().cloned().collect(),
        seed: args.seed,
        layers: args.layers.clone(),
        ..EvaluateArgs::default()
    };
    let (settings, _) = evaluate::resolve(&asked)?;
    let contestants = DriverSpec::parse_all(&args.drivers)?;
    let noise = settings.evaluation.noise[0];
    ensure!(settings.evaluation.noise.len() == 1, "--noise: name one level; a recording shows one");
    let direction = if args.reverse { Direction::Reverse } else { Direction::Forward };
    let lots = Lot::parse_all(&settings.evaluation.lots)?;
    let lot = only(&lots, &args.lot)?;
    let seed = trials::trial_seed(settings.evaluation.seed, Purpose::Evaluation, args.trial);
    let job = Trial { lot, direction, trial: args.trial, seed };
    let episode = start(&job, &settings, noise)?;
    let name = format!(
        "{}, {}, trial {}, {noise}: {}",
        lot.name(),
        report::name(direction),
        args.trial,
        args.drivers.join(", ")
    );
    let file = format!("{}-{}-t{}", lot.name(), report::name(direction), args.trial);
    let show = Show { settings: &settings, contestants: &contestants, episode: &episode, focus_tick: None, name };
    show.record(sink, &file)
}

/// The run of a replay key.
struct Replay {
    settings: Settings,
    contestants: Vec<DriverSpec>,
    episode: Episode,
    lot: String,
}

impl Replay {
    fn of(key: &ReplayKey, settings: Settings) -> anyhow::Result<Self> {
        let contestants = DriverSpec::parse_all(std::slice::from_ref(&key.driver))?;
        let lots = Lot::parse_all(std::slice::from_ref(&key.lot))?;
        let lot = only(&lots, &key.lot)?;
        let seed = trials::trial_seed(key.seed, Purpose::Evaluation, key.trial);
        let job = Trial { lot, direction: key.direction, trial: key.trial, seed };
        let episode = start(&job, &settings, key.noise)?;
        Ok(Self { lot: lot.name().to_owned(), settings, contestants, episode })
    }

    fn show(&self, focus_tick: Option<u32>, name: String) -> Show<'_> {
        Show { settings: &self.settings, contestants: &self.contestants, episode: &self.episode, focus_tick, name }
    }
}

fn of_key(key: &ReplayKey, layers: &LayerArgs, sink: &SinkArgs) -> anyhow::Result<()> {
    let asked = EvaluateArgs {
        drivers: vec![key.driver.clone()],
        lots: vec![key.lot.clone()],
        seed: Some(key.seed.0),
        layers: layers.clone(),
        ..EvaluateArgs::default()
    };
    let replay = Replay::of(key, evaluate::resolve(&asked)?.0)?;
    let file = format!("replay-{}-{}-t{}-{}", replay.lot, report::name(key.direction), key.trial, key.tick);
    replay.show((key.tick > 0).then_some(key.tick), key.to_string()).record(sink, &file)
}

fn of_run(run: &Path, sink: &SinkArgs) -> anyhow::Result<()> {
    let (always, moments) = training::read(run)?;
    let name = run.file_name().map_or_else(|| "run".to_owned(), |name| name.to_string_lossy().into_owned());
    let target = Target::of(sink, &format!("run-{}", root_of(&name)))?;
    let header = target.header("training", name, layout::of_training(true), None);
    let mut recorder = Recorder::start()?;
    let header = Header { timeline: "step".to_owned(), ..header };
    recorder.send(Message::Begin { recording: 0, header: Box::new(header) });
    recorder.send(Message::Always { recording: 0, marks: always });
    for (clock, marks) in moments {
        recorder.send(Message::At { recording: 0, clock, marks });
    }
    recorder.finish()?;
    target.report()
}

/// One near-collision of `failures.jsonl`: what is needed to see it again.
#[derive(serde::Deserialize)]
struct Failed {
    replay: String,
    cause: String,
}

/// Near-collisions of an evaluation, a recording each, of the seconds around it.
fn of_failures(args: &FailuresArgs, sink: &SinkArgs) -> anyhow::Result<()> {
    let list = args.run.join("failures.jsonl");
    let text = std::fs::read_to_string(&list)
        .with_context(|| format!("{}: not the folder of a finished evaluation", list.display()))?;
    let failures: Vec<Failed> =
        text.lines().map(serde_json::from_str).collect::<Result<_, _>>().with_context(|| list.display().to_string())?;
    ensure!(!failures.is_empty(), "{}: there is no near-collision in it, so there is nothing to see", list.display());
    ensure!(sink.out.is_none(), "--out: every failure is a file of its own, in {}/recordings", args.run.display());
    let settings = crate::run_dir::settings_of(&args.run)?;
    let mut recorder = Recorder::start()?;
    let mut targets = Vec::new();
    for (recording, failed) in failures.iter().take(args.limit).enumerate() {
        let key: ReplayKey = failed.replay.parse()?;
        let replay = Replay::of(&key, settings.clone())?;
        let name = format!("failure-{:03}-{}-{}", recording + 1, replay.lot, root_of(&failed.cause));
        let file = args.run.join("recordings").join(format!("{name}.rrd"));
        let target = Target::of(&SinkArgs { out: Some(file), ..sink.clone() }, &name)?;
        let show = replay.show(Some(key.tick), format!("{}: {}", failed.cause, failed.replay));
        show.send(&target, recording as u32, &mut recorder)?;
        targets.push(target);
        if interrupt::is_requested() {
            break;
        }
    }
    recorder.finish()?;
    let left = failures.len() - targets.len();
    if left > 0 {
        println!("{left} more near-collisions are in {}; see them with --limit {}", list.display(), failures.len());
    }
    targets.iter().try_for_each(Target::report)
}

fn start(job: &Trial<'_>, settings: &Settings, noise: crate::settings::NoiseChoice) -> anyhow::Result<Episode> {
    let map = Arc::new(job.map(&settings.episode)?);
    let config = Arc::new(trials::episode_config(settings, noise, &map));
    Ok(Episode::new(config, map, job.episode_seed()))
}

/// The same episode, driven by each of several drivers.
struct Show<'a> {
    settings: &'a Settings,
    contestants: &'a [DriverSpec],
    episode: &'a Episode,
    /// Moment of interest.
    focus_tick: Option<u32>,
    name: String,
}

impl Show<'_> {
    fn record(self, sink: &SinkArgs, file: &str) -> anyhow::Result<()> {
        let target = Target::of(sink, file)?;
        let mut recorder = Recorder::start()?;
        self.send(&target, 0, &mut recorder)?;
        recorder.finish()?;
        target.report()
    }

    /// Drives, and records the ticks around the moment of interest, or all.
    fn send(&self, target: &Target, recording: u32, recorder: &mut Recorder) -> anyhow::Result<()> {
        self.contestants.iter().try_for_each(|contestant| contestant.check(self.settings))?;
        let map = self.episode.map();
        let names: Vec<&str> = self.contestants.iter().map(|contestant| contestant.name.as_str()).collect();
        let roots = roots_of(&names);
        let focus_s = self.focus_tick.map(|tick| {
            let at_s = f64::from(tick) * f64::from(self.episode.settings().control_period_s());
            [(at_s - FOCUS_S[0]).max(0.0), at_s + FOCUS_S[1]]
        });
        let layout = layout::of_drives(map, &roots, Detail::Everything);
        let header = target.header("drive", self.name.clone(), layout, focus_s);
        recorder.send(Message::Begin { recording, header: Box::new(header) });
        recorder.send(Message::Always { recording, marks: lot_marks(map, legend::DRIVE) });
        for (index, root) in roots.iter().enumerate() {
            self.drive(index, root, recording, recorder);
        }
        recorder.send(Message::End { recording });
        Ok(())
    }

    /// First and last tick to record. The viewer begins where a recording does: not long before what is to be seen.
    fn ticks(&self) -> [u32; 2] {
        let control_period_s = f64::from(self.episode.settings().control_period_s());
        let [before, after] = AROUND_S.map(|seconds| (seconds / control_period_s) as u32);
        self.focus_tick.map_or([0, u32::MAX], |tick| [tick.saturating_sub(before), tick.saturating_add(after)])
    }

    fn drive(&self, index: usize, root: &str, recording: u32, recorder: &mut Recorder) {
        let contestant = &self.contestants[index];
        let [first, last] = self.ticks();
        let drive = Drive::new(root, self.episode, self.settings, Detail::Everything);
        let mut drive = drive.with_planner(contestant.planner(self.settings));
        if self.contestants.len() > 1 {
            let sources: Vec<Source> = self.contestants.iter().map(DriverSpec::source).collect();
            drive = drive.among_others(colours::of_drivers(&sources)[index]);
        }
        recorder.send(Message::Always { recording, marks: drive.always() });
        let mut work = Work::begin(format!("driving: {}", contestant.name));
        let mut fleet = contestant.fleet(self.settings, 1);
        let length_m = self.episode.map().path().length_m();
        let reports = run_lockstep_until(vec![self.episode.clone()], &mut *fleet, &mut |_, frame| {
            if frame.tick < first {
                drive.skip(frame);
            } else {
                let (clock, marks) = drive.frame(frame);
                recorder.send(Message::At { recording, clock, marks });
            }
            work.at(f64::from(frame.progress_m / length_m), || format!("{:.0} m", frame.progress_m));
            let is_over = frame.tick >= last || interrupt::is_requested();
            if is_over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        let result = reports[0].as_ref().map_or_else(
            || "recorded".to_owned(),
            |report| {
                let metrics = &report.metrics;
                let (events, ratio) = (metrics.near_collisions, metrics.safe_ratio);
                format!("{length_m:.0} m, {events} near-collisions, safe ratio {ratio:.2}")
            },
        );
        work.end(&result);
    }
}

/// The entities of several drivers: short names, for they are titles; the folder of a run, if that tells it from the others.
fn roots_of(names: &[&str]) -> Vec<String> {
    let short = |name: &str| {
        let folder = name.strip_prefix("run:").or_else(|| name.strip_prefix("net:"));
        root_of(folder.and_then(|folder| Path::new(folder).file_name()?.to_str()).unwrap_or(name))
    };
    let all: Vec<String> = names.iter().map(|name| short(name)).collect();
    let is_alone = |root: &String| all.iter().filter(|other| *other == root).count() == 1;
    names.iter().zip(&all).map(|(name, root)| if is_alone(root) { root.clone() } else { root_of(name) }).collect()
}

/// The entity under which a driver is found: its name, without what means something in a path.
pub(crate) fn root_of(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' }).collect()
}

/// Where a recording goes.
struct Target {
    sink: Sink,
    file: Option<PathBuf>,
}

impl Target {
    /// `name`: of the file, unless the command line says otherwise.
    fn of(args: &SinkArgs, name: &str) -> anyhow::Result<Self> {
        if args.spawn {
            return Ok(Self { sink: Sink::Spawn, file: None });
        }
        if let Some(url) = &args.connect {
            return Ok(Self { sink: Sink::Connect((!url.is_empty()).then(|| url.clone())), file: None });
        }
        let file = args.out.clone().unwrap_or_else(|| Path::new("recordings").join(format!("{name}.rrd")));
        let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        std::fs::create_dir_all(folder)
            .with_context(|| format!("{}: cannot be created; choose a file with --out", folder.display()))?;
        Ok(Self { sink: Sink::File(file.display().to_string()), file: Some(file) })
    }

    fn header(&self, application: &str, name: String, layout: Layout, focus_s: Option<[f64; 2]>) -> Header {
        let application = format!("parking-lot-{application}");
        let timeline = "sim_time".to_owned();
        Header { application, name, sink: self.sink.clone(), layout, timeline, focus_s }
    }

    /// What to do with it.
    fn report(&self) -> anyhow::Result<()> {
        if let Some(file) = &self.file {
            let bytes = std::fs::metadata(file).with_context(|| file.display().to_string())?.len();
            println!("written: {} ({:.1} MB)", file.display(), bytes as f64 / 1e6);
            println!("open it: {}", viewer_hint(&file.display().to_string()));
        }
        Ok(())
    }
}

/// How to open a recording, with a remedy if the viewer is missing or another version.
pub fn viewer_hint(what: &str) -> String {
    let install = format!("pip install rerun-sdk=={RERUN_VERSION}");
    let found = std::process::Command::new("rerun").arg("--version").output();
    let said = found.ok().filter(|output| output.status.success()).map(|output| output.stdout);
    let version = said.as_deref().map(String::from_utf8_lossy);
    // It says: rerun_py 0.36.3 (release) [rustc …
    match version.as_deref().and_then(|said| said.split_whitespace().nth(1)) {
        Some(RERUN_VERSION) => format!("rerun {what}"),
        Some(other) => {
            format!(
                "the viewer installed here is {other}, the recording is of {RERUN_VERSION}: {install} && rerun {what}"
            )
        }
        None => format!("no viewer is installed here: {install} && rerun {what}"),
    }
}

#[cfg(test)]
mod tests;
