//! Meshes, rays and the brute-force answer that the tests share.
#![allow(dead_code, reason = "each test file uses its own part")]

use glam::Vec3;
use rt_bvh::{BlockTree, BuildOptions, Builder, InvalidTriangles, Mesh, Stack, build, count, trace};
use rt_core::intersect::hit;
use rt_core::{Coherence, Hit, Precision, Query, Ray, Scene, StreamSpec, TestCounts, Triangle, Walk, random};
use rt_simd::{Isa, Kernel, Scratch};
use rt_verify::shapes;
use std::collections::HashMap;
use std::sync::Arc;

/// A mesh that owns its buffers.
#[derive(Clone, Debug, Default)]
pub(crate) struct Model {
    pub(crate) positions: Vec<Vec3>,
    pub(crate) indices: Vec<[u32; 3]>,
}

impl Model {
    pub(crate) fn mesh(&self) -> Mesh<'_> {
        Mesh { positions: &self.positions, indices: &self.indices }
    }

    /// Triangles in their order; equal vertices are shared.
    pub(crate) fn of(triangles: &[Triangle]) -> Self {
        let mut model = Self::default();
        let mut known = HashMap::new();
        for triangle in triangles {
            model.indices.push(triangle.vertices().map(|p| {
                *known.entry(p.to_array().map(f32::to_bits)).or_insert_with(|| {
                    model.positions.push(p);
                    model.positions.len() as u32 - 1
                })
            }));
        }
        model
    }

    pub(crate) fn push(&mut self, vertices: [Vec3; 3]) {
        let first = self.positions.len() as u32;
        self.positions.extend(vertices);
        self.indices.push([first, first + 1, first + 2]);
    }

    pub(crate) fn triangle(&self, primitive: u32) -> Triangle {
        let [a, b, c] = self.indices[primitive as usize].map(|i| self.positions[i as usize]);
        Triangle::new(a, b, c)
    }

    /// Applies `change` to every vertex.
    pub(crate) fn map(mut self, change: impl Fn(Vec3) -> Vec3) -> Self {
        for p in &mut self.positions {
            *p = change(*p);
        }
        self
    }

    /// Each triangle so many times.
    pub(crate) fn repeated(mut self, times: usize) -> Self {
        self.indices = self.indices.repeat(times);
        self
    }

    /// The nearest hit by testing every triangle.
    pub(crate) fn brute(&self, ray: &Ray, excluded: u32) -> Hit {
        let mut best = Hit::MISS;
        for id in (0..self.indices.len() as u32).filter(|&id| id != excluded) {
            let triangle = self.triangle(id);
            if let Some(hit) = hit(ray, &triangle, id)
                && hit.is_before(&best)
            {
                best = hit;
            }
        }
        best
    }
}

/// Options that choose nothing but the builder.
pub(crate) fn with(builder: Builder) -> BuildOptions {
    BuildOptions { builder, ..BuildOptions::default() }
}

/// Builds with non-finite triangles dropped.
pub(crate) fn scene_of(model: &Model, builder: Builder) -> Arc<Scene> {
    build(model.mesh(), &BuildOptions { invalid: InvalidTriangles::Drop, ..with(builder) }).expect("valid mesh").scene
}

pub(crate) fn closest(scene: &Scene, precision: Precision, rays: &[Ray]) -> Vec<Hit> {
    let spec = StreamSpec::new(Query::Closest, precision, false);
    trace_all(scene, spec, rays).into_iter().map(|(hit, _)| hit).collect()
}

/// The nearest hits of the kernels for all instructions that the processor has.
pub(crate) fn in_words(scene: &Scene, rays: &[Ray]) -> Vec<(Isa, Vec<Hit>)> {
    let tree = BlockTree::new(scene).expect("few blocks");
    tree.check(scene).expect("sound");
    let mut scratch = Scratch::default();
    let kernels = Isa::available().into_iter().filter_map(|isa| Some((isa, Kernel::new(isa)?)));
    kernels
        .map(|(isa, kernel)| {
            let mut hits = vec![Hit::MISS; rays.len()];
            kernel.trace(&tree, &mut scratch, (Query::Closest, Coherence::Unknown), rays, &[], &mut hits);
            (isa, hits)
        })
        .collect()
}

pub(crate) fn trace_all(scene: &Scene, spec: StreamSpec, rays: &[Ray]) -> Vec<(Hit, TestCounts)> {
    let mut out = Vec::with_capacity(rays.len());
    let mut stack = Stack::for_scene(scene);
    trace(scene, &mut stack, spec, rays.iter().map(|&r| (r, u32::MAX)), |hit, counts| out.push((hit, counts)));
    out
}

pub(crate) fn count_all(scene: &Scene, walk: Walk, rays: &[Ray]) -> Vec<(Hit, TestCounts)> {
    let mut out = Vec::with_capacity(rays.len());
    let mut stack = Stack::for_scene(scene);
    let rays = rays.iter().map(|&r| (r, u32::MAX));
    count(scene, &mut stack, walk, Precision::Robust, rays, |hit, counts| out.push((hit, counts)));
    out
}

/// Reproducible numbers.
#[derive(Clone, Debug)]
pub(crate) struct Random {
    seed: u32,
    drawn: u32,
}

impl Random {
    pub(crate) fn new(seed: u32) -> Self {
        Self { seed, drawn: 0 }
    }

    /// Uniform in `[0, 1)`.
    pub(crate) fn unit(&mut self) -> f32 {
        self.drawn += 1;
        random::pair(self.seed, self.drawn, 0)[0]
    }

    /// Uniform in `[−1, 1)`.
    pub(crate) fn signed(&mut self) -> f32 {
        2.0 * self.unit() - 1.0
    }

    pub(crate) fn below(&mut self, bound: usize) -> usize {
        self.drawn += 1;
        random::below(bound as u32, self.seed, self.drawn, 1) as usize
    }

    /// Uniform in the cube of half edge 1.
    pub(crate) fn point(&mut self) -> Vec3 {
        Vec3::new(self.signed(), self.signed(), self.signed())
    }

    /// Not zero.
    pub(crate) fn direction(&mut self) -> Vec3 {
        loop {
            let d = self.point();
            if d.length_squared() > 1e-4 {
                return d;
            }
        }
    }
}

/// Random triangles of the given size in the unit cube.
pub(crate) fn soup(count: usize, size: f32, seed: u32) -> Model {
    Model::of(&shapes::soup(count as u32, size, seed))
}

/// A height field of `n × n` squares with shared vertices.
pub(crate) fn grid(n: u32, seed: u32) -> Model {
    Model::of(&shapes::grid(n, 0.2, seed))
}

/// A closed sphere of 20 · 4^`level` triangles with shared vertices.
pub(crate) fn icosphere(level: u32) -> Model {
    Model::of(&shapes::icosphere(level))
}

/// A closed axis-aligned cube of half edge 1, each face `n × n` squares with shared vertices.
pub(crate) fn cube(n: u32) -> Model {
    Model::of(&shapes::box_grid(n))
}

/// Rays of every kind that is known to break traversals, aimed at the model from in and around it.
pub(crate) fn nasty_rays(model: &Model, count: usize, seed: u32) -> Vec<Ray> {
    let mut random = Random::new(seed);
    let (mut low, mut high) = (Vec3::MAX, Vec3::MIN);
    for &p in model.positions.iter().filter(|p| p.is_finite()) {
        (low, high) = (low.min(p), high.max(p));
    }
    let (middle, size) = (low * 0.5 + high * 0.5, high * 0.5 - low * 0.5);
    (0..count)
        .map(|i| {
            let triangle = model.triangle(random.below(model.indices.len()) as u32);
            let [a, b, c] = triangle.vertices();
            let origin = match i % 5 {
                0 | 1 => middle + size * 3.0 * random.point(),
                2 => middle + size * random.point(),
                3 => middle,
                // On the triangle's plane, in line with an edge or vertex.
                _ => a,
            };
            let target = match i % 7 {
                0 => a,
                1 => a + (b - a) * random.unit(),
                2 => a + (b - a) * 0.5,
                3 => (a + b + c) / 3.0,
                4 => a + (b - a) * random.unit() + (c - a) * 0.5 * random.unit(),
                _ => middle + size * random.point(),
            };
            let direction = match i % 11 {
                0 => [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z][random.below(6)],
                1 => Vec3::new(random.signed(), -0.0, random.signed()),
                2 => (target - origin) * 1e-30,
                _ => target - origin,
            };
            // Axis-aligned rays start level with the target, so that they run along planes of boxes.
            let origin = if i % 11 == 0 { target - direction * size.max_element() } else { origin };
            Ray::new(origin, direction)
        })
        .collect()
}
