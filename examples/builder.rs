//! A builder of one's own: triangles are sorted along the axes in turn and halved. A balancer takes any tree that
//! `Scene::new` finds sound, and hits do not depend on which; with the feature `ploc` there is PLOC beside the default.
//!
//! `cargo run --release -p rt-balance --example builder`

use rt_balance::cpu::CpuDevice;
use rt_balance::glam::Vec3;
use rt_balance::{Aabb, Balancer, Child, Device, Hit, Node, Ray, Scene, SceneError, SceneParts, Triangle};
use std::io::{Write, stdout};
use std::sync::Arc;

/// Triangles in a leaf.
const LEAF: usize = 2;

/// Adds the nodes over `triangles`, which are sorted into leaf order; the first is at place `first` of all.
fn halve(triangles: &mut [(Triangle, u32)], first: u32, depth: usize, nodes: &mut Vec<Node>) -> (Aabb, Child) {
    let bounds = triangles.iter().fold(Aabb::EMPTY, |all, (triangle, _)| all.union(triangle.bounds()));
    // The root is always a node.
    if triangles.len() <= LEAF && depth > 0 {
        return (bounds, Child::Leaf { first, count: triangles.len() as u32 });
    }
    let centre = |(t, _): &(Triangle, u32)| (t.a + t.b + t.c)[depth % 3];
    triangles.sort_by(|a, b| centre(a).total_cmp(&centre(b)));
    let node = nodes.len();
    nodes.push(Node::EMPTY);
    let half = triangles.len() / 2;
    let (left, right) = triangles.split_at_mut(half);
    for (side, (part, first)) in [(left, first), (right, first + half as u32)].into_iter().enumerate() {
        if !part.is_empty() {
            let (bounds, child) = halve(part, first, depth + 1, nodes);
            nodes[node].set(side, bounds, child);
        }
    }
    (bounds, Child::Inner(node as u32))
}

/// A scene of triangles whose ids are their positions; coordinates should be neither huge nor tiny, since they stay as
/// they are.
fn build(triangles: &[Triangle]) -> Result<Scene, SceneError> {
    let mut ordered: Vec<(Triangle, u32)> = triangles.iter().copied().zip(0..).collect();
    let mut nodes = Vec::new();
    halve(&mut ordered, 0, 0, &mut nodes);
    let primitive_count = triangles.len() as u32;
    let (triangles, primitives) = ordered.into_iter().unzip();
    Scene::new(SceneParts { nodes, triangles, primitives, scale_exponent: 0, primitive_count })
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A staircase.
    let step = |i: u16| {
        let (x, y) = (f32::from(i) / 128.0, f32::from(i % 10) / 100.0);
        let [a, b, c] = [[x, y, -1.0], [x + 1.0 / 128.0, y, -1.0], [x, y, 1.0]].map(Vec3::from_array);
        Triangle::new(a, b, c)
    };
    let triangles: Vec<Triangle> = (0..128).map(step).collect();
    let devices: Vec<Arc<dyn Device>> =
        CpuDevice::open_all(&[1, 1])?.into_iter().map(|device| Arc::new(device) as _).collect();
    let mut balancer = Balancer::new(Arc::new(build(&triangles)?), &devices)?;
    let above = |i: u32| Vec3::new((i % 128) as f32 / 128.0 + 0.001, 1.0, -0.5);
    let rays: Vec<Ray> = (0..100_000).map(|i| Ray::new(above(i), Vec3::NEG_Y)).collect();
    let mut hits = vec![Hit::MISS; rays.len()];
    let run = balancer.trace_rays(&rays, &mut hits)?;
    writeln!(stdout(), "{} rays over a tree of our own in {:.1} ms", rays.len(), 1e3 * run.report.makespan_s)?;
    assert!((0..).zip(&hits).all(|(i, hit): (u32, &Hit)| hit.primitive == i % 128));
    Ok(())
}

#[cfg(test)]
#[test]
fn runs() -> Result<(), Box<dyn std::error::Error>> {
    main()
}
