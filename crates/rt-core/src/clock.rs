//! The clock that all devices of a process share: what a [`Clock`](crate::Clock) is where there is an operating system.

use std::sync::OnceLock;
use std::time::{Duration, Instant};

static ORIGIN: OnceLock<Instant> = OnceLock::new();

/// Time since the first call in this process.
#[must_use]
pub fn now() -> Duration {
    ORIGIN.get_or_init(Instant::now).elapsed()
}
