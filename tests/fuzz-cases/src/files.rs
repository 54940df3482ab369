//! Files of users: scenes and NumPy rays.

use glam::DVec3;
use rt_bvh::{BuildOptions, InvalidTriangles, Mesh};
use rt_scene::files::load_bytes;
use rt_scene::obj::{LoadError, LoadOptions, Loaded, load_obj_from, unwatched};

/// Loads the bytes as an OBJ file, which may name itself as its material file; what it accepts can be built.
pub fn obj(data: &[u8]) {
    let materials = |_: &str| Ok(data.to_vec());
    load(&|options| load_obj_from(data, "fuzzed", options, &materials, &mut unwatched));
}

/// Loads the bytes as a file of any format; what it accepts can be built.
pub fn scene_file(data: &[u8]) {
    load(&|options| load_bytes(data.to_vec(), "fuzzed", options, &mut unwatched));
}

fn load(read: &dyn Fn(&LoadOptions) -> Result<Loaded, LoadError>) {
    for drop_invalid in [false, true] {
        match read(&LoadOptions { drop_invalid, ..LoadOptions::default() }) {
            Ok(loaded) => {
                let model = &loaded.model;
                let count = model.positions.len();
                assert!(model.offset.is_finite());
                assert!(drop_invalid || loaded.left_out == 0 && model.positions.iter().all(|p| p.is_finite()));
                assert!(model.indices.iter().flatten().all(|&i| (i as usize) < count), "an index leads nowhere");
                assert!(model.colour_of.is_empty() || model.colour_of.len() == model.indices.len());
                let mesh = Mesh { positions: &model.positions, indices: &model.indices };
                let invalid = if drop_invalid { InvalidTriangles::Drop } else { InvalidTriangles::Refuse };
                let built = rt_bvh::build(mesh, &BuildOptions { invalid, ..BuildOptions::default() });
                assert!(built.is_ok(), "the loader accepted what the builder refuses: {:?}", built.err());
            }
            Err(error) => {
                let message = error.to_string();
                assert!(message.contains("fuzzed"), "the error does not name the file: {message}");
            }
        }
    }
}

/// Reads the bytes as a NumPy file of rays.
pub fn npy(data: &[u8]) {
    let offset = DVec3::new(5e6, 0.0, -0.125);
    if let Ok(rays) = rt_scene::npy::RayFile::new(data, String::new()).and_then(|file| file.read(offset)) {
        assert!(rays.len() * size_of::<rt_core::Ray>() <= data.len(), "more rays than the file holds");
    }
}
