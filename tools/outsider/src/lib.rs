//! Somebody else's crate. What it is for is in its examples and tests.
#![forbid(unsafe_code)]
