//! Whatever a device or a caller does wrong: hits are right or the error has a name, and nothing waits for ever.
//!
//! `RAYBALANCE_CHAOS=N cargo test -p rt-balance --test faults chaos` tries N random schedules of faults in place of a
//! thousand.

mod callers;
mod chaos;
mod environment;
mod fixture;
mod lies;
mod panics;
mod queues;
mod silence;
