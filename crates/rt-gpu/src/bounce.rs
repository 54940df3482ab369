//! Whether a device makes the rays that leave surfaces as the host does, bit for bit.

use crate::ray_recipe::Row;
use crate::trials::first_fault;
use crate::{RayRecipe, SceneImage};
use glam::Vec3;
use rt_bvh::kernel_io::{KernelIo, KernelRay};
use rt_bvh::{BuildOptions, Mesh, build};
use rt_core::bounce::{Aim, Departure, Scatter, Surface, Surfaces, basis};
use rt_core::{BounceRays, Scene, random};
use std::sync::Arc;

/// Rays of a trial: no multiple of a workgroup.
const RAYS: u32 = 3000;

/// Share of the rays of a trial that a device may leave to the host: a component near 0 is rarer than this, but for the
/// directions of small discs around an axis, as random trials have them.
const LEFT_OUT: f64 = 1.0 / 256.0;
const LEFT_OUT_OF_RANDOM: f64 = 1.0 / 32.0;

/// A scene, and rays that a device is to make of it.
#[derive(Debug)]
pub struct Trial {
    scene: Arc<Scene>,
    rays: BounceRays,
    recipe: RayRecipe,
    /// Share of the rays that may be left to the host.
    left_out: f64,
}

/// What a device must pass: rays about normals and to a sun, soft and straight above, from triangles of all sizes,
/// among them needles and such as lie in a plane of two axes, at the origin and far from it, with one path in each
/// group and with several.
#[must_use]
pub fn trials() -> Vec<Trial> {
    let oblique = Vec3::new(0.48, 0.6, 0.64);
    [
        (1.0, 0.0, Aim::Cosine, 1, true),
        (3e6, 0.0, Aim::Cosine, 7, false),
        (0.004, 1e5, Aim::Cosine, 2, true),
        (1.0, 1e5, disc(oblique, 0.045), 3, false),
        (1e-9, 0.0, disc(oblique, 0.9), 1, true),
        (1.0, 0.0, disc(Vec3::Y, 0.0), 1, false),
    ]
    .into_iter()
    .filter_map(|(scale, offset, aim, samples, rows)| Trial::new(0, [scale, offset], aim, samples, rows))
    .collect()
}

/// Trials beyond those that a device must pass: of other triangles, scales, offsets and rays for each seed. What
/// extremes the host keeps to itself are left out.
#[must_use]
pub fn random_trials(seed: u32, count: u32) -> Vec<Trial> {
    let trial = |i: u32| {
        let [a, b, c] = random::pcg3d([seed, i, 4]);
        let scale = [1.0, 1e-12, 1e12, 1e-3, 7e4, 1e-17, 1e-30, 1e30][a as usize % 8];
        let offset = [0.0, 0.0, 1e3, 1e6][b as usize % 4];
        let middle = Vec3::from([a, b, c].map(|word| random::unit(word) - 0.5)).try_normalize()?;
        let aim = match c % 3 {
            0 => Aim::Cosine,
            1 => disc(middle, random::unit(b)),
            _ => disc([Vec3::X, Vec3::NEG_Y, Vec3::Z][a as usize / 8 % 3], 1e-3),
        };
        let trial = Trial::new(a ^ b, [scale, offset], aim, 1 + c % 5, c & 8 == 0)?;
        Some(Trial { left_out: LEFT_OUT_OF_RANDOM, ..trial })
    };
    (0..count).filter_map(trial).collect()
}

/// A disc of that radius, as a tangent, around a unit vector.
fn disc(middle: Vec3, radius: f32) -> Aim {
    let (tangent, bitangent) = basis(middle);
    Aim::Disc { middle, radii: [tangent * radius, bitangent * radius] }
}

/// A triangle's corner: some coordinates are 0, or so small that they are when squared.
fn vertex([seed, triangle, corner]: [u32; 3], scale: f32, offset: f32) -> Vec3 {
    let middle = random::pcg3d([triangle, seed, 1]);
    let words = random::pcg3d([triangle, corner, seed.wrapping_add(2)]);
    let size = [1.0, 0.1, 1e-3, 1e-5][triangle as usize % 4];
    let at = |axis: usize| {
        let spread = random::unit(words[axis]) * 2.0 - 1.0;
        match (triangle + axis as u32) % 7 {
            0 => 0.0,
            1 => spread * 1e-17,
            // A needle.
            2 if triangle.is_multiple_of(3) => random::unit(middle[axis]) + spread * size * 1e-3,
            _ => random::unit(middle[axis]) + spread * size,
        }
    };
    (Vec3::new(at(0), at(1), at(2)) + Vec3::splat(offset)) * scale
}

/// In words, the first ray of the trials that a device makes otherwise than the host; `None` if there is none. `make`
/// lets the device make rays that leave the triangles of a scene.
///
/// # Errors
/// Those of `make`.
pub fn fault<E>(
    trials: &[Trial],
    mut make: impl FnMut(&SceneImage<'_>, &RayRecipe) -> Result<Vec<KernelRay>, E>,
) -> Result<Option<String>, E> {
    for trial in trials {
        if let Some(fault) = trial.first_fault(&make(&trial.image(), &trial.recipe)?) {
            return Ok(Some(fault));
        }
    }
    Ok(None)
}

impl Trial {
    fn new(seed: u32, [scale, offset]: [f32; 2], aim: Aim, samples: u32, rows: bool) -> Option<Self> {
        const TRIANGLES: u32 = 280;
        let positions: Vec<Vec3> = (0..3 * TRIANGLES).map(|i| vertex([seed, i / 3, i % 3], scale, offset)).collect();
        let indices: Vec<[u32; 3]> = (0..TRIANGLES).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mesh = Mesh { positions: &positions, indices: &indices };
        let scene = build(mesh, &BuildOptions::default()).ok()?.scene;
        let surfaces = Arc::new(Surfaces::new(Arc::clone(&scene)));
        let exponent = scene.scale_exponent();
        let usable = |primitive: &u32| {
            surfaces.triangle(*primitive).is_some_and(|triangle| Surface::new(triangle, exponent).is_some())
        };
        let there: Vec<u32> = (0..TRIANGLES).filter(usable).collect();
        let departure = |i: u32| {
            let [u, v, other] = random::pcg3d([i, seed, 3]);
            // Some on edges and corners.
            let [u, v] = [[u >> 8, v >> 8], [0, v >> 8], [1 << 24, 0], [0, 0], [u >> 8, 0]][other as usize % 5];
            let v = v.min((1 << 24) - u);
            let behind = if other & 64 == 0 { 0 } else { Departure::BEHIND };
            let primitive = there[other as usize / 128 % there.len()];
            let path = if rows { i + i / 100 } else { i * 3 + 1 };
            Departure { weights: [u | behind, v], primitive, path }
        };
        let rays = BounceRays {
            surfaces,
            departures: (0..RAYS).map(departure).collect(),
            scatter: Scatter { aim, seed: 0x9e37_79b9, samples, first_group: 77, bounce: 1 },
        };
        let block = KernelIo::new(&scene).bounce(&rays)?;
        let rows = [Row { ray: 1000, count: RAYS - 1000 }, Row { ray: 0, count: 1000 }];
        let recipe = RayRecipe::bounce(&block, &rays, &rows, 0, &[]);
        Some(Self { scene, rays, recipe, left_out: LEFT_OUT })
    }

    /// The scene, whose triangles and primitives the kernel reads in the order of the two-wide tree.
    fn image(&self) -> SceneImage<'_> {
        SceneImage::new(&self.scene)
    }

    fn expected(&self) -> Vec<KernelRay> {
        let io = KernelIo::new(&self.scene);
        let ray = |i| {
            let (ray, excluded) = self.rays.ray(i);
            io.prepare(&ray, excluded)
        };
        (0..self.rays.len()).map(ray).collect()
    }

    /// What is wrong with what a device wrote to binding 6.
    fn first_fault(&self, made: &[KernelRay]) -> Option<String> {
        let name_of = |i: usize| format!("the ray from {:?}", self.rays.departures[i]);
        first_fault(&self.expected(), made, self.left_out, name_of)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a device without a fault would make. Fails when a trial compares nothing.
    #[test]
    fn trials_tell_the_right_rays_from_wrong_ones() {
        let trials = trials();
        assert_eq!(trials.len(), 6, "every trial is one that the host would not keep to itself");
        for trial in trials {
            let mut rays = trial.expected();
            assert!(rays.iter().all(|ray| ray.kind < KernelRay::MISS));
            assert_eq!(trial.first_fault(&rays), None);
            assert!(trial.first_fault(&rays[1..]).is_some());
            rays[7].origin.y = rays[7].origin.y.next_up();
            assert!(trial.first_fault(&rays).is_some_and(|fault| fault.contains("not KernelRay")));
            rays[7].kind = KernelRay::HOST;
            assert_eq!(trial.first_fault(&rays), None);
            rays.iter_mut().step_by(100).for_each(|ray| ray.kind = KernelRay::HOST);
            assert!(trial.first_fault(&rays).is_some());
        }
    }
}
