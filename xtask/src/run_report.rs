//! `report.html` of a run: one page that loads nothing, made from what the run left on disk. Beside it the same as
//! `report.md`, and its pictures in `figures/`.
//!
//! A file that cannot be read or written is an error. A near-collision that can no longer be driven again (its network
//! moved away) is not: the page says so in place of the picture.

mod moments;
mod sources;

use crate::interrupt;
use crate::page::{Image, Page};
use crate::plots::{self, AxisCalibration, Distribution, EtaSeries, NoisePoint, NoiseSeries, RateRow};
use crate::progress::{Stopwatch, Work};
use crate::run_dir;
use crate::settings::{NoiseChoice, Settings};
use anyhow::Context as _;
use policy::checkpoint::Checkpoint;
use policy::dataset::Dataset;
use policy::dataset::store::Store;
use policy::network::Predictor;
use sources::{Evaluation, Failure, Row, Sources, Training};
use statistics::poisson::DISPERSION_MAX;
use std::fmt::Write as _;
use std::path::Path;

/// Name of the file.
pub const FILE: &str = "report.html";
const STEM: &str = "report";
/// Near-collisions that are shown.
const MOMENTS: usize = 6;
/// Of these at most so many of one driver on one lot.
const MOMENTS_OF_A_KIND: usize = 2;
/// Rows of one plot; with more only the pooled lots are drawn.
const ROWS_MAX: usize = 18;

/// Writes the report of the run in a folder.
///
/// # Errors
/// If what the run left cannot be read, or the report cannot be written.
pub fn write(folder: &Path, stopwatch: &mut Stopwatch) -> anyhow::Result<()> {
    let mut work = Work::begin("report");
    let page = page(folder, &mut work).with_context(|| format!("report of {}", folder.display()))?;
    page.write(folder, STEM)?;
    stopwatch.add("report", work.seconds());
    work.end(&folder.join(FILE).display().to_string());
    Ok(())
}

fn page(folder: &Path, work: &mut Work) -> anyhow::Result<Page> {
    let sources = Sources::read(folder)?;
    let name = folder.file_name().map_or_else(|| folder.display().to_string(), |name| name.to_string_lossy().into());
    let mut page = Page::new(name);
    page.text(overview(&sources));
    if let Some(training) = &sources.training {
        add_training(&mut page, &sources.settings, training);
        work.at(0.1, || "calibration".to_owned());
        if let Some(axes) = calibration(folder, &sources.settings)? {
            page.figure("calibration", calibration_caption(&axes), Image::Svg(plots::calibration(&axes)));
        }
    }
    if let Some(evaluation) = &sources.evaluation {
        add_evaluation(&mut page, evaluation);
        add_moments(&mut page, folder, &sources.settings, evaluation, work);
    }
    page.section("Configuration", configuration(&sources));
    Ok(page)
}

fn overview(sources: &Sources) -> String {
    let dirty = if sources.made_with("git_dirty") == "true" { ", with changes that are not committed" } else { "" };
    let mut text = format!(
        "Made by\n\n```\n{}\n```\n\nfrom revision `{}`{dirty}.",
        sources.command_line(),
        sources.made_with("git_revision")
    );
    if let Some(evaluation) = &sources.evaluation {
        text += "\n\n| driver | noise | lots | near-collisions | per 100 m [95 %] | safe ratio |\n|---|---|---|---|---|---|\n";
        for row in
            evaluation.summary.rows.iter().filter(|row| row.direction == "both" && row.lots == evaluation.pooled())
        {
            let [lower, upper] = row.interval();
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} in {:.0} m | {:.2} [{lower:.2}, {upper:.2}] | {:.3} |",
                row.driver, row.noise, row.lots, row.near_collisions, row.reference_m, row.per_100m, row.safe_ratio
            );
        }
    }
    text
}

fn add_training(page: &mut Page, settings: &Settings, training: &Training) {
    page.section("Training", training.table.as_str());
    let rows = &training.table1.rows;
    let ours: Vec<(u32, f64)> = rows.iter().filter_map(|row| Some((row.round, row.eta_hat?))).collect();
    if !ours.is_empty() {
        let paper = (0..).zip(&training.table1.paper.eta_hat).filter_map(|(i, eta)| Some((i, (*eta)?)));
        let series = EtaSeries { name: "this run".to_owned(), points: ours };
        let svg = plots::eta(&[series], &paper.collect::<Vec<_>>(), settings.dagger.eta);
        page.figure(
            "eta",
            "How much the network drove while data were collected, beside the paper's table.",
            Image::Svg(svg),
        );
    }
    let caption = "Loss over optimiser steps, round after round; training as means of stretches of steps. Training and \
                   validation loss are different quantities where β > 0, and different rounds have different data.";
    page.figure("learning", caption, Image::Svg(plots::learning(&training.rounds)));
}

/// The network of the run on all samples that were held back.
fn calibration(folder: &Path, settings: &Settings) -> anyhow::Result<Option<Vec<AxisCalibration>>> {
    let Ok(network) = run_dir::policy_folder(folder) else { return Ok(None) };
    let store = Store::open(folder)?;
    let mut dataset = Dataset::default();
    for round in (0..).take_while(|&round| store.has_round(round)) {
        dataset.push(store.read_samples(round)?.into());
    }
    let held_back = dataset.split(settings.dagger.fit_iteration.validation).validation;
    if held_back.is_empty() {
        return Ok(None);
    }
    let mut predictor = Predictor::new(Checkpoint::load(&network)?.weights, settings.dagger.device);
    let grids: Vec<_> = held_back.iter().map(|sample| &sample.grid).collect();
    let answers = predictor.predict(&grids);
    let side_m = f64::from(settings.dagger.geometry.side_m);
    let axis = |name: &str, i: usize| {
        let samples = held_back.iter().zip(&answers).map(|(sample, answer)| {
            (side_m * f64::from(answer.mean[i] - sample.label[i]), side_m * f64::from(answer.sigma[i]))
        });
        AxisCalibration::of(name, samples)
    };
    Ok(Some(vec![axis("across", 0), axis("along", 1)]))
}

fn calibration_caption(axes: &[AxisCalibration]) -> String {
    let mut text = "Whether the network knows how wrong it is, on held-back samples: left the share of the labels within \
                    1σ and 2σ of its answer (dashed: a normal distribution), right its error in ten groups of equal size \
                    from sure to unsure. Above the dashed line it is too sure of itself."
        .to_owned();
    for axis in axes {
        let [one, two] = axis.coverage.map(|share| 100.0 * share);
        let _ = write!(text, " {}: {one:.0} % and {two:.0} % of {} samples.", axis.name, axis.samples);
    }
    text
}

impl Row {
    /// The interval that may be quoted, as in the tables.
    fn interval(&self) -> [f64; 2] {
        let is_clustered = self.dispersion.is_some_and(|index| index > DISPERSION_MAX);
        match (self.bootstrap_lower, self.bootstrap_upper) {
            (Some(lower), Some(upper)) if is_clustered => [lower, upper],
            _ => [self.garwood_lower, self.garwood_upper],
        }
    }
}

fn add_evaluation(page: &mut Page, evaluation: &Evaluation) {
    page.section("Evaluation", "");
    let drivers = first_seen(evaluation.summary.rows.iter().map(|row| row.driver.as_str()));
    let levels: Vec<NoiseChoice> = evaluation.summary.rows.iter().fold(Vec::new(), |mut levels, row| {
        if !levels.contains(&row.noise) {
            levels.push(row.noise);
        }
        levels
    });
    for (index, &noise) in levels.iter().enumerate() {
        let rows = rate_rows(evaluation, noise, &drivers);
        let title = format!("Near-collisions, noise {noise}");
        let caption = "Dots: near-collisions per 100 m of route; whiskers: 95 % intervals, as in the tables.";
        page.figure(format!("rates-{index}"), caption, Image::Svg(plots::rates(&title, &rows)));
    }
    if levels.len() > 1 {
        let series = noise_series(evaluation, &drivers);
        let title = format!("Near-collisions against noise, {}", evaluation.pooled());
        let svg = plots::rates_against_noise(&title, &series);
        page.figure("noise", "Near-collisions over the noise level; whiskers: exact 95 % intervals.", Image::Svg(svg));
    }
    for (index, &noise) in levels.iter().enumerate() {
        let row = |(group, driver): (usize, &&str)| Distribution {
            name: (*driver).to_owned(),
            values: safe_ratios(evaluation, noise, driver),
            group,
        };
        let rows: Vec<Distribution> = drivers.iter().enumerate().map(row).collect();
        let title = format!("Safe ratio of every run, noise {noise}");
        let caption = "Dots: runs (lot, direction, trial); box: quartiles; bar: median.";
        page.figure(format!("safe-ratio-{index}"), caption, Image::Svg(plots::safe_ratios(&title, &rows)));
    }
    page.section("Tables", evaluation.tables.as_str());
}

fn first_seen<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    names.fold(Vec::new(), |mut seen, name| {
        if !seen.contains(&name) {
            seen.push(name);
        }
        seen
    })
}

/// Lot by lot, driver by driver; only the pooled lots where that would be too many.
fn rate_rows(evaluation: &Evaluation, noise: NoiseChoice, drivers: &[&str]) -> Vec<RateRow> {
    let rows = || evaluation.summary.rows.iter().filter(|row| row.noise == noise && row.direction == "both");
    let pooled_only = rows().count() > ROWS_MAX;
    let lots = first_seen(rows().map(|row| row.lots.as_str()));
    let mut drawn = Vec::new();
    for lot in lots.iter().filter(|&&lot| !pooled_only || lot == evaluation.pooled()) {
        for row in rows().filter(|row| row.lots == **lot) {
            let name = if pooled_only { row.driver.clone() } else { format!("{}, {}", row.driver, row.lots) };
            let group = drivers.iter().position(|driver| *driver == row.driver).unwrap_or(0);
            drawn.push(RateRow { name, per_100m: row.per_100m, interval: row.interval(), group });
        }
    }
    drawn
}

fn noise_series(evaluation: &Evaluation, drivers: &[&str]) -> Vec<NoiseSeries> {
    let points = |driver: &str| {
        let rows = evaluation.summary.noise_sweep.iter();
        let rows = rows.filter(|row| row.driver == driver && row.lots == evaluation.pooled());
        let point = |row: &sources::SweepRow| {
            let (times_paper, per_100m) = (row.times_paper?, row.per_100m);
            Some(NoisePoint { times_paper, per_100m, interval: [row.lower, row.upper] })
        };
        let mut points: Vec<NoisePoint> = rows.filter_map(point).collect();
        points.sort_by(|a, b| a.times_paper.total_cmp(&b.times_paper));
        points
    };
    drivers.iter().map(|driver| NoiseSeries { name: (*driver).to_owned(), points: points(driver) }).collect()
}

fn safe_ratios(evaluation: &Evaluation, noise: NoiseChoice, driver: &str) -> Vec<f64> {
    let runs = evaluation.runs.iter().filter(|run| run.noise == noise && run.driver == driver);
    runs.map(|run| run.metrics.safe_ratio).collect()
}

/// The fastest near-collisions: how fast the car still was is how far the driver was from seeing it come.
fn worst(failures: &[Failure]) -> Vec<&Failure> {
    let mut fastest: Vec<&Failure> = failures.iter().collect();
    fastest.sort_by(|a, b| b.speed_mps.total_cmp(&a.speed_mps));
    let mut chosen: Vec<&Failure> = Vec::new();
    for failure in fastest {
        let alike = chosen.iter().filter(|other| other.driver == failure.driver && other.lot == failure.lot).count();
        if chosen.len() < MOMENTS && alike < MOMENTS_OF_A_KIND {
            chosen.push(failure);
        }
    }
    chosen
}

fn add_moments(page: &mut Page, folder: &Path, settings: &Settings, evaluation: &Evaluation, work: &mut Work) {
    let count = evaluation.failures.len();
    if count == 0 {
        page.section("Near-collisions", "There was none.");
        return;
    }
    let worst = worst(&evaluation.failures);
    page.section(
        "Near-collisions",
        format!(
            "{count} in all, each with its cause in `failures.md`. Shown are the {} in which the car was fastest, at most \
             {MOMENTS_OF_A_KIND} of one driver on one lot. The commands show them again in Rerun's viewer; run them where \
             this run was made.",
            worst.len()
        ),
    );
    for (index, failure) in worst.iter().enumerate() {
        work.at(0.2 + 0.8 * index as f64 / worst.len() as f64, || {
            format!("near-collision {} of {}", index + 1, worst.len())
        });
        let Failure { driver, lot, trial, noise, tick, route_m, speed_mps, .. } = failure;
        let way = crate::report::name(failure.direction);
        page.text(format!("### {driver} on {lot}, {way}\n"));
        let cause = failure.cause.replace('_', " ");
        let caption = format!(
            "Trial {trial}, noise {noise}, tick {tick}, {route_m:.1} m along the route, at {speed_mps:.2} m/s: {cause}."
        );
        let drawn = if interrupt::is_requested() { None } else { Some(moments::picture(&failure.replay, settings)) };
        match drawn {
            Some(Ok(png)) => {
                page.figure(format!("near-collision-{index}"), caption, Image::Png(png));
            }
            Some(Err(error)) => {
                page.text(format!("{caption} It could not be driven again: {error:#}."));
            }
            None => {
                page.text(format!("{caption} Not drawn: the command was interrupted."));
            }
        }
        page.text(format!("```\n{}\n```", visualise(&failure.replay, folder)));
    }
}

/// The command that shows a near-collision again. Drivers that are no runs do not bring their settings along.
fn visualise(key: &str, folder: &Path) -> String {
    if key.starts_with("run:") {
        return format!("cargo xtask visualise replay {key}");
    }
    format!("cargo xtask visualise replay {key} --config {}/settings.toml", folder.display())
}

fn configuration(sources: &Sources) -> String {
    let mut text = "| | |\n|---|---|\n".to_owned();
    for (name, key) in [
        ("preset", "preset"),
        ("root seed", "root_seed"),
        ("seed of the evaluation", "evaluation_seed"),
        ("compiler", "rustc_version"),
        ("target", "target"),
        ("threads", "threads"),
    ] {
        let _ = writeln!(text, "| {name} | {} |", sources.made_with(key));
    }
    let _ = write!(text, "\nEvery setting (`settings.toml`):\n\n```toml\n{}\n```", sources.settings_text.trim_end());
    text
}

#[cfg(test)]
mod tests;
