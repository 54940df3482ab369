//! Where the system refuses memory, loading ends in an error that names the file and the bytes.

use rt_scene::obj::{Fault, LoadOptions, load_obj, unwatched};
use std::path::Path;
use std::process::Command;

/// The environment variable through which the test tells itself what to load.
const FILE: &str = "RT_SCENE_TEST_FILE";

/// Runs in a process of its own, under a limit.
#[test]
#[ignore = "part of `refused_memory_is_an_error_wherever_it_happens`"]
fn load_under_a_limit() {
    let file = std::env::var(FILE).expect("the file's name");
    match load_obj(Path::new(&file), &LoadOptions::default(), &mut unwatched) {
        Ok(_) => println!("loaded"),
        Err(error) => {
            assert!(matches!(error.fault, Fault::Memory { bytes } if bytes > 1000), "{error}");
            let message = error.to_string();
            assert!(message.contains(&file) && message.contains("bytes of memory"), "{message}");
            println!("refused");
        }
    }
}

/// Guards: every list that grows with the file is grown with care. Fails (the child aborts) when any of them is grown
/// by `Vec::push` or `vec!`.
#[test]
#[cfg(target_os = "linux")]
fn refused_memory_is_an_error_wherever_it_happens() {
    let folder = tempfile::tempdir().unwrap();
    let vertices: String = (0..300_000).map(|i| format!("v {} {} 5412345.{i}\n", i % 7, i % 11)).collect();
    let triangles: String = (1..299_998).map(|i| format!("usemtl m{}\nf {i} {} {}\n", i / 4, i + 1, i + 2)).collect();
    let forward: String = (1..100_000).map(|i| format!("f {i} {} {} {}\n", i + 1, i + 2, i + 3)).collect();
    let texts = [
        format!("mtllib m.mtl\n{vertices}{triangles}"),
        format!("{forward}{vertices}"),
        // As UTF-16, which needs another list.
        String::from_utf8_lossy(
            &(vertices.clone() + "f 1 2 3\n").encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>(),
        )
        .into_owned(),
    ];
    std::fs::write(folder.path().join("m.mtl"), "newmtl m\nKd 1 0 0\n").unwrap();
    let me = std::env::current_exe().unwrap();
    for (i, text) in texts.iter().enumerate() {
        let path = folder.path().join(format!("{i}.obj"));
        std::fs::write(&path, text).unwrap();
        let (mut refused, mut loaded) = (0, 0);
        // From hardly enough to run to plenty.
        let mut limit = 8_000.0_f64;
        while loaded == 0 {
            let child = Command::new("sh")
                .arg("-c")
                .arg(format!("ulimit -v {limit:.0} && exec \"$0\" \"$@\""))
                .arg(&me)
                .args(["memory::load_under_a_limit", "--exact", "--ignored", "--nocapture", "--test-threads=1"])
                .env(FILE, &path)
                .env("RUST_BACKTRACE", "0")
                .output()
                .unwrap();
            let out = String::from_utf8_lossy(&child.stdout).into_owned() + &String::from_utf8_lossy(&child.stderr);
            refused += usize::from(out.contains("refused"));
            loaded += usize::from(out.contains("loaded"));
            // Below the first refusal the process may lack what it needs to begin.
            assert!(refused == 0 || child.status.success(), "file {i} at {limit:.0} KiB: {out}");
            limit *= 1.04;
            assert!(limit < 4e6, "file {i} is never loaded: {out}");
        }
        assert!(refused >= 5, "file {i}: memory was refused at {refused} limits only");
    }
}
