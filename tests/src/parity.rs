//! Trees, devices and peers compared with the exact reference on whole scenes.

use crate::judge::{Tally, judge};
use crate::scenes;
use rayon::prelude::*;
use rt_bvh::{Stack, WideTree, trace_wide};
use rt_core::{
    Camera, Device, Hit, Launch, Precision, Query, Ray, RaySource, Scene, StreamSpec, Triangle, intersect, random,
    tasks_of,
};
use rt_verify::clock;
use rt_verify::rays::{Aim, RayMaker};
use rt_verify::reference::{Reference, Verdict};
use rt_verify::{exact, tree};
use std::sync::Arc;
use std::time::Duration;

/// Rays of one task: enough for several threads to share a launch.
const TASK: u32 = 1024;

/// The longest a device may take for all rays: a software rasteriser on a loaded machine is slow.
const LIMIT: Duration = Duration::from_secs(600);

/// Rays that share a pass over the triangles: enough that reading these from memory does not count.
const BATCH: usize = 32;

/// The aims of rays 0 to 11, and of every twelve after; `None` is a camera ray. A third are random in the sense that
/// nothing makes them pass near an edge.
const AIMS: [Option<Aim>; 12] = [
    Some(Aim::Interior),
    Some(Aim::Random),
    Some(Aim::Interior),
    None,
    Some(Aim::Edge),
    Some(Aim::Diffuse),
    Some(Aim::Interior),
    Some(Aim::Random),
    Some(Aim::Shadow),
    None,
    Some(Aim::Vertex),
    Some(Aim::Axis),
];

/// Rays on one scene and their right answers.
#[derive(Debug)]
pub struct Exam<'a> {
    triangles: &'a [Triangle],
    rays: Vec<(Ray, u32)>,
    /// The exact verdict, and the answer of brute force.
    answers: Vec<(Verdict, Hit)>,
}

/// On how many rays tracers of another definition than the exact one may differ.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ambiguity {
    /// Ambiguous rays of all aims; those aimed at edges and vertices are meant to be.
    pub all: usize,
    /// Rays that nothing aims at edges: see [`Kind::is_random`].
    pub random: usize,
    /// Those of them that meet two triangles at nearly one distance: a property of the scene.
    pub random_ties: usize,
    /// Those of them that are ambiguous for another reason.
    pub random_doubtful: usize,
}

/// Of how many random rays one may be ambiguous, but for ties in the scenes that are listed for them.
const AMBIGUOUS_ONE_IN: usize = 1000;

impl Ambiguity {
    /// Whether no more random rays are ambiguous than may be in this scene: one in a thousand, and one more, since few
    /// rays say little. In [`scenes::TIED`], ties do not count.
    #[must_use]
    pub fn is_admissible(&self, scene: &str) -> bool {
        let ties = if scenes::TIED.contains(&scene) { 0 } else { self.random_ties };
        self.random_doubtful + ties <= self.random / AMBIGUOUS_ONE_IN + 1
    }
}

/// How a tree did.
#[derive(Clone, Debug, Default)]
pub struct Marks {
    /// Rays that hit something.
    pub hits: usize,
    /// Answers that are not the right one, or whose numbers are not the defined ones. Must be 0.
    pub disagreements: usize,
    /// The first disagreement, for a person.
    pub first: Option<String>,
}

/// What a ray stands for, coarser than its [`Aim`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// From the camera; a random segment where there is none.
    Primary,
    /// To a light.
    Shadow,
    /// Off a surface.
    Diffuse,
    /// Random segments.
    Random,
    /// At the inside of a triangle.
    Interior,
    /// At edges and vertices, and along the axes.
    Adversarial,
}

impl Kind {
    /// All of them, in the order of their numbers.
    pub const ALL: [Self; 6] =
        [Self::Primary, Self::Shadow, Self::Diffuse, Self::Random, Self::Interior, Self::Adversarial];

    /// The kind of ray `index` of an [`Exam`].
    #[must_use]
    pub const fn of(index: usize) -> Self {
        match AIMS[index % AIMS.len()] {
            None => Self::Primary,
            Some(Aim::Shadow) => Self::Shadow,
            Some(Aim::Diffuse) => Self::Diffuse,
            Some(Aim::Random) => Self::Random,
            Some(Aim::Interior) => Self::Interior,
            Some(Aim::Edge | Aim::Vertex | Aim::Axis) => Self::Adversarial,
        }
    }

    /// Whether nothing makes such rays pass near an edge.
    #[must_use]
    pub const fn is_random(self) -> bool {
        matches!(self, Self::Primary | Self::Random)
    }

    /// The name that reports use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Primary => "primary",
            Self::Shadow => "shadow",
            Self::Diffuse => "diffuse",
            Self::Random => "random",
            Self::Interior => "interior",
            Self::Adversarial => "adversarial",
        }
    }
}

/// Traces rays, each with the primitive it starts on (`u32::MAX`: none), on a device in one launch.
///
/// # Errors
/// The device's message.
pub fn trace_all(
    device: &dyn Device,
    scene: &Arc<Scene>,
    rays: &[(Ray, u32)],
    spec: StreamSpec,
) -> Result<Vec<Hit>, String> {
    let named = |e: rt_core::DeviceError| format!("{}: {e}", device.info().name);
    let mut tracer = device.tracer(Arc::clone(scene), clock).map_err(named)?;
    let (rays, origins): (Vec<Ray>, Vec<u32>) = rays.iter().copied().unzip();
    let tasks = tasks_of(rays.len() as u32, TASK);
    let expected = rays.len();
    tracer.load_rays(RaySource::Explicit { rays: rays.into(), origins: Some(origins.into()) }, spec).map_err(named)?;
    let ticket = tracer.submit(&tasks, None).map_err(named)?;
    let mut launch = Launch::default();
    tracer.wait(ticket, LIMIT, &mut launch).map_err(named)?;
    if launch.hits.len() != expected {
        return Err(format!("{}: {} hits of {expected} rays", device.info().name, launch.hits.len()));
    }
    Ok(launch.hits)
}

impl<'a> Exam<'a> {
    /// Makes `rays` rays and resolves them, on all cores.
    #[must_use]
    pub fn new(triangles: &'a [Triangle], camera: Option<&Camera>, rays: u32, seed: u32) -> Self {
        let maker = RayMaker::new(triangles, seed);
        let make = |i: u32| match (AIMS[i as usize % AIMS.len()], camera) {
            (Some(aim), _) => maker.ray(aim, i),
            (None, Some(camera)) => {
                let [x, y] = random::pair(seed, i, 9);
                (camera.ray(x, y, 1.6), u32::MAX)
            }
            (None, None) => maker.ray(Aim::Random, i),
        };
        let rays: Vec<_> = (0..rays).map(make).collect();
        let reference = Reference::new(triangles);
        let answers = rays.par_chunks(BATCH).flat_map_iter(|batch| reference.answers(batch)).collect();
        Self { triangles, rays, answers }
    }

    /// Number of rays.
    #[must_use]
    pub fn rays(&self) -> usize {
        self.rays.len()
    }

    /// How many rays are ambiguous to tracers of other definitions.
    #[must_use]
    pub fn ambiguity(&self) -> Ambiguity {
        let mut found = Ambiguity::default();
        for (i, (verdict, _)) in self.answers.iter().enumerate() {
            let random = usize::from(Kind::of(i).is_random());
            found.random += random;
            if verdict.is_ambiguous() {
                found.all += 1;
                if verdict.is_tie() {
                    found.random_ties += random;
                } else {
                    found.random_doubtful += random;
                }
            }
        }
        found
    }

    /// Puts the rays to a scene's own tree, the two-wide one.
    #[must_use]
    pub fn mark(&self, scene: &Scene, query: Query, precision: Precision) -> Marks {
        let spec = StreamSpec::new(query, precision, false);
        let hits: Vec<Hit> =
            self.rays.par_chunks(1024).flat_map_iter(|rays| tree::trace(scene, spec, rays).0).collect();
        self.mark_hits(&hits, query)
    }

    /// The same for the eight-wide tree of a scene.
    #[must_use]
    pub fn mark_wide(&self, tree: &WideTree, query: Query, precision: Precision) -> Marks {
        let spec = StreamSpec::new(query, precision, false);
        let trace = |rays: &[(Ray, u32)]| {
            let mut hits = Vec::with_capacity(rays.len());
            trace_wide(tree, &mut Stack::default(), spec, rays.iter().copied(), |hit, _| hits.push(hit));
            hits
        };
        let hits: Vec<Hit> = self.rays.par_chunks(1024).flat_map_iter(trace).collect();
        self.mark_hits(&hits, query)
    }

    /// Puts the rays to a device.
    ///
    /// # Errors
    /// The device's message.
    pub fn ask(&self, device: &dyn Device, scene: &Arc<Scene>, spec: StreamSpec) -> Result<Vec<Hit>, String> {
        trace_all(device, scene, &self.rays, spec)
    }

    /// Marks the answers, in the order of the rays, of a tracer that must give the defined numbers.
    #[must_use]
    pub fn mark_hits(&self, hits: &[Hit], query: Query) -> Marks {
        let mut marks = Marks { hits: hits.iter().filter(|hit| hit.is_hit()).count(), ..Marks::default() };
        for (((ray, _), (verdict, brute)), hit) in self.rays.iter().zip(&self.answers).zip(hits) {
            let right = self.is_defined(ray, hit)
                && match query {
                    Query::Closest | Query::All { .. } => verdict.is_right(hit) && hit == brute,
                    Query::Any => verdict.right().is_some() == hit.is_hit(),
                };
            if !right {
                marks.disagreements += 1;
                marks.first.get_or_insert_with(|| {
                    format!("{query:?}, {ray:?}: {hit:?}, but {verdict}; brute force says {brute:?}")
                });
            }
        }
        marks
    }

    /// Judges the answers, in the order of the rays, of a tracer that works in single precision: one tally for each of
    /// [`Kind::ALL`].
    #[must_use]
    pub fn judge(&self, hits: &[Hit], query: Query) -> [Tally; Kind::ALL.len()] {
        let mut tallies = [const { Tally::new() }; Kind::ALL.len()];
        for (i, (((ray, origin), (verdict, _)), hit)) in self.rays.iter().zip(&self.answers).zip(hits).enumerate() {
            let finding = judge(self.triangles, ray, *origin, query, verdict, hit);
            let describe = || format!("{query:?}, {ray:?}: {hit:?}, {finding:?}, but {verdict:?}");
            tallies[Kind::of(i) as usize].add(finding, describe);
        }
        tallies
    }

    /// Whether a hit's numbers are those of its triangle; those of the distance, in whole numbers as well.
    fn is_defined(&self, ray: &Ray, hit: &Hit) -> bool {
        match self.triangles.get(hit.primitive as usize) {
            Some(triangle) => {
                intersect::hit(ray, triangle, hit.primitive).as_ref() == Some(hit)
                    && exact::hit(ray, triangle) == Some(hit.t)
            }
            None => *hit == Hit::MISS,
        }
    }
}
