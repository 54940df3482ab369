//! How the command ends: exit codes, signals, and outputs that the outside world does not take.

mod folder;
#[cfg(unix)]
mod outputs;
#[cfg(unix)]
mod signals;
mod usage;
