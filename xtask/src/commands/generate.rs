//! `generate`: lots as TOML plus a top-view PNG.

use super::render::check_scale;
use crate::args::lot_name;
use crate::console::{Console, counted_lots};
use crate::output::Output;
use anyhow::{Context as _, bail, ensure};
use clap::Args;
use experiment::lots::Lot;
use experiment::notes;
use experiment::progress::{Interrupted, Progress};
use experiment::settings::NoiseChoice;
use experiment::shard::Shard;
use experiment::trials::{Purpose, Trial};
use rayon::prelude::*;
use report::drawn_lots::{DrawnLot, DrawnLots};
use scenarios::import::{self, MapLot};
use sim::collision::{BodyBox, ObstacleSet};
use sim::limits::TRIAL_MAX;
use sim::map::Map;
use sim::metrics::MetricsSettings;
use sim::scenario::{Direction, Scenario};
use sim::seed::RootSeed;
use sim::vehicle::VehicleSettings;
use std::path::{Path, PathBuf};

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask generate --lots lot-a,lot-b,lot-c --out lots
  cargo xtask generate --lots lot-a --seed 7 --count 5 --out lots
  cargo xtask generate --lots train:1000 --shard 2/16 --out lots
  cargo xtask generate --lots my-map.yaml --scale 20 --start 0.4,1.2,90 --goal 3.1,0.5,-90 --out lots
  cargo xtask generate --lots my-map.yaml --start 4,2,0 --loop --out lots";

#[derive(Debug, Clone, Args)]
pub(crate) struct GenerateArgs {
    /// Lots to write; see `cargo xtask lots`.
    #[arg(long, alias = "lot", value_name = "SPEC", num_args = 1.., value_delimiter = ',', value_parser = lot_name, required = true)]
    lots: Vec<String>,
    /// Seed of the obstacles of lot-a, lot-b and lot-c; other lots are the same with any seed.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Drawings of each lot, each with its own obstacles.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=i64::from(TRIAL_MAX)))]
    count: u32,
    /// Folder to write into.
    #[arg(long, value_name = "DIR", default_value = "lots")]
    out: PathBuf,
    /// Pixels per metre of the pictures [default: as fits 1600 pixels].
    #[arg(long, value_name = "PIXELS")]
    pixels_per_metre: Option<f32>,
    /// Replaces files of the same name.
    #[arg(long)]
    overwrite: bool,
    /// Writes only a share of the lots, for one of several machines (docs/cluster.md); all may write into one folder.
    #[arg(long, value_name = "NUMBER/OF")]
    shard: Option<Shard>,
    /// Where to drive on a map.
    #[command(flatten)]
    map: MapArgs,
}

/// Where to drive on a ROS map (`--lots MAP.yaml`) or TPCAP case (`--lots CASE.csv`).
#[derive(Debug, Clone, Default, PartialEq, Args)]
#[command(next_help_heading = "Maps")]
pub(crate) struct MapArgs {
    /// Makes the lot this many times as large as the map.
    #[arg(long, value_name = "FACTOR", allow_negative_numbers = true)]
    scale: Option<f64>,
    /// Where the rear axle starts on a map: metres, metres (of the map, before --scale), degrees counter-clockwise from x.
    /// What is not given is read from MAP.lot.toml.
    #[arg(long, value_name = "X,Y,DEG", value_parser = pose, allow_hyphen_values = true)]
    start: Option<[f64; 3]>,
    /// Where the rear axle is to arrive, in the same form; the route there is found automatically.
    #[arg(long, value_name = "X,Y,DEG", value_parser = pose, allow_hyphen_values = true)]
    goal: Option<[f64; 3]>,
    /// Routes the car round a loop, back to the start, instead of to a goal.
    #[arg(long = "loop", conflicts_with = "goal")]
    is_loop: bool,
    /// CSV file with the route of the rear axle, x and y in metres, instead of all three.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["start", "goal", "is_loop", "clearance"])]
    centre_line: Option<PathBuf>,
    /// Clearance that a route found automatically keeps around the body, metres in the lot [default: 0.25].
    #[arg(long, value_name = "METRES", allow_negative_numbers = true)]
    clearance: Option<f32>,
    /// Takes occupied specks up to this size for free ground, m² in the lot: stray pixels of a scan.
    #[arg(long, value_name = "M2", allow_negative_numbers = true)]
    drop_specks: Option<f64>,
    /// Closes ways that leave the route with kerbs.
    #[arg(long)]
    close_branches: bool,
    /// Reads the image of the map wherever its YAML file says, not only beside or below that file.
    #[arg(long)]
    image_anywhere: bool,
}

/// `X,Y,DEG`.
fn pose(text: &str) -> Result<[f64; 3], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    numbers
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or_else(|| "write x,y,degrees, e.g. 3.5,-2,90, without spaces".to_owned())
}

/// Lots generated at a time, or one for each thread, if there are more; Ctrl-C takes effect between two batches.
const BATCH_MIN: usize = 8;

pub(crate) fn run(args: &GenerateArgs, output: &Output) -> anyhow::Result<()> {
    check_scale(args.pixels_per_metre)?;
    let vehicle = VehicleSettings::hyundai_hg300();
    let lots = lots(args, &vehicle)?;
    output.notes(&notes::of(&lots, &[NoiseChoice::Lot]));
    let fixed = lots.iter().find(|lot| !lot.is_drawn_per_trial());
    ensure!(
        args.count == 1 || fixed.is_none(),
        "--count {}: only the reference lots have other obstacles in every trial, {:?} does not; for several generated \
         lots write --lots train:{0}",
        args.count,
        fixed.map_or("", Lot::name)
    );
    let trials: Vec<Trial<'_>> =
        Trial::all(RootSeed(args.seed), Purpose::Pictures, &lots, args.count, &[Direction::Forward])
            .enumerate()
            .filter(|(index, _)| args.shard.is_none_or(|shard| shard.takes(*index)))
            .map(|(_, trial)| trial)
            .collect();
    drawn_lots(args).ensure_free(&lots, &trials)?;
    let made = write_all(args, &trials, &Console::new(output), &|made: &Made| output.print(&made.line))?;
    let rejected: u32 = made.iter().filter_map(|made| made.attempts).map(|attempts| attempts - 1).sum();
    if rejected > 0 {
        output.print(rejected_said(rejected));
    }
    Ok(())
}

/// Writes the lots of all trials, and says of each that it is written.
fn write_all(
    args: &GenerateArgs,
    trials: &[Trial<'_>],
    progress: &dyn Progress,
    say: &dyn Fn(&Made),
) -> anyhow::Result<Vec<Made>> {
    progress.begin("generating", "generating");
    // What is done at the first report counts as done before.
    progress.at(0.0, &mut |_| String::new());
    let mut made = Vec::new();
    for batch in trials.chunks(BATCH_MIN.max(rayon::current_num_threads())) {
        if progress.is_cancelled() {
            let kept = format!("{} of {} lots are in {}", made.len(), trials.len(), args.out.display());
            return Err(Interrupted { kept }.into());
        }
        let written = batch.par_iter().map(|trial| write(args, trial)).collect::<anyhow::Result<Vec<Made>>>()?;
        for lot in &written {
            say(lot);
        }
        made.extend(written);
        progress.at(made.len() as f64 / trials.len() as f64, &mut |_| counted_lots(made.len()));
    }
    progress.end(&counted_lots(made.len()));
    Ok(made)
}

fn rejected_said(draws: u32) -> String {
    if draws == 1 {
        "generator: 1 draw had no drivable route and was drawn again".to_owned()
    } else {
        format!("generator: {draws} draws had no drivable route and were drawn again")
    }
}

/// The lots named; of a map with the route the command line asks for.
fn lots(args: &GenerateArgs, vehicle: &VehicleSettings) -> anyhow::Result<Vec<Lot>> {
    let MapArgs { scale, start, goal, is_loop, centre_line, clearance, drop_specks, close_branches, image_anywhere } =
        &args.map;
    if args.map == MapArgs::default() {
        return Lot::parse_all(&args.lots, vehicle);
    }
    let [path] = args.lots.as_slice() else {
        bail!("--scale, --start and the like apply to one map, and {} lots are named; name one", args.lots.len());
    };
    let path = Path::new(path);
    ensure!(
        import::is_map(path),
        "--scale, --start and the like apply to maps, and {} is not one; name a .yaml (ROS) or .csv (TPCAP) file",
        path.display()
    );
    let mut lot = MapLot::read(path)?;
    lot.scale = scale.unwrap_or(lot.scale);
    lot.is_image_anywhere = *image_anywhere;
    lot.close_branches |= close_branches;
    lot.drop_specks_m2 = drop_specks.unwrap_or(lot.drop_specks_m2);
    // Where it goes, by the flags, or by the file.
    if goal.is_some() || *is_loop || centre_line.is_some() {
        (lot.goal, lot.is_loop, lot.centre_line) = (*goal, *is_loop, centre_line.clone());
        lot.start = lot.start.filter(|_| centre_line.is_none());
        lot.clearance_m = lot.clearance_m.filter(|_| centre_line.is_none());
    }
    lot.start = start.or(lot.start);
    lot.clearance_m = clearance.or(lot.clearance_m);
    // An error names the file, in which something else may stand.
    Ok(vec![Lot::of_map(path, &lot, vehicle).context("with the flags that are given")?])
}

fn drawn_lots(args: &GenerateArgs) -> DrawnLots<'_> {
    DrawnLots { out: &args.out, seed: args.seed, count: args.count, overwrite: args.overwrite }
}

/// Why a lot cannot be driven back: a route found for one way need not leave room to start at its finish, or to stand at its
/// start the other way round.
fn fault_on_the_way_back(scenario: &Scenario, vehicle: &VehicleSettings) -> Option<String> {
    let map = match Map::build(scenario.clone().reversed(), vehicle) {
        Ok(map) => map,
        Err(error) => return Some(error.to_string()),
    };
    let end = map.path().pose_at(map.path().length_m());
    let (body, near_m) = (BodyBox::new(vehicle), MetricsSettings::paper().near_collision_m);
    // Every drive would be stopped before what is nearer than that.
    let hits = |ahead_m: f32| {
        let pose = end.advanced_along_arc(0.0, ahead_m);
        map.collision().body_hits(&body, pose, ObstacleSet::NonDrivable)
    };
    let is_blocked = [0.0, 0.5 * near_m, near_m].into_iter().any(hits);
    is_blocked.then(|| {
        format!("the car does not fit at the finish, ({:.2}, {:.2}); leave room behind the start", end.x_m, end.y_m)
    })
}

struct Made {
    attempts: Option<u32>,
    line: String,
}

fn write(args: &GenerateArgs, trial: &Trial<'_>) -> anyhow::Result<Made> {
    let vehicle = VehicleSettings::hyundai_hg300();
    let drawn = drawn_lots(args).draw(trial, &vehicle)?;
    let toml = drawn_lots(args).write(&drawn, &vehicle, args.pixels_per_metre)?;
    let DrawnLot { map, attempts, .. } = drawn;
    let (length_m, obstacles) = (map.path().length_m(), map.scenario().obstacles.len());
    let ways = fault_on_the_way_back(map.scenario(), &vehicle)
        .map_or_else(String::new, |fault| format!("; --directions forward only: on the way back, {fault}"));
    let obstacles = if obstacles == 1 { "1 obstacle".to_owned() } else { format!("{obstacles} obstacles") };
    let line = format!("{} and .png: route {length_m:.1} m, {obstacles}{ways}", toml.display());
    Ok(Made { attempts, line })
}

#[cfg(test)]
mod tests {
    use super::*;
    use experiment::progress::Shares;

    /// The first report came with the first lots, which counted as done before the command: a second before its end it
    /// had "about 16 min left".
    #[test]
    fn the_time_left_is_measured_from_the_first_lot_on() {
        let out = std::env::temp_dir().join(format!("lotpilot-generate-{}", std::process::id()));
        std::fs::create_dir_all(&out).unwrap();
        let args = GenerateArgs {
            lots: vec!["lot-b".to_owned()],
            seed: 1,
            count: 1,
            out: out.clone(),
            pixels_per_metre: None,
            overwrite: true,
            shard: None,
            map: MapArgs::default(),
        };
        let lots = lots(&args, &VehicleSettings::hyundai_hg300()).unwrap();
        let trials: Vec<Trial<'_>> =
            Trial::all(RootSeed(1), Purpose::Pictures, &lots, 1, &[Direction::Forward]).collect();
        let shares = Shares::default();
        let made = write_all(&args, &trials, &shares, &|_: &Made| {}).unwrap();
        assert_eq!((made.len(), shares.0.into_inner()), (1, vec![0.0, 1.0]));
        std::fs::remove_dir_all(out).unwrap();
    }

    /// A lot whose start stood close before a wall was said to be drivable both ways; every drive back ended at that wall.
    #[test]
    fn a_way_back_that_ends_at_a_wall_is_said() {
        let vehicle = VehicleSettings::hyundai_hg300();
        let fault = |wall_x_m: f32| {
            let boundary = [(wall_x_m, -3.0), (62.0, -3.0), (62.0, 3.0), (wall_x_m, 3.0)];
            fault_on_the_way_back(&Scenario::new("lane", boundary, [(0.0, 0.0), (40.0, 0.0)]), &vehicle)
        };
        assert_eq!(fault(-18.0), None);
        // The bumper comes to x = −3.80 m, and is stopped 0.5 m before a wall.
        assert_eq!(fault(-4.5), None);
        for wall_x_m in [-4.1, -2.0] {
            let fault = fault(wall_x_m).expect("it is blocked");
            assert!(fault.starts_with("the car does not fit at the finish, ("), "{fault}");
        }
    }

    /// It said "0 of 9 draws rejected (0.0 %)", of which nobody knew what it means.
    #[test]
    fn draws_that_were_drawn_again_are_said_in_words() {
        assert_eq!(rejected_said(1), "generator: 1 draw had no drivable route and was drawn again");
        assert_eq!(rejected_said(3), "generator: 3 draws had no drivable route and were drawn again");
    }
}
