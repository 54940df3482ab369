//! The OBJ loader from outside: what it accepts, what it refuses and how it says so.

use glam::Vec3;
use proptest::prelude::*;
use rt_scene::obj::{LoadError, LoadOptions, LoadStage, Loaded, load_obj, load_obj_from};
use std::io;
use std::path::Path;

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

fn no_materials(_: &str) -> io::Result<Vec<u8>> {
    Err(io::ErrorKind::NotFound.into())
}

fn load(text: impl AsRef<[u8]>, options: &LoadOptions) -> Result<Loaded, LoadError> {
    load_obj_from(text.as_ref(), "test.obj", options, &no_materials, &mut |_| {})
}

fn good(text: impl AsRef<[u8]>) -> Loaded {
    load(text, &LoadOptions::default()).expect("a good text")
}

/// The corners of every triangle.
fn corners(loaded: &Loaded) -> Vec<[Vec3; 3]> {
    loaded.model.indices.iter().map(|t| t.map(|i| loaded.model.positions[i as usize])).collect()
}

#[test]
fn everything_usual_is_read() {
    let text = b"\xef\xbb\xbf# Sch\xf6ne Gr\xfc\xdfe, C:\\temp\\\r\nmtllib gone.mtl\r\no one\r\nv 0 0 0 1\r\nv 1 0 0 0.5 0.5 0.5\r\n\
        v 1 \\\r\n 1 0\r\nv 0 1 0 # corner\r\nvt 0 nan\r\nvn 0 0 one\r\ng two\r\ns off\r\nf 1/1/1 2//7 +3/9 4\r\np 1\r\nl 1 2 3\r\n\
        usemtl\r\nusemtl stone\r\nf -4 -2/-1/-1 -1\r\n";
    let loaded = good(text);
    let [a, b, c, d] = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
    assert_eq!(corners(&loaded), [[a, b, c], [a, c, d], [a, c, d]]);
    assert_eq!((loaded.skipped_points, loaded.skipped_lines), (1, 1));
    assert_eq!(loaded.model.source, "test.obj");
    assert_eq!(loaded.warnings.len(), 1);
    assert!(loaded.warnings[0].contains("gone.mtl"), "{:?}", loaded.warnings);
}

#[test]
fn faces_may_stand_before_their_vertices_and_span_groups() {
    let loaded = good("f 1 2 3\nusemtl a\no other\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\n");
    assert_eq!(corners(&loaded), [[Vec3::ZERO, Vec3::X, Vec3::Y]; 2]);
}

#[test]
fn polygons_become_fans_in_file_order() {
    let mut text = String::new();
    for i in 0..7 {
        text += &format!("v {i} {} 0\n", i * i);
    }
    text += "f 1 2 3 4 5 6 7\nf 7 6 5\n";
    let corner = |i: usize| Vec3::new((i - 1) as f32, ((i - 1) * (i - 1)) as f32, 0.0);
    let fan = [[1, 2, 3], [1, 3, 4], [1, 4, 5], [1, 5, 6], [1, 6, 7], [7, 6, 5]];
    assert_eq!(corners(&good(text)), fan.map(|t| t.map(corner)));
}

#[test]
fn readable_materials_colour_their_faces() {
    let mtl = b"newmtl red brick #2\r\nKd 1 0 0\r\nKa 5\r\nillum seven\r\nmap_Kd\r\nnewmtl short\nKd 0.5\n\
        newmtl bright\nKd 7 nan 0\nnewmtl gr\xfcn\nKd 0 1 0\n";
    let text = [
        b"mtllib a.mtl\nf 1 2 3\nusemtl red brick #2\nf 3 1 2\nusemtl short\nf 1 2 3\n" as &[u8],
        b"usemtl bright\nf 1 2 3\nusemtl gr\xfcn\nf 1 2 3\nusemtl unknown\nf 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0",
    ];
    let read = |name: &str| if name == "a.mtl" { Ok(mtl.to_vec()) } else { no_materials(name) };
    let loaded = load_obj_from(&text.concat(), "x", &LoadOptions::default(), &read, &mut |_| {}).unwrap();
    let grey = loaded.model.palette[0];
    let colours: Vec<Vec3> = (0..6).map(|i| loaded.model.colour(i)).collect();
    assert_eq!(colours, [grey, Vec3::X, grey, grey, Vec3::Y, grey]);
    assert_eq!(corners(&loaded)[..2], [[Vec3::ZERO, Vec3::X, Vec3::Y], [Vec3::Y, Vec3::ZERO, Vec3::X]]);
    assert_eq!(loaded.warnings, [""; 0]);
}

#[test]
fn errors_name_file_line_and_remedy() {
    let vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    let with = |rest: &str| format!("{vertices}{rest}").into_bytes();
    let cases: &[(Vec<u8>, &[&str])] = &[
        (Vec::new(), &["test.obj: not an OBJ", "empty", "export"]),
        (b"\x7fELF\x00\x01".to_vec(), &["test.obj: not an OBJ", "binary"]),
        (b"ply\nformat ascii 1.0\n".to_vec(), &["PLY"]),
        (b"solid x\nfacet\n".to_vec(), &["STL"]),
        (b"Dear Sir,\nyours".to_vec(), &["no vertices and no faces"]),
        (vertices.into(), &["test.obj: no faces (3 vertices)", "export"]),
        (with("p 1\nl 1 2\n"), &["no faces"]),
        (with("\nf 1 2 4\n"), &["test.obj:5: index 4", "the 3 vertices", "correct"]),
        (with("f 1 2 3\r\nf 1 2 99999999999999999999999\r\n"), &["test.obj:5: index 99999999999999999999999"]),
        (with("f 1 2 0\n"), &["test.obj:4: index 0"]),
        (with("f 1 -4 2\nv 0 0 1\n"), &["test.obj:4: index -4", "the 3 vertices"]),
        (with("f 1 -9223372036854775808 2\n"), &["test.obj:4: index -9223372036854775808"]),
        (with("f 1 2 x\n"), &["test.obj:4: 'x' is not a number"]),
        (with("f 1 2 /1\n"), &["test.obj:4: '/1' is not a number"]),
        (with("f 1 2 3.5\n"), &["test.obj:4: '3.5'"]),
        (with("f 1 2 \\\n # \\\n\n"), &["test.obj:4: a face with 2 corners"]),
        (with("f\n"), &["test.obj:4: a face with 0 corners"]),
        (with("v 1 2\nf 1 2 3\n"), &["test.obj:4: a vertex with 2 coordinates", "v x y z"]),
        (with("# \nv 1 zwei 2\nf 1 2 3\n"), &["test.obj:5: 'zwei' is not a number", "correct"]),
        (with("v 1 2,5 2\nf 1 2 3\n"), &["test.obj:4: '2,5' is not a number"]),
        (b"v 1 2\xa03 4 5\nf 1 1 1\n".to_vec(), &["test.obj:1: '2?3'"]),
        ("v 1\u{a0}1 1 1\nf 1 1 1\n".into(), &["test.obj:1: '1??1'"]),
        (
            with("v 0 nan 0\nv inf 0 0\nv 0 0 1e39\nf 1 2 4"),
            &["test.obj:4:", "3 such vertices", "without the triangles"],
        ),
    ];
    for (text, parts) in cases {
        let error = load(text, &LoadOptions::default()).expect_err(&String::from_utf8_lossy(text));
        for part in *parts {
            assert!(error.to_string().contains(part), "{error}\n lacks {part:?}");
        }
    }
    let options = LoadOptions { max_triangles: 2, ..LoadOptions::default() };
    assert!(load(with("f 1 2 3 1\n"), &options).is_ok());
    let error = load(with("f 1 2 3 1 2\n"), &options).unwrap_err().to_string();
    assert!(error.contains("test.obj: more than 2 triangles"), "{error}");
}

#[test]
fn invalid_vertices_can_be_kept_and_are_counted() {
    let options = LoadOptions { drop_invalid: true, ..LoadOptions::default() };
    let text = format!("{TRIANGLE}v nan 0 0\nv 0 0 -inf\nf 1 2 4\nf 4 5 1\nf 3 2 1\n");
    let loaded = load(&text, &options).unwrap();
    assert_eq!((loaded.invalid_vertices, loaded.invalid_triangles), (2, 2));
    assert_eq!(loaded.model.indices.len(), 4);
    assert_eq!(corners(&loaded)[3], [Vec3::Y, Vec3::X, Vec3::ZERO]);
    // Unused, it harms nobody.
    assert_eq!(good(format!("v nan 0 0\n{}", TRIANGLE.replace("f 1 2 3", "f 2 3 4"))).invalid_vertices, 0);
}

#[test]
fn files_are_found_refused_and_followed() {
    let folder = tempfile::tempdir().unwrap();
    let fail = |path: &Path| load_obj(path, &LoadOptions::default(), &mut |_| {}).unwrap_err().to_string();
    let missing = folder.path().join("missing.obj");
    assert_eq!(fail(&missing), format!("{}: no such file: check the path", missing.display()));
    assert!(fail(folder.path()).contains("is a directory"));
    assert!(fail(Path::new("")).contains("no file name"));

    let path = folder.path().join("model.obj");
    std::fs::create_dir(folder.path().join("lib")).unwrap();
    std::fs::write(folder.path().join("lib/m.mtl"), "newmtl a\nKd 0 0 1\n").unwrap();
    // A directory in place of a library is only a warning.
    let mut text = String::from("mtllib lib\nmtllib lib\\m.mtl\nusemtl a\n") + TRIANGLE;
    while text.len() < 3 << 20 {
        text += "vn 0 0 1 # nothing to see here, only a long line that makes the file long enough for progress\n";
    }
    std::fs::write(&path, &text).unwrap();
    let mut seen = Vec::new();
    let loaded = load_obj(&path, &LoadOptions::default(), &mut |p| seen.push(p)).unwrap();
    assert_eq!(loaded.model.colour(0), Vec3::Z);
    assert_eq!(loaded.warnings.len(), 1);
    assert!(seen.iter().all(|p| p.done_bytes <= p.total_bytes));
    assert!(seen.is_sorted_by_key(|p| (p.stage, p.done_bytes)));
    assert!(seen.iter().any(|p| p.stage == LoadStage::Reading) && seen.iter().any(|p| p.stage == LoadStage::Checking));
}

/// Pieces of which random texts are made: enough truth to get far, enough nonsense to get everywhere.
fn piece() -> impl Strategy<Value = Vec<u8>> {
    let word = prop::sample::select(vec![
        "v 1 2 3\n",
        "v 0 0 1\n",
        "f 1 2 3\n",
        "f 1 1 99999999999999999999\n",
        "f 1/a 1/1/1/1 1\n",
        "v 1\u{a0}1 1 1\n",
        "f -1 -2 -3\n",
        "f 1/1 2/2 3/3 4\n",
        "v",
        "f",
        " ",
        "\n",
        "\\\n",
        "\\",
        "\r\n",
        "#",
        "nan",
        "1e999",
        "-",
        "/",
        "0",
        "-9223372036854775808",
        "18446744073709551616",
        "usemtl a\n",
        "usemtl \u{a0}\n",
        "mtllib a\n",
        "o\n",
        "g x\n",
        "p 1\n",
        "l 1 2\n",
        "\u{feff}",
        "newmtl a\n",
        "Kd 1\n",
        "Kd 1 2 3\n",
        "newmtl\n",
        "map_Kd\n",
        "vt 1",
        "vn",
        "\u{85}",
        "\u{2028}",
        "\x0b",
        "\r",
    ]);
    let usual = prop::sample::select(vec![
        "v 1 2 3\n",
        "v 0 0 1\n",
        "f 1 2 1\n",
        "usemtl a\n",
        "mtllib a\n",
        "f -1 -2/1/1 -1\n",
    ]);
    prop_oneof![8 => usual.prop_map(|w| w.as_bytes().to_vec()), 4 => word.prop_map(|w| w.as_bytes().to_vec()), 1 => prop::collection::vec(any::<u8>(), 0..6)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    /// Guards: no input panics, and what loads is whole. Fails when `material::clean` passes `Kd` lines through
    /// (tobj unwraps three numbers), when `parse_index` does not saturate, when faces keep what follows a slash, and when names are not trimmed.
    #[test]
    fn garbage_never_panics(pieces in prop::collection::vec(piece(), 0..40), mtl in prop::collection::vec(piece(), 0..12)) {
        let (text, mtl) = (pieces.concat(), mtl.concat());
        for drop_invalid in [false, true] {
            let options = LoadOptions { drop_invalid, ..LoadOptions::default() };
            match load_obj_from(&text, "garbage", &options, &|_| Ok(mtl.clone()), &mut |_| {}) {
                Ok(loaded) => {
                    let model = &loaded.model;
                    prop_assert!(!model.indices.is_empty() && !model.palette.is_empty());
                    prop_assert!(model.indices.iter().flatten().all(|&i| (i as usize) < model.positions.len()));
                    prop_assert!(model.colour_of.is_empty() || model.colour_of.len() == model.indices.len());
                    prop_assert!(model.colour_of.iter().all(|&c| usize::from(c) < model.palette.len()));
                    prop_assert!(drop_invalid || model.positions.iter().all(|p| p.is_finite()));
                }
                Err(error) => prop_assert!(!matches!(error, LoadError::Parser { .. }), "{error}"),
            }
        }
    }

    /// Guards: a text cut anywhere still loads or is refused. Fails when `Statements` looks past its end.
    #[test]
    fn a_cut_file_never_panics(cut in 0..400_usize) {
        let text = "mtllib a\nusemtl b\nv 0 0 0\nv 1 0 0 \\\n\nv 1 1 0\nv 0 1 0\nf 1/2/3 2 3 4\nf -1 -2 \\\n-3\n".repeat(4);
        let _ = load(&text.as_bytes()[..cut.min(text.len())], &LoadOptions::default());
    }

    /// Guards: numbers survive as they are. Fails when `copy_ascii` loses a sign or an exponent.
    #[test]
    fn coordinates_come_back_bit_for_bit(values in prop::collection::vec(any::<f32>().prop_filter("finite", |x| x.is_finite()), 9)) {
        let text: String = values.chunks(3).map(|v| format!("v {:e} {} {:?}\n", v[0], v[1], v[2])).collect();
        let loaded = good(text + "f 1 2 3\n");
        let found: Vec<u32> = corners(&loaded)[0].iter().flat_map(|p| p.to_array().map(f32::to_bits)).collect();
        prop_assert_eq!(found, values.iter().map(|x| x.to_bits()).collect::<Vec<_>>());
    }
}
