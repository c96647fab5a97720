//! `report.html` of a run: one page that loads nothing, made from the files of the run. Next to it the same as
//! `report.md`, with its pictures in `figures/`.
//!
//! A file that cannot be read or written is an error. A near-collision that cannot be replayed (its network has moved)
//! is not: the page says so in place of the picture, and the report in [`Report::not_replayed`].

use crate::glossary;
use crate::markdown::escaped;
use crate::moments;
use crate::page::{Image, Page};
use crate::plots::{self, Distribution, EtaSeries, RatePoint, RateRow, RateSeries};
use crate::table1;
use crate::what_if::distinct;
use anyhow::Context as _;
use evaluation::calibration::{self, AxisCalibration};
use evaluation::format::with_interval;
use evaluation::names::BC;
use evaluation::records::{self, FailureRecord, RecordHeader, RunRecord};
use evaluation::summary::{Row, SweepRow, Tables};
use evaluation::table1::Table1;
use experiment::command_line::{command_line, quoted, quoted_path};
use experiment::lots::ALL;
use experiment::manifest::{self, Manifest};
use experiment::progress::{Interrupted, Progress};
use experiment::run_dir::RunDir;
use experiment::settings::{NoiseChoice, Settings};
use experiment::trained;
use policy::checkpoint::Checkpoint;
use policy::dataset::Dataset;
use policy::dataset::store::Store;
use policy::decision_rule::DecisionRule;
use policy::fit::learning::{self, LearningCurve};
use sim::limits::RUN_TEXT_BYTES_MAX;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::Path;
use storage::sums;

/// Name of the file.
pub const FILE: &str = "report.html";
const STEM: &str = "report";
/// The table of a training's check on other lots.
const ELSEWHERE: &str = "elsewhere.md";
/// Near-collisions that are shown.
const MOMENTS: usize = 6;
/// At most this many of them are of one driver on one lot.
const MOMENTS_OF_A_KIND: usize = 2;
/// Rows of one plot; with more only the pooled lots are drawn.
const ROWS_MAX: usize = 18;

/// Everything the report is made of, as the run left it on disk.
#[derive(Debug)]
struct Sources {
    settings: Settings,
    manifest: Manifest,
    /// The training, if it was one.
    training: Option<Training>,
    /// The evaluation, if anything was driven.
    evaluation: Option<Evaluation>,
    /// The table of the check on other lots, if a training ended with one.
    elsewhere: Option<String>,
}

#[derive(Debug)]
struct Training {
    table: String,
    table1: Table1,
    rounds: Vec<LearningCurve>,
}

#[derive(Debug)]
struct Evaluation {
    text: String,
    tables: Tables,
    /// Safe ratios of the runs, by noise level and driver, then by lot.
    safe_ratios: BTreeMap<(String, String), BTreeMap<String, Vec<f32>>>,
    /// Near-collisions in all.
    near_collisions: usize,
    /// The worst of them.
    worst: Worst,
}

impl Sources {
    fn read(folder: &Path) -> anyhow::Result<Self> {
        Ok(Self {
            settings: trained::settings_of(folder)?,
            manifest: Manifest::read(folder)?,
            training: Training::read(folder)?,
            evaluation: Evaluation::read(folder)?,
            elsewhere: manifest::has_file(folder, ELSEWHERE)?.then(|| text(&folder.join(ELSEWHERE))).transpose()?,
        })
    }
}

impl Training {
    fn read(folder: &Path) -> anyhow::Result<Option<Self>> {
        let Some(table1) = Table1::read(folder)? else { return Ok(None) };
        let mut rounds = Vec::new();
        for row in &table1.rows {
            let name = if row.round == 0 { BC.to_owned() } else { format!("i = {}", row.round) };
            rounds.extend(learning::read(&folder.join(format!("round-{:02}", row.round)), &name)?);
        }
        rounds.extend(learning::read(&folder.join("final"), "final")?);
        Ok(Some(Self { table: text(&folder.join("table1.md"))?, table1, rounds }))
    }
}

impl Evaluation {
    fn read(folder: &Path) -> anyhow::Result<Option<Self>> {
        let Some(tables) = Tables::read(folder)? else { return Ok(None) };
        let text = text(&folder.join("summary.md"))?;
        let mut evaluation =
            Self { text, tables, safe_ratios: BTreeMap::new(), near_collisions: 0, worst: Worst::default() };
        records::each_line(&folder.join(records::RUNS), |run: RunRecord| {
            let RecordHeader { driver, lot, noise, .. } = run.header;
            let by_lot = evaluation.safe_ratios.entry((noise.to_string(), driver)).or_default();
            by_lot.entry(lot).or_default().push(run.report.metrics.safe_ratio);
            Ok(())
        })?;
        records::each_line(&folder.join(records::FAILURES), |failure| {
            evaluation.near_collisions += 1;
            evaluation.worst.add(failure);
            Ok(())
        })?;
        Ok(Some(evaluation))
    }

    /// The lots that stand for all: pooled where there are several.
    fn pooled(&self) -> &str {
        self.tables.rows.last().map_or(ALL, |row| row.lots.as_str())
    }

    /// Rows of both directions at a noise level.
    fn rows(&self, noise: NoiseChoice) -> impl Iterator<Item = &Row> {
        self.tables.rows.iter().filter(move |row| row.noise == noise && row.direction == "both")
    }

    /// The same of the pooled lots.
    fn pooled_rows(&self, noise: NoiseChoice) -> impl Iterator<Item = &Row> {
        self.rows(noise).filter(|row| row.lots == self.pooled())
    }

    /// The drivers in the order of the tables.
    fn drivers(&self) -> Vec<&str> {
        distinct(self.tables.rows.iter().map(|row| row.driver.as_str()))
    }

    /// The noise levels in the order of the tables.
    fn levels(&self) -> Vec<NoiseChoice> {
        self.tables.rows.iter().fold(Vec::new(), |mut levels, row| {
            if !levels.contains(&row.noise) {
                levels.push(row.noise);
            }
            levels
        })
    }
}

fn text(path: &Path) -> anyhow::Result<String> {
    Ok(sums::read_to_string(path, RUN_TEXT_BYTES_MAX)?)
}

/// Writes the report of the run in a folder.
///
/// # Errors
/// If what the run left cannot be read, or the report cannot be written.
pub fn write(run: &RunDir, progress: &dyn Progress) -> anyhow::Result<()> {
    Report::of(run, progress)?.write(run, progress)
}

/// The report of a run, not written yet.
#[derive(Debug)]
pub struct Report {
    page: Page,
    /// Why near-collisions that the page shows could not be replayed, one reason for each.
    pub not_replayed: Vec<String>,
}

impl Report {
    /// That of the run in a folder.
    ///
    /// # Errors
    /// If what the run left cannot be read.
    pub fn of(run: &RunDir, progress: &dyn Progress) -> anyhow::Result<Self> {
        progress.begin("report", "report");
        let folder = run.path();
        report(folder, progress).with_context(|| format!("report of {}", folder.display()))
    }

    /// Writes it into the folder of the run.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(self, run: &RunDir, progress: &dyn Progress) -> anyhow::Result<()> {
        self.page.write(run, STEM)?;
        progress.end(&run.path().join(FILE).display().to_string());
        Ok(())
    }
}

/// The name of a folder, as which it may not have been named: `.`.
fn name_of(folder: &Path) -> String {
    let place = if folder.file_name().is_none() { storage::place_of(folder).ok() } else { None };
    let place = place.as_deref().unwrap_or(folder);
    place.file_name().map_or_else(|| place.display().to_string(), |name| name.to_string_lossy().into_owned())
}

fn report(folder: &Path, progress: &dyn Progress) -> anyhow::Result<Report> {
    let sources = Sources::read(folder)?;
    let mut page = Page::new(name_of(folder));
    let mut not_replayed = Vec::new();
    overview(&mut page, &sources);
    if let Some(training) = &sources.training {
        add_training(&mut page, &sources.settings, training);
        progress.at(0.1, &mut |_| "calibration".to_owned());
        let rounds = training.table1.rows.len() as u32;
        if let Some(axes) = held_back_calibration(folder, rounds, &sources.settings)? {
            page.figure("calibration", calibration_caption(&axes), Image::Svg(plots::calibration(&axes)));
        }
    }
    if let Some(evaluation) = &sources.evaluation {
        add_evaluation(&mut page, evaluation);
        if let Some(table) = &sources.elsewhere {
            add_elsewhere(&mut page, &sources.settings, table);
        }
        not_replayed = add_moments(&mut page, folder, &sources, evaluation, progress)?;
    }
    glossary::add(&mut page);
    page.section("Configuration", configuration(&sources));
    Ok(Report { page, not_replayed })
}

fn overview(page: &mut Page, sources: &Sources) {
    if let Some(evaluation) = &sources.evaluation {
        let drivers = evaluation.drivers();
        if let Some(&noise) = evaluation.levels().first() {
            let rows = pooled_rates(evaluation, noise, &drivers);
            let title = format!("Near-collisions, noise {noise}, lots: {}", evaluation.pooled());
            let caption = format!(
                "{} per 100 m of route, with 95 % intervals.",
                glossary::NEAR_COLLISION.link("Near-collisions")
            );
            page.figure("headline", caption, Image::Svg(plots::rates(&title, &rows)));
        }
        for noise in evaluation.levels() {
            page.text(headline(evaluation, noise));
        }
    } else if let Some(training) = &sources.training {
        page.figure("headline", LEARNING_CAPTION, Image::Svg(plots::learning(&training.rounds)));
    }
    let manifest = &sources.manifest;
    let dirty = if manifest.git_dirty == Some(true) { ", with uncommitted changes" } else { "" };
    let revision = manifest
        .git_revision
        .as_ref()
        .map_or_else(String::new, |revision| format!(", at revision `{revision}`{dirty}"));
    page.text(format!("Made with{revision}:\n\n```\n{}\n```", command_line(manifest)));
}

/// Every driver on all lots together at one noise level.
fn headline(evaluation: &Evaluation, noise: NoiseChoice) -> String {
    let route_m = evaluation.pooled_rows(noise).next().map_or(0.0, |row| row.reference_m);
    let mut text = format!(
        "Lots: {}; {}; {route_m:.0} m of route per driver.\n\n| driver | {} | per 100 m [95 %] | {} | {} | {} |\n\
         |---|---|---|---|---|---|\n",
        escaped(evaluation.pooled()),
        glossary::NOISE.link(&format!("noise {noise}")),
        glossary::NEAR_COLLISION.link("near-collisions"),
        glossary::CONTACT.link("contacts"),
        glossary::LEAST_CLEARANCE.link("least clearance, m"),
        glossary::SAFE_RATIO.link("safe ratio"),
    );
    for row in evaluation.pooled_rows(noise) {
        let rate = with_interval(row.per_100m, row.quoted_interval(), 2);
        let clearance = row.clearance_min_m.map_or_else(|| "–".to_owned(), |metres| format!("{metres:.2}"));
        let _ = writeln!(
            text,
            "| {} | {} | {rate} | {} | {clearance} | {:.2} |",
            escaped(&row.driver),
            row.near_collisions,
            row.contacts,
            row.safe_ratio
        );
    }
    text
}

const LEARNING_CAPTION: &str = "Top: the error of the look-ahead point on held-back samples, in metres. This is what \
    counts. Below: the losses, in nats. Training and validation loss are different quantities where β > 0, and the \
    validation loss may rise while the policy gets better: β-NLL pays for predicted variance as well as for errors. Each \
    round has more data than the one before, so curves of different rounds do not compare.";

fn add_training(page: &mut Page, settings: &Settings, training: &Training) {
    let who_drives = match settings.dagger.rule {
        DecisionRule::AllBelow { .. } => format!(
            "The expert drives where the discrepancy exceeds {} or the {} is too large.",
            glossary::TAU.link("τ"),
            glossary::DOUBT.link("doubt")
        ),
        _ => "Who drives when, the setting `dagger.rule` says.".to_owned(),
    };
    page.section(
        "Training",
        format!(
            "One column per round: {}, then the iterations of {}. {} is the share of ticks in which the network drove, {} \
             its distance from the expert. {who_drives}",
            glossary::BC.link("BC"),
            glossary::DAGGER.link("DAgger"),
            glossary::ETA_HAT.link("η̂"),
            glossary::DISCREPANCY.link("τ̂"),
        ),
    );
    page.text(training.table.as_str());
    let rows = &training.table1.rows;
    let ours: Vec<(u32, f64)> = rows.iter().filter_map(|row| Some((row.round, row.eta_hat?))).collect();
    if !ours.is_empty() {
        let series = EtaSeries { name: "this run".to_owned(), points: ours };
        let svg = plots::eta(&[series], &table1::eta_hat_of_paper(settings), settings.dagger.eta);
        page.figure("eta", "How much the network drove in each iteration.", Image::Svg(svg));
    }
    page.figure("learning", LEARNING_CAPTION, Image::Svg(plots::learning(&training.rounds)));
}

/// The network of the run on all samples that were held back.
fn held_back_calibration(
    folder: &Path,
    rounds: u32,
    settings: &Settings,
) -> anyhow::Result<Option<[AxisCalibration; 2]>> {
    let store = Store::open(folder)?;
    let mut dataset = Dataset::default();
    for round in 0..rounds {
        dataset.push(store.read_samples(round)?.into());
    }
    let network = trained::policy_folder(folder)?;
    let held_back = dataset.split(settings.dagger.fit.validation).validation;
    if held_back.is_empty() {
        return Ok(None);
    }
    let policy = Checkpoint::load(&network)?;
    let held_back: Vec<_> = held_back.iter().collect();
    Ok(Some(calibration::of_policy(&policy, &held_back)))
}

fn calibration_caption(axes: &[AxisCalibration]) -> String {
    let mut text = "Whether the network knows how wrong it is, on held-back samples. Left: the share of labels within 1σ and \
                    2σ of its answer (dashed: normal distribution). Right: its error against the σ it predicted, in ten \
                    groups of equal size. Above the dashed line the network is overconfident."
        .to_owned();
    for axis in axes {
        let [one, two] = axis.coverage.map(|share| 100.0 * share);
        let _ = write!(text, " {}: {one:.0} % and {two:.0} % ({} samples).", axis.name, axis.samples);
    }
    text
}

fn add_evaluation(page: &mut Page, evaluation: &Evaluation) {
    page.section("Evaluation", "");
    let (drivers, levels) = (evaluation.drivers(), evaluation.levels());
    for (index, &noise) in levels.iter().enumerate() {
        let by_lot = rates_by_lot(evaluation, noise, &drivers);
        let is_by_lot = by_lot.len() <= ROWS_MAX;
        if index == 0 && (!is_by_lot || by_lot.len() == drivers.len()) {
            continue; // the same is at the top of the page
        }
        let rows = if is_by_lot { by_lot } else { pooled_rates(evaluation, noise, &drivers) };
        let title = format!("Near-collisions, noise {noise}");
        let caption = "Dots: near-collisions per 100 m of route. Whiskers: 95 % intervals, as in the tables.";
        page.figure(format!("rates-{index}"), caption, Image::Svg(plots::rates(&title, &rows)));
    }
    if levels.len() > 1 {
        let series = noise_series(evaluation, &drivers);
        let title = format!("Near-collisions against noise, lots: {}", evaluation.pooled());
        let svg = plots::rates_against_noise(&title, &series);
        let caption = "Near-collisions at each noise level. Whiskers: 95 % intervals, as in the tables.";
        page.figure("noise", caption, Image::Svg(svg));
    }
    for (index, &noise) in levels.iter().enumerate() {
        for (place, lots) in single_lots(evaluation).into_iter().enumerate() {
            let row = |(group, driver): (usize, &&str)| Distribution {
                name: (*driver).to_owned(),
                values: safe_ratios(evaluation, noise, driver, lots),
                group,
            };
            let rows: Vec<Distribution> = drivers.iter().enumerate().map(row).collect();
            let title = format!("Safe ratio on {lots}, noise {noise}");
            let caption = "One dot per run, of many runs some. Box: quartiles; bar: median.";
            let name = format!("safe-ratio-{index}-{place}");
            page.figure(name, caption, Image::Svg(plots::safe_ratios(&title, &rows)));
        }
    }
    page.section("Tables", evaluation.text.as_str());
}

/// What the same drivers did on other lots than those of the evaluation.
fn add_elsewhere(page: &mut Page, settings: &Settings, table: &str) {
    let evaluation = &settings.evaluation;
    page.section(
        "Other lots",
        format!(
            "The same drivers on {}, one trial per lot and direction, noise {}. Nobody trained on these lots, unless it \
             says so.\n\n{table}",
            escaped(&evaluation.elsewhere.join(", ")),
            // Of several levels the first was driven.
            evaluation.noise[0]
        ),
    );
}

/// Lots, or generated lots of one kind, that have rows of their own: safe ratios of different lots do not compare,
/// because lanes differ in width.
fn single_lots(evaluation: &Evaluation) -> Vec<&str> {
    let driven: BTreeSet<&String> = evaluation.safe_ratios.values().flat_map(BTreeMap::keys).collect();
    let is_of = |lots: &str| driven.iter().any(|lot| is_in(lot, lots));
    distinct(evaluation.tables.rows.iter().map(|row| row.lots.as_str()).filter(|lots| is_of(lots)))
}

/// Whether a lot belongs to a row: `lot-b`, or `test-hard (8 lots)` for `test-hard-3`.
fn is_in(lot: &str, lots: &str) -> bool {
    let kind = lots.rsplit_once(" (").map_or(lots, |(kind, _)| kind);
    let index = lot.strip_prefix(kind).and_then(|rest| rest.strip_prefix('-'));
    lot == lots || index.is_some_and(|index| index.parse::<u32>().is_ok())
}

/// Lot by lot, driver by driver.
fn rates_by_lot(evaluation: &Evaluation, noise: NoiseChoice, drivers: &[&str]) -> Vec<RateRow> {
    let lots = distinct(evaluation.rows(noise).map(|row| row.lots.as_str()));
    let rows = lots.iter().flat_map(|lots| evaluation.rows(noise).filter(move |row| row.lots == **lots));
    rows.map(|row| rate_row(row, format!("{}, {}", row.driver, row.lots), drivers)).collect()
}

/// Driver by driver, all lots together.
fn pooled_rates(evaluation: &Evaluation, noise: NoiseChoice, drivers: &[&str]) -> Vec<RateRow> {
    evaluation.pooled_rows(noise).map(|row| rate_row(row, row.driver.clone(), drivers)).collect()
}

fn rate_row(row: &Row, name: String, drivers: &[&str]) -> RateRow {
    let group = drivers.iter().position(|driver| *driver == row.driver).unwrap_or(0);
    RateRow { name, per_100m: row.per_100m, interval: row.quoted_interval(), group }
}

fn noise_series(evaluation: &Evaluation, drivers: &[&str]) -> Vec<RateSeries> {
    let points = |driver: &str| {
        let rows = evaluation.tables.noise_sweep.iter();
        let rows = rows.filter(|row| row.driver == driver && row.lots == evaluation.pooled());
        let point = |row: &SweepRow| {
            let (times_paper, per_100m) = (row.times_paper?, row.per_100m);
            Some(RatePoint { x: times_paper, per_100m, interval: [row.lower, row.upper] })
        };
        let mut points: Vec<RatePoint> = rows.filter_map(point).collect();
        points.sort_by(|a, b| a.x.total_cmp(&b.x));
        points
    };
    drivers.iter().map(|driver| RateSeries { name: (*driver).to_owned(), points: points(driver) }).collect()
}

fn safe_ratios(evaluation: &Evaluation, noise: NoiseChoice, driver: &str, lots: &str) -> Vec<f64> {
    let by_lot = evaluation.safe_ratios.get(&(noise.to_string(), driver.to_owned()));
    by_lot.map_or_else(Vec::new, |by_lot| of_row(by_lot, lots))
}

/// The values of the lots that a row is about.
fn of_row(by_lot: &BTreeMap<String, Vec<f32>>, lots: &str) -> Vec<f64> {
    // A lot by this very name is not of a kind: the row `garage` is not about `garage-2`.
    let is_one = by_lot.contains_key(lots);
    let of_row = by_lot.iter().filter(|(lot, _)| if is_one { *lot == lots } else { is_in(lot, lots) });
    of_row.flat_map(|(_, of_lot)| of_lot).copied().map(f64::from).collect()
}

/// The fastest near-collisions: how fast the car still was is how far the driver was from seeing it come.
#[derive(Debug, Default)]
struct Worst(Vec<FailureRecord>);

impl Worst {
    /// Adds a near-collision if it is among the fastest so far. What is chosen in the end is what would be chosen of all at
    /// once: who is not among the fastest of some is not among those of more.
    fn add(&mut self, failure: FailureRecord) {
        let at = self.0.partition_point(|other| other.speed_mps >= failure.speed_mps);
        self.0.insert(at, failure);
        let mut chosen: Vec<FailureRecord> = Vec::new();
        for failure in self.0.drain(..) {
            let is_alike = |other: &&FailureRecord| {
                (&other.header.driver, &other.header.lot) == (&failure.header.driver, &failure.header.lot)
            };
            if chosen.len() < MOMENTS && chosen.iter().filter(is_alike).count() < MOMENTS_OF_A_KIND {
                chosen.push(failure);
            }
        }
        self.0 = chosen;
    }
}

fn add_moments(
    page: &mut Page,
    folder: &Path,
    sources: &Sources,
    evaluation: &Evaluation,
    progress: &dyn Progress,
) -> anyhow::Result<Vec<String>> {
    let mut not_replayed = Vec::new();
    let count = evaluation.near_collisions;
    if count == 0 {
        page.section("Near-collisions", "There were none.");
        return Ok(not_replayed);
    }
    let worst = &evaluation.worst.0;
    let (listed, shown) = match (count, worst.len()) {
        (1, _) => ("`failures.md` lists the only near-collision with its cause.".to_owned(), String::new()),
        (_, all) if all == count => (format!("`failures.md` lists all {count} with their causes."), String::new()),
        (_, some) => (
            format!("`failures.md` lists all {count} with their causes."),
            format!(
                " The {some} in which the car was fastest are shown, at most {MOMENTS_OF_A_KIND} per driver and lot."
            ),
        ),
    };
    page.section(
        "Near-collisions",
        format!(
            "{listed}{shown} The dot is the {}, in the grid with the ellipses of 1σ and 2σ that a network predicts; \
             coloured cells are wrong, and the colour says why. The commands record the drive for Rerun (docs/recordings.md: \
             the first call builds the viewer); run them in the folder in which this report was made.",
            glossary::LOOK_AHEAD_POINT.link("look-ahead point")
        ),
    );
    for (index, failure) in worst.iter().enumerate() {
        progress.at(0.2 + 0.8 * index as f64 / worst.len() as f64, &mut |_| {
            format!("near-collision {} of {}", index + 1, worst.len())
        });
        let FailureRecord { header, tick, route_m, speed_mps, .. } = failure;
        let RecordHeader { driver, lot, trial, noise, .. } = header;
        let way = header.direction.name();
        page.text(format!("### {} on {}, {way}\n", escaped(driver), escaped(lot)));
        let cause = failure.cause.name();
        let caption = format!(
            "Trial {trial}, noise {noise}, tick {tick}: {route_m:.1} m along the route, at {speed_mps:.2} m/s. Cause: \
             {cause}."
        );
        if progress.is_cancelled() {
            return Err(Interrupted { kept: format!("{} holds everything but its report", folder.display()) }.into());
        }
        match moments::player(&failure.replay, &sources.settings, &sources.manifest) {
            Ok(player) => {
                page.figure(format!("near-collision-{index}"), caption, Image::Player(player));
            }
            // The report can be made again; with a remark in place of the picture it would count as finished.
            Err(error) if storage::is_of_disk(error.as_ref()) => return Err(error),
            Err(error) => {
                let reason = format!("{error:#}");
                page.text(format!("{caption} It could not be replayed: {}.", escaped(&reason)));
                not_replayed.push(reason);
            }
        }
        page.text(format!("```\n{}\n```", visualise(&failure.replay, folder)));
    }
    Ok(not_replayed)
}

/// The command that shows a near-collision again. A driver that is a run has settings of its own, those of its training; what
/// was driven is in the evaluation's.
fn visualise(key: &str, folder: &Path) -> String {
    let settings = folder.join("settings.toml");
    format!("cargo xtask visualise replay {} --config {}", quoted(key), quoted_path(&settings))
}

fn configuration(sources: &Sources) -> String {
    let manifest = &sources.manifest;
    let mut text = "| | |\n|---|---|\n".to_owned();
    for (name, value) in [
        ("program", &manifest.program),
        ("preset", &manifest.preset),
        ("root seed", &manifest.root_seed.to_string()),
        ("evaluation seed", &manifest.evaluation_seed.to_string()),
        ("compiler", &manifest.rustc_version),
        ("target", &manifest.target),
        ("threads", &manifest.threads.to_string()),
    ] {
        let _ = writeln!(text, "| {name} | {} |", escaped(value));
    }
    let settings = sources.settings.to_toml();
    let _ = write!(text, "\nEvery setting (`settings.toml`):\n\n```toml\n{}\n```", settings.trim_end());
    text
}

#[cfg(test)]
mod tests;
