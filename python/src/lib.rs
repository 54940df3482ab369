//! The native half of the Python package `raybalance`: arrays in, arrays out.
//!
//! What people import is written in Python, in the folder `raybalance` beside this one: it checks arguments, and words
//! errors and documentation. Here arrays have the types and shapes that [`rays`] names; who hands over others gets a
//! plain `TypeError`. Whatever takes long runs without the interpreter's lock and ends soon after Ctrl-C.
#![forbid(unsafe_code)]

mod errors;
mod interrupt;
mod process;
mod rays;
mod run;
mod scene;
mod tracer;

/// The module, as Python imports it.
#[pyo3::pymodule]
mod _raybalance {
    use pyo3::prelude::*;
    use rt_balance::catalogue::{ESTIMATORS, POLICIES, QUEUES};

    #[pymodule_export]
    use crate::errors::DeviceError;
    #[pymodule_export]
    use crate::run::Run;
    #[pymodule_export]
    use crate::scene::Scene;
    #[pymodule_export]
    use crate::tracer::Tracer;

    /// Names of every queue, policy and estimator, the default ones first.
    #[pyfunction]
    fn catalogue() -> (Vec<&'static str>, Vec<&'static str>, Vec<&'static str>) {
        (
            QUEUES.iter().map(|entry| entry.name).collect(),
            POLICIES.iter().map(|entry| entry.name).collect(),
            ESTIMATORS.iter().map(|entry| entry.name).collect(),
        )
    }
}
