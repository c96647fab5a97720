//! The paper's baselines and their kin: planners that answer the same noisy grid with a formula (docs/methods.md 6 and 7).
//!
//! | module | family | method | run by the paper? |
//! |---|---|---|---|
//! | [`tentacle`] | candidate paths | clothoid tentacles (Mouhagir 2019), arcs of von Hundelshausen 2008 | yes |
//! | [`vvf`] | field | velocity vector field: repulsion plus a constant forward field | yes |
//! | [`dwa`] | candidate paths | dynamic window approach (Fox 1997) | no |
//! | [`cvm`] | candidate paths | curvature velocity method (Simmons 1996) | no |
//! | [`apf`] | field | artificial potential field (Khatib; Ge and Cui 2000) | no |
//! | [`vff`] | field | virtual force field (Borenstein and Koren) | no |
//! | [`mppi`] | sampling | model predictive path integral control, as in nav2 (Williams 2017) | no |
//!
//! Each method chooses a steering angle; the controller follows it with the paper's speed law for planners, slower when
//! it steers more. Methods that search speeds ask for less than that where they want to. There is no global path: a method
//! that needs a goal gets "straight ahead" or a point that the grid suggests ([`Goal`]).
//!
//! Tags in the documentation of parameters, as in docs/methods.md: *paper* = stated there, *cited* = read in the cited
//! work or the authors' code, *derived* = arithmetic from those, *recalled* = from memory of the cited work, *chosen* =
//! stated nowhere.
//!
//! Shared by the methods: `context` (the car, and how to answer), `nearest` (distances on the grid), `field` (repulsion
//! and the walk along a field), `speeds` (the arcs and speeds of a window), [`Goal`], [`Method`]. The registry
//! ([`PlannerSpec`], [`Planner`]) uses the methods, never the other way round.

pub mod apf;
mod context;
pub mod cvm;
pub mod dwa;
pub mod explanation;
mod field;
mod goal;
mod method;
pub mod mppi;
mod nearest;
mod registry;
pub mod search;
mod speeds;
pub mod tentacle;
pub mod vff;
pub mod vvf;
mod way_field;

pub use context::PlannerContext;
pub use goal::Goal;
pub use method::{Method, Reading};
pub use registry::{Planner, PlannerSpec};

#[cfg(test)]
mod test_scenes;
#[cfg(test)]
mod tests;
