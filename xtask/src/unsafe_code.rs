//! Checks for what the compiler cannot see: `cargo xtask asan` and `cargo xtask loom`.

use crate::command::{cargo, root, run};
use crate::{embree, nightly, setup, vulkan};
use anyhow::{Result, bail};
use std::process::Command;

/// Packages with `unsafe` in them, and the tests that go through all of it: the bindings' sentinel, the kernels for
/// processors, both GPU backends with all layouts, and Embree beside them. The tests of lost devices hang them on
/// purpose and hold them to limits of time, which instrumented programs on a shared machine do not keep.
const TESTS: &str = "test --target x86_64-unknown-linux-gnu --no-fail-fast -p backend-vulkan -p backend-wgpu \
                     -p embree4-sys -p rt-simd -p rt-tests --lib --test abi --test embree --test gpu --test layouts \
                     --test peers --test rays";

/// Leaks that are not ours, by the library that keeps the memory.
const SUPPRESSIONS: &str = "xtask/leaks.supp";

/// AddressSanitizer and LeakSanitizer over everything that has `unsafe`: the GPU backends on the software driver, the
/// bindings to Embree, and kernels in intrinsics.
pub(crate) fn asan() -> Result<()> {
    if !cfg!(all(target_os = "linux", target_arch = "x86_64")) {
        bail!("asan runs on Linux on x86-64 only");
    }
    nightly::require("AddressSanitizer")?;
    let setup = setup::setup()?;
    let mut tests = nightly::cargo(TESTS);
    tests.env("RUSTFLAGS", "-Zsanitizer=address");
    tests.env("CARGO_TARGET_DIR", root().join("target/asan"));
    // Embree and the driver's compiler are not instrumented, and hand over containers that are.
    tests.env("ASAN_OPTIONS", "detect_leaks=1:detect_container_overflow=0");
    let suppressions = root().join(SUPPRESSIONS);
    tests.env("LSAN_OPTIONS", format!("suppressions={}:print_suppressions=0", suppressions.display()));
    tests.env("RT_REQUIRE", setup.provided.join(","));
    // Real scenes bring no other calls, and take long.
    tests.env_remove(real_scenes::VARIABLE);
    if let Some(library) = &setup.embree {
        tests.env(embree::VARIABLE, library);
    }
    if setup.software_vulkan {
        tests.envs(vulkan::environment()?);
    }
    run(&mut tests)
}

/// Every interleaving of a few devices on the lock-free queues.
pub(crate) fn loom() -> Command {
    let mut tests = cargo("test -p rt-sched --lib loom");
    tests.env("RUSTFLAGS", "--cfg loom");
    // Its own, since the flag would have everything built anew.
    tests.env("CARGO_TARGET_DIR", root().join("target/loom"));
    tests
}
