//! Real scenes, for those who have some: `real_scenes` finds them and unpacks them.

pub use real_scenes::{RealScene, VARIABLE};

use rt_core::Triangle;
use rt_scene::obj::{LoadOptions, load_obj, unwatched};
use rt_scene::{Model, view};

/// Scenes of which more than one random ray in a thousand meets two surfaces at one distance, to within the rounding of
/// double precision: faces that were modelled twice, or lie in each other's plane. Measured on 10³ random rays: 0.6% in
/// backyard and conference, 0.8% in sports-car, 31% in nasty-yard.
pub const TIED: [&str; 4] = ["backyard", "conference", "nasty-yard", "sports-car"];

/// The scenes in the folder that [`VARIABLE`] names, by name.
///
/// # Errors
/// The reason why there are none, for a person.
pub fn find() -> Result<Vec<RealScene>, String> {
    real_scenes::find().map_err(|error| format!("{error:#}"))
}

/// Loads the file, with the view that `cameras.tsv`, a file of the same folder, gives for it.
///
/// # Errors
/// The loader's message.
pub fn load(scene: &RealScene) -> Result<Model, String> {
    let loaded = load_obj(&scene.path, &LoadOptions::default(), &mut unwatched).map_err(|e| e.to_string())?;
    let view = view::listed(&scene.path, &loaded.model).map_err(|error| error.to_string())?;
    Ok(Model { view, ..loaded.model })
}

/// The triangles of a model in file order: their positions are the primitive ids.
#[must_use]
pub fn triangles(model: &Model) -> Vec<Triangle> {
    (0..model.indices.len() as u32).filter_map(|i| model.triangle(i)).collect()
}
