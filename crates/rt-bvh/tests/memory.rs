//! Where the system refuses memory, building ends in an error that says for what.
#![cfg(target_os = "linux")]

mod common;

use common::{Random, with};
use glam::Vec3;
use rt_bvh::{BuildError, Builder, Mesh, build};
use std::process::Command;

/// The environment variable through which the test tells itself what to build with.
const BUILDER: &str = "RT_BVH_TEST_BUILDER";

/// Runs in a process of its own, under a limit.
#[test]
#[ignore = "part of `refused_memory_is_an_error_wherever_it_happens`"]
fn build_under_a_limit() {
    let builder: Builder = std::env::var(BUILDER).expect("the builder's name").parse().expect("one of ours");
    // Little memory for the mesh itself, and much for what is made of it.
    let mut random = Random::new(1);
    let positions: Vec<Vec3> = (0..1_000).map(|_| random.point()).collect();
    let indices: Vec<[u32; 3]> = (0..200_000).map(|_| [(); 3].map(|()| random.below(1_000) as u32)).collect();
    println!("begun");
    match build(Mesh { positions: &positions, indices: &indices }, &with(builder)) {
        Ok(built) => println!("built by {}", built.report.builder),
        Err(error) => {
            assert!(matches!(error, BuildError::OutOfMemory { bytes, .. } if bytes > 1000), "{error}");
            println!("refused: {error}");
        }
    }
}

/// Guards: everything that grows with the mesh is asked for with a way to fail. Fails (the child aborts) when any of it
/// is grown by `Vec::push` or `vec!`.
#[test]
fn refused_memory_is_an_error_wherever_it_happens() {
    let me = std::env::current_exe().expect("this test");
    for builder in FALLIBLE {
        let (mut refused, mut built) = (0, false);
        // From hardly enough to run to plenty.
        let mut limit = 8_000.0_f64;
        while !built {
            let child = Command::new("sh")
                .arg("-c")
                .arg(format!("ulimit -v {limit:.0} && exec \"$0\" \"$@\""))
                .arg(&me)
                .args(["build_under_a_limit", "--exact", "--ignored", "--nocapture", "--test-threads=1"])
                .env(BUILDER, builder.name())
                .env("RUST_BACKTRACE", "0")
                .output()
                .expect("a shell");
            let out = String::from_utf8_lossy(&child.stdout).into_owned() + &String::from_utf8_lossy(&child.stderr);
            refused += usize::from(out.contains("refused: no memory for"));
            built = out.contains("built by");
            // Before it has begun, the process may lack what it needs to.
            assert!(!out.contains("begun") || child.status.success(), "{builder} at {limit:.0} KiB: {out}");
            limit *= 1.03;
            assert!(limit < 4e6, "{builder}: never built: {out}");
        }
        assert!(refused >= 5, "{builder}: memory was refused at {refused} limits only");
    }
}

/// Not those through `obvhs`, which allocates without a way to fail.
const FALLIBLE: [Builder; 1] = [Builder::Sah];
