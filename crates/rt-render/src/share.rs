//! A scene that rank 0 has prepared, sent to the others: they need neither its file nor the time to build its tree.

use crate::memory::{self, NoMemory};
use bytemuck::Zeroable;
use glam::{DVec3, Vec3};
use rt_cluster::{ClusterError, Relay};
use rt_core::{Node, Precision, Scene, SceneError, SceneParts, Triangle};
use rt_scene::prepare::Prepared;
use rt_scene::{Colours, View};
use serde::{Deserialize, Serialize};
use std::error::Error;
use std::fmt;
use std::sync::Arc;

/// What is rendered, as far as pixels depend on it: a scene with its colours.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The triangles and their tree.
    pub scene: Arc<Scene>,
    /// The colours of the triangles.
    pub colours: Colours,
    /// How carefully rays are tested.
    pub precision: Precision,
    /// Length of the diagonal of its bounds.
    pub extent: f32,
    /// What was subtracted from the coordinates of its file.
    pub offset: DVec3,
}

/// All of it but what is long, and the view that shows it well.
#[derive(Debug, Serialize, Deserialize)]
struct Head {
    nodes: usize,
    triangles: usize,
    scale_exponent: i32,
    primitive_count: u32,
    palette: Vec<[f32; 3]>,
    colours: usize,
    precision: usize,
    extent: f32,
    offset: [f64; 3],
    /// Eye, target and up.
    view: [[f32; 3]; 3],
    fov_degrees: f32,
}

impl Subject {
    /// A scene that is ready to be traced; the model's own triangles go here.
    #[must_use]
    pub fn of(prepared: Prepared) -> Self {
        let Prepared { model, built, precision, .. } = prepared;
        let (extent, offset) = (model.bounds().extent().length(), model.offset);
        Self { scene: built.scene, colours: model.into_colours(), precision, extent, offset }
    }

    /// On rank 0: sends it to all others, with the view that shows it well.
    ///
    /// # Errors
    /// When this rank is cut off, or is to stop.
    pub fn send(&self, view: &View, relay: &mut Relay<'_>) -> Result<(), ClusterError> {
        let scene = &self.scene;
        let primitives: Vec<u32> = (0..scene.primitives().len()).map(|slot| scene.primitives().get(slot)).collect();
        let head = Head {
            nodes: scene.nodes().len(),
            triangles: scene.triangles().len(),
            scale_exponent: scene.scale_exponent(),
            primitive_count: scene.primitive_count(),
            palette: self.colours.palette().iter().map(Vec3::to_array).collect(),
            colours: self.colours.indices().len(),
            precision: Precision::ALL.iter().position(|&precision| precision == self.precision).unwrap_or_default(),
            extent: self.extent,
            offset: self.offset.to_array(),
            view: [view.eye, view.target, view.up].map(|point| point.to_array()),
            fov_degrees: view.fov_degrees,
        };
        relay.tell(&Some(head))?;
        relay.send(bytemuck::cast_slice(scene.nodes()))?;
        relay.send(bytemuck::cast_slice(scene.triangles()))?;
        relay.send(bytemuck::cast_slice(&primitives))?;
        relay.send(bytemuck::cast_slice(self.colours.indices()))
    }

    /// On rank 0: tells all others that there will be none, so that they do not wait.
    ///
    /// # Errors
    /// When this rank is cut off, or is to stop.
    pub fn give_up(relay: &mut Relay<'_>) -> Result<(), ClusterError> {
        relay.tell(&None::<Head>)
    }

    /// On any other rank: the same as rank 0 has, and the view. The scene is checked like one from a builder.
    ///
    /// # Errors
    /// When rank 0 has none, there is no memory, what came is no scene, or this rank is cut off or to stop.
    pub fn receive(relay: &mut Relay<'_>) -> Result<(Self, View), ShareError> {
        let head: Head = relay.hear::<Option<Head>>()?.ok_or(ShareError::NoScene)?;
        let mut nodes = memory::filled(Node::zeroed(), head.nodes, "the nodes of the scene")?;
        relay.receive(bytemuck::cast_slice_mut(&mut nodes))?;
        let mut triangles = memory::filled(Triangle::zeroed(), head.triangles, "the triangles of the scene")?;
        relay.receive(bytemuck::cast_slice_mut(&mut triangles))?;
        let mut primitives = memory::filled(0_u32, head.triangles, "the ids of the scene")?;
        relay.receive(bytemuck::cast_slice_mut(&mut primitives))?;
        let mut colours = memory::filled(0_u16, head.colours, "the colours of the scene")?;
        relay.receive(bytemuck::cast_slice_mut(&mut colours))?;
        let Head { scale_exponent, primitive_count, extent, fov_degrees, .. } = head;
        let scene = Scene::new(SceneParts { nodes, triangles, primitives, scale_exponent, primitive_count })?;
        let palette = head.palette.into_iter().map(Vec3::from).collect();
        let [eye, target, up] = head.view.map(Vec3::from);
        let subject = Self {
            scene: Arc::new(scene),
            colours: Colours::new(palette, colours),
            precision: Precision::ALL.get(head.precision).copied().unwrap_or_default(),
            extent,
            offset: head.offset.into(),
        };
        Ok((subject, View { eye, target, up, fov_degrees }))
    }
}

/// Why this rank did not get the scene.
#[derive(Debug)]
#[non_exhaustive]
pub enum ShareError {
    /// Rank 0 has none.
    NoScene,
    /// This rank has no memory for it.
    NoMemory(NoMemory),
    /// What came is none.
    Scene(SceneError),
    /// This rank is cut off, or is to stop.
    Cluster(ClusterError),
}

impl fmt::Display for ShareError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoScene => write!(f, "rank 0 has no scene to send"),
            Self::NoMemory(error) => error.fmt(f),
            Self::Scene(_) => write!(f, "what rank 0 sent is no scene: start the same program on all nodes"),
            Self::Cluster(error) => error.fmt(f),
        }
    }
}

impl Error for ShareError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Self::Scene(error) => Some(error),
            Self::Cluster(error) => error.source(),
            Self::NoScene | Self::NoMemory(_) => None,
        }
    }
}

impl From<NoMemory> for ShareError {
    fn from(error: NoMemory) -> Self {
        Self::NoMemory(error)
    }
}

impl From<SceneError> for ShareError {
    fn from(error: SceneError) -> Self {
        Self::Scene(error)
    }
}

impl From<ClusterError> for ShareError {
    fn from(error: ClusterError) -> Self {
        Self::Cluster(error)
    }
}
