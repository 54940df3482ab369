//! Scenes that move: the tree is fitted or built anew, and what was learnt is kept.

use crate::device_state::{DeviceState, all_lost, ask_all, dismiss, settle};
use crate::device_thread::Call;
use crate::{BalanceError, Balancer, Control, Limits, clock};
use rt_bvh::{BuildOptions, Mesh, TreeStats};
use rt_core::Scene;
use std::fmt;
use std::sync::Arc;

/// How many times as expensive as the tree that was built a fitted one may be, by the surface area heuristic: beyond,
/// it is built anew.
pub const MOST_GROWTH: f32 = 1.5;

/// What an update did, and what it took.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Update {
    /// How the tree came to fit the triangles again.
    pub tree: Updated,
    /// How many times as expensive as the tree that was built the fitted one is; `None` where it could not be fitted.
    pub growth: Option<f32>,
    /// Seconds of fitting the tree, or of finding out that it cannot be.
    pub fit_s: f64,
    /// Seconds of building another; 0 where it was not.
    pub build_s: f64,
    /// Seconds until all devices had the scene.
    pub bring_s: f64,
    /// Bytes of what had changed that devices were sent; nothing for those that share the host's memory, or had to take
    /// the scene anew.
    pub sent_bytes: u64,
}

/// How a balancer's tree came to fit the triangles again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Updated {
    /// Its boxes were fitted.
    Fitted,
    /// It was built anew.
    Rebuilt(Cause),
}

/// Why a tree was built anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Cause {
    /// The triangles are others: another number of them, or one that could not be hit and now can, or the other way
    /// round.
    OtherTriangles,
    /// They have moved so far apart that rays would pay more than [`MOST_GROWTH`] times as much.
    TooExpensive,
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OtherTriangles => f.write_str("the triangles are others"),
            Self::TooExpensive => write!(f, "fitted it would be more than {MOST_GROWTH} times as expensive"),
        }
    }
}

impl Balancer {
    /// Goes on with triangles that have moved, or with others: hits are those of a balancer made for them, bit for bit.
    /// Devices, their prices and estimators stay.
    ///
    /// Where the same triangles moved, the tree's boxes are fitted, unless that makes rays more than [`MOST_GROWTH`]
    /// times as expensive. Otherwise it is built as [`Balancer::building`] says. Masks and geometries stay with the ids
    /// of their primitives.
    ///
    /// # Errors
    /// When an index or a coordinate is invalid, or the scene has masks or geometries and the triangles are not as
    /// many: then the scene is as before. When no device can take the scene: then none is left.
    pub fn update(&mut self, positions: &[[f32; 3]], indices: &[[u32; 3]]) -> Result<Update, BalanceError> {
        let (mesh, options) = (Mesh::of_arrays(positions, indices), self.building);
        let cost = |scene: &Scene| TreeStats::of(scene).sah_cost;
        let built = *self.built_cost.get_or_insert_with(|| cost(&self.scene));
        let (fitted, fit_s) = timed(|| {
            let fitted = rt_bvh::refit(&self.scene, mesh, &options)?;
            Ok(fitted.map(|scene| (cost(&scene), scene)))
        })?;
        let growth = fitted.as_ref().map(|(cost, _)| if built > 0.0 { cost / built } else { 1.0 });
        let (tree, (scene, build_s)) = match fitted {
            Some((cost, scene)) if cost <= MOST_GROWTH * built => (Updated::Fitted, (scene, 0.0)),
            unfit => {
                let cause = if unfit.is_some() { Cause::TooExpensive } else { Cause::OtherTriangles };
                // Its memory is free before the next one is built.
                drop(unfit);
                let build = || {
                    let built = Arc::unwrap_or_clone(rt_bvh::build(mesh, &options)?.scene);
                    built.with_attributes_of(&self.scene).map(Arc::new).map_err(BalanceError::Attributes)
                };
                (Updated::Rebuilt(cause), timed(build)?)
            }
        };
        let (sent_bytes, bring_s) = timed(|| self.bring(scene))?;
        if tree != Updated::Fitted {
            self.built_cost = None;
        }
        Ok(Update { tree, growth, fit_s, build_s, bring_s, sent_bytes })
    }

    /// How [`Balancer::update`] builds trees; with the default options at first.
    pub const fn building(&mut self) -> &mut BuildOptions {
        &mut self.building
    }

    /// Goes on with another scene, of whatever builder. Devices, their prices and estimators stay.
    ///
    /// Of a scene with the same tree ([`Scene::has_tree_of`]) devices are brought what is new, if they can take that.
    ///
    /// # Errors
    /// When no device can take the scene: then none is left.
    pub fn replace_scene(&mut self, scene: Arc<Scene>) -> Result<(), BalanceError> {
        self.bring(scene).map(|_| ())
    }

    /// Brings a scene to the devices, and says how many bytes of what had changed they were sent.
    fn bring(&mut self, scene: Arc<Scene>) -> Result<u64, BalanceError> {
        let (limits, control) = (Limits::default(), Control::default());
        let follows = scene.has_tree_of(&self.scene);
        if follows {
            settle(&mut self.members, &limits, control)?;
        }
        self.members.iter_mut().for_each(DeviceState::begin);
        let anew: Vec<usize> =
            self.members.iter().filter(|m| m.is_alive() && !(follows && m.is_ready())).map(|m| m.index).collect();
        // Their memory is free before the next scene comes.
        dismiss(self.members.iter_mut().filter(|member| anew.contains(&member.index)));
        for index in anew {
            let member = DeviceState::open(index, &self.opened[index], &scene)
                .map_err(|source| BalanceError::Thread { device: self.members[index].info.name.clone(), source })?;
            let before = std::mem::replace(&mut self.members[index], member);
            self.members[index].inherit(before);
        }
        if follows {
            let device = |index: usize| Arc::clone(&self.opened[index]);
            let call = |index| Call::Move { scene: Arc::clone(&scene), device: device(index) };
            // Nobody refuses: a device that cannot follow takes the scene anew.
            ask_all(&mut self.members, call, &limits, control)?;
        }
        self.scene = scene;
        settle(&mut self.members, &limits, control)?;
        if !self.members.iter().any(DeviceState::is_alive) {
            return Err(all_lost(&self.members, 0));
        }
        Ok(self.members.iter().filter_map(DeviceState::traffic).map(|traffic| traffic.scene).sum())
    }
}

/// What comes of it, and the seconds that it takes.
fn timed<T>(work: impl FnOnce() -> Result<T, BalanceError>) -> Result<(T, f64), BalanceError> {
    let begin = clock::now();
    Ok((work()?, clock::now().saturating_sub(begin).as_secs_f64()))
}
