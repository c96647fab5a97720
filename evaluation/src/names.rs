//! Names of policies in tables, by which they are found there.

/// The paper's driver.
pub const DAGGER: &str = "DAgger";
/// Behaviour cloning.
pub const BC: &str = "BC";
/// Behaviour cloning after a [final training](policy::dagger::DaggerSettings::final_budget).
pub const BC_FINAL: &str = "BC, final training";
/// [`Chain::Unweighted`](crate::stages::Chain::Unweighted).
pub const UNWEIGHTED: &str = "DAgger, α = 0";
/// [`Chain::ExpertOnly`](crate::stages::Chain::ExpertOnly).
pub const EXPERT_ONLY: &str = "expert's data alone";
/// [`Chain::ExpertEqual`](crate::stages::Chain::ExpertEqual).
pub const EXPERT_EQUAL: &str = "expert's data alone, as many samples";
/// [`Chain::Alpha15`](crate::stages::Chain::Alpha15).
pub const ALPHA_15: &str = "DAgger, α = 15";
/// [`Chain::Person`](crate::stages::Chain::Person): behaviour cloning, then `DAgger`.
pub const OF_PERSON: [&str; 2] = ["BC from a person's hand", "DAgger from a person's hand"];
/// The expert's rules on the noisy grid.
pub const GRID_EXPERT: &str = "the expert's rules on the grid";
