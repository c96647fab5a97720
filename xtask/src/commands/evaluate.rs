//! `evaluate`: drivers × lots × directions × trials × noise levels.

use crate::args::{Directions, JsonArgs, LayerArgs, OutArgs, lot_name, noise_levels, run_folder};
use crate::build_info;
use crate::console::Console;
use crate::interrupt;
use crate::output::Output;
use crate::record::{self, RecordArgs};
use anyhow::{Context as _, anyhow, ensure};
use clap::Args;
use evaluation::estimate;
use evaluation::plan::Plan;
use evaluation::results::EvaluationResults;
use evaluation::shards::ShardRecord;
use evaluation::summary::Summary;
use evaluation::trainings::{self, Methods};
use experiment::drivers::{self, DriverSpec, NamedDriver};
use experiment::inputs;
use experiment::lots::Lot;
use experiment::manifest::{Outcome, Request};
use experiment::notes;
use experiment::progress::{Interrupted, Progress};
use experiment::run_dir::RunDir;
use experiment::settings::{Layers, Settings, Smoothing};
use experiment::shard::Shard;
use scenarios::LoadError;
use serde::{Deserialize, Serialize};
use sim::seed::RootSeed;
use std::path::{Path, PathBuf};

pub(crate) const COMMAND: &str = "evaluate";

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask evaluate --driver expert --lots lot-a --trials 2
  cargo xtask evaluate --driver run:runs/train-dagger-default-s1/bc --driver run:runs/train-dagger-default-s1
  cargo xtask evaluate --driver net:runs/train-dagger-default-s1/round-03 --lots lot-b --noise hard --out runs/hard
  cargo xtask evaluate --driver expert trained:default --noise sweep --lots test:100
  cargo xtask evaluate --driver run:runs/s1 --lots sealed:mine:4800:all --trials 1 --shard 2/16 --out shards/2
  cargo xtask evaluate --driver onnx:mine-{1,2,3}.onnx run:runs/s{1,2,3} --method 'mine=onnx:mine-*' --lots test:100
  cargo xtask evaluate --resume runs/hard";

#[derive(Debug, Clone, Args)]
pub(crate) struct EvaluateArgs {
    /// Drivers, one or more; may be repeated. See `cargo xtask drivers`. The settings of the first `run:DIR` are used
    /// unless `--config` or `--preset` names others.
    #[arg(long = "driver", value_name = "SPEC", required_unless_present = "resume", num_args = 1..)]
    drivers: Vec<String>,
    /// Lots to drive; see `cargo xtask lots` [default: the setting evaluation.lots].
    #[arg(long, alias = "lot", value_name = "SPEC", num_args = 1.., value_delimiter = ',', value_parser = lot_name)]
    lots: Vec<String>,
    /// Trials per lot and direction; each draws its own obstacles and noise [default: the setting evaluation.trials].
    #[arg(long, value_name = "N")]
    trials: Option<u32>,
    /// Directions in which to drive the lots [default: the setting evaluation.directions].
    #[arg(long, alias = "direction", value_name = "WAY")]
    directions: Option<Directions>,
    /// Sensor noise: clean, paper, hard, lot (as the lot asks for) or multiples of paper; several are compared,
    /// `sweep` stands for 0,0.5,1,1.5,2 [default: the setting evaluation.noise].
    #[arg(long, alias = "level", value_name = "LEVEL", num_args = 1.., value_delimiter = ',')]
    noise: Vec<String>,
    /// Action smoothing of every driver: `own` (networks as they were trained, planners none), or a time constant in
    /// control ticks for all, 0 = none [default: the setting evaluation.smoothing].
    #[arg(long, value_name = "TICKS")]
    smoothing: Option<Smoothing>,
    /// Driver to compare the others with [default: the last network, else the first driver].
    #[arg(long, value_name = "SPEC")]
    compare_with: Option<String>,
    #[command(flatten)]
    methods: MethodArgs,
    /// Seed of obstacles and noise of the trials, not of a training [default: the setting evaluation.seed].
    #[arg(long)]
    seed: Option<u64>,
    /// Drives only a share of the trials, for one of several machines (docs/cluster.md); `merge` puts the shares
    /// together.
    #[arg(long, value_name = "NUMBER/OF", conflicts_with_all = ["record", "json"])]
    shard: Option<Shard>,
    #[command(flatten)]
    pub(crate) json: JsonArgs,
    #[command(flatten)]
    layers: LayerArgs,
    #[command(flatten)]
    out: OutArgs,
    /// Continues an interrupted evaluation with its own drivers and settings, to the same result.
    #[arg(
        long,
        value_name = "RUN", value_parser = run_folder(),
        conflicts_with_all = [
            "drivers", "lots", "trials", "directions", "noise", "compare_with", "methods", "seed", "shard", "preset", "config",
            "overrides", "out", "overwrite", "smoothing"
        ]
    )]
    resume: Option<PathBuf>,
    #[command(flatten)]
    record: RecordArgs,
}

impl EvaluateArgs {
    /// Refuses what is of whole evaluations, for one that turns out to be a shard.
    fn check_shard(&self, shard: Shard) -> anyhow::Result<()> {
        ensure!(
            self.record.record.is_none(),
            "--record: this is shard {shard}, of which nothing is recorded; leave it out, and see drives of the merged evaluation \
             with cargo xtask visualise"
        );
        ensure!(
            !self.json.json,
            "--json: this is shard {shard}, which has no tables; leave it out, merge --json prints them"
        );
        Ok(())
    }
}

/// Which drivers are trainings of one method.
#[derive(Debug, Clone, Args)]
pub(crate) struct MethodArgs {
    /// Drivers that are trainings of one method, three or more, to be judged together as well: its name, and a pattern of
    /// theirs (`*` stands for anything but a slash, `?` for one character); may be repeated. Three or more other trainings (`run:DIR`)
    /// that differ by nothing but their seed are found without it.
    #[arg(long = "method", value_name = "NAME=DRIVERS")]
    pub(crate) methods: Vec<String>,
}

impl MethodArgs {
    pub(crate) fn is_empty(&self) -> bool {
        self.methods.is_empty()
    }

    /// Finds the drivers that are meant, else those of `others`, and says so to them.
    ///
    /// # Errors
    /// See [`trainings::methods`] and [`trainings::assign`].
    pub(crate) fn or(&self, others: Methods, drivers: &mut [NamedDriver]) -> anyhow::Result<Methods> {
        if self.is_empty() {
            trainings::assign(&others, drivers).context("what was named before; name methods anew with --method")?;
            return Ok(others);
        }
        let methods = trainings::methods(&self.methods, drivers).context("--method")?;
        trainings::assign(&methods, drivers).context("--method")?;
        Ok(methods)
    }
}

/// What an evaluation was asked for besides its settings.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Asked {
    pub(crate) drivers: Vec<String>,
    /// An index of the drivers.
    pub(crate) compare_with: usize,
    #[serde(default, skip_serializing_if = "Methods::is_empty")]
    pub(crate) methods: Methods,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) shard: Option<ShardRecord>,
}

pub(crate) fn run(args: &EvaluateArgs, output: &Output) -> anyhow::Result<()> {
    let (settings, mut asked, begun) = if let Some(path) = &args.resume {
        let (run, settings, manifest) = build_info::resume(path, COMMAND, output)?;
        let asked: Asked = manifest.arguments.clone().try_into().with_context(|| path.display().to_string())?;
        asked.shard.as_ref().map_or(Ok(()), |record| args.check_shard(record.number))?;
        (settings, asked, Ok((run, manifest)))
    } else {
        let specs = DriverSpec::parse_all(&args.drivers)?;
        let asked = Asked {
            drivers: args.drivers.clone(),
            compare_with: compare_with(args.compare_with.as_deref(), &specs)?,
            methods: Methods::new(),
            shard: None,
        };
        let (mut settings, preset) = settings_for(&specs, &Layers::from(&args.layers), output)?;
        override_trials(&mut settings, args)?;
        (settings, asked, Err(preset))
    };
    let mut drivers = NamedDriver::load_all(&asked.drivers, &settings)?;
    asked.methods = args.methods.or(asked.methods, &mut drivers)?;
    let lots = Lot::parse_all(&settings.evaluation.lots, &settings.episode.vehicle)?;
    output.notes(&notes::of(&lots, &settings.evaluation.noise));
    let shard = args.shard.or(asked.shard.as_ref().map(|record| record.number));
    let plan = Plan { settings: &settings, drivers: &drivers, lots: &lots, compare_with: asked.compare_with, shard };
    check(&plan)?;
    args.record.record.map_or(Ok(()), |runs| record::check(&plan, runs))?;
    let inputs = inputs::of(&lots, &drivers);
    let run = match begun {
        Ok((run, manifest)) => {
            manifest.check_inputs(&inputs)?;
            run
        }
        Err(preset) => {
            asked.shard = ShardRecord::of(&plan)?;
            let mut reads = inputs::places(&lots, &drivers);
            reads.extend(args.layers.file().map(Path::to_owned));
            let request = Request { arguments: toml::Table::try_from(&asked)?, inputs, reads };
            RunDir::create(&args.out.place(COMMAND, &preset, settings.evaluation.seed.0), &settings, &request)?
        }
    };
    interrupt::can_resume(COMMAND, run.path());
    let console = Console::new(output);
    let mut tasks = tasks(&settings, drivers.len());
    // A shard has no report.
    tasks.truncate(if shard.is_some() { 1 } else { tasks.len() });
    console.plan(tasks);
    if let Some(shard) = shard {
        drive(&plan, &run, &console)?;
        run.finish(Outcome::Evaluation { drivers: asked.drivers })?;
        let folder = run.path().display();
        output.note(format_args!("written: {folder}: shard {shard}; put all together with cargo xtask merge DIR..."));
        return Ok(());
    }
    finish(&plan, &run, &console, output)?;
    console.report_time();
    let runs = args.record.record;
    runs.map_or(Ok(()), |runs| record::record(run.path(), vec![record::first_runs(&plan, runs)], output))
}

/// Drives what a run has not driven yet, and writes all of its files.
///
/// # Errors
/// See [`measure`].
pub(crate) fn finish(plan: &Plan<'_>, run: &RunDir, console: &Console, output: &Output) -> anyhow::Result<()> {
    measure(plan, run, console, output)?;
    report::run_report::write(run, console)?;
    run.finish(Outcome::Evaluation { drivers: plan.drivers.iter().map(|driver| driver.spec.to_string()).collect() })?;
    output.note(format_args!(
        "written: {}/report.html, summary.md, .json, .csv, runs.jsonl and failures.md, .jsonl",
        run.path().display()
    ));
    Ok(())
}

/// Drives the plan, writes and prints the tables.
///
/// # Errors
/// If a lot cannot be built or a file cannot be written, or on Ctrl-C; what was driven by then is kept.
pub(crate) fn measure(plan: &Plan<'_>, run: &RunDir, progress: &dyn Progress, output: &Output) -> anyhow::Result<()> {
    let results = drive(plan, run, progress)?;
    let summary = Summary::new(plan, &results);
    summary.write(run)?;
    report::failures::write(run)?;
    let text = report::summary::write(&summary, run)?;
    output.table(|| format!("\n{text}"), &summary.tables())
}

/// Drives the plan; see [`measure`].
pub(crate) fn drive(plan: &Plan<'_>, run: &RunDir, progress: &dyn Progress) -> anyhow::Result<EvaluationResults> {
    let interrupted = || Interrupted { kept: format!("everything driven so far is in {}", run.path().display()) };
    Ok(evaluation::evaluate::evaluate(plan, run, progress)?.ok_or_else(interrupted)?)
}

/// The tasks of an evaluation with their estimated seconds.
fn tasks(settings: &Settings, drivers: usize) -> Vec<estimate::Task> {
    vec![estimate::evaluation(settings, drivers), estimate::report()]
}

/// What can be known to go wrong before the first step.
///
/// # Errors
/// If a lot can only be driven forward; the error names the flag that says so.
pub(crate) fn check(plan: &Plan<'_>) -> anyhow::Result<()> {
    plan.check().map_err(|error| or_forward(error, "--directions forward"))
}

/// Adds the flag that helps to the error of a lot that can only be driven forward.
pub(crate) fn or_forward(error: anyhow::Error, flag: &str) -> anyhow::Error {
    match error.downcast_ref::<LoadError>() {
        Some(LoadError::ForwardOnly { .. }) => anyhow!("{error:#}, or drive it forward only: {flag}"),
        _ => error,
    }
}

/// `--compare-with`, else the last network, else the first driver.
pub(crate) fn compare_with(wanted: Option<&str>, specs: &[DriverSpec]) -> anyhow::Result<usize> {
    let Some(wanted) = wanted else {
        return Ok(specs.iter().rposition(DriverSpec::is_network).unwrap_or(0));
    };
    let spec = wanted.parse::<DriverSpec>().ok();
    let found = specs.iter().position(|given| spec.as_ref().is_some_and(|spec| given.is_same_as(spec)));
    found.with_context(|| {
        let named: Vec<String> = specs.iter().map(DriverSpec::to_string).collect();
        format!("--compare-with {wanted}: is not one of the drivers; name one of {}", named.join(", "))
    })
}

/// The settings, and the name of what they start from: `--preset` or `--config` if given, else the first run that is
/// named as a driver, else the default preset.
///
/// # Errors
/// If something named does not exist, a training is not finished, or runs were trained with settings that differ.
pub(crate) fn settings_for(
    specs: &[DriverSpec],
    layers: &Layers,
    output: &Output,
) -> anyhow::Result<(Settings, String)> {
    specs.iter().try_for_each(DriverSpec::ensure_whole)?;
    let Some((of_run, path)) = drivers::settings_of_runs(specs, layers)? else {
        return Ok((Settings::resolve(layers, None)?, layers.preset_name().to_owned()));
    };
    output.note(format_args!("settings: those of {} (others: --config or --preset)", path.display()));
    Ok((Settings::resolve_over(&of_run, layers, None)?, "run".to_owned()))
}

fn override_trials(settings: &mut Settings, args: &EvaluateArgs) -> anyhow::Result<()> {
    let evaluation = &mut settings.evaluation;
    if let Some(seed) = args.seed {
        evaluation.seed = RootSeed(seed);
    }
    if !args.lots.is_empty() {
        evaluation.lots.clone_from(&args.lots);
    }
    evaluation.trials = args.trials.unwrap_or(evaluation.trials);
    if let Some(directions) = args.directions {
        evaluation.directions = directions.to_vec();
    }
    if !args.noise.is_empty() {
        evaluation.noise = noise_levels(&args.noise)?;
    }
    evaluation.smoothing = args.smoothing.unwrap_or(evaluation.smoothing);
    settings.name_lots_one_by_one();
    settings.check()
}
