//! Lots, drivers and settings by name, for looking at.

use crate::arrays::points;
use crate::course::{SettingsFrom, directions};
use crate::guard::{alone, input, warn, whole};
use experiment::notes;
use experiment::settings::{NoiseChoice, Settings};
use experiment::trials::{Purpose, Trial};
use numpy::{Ix2, PyArray, PyArray1, PyArray3, PyArrayMethods as _, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use report::drawn_lots::{DrawnLot, DrawnLots};
use report::pictures::lot;
use sim::geometry::Vec2;
use sim::limits::TRIAL_MAX;
use sim::map::Map;
use sim::scenario::Direction;
use sim::seed::RootSeed;
use sim::vehicle::VehicleSettings;
use std::path::{Path, PathBuf};

/// A lot with the obstacles of one trial, in one direction.
///
/// Lengths are metres in the world frame of the lot, angles radians counter-clockwise from x.
///
/// Args:
///     name: A lot as on the command line: ``"lot-a"``, ``"test-hard-7"``, ``"my-map.toml"``.
///     direction: ``"forward"`` or ``"reverse"``.
///     trial: Which obstacles, for lots that draw them in every trial.
///     seed: Seed of the obstacles, as in ``evaluate``.
///
/// Raises:
///     ValueError: If there is no such lot, or it cannot be driven in this direction.
#[pyclass(frozen, module = "lotpilot")]
pub(crate) struct Lot {
    map: Map,
    notes: Vec<String>,
    vehicle: VehicleSettings,
}

#[pymethods]
impl Lot {
    #[new]
    #[pyo3(
        signature = (name, *, direction="forward", trial=None, seed=None),
        text_signature = "(name, *, direction='forward', trial=0, seed=1)"
    )]
    fn new(
        py: Python<'_>,
        name: &str,
        direction: &str,
        trial: Option<&Bound<'_, PyAny>>,
        seed: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let trial = trial.map_or(Ok(0), |trial| whole("trial", trial, 0..=u64::from(TRIAL_MAX)))? as u32;
        let seed = seed.map_or(Ok(1), |seed| whole("seed", seed, 0..=i64::MAX as u64))?;
        let settings = Settings::preset("default").map_err(input)?;
        alone(py, || {
            let vehicle = settings.episode.vehicle.clone();
            let lots = experiment::lots::Lot::parse_all(&[name], &vehicle).map_err(input)?;
            let [lot] = lots.as_slice() else {
                let problem = format!("{name:?} stands for {} lots; lotpilot.lots names them", lots.len());
                return Err(PyValueError::new_err(problem));
            };
            let [direction] = directions(direction).map_err(input)?[..] else {
                return Err(PyValueError::new_err(format!("direction {direction:?}: name one, forward or reverse")));
            };
            lot.check_direction(direction, &vehicle).map_err(input)?;
            let trial = Trial::of_evaluation(RootSeed(seed), lot, direction, trial);
            let notes = notes::of(&lots, &[NoiseChoice::Lot]);
            Ok(Self { map: trial.map(&settings.episode).map_err(input)?, notes, vehicle })
        })
    }

    /// Name in tables.
    #[getter]
    fn name(&self) -> &str {
        &self.map.scenario().name
    }

    /// What the import of a map did and found, as ``cargo xtask generate`` says it; of a lot written by hand its
    /// junctions and short cuts; nothing for other lots.
    #[getter]
    fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Length of the route, metres.
    #[getter]
    fn length_m(&self) -> f32 {
        self.map.path().length_m()
    }

    /// Route of the rear axle, float32 [n, 3]: x and y in metres, heading in radians.
    #[getter]
    fn route<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray<f32, Ix2>>> {
        points(py, self.map.path().poses().iter().map(|pose| [pose.x_m, pose.y_m, pose.heading_rad]))
    }

    /// Outline of the drivable ground, float32 [n, 2], metres.
    #[getter]
    fn boundary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray<f32, Ix2>>> {
        points(py, self.map.scenario().boundary.iter().map(Vec2::to_array))
    }

    /// Outlines of the islands, each float32 [n, 2], metres.
    #[getter]
    fn islands<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyArray<f32, Ix2>>>> {
        let islands = self.map.scenario().islands.iter();
        islands.map(|island| points(py, island.polygon.iter().map(Vec2::to_array))).collect()
    }

    /// Outlines of the obstacles, each float32 [n, 2], metres.
    #[getter]
    fn obstacles<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyArray<f32, Ix2>>>> {
        let obstacles = self.map.scenario().obstacles.iter();
        obstacles.map(|obstacle| points(py, obstacle.outline().iter().map(Vec2::to_array))).collect()
    }

    /// Signed distances of points to the nearest non-drivable ground, float32 [n], metres: positive on drivable ground,
    /// at most 3 m.
    ///
    /// Args:
    ///     points: float32 [n, 2], metres.
    fn distances_m<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArray2<'py, f32>,
    ) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let points = points.as_array();
        if points.ncols() != 2 {
            return Err(PyValueError::new_err(format!("points: the shape is {:?}, [n, 2] is needed", points.shape())));
        }
        let distances = points.outer_iter().map(|point| self.map.signed_distance_m(Vec2::new(point[0], point[1])));
        Ok(PyArray::from_vec(py, distances.collect()))
    }

    /// The lot as TOML, as ``cargo xtask generate`` writes it.
    fn to_toml(&self) -> String {
        scenarios::load::to_toml(self.map.scenario())
    }

    /// The lot from above, uint8 [height, width, 3].
    ///
    /// Args:
    ///     pixels_per_metre: Scale; by default it fits 1600 pixels.
    #[pyo3(signature = (pixels_per_metre=None))]
    fn picture<'py>(&self, py: Python<'py>, pixels_per_metre: Option<f32>) -> PyResult<Bound<'py, PyArray3<u8>>> {
        if pixels_per_metre.is_some_and(|scale| !(0.1..=1000.0).contains(&scale)) {
            return Err(PyValueError::new_err("pixels_per_metre is not within 0.1 … 1000"));
        }
        let drawn =
            alone(py, || Ok(lot::top_view(&self.map, &self.vehicle, pixels_per_metre).map_err(input)?.pixmap()))?;
        let rgb: Vec<u8> = drawn.data().chunks_exact(4).flat_map(|rgba| [rgba[0], rgba[1], rgba[2]]).collect();
        PyArray::from_vec(py, rgb).reshape([drawn.height() as usize, drawn.width() as usize, 3])
    }

    fn __repr__(&self) -> String {
        format!("<lotpilot.Lot {:?}, route {:.1} m>", self.name(), self.length_m())
    }
}

/// The single lots that names stand for: ``lots(["test:3"])`` is ``["test-medium-0", "test-medium-1", "test-medium-2"]``.
///
/// Raises:
///     ValueError: If nothing is named so.
#[pyfunction]
#[pyo3(signature = (names))]
pub(crate) fn lots(py: Python<'_>, names: Vec<String>) -> PyResult<Vec<String>> {
    let settings = Settings::preset("default").map_err(input)?;
    alone(py, || {
        let lots = experiment::lots::Lot::parse_all(&names, &settings.episode.vehicle).map_err(input)?;
        Ok(lots.iter().map(experiment::lots::Lot::spec).collect())
    })
}

/// Ways to name a driver, each with what it means.
#[pyfunction]
pub(crate) fn drivers() -> Vec<(String, String)> {
    experiment::drivers::specs()
}

/// Settings as TOML: preset, then file, then single changes.
#[pyfunction]
pub(crate) fn settings(from: SettingsFrom) -> PyResult<String> {
    Ok(Settings::resolve(&from.into(), None).map_err(input)?.to_toml())
}

/// Refuses lots of which two would be one file of a folder, or that would replace what one is made of.
#[pyfunction]
pub(crate) fn check_generate(py: Python<'_>, names: Vec<String>, seed: u64, count: u32, out: PathBuf) -> PyResult<()> {
    let settings = Settings::preset("default").map_err(input)?;
    alone(py, || {
        let lots = experiment::lots::Lot::parse_all(&names, &settings.episode.vehicle).map_err(input)?;
        let trials = Trial::all(RootSeed(seed), Purpose::Pictures, &lots, count, &[Direction::Forward]);
        let to = DrawnLots { out: &out, seed, count, overwrite: true };
        to.ensure_free(&lots, &trials.collect::<Vec<_>>()).map_err(input)
    })
}

/// Draws lots: of each its name, TOML, the path of its TOML file, route in metres and number of obstacles. With `out`,
/// TOML and PNG are files there; without, nothing is written and paths are empty.
#[pyfunction]
#[expect(clippy::type_complexity, reason = "columns of a table in Python")]
pub(crate) fn generate(
    py: Python<'_>,
    names: Vec<String>,
    seed: u64,
    count: u32,
    out: Option<PathBuf>,
    overwrite: bool,
) -> PyResult<Vec<(String, String, String, f32, usize)>> {
    let settings = Settings::preset("default").map_err(input)?;
    let vehicle = &settings.episode.vehicle;
    let to = DrawnLots { out: out.as_deref().unwrap_or(Path::new("")), seed, count, overwrite };
    let draw = |trial: &Trial<'_>| {
        let drawn = to.draw(trial, vehicle)?;
        let place = match &out {
            Some(_) => to.write(&drawn, vehicle, None)?.display().to_string(),
            None => String::new(),
        };
        let DrawnLot { name, toml, map, .. } = drawn;
        Ok::<_, anyhow::Error>((name, toml, place, map.path().length_m(), map.scenario().obstacles.len()))
    };
    let lots = alone(py, || experiment::lots::Lot::parse_all(&names, vehicle).map_err(input))?;
    warn(py, &notes::of(&lots, &[NoiseChoice::Lot]))?;
    alone(py, || {
        if let Some(fixed) = lots.iter().find(|lot| count != 1 && !lot.is_drawn_per_trial()) {
            let problem = format!("count: {:?} has the same obstacles in every drawing", fixed.name());
            return Err(PyValueError::new_err(problem));
        }
        let trials = Trial::all(RootSeed(seed), Purpose::Pictures, &lots, count, &[Direction::Forward]);
        let trials: Vec<_> = trials.collect();
        if let Some(out) = &out {
            to.ensure_free(&lots, &trials).map_err(input)?;
            std::fs::create_dir_all(out)?;
        }
        let draw = |trial| {
            // Between any two, so that Ctrl-C is heeded.
            Python::attach(|py| py.check_signals())?;
            draw(trial).map_err(input)
        };
        trials.iter().map(draw).collect()
    })
}
