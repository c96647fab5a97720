//! A filter between a driver's answer and the controller: it lets pass what leaves a way out, and otherwise drives the way
//! out that is nearest to the answer.
//!
//! A driver of one grid forgets what has left the patch: the patch begins half a metre ahead of the bumper, and what
//! stands beside the car cannot be seen. The filter remembers ([`LocalMap`]) and asks of every answer whether the car,
//! with its steering rate and its braking, could still get through if it followed it a moment longer ([`SafetyFilter`]).
//! It sees what a policy sees, the noisy grids and the car's odometry, and nothing else.
//!
//! | module | content |
//! |---|---|
//! | [`local_map`] | what was seen of the ground around the car, moved along by odometry |
//! | [`forecast`] | where the car gets to with one steering command, and then another |
//! | [`filter`] | the decision |
//! | [`fleet`] | any fleet of drivers behind filters |

pub mod filter;
pub mod fleet;
pub mod forecast;
pub mod local_map;
mod settings;

pub use filter::SafetyFilter;
pub use fleet::FilteredFleet;
pub use local_map::LocalMap;
pub use settings::{SafetySettings, env};
