//! Writing down the wide tree that a plan describes, and putting the triangles in its order.

use super::WideNode;
use super::encode::{self, Entry, encode};
use crate::collapse::{Plan, WIDTH};
use alloc::vec;
use alloc::vec::Vec;
use rt_core::{Child, Scene, SceneParts};

/// The wide tree's nodes, and the order of its triangles.
#[derive(Debug)]
pub(super) struct Emitted {
    pub nodes: Vec<WideNode>,
    /// For each triangle in the new order, where it is in the scene's.
    pub slots: Vec<u32>,
    pub depth: u32,
}

/// Writes nodes depth first. The triangles of a node's leaves come side by side, then those below its children, one
/// child after the other: so the triangles of a two-wide leaf, which `collapse` never deals to two wide nodes other
/// than by giving it a subtree of its own, stay side by side and in order.
pub(super) fn emit(scene: &Scene, plan: &Plan) -> Emitted {
    let mut emitted =
        Emitted { nodes: vec![WideNode::EMPTY], slots: Vec::with_capacity(scene.triangles().len()), depth: 0 };
    // Nodes to be written: where, what, and how deep. The root is no part of anything.
    let mut open = vec![(0, plan.root(), 1)];
    let mut parts = Vec::with_capacity(WIDTH);
    while let Some((index, part, depth)) = open.pop() {
        emitted.depth = emitted.depth.max(depth);
        plan.children(scene, part, &mut parts);
        let first_triangle = emitted.slots.len() as u32;
        let entries: Vec<Entry> = parts
            .iter()
            .map(|part| {
                let before = emitted.slots.len();
                let bounds = part.gather(scene, &mut emitted.slots);
                Entry { bounds, triangles: (emitted.slots.len() - before) as u32 }
            })
            .collect();
        let slots = encode::places(&entries);
        let first_node = emitted.nodes.len() as u32;
        let node = encode(&entries, &slots, first_node, first_triangle);
        // The last one is written first.
        for (part, slot) in parts.iter().zip(slots).rev() {
            if part.is_node() {
                let place = (node.inner & ((1_u16 << slot) - 1) as u8).count_ones();
                open.push((first_node as usize + place as usize, *part, depth + 1));
            }
        }
        let children = node.inner.count_ones() as usize;
        emitted.nodes.resize(emitted.nodes.len() + children, WideNode::EMPTY);
        emitted.nodes[index] = node;
    }
    emitted
}

/// The scene with its triangles in another order, in which those of each leaf are still side by side.
pub(super) fn arrange(scene: &Scene, slots: &[u32]) -> Scene {
    let mut new = vec![0_u32; slots.len()];
    for (position, &slot) in (0..).zip(slots) {
        new[slot as usize] = position;
    }
    let mut nodes = scene.nodes().to_vec();
    for node in &mut nodes {
        for side in 0..2 {
            if let Child::Leaf { first, .. } = node.child(side) {
                node.child[side] = new[first as usize];
            }
        }
    }
    let parts = SceneParts {
        nodes,
        triangles: slots.iter().map(|&slot| scene.triangles()[slot as usize]).collect(),
        primitives: slots.iter().map(|&slot| scene.primitives().get(slot as usize)).collect(),
        scale_exponent: scene.scale_exponent(),
        primitive_count: scene.primitive_count(),
    };
    Scene::new(parts).expect("the same tree over the same triangles")
}
