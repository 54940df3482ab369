//! Scene files from the command line: coordinates with many digits, malformed statements, refused memory.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// A NumPy file of `rows` of 8 numbers of `descr`, whose bytes are these.
fn npy(descr: &str, rows: usize, data: &[u8]) -> Vec<u8> {
    let dict = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({rows}, 8), }}");
    let mut file = b"\x93NUMPY\x01\x00".to_vec();
    file.extend(118_u16.to_le_bytes());
    file.extend(format!("{dict:<117}\n").bytes());
    file.extend(data);
    file
}

fn single(rays: &[[f64; 8]]) -> Vec<u8> {
    npy("<f4", rays.len(), &rays.iter().flatten().flat_map(|&x| (x as f32).to_le_bytes()).collect::<Vec<_>>())
}

fn double(rays: &[[f64; 8]]) -> Vec<u8> {
    npy("<f8", rays.len(), &rays.iter().flatten().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>())
}

/// A ray down to the plane z = 0.
fn down(x: f64, y: f64, z: f64) -> [f64; 8] {
    [x, y, z, 0.0, 0.0, 0.0, -1.0, f64::INFINITY]
}

/// Traces rays through a scene in `folder` on one core.
fn trace(folder: &Path, scene: &str, rays: &[u8], more: &[&str]) -> Output {
    fs::write(folder.join("scene.obj"), scene).expect("the folder can be written");
    fs::write(folder.join("rays.npy"), rays).expect("the folder can be written");
    Command::new(env!("CARGO_BIN_EXE_raybalance"))
        .current_dir(folder)
        .args(["trace", "scene.obj", "--rays", "rays.npy", "--hits", "hits.npy", "--devices", "cpu:1"])
        .args(more)
        .output()
        .expect("the program starts")
}

/// t and the primitive id of each hit.
fn hits(folder: &Path) -> Vec<(f32, u32)> {
    let file = fs::read(folder.join("hits.npy")).expect("hits are written");
    let word = |row: &[u8], i: usize| u32::from_le_bytes(row[4 * i..4 * i + 4].try_into().expect("four bytes"));
    file[128..].chunks_exact(16).map(|row| (f32::from_bits(word(row, 0)), word(row, 3))).collect()
}

const MISS: (f32, u32) = (f32::INFINITY, u32::MAX);

#[test]
fn a_small_square_far_away_is_hit_where_the_file_says() {
    let folder = tempfile::tempdir().unwrap();
    let scene = "v 512345.100 5412345.250 0\nv 512345.200 5412345.250 0\nv 512345.200 5412345.350 0\n\
        v 512345.100 5412345.350 0\nf 1 2 3 4\n";
    // Beside the square, by numbers that single precision holds.
    let rays = [down(512_345.156_25, 5_412_345.0, 100.0), down(512_345.156_25, 5_412_345.5, 100.0)];
    let run = trace(folder.path(), scene, &single(&rays), &["--json"]);
    assert!(run.status.success(), "{run:?}");
    assert_eq!(hits(folder.path()), [MISS, MISS]);
    let (out, notes) = (String::from_utf8_lossy(&run.stdout), String::from_utf8_lossy(&run.stderr));
    assert!(notes.contains("note: scene.obj: coordinates are kept relative to (5"), "{notes}");
    assert!(notes.contains("vertices by up to 0.25;"), "{notes}");
    let report: serde_json::Value = serde_json::from_str(&out).unwrap();
    let offset: Vec<f64> = serde_json::from_value(report["scene"]["offset"].clone()).unwrap();
    assert!((offset[0] - 512_345.15).abs() < 0.1 && (offset[1] - 5_412_345.3).abs() < 0.1, "{offset:?}");
    assert_eq!(offset[2], 0.0);
    // On both sides of its edges, which single precision cannot tell.
    let rays = [
        down(512_345.15, 5_412_345.249_9, 100.0),
        down(512_345.15, 5_412_345.250_1, 100.0),
        down(512_345.15, 5_412_345.349_9, 100.0),
        down(512_345.15, 5_412_345.350_1, 100.0),
        down(512_345.099_9, 5_412_345.3, 100.0),
        down(512_345.100_1, 5_412_345.3, 100.0),
    ];
    assert!(trace(folder.path(), scene, &double(&rays), &[]).status.success());
    let found = hits(folder.path());
    assert_eq!(found.iter().map(|hit| hit.0).collect::<Vec<_>>(), [MISS.0, 100.0, 100.0, MISS.0, MISS.0, 100.0]);
}

/// A roof of 5 cm cells, its first corner at x, y.
fn roof(x: f64, y: f64) -> String {
    let mut text = String::new();
    for j in 0..41 {
        for i in 0..41 {
            let height = 0.01 * f64::from((i * 7 + j * 3) % 10);
            writeln!(text, "v {:.3} {:.3} {height:.3}", x + 0.05 * f64::from(i), y + 0.05 * f64::from(j))
                .expect("writing to a string cannot fail");
        }
    }
    for j in 0..40 {
        for i in 0..40 {
            let first = 41 * j + i + 1;
            writeln!(text, "f {first} {} {} {}", first + 1, first + 42, first + 41)
                .expect("writing to a string cannot fail");
        }
    }
    text
}

#[test]
fn a_roof_is_hit_alike_wherever_it_stands() {
    let folder = tempfile::tempdir().unwrap();
    let rays = |x: f64, y: f64| -> Vec<[f64; 8]> {
        (0..2000)
            .map(|i| {
                down(x + 0.001 * f64::from(i % 1999) + 0.000_4, y + 0.001 * f64::from(i * 37 % 1999) + 0.000_7, 9.0)
            })
            .collect()
    };
    let mut all = Vec::new();
    for (x, y) in [(0.0, 0.0), (512_345.0, 5_412_345.0), (-512_345.4, 45_412_345.7)] {
        let run = trace(folder.path(), &roof(x, y), &double(&rays(x, y)), &[]);
        assert!(run.status.success(), "{run:?}");
        all.push(hits(folder.path()));
    }
    for other in &all[1..] {
        for (a, b) in all[0].iter().zip(other) {
            assert!(a.1 == b.1 && (a.0 - b.0).abs() < 1e-4, "{a:?} is {b:?} elsewhere");
        }
    }
}

#[test]
fn cameras_are_in_the_coordinates_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let picture = |x: f64, y: f64| {
        fs::write(folder.path().join("scene.obj"), roof(x, y)).unwrap();
        let point = |dx: f64, dy: f64, z: f64| format!("{},{},{z}", x + dx, y + dy);
        let run = Command::new(env!("CARGO_BIN_EXE_raybalance"))
            .current_dir(&folder)
            .args(["render", "scene.obj", "--devices", "cpu:1", "--size", "64x48", "--spp", "1", "--bounces", "0"])
            .args(["--eye", &point(1.0, -1.0, 3.0), "--target", &point(1.0, 1.0, 0.0), "--up", "0,0,1"])
            .output()
            .unwrap();
        assert!(run.status.success(), "{run:?}");
        fs::read(folder.path().join("out/cost.png")).unwrap();
        let mut reader =
            png::Decoder::new(std::io::Cursor::new(fs::read(folder.path().join("out/image.png")).unwrap()))
                .read_info()
                .unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        pixels
    };
    let (near, far) = (picture(0.0, 0.0), picture(512_345.0, 5_412_345.0));
    let differ = near.iter().zip(&far).filter(|(a, b)| a.abs_diff(**b) > 8).count();
    assert!(differ < near.len() / 50, "{differ} of {} bytes differ", near.len());
    assert!(near.iter().any(|&byte| byte != near[0]), "nothing to be seen");
}

#[test]
fn malformed_faces_are_named_and_can_be_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let scene = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\nf 1 2 3\nf 1 2 9\nf 3 2 1\n";
    let rays = single(&[down(0.2, 0.2, 1.0)]);
    let run = trace(folder.path(), scene, &rays, &[]);
    let message = String::from_utf8_lossy(&run.stderr);
    assert!(!run.status.success());
    assert!(message.contains("scene.obj:4: a face with 2 corners") && message.contains("--drop-invalid"), "{message}");
    let run = trace(folder.path(), scene, &rays, &["--drop-invalid"]);
    let message = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{message}");
    assert!(message.starts_with("warning: scene.obj:4: ") && message.contains("2 faces left out"), "{message}");
    assert_eq!(hits(folder.path()), [(1.0, 0)]);
}

/// Fails when a list of the loader is grown without care: the process aborts.
#[test]
#[cfg(target_os = "linux")]
fn memory_that_is_refused_while_loading_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let mut scene = roof(0.0, 0.0);
    let comment = "# nothing to see here, only a long line that makes the file large\n";
    while scene.len() < 200 << 20 {
        scene += comment;
    }
    fs::write(folder.path().join("large.obj"), scene).unwrap();
    // The file alone is more than this, and the program with its threads less.
    let run = Command::new("sh")
        .arg("-c")
        .arg("ulimit -v 180000 && exec \"$0\" \"$@\"")
        .arg(env!("CARGO_BIN_EXE_raybalance"))
        .current_dir(&folder)
        .args(["render", "large.obj", "--size", "64x64", "--spp", "1", "--devices", "cpu:1"])
        .output()
        .unwrap();
    let message = String::from_utf8_lossy(&run.stderr);
    assert_eq!(run.status.code(), Some(1), "{message}");
    assert!(message.contains("large.obj: the system refused 209") && message.contains("bytes of memory"), "{message}");
}
