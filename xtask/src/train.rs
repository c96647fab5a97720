//! `train-bc` and `train-dagger`.

use crate::cli::TrainArgs;
use crate::drivers::{self, DriverSpec};
use crate::evaluate::{self, NamedDriver, Plan};
use crate::interrupt::{self, Interrupted};
use crate::learning::Recorder;
use crate::lots::Lot;
use crate::progress::{Stopwatch, Work};
use crate::run_dir::{Place, RunDir};
use crate::settings::Settings;
use crate::table1::Table1;
use crate::trials::{self, Purpose, Trial};
use crate::visualise::drive::Detail;
use crate::visualise::live::{Live, View};
use crate::{learning, run_report};
use anyhow::Context as _;
use policy::checkpoint::Checkpoint;
use policy::dagger::{Hooks, Outcome, Progress, Stop};
use policy::dataset::store::Store;
use policy::drivers::NetPolicy;
use policy::fit::{FitProgress, FitReport};
use serde::Serialize;
use sim::driver::Source;
use sim::episode::Episode;
use sim::frame::Frame;
use std::cell::RefCell;
use std::ops::ControlFlow;
use std::path::Path;

/// Behaviour cloning alone: `DAgger` without an iteration.
///
/// # Errors
/// See [`dagger`].
pub fn bc(args: &TrainArgs) -> anyhow::Result<()> {
    train(args, "train-bc", |settings| {
        settings.dagger.iterations_max = 0;
        settings.dagger.iterations_min = 0;
    })
}

/// The main line.
///
/// # Errors
/// If something named does not exist, a file cannot be read or written, or by Ctrl-C.
pub fn dagger(args: &TrainArgs) -> anyhow::Result<()> {
    train(args, "train-dagger", |_| {})
}

fn train(args: &TrainArgs, command: &str, adjust: impl FnOnce(&mut Settings)) -> anyhow::Result<()> {
    let (run, settings) = if let Some(path) = &args.resume {
        RunDir::resume(path)?
    } else {
        let mut settings = Settings::resolve(&args.settings.layers, args.settings.seed)?;
        adjust(&mut settings);
        // Before the folder is claimed: a misspelt lot should not leave one behind.
        Lot::parse_all(&settings.training.lots)?;
        Lot::parse_all(&settings.evaluation.lots)?;
        let place = Place {
            out: args.out.as_deref(),
            overwrite: args.overwrite,
            command,
            preset: args.settings.layers.preset_name(),
            seed: settings.seed.0,
        };
        (RunDir::create(&place, &settings)?, settings)
    };
    eprintln!("run: {}", run.path().display());

    let mut stopwatch = Stopwatch::default();
    let mut live = args.record.map(|runs| Live::start(run.path(), runs)).transpose()?;
    let done = train_and_check(&settings, &run, args.no_eval, live.as_mut(), &mut stopwatch);
    if let Some(live) = live {
        live.finish();
    }
    let finished = done?;
    run_report::write(run.path(), &mut stopwatch)?;
    run.finish(&finished)?;
    print_next_steps(run.path());
    stopwatch.report();
    Ok(())
}

/// Trains, prints the paper's table and drives the check.
fn train_and_check(
    settings: &Settings,
    run: &RunDir,
    no_eval: bool,
    mut live: Option<&mut Live>,
    stopwatch: &mut Stopwatch,
) -> anyhow::Result<Finished> {
    let (policy, finished) =
        tabulated(settings, run, live.as_deref_mut(), stopwatch)?.map_err(|rounds| cut_short(run.path(), rounds))?;
    if !no_eval {
        let entries = entries(run, policy, finished.rounds)?;
        let lots = Lot::parse_all(&settings.evaluation.lots)?;
        let plan = Plan { settings, entries: &entries, lots: &lots, compare_with: entries.len() - 1 };
        plan.check()?;
        evaluate::measure(&plan, run, live, stopwatch)?;
    }
    Ok(finished)
}

/// Trains, prints and writes the paper's table. The inner error of a training cut short is the number of rounds that
/// were finished.
pub(crate) fn tabulated(
    settings: &Settings,
    run: &RunDir,
    live: Option<&mut Live>,
    stopwatch: &mut Stopwatch,
) -> anyhow::Result<Result<(Checkpoint, Finished), usize>> {
    let outcome = learn(settings, run, live, stopwatch)?;
    let table1 = Table1 { rows: &outcome.rows, stop: outcome.stop };
    println!("\nDAgger iterations\n\n{}", table1.to_markdown());
    table1.write(run)?;
    let (Stop::EtaReached | Stop::IterationCap, Some(policy)) = (outcome.stop, outcome.policy) else {
        return Ok(Err(outcome.rows.len()));
    };
    Ok(Ok((policy, Finished { stop: outcome.stop, rounds: outcome.rows.len() })))
}

/// How a training ended.
#[derive(Debug, Serialize)]
pub(crate) struct Finished {
    stop: Stop,
    rounds: usize,
}

fn cut_short(path: &Path, rounds: usize) -> anyhow::Error {
    let path = path.display();
    let kept = format!("{rounds} finished rounds are in {path}; go on with: cargo xtask train-dagger --resume {path}");
    Interrupted { kept }.into()
}

/// Expert, behaviour cloning and what became of it.
fn entries(run: &RunDir, policy: Checkpoint, rounds: usize) -> anyhow::Result<Vec<NamedDriver>> {
    let folder = run.path().display();
    let cloned = Checkpoint::load(&run.path().join("round-00")).context("behaviour cloning of this run")?;
    let mut entries = vec![
        NamedDriver { contestant: DriverSpec::expert(), spec: "expert".to_owned() },
        NamedDriver { contestant: DriverSpec::network("BC", cloned), spec: format!("run:{folder}/bc") },
    ];
    if rounds > 1 {
        entries.push(NamedDriver { contestant: DriverSpec::network("DAgger", policy), spec: format!("run:{folder}") });
    }
    Ok(entries)
}

fn print_next_steps(path: &Path) {
    let path = path.display();
    println!("\nPolicy: {path} (the last round; model.safetensors opens in PyTorch)");
    println!("Next:   cargo xtask evaluate --driver run:{path} --seed 2");
}

/// Data sampling and training, with bars.
fn learn(
    settings: &Settings,
    run: &RunDir,
    live: Option<&mut Live>,
    stopwatch: &mut Stopwatch,
) -> anyhow::Result<Outcome> {
    let lots = Lot::parse_all(&settings.training.lots)?;
    // A lot that cannot be driven is found here, with its error, not in the middle of a round.
    episodes_of(settings, &lots, 0)?;
    let store = Store::open(run.path())?;
    let monitor = RefCell::new(Monitor {
        stopwatch,
        work: None,
        ticks: Ticks::default(),
        store: store.clone(),
        learning: Recorder::default(),
        failed: None,
        live,
    });
    if let Some(live) = &mut monitor.borrow_mut().live {
        live.training();
    }
    let mut hooks = Hooks {
        episodes: &mut |round| {
            let episodes = episodes_of(settings, &lots, round)
                .unwrap_or_else(|error| panic!("round {round} of seed {:?}: {error:#}", settings.seed));
            monitor.borrow_mut().ticks = Ticks::of(&episodes);
            if let Some(live) = &mut monitor.borrow_mut().live {
                record(settings, &store, round, &episodes, live);
            }
            episodes
        },
        expert: &mut |round, episode| {
            // 2^20 rounds of 2^20 episodes, as in `trials`.
            let index = u64::from(round) << 20 | episode as u64;
            Box::new(drivers::expert(settings).with_jitter_seed(settings.seed, index))
        },
        on_frame: &mut |_, episode, frame| monitor.borrow_mut().frame(episode, frame),
        progress: &mut |progress| {
            let mut monitor = monitor.borrow_mut();
            monitor.progress(progress);
            if interrupt::is_requested() || monitor.failed.is_some() {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        },
    };
    let outcome = policy::dagger::run(&settings.dagger, &store, settings.seed, &mut hooks)?;
    let mut monitor = monitor.into_inner();
    monitor.end_work("stopped");
    if let (Some(fit), None) = (learning::report(&store.final_folder())?, &monitor.failed) {
        monitor.keep_curve(&store.final_folder(), &fit);
    }
    monitor.failed.map_or(Ok(outcome), Err)
}

/// Records the first runs of a round, with what the network that collects would do while the expert drives.
fn record(settings: &Settings, store: &Store, round: u32, episodes: &[Episode], live: &mut Live) {
    let collector = round.checked_sub(1).and_then(|before| Checkpoint::load(&store.round_folder(before)).ok());
    let novice = collector.map(|checkpoint| NetPolicy::new(checkpoint, settings.dagger.device));
    let name = |(i, episode): (usize, &Episode)| format!("run {i}, {}", episode.map().scenario().name);
    let names: Vec<String> = episodes.iter().enumerate().map(name).collect();
    let view = View { root: "dagger", detail: Detail::Everything, novice: novice.as_ref() };
    live.begin(&format!("round {round:02}"), settings, episodes, &names, &view);
}

/// Lots that draw their obstacles are driven `training.trials` times. A generated lot looks the same every time: it is
/// driven once, and the next round has other ones.
///
/// # Errors
/// If a lot cannot be driven.
pub fn episodes_of(settings: &Settings, lots: &[Lot], round: u32) -> anyhow::Result<Vec<Episode>> {
    let training = &settings.training;
    let (generated, others): (Vec<Lot>, Vec<Lot>) = lots.iter().cloned().partition(Lot::is_generated);
    let of_a_kind = |lot: &Lot| generated.iter().filter(|other| other.family() == lot.family()).count() as u64;
    let generated: Vec<Lot> = generated.iter().map(|lot| lot.in_round(round, of_a_kind(lot))).collect();
    let jobs =
        |lots, trials| Trial::all(settings.seed, Purpose::Training { round }, lots, trials, &training.directions);
    let jobs: Vec<_> = jobs(&others, training.trials).chain(jobs(&generated, 1)).collect();
    trials::episodes(&jobs, settings, training.noise)
}

/// Turns what is reported during a training into bars and seconds.
struct Monitor<'a> {
    stopwatch: &'a mut Stopwatch,
    work: Option<(Stretch, Work)>,
    ticks: Ticks,
    live: Option<&'a mut Live>,
    store: Store,
    learning: Recorder,
    /// A file that could not be written: ends the run at the next safe point.
    failed: Option<anyhow::Error>,
}

/// What the present bar is about.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Stretch {
    Collecting,
    Fitting,
}

/// Where the cars of a collection are.
#[derive(Default)]
struct Ticks {
    lengths_m: Vec<f32>,
    progress_m: Vec<f32>,
    novice: u64,
    all: u64,
}

impl Ticks {
    fn of(episodes: &[Episode]) -> Self {
        let lengths_m: Vec<f32> = episodes.iter().map(|episode| episode.map().path().length_m()).collect();
        Self { progress_m: vec![0.0; lengths_m.len()], lengths_m, novice: 0, all: 0 }
    }

    fn share(&self) -> f64 {
        f64::from(self.progress_m.iter().sum::<f32>() / self.lengths_m.iter().sum::<f32>().max(f32::MIN_POSITIVE))
    }
}

impl Monitor<'_> {
    fn frame(&mut self, episode: usize, frame: &Frame) {
        if let Some(live) = &mut self.live {
            live.frame(episode, frame);
        }
        let ticks = &mut self.ticks;
        ticks.progress_m[episode] = frame.progress_m;
        ticks.all += 1;
        ticks.novice += u64::from(frame.decision.source == Source::Novice);
        if let Some((_, work)) = &mut self.work {
            let per_s = ticks.all as f64 / work.seconds();
            let eta_hat = ticks.novice as f64 / ticks.all as f64;
            work.at(ticks.share(), || format!("η̂ {eta_hat:.2}, {per_s:.0} ticks/s"));
        }
    }

    fn progress(&mut self, progress: &Progress<'_>) {
        if let Some(live) = &mut self.live {
            live.progress(progress);
        }
        match *progress {
            Progress::Collecting { round, .. } => {
                self.work = Some((Stretch::Collecting, Work::begin(format!("round {round}: collecting"))));
            }
            Progress::Collected { round, collection, dataset } => {
                let eta = if round > 0 { format!(", η̂ {:.3}", collection.eta_hat()) } else { String::new() };
                self.end_work(&format!("{} samples, {dataset} in all{eta}", collection.samples));
            }
            Progress::Fitting { round, fit } => self.fitting(round, fit),
            Progress::Finished { row, fit } => {
                self.keep_curve(&self.store.round_folder(row.round), fit);
                let error_m = row.validation_rmse_m.map_or_else(String::new, |error| format!("{error:.3} m off"));
                self.end_work(&format!("validation {error_m}"));
            }
        }
    }

    fn keep_curve(&mut self, folder: &Path, fit: &FitReport) {
        self.failed = self.failed.take().or(self.learning.write(folder, fit).err());
    }

    fn fitting(&mut self, round: Option<u32>, fit: &FitProgress) {
        self.learning.step(fit);
        let (_, work) = self.work.get_or_insert_with(|| {
            let label = round.map_or_else(|| "final training".to_owned(), |round| format!("round {round}: training"));
            (Stretch::Fitting, Work::begin(label))
        });
        let per_s = fit.samples_done as f64 / work.seconds().max(1e-9);
        work.at(f64::from(fit.step) / f64::from(fit.steps), || {
            let validation = fit.validation.map_or_else(String::new, |at| format!(", validation {:.3} m", at.rmse_m));
            format!("loss {:.3}{validation}, {per_s:.0} samples/s", fit.loss.total)
        });
    }

    fn end_work(&mut self, result: &str) {
        if let Some((stretch, work)) = self.work.take() {
            let name = match stretch {
                Stretch::Collecting => "collecting",
                Stretch::Fitting => "training",
            };
            self.stopwatch.add(name, work.seconds());
            work.end(result);
        }
    }
}
