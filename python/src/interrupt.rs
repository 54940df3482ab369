//! Ctrl-C while native code is at work.

use pyo3::prelude::*;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

/// How often signals are looked for. People take a tenth of a second for at once.
const POLL: Duration = Duration::from_millis(50);

/// Runs `work` without the interpreter's lock. It is told by the flag when a signal's handler raises, as Python's own
/// does after Ctrl-C, and should return soon then, whatever: the handler's exception is what is raised.
///
/// The work has a thread of its own: Python's handlers run on the thread that waits, however long the work has nothing
/// to tell.
pub(crate) fn interruptible<T: Send>(py: Python<'_>, work: impl FnOnce(&AtomicBool) -> T + Send) -> PyResult<T> {
    let cancel = AtomicBool::new(false);
    py.detach(|| {
        thread::scope(|scope| {
            let (at_work, ended) = channel::<()>();
            let cancel = &cancel;
            let run = move || {
                // Dropped when the work returns or panics.
                let _at_work = at_work;
                work(cancel)
            };
            let worker = thread::Builder::new().name("raybalance".to_owned()).spawn_scoped(scope, run)?;
            let mut raised = None;
            while ended.recv_timeout(POLL) == Err(RecvTimeoutError::Timeout) {
                if raised.is_none()
                    && let Err(error) = Python::attach(|py| py.check_signals())
                {
                    cancel.store(true, Ordering::Relaxed);
                    raised = Some(error);
                }
            }
            let done = worker.join();
            match raised {
                Some(error) => Err(error),
                None => done.map_err(|panic| resume_unwind(panic)),
            }
        })
    })
}
