//! `render`: pictures of lots, drives, samples and noise.
//!
//! | file | what |
//! |---|---|
//! | [`drawing`] | a picture as a list of shapes, which becomes PNG or SVG |
//! | [`lot`] | lots from above |
//! | [`trajectories`] | drives over a lot |
//! | [`contact_sheet`] | many lots on one page |
//! | [`grids`] | grids and views, predictions and labels |
//! | [`samples`], [`noise`] | pages of them |

pub mod contact_sheet;
pub mod drawing;
pub mod grids;
pub mod lot;
pub mod noise;
pub mod samples;
pub mod trajectories;

use crate::cli::{
    ColourChoice, Directions, EvaluateArgs, RenderArgs, RenderLotArgs, RenderNoiseArgs, RenderWhat, SamplesArgs,
    TrajectoriesArgs, Way,
};
use crate::drivers::{self, DriverSpec};
use crate::lots::Lot;
use crate::progress::{Stopwatch, Work};
use crate::run_dir::{self, write_whole};
use crate::settings::{NoiseChoice, Settings};
use crate::trials::{self, Purpose, Trial};
use crate::{evaluate, report, run_report, train};
use anyhow::{Context as _, ensure};
use drawing::Drawing;
use policy::checkpoint::Checkpoint;
use policy::dagger::GatedCollector;
use policy::dataset::store::Store;
use policy::network::Predictor;
use rayon::prelude::*;
use sim::batch::run_lockstep;
use sim::driver::Fleet;
use sim::episode::Episode;
use sim::map::Map;
use sim::scenario::Direction;
use sim::seed::RootSeed;
use sim::sensing::noise::Layer;
use sim::sensing::{Inspection, Sensor};
use std::path::Path;
use std::sync::Arc;
use trajectories::{ColourBy, Point, Trajectory};

/// The command.
///
/// # Errors
/// If something named does not exist, or a file is there already or cannot be written.
pub fn run(args: &RenderArgs) -> anyhow::Result<()> {
    let output = Output { folder: &args.out, overwrite: args.overwrite };
    match &args.what {
        RenderWhat::Lot(what) => render_lots(what, &output),
        RenderWhat::ContactSheet(what) => contact_sheet(what, &output),
        RenderWhat::Trajectories(what) => render_trajectories(what, &output),
        RenderWhat::Samples(what) => render_samples(what, &output),
        RenderWhat::Noise(what) => render_noise(what, &output),
        RenderWhat::Report(what) => render_report(&what.run),
    }
}

/// Where pictures go.
struct Output<'a> {
    folder: &'a Path,
    overwrite: bool,
}

impl Output<'_> {
    /// Writes a picture as PNG, and as SVG where it is made of lines.
    fn write(&self, name: &str, drawing: &Drawing, is_vector: bool) -> anyhow::Result<()> {
        let folder = self.folder;
        std::fs::create_dir_all(folder)
            .with_context(|| format!("{}: cannot be created; choose another --out", folder.display()))?;
        let name = file_name(name);
        let mut files = vec![(folder.join(format!("{name}.png")), drawing.to_png()?)];
        if is_vector {
            files.push((folder.join(format!("{name}.svg")), drawing.to_svg().into_bytes()));
        }
        for (path, content) in files {
            ensure!(
                self.overwrite || !path.exists(),
                "{}: exists already; choose another --out, or replace it with --overwrite",
                path.display()
            );
            write_whole(&path, &content)?;
            println!("{}: {} kB", path.display(), content.len().div_ceil(1000));
        }
        Ok(())
    }
}

/// Names of lots and drivers are free text; names of files are not.
pub fn file_name(name: &str) -> String {
    name.replace(|c: char| !c.is_alphanumeric() && !"-_.".contains(c), "-")
}

fn maps(args: &RenderLotArgs) -> anyhow::Result<Vec<Map>> {
    let lots = Lot::parse_all(&args.lots)?;
    let jobs: Vec<Trial<'_>> =
        Trial::all(RootSeed(args.seed), Purpose::Pictures, &lots, 1, &[Direction::Forward]).collect();
    let episode = Settings::preset("default")?.episode;
    let work = Work::begin("drawing lots");
    let maps = jobs.par_iter().map(|job| job.map(&episode)).collect::<anyhow::Result<Vec<Map>>>()?;
    work.end(&format!("{} lots", maps.len()));
    Ok(maps)
}

fn render_lots(args: &RenderLotArgs, output: &Output<'_>) -> anyhow::Result<()> {
    ensure!(args.pixels_per_metre.is_none_or(|scale| scale > 0.0), "--pixels-per-metre must be positive");
    let vehicle = Settings::preset("default")?.episode.vehicle;
    for map in maps(args)? {
        output.write(&map.scenario().name, &lot::top_view(&map, &vehicle, args.pixels_per_metre)?, true)?;
    }
    Ok(())
}

fn contact_sheet(args: &RenderLotArgs, output: &Output<'_>) -> anyhow::Result<()> {
    output.write("contact-sheet", &contact_sheet::picture(&maps(args)?)?, true)
}

fn render_trajectories(args: &TrajectoriesArgs, output: &Output<'_>) -> anyhow::Result<()> {
    ensure!(args.pixels_per_metre.is_none_or(|scale| scale > 0.0), "--pixels-per-metre must be positive");
    let (map, driven, name) = match &args.run {
        Some(run) => driven_in_training(run, args)?,
        None => driven_anew(args)?,
    };
    let by = match args.by.unwrap_or(if args.run.is_some() { ColourChoice::Who } else { ColourChoice::Driver }) {
        ColourChoice::Speed => ColourBy::Speed,
        ColourChoice::Driver => ColourBy::Driver,
        ColourChoice::Who => ColourBy::Source,
    };
    output.write(
        &format!("drive-{name}"),
        &trajectories::picture(&map, &driven, by, &name, args.pixels_per_metre)?,
        true,
    )
}

type Drives = (Arc<Map>, Vec<Trajectory>, String);

/// One drive per driver, all on the same obstacles and noise as in an evaluation.
fn driven_anew(args: &TrajectoriesArgs) -> anyhow::Result<Drives> {
    let (direction, directions) = match args.direction {
        Way::Forward => (Direction::Forward, Directions::Forward),
        Way::Reverse => (Direction::Reverse, Directions::Reverse),
    };
    let evaluation = EvaluateArgs {
        drivers: args.drivers.clone(),
        lots: vec![args.lot.clone()],
        trials: Some(args.trial + 1),
        directions: Some(directions),
        noise: vec![args.noise.clone()],
        compare_with: None,
        seed: args.seed,
        layers: args.layers.clone(),
        out: None,
        overwrite: false,
        ..EvaluateArgs::default()
    };
    let contestants = DriverSpec::parse_all(&args.drivers)?;
    let (settings, _) = evaluate::resolve(&evaluation)?;
    contestants.iter().try_for_each(|contestant| contestant.check(&settings))?;
    let lots = Lot::parse_all(&settings.evaluation.lots)?;
    ensure!(lots.len() == 1, "{:?} stands for {} lots; name one", args.lot, lots.len());
    let seed = trials::trial_seed(settings.evaluation.seed, Purpose::Evaluation, args.trial);
    let job = Trial { lot: &lots[0], direction, trial: args.trial, seed };
    let map = Arc::new(job.map(&settings.episode)?);
    let noise = settings.evaluation.noise[0];
    let mut driven = Vec::new();
    for contestant in &contestants {
        let episodes = trials::start(&[job], &[Arc::clone(&map)], &settings, noise);
        let mut fleet = contestant.fleet(&settings, 1);
        driven.push(drive(&contestant.name, episodes, &mut *fleet));
    }
    let way = report::name(direction);
    Ok((map, driven, format!("{} {way} trial {}", job.lot.name(), args.trial)))
}

/// A drive of a training round: the network of the round before and the expert, as in the training itself.
fn driven_in_training(run: &Path, args: &TrajectoriesArgs) -> anyhow::Result<Drives> {
    let settings = run_dir::settings_of(run)?;
    let lots = Lot::parse_all(&settings.training.lots)?;
    let mut episodes = train::episodes_of(&settings, &lots, args.round)?;
    let count = episodes.len();
    ensure!((args.trial as usize) < count, "--trial {}: a round has {count} drives, counted from 0", args.trial);
    let episode = episodes.swap_remove(args.trial as usize);
    let map = Arc::clone(episode.map());
    let novice = args.round.checked_sub(1).map(|before| run.join(format!("round-{before:02}")));
    let novice = novice.map(|folder| Checkpoint::load(&folder)).transpose()?;
    let novice = novice.map(|checkpoint| Predictor::new(checkpoint.weights, settings.dagger.device));
    let jitter = u64::from(args.round) << 20 | u64::from(args.trial);
    let expert = drivers::expert(&settings).with_jitter_seed(settings.seed, jitter);
    let dagger = &settings.dagger;
    let mut collector = GatedCollector::new(novice, vec![Box::new(expert)], dagger.rule, dagger.keep, dagger.geometry);
    let name = format!("{} round {} drive {}", map.scenario().name, args.round, args.trial);
    Ok((map, vec![drive("training", vec![episode], &mut collector)], name))
}

fn drive(name: &str, episodes: Vec<Episode>, fleet: &mut dyn Fleet) -> Trajectory {
    let length_m = episodes[0].map().path().length_m();
    let mut work = Work::begin(name);
    let mut points = Vec::new();
    let reports = run_lockstep(episodes, fleet, &mut |_, frame| {
        points.push(Point::of(frame));
        work.at(f64::from(frame.progress_m / length_m), || format!("{} ticks", points.len()));
    });
    work.end(&format!("{} near-collisions in {length_m:.0} m", reports[0].metrics.near_collisions));
    Trajectory { name: name.to_owned(), points }
}

fn render_samples(args: &SamplesArgs, output: &Output<'_>) -> anyhow::Result<()> {
    ensure!(args.count > 0, "--count is 0; at least one is needed");
    let name = args.round.file_name().unwrap_or_default().to_string_lossy();
    let index = name.strip_prefix("round-").and_then(|index| index.parse().ok());
    let (Some(index), Some(run)) = (index, args.round.parent()) else {
        anyhow::bail!("{}: this is no round; name one, as in runs/NAME/round-01", args.round.display());
    };
    // Opening a store creates its folder.
    ensure!(args.round.is_dir(), "{}: there is no such round", args.round.display());
    let kept = Store::open(run)?.read_samples(index)?;
    let settings = run_dir::settings_of(run)?;
    let folder = args.net.as_deref().unwrap_or(&args.round);
    let checkpoint =
        (args.net.is_some() || Checkpoint::exists(folder)).then(|| Checkpoint::load(folder)).transpose()?;
    let count = args.count.min(kept.len());
    let chosen: Vec<usize> = (0..count).map(|i| (2 * i + 1) * kept.len() / (2 * count)).collect();
    let grids: Vec<_> = chosen.iter().map(|&i| &kept[i].grid).collect();
    let answers =
        checkpoint.map(|checkpoint| Predictor::new(checkpoint.weights, settings.dagger.device).predict(&grids));
    let samples: Vec<_> = chosen
        .iter()
        .enumerate()
        .map(|(place, &i)| (i, kept[i], answers.as_ref().map(|answers| answers[place])))
        .collect();
    let title = format!("{name}: {count} of {} samples", kept.len());
    output.write(&format!("samples-{name}"), &samples::picture(&title, &samples, &settings.dagger.geometry)?, false)
}

fn render_noise(args: &RenderNoiseArgs, output: &Output<'_>) -> anyhow::Result<()> {
    let lots = Lot::parse_all(std::slice::from_ref(&args.lot))?;
    let job = Trial::all(RootSeed(args.seed), Purpose::Pictures, &lots, 1, &[Direction::Forward]).next();
    let (Some(job), 1, Some(&last)) = (job, lots.len(), args.noise.last()) else {
        anyhow::bail!("{:?} stands for {} lots; name one", args.lot, lots.len());
    };
    let settings = Settings::preset("default")?;
    let map = job.map(&settings.episode)?;
    let inspect = |noise: NoiseChoice, at_m: f32| inspect(&settings, &job, &map, noise, at_m);
    let at_m = match args.at {
        Some(at_m) => at_m,
        None => richest_place(map.path().length_m(), |at_m| inspect(last, at_m)),
    };
    ensure!(
        (0.0..=map.path().length_m()).contains(&at_m),
        "--at {at_m}: the route is {:.1} m long",
        map.path().length_m()
    );
    let levels: Vec<(String, Inspection)> =
        args.noise.iter().map(|&noise| (noise.name(), inspect(noise, at_m))).collect();
    let title = format!("{}, {at_m:.1} m along the route, seed {}", job.lot.name(), args.seed);
    output.write(&format!("noise-{}", job.lot.name()), &noise::picture(&title, &levels)?, false)
}

/// What is seen on the route at a place, about when a car at 1.4 m/s gets there.
fn inspect(settings: &Settings, job: &Trial<'_>, map: &Map, noise: NoiseChoice, at_m: f32) -> Inspection {
    let episode = trials::episode_config(settings, noise, map);
    let tick = (at_m / (1.4 * episode.control_period_s())) as u32;
    let mut sensor = Sensor::new(map, episode.sensing, &episode.noise, job.episode_seed());
    let pose = map.path().pose_at(at_m);
    let shown = sensor.observe(map, pose, tick);
    sensor.inspect(map, pose, tick, &shown)
}

fn render_report(run: &Path) -> anyhow::Result<()> {
    ensure!(
        run.join("settings.toml").is_file(),
        "{}: this is no run; name a folder that train-dagger, train-bc or evaluate made",
        run.display()
    );
    run_report::write(run, &mut Stopwatch::default())?;
    println!("{}", run.join(run_report::FILE).display());
    Ok(())
}

/// Where most layers make cells wrong; among these, where most cells are.
fn richest_place(length_m: f32, inspect: impl Fn(f32) -> Inspection + Sync) -> f32 {
    let places: Vec<f32> = (0..(length_m / 2.0) as u32).map(|i| 2.0 * i as f32).collect();
    let richness = |inspection: &Inspection| {
        let cells = Layer::ALL.map(|layer| inspection.count_cells(layer));
        (cells.iter().filter(|&&n| n > 0).count(), cells.iter().sum::<usize>())
    };
    let rich: Vec<_> = places.par_iter().map(|&at_m| richness(&inspect(at_m))).collect();
    let best = (0..places.len()).rev().max_by_key(|&i| rich[i]).unwrap_or(0);
    places.get(best).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests;
