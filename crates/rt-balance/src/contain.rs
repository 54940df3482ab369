//! Calls of other people's code, whose panics end here.

use rt_core::{DeviceError, DeviceErrorKind};
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Calls a backend; a panic in it is an error that names the call.
///
/// Whatever the backend was in the middle of is in an unknown state then: its tracer is only dropped, also in here. A
/// program that is compiled with `panic = "abort"` ends all the same.
pub(crate) fn contain<T>(call: &str, work: impl FnOnce() -> Result<T, DeviceError>) -> Result<T, DeviceError> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|payload| {
        let message = format!("the backend panicked in `{call}`: {}", message(payload));
        Err(DeviceError::new(DeviceErrorKind::Panicked, message))
    })
}

/// What a panic said.
fn message(payload: Box<dyn Any + Send>) -> String {
    match payload.downcast::<String>() {
        Ok(text) => *text,
        Err(payload) => match payload.downcast::<&'static str>() {
            Ok(text) => (*text).to_owned(),
            Err(payload) => {
                // A value of the backend's own: its destructor may panic as well, here where nobody expects it.
                std::mem::forget(payload);
                "it does not say why".to_owned()
            }
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Grenade;

    impl Drop for Grenade {
        fn drop(&mut self) {
            panic!("in the destructor of what a panic carried");
        }
    }

    /// Mutants: a payload that is no text is dropped; `&str` alone is looked for.
    #[test]
    fn every_panic_is_an_error_that_names_the_call() {
        let error = |work: fn() -> Result<(), DeviceError>| contain("walk", work).expect_err("a panic");
        assert_eq!(error(|| panic!("so")).to_string(), "the backend panicked in `walk`: so");
        assert_eq!(error(|| panic!("so {}", 1)).to_string(), "the backend panicked in `walk`: so 1");
        let thrown = error(|| std::panic::panic_any(Grenade));
        assert_eq!((thrown.kind(), thrown.to_string().contains("walk")), (DeviceErrorKind::Panicked, true));
        assert_eq!(contain("walk", || Ok(1)).expect("no panic"), 1);
    }
}
