//! Hands libFuzzer's bytes to the case `camera_path`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| fuzz_cases::camera_path(data));
