//! The largest inputs: checked before anything is allocated for them, so that whatever is refused is refused within two
//! seconds and 500 MB. The table in docs/formats.md is made of these lines.
//!
//! They are in this crate because every other one may use it; `sim` itself reads no files.

use std::ops::RangeInclusive;

/// Extent of a lot, metres: its raster of distances then takes 100 MB.
pub const LOT_EXTENT_MAX_M: f32 = 500.0;
/// Coordinate of a lot, metres: single precision resolves 1 mm up to here.
pub const COORDINATE_MAX_M: f32 = 8192.0;
/// Coordinate of a map, metres: UTM reaches 10⁷ m.
pub const MAP_COORDINATE_MAX_M: f64 = 100_000_000.0;
/// Length of a route, metres.
pub const ROUTE_MAX_M: f32 = 20_000.0;
/// Points of a route or centre line.
pub const ROUTE_POINTS_MAX: usize = 10_000;
/// Vertices of the boundary and all islands of a lot.
pub const VERTICES_MAX: usize = 20_000;
/// Length of the boundary and all islands of a lot, metres: walls are held in pieces of 8 m.
pub const OUTLINES_MAX_M: f64 = 200_000.0;
/// Islands of a lot.
pub const ISLANDS_MAX: usize = 5_000;
/// Obstacles of a lot.
pub const OBSTACLES_MAX: usize = 10_000;
/// Speed bumps of a lot.
pub const SPEED_BUMPS_MAX: usize = 1_000;
/// Characters of a name: files are named after it.
pub const NAME_CHARS_MAX: usize = 100;
/// Bytes of a name in UTF-8: file systems take 255, of which endings take some.
pub const NAME_BYTES_MAX: usize = 200;

/// Lots that are named at once.
pub const LOTS_MAX: usize = 1_000_000;

/// File of a lot, bytes.
pub const LOT_BYTES_MAX: u64 = 1_000_000;
/// Centre line or TPCAP case, bytes.
pub const CSV_BYTES_MAX: u64 = 1_000_000;
/// YAML file of a map, bytes.
pub const MAP_YAML_BYTES_MAX: u64 = 65_536;
/// Image of a map, bytes.
pub const IMAGE_BYTES_MAX: u64 = 20_000_000;
/// Side of an image of a map, pixels.
pub const IMAGE_SIDE_MAX_PX: u32 = 4096;
/// Metres per pixel of a map.
pub const MAP_RESOLUTION_M: RangeInclusive<f64> = 0.0001..=1000.0;
/// How many times as large as its map a lot is.
pub const MAP_SCALE: RangeInclusive<f64> = 0.001..=10_000.0;
/// Pixel of a map in the lot, metres.
pub const MAP_PIXEL_M: RangeInclusive<f64> = 0.001..=100.0;
/// Corners of the outlines of what is drivable on a map, before they are simplified.
pub const OUTLINE_CORNERS_MAX: usize = 500_000;
/// Pixels per metre of a picture that is drawn.
pub const PIXELS_PER_METRE_MAX: f32 = 1000.0;

/// File with settings, bytes.
pub const SETTINGS_BYTES_MAX: u64 = 262_144;
/// File with the parameters of a planner, bytes.
pub const PLANNER_BYTES_MAX: u64 = 65_536;
/// TOML file of a run, bytes.
pub const RUN_TOML_BYTES_MAX: u64 = 16_000_000;
/// JSON, CSV or Markdown file of a run, bytes.
pub const RUN_TEXT_BYTES_MAX: u64 = 256_000_000;
/// JSONL file of a run, bytes.
pub const RUN_LINES_BYTES_MAX: u64 = 100_000_000_000;
/// Line of a JSONL file of a run, bytes.
pub const RECORD_BYTES_MAX: u64 = 4_000_000;

/// Request to the viewer, bytes.
pub const VIEW_REQUEST_BYTES_MAX: u64 = 1_000_000;

/// Channels of a convolution.
pub const CHANNELS_MAX: usize = 1024;
/// Residual layers after a pool.
pub const RESIDUAL_LAYERS_MAX: usize = 8;
/// Units of the fully connected layer.
pub const HIDDEN_MAX: usize = 65_536;
/// Components of the mixture that a network answers with.
pub const MODES_MAX: usize = 8;
/// Trainable values of a network: 256 MB.
pub const PARAMETERS_MAX: usize = 64_000_000;
/// Header of a safetensors or NPY file, bytes.
pub const HEADER_BYTES_MAX: u64 = 65_536;
/// ONNX file, bytes.
pub const ONNX_BYTES_MAX: u64 = 100_000_000;
/// Grids that a network from an ONNX file answers in one call.
pub const ONNX_BATCH_MAX: usize = 1024;
/// Fields of an ONNX file.
pub const ONNX_FIELDS_MAX: usize = 1_000_000;
/// Messages within messages of an ONNX file.
pub const ONNX_NESTING_MAX: usize = 100;

/// Number of a trial, a drive or a round, from 0: each has random streams of its own.
pub const TRIAL_MAX: u32 = 1_048_575;
/// Levels of noise of an evaluation: each has rows of its own in every table.
pub const NOISE_LEVELS_MAX: usize = 100;
/// Runs of an evaluation, for each driver.
pub const RUNS_MAX: usize = 10_000_000;
/// Drives whose maps are held at once, 1 to 2 MB each: those of a round of training, of a planner that is tuned, of an on-policy rollout.
pub const DRIVES_AT_ONCE_MAX: usize = 10_000;
/// Threads to compute with.
pub const THREADS_MAX: u16 = 1024;
