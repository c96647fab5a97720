//! `train-bc` and `train-dagger`.

use super::{evaluate, within};
use crate::args::{JsonArgs, LayerArgs, OutArgs, lot_name, run_folder};
use crate::build_info;
use crate::console::Console;
use crate::interrupt;
use crate::output::Output;
use crate::record::{self, RecordArgs};
use anyhow::{Context as _, ensure};
use clap::Args;
use evaluation::estimate;
use evaluation::names::{BC, BC_FINAL, DAGGER};
use evaluation::plan::Plan;
use evaluation::records;
use evaluation::table1::Table1;
use experiment::command_line::quoted;
use experiment::drivers::{DriverSpec, NamedDriver};
use experiment::inputs::{self, Inputs};
use experiment::lots::{self, Lot};
use experiment::manifest::{Outcome, Request};
use experiment::notes;
use experiment::progress::{Interrupted, Progress};
use experiment::run_dir::RunDir;
use experiment::settings::{EvaluationSettings, Layers, Settings};
use experiment::training;
use experiment::view_request::Show;
use policy::dagger::Stop;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use storage::sums;

pub(crate) const DAGGER_EXAMPLES: &str = "\
Examples:
  cargo xtask train-dagger --seed 2
  cargo xtask train-dagger --set dagger.eta=0.85 --set dagger.fit.budget.steps=2000
  cargo xtask train-dagger --also lots/my-map.toml
  cargo xtask train-dagger --resume runs/train-dagger-default-s1";

pub(crate) const BC_EXAMPLES: &str = "\
Examples:
  cargo xtask train-bc --seed 2
  cargo xtask train-bc --set training.trials=1 --no-eval
  cargo xtask evaluate --driver run:runs/train-bc-default-s1 --lots test:10";

#[derive(Debug, Clone, Args)]
pub(crate) struct TrainArgs {
    #[command(flatten)]
    layers: LayerArgs,
    /// Root seed of training data, weights and shuffling.
    #[arg(long)]
    seed: Option<u64>,
    /// Lots to drive in every round in addition to those of the settings: your own map, for example. See `cargo
    /// xtask lots`.
    #[arg(long, value_name = "SPEC", num_args = 1.., value_delimiter = ',', value_parser = lot_name)]
    also: Vec<String>,
    #[command(flatten)]
    out: OutArgs,
    /// Continues an interrupted run with its own settings, to the same result.
    #[arg(long, value_name = "RUN", value_parser = run_folder(), conflicts_with_all = ["preset", "config", "overrides", "seed", "also", "out", "overwrite"])]
    resume: Option<PathBuf>,
    /// Trains only: no closed-loop check at the end.
    #[arg(long)]
    no_eval: bool,
    #[command(flatten)]
    pub(crate) json: JsonArgs,
    #[command(flatten)]
    record: RecordArgs,
}

/// What a training was asked for besides its settings.
#[derive(Debug, Serialize, Deserialize)]
struct Asked {
    #[serde(default)]
    no_eval: bool,
}

/// Behaviour cloning alone: DAgger without an iteration.
pub(crate) fn bc(args: &TrainArgs, output: &Output) -> anyhow::Result<()> {
    let unused = Layers::from(&args.layers).overrides.into_iter().find(|it| it.starts_with("dagger.iterations_"));
    ensure!(unused.is_none(), "--set {}: train-bc has no iterations; train-dagger has", unused.unwrap_or_default());
    train(args, "train-bc", output, |settings| {
        settings.dagger.iterations_max = 0;
        settings.dagger.iterations_min = 0;
    })
}

pub(crate) fn dagger(args: &TrainArgs, output: &Output) -> anyhow::Result<()> {
    train(args, "train-dagger", output, |_| {})
}

fn train(args: &TrainArgs, command: &str, output: &Output, adjust: impl FnOnce(&mut Settings)) -> anyhow::Result<()> {
    let (run, settings, asked) = if let Some(path) = &args.resume {
        let (run, settings, manifest) = build_info::resume(path, command, output)?;
        manifest.check_inputs(&inputs(&settings)?)?;
        let asked: Asked = manifest.arguments.try_into().with_context(|| path.display().to_string())?;
        let drives = path.join(records::RUNS).try_exists().with_context(|| path.display().to_string())?;
        ensure!(!(args.no_eval && drives), "--no-eval: {} drives already; leave it out", path.display());
        (run, settings, Asked { no_eval: asked.no_eval || args.no_eval })
    } else {
        let layers = Layers::from(&args.layers);
        let mut settings = Settings::resolve(&layers, args.seed)?;
        settings.training.lots.extend_from_slice(&args.also);
        adjust(&mut settings);
        settings.name_lots_one_by_one();
        settings.check()?;
        // Before the folder is claimed: a misspelt lot should not leave one behind.
        check_lots(&settings, output)?;
        let mut reads = places(&settings, &[])?;
        reads.extend(args.layers.file().map(Path::to_owned));
        let place = args.out.place(command, layers.preset_name(), settings.seed.0);
        let asked = Asked { no_eval: args.no_eval };
        let request = Request { arguments: toml::Table::try_from(&asked)?, inputs: inputs(&settings)?, reads };
        (RunDir::create(&place, &settings, &request)?, settings, asked)
    };
    interrupt::can_resume(command, run.path());
    output.note(format_args!("run: {}", run.path().display()));

    let console = Console::new(output);
    let mut tasks = estimate::rest_of_training(&settings, true, run.path());
    if !asked.no_eval {
        // The expert, the behaviour-cloned policy and the final one.
        let drivers = if settings.dagger.iterations_max > 0 { 3 } else { 2 };
        if !sums::is_listed(run.path(), records::RUNS)? {
            tasks.push(estimate::evaluation(&settings, drivers));
        }
        tasks.extend([estimate::evaluation(&elsewhere(&settings), drivers), estimate::report()]);
    }
    console.plan(tasks);
    let outcome = tabulated(&settings, &run, &console, output)?.map_err(|rounds| cut_short(run.path(), rounds))?;
    let mut to_record = args.record.record.map_or_else(Vec::new, |episodes| {
        let folder = || run.path().to_owned();
        vec![Show::Training { run: folder() }, Show::Rollouts { run: folder(), episodes: episodes as usize }]
    });
    if !asked.no_eval {
        let drivers = drivers(&settings, run.path())?;
        let lots = Lot::parse_all(&settings.evaluation.lots, &settings.episode.vehicle)?;
        let plan =
            Plan { settings: &settings, drivers: &drivers, lots: &lots, compare_with: drivers.len() - 1, shard: None };
        evaluate::check(&plan)?;
        evaluate::measure(&plan, &run, &console, output)?;
        check_elsewhere(&settings, &run, &drivers, &console, output)?;
        to_record.extend(args.record.record.map(|runs| record::first_runs(&plan, runs)));
    }
    report::run_report::write(&run, &console)?;
    run.finish(outcome)?;
    print_next_steps(run.path(), output);
    console.report_time();
    if to_record.is_empty() { Ok(()) } else { record::record(run.path(), to_record, output) }
}

/// The settings of the check on lots that nobody trained on: once each way.
fn elsewhere(settings: &Settings) -> Settings {
    let evaluation = EvaluationSettings {
        lots: settings.evaluation.elsewhere.clone(),
        elsewhere: Vec::new(),
        trials: 1,
        // One table is shown, of the first level.
        noise: settings.evaluation.noise[..1].to_vec(),
        ..settings.evaluation.clone()
    };
    Settings { evaluation, ..settings.clone() }
}

/// Drives where nobody trained, so that few runs on lots that look like those of the training mislead nobody.
fn check_elsewhere(
    settings: &Settings,
    run: &RunDir,
    drivers: &[NamedDriver],
    progress: &dyn Progress,
    output: &Output,
) -> anyhow::Result<()> {
    let settings = elsewhere(settings);
    if settings.evaluation.lots.is_empty() {
        return Ok(());
    }
    let results = within::evaluate(run, "elsewhere", &settings, drivers, progress)?;
    let names: Vec<&str> = drivers.iter().map(|driver| driver.name.as_str()).collect();
    let rows = report::elsewhere::rows(&results, &names, settings.evaluation.seed);
    let table = report::elsewhere::write(&rows, &names, run)?;
    let noise = &settings.evaluation.noise[0];
    let which = if rows.iter().any(|row| row.trained_on) {
        "lots of which some were trained on"
    } else {
        "lots that nobody trained on"
    };
    let text = || format!("\nElsewhere: {which}, noise {noise}\n\n{table}");
    output.table(text, &rows)
}

/// The lots from files that a training reads.
pub(crate) fn inputs(settings: &Settings) -> anyhow::Result<Inputs> {
    Ok(inputs::of(&lots_read(settings, &[])?, &[]))
}

/// The files of the lots that a training reads, and of those that it is judged by.
pub(crate) fn places(settings: &Settings, unseen: &[String]) -> anyhow::Result<Vec<PathBuf>> {
    Ok(inputs::places(&lots_read(settings, unseen)?, &[]))
}

/// The lots of a training, and those that it is judged by; a lot may be both.
fn lots_read(settings: &Settings, unseen: &[String]) -> anyhow::Result<Vec<Lot>> {
    let Settings { training, evaluation, episode, .. } = settings;
    let named = [&training.lots[..], &evaluation.lots, &evaluation.elsewhere, unseen];
    let specs: BTreeSet<&String> = named.into_iter().flatten().collect();
    let lots = specs.into_iter().map(|spec| Lot::parse_all(&[spec], &episode.vehicle));
    Ok(lots.collect::<anyhow::Result<Vec<_>>>()?.concat())
}

/// Refuses lots to judge by that policies were or may be trained or tuned on, or that cannot be driven as the settings ask;
/// says notes about them.
pub(crate) fn check_unseen(settings: &Settings, unseen: &[String], output: &Output) -> anyhow::Result<()> {
    let Settings { training, evaluation, episode, .. } = settings;
    let trained_on = Lot::parse_all(&training.lots, &episode.vehicle)?;
    let unseen = Lot::parse_all(unseen, &episode.vehicle)?;
    output.notes(&notes::of(&unseen, &evaluation.noise));
    for lot in &unseen {
        // Every round takes the next ones of a kind.
        let is_same = |known: &Lot| match (known.digest(), lot.digest()) {
            (None, None) => known.group() == lot.group(),
            (known, lot) => known == lot,
        };
        let is_unseen = !lot.is_for_training() && !trained_on.iter().any(is_same);
        let name = lot.name();
        ensure!(
            is_unseen,
            "--unseen {name}: drivers are trained or tuned on it; name others, e.g. sealed:PHRASE:24:all"
        );
        let check = |&direction| lot.check_direction(direction, &episode.vehicle);
        let flag = "--set evaluation.directions='[\"forward\"]'";
        evaluation.directions.iter().try_for_each(check).map_err(|error| evaluate::or_forward(error, flag))?;
    }
    Ok(())
}

/// Refuses lots that do not exist, or cannot be driven as the settings ask.
pub(crate) fn check_lots(settings: &Settings, output: &Output) -> anyhow::Result<()> {
    let Settings { training, evaluation, episode, .. } = settings;
    let noise = std::slice::from_ref(&training.noise);
    for (section, lots, directions, noise) in [
        ("training", &training.lots, &training.directions, noise),
        ("evaluation", &evaluation.lots, &evaluation.directions, &evaluation.noise),
        ("evaluation", &evaluation.elsewhere, &evaluation.directions, &evaluation.noise),
    ] {
        let lots = Lot::parse_all(lots, &episode.vehicle)?;
        if section == "training" {
            let rounds = settings.dagger.iterations_max.saturating_add(1);
            lots::check_rounds(&lots, rounds, training.different_lots)?;
        }
        output.notes(&notes::of(&lots, noise));
        for lot in lots {
            let flag = format!("--set {section}.directions='[\"forward\"]'");
            let check = |&direction| lot.check_direction(direction, &episode.vehicle);
            directions.iter().try_for_each(check).map_err(|error| evaluate::or_forward(error, &flag))?;
        }
    }
    Ok(())
}

/// Trains, prints and writes the paper's table. The inner error of a training cut short is the number of rounds that
/// were finished.
pub(crate) fn tabulated(
    settings: &Settings,
    run: &RunDir,
    progress: &dyn Progress,
    output: &Output,
) -> anyhow::Result<Result<Outcome, usize>> {
    let outcome = training::train(settings, run, progress)?;
    let table1 = Table1::new(outcome.rows, outcome.stop);
    table1.write(run)?;
    let text = report::table1::write(&table1, run)?;
    output.table(|| format!("\nDAgger iterations\n\n{text}"), &table1)?;
    let rounds = table1.rows.len();
    let is_whole = matches!(outcome.stop, Stop::EtaReached | Stop::IterationCap);
    Ok(if is_whole { Ok(Outcome::Training { stop: outcome.stop, rounds }) } else { Err(rounds) })
}

fn cut_short(path: &Path, rounds: usize) -> anyhow::Error {
    Interrupted { kept: format!("{rounds} finished rounds are in {}", path.display()) }.into()
}

/// The expert, the behaviour-cloned policy and the final one.
fn drivers(settings: &Settings, run: &Path) -> anyhow::Result<Vec<NamedDriver>> {
    let of_run = |folder: PathBuf| DriverSpec::Run { folder }.load(settings);
    let has = |folder: &str| run.join(folder).try_exists().with_context(|| run.display().to_string());
    let mut drivers = vec![DriverSpec::Expert.load(settings)?, of_run(run.join("bc"))?.renamed(BC)];
    if has("round-01")? {
        drivers.push(of_run(run.to_owned())?.renamed(DAGGER));
    } else if has("final")? {
        drivers.push(of_run(run.to_owned())?.renamed(BC_FINAL));
    }
    Ok(drivers)
}

fn print_next_steps(path: &Path, output: &Output) {
    let driver = quoted(&format!("run:{}", path.display()));
    let of = if path.join("final").exists() { "the final training" } else { "the last round" };
    output.remark(format_args!("\nPolicy: {} ({of}; model.safetensors opens in PyTorch)", path.display()));
    output.remark(format_args!("Next:   cargo xtask evaluate --driver {driver} --seed 2"));
}

#[cfg(test)]
mod tests {
    use super::*;
    use experiment::settings::NoiseChoice;

    /// Every level was driven, and one of them shown.
    #[test]
    fn the_check_elsewhere_drives_the_noise_that_it_shows() {
        let mut settings = Settings::preset("smoke").unwrap();
        settings.evaluation.noise = vec![NoiseChoice::Hard, NoiseChoice::Clean];
        let elsewhere = elsewhere(&settings).evaluation;
        assert_eq!(elsewhere.noise, settings.evaluation.noise[..1]);
        assert_eq!((elsewhere.lots, elsewhere.trials), (settings.evaluation.elsewhere, 1));
    }
}
