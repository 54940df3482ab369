//! Hands libFuzzer's bytes to the case `predicates`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| fuzz_cases::predicates(data));
