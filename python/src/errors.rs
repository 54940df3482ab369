//! Which exception an error is: who made the mistake decides.

use pyo3::create_exception;
use pyo3::exceptions::{PyMemoryError, PyOSError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use rt_balance::{BalanceError, BuildError, with_causes};
use rt_scene::obj::Fault;
use rt_scene::prepare::PrepareError;
use std::error::Error;

create_exception!(
    raybalance,
    DeviceError,
    PyRuntimeError,
    "A device cannot be used, or every device failed; the message names each and says why."
);

/// A mistake in an argument, which the message names.
pub(crate) fn argument(name: &str, error: &dyn Error) -> PyErr {
    PyValueError::new_err(format!("{name}: {}", with_causes(error)))
}

/// A scene that cannot be prepared.
pub(crate) fn of_scene(error: &PrepareError) -> PyErr {
    let text = with_causes(error);
    match error {
        PrepareError::Load(load) if matches!(load.fault, Fault::Read(_)) => PyOSError::new_err(text),
        PrepareError::Build { source: BuildError::OutOfMemory { .. }, .. } => PyMemoryError::new_err(text),
        _ => PyValueError::new_err(text),
    }
}

/// A stream that cannot be traced, or devices that cannot be brought to do it.
pub(crate) fn of_run(error: &BalanceError) -> PyErr {
    let text = with_causes(error);
    match error {
        BalanceError::PolicyUnused { .. } => PyValueError::new_err(format!("policy: {text}")),
        BalanceError::NoDevices => PyValueError::new_err(format!("devices: {text}")),
        _ => DeviceError::new_err(text),
    }
}
