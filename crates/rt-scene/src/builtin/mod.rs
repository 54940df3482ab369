//! The built-in scenes: a garden and a car, made by formula, the same bits on every platform.
//!
//! Both are as uneven as scenes can be: much of the picture costs a ray next to nothing, the rest is expensive. Their
//! triangles are as many as those of the scenes in M. Rincón-Nigro and Z. Deng, *Cost-based Workload Balancing for Ray
//! Tracing on Multi-GPU Systems* (SIGGRAPH 2013 poster), so that timings are of like scale; the scenes are our own.
//! What has a free number of parts, blades of grass and pieces of wire, takes the number that makes the sum come out.

mod car;
mod mesh;
mod yard;

use crate::Model;

/// A garden with a house: trees, hedge and flowers on one side, sky and lawn that cost next to nothing around them.
/// 213,802 triangles.
#[must_use]
pub fn yard() -> Model {
    yard::build()
}

/// A car on an empty floor, its windows open and its interior complete. 234,443 triangles.
#[must_use]
pub fn car() -> Model {
    car::build()
}

#[cfg(test)]
mod tests;
