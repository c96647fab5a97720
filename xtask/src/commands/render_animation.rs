//! `render animation`: drives that move, as GIF or APNG.

use super::evaluate;
use super::one_trial::TrialArgs;
use crate::args::LayerArgs;
use crate::console::Console;
use crate::output::Output;
use crate::picture_folder::Folder;
use anyhow::{Context as _, ensure};
use clap::{ArgGroup, Args, ValueEnum};
use experiment::drive::Replay;
use experiment::drivers::{DriverSpec, NamedDriver};
use experiment::progress::{Interrupted, Progress as _};
use experiment::replay_key::ReplayKey;
use experiment::settings::{Layers, Settings};
use report::pictures::animation::{Camera, Layout, Scene, Take};
use report::pictures::encode::Format;
use std::ops::{ControlFlow, RangeInclusive};

/// Before and after the tick of a replay key, seconds.
const AROUND_S: [f32; 2] = [8.0, 3.0];
/// Times faster than life.
const SPEEDS: RangeInclusive<f32> = 0.1..=1000.0;
/// What a README or a report may carry.
const LIMIT_BYTES: usize = 3_000_000;
/// Pictures that are drawn before they are put together: half a megabyte each.
const PICTURES_MAX: u32 = 3000;
/// Frames of a whole drive that play faster than life.
const FRAMES_WANTED: f32 = 320.0;

#[derive(Debug, Clone, Args)]
#[command(group = ArgGroup::new("who").args(["keys", "drivers"]).required(true))]
pub(crate) struct AnimationArgs {
    /// Replay keys of one trial, as a report or failures.md lists them: the seconds around their ticks.
    #[arg(value_name = "KEY", conflicts_with_all = TrialArgs::FLAGS)]
    keys: Vec<String>,
    /// Drivers, as in an evaluation, instead of keys; may be repeated. See `cargo xtask drivers`.
    #[arg(long = "driver", value_name = "SPEC", num_args = 1..)]
    drivers: Vec<String>,
    #[command(flatten)]
    trial: TrialArgs,
    /// Start of what is shown, seconds [default: 8 s before the tick of a key, else 0].
    #[arg(long, value_name = "SECONDS")]
    from: Option<f32>,
    /// End of what is shown, seconds [default: 3 s after the tick of a key, else the end of the drives].
    #[arg(long, value_name = "SECONDS")]
    to: Option<f32>,
    /// What the top view shows [default: the place around the tick of a key, else the lot].
    #[arg(long)]
    view: Option<ViewChoice>,
    /// Plays this many times faster than life [default: 1 for keys, else so that it comes to about 320 pictures].
    #[arg(long, value_name = "FACTOR")]
    speed: Option<f32>,
    /// Frames per second; fewer are kept where the file would be larger than 3 MB.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u16).range(1..=50))]
    fps: u16,
    /// File format.
    #[arg(long, default_value = "gif")]
    format: FormatChoice,
    /// Name of the file without ending [default: drive-LOT-DIRECTION-trial-N].
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    #[command(flatten)]
    layers: LayerArgs,
}

/// What the top view shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ViewChoice {
    /// The whole lot.
    Lot,
    /// 28 m around the car of the first driver.
    Follow,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum FormatChoice {
    /// GIF.
    Gif,
    /// Animated PNG.
    Apng,
}

pub(super) fn run(args: &AnimationArgs, folder: &Folder<'_>) -> anyhow::Result<()> {
    let is_time = |seconds: f32| seconds >= 0.0 && seconds.is_finite();
    ensure!([args.from, args.to].into_iter().flatten().all(is_time), "--from and --to are seconds, 0 or more");
    ensure!(
        args.speed.is_none_or(|speed| SPEEDS.contains(&speed)),
        "--speed must be {} to {}",
        SPEEDS.start(),
        SPEEDS.end()
    );
    let (settings, keys) = resolve(args, folder.output)?;
    let first = &keys[0];
    let trial = format!("{} {} trial {}", first.lot, first.direction.name(), first.trial);
    let format = match args.format {
        FormatChoice::Gif => Format::Gif,
        FormatChoice::Apng => Format::Apng,
    };
    let path = folder.file(args.name.as_ref().unwrap_or(&format!("drive-{trial}")), format.extension())?;

    let replay = Replay::new(first, &settings.episode)?;
    let drivers = load(&keys, &settings)?;
    let moments = moments(&keys, &drivers, &settings, args.to)?;
    let (earliest, latest) = (moments.first(), moments.last());
    let to_s = args.to.or(latest.map(|latest| latest.at_s + AROUND_S[1]));
    let takes = drive(&replay, &settings, &drivers, to_s.unwrap_or(f32::INFINITY), folder.output)?;

    let end_s = takes.iter().map(|take| take.observed_at_s(take.frames.len() - 1)).fold(0.0, f32::max);
    let from_s = args.from.or(earliest.map(|earliest| earliest.at_s - AROUND_S[0])).unwrap_or(0.0).max(0.0);
    let to_s = to_s.unwrap_or(end_s).min(end_s);
    ensure!(from_s < to_s, "from {from_s:.1} s to {to_s:.1} s there is nothing to show; choose other --from and --to");
    let shown_cs = shown_cs(args.fps);
    let whole = ((to_s - from_s) / step_s(1.0, shown_cs) / FRAMES_WANTED).ceil().max(1.0);
    let speed = args.speed.unwrap_or(if moments.is_empty() { whole } else { 1.0 });
    let step_s = step_s(speed, shown_cs);
    let count = steps(from_s, to_s, step_s);
    ensure!(
        count < PICTURES_MAX,
        "this comes to {count} pictures, and at most {PICTURES_MAX} are drawn; show less with --from and --to, fewer with \
         --fps, or faster with --speed"
    );
    let times = times_s(from_s, to_s, step_s);

    let camera = match (args.view, earliest) {
        (Some(ViewChoice::Follow), _) => Camera::Follow,
        (None, Some(earliest)) => earliest.place(&takes),
        (Some(ViewChoice::Lot), _) | (None, None) => Camera::Lot,
    };
    let layout = if camera == Camera::Lot { Layout::fitting(&replay.map) } else { Layout::Beside };
    let title = format!("{trial}, noise {}, {speed}x", first.noise);
    let console = Console::new(folder.output);
    console.begin("animation", "drawing");
    let scene = Scene::new(&replay, &settings.episode, takes, &times, (camera, layout), title);
    let reel = scene.reel()?;
    let (bytes, stride) = reel.encode_within(LIMIT_BYTES, shown_cs, format)?;
    let fewer = if stride == 1 { String::new() } else { format!(", one of {stride} kept for size") };
    console.end(&format!("{} frames{fewer}", reel.len()));
    folder.put(&path, &bytes)
}

/// How long a picture is shown, in hundredths of a second, which the formats count in.
fn shown_cs(fps: u16) -> u16 {
    100 / fps
}

/// What passes from one picture to the next, s.
fn step_s(speed: f32, shown_cs: u16) -> f32 {
    speed * f32::from(shown_cs) / 100.0
}

/// Whole steps from one time to another.
fn steps(from_s: f32, to_s: f32, step_s: f32) -> u32 {
    ((to_s - from_s) / step_s) as u32
}

/// From one time to another, the last one included: whoever drives longest arrives there.
fn times_s(from_s: f32, to_s: f32, step_s: f32) -> Vec<f32> {
    let count = steps(from_s, to_s, step_s);
    let mut times_s: Vec<f32> = (0..=count).map(|i| from_s + i as f32 * step_s).collect();
    times_s.extend((times_s[count as usize] < to_s).then_some(to_s));
    times_s
}

/// What is to be driven: a key per driver.
fn resolve(args: &AnimationArgs, output: &Output) -> anyhow::Result<(Settings, Vec<ReplayKey>)> {
    let keys: Vec<ReplayKey> = args.keys.iter().map(|key| key.parse()).collect::<anyhow::Result<_>>()?;
    let Some(first) = keys.first() else {
        let (settings, _, keys) = args.trial.keys(&DriverSpec::parse_all(&args.drivers)?, &args.layers, output)?;
        return Ok((settings, keys));
    };
    let drivers: Vec<DriverSpec> = keys.iter().map(|key| key.driver.clone()).collect();
    let (settings, _) = evaluate::settings_for(&drivers, &Layers::from(&args.layers), output)?;
    let trial = |key: &ReplayKey| (key.lot.clone(), key.direction, key.trial, key.noise, key.seed);
    for key in &keys {
        ensure!(
            trial(key) == trial(first),
            "{key} is of another trial than {first}; one animation shows one lot, direction, trial, noise and seed"
        );
    }
    Ok((settings, keys))
}

/// The drivers of keys, in their order.
fn load(keys: &[ReplayKey], settings: &Settings) -> anyhow::Result<Vec<NamedDriver>> {
    let load = |key: &ReplayKey| {
        let driver = key.driver.clone().load(settings)?;
        driver.check(settings).with_context(|| key.to_string())?;
        Ok(driver)
    };
    keys.iter().map(load).collect()
}

/// The moment of a key.
#[derive(Debug, Clone, Copy)]
struct Moment {
    /// Place of the key, and of its driver's take, in the order of all.
    index: usize,
    /// When it was observed, seconds.
    at_s: f32,
}

impl Moment {
    /// Where it happens: where the driver of its key is, not the first one.
    fn place(self, takes: &[Take]) -> Camera {
        let take = &takes[self.index];
        let pose = take.frames[take.index_at(self.at_s)].vehicle.pose;
        Camera::Place(pose.position() + 3.0 * pose.ahead())
    }
}

/// The moments of keys that have one, the earliest first. `to_s`: where the pictures end, if that was said.
fn moments(
    keys: &[ReplayKey],
    drivers: &[NamedDriver],
    settings: &Settings,
    to_s: Option<f32>,
) -> anyhow::Result<Vec<Moment>> {
    let mut moments = Vec::new();
    for (index, (key, driver)) in keys.iter().zip(drivers).enumerate().filter(|(_, (key, _))| key.tick > 0) {
        let at_s = Replay::new(key, &settings.episode)?.observed_at_s(&settings.episode, driver)?;
        if let Some(to_s) = to_s {
            ensure!(to_s >= at_s, "--to {to_s}: the moment of {key} comes later, at {at_s:.1} s; choose a later one");
        }
        moments.push(Moment { index, at_s });
    }
    moments.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
    Ok(moments)
}

/// Drives the trial with each of the drivers, up to a time.
fn drive(
    replay: &Replay,
    settings: &Settings,
    drivers: &[NamedDriver],
    to_s: f32,
    output: &Output,
) -> anyhow::Result<Vec<Take>> {
    let console = Console::new(output);
    let length_m = replay.map.path().length_m();
    let mut takes = Vec::new();
    for driver in drivers {
        console.begin("driving", &driver.name);
        let take = Take::of(replay, &settings.episode, driver, |frame| {
            console.at(f64::from(frame.progress_m / length_m), &mut |_| format!("{} ticks", frame.tick));
            if frame.time_s > to_s { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })?;
        if console.is_cancelled() {
            return Err(Interrupted { kept: "nothing was written".to_owned() }.into());
        }
        console.end(&format!("{} ticks", take.frames.len()));
        takes.push(take);
    }
    Ok(takes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Thirty pictures a second, of which a GIF shows 33, played 1.1 times too fast.
    #[test]
    fn a_drive_is_shown_as_fast_as_asked_whatever_the_pictures_per_second() {
        for (fps, speed) in [(10, 1.0), (30, 1.0), (30, 0.5), (50, 4.0)] {
            let shown_s = f32::from(shown_cs(fps)) / 100.0;
            assert!((step_s(speed, shown_cs(fps)) / shown_s - speed).abs() < 1e-6, "{fps} {speed}");
            assert!(1.0 / shown_s >= f32::from(fps), "no fewer than asked for");
        }
    }

    /// The last picture came up to a step before the end: who drove longest was never seen to finish.
    #[test]
    fn the_last_picture_is_that_of_the_end() {
        assert_eq!(times_s(5.0, 6.2, 0.5), [5.0, 5.5, 6.0, 6.2]);
        assert_eq!(times_s(5.0, 6.0, 0.5), [5.0, 5.5, 6.0]);
        assert_eq!(times_s(0.0, 90.0, 100.0), [0.0, 90.0]);
    }

    /// The place was where the first driver was at that moment: what happened to the second was out of the picture.
    #[test]
    fn the_camera_stands_where_the_moment_happens() {
        let settings = Settings::preset("default").unwrap();
        let keys: [ReplayKey; 2] =
            ["expert@lot-b@forward@0@paper@1@0", "vvf@lot-b@forward@0@paper@1@200"].map(|key| key.parse().unwrap());
        let replay = Replay::new(&keys[0], &settings.episode).unwrap();
        let drivers = load(&keys, &settings).unwrap();
        let [moment] = moments(&keys, &drivers, &settings, None).unwrap()[..] else { panic!("one key has a moment") };
        let takes = drive(&replay, &settings, &drivers, moment.at_s, &Output::new(true, false)).unwrap();
        let [other, pose] = [&takes[0], &takes[1]].map(|take| take.frames[take.index_at(moment.at_s)].vehicle.pose);
        assert_eq!(moment.index, 1);
        assert_eq!(moment.place(&takes), Camera::Place(pose.position() + 3.0 * pose.ahead()));
        assert_ne!(other.position(), pose.position());
    }
}
