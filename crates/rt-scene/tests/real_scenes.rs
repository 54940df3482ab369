//! Real files, where the caller has them: `RAYBALANCE_SCENES` names the folder. What is not there is left out, and why
//! is said.

use libtest_mimic::{Arguments, Completion, Failed, Trial, run};
use rt_scene::obj::{LoadOptions, load_obj, unwatched};
use rt_scene::scan::Scan;
use rt_scene::view::auto_view;
use std::path::Path;

/// Triangles and triangles without area of each file; those without area by exact arithmetic on its single-precision
/// numbers.
const FILES: [(&str, u64, u64); 7] = [
    ("backyard", 213_802, 275),
    ("conference", 331_179, 0),
    ("cornell-box", 36, 0),
    ("mohawk-hair", 139_442, 0),
    ("nasty-yard", 201_305, 27_302),
    ("scorpion", 99_990, 0),
    ("sports-car", 300_603, 201),
];

fn main() {
    let found = real_scenes::find();
    let trial = |(file, triangles, degenerate): (&'static str, u64, u64)| {
        let path = match &found {
            Ok(scenes) => match scenes.iter().find(|scene| scene.name == file) {
                Some(scene) => Ok(scene.path.clone()),
                None => Err(format!("there is no {file}")),
            },
            Err(reason) => Err(format!("{reason:#}")),
        };
        Trial::ignorable_test(file, move || match path {
            Ok(path) => examine(&path, triangles, degenerate).map(|()| Completion::Completed),
            Err(reason) => Ok(Completion::ignored_with(reason)),
        })
    };
    run(&Arguments::from_args(), FILES.into_iter().map(trial).collect()).exit();
}

/// A file is loaded, scanned and seen.
///
/// Mutants: a loader that loses the last face; a scan that counts no triangle without area.
fn examine(path: &Path, triangles: u64, degenerate: u64) -> Result<(), Failed> {
    let model = load_obj(path, &LoadOptions::default(), &mut unwatched)?.model;
    let scan = Scan::new(&model);
    if (scan.triangles, scan.degenerate) != (triangles, degenerate) {
        let (found, flat) = (scan.triangles, scan.degenerate);
        return Err(format!("{found} triangles, {flat} without area, instead of {triangles} and {degenerate}").into());
    }
    auto_view(&model, 1.5).camera()?;
    Ok(())
}
