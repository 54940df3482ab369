//! Real files, where the caller has them: `RAYBALANCE_SCENES` names the folder.

use rt_scene::obj::{LoadOptions, load_obj, unwatched};
use rt_scene::scan::{Plan, Scan};
use rt_scene::view::auto_view;
use std::path::Path;
use std::time::Instant;

/// Triangles and triangles without area of each file.
const FILES: [(&str, u64, u64); 7] = [
    ("backyard.obj", 213_802, 0),
    ("conference.obj", 331_179, 0),
    ("cornell-box.obj", 36, 0),
    ("mohawk-hair.obj", 139_442, 0),
    ("nasty-yard.obj", 201_305, 27_302),
    ("scorpion.obj", 99_990, 0),
    ("sports-car.obj", 300_603, 0),
];

#[test]
#[ignore = "needs RAYBALANCE_SCENES, a folder with the scenes"]
fn real_files_are_loaded_scanned_and_seen() {
    let folder = std::env::var("RAYBALANCE_SCENES").expect("set RAYBALANCE_SCENES");
    for (file, triangles, degenerate) in FILES {
        let start = Instant::now();
        let model = load_obj(&Path::new(&folder).join(file), &LoadOptions::default(), &mut unwatched).unwrap().model;
        let loaded = start.elapsed();
        let start = Instant::now();
        let scan = Scan::new(&model);
        let scanned = start.elapsed();
        let start = Instant::now();
        let view = auto_view(&model);
        println!("{file}: load {loaded:?}, scan {scanned:?}, view {:?}\n{scan:?}", start.elapsed());
        println!("{:?}\n{view:?}\n", Plan::new(&scan));
        assert_eq!(scan.triangles, triangles, "{file}");
        assert!(degenerate == 0 || scan.degenerate == degenerate, "{file}: {}", scan.degenerate);
        assert!(view.camera().is_ok());
    }
}
