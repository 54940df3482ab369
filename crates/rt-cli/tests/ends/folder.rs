//! A folder with a small scene and rays, and the command in it.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};
use tempfile::TempDir;

/// One triangle.
pub(crate) const SCENE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// Options that make a picture in an instant.
pub(crate) const SMALL: [&str; 8] = ["--size", "8x8", "--spp", "1", "--bounces", "0", "--devices", "cpu:1"];

/// A folder with `scene.obj` and `rays.npy`, and nothing else.
pub(crate) struct Folder(TempDir);

impl Folder {
    pub(crate) fn new() -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        fs::write(folder.at("scene.obj"), SCENE).unwrap();
        fs::write(folder.at("rays.npy"), npy("<f4", "(1, 8)", &ray())).unwrap();
        folder
    }

    pub(crate) fn at(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// The command, to be run in the folder.
    pub(crate) fn raybalance(&self) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_raybalance"));
        command.current_dir(self.0.path());
        command
    }

    /// Runs the command with words that blanks separate.
    pub(crate) fn run(&self, words: &str) -> Ended {
        Ended::of(self.raybalance().args(words.split_whitespace()).output().unwrap())
    }

    /// Names of everything in the folder, in alphabetical order.
    pub(crate) fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(self.0.path()).unwrap();
        let mut names: Vec<String> =
            entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }
}

/// How a command ended.
#[derive(Debug)]
pub(crate) struct Ended {
    pub(crate) code: Option<i32>,
    pub(crate) out: String,
    pub(crate) err: String,
}

impl Ended {
    pub(crate) fn of(output: Output) -> Self {
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        Self { code: output.status.code(), out: text(&output.stdout), err: text(&output.stderr) }
    }
}

/// A NumPy file.
pub(crate) fn npy(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n");
    let mut file = b"\x93NUMPY\x01\x00".to_vec();
    file.extend((header.len() as u16).to_le_bytes());
    file.extend(header.bytes());
    file.extend(data);
    file
}

/// A ray that meets the triangle.
pub(crate) fn ray() -> Vec<u8> {
    [0.2_f32, 0.2, 1.0, 0.0, 0.0, 0.0, -1.0, f32::INFINITY].iter().flat_map(|x| x.to_le_bytes()).collect()
}
