//! `generate`: lots as TOML plus a top-view PNG.

use crate::cli::{GenerateArgs, MapArgs};
use crate::interrupt::{self, Interrupted};
use crate::lots::Lot;
use crate::progress::Work;
use crate::render::{self, lot};
use crate::run_dir::write_whole;
use crate::trials::{Purpose, Trial};
use anyhow::{Context as _, bail, ensure};
use rayon::prelude::*;
use scenarios::import::{self, MapLot};
use sim::map::Map;
use sim::scenario::Direction;
use sim::seed::RootSeed;
use sim::vehicle::VehicleSettings;
use std::path::Path;

/// Lots made at a time; between two groups Ctrl-C is looked at.
const GROUP: usize = 8;

/// The command.
///
/// # Errors
/// If something named does not exist or a file is there already, or by Ctrl-C.
pub fn run(args: &GenerateArgs) -> anyhow::Result<()> {
    ensure!(args.pixels_per_metre.is_none_or(|scale| scale > 0.0), "--pixels-per-metre must be positive");
    ensure!(args.count > 0, "--count is 0; at least one is needed");
    let lots = lots(args)?;
    let fixed = lots.iter().find(|lot| !lot.is_drawn_per_trial());
    ensure!(
        args.count == 1 || fixed.is_none(),
        "--count {}: only the reference lots have other obstacles in every trial, {:?} has not; for several generated \
         lots write --lots train:{0}",
        args.count,
        fixed.map_or("", Lot::name)
    );
    std::fs::create_dir_all(&args.out)
        .with_context(|| format!("{}: cannot be created; choose another --out", args.out.display()))?;
    let jobs: Vec<Trial<'_>> =
        Trial::all(RootSeed(args.seed), Purpose::Pictures, &lots, args.count, &[Direction::Forward]).collect();
    let mut work = Work::begin("generating");
    let mut made = Vec::new();
    for group in jobs.chunks(GROUP) {
        if interrupt::is_requested() {
            let kept = format!("{} of {} lots are in {}", made.len(), jobs.len(), args.out.display());
            return Err(Interrupted { kept }.into());
        }
        let written = group.par_iter().map(|job| write(args, job)).collect::<anyhow::Result<Vec<Made>>>()?;
        for lot in &written {
            println!("{}", lot.line);
        }
        made.extend(written);
        work.at(made.len() as f64 / jobs.len() as f64, || format!("{} lots", made.len()));
    }
    work.end(&format!("{} lots", made.len()));
    let attempts: Vec<u32> = made.iter().filter_map(|made| made.attempts).collect();
    if !attempts.is_empty() {
        let drawn: u32 = attempts.iter().sum();
        let rejected = drawn - attempts.len() as u32;
        println!(
            "generator: {rejected} of {drawn} draws rejected ({:.1} %)",
            100.0 * f64::from(rejected) / f64::from(drawn)
        );
    }
    Ok(())
}

/// The lots named; of a map with the route the command line asks for.
fn lots(args: &GenerateArgs) -> anyhow::Result<Vec<Lot>> {
    let MapArgs { scale, start, goal, is_loop, centre_line, clearance } = &args.map;
    if args.map == MapArgs::default() {
        return Lot::parse_all(&args.lots);
    }
    let [path] = args.lots.as_slice() else {
        bail!("--scale, --start and the like are about one map, and {} lots are named; name one", args.lots.len());
    };
    let path = Path::new(path);
    ensure!(
        import::is_map(path),
        "--scale, --start and the like are about maps, and {} is none; name a .yaml (ROS) or .csv (TPCAP) file",
        path.display()
    );
    let mut lot = MapLot::read(path)?;
    lot.scale = scale.unwrap_or(lot.scale);
    lot.clearance_m = clearance.unwrap_or(lot.clearance_m);
    lot.start = start.or(lot.start);
    if goal.is_some() || *is_loop || centre_line.is_some() {
        (lot.goal, lot.is_loop, lot.centre_line) = (*goal, *is_loop, centre_line.clone());
    }
    Ok(vec![Lot::of_map(path, &lot)?])
}

struct Made {
    attempts: Option<u32>,
    line: String,
}

fn write(args: &GenerateArgs, job: &Trial<'_>) -> anyhow::Result<Made> {
    let name = match (job.lot.is_drawn_per_trial(), args.count) {
        (false, _) => job.lot.name().to_owned(),
        (true, 1) => format!("{}-s{}", job.lot.name(), args.seed),
        (true, _) => format!("{}-s{}-{}", job.lot.name(), args.seed, job.trial + 1),
    };
    let name = render::file_name(&name);
    let [toml, png] = ["toml", "png"].map(|extension| args.out.join(format!("{name}.{extension}")));
    for path in [&toml, &png] {
        ensure!(
            args.overwrite || !path.exists(),
            "{}: exists already; choose another --out or --seed, or replace it with --overwrite",
            path.display()
        );
    }
    let mut drawn = job.lot.draw(job.seed);
    // The file is a lot of its own, told apart from its siblings in tables.
    drawn.scenario.name.clone_from(&name);
    let vehicle = VehicleSettings::hyundai_hg300();
    let text = scenarios::load::to_toml(&drawn.scenario);
    let map = Map::build(drawn.scenario, &vehicle).with_context(|| name.clone())?;
    write_whole(&png, &lot::top_view(&map, &vehicle, args.pixels_per_metre)?.to_png()?)?;
    write_whole(&toml, text.as_bytes())?;
    let (length_m, obstacles) = (map.path().length_m(), map.scenario().obstacles.len());
    // A route found for one way need not leave room at its finish to start back from there.
    let back = Map::build(map.scenario().clone().reversed(), &vehicle);
    let ways =
        back.err().map_or(String::new(), |error| format!("; --directions forward only: on the way back, {error}"));
    let line = format!("{} and .png: route {length_m:.1} m, {obstacles} obstacles{ways}", toml.display());
    Ok(Made { attempts: drawn.attempts, line })
}
