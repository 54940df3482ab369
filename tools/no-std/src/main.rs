//! A program without std and libc that uses rt-core, rt-bvh and rt-sched for what they are made for.
//!
//! It exists to fail to build: with its own panic handler and link arguments that leave out every library, it stops
//! with E0152 (duplicate lang item) as soon as std is anywhere below those three crates, and with an undefined symbol
//! as soon as they call libc. `cargo xtask no-std` builds it, runs it and checks that the negative control fails.
#![no_std]
#![no_main]

extern crate alloc;

mod runtime;

use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;
use core::hint::black_box;
use glam::Vec3;
use rt_bvh::{BuildOptions, Mesh, Stack, build, count, trace};
use rt_core::{
    Camera, CameraRays, CostEstimator, CostModel, Hit, Observation, Precision, Ray, RayStream, Scene, Step, StreamKind,
    StreamSpec, Task, Triangle, Work, intersect, morton, tasks_of,
};
use rt_sched::estimate::Sampled;
use rt_sched::policy::{Lpt, Policy};
use rt_sched::queue::{HybridQueue, Pop, TaskQueue};
use rt_sched::sample::Fraction;

/// Squares of the scene along each side, two triangles each.
const SQUARES: u32 = 8;

/// Width and height of the image in pixels.
const SIZE: u32 = 16;

/// 0 when every answer is right, otherwise the number of the first wrong one.
fn main() -> i32 {
    let (positions, indices) = hills();
    // The black boxes keep the optimiser from answering at build time.
    let mesh = Mesh { positions: black_box(&positions), indices: black_box(&indices) };
    let Ok(built) = build(mesh, &BuildOptions::default()) else { return 1 };
    let Some(rays) = camera_rays() else { return 2 };
    let tasks = tasks_of(rays.len() as u32, 32);
    let Some(work) = estimate(&built.scene, &rays, &tasks) else { return 3 };
    let Some(hits) = trace_all(&built.scene, &rays, &tasks, &work) else { return 4 };
    let right = rays.iter().zip(&hits).all(|(ray, hit)| *hit == nearest(ray, &positions, &indices));
    // The camera looks at the middle of the scene: a picture of misses alone would prove little.
    if right && hits.iter().any(Hit::is_hit) { 0 } else { 5 }
}

/// A grid of squares over hills and valleys.
fn hills() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let side = SQUARES + 1;
    let height = |x: u32, y: u32| libm::sinf(x as f32) * libm::cosf(y as f32);
    let positions = (0..side * side).map(|i| (i % side, i / side));
    let positions = positions.map(|(x, y)| Vec3::new(x as f32, height(x, y), y as f32)).collect();
    let squares = (0..SQUARES * SQUARES).map(|i| i % SQUARES + i / SQUARES * side);
    let indices = squares.flat_map(|a| [[a, a + 1, a + side], [a + 1, a + side + 1, a + side]]).collect();
    (positions, indices)
}

fn camera_rays() -> Option<Vec<Ray>> {
    let middle = Vec3::new(SQUARES as f32 / 2.0, 0.0, SQUARES as f32 / 2.0);
    let camera = Camera::look_at(black_box(Vec3::new(-3.0, 5.0, -2.0)), middle, Vec3::Y, 60.0).ok()?;
    let pixels: Arc<[u32]> = morton::pixel_order(SIZE, SIZE).into();
    let rays = CameraRays { camera, size: [SIZE; 2], pixels, samples: 2, first_sample: 0, all_samples: 2, seed: 7 };
    Some((0..rays.len()).map(|index| rays.ray(index)).collect())
}

/// Asks an estimator, and walks the rays that it names.
fn estimate(scene: &Scene, rays: &[Ray], tasks: &[Task]) -> Option<Vec<Work>> {
    let mut estimator = Sampled::new(rt_core::Walk::Full, Fraction::EIGHTH);
    let stream = RayStream { devices: 2, ..RayStream::new(StreamKind::Primary, tasks) };
    let Step::Sample { rays: asked, walk } = estimator.next(stream, Observation::default()) else { return None };
    let mut counts = Vec::new();
    let samples = asked.iter().map(|&ray| (rays[ray as usize], u32::MAX));
    count(scene, &mut Stack::for_scene(scene), walk, Precision::Robust, samples, |_, tests| counts.push(tests));
    match estimator.next(stream, Observation { rays: &asked, counts: &counts }) {
        Step::Done(work) if work.iter().all(|work| work.tests() > 0.0) => Some(work),
        _ => None,
    }
}

/// Deals the tasks to two devices, one twice as fast, and runs both by turns; `None` if a task is left out or comes
/// twice.
fn trace_all(scene: &Scene, rays: &[Ray], tasks: &[Task], work: &[Work]) -> Option<Vec<Hit>> {
    let devices = [CostModel::new(1e-6, 1e-9, 1e-9, 1e-9)?, CostModel::new(1e-6, 2e-9, 2e-9, 2e-9)?];
    let queue = HybridQueue::new(&Lpt.schedule(work, &devices), work, &devices);
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut times_traced = vec![0; tasks.len()];
    let mut stack = Stack::for_scene(scene);
    let mut launch = Vec::new();
    let mut done = [false; 2];
    while done != [true; 2] {
        for (device, done) in done.iter_mut().enumerate() {
            *done = queue.pop(device, &mut launch) == Pop::Done;
            for &task in &launch {
                times_traced[task as usize] += 1;
                let range = tasks[task as usize].first as usize..tasks[task as usize].range().end as usize;
                let task_rays = rays[range.clone()].iter().map(|ray| (*ray, u32::MAX));
                let mut out = hits[range].iter_mut();
                trace(scene, &mut stack, StreamSpec::default(), task_rays, |hit, _| {
                    if let Some(place) = out.next() {
                        *place = hit;
                    }
                });
            }
            queue.finish(device, &launch);
        }
    }
    times_traced.iter().all(|&times| times == 1).then_some(hits)
}

/// The hit that a test of every triangle finds.
fn nearest(ray: &Ray, positions: &[Vec3], indices: &[[u32; 3]]) -> Hit {
    let mut nearest = Hit::MISS;
    for (primitive, corners) in indices.iter().enumerate() {
        let [a, b, c] = corners.map(|corner| positions[corner as usize]);
        if let Some(hit) = intersect::hit(ray, &Triangle::new(a, b, c), primitive as u32)
            && hit.is_before(&nearest)
        {
            nearest = hit;
        }
    }
    nearest
}
