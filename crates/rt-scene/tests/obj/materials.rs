//! Materials: which colour a face gets, and what is said where it gets none.

use super::{corners, load_obj_from, no_materials};
use glam::Vec3;
use rt_scene::obj::{LoadOptions, Loaded, load_obj, unwatched};
use std::collections::HashMap;
use std::fs;

const GREY: Vec3 = Vec3::new(0.62, 0.58, 0.53);
const VERTICES: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

/// Loads a text with these libraries.
fn load(text: &str, libraries: &[(&str, &str)]) -> Loaded {
    let libraries: HashMap<&str, &str> = libraries.iter().copied().collect();
    let read = |name: &str| libraries.get(name).map_or_else(|| no_materials(name), |text| Ok(text.as_bytes().to_vec()));
    let text = format!("{VERTICES}{text}\n");
    load_obj_from(text.as_bytes(), "x.obj", &LoadOptions::default(), &read, &mut unwatched).expect("a good text")
}

fn colours(loaded: &Loaded) -> Vec<Vec3> {
    (0..loaded.model.indices.len() as u32).map(|i| loaded.model.colour(i)).collect()
}

#[test]
fn readable_materials_colour_their_faces() {
    let mtl = "newmtl red brick #2\r\nKd 1 0 0\r\nKa 5\r\nillum seven\r\nmap_Kd\r\nnewmtl half\nKd 0.5\n\
        newmtl bright\nKd 7 -1 0\nnewmtl plain\nNs 3\nnewmtl measured\nKd spectral a.rfl 1\nnewmtl white\nKd xyz 0.9505 1 1.089\n\
        newmtl dark\nKd xyz 0\nNEWMTL loud\nKD 0 0 1 # quite blue\n";
    let names = ["red brick #2", "half", "bright", "plain", "measured", "white", "dark", "loud"];
    let uses: String = names.iter().map(|name| format!("usemtl {name}  \nf 3 1 2\n")).collect();
    let loaded = load(&format!("mtllib a.mtl\nf 1 2 3\n{uses}"), &[("a.mtl", mtl)]);
    let found = colours(&loaded);
    let expected = [GREY, Vec3::X, Vec3::splat(0.5), Vec3::X, GREY, GREY, Vec3::ONE, Vec3::ZERO, Vec3::Z];
    for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
        assert!(found.abs_diff_eq(expected, 2e-3), "triangle {i} is {found} instead of {expected}");
    }
    assert_eq!(corners(&loaded)[..2], [[Vec3::ZERO, Vec3::X, Vec3::Y], [Vec3::Y, Vec3::ZERO, Vec3::X]]);
    assert_eq!(loaded.warnings, [""; 0]);
}

#[test]
fn several_libraries_in_any_order() {
    let (red, green) = (("a.mtl", "newmtl r\nKd 1 0 0"), ("b.mtl", "newmtl g\nKd 0 1 0"));
    let spaced = ("my lib.mtl", "newmtl g\nKd 0 1 0");
    let no_end = ("a", "newmtl r\nKd 1 0 0");
    let two = [Vec3::X, Vec3::Y];
    let cases: &[(&str, &[(&str, &str)])] = &[
        ("mtllib a.mtl b.mtl\nusemtl r\nf 1 2 3\nusemtl g\nf 1 2 3", &[red, green]),
        ("mtllib a.mtl\nmtllib b.mtl\nusemtl r\nf 1 2 3\nusemtl g\nf 1 2 3", &[red, green]),
        ("usemtl r\nf 1 2 3\nusemtl g\nf 1 2 3\nmtllib a.mtl b.mtl", &[red, green]),
        ("usemtl r\nmtllib b.mtl\nf 1 2 3\nmtllib a.mtl\nusemtl g\nf 1 2 3", &[red, green]),
        ("mtllib a.mtl my lib.mtl\nusemtl r\nf 1 2 3\nusemtl g\nf 1 2 3", &[red, spaced]),
        ("mtllib my lib.mtl a.mtl\nusemtl r\nf 1 2 3\nusemtl g\nf 1 2 3", &[red, spaced]),
        ("mtllib \"my lib.mtl\" \"a.mtl\"\nusemtl r\nf 1 2 3\nusemtl g\nf 1 2 3", &[red, spaced]),
        ("mtllib \"my lib.mtl\"\nmtllib a.mtl # red\nusemtl r\nf 1 2 3\nusemtl g\nf 1 2 3", &[red, spaced]),
        ("mtllib a b.mtl\nmtllib a\nusemtl r\nf 1 2 3\nusemtl g\nf 1 2 3", &[no_end, ("a b.mtl", green.1)]),
        ("mtllib b.mtl a\nusemtl r\nf 1 2 3\nusemtl g\nf 1 2 3", &[no_end, green]),
        ("MtlLib a.mtl  \t b.mtl  \nUSEMTL r \t\nf 1 2 3\nUsemtl g\nf 1 2 3", &[red, green]),
        ("mtllib a.mtl \\\n b.mtl\nusemtl r # red\nf 1 2 3\nusemtl g#\nusemtl g\nf 1 2 3", &[red, green]),
        // The first library that has a name counts.
        (
            "mtllib a.mtl c.mtl b.mtl\nusemtl r\nf 1 2 3\nusemtl g\nf 1 2 3",
            &[red, green, ("c.mtl", "newmtl r\nKd 0 0 1")],
        ),
        // A material that no face uses says nothing, the last statement before a face counts.
        (
            "mtllib a.mtl b.mtl\nusemtl none\nusemtl r\nf 1 2 3\nusemtl r\nusemtl g\nf 1 2 3",
            &[red, green, ("c.mtl", "newmtl none")],
        ),
    ];
    for (text, libraries) in cases {
        let loaded = load(text, libraries);
        assert_eq!(colours(&loaded), two, "{text}");
        let unknown = |warning: &&String| !warning.contains("material none") && !warning.contains("material g#");
        assert_eq!(loaded.warnings.iter().filter(unknown).count(), 0, "{text}: {:?}", loaded.warnings);
    }
}

#[test]
fn a_material_ends_with_the_next_statement_even_an_empty_one() {
    let loaded = load(
        "mtllib a.mtl\nusemtl r\nf 1 2 3 1\nusemtl\nf 1 2 3\nusemtl r\nf 1 2 3",
        &[("a.mtl", "newmtl r\nKd 1 0 0")],
    );
    assert_eq!(colours(&loaded), [Vec3::X, Vec3::X, GREY, Vec3::X]);
}

#[test]
fn what_is_missing_is_said_once_with_counts() {
    let text = "usemtl q\nf 1 2 3 1\nusemtl r\nf 1 2 3\n".repeat(3)
        + "mtllib a.mtl gone.mtl b.mtl\nmtllib gone.mtl\nusemtl s\nf 1 2 3";
    let loaded = load(&text, &[("a.mtl", "newmtl r\nKd 1 0\nKd x\nKd\n")]);
    let [library, broken, unknown] = &loaded.warnings[..] else { panic!("{:?}", loaded.warnings) };
    assert!(library.starts_with("x.obj: material library gone.mtl cannot be read"), "{library}");
    assert!(library.ends_with(", and 1 more"), "{library}");
    assert!(broken.starts_with("a.mtl:2: 3 Kd statements that give no colour"), "{broken}");
    assert!(unknown.starts_with("x.obj:4: material q and 1 more"), "{unknown}");
    assert!(unknown.ends_with("7 triangles are grey"), "{unknown}");
    assert!(colours(&loaded).iter().all(|&colour| colour == GREY));
}

#[test]
fn more_materials_than_colours_are_grey() {
    let mut text = String::from("mtllib a\n");
    let mut mtl = String::new();
    for i in 0..65_540 {
        text += &format!("usemtl m{i}\nf 1 2 3\n");
        mtl += &format!("newmtl m{i}\nKd 1 0 0\n");
    }
    let loaded = load(&text, &[("a", &mtl)]);
    let found = colours(&loaded);
    assert_eq!(found.iter().filter(|&&colour| colour == Vec3::X).count(), 65_535);
    assert_eq!(found[65_535..], [GREY; 5]);
    assert!(loaded.warnings[0].ends_with("the last 5 are grey"), "{:?}", loaded.warnings);
}

#[test]
fn libraries_are_found_beside_the_file_however_their_name_is_written() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("lib")).unwrap();
    for (file, name) in [("lib/m.mtl", "m"), ("Case.MTL", "case"), ("here.mtl", "here"), ("two words.mtl", "two")] {
        fs::write(folder.path().join(file), format!("newmtl {name}\nKd 0 0 1\n")).unwrap();
    }
    let absolute = folder.path().join("here.mtl").display().to_string();
    let cases = [
        ("lib/m.mtl", "m"),
        ("lib\\m.mtl", "m"),
        (".\\lib\\M.mtl", "m"),
        ("case.mtl", "case"),
        ("CASE.mtl two words.mtl", "two"),
        ("C:\\Users\\me\\here.mtl", "here"),
        ("/somewhere/else/here.mtl", "here"),
        (&absolute, "here"),
    ];
    let path = folder.path().join("model.obj");
    for (library, name) in cases {
        fs::write(&path, format!("mtllib {library}\n{VERTICES}usemtl {name}\nf 1 2 3\n")).unwrap();
        let loaded = load_obj(&path, &LoadOptions::default(), &mut unwatched).unwrap();
        assert_eq!((loaded.model.colour(0), &loaded.warnings[..]), (Vec3::Z, &[][..]), "{library}");
    }
    // A directory in place of a library is only a warning.
    fs::write(&path, format!("mtllib lib\n{VERTICES}f 1 2 3\n")).unwrap();
    let loaded = load_obj(&path, &LoadOptions::default(), &mut unwatched).unwrap();
    assert!(loaded.warnings[0].contains("library lib cannot be read"), "{:?}", loaded.warnings);
}
