//! The suite on the backend of the examples, from outside the workspace.

#[path = "../../../examples/backend.rs"]
#[expect(dead_code, reason = "an example has a main of its own")]
mod backend;

use rt_conformance::{Subject, run};
use std::process::ExitCode;
use std::sync::Arc;

fn main() -> ExitCode {
    run(vec![Subject::new("example", "brute force", Ok(Arc::new(backend::BruteForce::open())))])
}
