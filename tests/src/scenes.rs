//! Real scenes: `.obj` files in the folder that the environment variable `RAYBALANCE_SCENES` names.

use rt_core::Triangle;
use rt_scene::obj::{LoadOptions, load_obj, unwatched};
use rt_scene::{Model, view};
use std::fs;
use std::path::{Path, PathBuf};

/// The environment variable.
pub const VARIABLE: &str = "RAYBALANCE_SCENES";

/// Scenes of which more than one random ray in a thousand meets two surfaces at one distance, to within the rounding of
/// double precision: faces that were modelled twice, or lie in each other's plane. Measured on 10³ random rays: 0.6% in
/// backyard and conference, 0.8% in sports-car, 31% in nasty-yard.
pub const TIED: [&str; 4] = ["backyard", "conference", "nasty-yard", "sports-car"];

/// A scene that can be loaded.
#[derive(Clone, Debug)]
pub struct RealScene {
    /// File name without `.obj`.
    pub name: String,
    /// The file.
    pub path: PathBuf,
}

/// The scenes in the folder that [`VARIABLE`] names, by name.
///
/// # Errors
/// The reason why there are none, for a person: the variable is not set, or the folder cannot be read or has no scene.
pub fn find() -> Result<Vec<RealScene>, String> {
    let folder = std::env::var_os(VARIABLE)
        .ok_or_else(|| format!("{VARIABLE} is not set: let it name a folder of .obj files"))?;
    find_in(Path::new(&folder))
}

/// [`find`] for a folder.
///
/// # Errors
/// When it cannot be read or has no `.obj` file.
pub fn find_in(folder: &Path) -> Result<Vec<RealScene>, String> {
    let cannot = |e: std::io::Error| format!("{}: {e}", folder.display());
    let mut scenes = Vec::new();
    for entry in fs::read_dir(folder).map_err(cannot)? {
        let path = entry.map_err(cannot)?.path();
        let (Some("obj"), Some(name)) =
            (path.extension().and_then(|e| e.to_str()), path.file_stem().and_then(|s| s.to_str()))
        else {
            continue;
        };
        scenes.push(RealScene { name: name.to_owned(), path });
    }
    scenes.sort_by(|a, b| a.name.cmp(&b.name));
    if scenes.is_empty() { Err(format!("{}: no .obj file in it", folder.display())) } else { Ok(scenes) }
}

impl RealScene {
    /// Loads the file, with the view that `cameras.tsv`, a file of the same folder, gives for it.
    ///
    /// # Errors
    /// The loader's message.
    pub fn load(&self) -> Result<Model, String> {
        let loaded = load_obj(&self.path, &LoadOptions::default(), &mut unwatched).map_err(|e| e.to_string())?;
        let view = view::listed(&self.path, &loaded.model);
        Ok(Model { view, ..loaded.model })
    }
}

/// The triangles of a model in file order: their positions are the primitive ids.
#[must_use]
pub fn triangles(model: &Model) -> Vec<Triangle> {
    (0..model.indices.len() as u32).filter_map(|i| model.triangle(i)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_folder_is_named() {
        assert!(find_in(Path::new("no such folder")).is_err_and(|e| e.contains("no such folder")));
    }
}
