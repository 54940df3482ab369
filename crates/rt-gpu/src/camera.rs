//! Whether a device makes the camera rays that the host makes, bit for bit.

use crate::RayRecipe;
use crate::ray_recipe::Row;
use crate::trials::first_fault;
use rt_bvh::kernel_io::{KernelCamera, KernelIo, KernelRay};
use rt_bvh::{BuildOptions, Mesh, build};
use rt_core::{Camera, CameraRays, Scene, morton};
use std::sync::Arc;

/// Width and height of the trials' images in pixels. Even, so that no ray runs along an axis: those are left to the
/// host.
const SIZE: [u32; 2] = [62, 38];

/// Share of the rays of a trial that a device may leave to the host. With quotients that are off by 2.5 units in the
/// last place, the improved ones are off by 2⁻⁴³ at most, so that at worst one in 2¹⁸ is rounded otherwise, and one ray
/// in 2¹⁵ has such a one among its eight; more come from components near 0.
const LEFT_OUT: f64 = 1.0 / 256.0;

/// A scene, a camera, and the rays that a device is to make.
#[derive(Debug)]
struct Trial {
    scene: Arc<Scene>,
    rays: CameraRays,
    camera: KernelCamera,
}

/// What a device must pass: cameras near and far, along an axis and across, wide and narrow, with one ray for each
/// pixel and with several.
fn trials() -> Vec<Trial> {
    let oblique = ([3.1, 1.7, -2.3], [0.2, 0.4, 0.1]);
    let along = ([0.5, 0.25, 4.0], [0.5, 0.25, 0.0]);
    let far = ([2e5, 1e4, -3e5], [1.0, 0.0, 0.0]);
    // Of which samples a pixel has rays: how many, from which on, of how many.
    [
        (1.0, oblique, 50.0, SIZE, [1, 0, 1]),
        (1.0, along, 40.0, SIZE, [3, 0, 3]),
        (3e6, oblique, 170.0, SIZE, [2, 0, 2]),
        (0.004, far, 0.001, SIZE, [5, 7, 16]),
        (1.0, oblique, 90.0, [640, 6], [4, 0, 4]),
        (1.0, oblique, 60.0, SIZE, [1, 2, 3]),
    ]
    .into_iter()
    .filter_map(|(scale, (eye, target), fov, size, samples)| Trial::new(scale, [eye, target], fov, size, samples))
    .collect()
}

/// In words, the first ray of all trials that a device makes otherwise than the host; `None` if there is none. `make`
/// lets the device make rays.
///
/// # Errors
/// Those of `make`.
pub fn fault<E>(mut make: impl FnMut(&RayRecipe) -> Result<Vec<KernelRay>, E>) -> Result<Option<String>, E> {
    for trial in trials() {
        if let Some(fault) = trial.first_fault(&make(&trial.order())?) {
            return Ok(Some(fault));
        }
    }
    Ok(None)
}

impl Trial {
    fn new(scale: f32, [eye, target]: [[f32; 3]; 2], fov: f32, size: [u32; 2], samples: [u32; 3]) -> Option<Self> {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 1.0]].map(|p| glam::Vec3::from(p) * scale);
        let scene = build(Mesh { positions: &corners, indices: &[[0, 1, 2]] }, &BuildOptions::default()).ok()?.scene;
        let [eye, target] = [eye, target].map(|p| glam::Vec3::from(p) * scale);
        let camera = Camera::look_at(eye, target, glam::Vec3::Y, fov).ok()?;
        let pixels: Arc<[u32]> = morton::pixel_order(size[0], size[1]).into();
        let [samples, first_sample, all_samples] = samples;
        let rays = CameraRays { camera, size, pixels, samples, first_sample, all_samples, seed: 0x9e37_79b9 };
        let camera = KernelIo::new(&scene).camera(&rays)?;
        Some(Self { scene, rays, camera })
    }

    /// What the device is told to make: all but the first pixel's first sample, as for a stream's second window, the
    /// later rays first.
    fn order(&self) -> RayRecipe {
        let [middle, end] = [self.rays.len() / 2 + 1, self.rays.len()];
        let rows = [Row { ray: middle, count: end - middle }, Row { ray: 1, count: middle - 1 }];
        RayRecipe::camera(&self.camera, &self.rays, &rows, 1)
    }

    /// What the host makes of it, without the same sample.
    fn expected(&self) -> Vec<KernelRay> {
        let io = KernelIo::new(&self.scene);
        (1..self.rays.len()).map(|i| io.prepare(&self.rays.ray(i), u32::MAX)).collect()
    }

    /// What is wrong with what a device wrote to binding 6.
    fn first_fault(&self, made: &[KernelRay]) -> Option<String> {
        let name_of = |i| format!("ray {} of {:?}", i + 1, self.rays.camera);
        first_fault(&self.expected(), made, LEFT_OUT, name_of)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a device with IEEE division would make. Fails when a trial compares nothing.
    #[test]
    fn trials_tell_the_right_rays_from_wrong_ones() {
        let trials = trials();
        assert_eq!(trials.len(), 6, "every trial is one that the host would not keep to itself");
        for trial in trials {
            let mut rays = trial.expected();
            assert!(rays.iter().all(|ray| ray.kind < KernelRay::MISS));
            assert_eq!(trial.first_fault(&rays), None);
            assert!(trial.first_fault(&rays[1..]).is_some());
            let right = rays[7];
            rays[7].reciprocal.y = right.reciprocal.y.next_up();
            assert!(trial.first_fault(&rays).is_some_and(|fault| fault.contains("ray 8")));
            rays[7].kind = KernelRay::HOST;
            assert_eq!(trial.first_fault(&rays), None);
            rays.iter_mut().step_by(100).for_each(|ray| ray.kind = KernelRay::HOST);
            assert!(trial.first_fault(&rays).is_some());
        }
    }
}
