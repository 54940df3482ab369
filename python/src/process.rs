//! Threads do not survive `fork`: in a child of a process that has some, whatever waits for them waits for ever.

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use std::process;
use std::sync::OnceLock;

/// The process in which threads were started first.
static FIRST: OnceLock<u32> = OnceLock::new();

/// Whether the threads that were started are this process's.
pub(crate) fn has_its_threads() -> bool {
    *FIRST.get_or_init(process::id) == process::id()
}

/// Refuses work in a process that was forked off one that had worked.
pub(crate) fn check() -> PyResult<()> {
    if has_its_threads() {
        return Ok(());
    }
    Err(PyRuntimeError::new_err(
        "this process was forked off one that used raybalance, whose threads it does not have: start processes by \
         multiprocessing.get_context('spawn'), or use raybalance in the children alone",
    ))
}
