//! One scene in every encoding and with every line end: the same model.

use super::{corners, good, load_obj_from};
use rt_scene::obj::{LoadOptions, Loaded, unwatched};

const LINES: [&str; 12] = [
    "# gr\u{fc}n, C:\\temp\\",
    "mtllib bl\u{e4}tter.mtl",
    "v 0 0 0",
    "v 1 0 \\",
    " 0   # \\",
    "",
    "v 0 1 0",
    "usemtl gr\u{fc}n",
    "f 1 2 \\",
    "  3",
    "usemtl rot",
    "f 3 2 1",
];

const MATERIALS: [&str; 4] = ["newmtl gr\u{fc}n", "Kd 0 1 0", "newmtl rot", "Kd 1 0 0"];

/// A text's bytes in some encoding.
type Encoding = fn(&str) -> Vec<u8>;

const ENCODINGS: [(&str, Encoding); 7] = [
    ("UTF-8", |text| text.as_bytes().to_vec()),
    ("UTF-8 with mark", |text| format!("\u{feff}{text}").into_bytes()),
    ("Latin-1", |text| text.chars().map(|c| c as u8).collect()),
    ("UTF-16 LE with mark", |text| {
        "\u{feff}".encode_utf16().chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect()
    }),
    ("UTF-16 BE with mark", |text| {
        "\u{feff}".encode_utf16().chain(text.encode_utf16()).flat_map(u16::to_be_bytes).collect()
    }),
    ("UTF-16 LE", |text| text.encode_utf16().flat_map(u16::to_le_bytes).collect()),
    ("UTF-16 BE", |text| text.encode_utf16().flat_map(u16::to_be_bytes).collect()),
];

fn load(scene: &[u8], materials: &[u8]) -> Loaded {
    let read = |name: &str| {
        assert_eq!(name, "bl\u{e4}tter.mtl");
        Ok(materials.to_vec())
    };
    load_obj_from(scene, "test.obj", &LoadOptions::default(), &read, &mut unwatched).expect("a good text")
}

#[test]
fn encodings_and_line_ends_do_not_matter() {
    let expected = load(LINES.join("\n").as_bytes(), MATERIALS.join("\n").as_bytes());
    assert_eq!(expected.model.colour(0), glam::Vec3::Y);
    assert_eq!(expected.model.colour(1), glam::Vec3::X);
    for (name, encode) in ENCODINGS {
        for (other, encode_materials) in ENCODINGS {
            for end in ["\n", "\r\n", "\r"] {
                let loaded = load(&encode(&LINES.join(end)), &encode_materials(&MATERIALS.join(end)));
                let context = format!("{name}, materials in {other}, {end:?}");
                assert_eq!(corners(&loaded), corners(&expected), "{context}");
                let colours = |loaded: &Loaded| [0, 1].map(|i| loaded.model.colour(i));
                assert_eq!(colours(&loaded), colours(&expected), "{context}");
                assert_eq!(loaded.warnings, [""; 0], "{context}");
            }
        }
    }
}

#[test]
fn ends_of_transfers_are_ignored() {
    // DOS's end of file, zeros that fill a block, a line without its end.
    for end in ["\x1a", "\0\0\0\0", "", "\n\n\r\n", "\\"] {
        assert_eq!(good(format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n{end}")).model.indices.len(), 1, "{end:?}");
    }
}
