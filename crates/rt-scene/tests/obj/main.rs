//! The OBJ loader from outside: what it accepts, what it refuses and how it says so.

mod defects;
mod digits;
mod encodings;
mod files;
mod garbage;
mod materials;
mod memory;
mod polygons;

use glam::Vec3;
use rt_scene::obj::{LoadError, LoadOptions, Loaded, load_obj_from, unwatched};
use std::io;

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

const LENIENT: LoadOptions = LoadOptions { drop_invalid: true, max_triangles: u32::MAX - 1 };

fn no_materials(_: &str) -> io::Result<Vec<u8>> {
    Err(io::ErrorKind::NotFound.into())
}

fn load(text: impl AsRef<[u8]>, options: &LoadOptions) -> Result<Loaded, LoadError> {
    load_obj_from(text.as_ref(), "test.obj", options, &no_materials, &mut unwatched)
}

fn good(text: impl AsRef<[u8]>) -> Loaded {
    load(text, &LoadOptions::default()).expect("a good text")
}

/// The message of the error that the text ends in.
fn refused(text: impl AsRef<[u8]>) -> String {
    let text = text.as_ref();
    load(text, &LoadOptions::default()).expect_err(&String::from_utf8_lossy(text)).to_string()
}

/// The corners of every triangle.
fn corners(loaded: &Loaded) -> Vec<[Vec3; 3]> {
    loaded.model.indices.iter().map(|t| t.map(|i| loaded.model.positions[i as usize])).collect()
}

/// Whether each triangle can be hit: its vertices are finite.
fn kept(loaded: &Loaded) -> Vec<bool> {
    corners(loaded).iter().map(|triangle| triangle.iter().all(|p| p.is_finite())).collect()
}

#[test]
fn everything_usual_is_read() {
    let text = b"\xef\xbb\xbf# Sch\xf6ne Gr\xfc\xdfe, C:\\temp\\\r\nmtllib gone.mtl\r\no one\r\nv 0 0 0 1\r\nv 1 0 0 0.5 0.5 0.5\r\n\
        v 1 \\\r\n 1 0\r\nv 0 1 0 # corner\r\nvt 0 nan\r\nvn 0 0 one\r\ng two\r\ns off\r\nf 1/1/1 2//7 +3/9 4\r\np 1\r\nl 1 2 3\r\n\
        usemtl\r\nV 5 5 5\r\nfo -5 -3/-1/-1 -2\r\n";
    let loaded = good(text);
    let [a, b, c, d] = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
    assert_eq!(corners(&loaded), [[a, b, c], [a, c, d], [a, c, d]]);
    // The fifth vertex is in no face.
    assert_eq!(loaded.model.positions.len(), 4);
    assert_eq!((loaded.skipped_points, loaded.skipped_lines, loaded.left_out), (1, 1, 0));
    assert_eq!(loaded.model.source, "test.obj");
    assert_eq!(loaded.warnings.len(), 1);
    assert!(loaded.warnings[0].contains("gone.mtl"), "{:?}", loaded.warnings);
}

/// Mutants: a part for a name without faces; faces above the first name lost; groups of the object before; one group in
/// two parts where it is named twice in a row; a whole file without names taken for a part.
#[test]
fn objects_and_groups_are_parts() {
    let parts = |text: &str| {
        let text = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{}", text.replace('F', "f 1 2 3"));
        let parts = good(text).model.geometries;
        parts.into_iter().map(|part| (part.name, part.first)).collect::<Vec<_>>()
    };
    let named = |list: &[(&str, u32)]| list.iter().map(|&(name, first)| (name.to_owned(), first)).collect::<Vec<_>>();
    assert_eq!(parts("F\nF"), named(&[]));
    assert_eq!(parts("g\nF\ng\nF"), named(&[]));
    assert_eq!(parts("o left wing\nF\nF"), named(&[("left wing", 0)]));
    assert_eq!(
        parts("F\no empty\no a\nF\ng b\nF\ng b\nF\nO c\nF\no d"),
        named(&[("", 0), ("a", 1), ("a/b", 2), ("c", 4)])
    );
    assert_eq!(parts("g x\nF\ng y\ng x\nF"), named(&[("x", 0)]));
    assert_eq!(parts("o x\ng x\nF\no y\nF\no x\nF"), named(&[("x", 0), ("y", 1), ("x", 2)]));
}

#[test]
fn faces_may_stand_before_their_vertices_and_span_groups() {
    let loaded = good(
        "f 1 2 3\nf 4 5 6 7\nusemtl a\no other\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\n\
        v 0 0 0\nv 2 4 0\nv 4 0 0\nv 2 1 0\n",
    );
    let [a, b, c, d] = [Vec3::ZERO, Vec3::new(2.0, 4.0, 0.0), Vec3::new(4.0, 0.0, 0.0), Vec3::new(2.0, 1.0, 0.0)];
    let triangle = [Vec3::ZERO, Vec3::X, Vec3::Y];
    assert_eq!(corners(&loaded), [triangle, [b, c, d], [b, d, a], triangle]);
}
