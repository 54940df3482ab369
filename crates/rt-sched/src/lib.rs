//! Filled in below.
#![no_std]
#![forbid(unsafe_code)]
