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
use std::fmt;
use std::str::FromStr;

/// Frames of a second.
pub const FRAMES_PER_SECOND: f32 = 25.0;

/// Where the wind blows to: a unit vector.
const TOWARDS: Vec3 = Vec3::new(0.96, 0.0, 0.28);

/// How far a plant's top goes to one side in wind of strength 1, as a share of its height: a fresh breeze.
const BEND: f32 = 0.035;

/// Seconds from gust to gust, and metres between two.
const PERIOD: f32 = 2.6;
const WAVELENGTH: f32 = 14.0;

/// The same of the flutter of leaves, and how far it goes at the top, as a share of the height.
const FLUTTER_PERIOD: f32 = 0.41;
const FLUTTER_WAVELENGTH: f32 = 0.9;
const FLUTTER: f32 = 0.0025;

/// How strong wind is, beside a fresh breeze: that many times as far it bends what it blows over.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Strength(f32);

impl Strength {
    /// A fresh breeze.
    pub const BREEZE: Self = Self(1.0);

    /// The strongest wind: plants lie flat, and their leaves fly.
    pub const MOST: Self = Self(100.0);

    /// How many times a fresh breeze.
    #[must_use]
    pub const fn times(self) -> f32 {
        self.0
    }
}

impl FromStr for Strength {
    type Err = BadStrength;

    fn from_str(text: &str) -> Result<Self, BadStrength> {
        let strength = text.parse().ok().map(Self).filter(|strength| strength.0 > 0.0 && *strength <= Self::MOST);
        strength.ok_or(BadStrength)
    }
}

/// What is no [`Strength`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BadStrength;

impl fmt::Display for BadStrength {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a number above 0, at most {}, is needed: 1 is a fresh breeze, 60 a hurricane", Strength::MOST.0)
    }
}

impl std::error::Error for BadStrength {}

/// Why there is no wind over a model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NothingBends {
    source: String,
}

impl fmt::Display for NothingBends {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "nothing in {} bends in it", self.source)
    }
}

impl std::error::Error for NothingBends {}

/// Wind over a model.
#[derive(Clone, Debug)]
pub struct Wind {
    strength: Strength,
    calm: Vec<Vec3>,
    indices: Vec<[u32; 3]>,
    plants: Vec<Plant>,
    now: Vec<Vec3>,
}

impl Wind {
    /// Wind over a model as it is when it is calm.
    ///
    /// # Errors
    /// Where nothing of it bends.
    pub fn over(model: &Model, strength: Strength) -> Result<Self, NothingBends> {
        let Model { positions, indices, plants, source, .. } = model;
        if plants.is_empty() {
            return Err(NothingBends { source: source.clone() });
        }
        Ok(Self {
            strength,
            calm: positions.clone(),
            indices: indices.clone(),
            plants: plants.clone(),
            now: positions.clone(),
        })
    }

    /// The model so many seconds after it was calm: its triangles in their order, none more and none less.
    pub fn after(&mut self, seconds: f32) -> Mesh<'_> {
        let Self { strength: Strength(strength), calm, indices, plants, now } = self;
        for Plant { vertices, foot } in plants.iter() {
            let (calm, now) = (&calm[vertices.clone()], &mut now[vertices.clone()]);
            let height = calm.iter().fold(f32::MIN_POSITIVE, |height, vertex| height.max(vertex.y - foot.y));
            now.par_iter_mut()
                .zip(calm)
                .for_each(|(now, &calm)| *now = calm + *strength * bend(calm, calm.y - foot.y, height, seconds));
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
        let mut wind = Wind::over(&yard, Strength::BREEZE).expect("trees");
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
        let mut wind = Wind::over(&builtin::yard(), Strength::BREEZE).expect("trees");
        let (first, second) = (wind.after(0.7).positions.to_vec(), wind.after(1.4).positions.to_vec());
        assert!(first != second);
        assert!(wind.after(0.7).positions == first);
        let sway = |x: f32| bend(Vec3::new(x, 5.0, 0.0), 5.0, 5.0, 0.7).dot(TOWARDS);
        assert!((sway(0.0) - sway(5.0)).abs() > 0.01);
    }

    #[test]
    fn nothing_of_a_car_bends() {
        assert!(Wind::over(&builtin::car(), Strength::BREEZE).is_err());
    }

    /// Mutants: the strength is not heeded; a breeze that is none; bad words taken for a number.
    #[test]
    fn strong_wind_bends_farther() {
        let yard = builtin::yard();
        let most = |strength: Strength| {
            let mut wind = Wind::over(&yard, strength).expect("trees");
            let moved = wind.after(0.9).positions.iter().zip(&yard.positions);
            moved.map(|(now, calm)| now.distance(*calm)).fold(0.0, f32::max)
        };
        let ten: Strength = "10".parse().expect("a strength");
        let ratio = most(ten) / most(Strength::BREEZE);
        assert!((9.9..10.1).contains(&ratio), "{ratio}");
        assert_eq!("1".parse(), Ok(Strength::BREEZE));
        assert_eq!("100".parse(), Ok(Strength::MOST));
        for bad in ["0", "-1", "101", "nan", "inf", "storm", ""] {
            assert_eq!(bad.parse::<Strength>(), Err(BadStrength), "{bad}");
        }
    }
}
