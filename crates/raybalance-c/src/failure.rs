//! How calls fail: a status, and words that stay until the thread's next call.

use crate::types::rb_status;
use rt_balance::{BalanceError, BuildError, with_causes};
use std::cell::RefCell;
use std::error::Error;
use std::ffi::{CStr, CString};
use std::panic::{AssertUnwindSafe, catch_unwind};

thread_local! {
    static LAST: RefCell<CString> = RefCell::default();
}

/// Why a call fails.
#[derive(Debug)]
pub(crate) struct Failure {
    pub(crate) status: rb_status,
    pub(crate) message: String,
}

impl Failure {
    /// The caller's mistake.
    pub(crate) fn argument(message: impl Into<String>) -> Self {
        Self { status: rb_status::RB_INVALID_ARGUMENT, message: message.into() }
    }

    /// An error of the facade, with its causes.
    pub(crate) fn of(status: rb_status, error: &dyn Error) -> Self {
        Self { status, message: with_causes(error) }
    }
}

impl From<BuildError> for Failure {
    fn from(error: BuildError) -> Self {
        let status = match error {
            BuildError::OutOfMemory { .. } => rb_status::RB_OUT_OF_MEMORY,
            _ => rb_status::RB_INVALID_ARGUMENT,
        };
        Self::of(status, &error)
    }
}

impl From<BalanceError> for Failure {
    fn from(error: BalanceError) -> Self {
        let status = match error {
            BalanceError::Cancelled { .. } => rb_status::RB_CANCELLED,
            BalanceError::Length { .. } | BalanceError::Hits { .. } | BalanceError::NoDevices => {
                rb_status::RB_INVALID_ARGUMENT
            }
            _ => rb_status::RB_DEVICE,
        };
        Self::of(status, &error)
    }
}

/// Does a call's work, and keeps the words of its failure. Panics end here.
pub(crate) fn call(work: impl FnOnce() -> Result<(), Failure>) -> rb_status {
    let done = catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let words = panic.downcast_ref::<&str>().map(|words| (*words).to_owned());
        let words = words.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_default();
        Err(Failure { status: rb_status::RB_DEFECT, message: format!("a defect of raybalance: {words}") })
    });
    let (status, message) = match done {
        Ok(()) => (rb_status::RB_OK, String::new()),
        Err(Failure { status, message }) => (status, message),
    };
    let message = CString::new(message.replace('\0', " ")).unwrap_or_default();
    LAST.with(|last| *last.borrow_mut() = message);
    status
}

/// The words of the thread's last call.
pub(crate) fn with_last<T>(read: impl FnOnce(&CStr) -> T) -> T {
    LAST.with(|last| read(&last.borrow()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn last() -> String {
        with_last(|last| last.to_string_lossy().into_owned())
    }

    /// Mutants: a panic that goes on; words of a failure that stay after a success.
    #[test]
    fn panics_become_a_status_with_their_words() {
        let panicking = || -> Result<(), Failure> { panic!("all is {}", "lost") };
        assert_eq!(call(panicking), rb_status::RB_DEFECT);
        assert_eq!(last(), "a defect of raybalance: all is lost");
        assert_eq!(call(|| Err(Failure::argument("rays: 1\0 2"))), rb_status::RB_INVALID_ARGUMENT);
        assert_eq!(last(), "rays: 1  2");
        assert_eq!(call(|| Ok(())), rb_status::RB_OK);
        assert_eq!(last(), "");
    }
}
