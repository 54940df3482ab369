//! Large scenes, made rather than loaded: copies of the built-in ones on a terrain, the same for the same number.

use glam::{Mat3, Vec3};
use rt_bvh::InvalidTriangles;
use rt_core::random;
use rt_scene::prepare::load;
use rt_scene::progress::unwatched;
use rt_scene::{Model, builtin};
use std::error::Error;
use std::path::Path;

/// Vertices along a side of the terrain.
const SIDE: u32 = 512;

/// The scene of that name: built-in, a file, or `large:` and a number of triangles.
///
/// # Errors
/// When there is none, or the file cannot be loaded.
pub fn open(name: &str) -> Result<Model, Box<dyn Error>> {
    match name.strip_prefix("large:") {
        Some(triangles) => Ok(large(triangles.parse()?)),
        None => Ok(load(Path::new(name), InvalidTriangles::Refuse, &mut unwatched)?.model),
    }
}

/// A scene of exactly `triangles` triangles: a terrain of half a million, and copies of the car and the yard, turned,
/// of several sizes and closer together than they are large here and there.
#[must_use]
pub fn large(triangles: usize) -> Model {
    let kinds = [builtin::car(), builtin::yard()].map(|model| (reach(&model), model));
    let mut all = terrain();
    all.indices.truncate(triangles);
    let mut copies = Vec::new();
    let mut room = triangles - all.indices.len();
    while room > 0 {
        let number = copies.len() as u32;
        // One yard for five cars.
        let kind = usize::from(number % 6 == 5);
        room = room.saturating_sub(kinds[kind].1.indices.len());
        copies.push((kind, random::pair(7, number, 0), random::pair(7, number, 1)));
    }
    // Room for every copy, and one in four stands in another's.
    let extent = 2.0 * (copies.len().max(1) as f32).sqrt();
    for p in &mut all.positions {
        *p *= Vec3::new(extent, 1.0, extent);
    }
    for (kind, place, [turn, size]) in copies {
        let (reach, model) = &kinds[kind];
        let turned = Mat3::from_rotation_y(turn * core::f32::consts::TAU) * ((0.5 + size) / reach);
        let ground = Vec3::new(place[0] * extent, height(place[0], place[1]), place[1] * extent);
        let base = all.positions.len() as u32;
        all.positions.extend(model.positions.iter().map(|p| turned * *p + ground));
        all.indices.extend(model.indices.iter().map(|corners| corners.map(|i| base + i)));
    }
    all.indices.truncate(triangles);
    all
}

/// Half the width of a model.
fn reach(model: &Model) -> f32 {
    model.positions.iter().map(|p| p.x.abs().max(p.z.abs())).fold(1e-6, f32::max)
}

fn height(x: f32, z: f32) -> f32 {
    (17.0 * x).sin() * (13.0 * z).cos() + 0.2 * (101.0 * x + 57.0 * z).sin()
}

/// Hills over the unit square.
fn terrain() -> Model {
    let at = |i: u32| i as f32 / (SIDE - 1) as f32;
    let corners = (0..SIDE * SIDE).map(|i| (at(i % SIDE), at(i / SIDE)));
    let positions = corners.map(|(x, z)| Vec3::new(x, height(x, z), z)).collect();
    let squares = (0..SIDE * SIDE).filter(|i| i % SIDE + 1 < SIDE && i / SIDE + 1 < SIDE);
    let indices = squares.flat_map(|a| [[a, a + SIDE, a + 1], [a + 1, a + SIDE, a + SIDE + 1]]).collect();
    Model { positions, indices, ..Model::default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::Aabb;

    // Fails when a terrain without copies has no extent.
    #[test]
    fn scenes_are_as_large_as_asked_for_and_have_an_extent() {
        for triangles in [1_000, 600_000] {
            let model = large(triangles);
            assert_eq!(model.indices.len(), triangles);
            let used = model.indices.iter().flatten().map(|&i| model.positions[i as usize]);
            let bounds = used.fold(Aabb::EMPTY, |all, p| Aabb { min: all.min.min(p), max: all.max.max(p) });
            assert!((bounds.max - bounds.min).min_element() > 0.0, "{triangles}: {bounds:?}");
        }
    }
}
