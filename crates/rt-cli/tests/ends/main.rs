//! How the command ends: exit codes, signals, and outputs that the outside world does not take; and what `compare` and
//! `diff` leave behind.
#![expect(clippy::unwrap_used, reason = "a broken fixture is to panic in helpers as in tests")]

mod compare;
mod folder;
#[cfg(unix)]
mod outputs;
#[cfg(unix)]
mod signals;
mod usage;
