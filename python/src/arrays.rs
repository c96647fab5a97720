//! Numpy arrays of the caller as what cars write into: no copy beyond the observation itself.

use crate::car::{CELLS, INFO, PIXELS, STATE, Seen};
use numpy::{
    Element, PyArray, PyArrayDyn, PyArrayMethods as _, PyReadonlyArray2, PyReadwriteArrayDyn,
    PyUntypedArrayMethods as _,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use sim::sensing::{BEV_PIXELS, GRID_CELLS};

/// An array that is written into.
pub(crate) struct Target<'py, T: Element>(PyReadwriteArrayDyn<'py, T>);

impl<'py, T: Element> Target<'py, T> {
    /// Takes an array of this shape.
    ///
    /// # Errors
    /// If it has another type or shape, is not contiguous, or is read-only.
    pub(crate) fn of(object: &Bound<'py, PyAny>, name: &str, shape: &[usize]) -> PyResult<Self> {
        let array: &Bound<'py, PyArrayDyn<T>> = object.cast().map_err(|_| {
            let dtype = T::get_dtype(object.py());
            PyValueError::new_err(format!("{name}: not a numpy array of dtype {dtype}"))
        })?;
        if array.shape() != shape {
            let found = array.shape();
            return Err(PyValueError::new_err(format!("{name}: the shape is {found:?}, {shape:?} is needed")));
        }
        if !array.is_c_contiguous() {
            return Err(PyValueError::new_err(format!("{name}: the array is not C-contiguous")));
        }
        let writable = array.try_readwrite().map_err(|error| PyValueError::new_err(format!("{name}: {error}")))?;
        Ok(Self(writable))
    }

    /// Its values, row by row.
    pub(crate) fn values(&mut self) -> PyResult<&mut [T]> {
        Ok(self.0.as_slice_mut()?)
    }
}

/// Where the observations of all cars go: arrays of an object with the attributes `grids`, `states`, `views`, `info`.
pub(crate) struct SeenArrays<'py> {
    grids: Target<'py, u8>,
    states: Option<Target<'py, f32>>,
    views: Option<Target<'py, u8>>,
    info: Target<'py, f64>,
}

impl<'py> SeenArrays<'py> {
    /// Takes the arrays for `n` cars.
    ///
    /// # Errors
    /// See [`Target::of`].
    pub(crate) fn of(object: &Bound<'py, PyAny>, n: usize) -> PyResult<Self> {
        let (states, views) = (object.getattr("states")?, object.getattr("views")?);
        Ok(Self {
            grids: Target::of(&object.getattr("grids")?, "grids", &[n, GRID_CELLS, GRID_CELLS])?,
            states: (!states.is_none()).then(|| Target::of(&states, "states", &[n, STATE])).transpose()?,
            views: (!views.is_none()).then(|| Target::of(&views, "views", &[n, BEV_PIXELS, BEV_PIXELS])).transpose()?,
            info: Target::of(&object.getattr("info")?, "info", &[n, INFO.len()])?,
        })
    }

    /// The part of each car.
    pub(crate) fn rows(&mut self) -> PyResult<Vec<Seen<'_>>> {
        let grids = self.grids.values()?.chunks_exact_mut(CELLS);
        let info = self.info.values()?.chunks_exact_mut(INFO.len());
        let mut states = self.states.as_mut().map(Target::values).transpose()?.map(|all| all.chunks_exact_mut(STATE));
        let mut views = self.views.as_mut().map(Target::values).transpose()?.map(|all| all.chunks_exact_mut(PIXELS));
        let seen = |(grid, info)| Seen {
            grid,
            state: states.as_mut().and_then(Iterator::next),
            view: views.as_mut().and_then(Iterator::next),
            info,
        };
        Ok(grids.zip(info).map(seen).collect())
    }
}

/// Pairs of numbers, one per car: actions or points.
///
/// # Errors
/// If it is not an array of float32 of shape `[n, 2]`, or a number in a row that counts is not finite.
pub(crate) fn pairs(object: &Bound<'_, PyAny>, n: usize, counts: impl Fn(usize) -> bool) -> PyResult<Vec<[f32; 2]>> {
    let array: PyReadonlyArray2<'_, f32> = object
        .extract()
        .map_err(|_| PyValueError::new_err(format!("actions: a float32 array of shape [{n}, 2] is needed")))?;
    if array.shape() != [n, 2] {
        let shape = array.shape();
        return Err(PyValueError::new_err(format!("actions: the shape is {shape:?}, [{n}, 2] is needed")));
    }
    let pairs: Vec<[f32; 2]> = array.as_array().outer_iter().map(|row| [row[0], row[1]]).collect();
    match pairs.iter().enumerate().find(|(index, pair)| counts(*index) && pair.iter().any(|value| !value.is_finite())) {
        Some((index, pair)) => {
            Err(PyValueError::new_err(format!("actions: row {index} is {pair:?}, which is not finite")))
        }
        None => Ok(pairs),
    }
}

/// Points as an array `[n, 2]`.
pub(crate) fn points<const N: usize>(
    py: Python<'_>,
    points: impl IntoIterator<Item = [f32; N]>,
) -> PyResult<Bound<'_, PyArray<f32, numpy::Ix2>>> {
    let flat: Vec<f32> = points.into_iter().flatten().collect();
    let rows = flat.len() / N;
    PyArray::from_vec(py, flat).reshape([rows, N])
}
