//! What people read and look at, made from what runs left: Markdown, HTML, plots, pictures.
//!
//! | module | what |
//! |---|---|
//! | [`markdown`], [`summary`], [`table1`], [`failures`], [`tuning`], [`pixel_accuracy`], [`replays`], [`what_if`] | tables as Markdown |
//! | [`plots`] | plots as SVG |
//! | [`pictures`] | lots, drives, samples and noise as PNG and SVG |
//! | [`drawn_lots`] | lots drawn and written to files, and what they must not replace |
//! | [`page`], [`glossary`] | one HTML page that loads nothing, and what its words mean |
//! | [`run_report`], [`moments`] | `report.html` of a run, with its worst near-collisions |
//! | [`reproduction`] | the report of `reproduce` |
//! | [`other_run`] | the table of another run in that report, or on a page of its own |
//! | [`rules`], [`scaling`], [`deviations`], [`trainings_table`] | those of the commands of these names: many trainings, one table, one plot |

mod controls;
pub mod deviations;
pub mod docs_page;
pub mod drawn_lots;
mod drive;
pub mod elsewhere;
pub mod failures;
pub mod glossary;
pub mod markdown;
pub mod moments;
pub mod other_run;
pub mod page;
pub mod pictures;
pub mod pixel_accuracy;
pub mod plots;
pub mod replays;
pub mod reproduction;
pub mod rules;
pub mod run_report;
pub mod scaling;
pub mod summary;
pub mod table1;
mod trainings;
pub mod trainings_table;
pub mod tuning;
pub mod what_if;
