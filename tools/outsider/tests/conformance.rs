//! The suite on the backend of the examples, from outside the workspace.

#[path = "../../../examples/backend.rs"]
#[expect(dead_code, reason = "an example has a main of its own")]
mod backend;

use rt_conformance::{Capability, Subject, run};
use std::process::ExitCode;
use std::sync::Arc;

fn main() -> ExitCode {
    // There is no tree, so there are no reduced walks, and counts are nobody else's.
    let claims = [Capability::DefinedBits, Capability::Counts, Capability::FullWalks];
    let device = Arc::new(backend::BruteForce::open());
    run(vec![Subject::new("example", "brute force", Ok(device)).claiming(&claims)])
}
