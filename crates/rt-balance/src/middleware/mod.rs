//! Devices around devices: slower, failing, or remembering what they did.
//!
//! They implement the same traits as backends, so a balancer cannot tell the difference; experiments and tests use
//! them to make unequal speeds and failures on one machine.

mod faulty;
mod recorded;
mod throttled;

pub use faulty::{Failure, Fault, Faulty, FaultyCall, Lie};
pub use recorded::{Record, Recorded};
pub use throttled::Throttled;
