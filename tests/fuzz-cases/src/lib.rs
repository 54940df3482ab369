//! What raybalance's fuzz targets do with their bytes.
//!
//! Each case takes any bytes and panics if a promise is broken: no panic, hang or wrong answer whatever comes in. The
//! programs in `fuzz/fuzz_targets` hand them to libFuzzer (`cargo xtask fuzz`); the test `corpus` of this package
//! replays `fuzz/corpus`, where every input that once broke something stays.
#![forbid(unsafe_code)]

mod bytes;
mod files;
mod geometry;
mod predicates;
mod scheduling;

pub use files::{camera_path, npy, obj, scene_file};
pub use geometry::geometry;
pub use predicates::predicates;
pub use scheduling::scheduling;

/// A case: panics if its bytes break a promise.
pub type Case = fn(&[u8]);

/// All cases by the name of their program and their folder in the corpus. Whatever is a scene is told by its content,
/// but what libFuzzer makes of a format resembles it.
pub const CASES: &[(&str, Case)] = &[
    ("obj", obj),
    ("ply", scene_file),
    ("stl", scene_file),
    ("gltf", scene_file),
    ("packed", scene_file),
    ("npy", npy),
    ("camera_path", camera_path),
    ("geometry", geometry),
    ("predicates", predicates),
    ("scheduling", scheduling),
];
