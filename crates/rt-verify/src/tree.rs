//! Triangles turned into a scene, and what `rt_bvh` itself says of rays on it.

use glam::Vec3;
use rt_bvh::{BuildOptions, Builder, Built, Mesh, Stack};
use rt_core::{Hit, Precision, Ray, Scene, StreamSpec, TestCounts, Triangle, Walk};
use std::sync::Arc;

/// Builds a scene of `triangles`, whose ids are their positions.
///
/// # Errors
/// The builder's message.
pub fn build(triangles: &[Triangle], builder: Builder) -> Result<Arc<Scene>, String> {
    built(triangles, builder).map(|built| built.scene)
}

/// A scene of `triangles`, whose ids are their positions, and how it was built.
///
/// # Errors
/// The builder's message.
pub fn built(triangles: &[Triangle], builder: Builder) -> Result<Built, String> {
    let (positions, indices) = soup(triangles);
    let options = BuildOptions { builder, ..BuildOptions::default() };
    rt_bvh::build(Mesh { positions: &positions, indices: &indices }, &options).map_err(|e| e.to_string())
}

/// The scene of triangles that have moved since `scene` was built of them; `None` if they cannot have its tree.
///
/// # Errors
/// The builder's message.
pub fn refit(scene: &Scene, triangles: &[Triangle]) -> Result<Option<Arc<Scene>>, String> {
    let (positions, indices) = soup(triangles);
    let mesh = Mesh { positions: &positions, indices: &indices };
    rt_bvh::refit(scene, mesh, &BuildOptions::default()).map_err(|e| e.to_string())
}

/// Vertices of triangles that share none.
fn soup(triangles: &[Triangle]) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let positions = triangles.iter().flat_map(Triangle::vertices).collect();
    (positions, (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
}

/// Traces every ray with `rt_bvh`.
#[must_use]
pub fn trace(scene: &Scene, spec: StreamSpec, rays: &[(Ray, u32)]) -> (Vec<Hit>, Vec<TestCounts>) {
    let mut answers = (Vec::with_capacity(rays.len()), Vec::with_capacity(rays.len()));
    rt_bvh::trace(scene, &mut Stack::for_scene(scene), spec, rays.iter().copied(), |hit, counts| {
        answers.0.push(hit);
        answers.1.push(counts);
    });
    answers
}

/// Walks every ray with `rt_bvh`.
#[must_use]
pub fn walk(scene: &Scene, walk: Walk, spec: StreamSpec, rays: &[(Ray, u32)]) -> (Vec<Hit>, Vec<TestCounts>) {
    let mut answers = (Vec::with_capacity(rays.len()), Vec::with_capacity(rays.len()));
    let precision: Precision = spec.precision;
    rt_bvh::count(scene, &mut Stack::for_scene(scene), walk, precision, rays.iter().copied(), |hit, counts| {
        answers.0.push(hit);
        answers.1.push(counts);
    });
    answers
}
