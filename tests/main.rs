//! Tests across crates, in one binary so that burn is linked once.
//!
//! | module | what it holds true |
//! |---|---|
//! | [`bad_inputs`] | the table of bad inputs: one error each, nothing left, little time and memory |
//! | [`tidy`] | dependency direction, licence files |
//! | [`commands`] | whole commands run from outside: results, exit codes, errors |
//! | [`determinism`] | same seed, same bytes, for 1 and 2 threads |
//! | [`docs`] | what the docs name exists: links, sections, commands, flags, settings, paths |
//! | [`expert_drives`] | the expert on the reference lots |
//! | [`formats`] | data sets open as NPY, weights as safetensors |
//! | [`goldens`] | digests of episodes, by layer |
//! | [`limits`] | the limits in docs/formats.md are those of the code |
//! | [`planners`] | model-based planners: naming, parameter files, tuning |
//! | [`regressions`] | what once went wrong, named by symptom |
//! | [`reliability`] | one owner per run, nothing lost to kills and signals, every damage noticed |
//! | [`printed`] | every `--help` and every printed table, as people read them |
//! | [`python`] | the Python of docs/formats.md answers as Rust does |
//! | [`shards`] | an evaluation in parts, on several machines, is the same as on one |
//! | [`words`] | words that were replaced do not come back |
//! | [`reproduce`] | the paper in a box: its report, resumed to the same bytes |
#![allow(clippy::unwrap_used, reason = "tests")]

mod bad_inputs;
mod bench;
mod commands;
mod determinism;
mod docs;
mod expert_drives;
mod formats;
mod goldens;
mod import_graph;
mod limits;
mod planners;
mod printed;
mod python;
mod regressions;
mod reliability;
mod reproduce;
mod shards;
mod tidy;
mod words;
