//! Statements that mean nothing: named with file, line and remedy, or left out face by face.

use super::{LENIENT, TRIANGLE, corners, good, kept, load, refused};
use glam::Vec3;
use rt_scene::obj::{Fault, LoadOptions};

const VERTICES: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

#[test]
fn errors_name_file_line_and_remedy() {
    let with = |rest: &str| format!("{VERTICES}{rest}").into_bytes();
    let cases: &[(Vec<u8>, &[&str])] = &[
        (Vec::new(), &["test.obj: not an OBJ", "empty", "export"]),
        (b"\x7fELF\x00\x01".to_vec(), &["test.obj: not an OBJ", "binary"]),
        (b"ply\nformat ascii 1.0\n".to_vec(), &["PLY"]),
        (b"solid x\nfacet\n".to_vec(), &["STL"]),
        (b"glTF\x02\0\0\0".to_vec(), &["binary glTF"]),
        (b"\x1f\x8b\x08".to_vec(), &["gzip", "unpack"]),
        (b"\xfd7zXZ\0".to_vec(), &["xz", "unpack"]),
        (b"\x28\xb5\x2f\xfd".to_vec(), &["zstd", "unpack"]),
        (b"BZh9".to_vec(), &["bzip2", "unpack"]),
        (b"PK\x03\x04".to_vec(), &["zip", "unpack"]),
        (b"\xff\xfe\0\0v\0\0\0".to_vec(), &["UTF-32", "UTF-8"]),
        (b"Dear Sir,\nyours".to_vec(), &["no vertices and no faces"]),
        (VERTICES.into(), &["test.obj: no faces (3 vertices)", "export"]),
        (with("p 1\nl 1 2\n"), &["no faces"]),
        (with("\nf 1 2 4\n"), &["test.obj:5: index 4", "the 3 vertices", "correct", "without the faces"]),
        (with("f 1 2 3\r\nf 1 2 99999999999999999999999\r\n"), &["test.obj:5: index 99999999999999999999999"]),
        (with("f 1 2 4294967296\n"), &["test.obj:4: index 4294967296"]),
        (with("f 1 2 3\nf 1 2/4 5/3 3\nf 1 2 9\n"), &["test.obj:5: index 5"]),
        (with("f 1 2 0\n"), &["test.obj:4: index 0"]),
        (with("f 1 -4 2\nv 0 0 1\n"), &["test.obj:4: index -4", "the 3 vertices"]),
        (with("f 1 -9223372036854775808 2\n"), &["test.obj:4: index -9223372036854775808"]),
        (with("f 1 2 x\n"), &["test.obj:4: 'x' is not a number"]),
        (with("f 1 2 /1\n"), &["test.obj:4: '/1' is not a number"]),
        (with("f 1 2 3.5\n"), &["test.obj:4: '3.5'"]),
        (with("f 1 2 nan\n"), &["test.obj:4: 'nan'"]),
        (with("f1 2 3\n"), &["test.obj:4: 'f1' is not a number"]),
        (with("f 1 2 \\\n # \\\n\n"), &["test.obj:4: a face with 2 corners"]),
        (with("f\n"), &["test.obj:4: a face with 0 corners"]),
        (with("v 1 2\nf 1 2 3\n"), &["test.obj:4: a vertex with 2 coordinates", "without the faces"]),
        (with("# \nv 1 zwei 2\nf 1 2 3\n"), &["test.obj:5: 'zwei' is not a number", "correct"]),
        (with("v 1 2,5 2\nf 1 2 3\n"), &["test.obj:4: '2,5' is not a number", "decimal point"]),
        (with("v 1 1.0D+00 2\nf 1 2 3\n"), &["test.obj:4: '1.0D+00'", "with an e"]),
        (with("v1 2 3\nf 1 2 3\n"), &["test.obj:4: 'v1' is not a number"]),
        (with("v\u{a0}1 2 3\nf 1 2 3\n"), &["test.obj:4: 'v\\u{a0}1'", "ASCII"]),
        (with("v \u{2212}1 2 3\nf 1 2 3\n"), &["test.obj:4: '\\u{2212}1'", "ASCII"]),
        (b"v 1 2\xa03 4 5\nf 1 1 1\n".to_vec(), &["test.obj:1: '2\\xa03'", "ASCII"]),
        ("v 1 2 3\u{2028}v 1 2 3\u{2028}f 1 1 1\n".into(), &["test.obj:1: '3\\u{2028}v'", "line ends", "ASCII"]),
        (
            with("v 0 nan 0\nv inf 0 0\nv 0 0 1e39\nf 1 2 4\nf 4 5 6"),
            &["test.obj:4:", "3 such vertices", "without the faces"],
        ),
        (with("v 0 nan 0\nv inf 0 0\nf 1 2 5"), &["test.obj:5: a vertex that faces use"]),
    ];
    for (text, parts) in cases {
        let error = refused(text);
        for part in *parts {
            assert!(error.contains(part), "{error}\n lacks {part:?}");
        }
    }
    let options = LoadOptions { max_triangles: 2, ..LoadOptions::default() };
    assert!(load(with("f 1 2 3 1\n"), &options).is_ok());
    let error = load(with("f 1 2 3 1 2\n"), &options).unwrap_err().to_string();
    assert!(error.contains("test.obj: more than 2 triangles"), "{error}");
}

/// Every defect of a face or of its vertices, and the triangles that such a face has where it is left out.
const DEFECTS: [(&str, usize); 27] = [
    ("f", 0),
    ("f 1", 0),
    ("f 1 2", 0),
    ("f 1 2 9", 1),
    ("f 9 2 1 3", 2),
    ("f 1 2 0", 1),
    ("f 1 2 -9", 1),
    ("f 1 2 99999999999999999999 3 1", 3),
    ("f 1 2 x", 1),
    ("f 1 2 1,5", 1),
    ("f 1 2 3.0", 1),
    ("f 1 2 nan", 1),
    ("f1 2 3 1", 1),
    ("f 1 /2 3", 1),
    ("v 0 0\nf 1 2 -1", 1),
    ("v\nf 1 2 -1 3", 2),
    ("v nan 0 0\nf 1 2 -1", 1),
    ("v 0 -inf 0\nf 3 1 2 -1 1", 3),
    ("v 0 0 1.#QNAN\nf 1 2 -1", 1),
    ("v 0 -1.#IND00 0\nf 1 2 -1", 1),
    ("v 0 Infinity 0\nf 1 2 -1", 1),
    ("v 0 \u{221e} 0\nf 1 2 -1", 1),
    ("v 0 None 0\nf 1 2 -1", 1),
    ("v 0 ***** 0\nf 1 2 -1", 1),
    ("v 1,5 0 0\nf 1 2 -1", 1),
    ("v 1e39 0 0\nf 1 2 -1", 1),
    ("v 1e999 0 0\nf 1 2 -1", 1),
];

#[test]
fn defects_drop_faces_and_not_files() {
    for (defect, triangles) in DEFECTS {
        let text = format!("{TRIANGLE}{defect}\nf 3 2 1\n");
        let error = load(&text, &LoadOptions::default()).expect_err(&text);
        assert!(matches!(error.fault, Fault::Defect { line: 5, .. }), "{defect}: {error}");
        let loaded = load(&text, &LENIENT).expect(&text);
        // Every other face keeps its number.
        let expected: Vec<bool> = [true].into_iter().chain(vec![false; triangles]).chain([true]).collect();
        assert_eq!(kept(&loaded), expected, "{defect}");
        assert_eq!(corners(&loaded)[triangles + 1], [Vec3::Y, Vec3::X, Vec3::ZERO], "{defect}");
        assert_eq!(loaded.left_out, 1, "{defect}");
        assert_eq!(loaded.warnings.len(), 1, "{defect}");
        let warning = &loaded.warnings[0];
        assert!(warning.starts_with("test.obj:5: ") && warning.ends_with("1 face left out"), "{defect}: {warning}");
    }
    let all: String = DEFECTS.map(|(defect, _)| format!("{defect}\n")).concat();
    let loaded = load(format!("{TRIANGLE}{all}"), &LENIENT).unwrap();
    assert_eq!(loaded.left_out, DEFECTS.len() as u64);
    assert_eq!(kept(&loaded).iter().filter(|&&kept| kept).count(), 1);
    assert_eq!(loaded.warnings.len(), 1);
    assert!(loaded.warnings[0].ends_with("27 faces left out"), "{:?}", loaded.warnings);
}

#[test]
fn faces_before_their_vertices_are_left_out_likewise() {
    let loaded = load(format!("f 1 2 3\nf 1 2 5\nf 1 2 4 3\nf 3 2 1\n{VERTICES}v nan 0 0\n"), &LENIENT).unwrap();
    assert_eq!(kept(&loaded), [true, false, false, false, true]);
    assert_eq!(loaded.left_out, 2);
    assert!(loaded.warnings[0].starts_with("test.obj:2: index 5 "), "{:?}", loaded.warnings);
}

#[test]
fn what_no_face_uses_harms_nobody() {
    let loaded = good(format!("v nan 0 0\nv 1e300 0 0\nv 1.#INF 0 0\n{}", TRIANGLE.replace("f 1 2 3", "f 4 5 6")));
    assert_eq!((loaded.left_out, loaded.model.positions.len()), (0, 3));
    assert_eq!(loaded.warnings, [""; 0]);
    // But a vertex that cannot be read is an error, since those who use it by number may mean another.
    assert!(refused("v 1 2\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 2 3 4\n").contains("test.obj:1"));
}

#[test]
fn repeated_corners_are_no_defect() {
    let loaded = good(format!("{VERTICES}f 1 1 2\nf 1 2 2 3\nf 1 2 3 1\n"));
    assert_eq!((loaded.model.indices.len(), loaded.left_out), (5, 0));
    assert_eq!(loaded.warnings, [""; 0]);
}

#[test]
fn a_file_of_nothing_but_defects_has_no_faces() {
    let error = load("v 0 0 0\nf 1 2\nf 1\n", &LENIENT).unwrap_err();
    assert!(matches!(error.fault, Fault::NoTriangles { vertices: 1 }), "{error}");
    let error = load("f 1 2\n", &LENIENT).unwrap_err();
    assert!(matches!(error.fault, Fault::NoTriangles { vertices: 0 }), "{error}");
}
