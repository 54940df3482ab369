//! A program without std and libc that uses rt-core, rt-bvh and rt-sched.
//!
//! It exists to fail to build: with its own panic handler and link arguments that leave out every library, it stops
//! with E0152 (duplicate lang item) as soon as std is anywhere below those three crates, and with an undefined symbol
//! as soon as they call libc. `cargo xtask no-std` builds it, runs it and checks that the negative control fails.
#![no_std]
#![no_main]

extern crate alloc;

mod runtime;

use alloc::vec;
use core::hint::black_box;
use glam::Vec3;
use rt_core::{Aabb, Camera, Child, Node, Scene, SceneParts, Triangle, intersect, tasks_of};

use rt_bvh as _;
use rt_sched as _;

/// 0 when every answer is right, otherwise the number of the first wrong one.
fn main() -> i32 {
    let checks: [fn() -> bool; 2] = [traces, cuts_tasks];
    checks.iter().position(|check| !check()).map_or(0, |index| index as i32 + 1)
}

/// A camera ray meets a triangle of a checked scene where it must.
fn traces() -> bool {
    let triangle = Triangle::new(Vec3::ZERO, Vec3::X, Vec3::Y);
    let mut root = Node::EMPTY;
    root.set(0, triangle.bounds(), Child::Leaf { first: 0, count: 1 });
    root.set(1, Aabb::EMPTY, Child::Absent);
    let parts = SceneParts {
        nodes: vec![root],
        triangles: vec![triangle],
        primitives: vec![0],
        scale_exponent: 0,
        primitive_count: 1,
    };
    // The black boxes keep the optimiser from answering at build time.
    let Ok(scene) = Scene::new(black_box(parts)) else { return false };
    let eye = black_box(Vec3::new(0.25, 0.25, 2.0));
    let Ok(camera) = Camera::look_at(eye, Vec3::new(0.25, 0.25, 0.0), Vec3::Y, 40.0) else { return false };
    let ray = camera.ray(0.5, 0.5, 1.0);
    intersect::hit(&ray, &scene.triangles()[0], 0).is_some_and(|hit| hit.t == 2.0 && hit.primitive == 0)
}

/// A stream is cut into tasks.
fn cuts_tasks() -> bool {
    tasks_of(black_box(100), 32).len() == 4
}
