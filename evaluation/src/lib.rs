//! What drivers did: measured, explained and compared, as data. What people read of it is made by `report`.
//!
//! | module | what |
//! |---|---|
//! | [`plan`], [`mod@evaluate`] | drivers × lots × directions × trials × noise levels, driven and written down |
//! | [`shards`] | what several machines did a share of each, put together again |
//! | [`records`] | the lines of `runs.jsonl`, `failures.jsonl`, `wall_time.jsonl` |
//! | [`monitor`], [`incidents`], [`what_if`], [`avoidable`] | near-collisions one by one, why they happened, and what would have avoided them |
//! | [`totals`], [`slices`], [`names`], [`results`], [`judge`], [`trainings`] | runs added up, pooled and compared |
//! | [`statistics`] | exact intervals, comparisons, paired bootstrap, sample sizes |
//! | [`summary`], [`table1`] | the tables as data |
//! | [`calibration`], [`on_policy`] | whether the predicted variance is right, on held-back and on driven states |
//! | [`paper`], [`conclusions`], [`stage`], [`stages`], [`drive_stage`], [`rules`], [`scaling`], [`deviations`], [`estimate`] | the paper's figures, which of its conclusions hold here, and what is done to find out, in what time |
//! | [`tune`] | parameters of planners, searched alike for each |
//! | [`pixel_accuracy`] | how wrong the noisy view is |

pub mod avoidable;
pub mod calibration;
pub mod conclusions;
pub mod deviations;
pub mod drive_stage;
pub mod estimate;
pub mod evaluate;
pub mod evaluations;
pub mod format;
pub mod incidents;
pub mod json;
pub mod judge;
pub mod monitor;
pub mod names;
pub mod on_policy;
pub mod paper;
pub mod parts;
pub mod pixel_accuracy;
pub mod plan;
pub mod read;
pub mod records;
pub mod results;
pub mod rules;
pub mod scaling;
pub mod shards;
pub mod slices;
pub mod stage;
pub mod stages;
pub mod statistics;
pub mod summary;
pub mod table1;
pub mod totals;
pub mod trainings;
pub mod tune;
pub mod what_if;
