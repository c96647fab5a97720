//! A near-collision to watch: driven again from its replay key.

use crate::page::Player;
use crate::pictures::animation::{Camera, Layout, Scene, Take};
use anyhow::Context as _;
use experiment::drive::Replay;
use experiment::manifest::Manifest;
use experiment::replay_key::ReplayKey;
use experiment::settings::Settings;
use sim::frame::Event;
use std::ops::ControlFlow;

/// What is shown before and after the near-collision, seconds.
const BEFORE_S: f32 = 8.0;
const AFTER_S: f32 = 2.0;
/// Pictures per second.
const RATE_PER_S: f32 = 5.0;

/// The seconds around a near-collision; where no script runs, its moment. `manifest`: that of the run, which says what drove
/// and where.
///
/// # Errors
/// If it cannot be driven again: the network or the lot has moved away or changed.
pub fn player(key: &str, settings: &Settings, manifest: &Manifest) -> anyhow::Result<Player> {
    let key: ReplayKey = key.parse()?;
    let (replay, driver) = Replay::of_run(&key, settings, manifest)?;
    let (mut now_s, mut until_s) = (0.0, f32::INFINITY);
    let take = Take::of(&replay, &settings.episode, &driver, |frame| {
        if frame.tick == key.tick {
            until_s = now_s + AFTER_S;
        }
        now_s = frame.time_s;
        if now_s > until_s { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    let found = take.frames.get(key.tick as usize).and_then(|frame| match frame.event {
        Event::NearCollision { at, .. } => Some(at),
        Event::Drove | Event::Stuck { .. } | Event::ReachedEnd => None,
    });
    let at = found.context("driven again, it does not happen: has the network been trained again since?")?;

    // Counted from the tick, so that one picture shows it.
    let at_s = take.observed_at_s(key.tick as usize);
    let end_s = take.observed_at_s(take.frames.len() - 1);
    let before = (at_s.min(BEFORE_S) * RATE_PER_S) as i32;
    let after = ((end_s - at_s).min(AFTER_S) * RATE_PER_S) as i32;
    let times: Vec<f32> = (-before..=after).map(|i| at_s + i as f32 / RATE_PER_S).collect();
    let camera = Camera::Place(at.position() + 3.0 * at.ahead());
    let title = format!("{} {} trial {}", key.lot, key.direction.name(), key.trial);
    let scene = Scene::new(&replay, &settings.episode, vec![take], &times, (camera, Layout::Below), title);
    scene.player(before as usize, RATE_PER_S)
}
