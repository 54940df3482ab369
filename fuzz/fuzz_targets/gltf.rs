//! Hands libFuzzer's bytes, which begin as glTF files, to the case `scene_file`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| fuzz_cases::scene_file(data));
