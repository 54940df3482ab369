//! Files of users: scenes, NumPy rays and camera paths.

use glam::DVec3;
use rt_bvh::{BuildOptions, InvalidTriangles, Mesh};
use rt_scene::camera::{CameraMotion, CameraPath};
use rt_scene::files::load_bytes;
use rt_scene::obj::{LoadError, LoadOptions, Loaded, load_obj_from, unwatched};
use std::path::Path;

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

/// Reads the bytes as the key frames of a camera; each of a few frames has a camera or an error that names the file.
pub fn camera_path(data: &[u8]) {
    let (frames, text) = data.split_first_chunk::<8>().unwrap_or((&[0; 8], data));
    let offset = DVec3::new(5e6, 0.0, -0.125);
    let path = match CameraPath::parse(Path::new("fuzzed"), &String::from_utf8_lossy(text)) {
        Ok(path) => path,
        Err(error) => {
            assert!(error.to_string().contains("fuzzed"), "the error does not name the file: {error}");
            return;
        }
    };
    let motion = CameraMotion::Path { path, offset };
    let [any @ .., b, a] = frames;
    let any = u32::from_le_bytes([any[0], any[1], any[2], any[3]]);
    for frame in [0, u32::from(*a), u32::from(*b), any, u32::MAX] {
        if let Err(error) = motion.camera(frame) {
            let message = error.to_string();
            assert!(message.contains("fuzzed") && message.contains(&frame.to_string()), "{message}");
        }
    }
}
