//! Drives of an evaluation, simulated again from their replay keys.

use crate::drive::Drive;
use crate::recording::{EVENT_TIME, Header, Moment, Recording};
use crate::{Context, colours, layout, legend, result_of, show_map};
use anyhow::{Context as _, bail};
use experiment::drivers::NamedDriver;
use experiment::replay_key::ReplayKey;
use experiment::settings::Settings;
use experiment::view_request::DriveRequest;
use sim::driver::Source;
use std::ops::ControlFlow;
use std::path::Path;

/// What is played first, and again and again: seconds from the moment of interest.
const PLAYED_S: [f64; 2] = [-1.0, 3.0];
/// Seconds before and after the moment of interest that are recorded.
const RECORDED_S: [f64; 2] = [10.0, 5.0];

/// Records drives, one after the other.
pub(crate) fn show(drives: &[DriveRequest], settings: &Settings, context: &mut Context<'_>) -> anyhow::Result<()> {
    drives.iter().try_for_each(|request| {
        let replay = Replay::new(request, settings).with_context(|| request.title.clone())?;
        replay.record(&request.file, context)
    })
}

/// The same run, driven by each of several drivers.
struct Replay<'a> {
    title: &'a str,
    settings: &'a Settings,
    drivers: Vec<NamedDriver>,
    run: experiment::drive::Replay,
    /// The moment of interest, a control tick.
    focus_tick: Option<u32>,
}

impl<'a> Replay<'a> {
    fn new(request: &'a DriveRequest, settings: &'a Settings) -> anyhow::Result<Self> {
        let key = request.keys.first().context("a drive needs a replay key")?;
        let differs = |other: &&ReplayKey| ReplayKey { driver: key.driver.clone(), ..(*other).clone() } != *key;
        if let Some(other) = request.keys.iter().find(differs) {
            bail!("{key} and {other} are different runs; one recording shows one");
        }
        let load = |key: &ReplayKey| key.driver.clone().load(settings);
        let drivers: Vec<NamedDriver> = request.keys.iter().map(load).collect::<anyhow::Result<_>>()?;
        drivers.iter().try_for_each(|driver| driver.check(settings))?;
        let run = experiment::drive::Replay::new(key, &settings.episode)?;
        let focus_tick = (key.tick > 0).then_some(key.tick);
        Ok(Self { title: &request.title, settings, drivers, run, focus_tick })
    }

    fn record(&self, file: &str, context: &mut Context<'_>) -> anyhow::Result<()> {
        let map = &self.run.map;
        let names: Vec<&str> = self.drivers.iter().map(|driver| driver.name.as_str()).collect();
        let roots = roots_of(&names);
        let observed_at_s = || self.run.observed_at_s(&self.settings.episode, &self.drivers[0]);
        let event_s = self.focus_tick.map(|_| observed_at_s()).transpose()?.map(f64::from);
        let header = Header {
            application: "drive",
            title: self.title.to_owned(),
            layout: layout::of_drives(map, &roots),
            timeline: if self.focus_tick.is_some() { EVENT_TIME } else { "sim_time" },
            event: event_s
                .map(|event_s| Moment { played_s: PLAYED_S.map(|from_event_s| (event_s + from_event_s).max(0.0)) }),
        };
        let recording = context.begin(file, &header)?;
        show_map(map, legend::DRIVE, &recording);
        for (index, root) in roots.iter().enumerate() {
            if !context.progress.is_cancelled() {
                self.drive(index, root, &recording, context)?;
            }
        }
        context.end(recording)
    }

    /// First and last tick to record.
    fn ticks(&self) -> [u32; 2] {
        let control_period_s = f64::from(self.settings.episode.control_period_s());
        let [before, after] = RECORDED_S.map(|seconds| (seconds / control_period_s) as u32);
        self.focus_tick.map_or([0, u32::MAX], |tick| [tick.saturating_sub(before), tick.saturating_add(after)])
    }

    fn drive(&self, index: usize, root: &str, recording: &Recording, context: &Context<'_>) -> anyhow::Result<()> {
        let (driver, episode) = (&self.drivers[index], &self.settings.episode);
        let [first, last] = self.ticks();
        let mut drive = Drive::new(recording, root, &self.run.episode(episode), self.settings, self.run.hand())
            .with_planner(driver.to_planner(episode));
        if self.drivers.len() > 1 {
            let sources: Vec<Source> = self.drivers.iter().map(NamedDriver::source).collect();
            drive = drive.among_others(colours::of_drivers(&sources)[index]);
        }
        drive.show_static();
        let length_m = self.run.map.path().length_m();
        context.progress.begin("recording", &format!("recording: {}", driver.name));
        let report = self.run.drive(episode, driver, |frame| {
            if frame.tick < first {
                drive.skip(frame);
            } else {
                drive.frame(frame);
            }
            let status = &mut |_| format!("{:.0} of {length_m:.0} m", frame.progress_m);
            context.progress.at(f64::from(frame.progress_m / length_m), status);
            let is_over = frame.tick >= last || context.progress.is_cancelled();
            if is_over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })?;
        context.progress.end(&report.map_or_else(|| "done".to_owned(), |report| result_of(&report.metrics)));
        Ok(())
    }
}

/// The entities of several drivers: short, because they are titles; the folder of a run where that tells it from the
/// others; numbers where nothing else does. None is that of the lot or the legend.
fn roots_of(names: &[&str]) -> Vec<String> {
    let short = |name: &str| {
        let folder = name.strip_prefix("run:").or_else(|| name.strip_prefix("net:"));
        root_of(folder.and_then(|folder| Path::new(folder).file_name()?.to_str()).unwrap_or(name))
    };
    let all: Vec<String> = names.iter().map(|name| short(name)).collect();
    let is_alone = |root: &String| all.iter().filter(|other| *other == root).count() == 1;
    let mut roots: Vec<String> = Vec::new();
    for (name, short) in names.iter().zip(&all) {
        let root = if is_alone(short) { short.clone() } else { root_of(name) };
        let numbered = |k: usize| if k == 1 { root.clone() } else { format!("{root}-{k}") };
        let is_free = |root: &String| !roots.contains(root) && !["lot", "legend"].contains(&root.as_str());
        let unlike = (1..names.len() + 3)
            .map(numbered)
            .find(is_free)
            .expect("more numbers than names, and the two that are taken");
        roots.push(unlike);
    }
    roots
}

/// The entity under which a driver is found: its name without what means something in a path.
fn root_of(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_drivers_are_single_parts_of_entity_paths() {
        assert_eq!(root_of("run:runs/a b/bc"), "run_runs_a_b_bc");
        assert_eq!(root_of("expert"), "expert");
        assert_eq!(roots_of(&["run:runs/a", "tuned:vvf", "net:runs/a/round-01"]), ["a", "tuned_vvf", "round-01"]);
        assert_eq!(roots_of(&["run:runs/a/bc", "run:runs/b/bc"]), ["run_runs_a_bc", "run_runs_b_bc"]);
    }

    /// Two cars were one, that jumped from place to place.
    #[test]
    fn no_driver_shares_its_entity() {
        assert_eq!(roots_of(&["run:runs/ä", "run:runs/ö"]), ["run_runs__", "run_runs__-2"]);
        assert_eq!(roots_of(&["run:runs/lot", "run:runs/legend"]), ["lot-2", "legend-2"]);
    }
}
