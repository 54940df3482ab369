//! Wind: a model whose plants bend, frame by frame.
//!
//! A plant bends as a beam that is fixed at its foot does under an even load, about with the square of the height
//! (A. H. Barr, *Global and Local Deformations of Solid Primitives*, 1984, has the general form); gusts travel over
//! the model as a wave, and leaves flutter beside that. It is sines and sums in single precision, by `libm`: the same
//! bits on every platform.

use crate::{Model, Plant};
use glam::Vec3;
use rayon::iter::{IndexedParallelIterator, IntoParallelRefMutIterator, ParallelIterator};
use rt_bvh::Mesh;
use std::f32::consts::TAU;

/// Frames of a second.
pub const FRAMES_PER_SECOND: f32 = 25.0;

/// Where the wind blows to: a unit vector.
const TOWARDS: Vec3 = Vec3::new(0.96, 0.0, 0.28);

/// How far a plant's top goes to one side, as a share of its height: a fresh breeze.
const BEND: f32 = 0.035;

/// Seconds from gust to gust, and metres between two.
const PERIOD: f32 = 2.6;
const WAVELENGTH: f32 = 14.0;

/// The same of the flutter of leaves, and how far it goes at the top, as a share of the height.
const FLUTTER_PERIOD: f32 = 0.41;
const FLUTTER_WAVELENGTH: f32 = 0.9;
const FLUTTER: f32 = 0.0025;

/// Wind over a model.
#[derive(Clone, Debug)]
pub struct Wind {
    calm: Vec<Vec3>,
    indices: Vec<[u32; 3]>,
    plants: Vec<Plant>,
    now: Vec<Vec3>,
}

impl Wind {
    /// Wind over a model as it is when it is calm; `None` where nothing of it bends.
    #[must_use]
    pub fn over(model: &Model) -> Option<Self> {
        let Model { positions, indices, plants, .. } = model;
        let wind = || Self {
            calm: positions.clone(),
            indices: indices.clone(),
            plants: plants.clone(),
            now: positions.clone(),
        };
        (!plants.is_empty()).then(wind)
    }

    /// The model so many seconds after it was calm: its triangles in their order, none more and none less.
    pub fn after(&mut self, seconds: f32) -> Mesh<'_> {
        let Self { calm, indices, plants, now } = self;
        for Plant { vertices, foot } in plants.iter() {
            let (calm, now) = (&calm[vertices.clone()], &mut now[vertices.clone()]);
            let height = calm.iter().fold(f32::MIN_POSITIVE, |height, vertex| height.max(vertex.y - foot.y));
            now.par_iter_mut()
                .zip(calm)
                .for_each(|(now, &calm)| *now = calm + bend(calm, calm.y - foot.y, height, seconds));
        }
        Mesh { positions: now, indices }
    }
}

/// How far the wind moves a point of a plant, so high above its foot.
fn bend(point: Vec3, above: f32, height: f32, seconds: f32) -> Vec3 {
    let share = (above / height).clamp(0.0, 1.0);
    let along = point.dot(TOWARDS);
    let gust = wave(seconds / PERIOD, along / WAVELENGTH);
    // Across the wind too, so that leaves turn.
    let [x, y, z] = [along + point.y, point.x - point.z, point.y + point.z]
        .map(|place| wave(seconds / FLUTTER_PERIOD, place / FLUTTER_WAVELENGTH));
    height * share * (BEND * share * gust * TOWARDS + FLUTTER * Vec3::new(x, y, z))
}

/// A wave that travels, less what it was at first: so it begins with nothing.
fn wave(time: f32, place: f32) -> f32 {
    libm::sinf(TAU * (time - place)) + libm::sinf(TAU * place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin;
    use std::collections::HashSet;

    /// Mutants: vertices of a plant that the rest uses, or that it does not use itself; a trunk that leaves the ground;
    /// a house that sways.
    #[test]
    fn trees_bend_and_all_else_stands() {
        let yard = builtin::yard();
        assert_eq!(yard.plants.len(), 3);
        let mut wind = Wind::over(&yard).expect("trees");
        assert_eq!(wind.after(0.0).positions, yard.positions);
        let moved = wind.after(1.3).positions.to_vec();
        let bends = |vertex: u32| yard.plants.iter().any(|plant| plant.vertices.contains(&(vertex as usize)));
        let (mut most, mut standing) = (0.0_f32, 0);
        for (vertex, (&calm, &now)) in (0..).zip(yard.positions.iter().zip(&moved)) {
            let way = now.distance(calm);
            if !bends(vertex) || calm.y <= 0.0 {
                assert_eq!(way, 0.0);
                standing += 1;
            }
            most = most.max(way);
        }
        assert!((0.1..1.0).contains(&most), "{most} m");
        assert!(standing > 10_000 && standing < moved.len());
        // A triangle is of one plant or of none, and every vertex of a plant is of a triangle.
        let own: Vec<&[u32; 3]> = yard.indices.iter().filter(|corners| bends(corners[0])).collect();
        assert!(own.iter().all(|corners| corners.iter().all(|&vertex| bends(vertex))));
        let used: HashSet<u32> = own.into_iter().flatten().copied().collect();
        assert_eq!(used.len(), yard.plants.iter().map(|plant| plant.vertices.len()).sum::<usize>());
    }

    /// Mutants: gusts everywhere at once; a frame that depends on the one before.
    #[test]
    fn gusts_travel_and_depend_on_the_time_alone() {
        let mut wind = Wind::over(&builtin::yard()).expect("trees");
        let (first, second) = (wind.after(0.7).positions.to_vec(), wind.after(1.4).positions.to_vec());
        assert!(first != second);
        assert!(wind.after(0.7).positions == first);
        let sway = |x: f32| bend(Vec3::new(x, 5.0, 0.0), 5.0, 5.0, 0.7).dot(TOWARDS);
        assert!((sway(0.0) - sway(5.0)).abs() > 0.01);
    }

    #[test]
    fn nothing_of_a_car_bends() {
        assert!(Wind::over(&builtin::car()).is_none());
    }
}
