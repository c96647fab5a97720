//! `generate`: lots as TOML plus a top-view PNG.

use crate::cli::GenerateArgs;
use crate::interrupt::{self, Interrupted};
use crate::lots::Lot;
use crate::progress::Work;
use crate::render;
use crate::run_dir::write_whole;
use crate::trials::{Job, Purpose};
use anyhow::{Context as _, ensure};
use sim::map::Map;
use sim::scenario::Direction;
use sim::seed::RootSeed;
use sim::vehicle::VehicleParams;

/// The command.
///
/// # Errors
/// If something named does not exist or a file is there already, or by Ctrl-C.
pub fn run(args: &GenerateArgs) -> anyhow::Result<()> {
    ensure!(args.scale.is_none_or(|scale| scale > 0.0), "--scale must be positive, in pixels per metre");
    ensure!(args.count > 0, "--count is 0; at least one is needed");
    let lots = Lot::parse_all(&args.lots)?;
    std::fs::create_dir_all(&args.out)
        .with_context(|| format!("{}: cannot be created; choose another --out", args.out.display()))?;
    let vehicle = VehicleParams::hyundai_hg300();
    let jobs = Job::all(RootSeed(args.seed), Purpose::Pictures, &lots, args.count, &[Direction::Forward]);
    let total = jobs.clone().count();
    let mut work = Work::begin("generating");
    for (done, job) in jobs.enumerate() {
        if interrupt::is_requested() {
            let kept = format!("{done} of {total} lots are in {}", args.out.display());
            return Err(Interrupted { kept }.into());
        }
        let counter = if args.count > 1 { format!("-{}", job.trial + 1) } else { String::new() };
        let name = format!("{}-s{}{counter}", job.lot.name(), args.seed);
        write(args, &vehicle, &job, &name)?;
        work.at(done as f64 / total as f64, || name);
    }
    work.end(&format!("{total} lots"));
    Ok(())
}

fn write(args: &GenerateArgs, vehicle: &VehicleParams, job: &Job<'_>, name: &str) -> anyhow::Result<()> {
    let [toml, png] = ["toml", "png"].map(|extension| args.out.join(format!("{name}.{extension}")));
    for path in [&toml, &png] {
        ensure!(
            args.overwrite || !path.exists(),
            "{}: exists already; choose another --out or --seed, or replace it with --overwrite",
            path.display()
        );
    }
    let mut scenario = job.lot.scenario(job.seed)?;
    // The file is a lot of its own, told apart from its siblings in tables.
    name.clone_into(&mut scenario.name);
    write_whole(&toml, scenarios::load::to_toml(&scenario).as_bytes())?;
    let map = Map::build(scenario, vehicle).with_context(|| name.to_owned())?;
    write_whole(&png, &render::top_view(&map, vehicle, args.scale)?)?;
    println!("{} and .png: route {:.1} m, {} obstacles", toml.display(), map.path().length_m(), map.scenario().obstacles.len());
    Ok(())
}
