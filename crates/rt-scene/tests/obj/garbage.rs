//! Anything may come in; nothing panics.

use super::{TRIANGLE, corners, good, load, load_obj_from};
use proptest::prelude::*;
use rt_scene::obj::{LoadOptions, unwatched};

/// Pieces of which random texts are made: enough truth to get far, enough nonsense to get everywhere.
fn piece() -> impl Strategy<Value = Vec<u8>> {
    let word = prop::sample::select(vec![
        "v 1 2 3\n",
        "v 0 0 1\n",
        "v 1e300 -1e300 1e308\n",
        "v 1e-300 0 4e-320\n",
        "v 5412345.25 1 0\n",
        "f 1 2 3\n",
        "f 1 2 3 4 5 1 3\n",
        "f 1 1 99999999999999999999\n",
        "f 1/a 1/1/1/1 1\n",
        "v 1\u{a0}1 1 1\n",
        "v\u{a0}1 1 1\n",
        "f -1 -2 -3\n",
        "f 1/1 2/2 3/3 4\n",
        "f1 2 3\n",
        "v",
        "f",
        " ",
        "\n",
        "\\\n",
        "\\ \r",
        "\\",
        "\r\n",
        "#",
        "nan",
        "1.#QNAN",
        "1e999",
        "1,5",
        "-",
        "/",
        "0",
        "-9223372036854775808",
        "18446744073709551616",
        "usemtl a\n",
        "usemtl \u{a0}\n",
        "mtllib a\n",
        "mtllib a.mtl \"b c.mtl\" d # e\n",
        "o\n",
        "g x\n",
        "p 1\n",
        "l 1 2\n",
        "\u{feff}",
        "newmtl a\n",
        "Kd 1\n",
        "Kd 1 2 3\n",
        "Kd xyz 1 nan\n",
        "Kd spectral\n",
        "newmtl\n",
        "map_Kd\n",
        "vt 1",
        "vn",
        "\u{85}",
        "\u{2028}",
        "\x0b",
        "\r",
        "\0",
    ]);
    let usual = prop::sample::select(vec![
        "v 1 2 3\n",
        "v 0 0 1\n",
        "v 4 0 1\n",
        "v 1 -2 0\n",
        "f 1 2 1\n",
        "usemtl a\n",
        "mtllib a\n",
        "f -1 -2/1/1 -1\n",
        "f 1 2 3 4\n",
        "f -1 -2 -3 -4 -5\n",
    ]);
    prop_oneof![8 => usual.prop_map(|w| w.as_bytes().to_vec()), 4 => word.prop_map(|w| w.as_bytes().to_vec()), 1 => prop::collection::vec(any::<u8>(), 0..6)]
}

/// As UTF-16, by some encoders.
fn in_utf16(text: &[u8]) -> Vec<u8> {
    let text = String::from_utf8_lossy(text);
    text.encode_utf16().flat_map(u16::to_be_bytes).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    /// Guards: no input panics, and what loads is whole. Fails when `number::index` does not saturate, when faces keep
    /// what follows a slash, when corners beyond the last vertex are not looked for, and when left out faces keep their
    /// vertices.
    #[test]
    fn garbage_never_panics(
        pieces in prop::collection::vec(piece(), 0..40), mtl in prop::collection::vec(piece(), 0..12), wide in 0..8,
    ) {
        let (mut text, mtl) = (pieces.concat(), mtl.concat());
        if wide == 0 {
            text = in_utf16(&text);
        }
        for drop_invalid in [false, true] {
            let options = LoadOptions { drop_invalid, ..LoadOptions::default() };
            match load_obj_from(&text, "garbage", &options, &|_| Ok(mtl.clone()), &mut unwatched) {
                Ok(loaded) => {
                    let model = &loaded.model;
                    prop_assert!(!model.indices.is_empty() && !model.palette.is_empty());
                    prop_assert!(model.indices.iter().flatten().all(|&i| (i as usize) < model.positions.len()));
                    prop_assert!(model.colour_of.is_empty() || model.colour_of.len() == model.indices.len());
                    prop_assert!(model.colour_of.iter().all(|&c| usize::from(c) < model.palette.len()));
                    prop_assert!(drop_invalid || model.positions.iter().all(|p| p.is_finite()));
                    prop_assert!(drop_invalid || loaded.left_out == 0);
                    prop_assert!(model.offset.is_finite());
                }
                Err(error) => prop_assert!(error.to_string().starts_with("garbage")),
            }
        }
    }

    /// Guards: a text cut anywhere still loads or is refused. Fails when `Statements` looks past its end.
    #[test]
    fn a_cut_file_never_panics(cut in 0..400_usize) {
        let text = "mtllib a\nusemtl b\nv 0 0 0\nv 1 0 0 \\\n\nv 1 1 0\nv 0 1 0\nf 1/2/3 2 3 4\nf -1 -2 \\\n-3\n".repeat(4);
        let _ = load(&text.as_bytes()[..cut.min(text.len())], &LoadOptions::default());
    }

    /// Guards: numbers survive as they are, with an offset or without. Fails when a coordinate is read in single
    /// precision and the offset is subtracted after that.
    #[test]
    fn coordinates_come_back_bit_for_bit(values in prop::collection::vec(any::<f32>().prop_filter("finite", |x| x.is_finite()), 9)) {
        let text: String = values.chunks(3).map(|v| format!("v {:e} {} {:?}\n", v[0], v[1], v[2])).collect();
        let loaded = good(text + "f 1 2 3\n");
        prop_assert_eq!(loaded.model.offset, glam::DVec3::ZERO);
        let found: Vec<u32> = corners(&loaded)[0].iter().flat_map(|p| p.to_array().map(f32::to_bits)).collect();
        prop_assert_eq!(found, values.iter().map(|x| x.to_bits()).collect::<Vec<_>>());
    }
}

#[test]
fn joined_files_keep_every_statement() {
    let loaded = good(format!("{TRIANGLE}\u{feff}v 5 0 0\nf 2 3 -1\n"));
    assert_eq!(corners(&loaded)[1][2].x, 5.0);
}
