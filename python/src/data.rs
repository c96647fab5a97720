//! Rounds of training data as arrays.

use crate::arrays::points;
use crate::guard::{alone, detached, input};
use experiment::trained;
use numpy::{PyArray, PyArrayMethods as _};
use policy::dataset::Tick;
use policy::dataset::store::Store;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sim::driver::{LookAheadPoint, Source};
use sim::sensing::{GRID_CELLS, OccupancyGrid};
use std::path::{Path, PathBuf};

/// The rounds of a run. Opening them creates its folder, so it has to be there.
fn store_of(run: &Path) -> PyResult<Store> {
    if !run.is_dir() {
        return Err(PyValueError::new_err(format!("{}: there is no such run", run.display())));
    }
    Store::open(run).map_err(input)
}

/// How many rounds a run has collected: one that it lists and that is gone, or that it did not collect, is an error.
#[pyfunction]
pub(crate) fn count_rounds(py: Python<'_>, run: PathBuf) -> PyResult<u32> {
    let store = store_of(&run)?;
    alone(py, || {
        let mut count = 0;
        while store.has_round(count).map_err(input)? {
            count += 1;
        }
        Ok(count)
    })
}

/// The columns of a round of a run; see `lotpilot.load_round`.
#[pyfunction]
pub(crate) fn read_round(py: Python<'_>, run: PathBuf, round: u32) -> PyResult<Bound<'_, PyDict>> {
    let store = store_of(&run)?;
    let (data, collection, episode) = detached(py, || {
        let settings = trained::settings_of(&run).map_err(input)?;
        // By its own list alone, one that somebody had copied there would be the run's.
        if !store.has_round(round).map_err(input)? {
            return Err(PyValueError::new_err(format!("{}: there is no round {round}", run.display())));
        }
        let (data, collection) = store.read_round(round).map_err(input)?;
        Ok((data, collection, settings.episode))
    })?;
    let geometry = &episode.sensing.geometry;
    let n = data.samples.len();
    let grids =
        |grids: &mut dyn Iterator<Item = &OccupancyGrid>| -> Vec<u8> { grids.flat_map(OccupancyGrid::cells).collect() };
    let columns = PyDict::new(py);
    let shown = grids(&mut data.samples.iter().map(|sample| &sample.grid));
    columns.set_item("grids", PyArray::from_vec(py, shown).reshape([n, GRID_CELLS, GRID_CELLS])?)?;
    let label = |label| LookAheadPoint::from_image_fraction(label, geometry);
    let labels = data.samples.iter().map(|sample| label(sample.label)).map(|point| [point.ahead_m, point.left_m]);
    columns.set_item("points", points(py, labels)?)?;
    columns.set_item("image_fractions", points(py, data.samples.iter().map(|sample| sample.label))?)?;
    let tau_hat = data.samples.iter().map(|sample| sample.tau_hat).collect();
    columns.set_item("tau_hat", PyArray::from_vec(py, tau_hat))?;
    let augmentations = grids(&mut data.noise_augmentations.iter());
    let shape = [n, data.augmentations_each(), GRID_CELLS, GRID_CELLS];
    columns.set_item("noise_augmentations", PyArray::from_vec(py, augmentations).reshape(shape)?)?;
    let ticks = &data.ticks;
    columns.set_item("episode", PyArray::from_vec(py, ticks.iter().map(|tick| i64::from(tick.episode)).collect()))?;
    columns.set_item("tick", PyArray::from_vec(py, ticks.iter().map(|tick| i64::from(tick.tick)).collect()))?;
    for (name, of) in Tick::FLOATS {
        columns.set_item(name, PyArray::from_vec(py, ticks.iter().map(of).collect()))?;
    }
    let is_novice = ticks.iter().map(|tick| tick.driver == Source::Novice).collect();
    columns.set_item("is_novice", PyArray::from_vec(py, is_novice))?;
    let lots: Vec<&str> = collection.episodes.iter().map(|episode| episode.lot.as_str()).collect();
    columns.set_item("lots", lots)?;
    let directions: Vec<&str> = collection.episodes.iter().map(|episode| episode.direction.name()).collect();
    columns.set_item("directions", directions)?;
    columns.set_item("control_period_s", episode.control_period_s())?;
    Ok(columns)
}
