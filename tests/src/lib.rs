//! Filled in below.
#![forbid(unsafe_code)]
