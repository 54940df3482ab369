//! Hands libFuzzer's bytes, which begin as packed files, to the case `scene_file`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| fuzz_cases::scene_file(data));
