//! Files of every format but OBJ, which has its own tests: what is read, and what is refused with which words.

use glam::Vec3;
use rt_scene::files::{load_bytes, load_file};
use rt_scene::obj::{LoadError, LoadOptions, Loaded, unwatched};
use std::fmt::Write;

/// A square of two triangles, as OBJ text that xz and gzip have packed.
const XZ: &[u8] =
    b"\xfd\x37\x7a\x58\x5a\x00\x00\x04\xe6\xd6\xb4\x46\x02\x00\x21\x01\x16\x00\x00\x00\x74\x2f\xe5\xa3\xe0\x00\
    \x29\x00\x1a\x5d\x00\x3b\x08\x02\x11\x02\x0a\x80\x5b\x9c\x99\x21\xc6\xe8\x73\xf5\x25\x65\x70\x83\xec\x15\
    \xe1\xda\x05\x8f\xc0\x00\x00\x00\xaf\xad\x92\x57\x41\xd5\xbf\x9f\x00\x01\x36\x2a\x88\xed\x21\x72\x1f\xb6\
    \xf3\x7d\x01\x00\x00\x00\x00\x04\x59\x5a";
const GZIP: &[u8] =
    b"\x1f\x8b\x08\x00\x00\x00\x00\x00\x02\x03\x2b\x53\x30\x00\x41\xae\x32\x05\x43\x38\x6d\x08\xa6\x0d\xc0\x74\
    \x1a\x90\x34\x52\x30\x56\x30\xe1\x02\x00\xc5\x34\x62\xd9\x2a\x00\x00\x00";

/// Corners of a square, and its two triangles.
const SQUARE: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
const HALVES: [[u32; 3]; 2] = [[0, 1, 2], [0, 2, 3]];

fn load(bytes: &[u8]) -> Result<Loaded, LoadError> {
    load_bytes(bytes.to_vec(), "test", &LoadOptions::default(), &mut unwatched)
}

/// The corners of all triangles.
fn corners(loaded: &Loaded) -> Vec<[[f32; 3]; 3]> {
    let model = &loaded.model;
    let corner = |&index: &u32| model.positions[index as usize].to_array();
    model.indices.iter().map(|triangle| [corner(&triangle[0]), corner(&triangle[1]), corner(&triangle[2])]).collect()
}

fn square() -> Vec<[[f32; 3]; 3]> {
    HALVES.iter().map(|half| half.map(|corner| SQUARE[corner as usize])).collect()
}

fn refused(bytes: &[u8], what: &str) {
    let error = load(bytes).map(drop).expect_err("a bad file").to_string();
    assert!(error.contains("test") && error.contains(what), "{error} does not say {what}");
}

fn ply_head(format: &str, coordinate: &str) -> String {
    format!(
        "ply\nformat {format} 1.0\ncomment made by hand\nelement vertex 4\nproperty {coordinate} x\nproperty {coordinate} y\n\
         property {coordinate} z\nproperty uchar red\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
    )
}

/// Mutants: an order of bytes taken for the other; properties by their place instead of their names; a face's first
/// three corners only.
#[test]
fn ply_is_read_as_text_and_in_both_orders_of_bytes() {
    let mut text = ply_head("ascii", "float");
    SQUARE.iter().for_each(|[x, y, z]| writeln!(text, "{x} {y} {z} 200").unwrap());
    text.push_str("4 0 1 2 3\n");
    assert_eq!(corners(&load(text.as_bytes()).unwrap()), square());
    assert_eq!(corners(&load(text.replace('\n', "\r\n").as_bytes()).unwrap()), square());

    for (format, is_little) in [("binary_little_endian", true), ("binary_big_endian", false)] {
        let mut bytes = ply_head(format, "double").into_bytes();
        for corner in SQUARE {
            for x in corner.map(f64::from) {
                bytes.extend(if is_little { x.to_le_bytes() } else { x.to_be_bytes() });
            }
            bytes.push(200);
        }
        bytes.push(4);
        (0..4_i32).for_each(|i| bytes.extend(if is_little { i.to_le_bytes() } else { i.to_be_bytes() }));
        assert_eq!(corners(&load(&bytes).unwrap()), square(), "{format}");
        bytes.truncate(bytes.len() - 3);
        refused(&bytes, "PLY, but malformed: face 0");
    }
    let far = text.replace("4 0 1 2 3", "3 0 1 9");
    refused(far.as_bytes(), "triangle 0 has the vertex 9, of 4 from 0 on");
    let dropped =
        load_bytes(far.into(), "test", &LoadOptions { drop_invalid: true, ..LoadOptions::default() }, &mut unwatched);
    assert_eq!(dropped.unwrap().left_out, 1);
    refused(text.replace("4 0 1 2 3", "2 0 1").as_bytes(), "face 0 has 2 corners");
    refused(text.replace("1 1 0 200", "1 1e99 0 200").as_bytes(), "triangle 0 is not three finite");
    refused(text.replace("1 1 0 200", "1 one 0 200").as_bytes(), "vertex 2: line 14");
    refused(
        b"ply\nformat ascii 1.0\nelement vertex 99999999999\nproperty float x\nend_header\n",
        "the file ends before it",
    );
}

/// Coordinates in double precision keep their digits, as those of OBJ files.
#[test]
fn double_precision_is_kept_by_an_offset() {
    let mut text = ply_head("ascii", "double");
    SQUARE.iter().for_each(|[x, y, z]| writeln!(text, "{} {y} {z} 0", 4_000_000.1 + f64::from(*x)).unwrap());
    text.push_str("4 0 1 2 3\n");
    let loaded = load(text.as_bytes()).unwrap();
    let x = f64::from(loaded.model.positions[1].x) + loaded.model.offset.x;
    assert!((x - 4_000_001.1).abs() < 1e-6 && loaded.notes.len() == 1, "{x}");
}

fn stl_binary(head: &str) -> Vec<u8> {
    let mut bytes = head.as_bytes().to_vec();
    bytes.resize(80, 0);
    bytes.extend(2_u32.to_le_bytes());
    for half in HALVES {
        bytes.extend([0; 12]);
        half.iter().flat_map(|&corner| SQUARE[corner as usize]).for_each(|x| bytes.extend(x.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

/// Mutants: a binary file that begins with `solid` taken for text; text in capitals taken for OBJ.
#[test]
fn stl_is_read_as_text_and_binary() {
    for head in ["made by hand", "solid binary"] {
        assert_eq!(corners(&load(&stl_binary(head)).unwrap()), square(), "{head}");
    }
    for name in ["", " square"] {
        let mut text = format!("solid{name}\n");
        for half in HALVES {
            text.push_str("facet normal 0 0 1\n outer loop\n");
            for corner in half {
                let [x, y, z] = SQUARE[corner as usize];
                writeln!(text, "  vertex {x} {y} {z:e}").unwrap();
            }
            text.push_str(" endloop\nendfacet\n");
        }
        text.push_str("endsolid\n");
        assert_eq!(corners(&load(text.as_bytes()).unwrap()), square());
        assert_eq!(corners(&load(text.to_uppercase().as_bytes()).unwrap()), square());
        refused(text.replacen("vertex", "vortex", 2).as_bytes(), "STL, but malformed: facet 0");
        refused(text.replace("endsolid\n", "").as_bytes(), "facet 2");
    }
    refused(b"solid\nendsolid\n", "no faces");
}

/// A glTF file whose buffer is `uri`: two nodes, one below the other, with one mesh each.
fn gltf(uri: &str) -> String {
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}],
        "nodes": [{{"mesh": 0, "translation": [0, 0, 1], "children": [1]}}, {{"mesh": 0, "scale": [2, 2, 2]}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "indices": 1, "material": 0}}]}}],
        "materials": [{{"pbrMetallicRoughness": {{"baseColorFactor": [1, 0.5, 0, 1]}}}}],
        "accessors": [
            {{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}},
            {{"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 48}}, {{"buffer": 0, "byteOffset": 48, "byteLength": 12}}],
        "buffers": [{{"byteLength": 60{uri}}}]}}"#
    )
}

fn buffer() -> Vec<u8> {
    let positions = SQUARE.iter().flatten().flat_map(|x| x.to_le_bytes());
    positions.chain(HALVES.iter().flatten().flat_map(|&i| (i as u16).to_le_bytes())).collect()
}

fn embedded() -> String {
    use base64::Engine;
    let text = base64::engine::general_purpose::STANDARD.encode(buffer());
    gltf(&format!(r#", "uri": "data:application/octet-stream;base64,{text}""#))
}

fn binary(json: &str, buffer: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let total = 12 + 8 + json.len() + 8 + buffer.len();
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((total as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &json[..]), (b"BIN\0", buffer)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    bytes
}

fn two_squares() -> Vec<[[f32; 3]; 3]> {
    let placed = |scale: f32| square().into_iter().map(move |half| half.map(|[x, y, _]| [scale * x, scale * y, 1.0]));
    placed(1.0).chain(placed(2.0)).collect()
}

/// Mutants: a node's place without that of the node above; colours of the wrong material.
#[test]
fn gltf_is_read_with_its_nodes_in_their_places() {
    for bytes in [embedded().into_bytes(), binary(&gltf(""), &buffer())] {
        let loaded = load(&bytes).unwrap();
        assert_eq!(corners(&loaded), two_squares());
        assert_eq!(loaded.model.colour(3), Vec3::new(1.0, 0.5, 0.0));
        assert!(loaded.notes[0].contains("2 nodes with 2 meshes"), "{:?}", loaded.notes);
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("square.gltf");
    std::fs::write(&path, gltf(r#", "uri": "the%20buffer.bin""#)).unwrap();
    let error = load_file(&path, &LoadOptions::default(), &mut unwatched).unwrap_err().to_string();
    assert!(error.contains("square.gltf") && error.contains("the buffer.bin"), "{error}");
    std::fs::write(folder.path().join("the buffer.bin"), buffer()).unwrap();
    let loaded = load_file(&path, &LoadOptions::default(), &mut unwatched).unwrap();
    assert_eq!((corners(&loaded), loaded.libraries.len()), (two_squares(), 1));
}

/// Mutants: a part for a node without triangles; the mesh's name before the node's; parts that begin where the others
/// do.
#[test]
fn nodes_are_parts_with_their_names() {
    let parts = |json: String| {
        let loaded = load(json.as_bytes()).unwrap();
        loaded.model.geometries.into_iter().map(|part| (part.name, part.first)).collect::<Vec<_>>()
    };
    assert_eq!(parts(embedded()), [("node 0".to_owned(), 0), ("node 1".to_owned(), 2)]);
    let named = embedded()
        .replace(r#"{"mesh": 0, "scale""#, r#"{"mesh": 0, "name": "large", "scale""#)
        .replace(r#""meshes": [{"#, r#""meshes": [{"name": "square", "#);
    assert_eq!(parts(named), [("square".to_owned(), 0), ("large".to_owned(), 2)]);
    assert!(load(&stl_binary("solid")).unwrap().model.geometries.is_empty());
}

/// Strips and fans, with and without indices.
#[test]
fn gltf_strips_turn_every_second_triangle() {
    let triangles = |mode: u32| {
        let text = embedded().replace(r#""indices": 1,"#, &format!(r#""mode": {mode},"#));
        let loaded = load(text.as_bytes()).unwrap();
        loaded.model.indices[..2].to_vec()
    };
    assert_eq!(triangles(5), [[0, 1, 2], [2, 1, 3]]);
    assert_eq!(triangles(6), [[0, 1, 2], [0, 2, 3]]);
    let points = embedded().replace(r#""indices": 1,"#, r#""mode": 0,"#);
    refused(points.as_bytes(), "no faces");
}

/// What the crate takes for granted is checked: mutants panic.
#[test]
fn gltf_that_lies_about_its_buffers_is_refused() {
    for (from, to, what) in [
        (r#""count": 4"#, r#""count": 5"#, "accessor 0 lies beyond"),
        (r#""count": 4"#, r#""count": 0"#, "accessor 0 has no items"),
        (r#""count": 6"#, r#""count": 18446744073709551615"#, "accessor 1 lies beyond"),
        ("5126", "5123", "accessor 0 has other numbers"),
        (r#""byteOffset": 48"#, r#""byteOffset": 52"#, "accessor 1 lies beyond"),
        (r#""byteLength": 60"#, r#""byteLength": 64"#, "buffer 0 has 60 bytes instead of 64"),
        (r#""children": [1]"#, r#""children": [0]"#, "below"),
        (
            r#""version": "2.0"}"#,
            r#""version": "2.0"}, "extensionsRequired": ["KHR_draco_mesh_compression"]"#,
            "KHR_draco",
        ),
        (r#""count": 4"#, r#""count": 3"#, "index 3 leads beyond its 3 vertices"),
        (";base64", "", "embedded otherwise"),
    ] {
        let text = embedded();
        assert!(text.contains(from), "{from}");
        refused(text.replacen(from, to, 1).as_bytes(), what);
    }
    refused(&binary(&gltf(""), &buffer())[..40], "glTF, but malformed");
}

/// Mutants: the wrong unpacker; names of packed files with their inner ending.
#[test]
fn packed_files_are_unpacked() {
    for packed in [XZ, GZIP] {
        assert_eq!(corners(&load(packed).unwrap()), square());
        refused(&packed[..packed.len() / 2], "cannot be unpacked");
    }
    assert_eq!(rt_scene::prepare::short_name("folder/car.obj.xz".as_ref()), "car");
    assert_eq!(rt_scene::prepare::short_name("car.v2.obj".as_ref()), "car.v2");
}
