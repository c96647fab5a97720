//! What every planning method implements.

use crate::context::PlannerContext;
use crate::search::Dimension;
use serde::Serialize;
use serde::de::DeserializeOwned;
use sim::driver::Policy;

/// Parameters of a planner, and the planner they make.
pub trait Method: Clone + std::fmt::Debug + PartialEq + Serialize + DeserializeOwned + 'static {
    /// As named on the command line.
    const NAME: &'static str;
    /// One line.
    const ABOUT: &'static str;
    /// What the tuner varies, and how far.
    const SEARCH: &'static [Dimension<Self>];
    /// Other readings of the publication, where it leaves something open.
    const READINGS: &'static [Reading<Self>] = &[];
    /// The planner that drives.
    type Planner: Policy + Clone + Send + Sync;

    /// The paper's values where it ran the method, the literature's otherwise.
    fn paper() -> Self;

    /// Whether a planner can be made of these.
    ///
    /// # Errors
    /// Naming the parameter that is out of range.
    fn check(&self) -> Result<(), String>;

    /// A planner for a car.
    fn planner(&self, context: &PlannerContext) -> Self::Planner;
}

/// A reading of a publication other than [`Method::paper`].
#[derive(Debug)]
pub struct Reading<P> {
    /// As named on the command line, behind the method's: `dwa/fox`.
    pub name: &'static str,
    /// What is different, in a few words.
    pub about: &'static str,
    /// Its parameters.
    pub params: fn() -> P,
}

/// `Err` unless a parameter lies within its range.
pub(crate) fn within(name: &str, value: f32, low: f32, high: f32) -> Result<(), String> {
    if (low..=high).contains(&value) { Ok(()) } else { Err(format!("{name} = {value}: choose {low} to {high}")) }
}
