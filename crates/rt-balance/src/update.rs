//! Scenes that move: the tree is fitted or built anew, and what was learnt is kept.

use crate::device_state::{DeviceState, all_lost, dismiss, settle};
use crate::{BalanceError, Balancer, Control, Limits};
use rt_bvh::{BuildOptions, Mesh, TreeStats};
use rt_core::Scene;
use std::sync::Arc;

/// How many times as expensive as the tree that was built a fitted one may be, by the surface area heuristic: beyond,
/// it is built anew.
pub const MOST_GROWTH: f32 = 1.5;

/// How a balancer's tree came to fit the triangles again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Updated {
    /// Its boxes were fitted.
    Fitted,
    /// It was built anew: the triangles are others, or have moved so far that rays would pay for it.
    Rebuilt,
}

impl Balancer {
    /// Goes on with triangles that have moved, or with others: hits are those of a balancer made for them, bit for bit.
    /// Devices, their prices and estimators stay.
    ///
    /// Where the same triangles moved, the tree's boxes are fitted, unless that makes rays more than [`MOST_GROWTH`]
    /// times as expensive. Trees are built with the default options.
    ///
    /// # Errors
    /// When an index or a coordinate is invalid: then the scene is as before. When no device can take the scene: then
    /// none is left.
    pub fn update(&mut self, positions: &[[f32; 3]], indices: &[[u32; 3]]) -> Result<Updated, BalanceError> {
        let (mesh, options) = (Mesh::of_arrays(positions, indices), BuildOptions::default());
        let cost = |scene: &Scene| TreeStats::of(scene).sah_cost;
        let most = MOST_GROWTH * *self.built_cost.get_or_insert_with(|| cost(&self.scene));
        match rt_bvh::refit(&self.scene, mesh, &options)? {
            Some(scene) if cost(&scene) <= most => {
                self.replace_scene(scene)?;
                Ok(Updated::Fitted)
            }
            _ => {
                self.replace_scene(rt_bvh::build(mesh, &options)?.scene)?;
                self.built_cost = None;
                Ok(Updated::Rebuilt)
            }
        }
    }

    /// Goes on with another scene, of whatever builder. Devices, their prices and estimators stay.
    ///
    /// # Errors
    /// When no device can take the scene: then none is left.
    pub fn replace_scene(&mut self, scene: Arc<Scene>) -> Result<(), BalanceError> {
        let alive: Vec<bool> = self.members.iter().map(DeviceState::is_alive).collect();
        // Their memory is free before the next scene comes.
        dismiss(&mut self.members);
        for (index, device) in self.opened.iter().enumerate().filter(|(index, _)| alive[*index]) {
            let member = DeviceState::open(index, device, &scene)
                .map_err(|source| BalanceError::Thread { device: self.members[index].info.name.clone(), source })?;
            let before = std::mem::replace(&mut self.members[index], member);
            self.members[index].inherit(before);
        }
        self.scene = scene;
        settle(&mut self.members, &Limits::default(), Control::default())?;
        if self.members.iter().any(DeviceState::is_alive) { Ok(()) } else { Err(all_lost(&self.members, 0)) }
    }
}
