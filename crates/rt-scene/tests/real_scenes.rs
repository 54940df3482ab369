//! Real files, where the caller has them: `RAYBALANCE_SCENES` names the folder. What is not there is left out, and why is said.

use libtest_mimic::{Arguments, Completion, Failed, Trial, run};
use rt_scene::obj::{LoadOptions, load_obj, unwatched};
use rt_scene::scan::Scan;
use rt_scene::view::auto_view;
use std::path::{Path, PathBuf};

/// Triangles and triangles without area of each file; those without area by exact arithmetic on its single-precision numbers.
const FILES: [(&str, u64, u64); 7] = [
    ("backyard.obj", 213_802, 275),
    ("conference.obj", 331_179, 0),
    ("cornell-box.obj", 36, 0),
    ("mohawk-hair.obj", 139_442, 0),
    ("nasty-yard.obj", 201_305, 27_302),
    ("scorpion.obj", 99_990, 0),
    ("sports-car.obj", 300_603, 201),
];

fn main() {
    let trial = |(file, triangles, degenerate)| {
        Trial::ignorable_test(file, move || match find(file) {
            Ok(path) => examine(&path, triangles, degenerate).map(|()| Completion::Completed),
            Err(reason) => Ok(Completion::ignored_with(reason)),
        })
    };
    run(&Arguments::from_args(), FILES.into_iter().map(trial).collect()).exit();
}

fn find(file: &str) -> Result<PathBuf, String> {
    let folder = std::env::var_os("RAYBALANCE_SCENES").ok_or("RAYBALANCE_SCENES is not set")?;
    let path = Path::new(&folder).join(file);
    if path.is_file() { Ok(path) } else { Err(format!("there is no {}", path.display())) }
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
    auto_view(&model).camera()?;
    Ok(())
}
