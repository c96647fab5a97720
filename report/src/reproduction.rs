//! The one report: what holds, the paper's tables beside ours, ablations. Made from what the stages wrote.

use crate::controls;
use crate::deviations;
use crate::docs_page::{self, MadeBy};
use crate::drive::{rows_of, with_drives};
use crate::markdown::{escaped, table_of, with_header};
use crate::other_run::OtherRun;
use crate::page::{Image, Page};
use crate::plots::{self, Bar, BarGroup, EtaSeries, RateRow};
use crate::rules;
use crate::table1::{self, ByRound, READ_ETA_HAT};
use crate::trainings::{self, Place};
use crate::trainings_table::TrainingsTable;
use evaluation::calibration::AxisCalibration;
use evaluation::conclusions::{self, Against, DrivenPlan, Statement, Verdict};
use evaluation::format::{difference, exact_rate, quoted_interval, quoted_rate};
use evaluation::judge::DriverEstimate;
use evaluation::names::{BC, DAGGER, UNWEIGHTED};
use evaluation::on_policy::{Calibration, Effect, OnPolicy, States};
use evaluation::paper::{self, PaperLot};
use evaluation::slices::{LotGroup, Slice};
use evaluation::stage::Stage;
use evaluation::stages::{self, Chain, Extent};
use evaluation::statistics::poisson::Rate;
use evaluation::summary::csv_of;
use evaluation::totals::Totals;
use evaluation::trainings::TRAININGS_MIN;
use experiment::drivers::NamedDriver;
use experiment::lots::UNSEEN;
use experiment::manifest::Manifest;
use experiment::run_dir::RunDir;
use experiment::settings::{Settings, has_points_of_paper};
use policy::dagger::IterationRow;
use policy::loss::{LossSettings, WeightForm};
use std::fmt::Write as _;
use std::path::Path;

/// Everything that decides what was done.
#[derive(Debug, Clone, PartialEq)]
pub struct Recipe {
    /// Every setting.
    pub settings: Settings,
    /// How much.
    pub extent: Extent,
    /// What is done, in order.
    pub stages: Vec<Stage>,
}

/// Writes `report.md`, `report.html`, `conclusions.csv` and the figures; returns the conclusions as printed.
///
/// # Errors
/// If what a stage wrote cannot be read, or a file cannot be written.
pub fn write(recipe: &Recipe, run: &RunDir) -> anyhow::Result<String> {
    let found = Found::read(recipe, run.path())?;
    let mut page = Page::new("The paper in a box");
    page.text(introduction(recipe));
    let statements = found.add_to(&mut page, recipe, run.path())?;
    page.section("Where to look further", further());
    page.write(run, "report")?;
    run.write("conclusions.csv", &csv_of(&statements)?)?;
    for FurtherTable { name, table, .. } in &found.further_tables {
        table.write(run, name)?;
    }
    Ok(verdicts(&statements, &recipe.extent))
}

/// The same as a page of the documentation, with what made it in its head, and the tables of other runs at its end.
///
/// # Errors
/// If what a stage wrote, or another run, cannot be read.
pub fn docs_page(recipe: &Recipe, run: &Path, others: &[OtherRun], made_by: MadeBy<'_>) -> anyhow::Result<Page> {
    let seeds = recipe.settings.training_seeds(recipe.extent.seeds);
    let seeds = seeds.iter().map(|seed| seed.0.to_string()).collect::<Vec<_>>().join(", ");
    let named: Vec<String> = others.iter().map(OtherRun::to_string).collect();
    let manifest = Manifest::read(run)?;
    let preset = manifest.preset.strip_prefix("full-").unwrap_or(&manifest.preset);
    let of_preset = if preset == "default" { String::new() } else { format!(", preset {preset}") };
    let mut page = Page::new(format!("Results{of_preset}"));
    let more = [("training seeds", seeds)];
    page.text(docs_page::head(&run.display().to_string(), &named, &manifest, made_by, &more));
    page.text(introduction(recipe));
    page.text(cautions(&recipe.settings)?);
    Found::read(recipe, run)?.add_to(&mut page, recipe, run)?;
    others.iter().try_for_each(|other| other.add_to(&mut page))?;
    Ok(page)
}

/// A table with trainings of its own.
struct FurtherTable {
    /// Of its files.
    name: &'static str,
    title: &'static str,
    table: TrainingsTable,
}

/// Those that were asked for.
fn further_tables(recipe: &Recipe, root: &Path) -> anyhow::Result<Vec<FurtherTable>> {
    let Recipe { settings, extent, .. } = recipe;
    let mut tables = Vec::new();
    if let (Some(compared), Some(of)) = (stages::of_rules(settings, extent, root)?, &extent.rules) {
        let table = rules::table(&compared.settings, of, &compared.stages, &root.join(stages::FAMILY))?;
        tables.push(FurtherTable { name: "rules", title: rules::TITLE, table });
    }
    if let Some(stages) = stages::of_deviations(settings, extent, root)? {
        let table = deviations::table(&stages, &root.join(stages::DEVIATIONS))?;
        tables.push(FurtherTable { name: "deviations", title: deviations::TITLE, table });
    }
    Ok(tables)
}

/// What a reader must know before quoting a figure.
fn cautions(settings: &Settings) -> anyhow::Result<String> {
    let points = if has_points_of_paper(settings) {
        let unlike = evaluation::deviations::unlike_the_paper(settings)?;
        let unlike = if unlike.is_empty() {
            "Otherwise, too, the trainings are those of the preset `paper`.".to_owned()
        } else {
            format!("The trainings differ from the preset `paper` in: `{}`.", unlike.join("`, `"))
        };
        format!("The expert's points lie as far as the way is open, as the paper says. {unlike}")
    } else {
        "The expert's points lie at half of the open way, which is our reading of the paper ([paper](paper.md)); it raises η̂ at \
         an unchanged τ, so that η̂ is not comparable with the paper's."
            .to_owned()
    };
    Ok(format!(
        "Before quoting a figure: the widths of the three reference lots were chosen so that a prototype's expert came near the \
         paper's safe ratios ([methods](methods.md#11-lots)). {points} Forward and reverse drives of a trial share their obstacles. One \
         training is one sample: its interval says how sure the rate of *this* network is, not what another training would \
         give; an interval over several trainings is for other seeds, too. *Unseen* are, in tables of the paper's lots, those of \
         them that nothing was trained or tuned on, and elsewhere the generated lots."
    ))
}

/// What the stages found, but their drives.
struct Found {
    weighted: Vec<IterationRow>,
    unweighted: Vec<IterationRow>,
    on_policy: OnPolicy,
    further_tables: Vec<FurtherTable>,
}

impl Found {
    fn read(recipe: &Recipe, root: &Path) -> anyhow::Result<Self> {
        let settings = &recipe.settings;
        let rows = |chain: Chain| {
            let is_trained = chain.is_trained(settings);
            is_trained.then(|| rows_of(root, chain, settings.seed)).transpose().map(Option::unwrap_or_default)
        };
        let (weighted, unweighted) = (rows(Chain::Weighted)?, rows(Chain::Unweighted)?);
        let on_policy = OnPolicy::read(&root.join(stages::ON_POLICY))?;
        Ok(Self { weighted, unweighted, on_policy, further_tables: further_tables(recipe, root)? })
    }

    /// Adds all of it to a page; returns what is concluded.
    fn add_to(&self, page: &mut Page, recipe: &Recipe, root: &Path) -> anyhow::Result<Vec<Statement>> {
        let settings = &recipe.settings;
        let folders = [stages::REFERENCE, stages::UNSEEN];
        let statements = with_drives(&recipe.stages, root, folders, |[reference, unseen]| {
            let statements = statements(settings, &reference, &unseen, &self.weighted, &self.on_policy.effect);
            headline(page, &reference, &unseen);
            page.section("What holds here", verdicts(&statements, &recipe.extent));
            table_1(page, settings, &self.weighted, &self.unweighted, &self.on_policy.effect);
            let judged = JudgedSlices::of(&reference);
            collision_rates(page, &judged);
            safe_ratios(page, &judged);
            unseen_lots(page, &JudgedSlices::of(&unseen));
            page.section("How they drove", how_they_drove(&reference, &unseen));
            page.section("Ablations", "");
            self.add_ablations_to(page, recipe, root, &reference, &unseen)?;
            if recipe.extent.seeds > 1 {
                page.section(
                    "Training seeds",
                    trainings::by_seed(settings, &recipe.extent, root, &reference, &unseen)?,
                );
            }
            Ok(statements)
        })?;
        for FurtherTable { name, title, table } in &self.further_tables {
            page.section(*title, table.text.as_str());
            page.figure(*name, "The same as a plot.", Image::Svg(table.svg.clone()));
        }
        Ok(statements)
    }

    fn add_ablations_to(
        &self,
        page: &mut Page,
        recipe: &Recipe,
        root: &Path,
        reference: &DrivenPlan<'_>,
        unseen: &DrivenPlan<'_>,
    ) -> anyhow::Result<()> {
        let seed = recipe.settings.seed;
        let folders = [stages::RULES, stages::CONTROLS];
        with_drives(&recipe.stages, root, folders, |[rules, controls]| {
            page.text(decision_rules(root, recipe, &rules)?);
            page.text(weight_and_cloning(reference));
            page.text(controls::controls(root, seed, &controls)?);
            Ok(())
        })?;
        if recipe.stages.iter().any(|stage| stage.folder == stages::FAR_POINTS) {
            with_drives(&recipe.stages, root, [stages::FAR_POINTS], |[far]| {
                page.text(controls::points(root, seed, unseen, &far)?);
                Ok(())
            })?;
        }
        let folders = [stages::UNSMOOTHED, stages::SMOOTHED, stages::READINGS, stages::READINGS_UNSEEN];
        with_drives(&recipe.stages, root, folders, |[unsmoothed, smoothed, readings, readings_unseen]| {
            page.text(controls::action_smoothing(&unsmoothed, &smoothed));
            page.text(controls::readings(&readings, &readings_unseen));
            Ok(())
        })?;
        calibration(page, &self.on_policy.calibration);
        Ok(())
    }
}

/// The learned drivers and the best of the others: near-collisions, contacts and least clearance side by side.
fn headline(page: &mut Page, reference: &DrivenPlan<'_>, unseen: &DrivenPlan<'_>) {
    let mut table =
        table_of(&["driver", "lots", "route", "near-collisions", "per 100 m [95 %]", "contacts", "least clearance"]);
    let of_reference = if reference.is_of_papers_lots() { "the paper's three" } else { "of the evaluation" };
    for (driven, label) in [(reference, of_reference), (unseen, "unseen, generated")] {
        let place = Place::new(label, driven, driven.all());
        for name in ["expert", DAGGER, BC, "tentacle, tuned"] {
            let Some(driver) = driven.driver(name) else { continue };
            table.add_row(trainings::headline_row(&place, driver));
        }
    }
    let near_m = reference.plan.settings.episode.metrics.near_collision_m;
    page.section(
        "In short",
        format!(
            "{table}\n\nA *near-collision*: something lies within {near_m} m in the direction of travel; the car is stopped, put \
             back on the route, and drives on. A *contact*: the body touches something. *Least clearance*: the smallest \
             distance of the body to anything in any run. Where there are several trainings, the route is that of each, \
             the rate is their mean, with an interval for other trials or lots and other seeds, and the clearance is the least \
             of all."
        ),
    );
}

/// Contacts, clearance, speed and steering of every driver.
fn how_they_drove(reference: &DrivenPlan<'_>, unseen: &DrivenPlan<'_>) -> String {
    let mut table = table_of(&[
        "driver",
        "lots",
        "contacts",
        "stuck",
        "given up",
        "least clearance m",
        "m/s",
        "reversals per 100 m",
    ]);
    let of_reference = if reference.is_of_papers_lots() { "the paper's" } else { "of the evaluation" };
    for (driven, label) in [(reference, of_reference), (unseen, UNSEEN)] {
        let slice = driven.all();
        for (driver, named) in driven.plan.drivers.iter().enumerate() {
            let totals = driven.results.totals(0, driver, &slice, None);
            table.add_row([
                named.name.clone(),
                label.to_owned(),
                totals.contacts.to_string(),
                totals.stuck.to_string(),
                totals.given_up.to_string(),
                totals.clearance_min_m.map_or_else(|| "–".to_owned(), |metres| format!("{metres:.2}")),
                format!("{:.2}", totals.mean_speed_mps()),
                format!("{:.1}", totals.reversals_per_100m()),
            ]);
        }
    }
    format!("Rates are per length of the route: for runs that were given up they are too low.\n\n{table}")
}

fn statements(
    settings: &Settings,
    reference: &DrivenPlan<'_>,
    unseen: &DrivenPlan<'_>,
    weighted: &[IterationRow],
    effect: &[Effect],
) -> Vec<Statement> {
    let mut statements = conclusions::on_reference_lots(reference);
    // With nearer labels η̂ is another quantity, and is not held against the paper's.
    if table1::has_eta_hat_of_paper(settings) {
        statements.push(conclusions::share_of_the_network(weighted, settings.dagger.eta));
    }
    statements.extend(effect.iter().map(|Effect { iteration, held_back, held_back_by_seed, .. }| {
        conclusions::effect_of_the_weight(*iteration, *held_back, held_back_by_seed)
    }));
    let unseen_lots =
        reference.unseen().and_then(|it| reference.against_dagger(it, "on the lots it was not trained on"));
    let generated = unseen.against_dagger(unseen.all(), "on unseen generated lots");
    for others in [unseen_lots, generated].iter().flatten().map(Against::others) {
        let is_new = |other: &Statement| statements.iter().all(|known| known.claim != other.claim);
        statements.extend(others.into_iter().filter(is_new).collect::<Vec<_>>());
    }
    statements
}

fn introduction(recipe: &Recipe) -> String {
    let settings = &recipe.settings;
    let (evaluation, extent) = (&settings.evaluation, &recipe.extent);
    format!(
        "Vision-based Autonomous Driving for Unstructured Environments Using Imitation Learning (Ahn, Kim, Park), \
         rebuilt in simulation: trained on {}, driven on {} in {} trials, and on {}. Root seed {}{}, seed of the \
         evaluation {}. Everything that made this is in `manifest.toml` and `settings.toml` beside \
         this report; the same command gives the same bytes.\n\n\
         Intervals are of 95 %: exact Poisson intervals (Garwood) for rates, or (b), where events come in clusters, the farther \
         ends of these and a paired bootstrap of whole trials, both ways together; bootstrap for safe ratios and differences. All drivers met \
         the same obstacles and the same noise.{}",
        settings.training.lots.join(", "),
        evaluation.lots.join(", "),
        evaluation.trials,
        extent.unseen.join(", "),
        settings.seed.0,
        if extent.seeds > 1 { format!(" and {} more", extent.seeds - 1) } else { String::new() },
        evaluation.seed.0,
        if extent.seeds > 1 {
            " What names no training and is not of several is of the first: Table 1, what stands beside the paper's figures, \
             the ablations."
        } else {
            ""
        },
    )
}

/// A list under each verdict.
fn verdicts(statements: &[Statement], extent: &Extent) -> String {
    let mut text = "Decided from the runs of this report: a comparison *holds* where the paired interval of 95 % lies on the \
                    paper's side of zero, *does not hold* where it lies on the other, and *cannot be told* where it contains \
                    zero (differences are the other driver's − DAgger's in near-collisions and reversals, DAgger's − the \
                    other driver's in safe ratios; * = excludes zero, by six trials or lots that differ, or more). Beside near-collisions, contacts \
                    in brackets. Statements on none at all, on noise, on the paper's rates, on η̂ and on the weight are decided by the \
                    figures beside them. Nothing is adjusted for the number of statements.\n"
        .to_owned();
    if extent.seeds >= TRAININGS_MIN as u64 {
        text += "\nWhere several figures are named, they are of trainings that differ by their seed: their means are compared, \
                 with an interval for other trials or lots and other seeds, and none of them may have a near-collision where \
                 there should be none; of noise-induced ones each has to have fewer. So is the weight on τ̂, by pairs of trainings. Everything else is of the first training.\n";
    }
    for verdict in [Verdict::Holds, Verdict::DoesNotHold, Verdict::CannotBeTold] {
        let found: Vec<&Statement> = statements.iter().filter(|statement| statement.verdict == verdict).collect();
        let _ = write!(text, "\n### {}: {} of {}\n\n", verdict.title(), found.len(), statements.len());
        if found.is_empty() {
            text += "None.\n";
        }
        for Statement { claim, figures, .. } in found {
            let _ = writeln!(text, "- **{claim}**: {}.", figures.replace('*', "\\*"));
        }
    }
    text
}

fn table_1(
    page: &mut Page,
    settings: &Settings,
    weighted: &[IterationRow],
    unweighted: &[IterationRow],
    effect: &[Effect],
) {
    let weight = weight_of(&settings.dagger.fit.loss);
    let mut table = ByRound::new(weighted, unweighted, &paper::TABLE_1);
    table.add_of("mean weight of τ̂", weighted, |row| row.mean_weight.map(|weight| format!("{weight:.3}")));
    if !unweighted.is_empty() {
        let effect_of = |i: usize| effect.iter().find(|effect| effect.iteration as usize == i);
        table.add("effect of the weight, held-back samples", &|i| {
            let interval = effect_of(i)?.held_back?;
            Some(format!("{:.2} [{:.2}, {:.2}]", interval.estimate, interval.lower, interval.upper))
        });
        table.add("effect of the weight, driving", &|i| {
            let [with, without] = effect_of(i)?.driving_per_s;
            Some(format!("{:.2}", with / without.max(f64::MIN_POSITIVE)))
        });
        table.add("  paper", &|i| table1::of_paper(&paper::TABLE_1.effect, i));
    }
    let of_effect = if unweighted.is_empty() {
        "There is no effect of the weight: nothing is weighted.".to_owned()
    } else {
        format!(
            "The effect compares the two policies trained in a column, with {weight} and with α = 0 on the same data seeds: Σ τ̂ \
             with the weight over Σ τ̂ without, smaller is better. *Held-back samples*: of both data sets so far, resampled in \
             stretches. *Driving*: per second at the wheel of one trial of every lot, the expert watching."
        )
    };
    page.section(
        "Table 1: DAgger iterations",
        format!("{table}\n\nη̂ of a column is of the policy trained in the column before. {of_effect} {READ_ETA_HAT}"),
    );
    let points = |rows: &[IterationRow]| {
        rows.iter().filter_map(|row| Some((row.round, row.eta_hat?))).collect::<Vec<(u32, f64)>>()
    };
    let ours: Vec<EtaSeries> = [(weight, weighted), ("α = 0".to_owned(), unweighted)]
        .into_iter()
        .filter(|(_, rows)| !rows.is_empty())
        .map(|(name, rows)| EtaSeries { name, points: points(rows) })
        .collect();
    let figure = plots::eta(&ours, &table1::eta_hat_of_paper(settings), settings.dagger.eta);
    page.figure("eta", "Share of the network by iteration.", Image::Svg(figure));
}

/// The weight on τ̂, in words.
fn weight_of(loss: &LossSettings) -> String {
    match loss.weight {
        WeightForm::ResidualSq => format!("α = {}", loss.alpha),
        WeightForm::Linear { gain } => format!("the weight 1 + {gain} τ̂"),
    }
}

/// An evaluation, and how every driver stands in each of its slices.
struct JudgedSlices<'a> {
    driven: &'a DrivenPlan<'a>,
    slices: Vec<(Slice, Vec<DriverEstimate>)>,
}

impl<'a> JudgedSlices<'a> {
    fn of(driven: &'a DrivenPlan<'a>) -> Self {
        let judged = |slice: Slice| {
            let estimates = driven.estimates(&slice);
            (slice, estimates)
        };
        Self { driven, slices: driven.results.slices().into_iter().map(judged).collect() }
    }

    fn totals(&self, driver: usize, slice: &Slice) -> Totals {
        self.driven.results.totals(0, driver, slice, None)
    }
}

/// Lots as columns, as in the paper: groups, then what is pooled.
fn by_lot(
    judged: &JudgedSlices<'_>,
    cell: &dyn Fn(&Totals, &DriverEstimate) -> String,
    paper: &dyn Fn(usize, &Slice) -> String,
) -> String {
    let slices = &judged.slices;
    let labels = slices.iter().map(|(slice, _)| escaped(&slice.label));
    let mut table = with_header(std::iter::once("driver".to_owned()).chain(labels).collect());
    for (driver, entry) in judged.driven.plan.drivers.iter().enumerate() {
        let name = &entry.name;
        let cells = slices.iter().map(|(slice, estimates)| cell(&judged.totals(driver, slice), &estimates[driver]));
        table.add_row(std::iter::once(name.clone()).chain(cells));
        if let Some(of_paper) = paper::DRIVERS.iter().position(|known| known == name) {
            let cells: Vec<String> = slices.iter().map(|(slice, _)| paper(of_paper, slice)).collect();
            if cells.iter().any(|cell| !cell.is_empty()) {
                table.add_row(std::iter::once(format!("  paper: {name}")).chain(cells));
            }
        }
    }
    table.to_string()
}

/// Near-collisions and metres of a driver of the paper on the lots of a slice; `None` if the paper drove elsewhere.
fn count_of_paper(driver: usize, slice: &Slice, groups: &[LotGroup]) -> Option<(u32, f64)> {
    let names: Vec<&str> =
        (0..).zip(groups).filter(|&(index, _)| slice.contains(index)).map(|(_, group)| group.name.as_str()).collect();
    let are_papers = names.iter().all(|name| paper::LOTS.iter().any(|lot| lot.lot == *name));
    are_papers.then(|| paper::count(driver, |lot| names.contains(&lot.lot)))
}

fn rates_table(judged: &JudgedSlices<'_>, with_paper: bool) -> String {
    let cell = |totals: &Totals, estimate: &DriverEstimate| {
        format!("{} ({}): {}", totals.near_collisions, totals.contacts, quoted_rate(totals, estimate))
    };
    let of_paper = |driver: usize, slice: &Slice| {
        let count = count_of_paper(driver, slice, judged.driven.results.groups()).filter(|_| with_paper);
        count.map_or_else(String::new, |(events, metres)| format!("{events}: {}", exact_rate(events, metres)))
    };
    by_lot(judged, &cell, &of_paper)
}

/// What the lots of the settings are called: `--preset smoke` has lot b alone.
fn lots_of(driven: &DrivenPlan<'_>) -> &'static str {
    if driven.is_of_papers_lots() { "the paper's lots" } else { "the lots of the evaluation" }
}

fn collision_rates(page: &mut Page, judged: &JudgedSlices<'_>) {
    page.section(
        format!("Collision rates on {}", lots_of(judged.driven)),
        format!(
            "Near-collisions (contacts), and near-collisions per 100 m of the route [95 %]. The paper's counts are recovered from \
             its rates.\n\n{}",
            rates_table(judged, true)
        ),
    );
    let rates = rates_beside_paper(judged);
    page.figure(
        "rates-beside-paper",
        "The paper's comparison beside ours, with intervals of 95 %: of the paper's counts exact ones, of ours as in the table.",
        Image::Svg(plots::bars("Collision rate", "near-collisions per 100 m", &paper::DRIVERS, &rates)),
    );
    page.figure("rates", "Every driver, all of these lots together.", Image::Svg(rates_of_all(judged)));
}

/// Near-collisions per 100 m, the paper's and ours.
fn rates_beside_paper(judged: &JudgedSlices<'_>) -> Vec<BarGroup> {
    bars_beside_paper(
        judged,
        &|totals, estimate| (totals.rate().per_unit, Some(quoted_interval(totals, estimate))),
        &|driver, lot| {
            let (events, metres) = paper::count(driver, |known| known.lot == lot.lot);
            // Of its events nothing is known but their number.
            let rate = Rate::new(events, metres / 100.0);
            (rate.per_unit, Some([rate.lower, rate.upper]))
        },
    )
}

/// A height and its interval.
type Height = (f64, Option<[f64; 2]>);

/// The paper's drivers on its lots, as far as they were driven: its bar, then ours.
fn bars_beside_paper(
    judged: &JudgedSlices<'_>,
    ours: &dyn Fn(&Totals, &DriverEstimate) -> Height,
    theirs: &dyn Fn(usize, &PaperLot) -> Height,
) -> Vec<BarGroup> {
    let group = |lot: &PaperLot| {
        let (slice, estimates) = judged.slices.iter().find(|(slice, _)| slice.label == lot.lot)?;
        let bars = paper::DRIVERS.into_iter().enumerate().flat_map(|(driver, name)| {
            let bar = |(value, interval): Height, is_papers| Bar { driver, value, interval, is_papers };
            let own = judged.driven.driver(name);
            let ours = own.map(|own| bar(ours(&judged.totals(own, slice), &estimates[own]), false));
            std::iter::once(bar(theirs(driver, lot), true)).chain(ours)
        });
        Some(BarGroup { name: lot.lot.to_owned(), bars: bars.collect() })
    };
    paper::LOTS.iter().filter_map(group).collect()
}

/// A row per driver, its lots together.
fn rates_of_all(judged: &JudgedSlices<'_>) -> String {
    let (slice, estimates) = judged.slices.last().expect("at least one lot is driven");
    let row = |(driver, entry): (usize, &NamedDriver)| {
        let totals = judged.totals(driver, slice);
        let name = entry.name.clone();
        let group = match name.as_str() {
            "expert" => 0,
            name if name.starts_with(BC) || name.starts_with(DAGGER) => 1,
            name if name.ends_with("tuned") => 3,
            _ => 2,
        };
        let interval = quoted_interval(&totals, &estimates[driver]);
        RateRow { name, per_100m: totals.rate().per_unit, interval, group }
    };
    let rows: Vec<RateRow> = judged.driven.plan.drivers.iter().enumerate().map(row).collect();
    plots::rates(&format!("Near-collisions, {}", slice.label), &rows)
}

fn safe_ratios(page: &mut Page, judged: &JudgedSlices<'_>) {
    let cell = |totals: &Totals, estimate: &DriverEstimate| {
        let interval = estimate.safe_ratio.map_or_else(String::new, |i| format!(" [{:.3}, {:.3}]", i.lower, i.upper));
        format!("{:.3}{interval}", totals.safe_ratio())
    };
    let of_paper = |driver: usize, slice: &Slice| {
        let lot = paper::LOTS.iter().find(|lot| lot.lot == slice.label);
        lot.map_or_else(String::new, |lot| format!("{:.2}", lot.results[driver].safe_ratio))
    };
    let text = "Drivable share of the metre around the body, mean over runs [95 %]. The widths of these lots were chosen so that \
                a prototype's expert came near the paper's safe ratios: the expert's, and those of who imitates it well, are fitted, not found.";
    page.section(
        format!("Safe ratios on {}", lots_of(judged.driven)),
        format!("{text}\n\n{}", by_lot(judged, &cell, &of_paper)),
    );
    let ratios = bars_beside_paper(
        judged,
        &|totals, estimate| (totals.safe_ratio(), estimate.safe_ratio.map(|interval| [interval.lower, interval.upper])),
        &|driver, lot| (lot.results[driver].safe_ratio, None),
    );
    page.figure(
        "safe-ratios-beside-paper",
        "The paper's safe ratios beside ours; the paper gives no intervals.",
        Image::Svg(plots::bars("Safe ratio", "drivable share of the ring", &paper::DRIVERS, &ratios)),
    );
}

fn unseen_lots(page: &mut Page, judged: &JudgedSlices<'_>) {
    page.section(
        "Unseen generated lots",
        format!(
            "Near-collisions (contacts), and near-collisions per 100 m of the route [95 %]; nothing was trained or tuned on these \
             lots.\n\n{}",
            rates_table(judged, false)
        ),
    );
    page.figure("rates-unseen", "Every driver on generated lots.", Image::Svg(rates_of_all(judged)));
}

fn decision_rules(root: &Path, recipe: &Recipe, driven: &DrivenPlan<'_>) -> anyhow::Result<String> {
    let seed = recipe.settings.seed;
    let mut table = table_of(&[
        "network drives if",
        "iterations",
        "samples, i = 1",
        "η̂, i = 1",
        "near-collisions (contacts) while collecting, i = 1",
        "then driving: near-collisions (contacts)",
        "safe ratio",
    ]);
    let slice = driven.all();
    let estimates = driven.estimates(&slice);
    let chains = [Chain::Weighted, Chain::AnyBelow, Chain::TauOnly];
    for (driver, chain) in chains.into_iter().enumerate() {
        let rows = rows_of(root, chain, seed)?;
        let first = rows.get(1);
        let cell = |of: fn(&IterationRow) -> Option<String>| first.and_then(of).unwrap_or_else(|| "–".to_owned());
        let totals = driven.results.totals(0, driver, &slice, None);
        table.add_row([
            driven.plan.drivers[driver].name.clone(),
            rows.len().saturating_sub(1).min(recipe.extent.rule_iterations as usize).to_string(),
            cell(|row| Some(row.samples.to_string())),
            cell(|row| row.eta_hat.map(|eta| format!("{eta:.3}"))),
            cell(|row| {
                let contacts = row.effort.map(|effort| format!(" ({})", effort.contacts)).unwrap_or_default();
                Some(format!("{}{contacts}", row.near_collisions))
            }),
            format!("{} ({}): {}", totals.near_collisions, totals.contacts, quoted_rate(&totals, &estimates[driver])),
            format!("{:.3}", totals.safe_ratio()),
        ]);
    }
    Ok(format!(
        "### Decision rule\n\nAlgorithm 2, line 9, three ways: all of τ̂ < τ, χ̂ < χ (the text and the figures), any of \
         them (the listing as printed), τ̂ < τ alone. All start from the same behaviour cloning; each ends when η̂ > η, and so \
         they may differ in iterations and samples.\n\n{table}"
    ))
}

/// Pairs of drivers that differ in one thing.
fn weight_and_cloning(driven: &DrivenPlan<'_>) -> String {
    let mut table = table_of(&["", "lots", "Δ near-collisions per 100 m [95 %]", "Δ safe ratio [95 %]"]);
    let judged = |slice: Slice| {
        let (estimates, comparisons) = driven.judge(&slice);
        let teams = driven.judge_teams(&slice, &estimates);
        (slice, comparisons, teams)
    };
    let slices: Vec<_> = driven.results.slices().into_iter().map(judged).collect();
    for name in [BC, UNWEIGHTED] {
        let (Some(driver), Some(_)) = (driven.driver(name), driven.driver(DAGGER)) else { continue };
        for (slice, comparisons, teams) in &slices {
            let Some(found) = comparisons.iter().find(|comparison| comparison.driver == driver) else { continue };
            let of_team = teams.of(driver).and_then(|(_, estimate)| estimate);
            // The first of several does not stand for all where there is too little to judge them by.
            let of_one = found.difference_per_100m.filter(|_| teams.teams.is_empty());
            let near_collisions = of_team.map_or(of_one, |estimate| Some(estimate.difference_per_100m));
            table.add_row([
                format!("{name} − {DAGGER}"),
                escaped(&slice.label),
                difference(near_collisions, 2),
                difference(found.difference_safe_ratio, 3),
            ]);
        }
    }
    format!(
        "### α, and behaviour cloning against DAgger\n\nPaired differences on {}; a positive one in \
         near-collisions speaks for DAgger with the weight (*: excludes zero). Of several trainings the means are compared, safe \
         ratios of the first.\n\n{table}",
        lots_of(driven)
    )
}

fn calibration(page: &mut Page, found: &[Calibration]) {
    let mut table = table_of(&["policy", "states", "axis", "samples", "within 1 σ", "within 2 σ", "RMS error / RMS σ"]);
    for Calibration { policy, states, axis, samples, coverage, bins } in found {
        let states = match states {
            States::HeldBack => "held-back samples",
            States::OnPolicy => "driving, expert watching",
        };
        // Bins hold as many samples each, or one more: close enough for a ratio of two digits.
        let mean_square = |which: usize| bins.iter().map(|bin| bin[which] * bin[which]).sum::<f64>();
        let ratio = (mean_square(1) / mean_square(0).max(f64::MIN_POSITIVE)).sqrt();
        table.add_row([
            policy.clone(),
            states.to_owned(),
            axis.clone(),
            samples.to_string(),
            format!("{:.1} %", 100.0 * coverage[0]),
            format!("{:.1} %", 100.0 * coverage[1]),
            format!("{ratio:.2}"),
        ]);
    }
    page.text(format!(
        "### Calibration of the predicted variance\n\nShares of the expert's answers within 1 σ and 2 σ of the network's \
         (normal errors with the right σ: 68.3 % and 95.4 %), and how large errors are against σ.\n\n{table}"
    ));
    let of = |states: States| -> Vec<AxisCalibration> {
        let of_dagger = found.iter().filter(|row| row.states == states && row.policy == DAGGER);
        of_dagger
            .map(|row| AxisCalibration {
                name: row.axis.clone(),
                samples: row.samples,
                coverage: row.coverage,
                bins: row.bins.clone(),
            })
            .collect()
    };
    for (name, caption, states) in [
        ("calibration-held-back", "DAgger on held-back samples.", States::HeldBack),
        ("calibration-driving", "DAgger at the wheel, the expert watching.", States::OnPolicy),
    ] {
        page.figure(name, caption, Image::Svg(plots::calibration(&of(states))));
    }
}

fn further() -> String {
    "- `drives/*/summary.md`: every table of every evaluation; `failures.md`: each near-collision with its place, its \
     cause and the key that replays it; `cargo xtask render report FOLDER` shows them.\n- `chains/*`: data, networks and Table 1 of each training.\n- \
     `on-policy/on_policy.json`, `conclusions.csv`: the figures of this report.\n"
        .to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use evaluation::plan::Plan;
    use evaluation::results::EvaluationResults;
    use experiment::lots::Lot;
    use experiment::trials::{Purpose, Trial};
    use sim::episode::EpisodeReport;
    use sim::frame::Ending;
    use sim::metrics::EpisodeMetrics;
    use sim::scenario::Direction;
    use sim::seed::RootSeed;

    fn groups(names: &[&str]) -> Vec<LotGroup> {
        names.iter().map(|&name| LotGroup { name: name.to_owned(), lots: 1, is_trained_on: name == "lot-a" }).collect()
    }

    fn counts(names: &[&str]) -> Vec<Option<u32>> {
        let groups = groups(names);
        let tentacle = 1;
        let count = |slice: &Slice| count_of_paper(tentacle, slice, &groups).map(|(events, _)| events);
        Slice::all_of(&groups).iter().map(count).collect()
    }

    /// The bars had exact intervals, and the table above them those of the bootstrap.
    #[test]
    fn bars_have_the_intervals_of_the_table_where_near_collisions_cluster() {
        let settings = Settings::preset("default").unwrap();
        let drivers = [NamedDriver::expert(&settings.expert).renamed(DAGGER)];
        let lots = Lot::parse_all(&["lot-a"], &settings.episode.vehicle).unwrap();
        let plan = Plan { settings: &settings, drivers: &drivers, lots: &lots, compare_with: 0, shard: None };
        let mut results = EvaluationResults::new(&plan);
        for (index, trial) in Trial::all(RootSeed(1), Purpose::Evaluation, &lots, 6, &Direction::BOTH).enumerate() {
            // All in one trial of six.
            let near_collisions = if trial.index == 0 { 9 } else { 0 };
            let metrics = EpisodeMetrics { near_collisions, reference_m: 100.0, ..EpisodeMetrics::default() };
            results.add(0, 0, index, &trial, &EpisodeReport { ending: Ending::ReachedEnd, metrics, events: vec![] });
        }
        let driven = DrivenPlan { plan: &plan, results: &results };
        let judged = JudgedSlices::of(&driven);
        let groups = rates_beside_paper(&judged);
        let ours = groups[0].bars.iter().find(|bar| !bar.is_papers && bar.driver == 0).unwrap();
        let [lower, upper] = ours.interval.unwrap();
        let quoted = format!("{:.2} [{lower:.2}, {upper:.2}] (b)", ours.value);
        assert!(rates_table(&judged, false).contains(&quoted), "{quoted}: {}", rates_table(&judged, false));
        assert!(upper > 1.5 * Rate::new(18, 12.0).upper, "wider than if each came by itself: {quoted}");
    }

    #[test]
    fn the_papers_counts_are_of_the_lots_they_stand_beside() {
        let unseen_and_all = [Some(27 + 20), Some(24 + 27 + 20)];
        assert_eq!(counts(&["lot-a", "lot-b", "lot-c"])[3..], unseen_and_all);
        assert_eq!(counts(&["lot-a", "lot-b"]), [Some(24), Some(27), Some(24 + 27)]);
        assert_eq!(counts(&["lot-a", "lot-b", "my-map"]), [Some(24), Some(27), None, None, None]);
    }
}
