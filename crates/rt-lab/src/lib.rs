//! The experiments: what raybalance measures of itself and of the machine.
//!
//! | module | what |
//! |---|---|
//! | [`figure1`] | the paper's Figure 1: tracing time against task size, with and without cost initialisation |
//! | [`simulate`] | machines that are not there, played from measured task times |
//! | [`tradeoff`] | what speed costs in accuracy, in memory and in time to prepare |
//! | [`compare`] | which queue, policy and estimator to use for a scene and devices |
//! | [`estimators`] | those of the catalogue, and those that are only tried |
//! | [`contenders`] | the ways to schedule that other experiments set beside each other |
//! | [`arguments`] | values on the command lines of programs that run experiments |
//! | [`devices`] | the devices of this machine, for people and programs |
//! | [`verify`] | what the suite of promises found, for people and programs |
//! | [`mod@bench`] | how fast each device traces, and what reduced traversal costs beside full |
//!
//! Programs, each with `--help`: `estimation` (what estimates cost and how wrong they are), `coverage` (how often their
//! intervals hold). `cargo run --release -p rt-lab --bin coverage -- yard` runs one.
//!
//! Whoever runs one hands it a [`Lab`]: how scenes are loaded, how it is stopped, and where it shows what it does. So
//! nothing here knows a command line or a terminal.
#![forbid(unsafe_code)]

pub mod arguments;
pub mod bench;
pub mod compare;
pub mod contenders;
pub mod devices;
pub mod estimators;
pub mod figure1;
mod intervals;
mod lab;
mod lifelines;
pub mod simulate;
mod subject;
mod time_budget;
pub mod tradeoff;
pub mod verify;

pub use lab::{Lab, Show};

/// What is measured where no scene is named.
pub const DEFAULT_SCENES: [&str; 2] = ["yard", "car"];
