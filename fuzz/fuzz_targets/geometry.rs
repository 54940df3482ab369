//! Hands libFuzzer's bytes to the case `geometry`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| fuzz_cases::geometry(data));
