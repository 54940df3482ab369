//! Hands libFuzzer's bytes to the case `obj`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| fuzz_cases::obj(data));
