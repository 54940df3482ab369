//! What raybalance found, for people and for programs: `report.json`, tables, charts, HTML pages, pictures.
//!
//! Nothing here measures or decides: it is handed [`StreamRun`](rt_balance::report::StreamRun)s and numbers, and writes
//! files that are there in full or not at all ([`output`]).
#![forbid(unsafe_code)]

pub mod chart;
pub mod charts;
pub mod diff;
mod error;
pub mod exit;
pub mod exr;
pub mod frames;
pub mod headline;
pub mod html;
pub mod image;
mod machine;
pub mod npy;
pub mod output;
pub mod pictures;
pub mod print;
mod provenance;
pub mod recipe;
pub mod report;
pub mod table;
pub mod tasks;
pub mod terminal;
pub mod usage;

pub use error::ReportError;
pub use machine::Machine;
pub use provenance::Provenance;
