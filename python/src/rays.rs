//! A caller's arrays as rays.
//!
//! Arrays are read where they are, while the interpreter's lock keeps others from writing to them. What is made of them
//! is what devices read: one list of [`Ray`]s, 32 bytes each.

use bytemuck::cast_slice;
use glam::{DVec3, Vec3};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use rt_balance::Ray;
use std::sync::Arc;

/// Points, a row each: `N × 3`, contiguous.
#[derive(FromPyObject)]
pub(crate) enum Points<'py> {
    Single(PyReadonlyArray2<'py, f32>),
    Double(PyReadonlyArray2<'py, f64>),
}

/// Where rays begin or end: all alike, or one number for each.
#[derive(FromPyObject)]
pub(crate) enum Limit<'py> {
    Each(PyReadonlyArray1<'py, f32>),
    All(f32),
}

impl Limit<'_> {
    fn slice(&self, name: &str) -> PyResult<&[f32]> {
        match self {
            Self::Each(array) => array.as_slice().map_err(|_| not_contiguous(name)),
            Self::All(number) => Ok(std::slice::from_ref(number)),
        }
    }
}

/// The rows of `N × 3` numbers.
pub(crate) fn rows<'a>(array: &'a PyReadonlyArray2<'_, f32>, name: &str) -> PyResult<&'a [Vec3]> {
    Ok(cast_slice(contiguous(array, name)?))
}

/// The same in double precision.
pub(crate) fn double_rows<'a>(array: &'a PyReadonlyArray2<'_, f64>, name: &str) -> PyResult<&'a [DVec3]> {
    Ok(cast_slice(contiguous(array, name)?))
}

/// The rows of `N × 3` indices.
pub(crate) fn index_rows<'a>(array: &'a PyReadonlyArray2<'_, u32>, name: &str) -> PyResult<&'a [[u32; 3]]> {
    Ok(cast_slice(contiguous(array, name)?))
}

fn contiguous<'a, T: numpy::Element>(array: &'a PyReadonlyArray2<'_, T>, name: &str) -> PyResult<&'a [T]> {
    match array.as_array().shape() {
        [_, 3] => array.as_slice().map_err(|_| not_contiguous(name)),
        shape => Err(PyTypeError::new_err(format!("{name}: shape {shape:?} is not (N, 3)"))),
    }
}

fn not_contiguous(name: &str) -> PyErr {
    PyTypeError::new_err(format!("{name}: not contiguous"))
}

/// A caller's rays.
#[derive(Debug)]
pub(crate) struct Rays {
    pub(crate) rays: Arc<[Ray]>,
    /// The first ray that is no number somewhere, or infinite where it must not be, and how many there are.
    pub(crate) invalid: Option<(usize, usize)>,
}

/// Lists of rays of the last two runs, to be filled again: fresh memory costs as much as what is written to it.
///
/// Devices keep the list of a run until the next one, so the one before that is free.
#[derive(Debug, Default)]
pub(crate) struct Buffers([Option<Arc<[Ray]>>; 2]);

impl Buffers {
    /// A list of `count` rays that nobody reads.
    fn take(&mut self, count: usize) -> Option<Arc<[Ray]>> {
        let is_free = |list: &Option<Arc<[Ray]>>| {
            list.as_ref().is_some_and(|list| list.len() == count && Arc::strong_count(list) == 1)
        };
        self.0.iter_mut().find(|list| is_free(list))?.take()
    }

    /// Keeps the list of a run, and the one before it.
    pub(crate) fn keep(&mut self, list: &Arc<[Ray]>) {
        self.0.swap(0, 1);
        self.0[1] = Some(Arc::clone(list));
    }
}

/// Makes rays of arrays; `offset` is subtracted from origins in double precision, before they are rounded.
pub(crate) fn rays(
    buffers: &mut Buffers,
    origins: &Points<'_>,
    directions: &PyReadonlyArray2<'_, f32>,
    tmin: &Limit<'_>,
    tmax: &Limit<'_>,
    offset: DVec3,
) -> PyResult<Rays> {
    let directions = rows(directions, "directions")?;
    let (tmin, tmax) = (tmin.slice("tmin")?, tmax.slice("tmax")?);
    let parts = Parts { directions, tmin, tmax };
    match origins {
        Points::Single(origins) if offset == DVec3::ZERO => {
            parts.with(buffers, rows(origins, "origins")?, |&point| point)
        }
        Points::Single(origins) => {
            parts.with(buffers, rows(origins, "origins")?, |point| (point.as_dvec3() - offset).as_vec3())
        }
        Points::Double(origins) => {
            parts.with(buffers, double_rows(origins, "origins")?, |&point| (point - offset).as_vec3())
        }
    }
}

/// All of rays but where they start.
struct Parts<'a> {
    directions: &'a [Vec3],
    tmin: &'a [f32],
    tmax: &'a [f32],
}

impl Parts<'_> {
    fn with<P>(&self, buffers: &mut Buffers, origins: &[P], place: impl Fn(&P) -> Vec3) -> PyResult<Rays> {
        let &Self { directions, tmin, tmax } = self;
        let count = origins.len();
        let is_as_long = |limits: &[f32]| limits.len() == 1 || limits.len() == count;
        if directions.len() != count || !is_as_long(tmin) || !is_as_long(tmax) {
            return Err(PyValueError::new_err("origins, directions, tmin and tmax differ in length"));
        }
        // A list of one serves all rays.
        let (every_tmin, every_tmax) = (tmin.len().min(2) - 1, tmax.len().min(2) - 1);
        let (mut first, mut invalid) = (0, 0);
        let mut ray = |index: usize| {
            let (origin, direction) = (place(&origins[index]), directions[index]);
            let (tmin, tmax) = (tmin[index * every_tmin], tmax[index * every_tmax]);
            if !(origin.is_finite() && direction.is_finite()) || tmin.is_nan() || tmax.is_nan() {
                if invalid == 0 {
                    first = index;
                }
                invalid += 1;
            }
            Ray { origin, tmin, direction, tmax }
        };
        let rays = match buffers.take(count) {
            Some(mut list) => {
                let slots = Arc::get_mut(&mut list).into_iter().flatten();
                slots.enumerate().for_each(|(index, slot)| *slot = ray(index));
                list
            }
            None => (0..count).map(&mut ray).collect(),
        };
        Ok(Rays { rays, invalid: (invalid > 0).then_some((first, invalid)) })
    }
}
