//! Hands libFuzzer's bytes to the case `scheduling`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| fuzz_cases::scheduling(data));
