//! From a mesh to a checked [`Scene`]: gathering, normalising, building, and what came of it.

mod bounds;
mod draft;
mod fit;
mod gather;
mod meshes;
mod ploc;
mod refit;
mod reinsert;
mod sah;

use crate::parallel::{self, each};
use crate::{BuildOptions, Builder, Mesh};
use alloc::sync::Arc;
use alloc::vec::Vec;
use bytemuck::Zeroable;
use bytemuck::allocation::try_zeroed_vec;
use core::fmt;
use core::mem::take;
use core::ops::Range;
use fit::fit;
use gather::{Gathered, Reference};
use rt_core::{Node, Scene, SceneError, SceneParts};

pub use meshes::build_meshes;
pub use refit::refit;

/// Builds a scene from `mesh`.
///
/// Triangles without area are left out, since no ray can hit them. Primitive ids are positions in `mesh.indices`
/// whatever is left out. An empty mesh gives an empty scene.
///
/// # Errors
/// When an index is not below the number of positions, a coordinate is not finite (unless those triangles are to be
/// dropped), or there are too many triangles for 32-bit ids.
pub fn build(mesh: Mesh<'_>, options: &BuildOptions) -> Result<Built, BuildError> {
    build_with(mesh, options, &mut |_, _| true)
}

/// [`build`], with a word in between: `proceed` is told how much is done and how much there is, in triangles, and says
/// whether to go on. Where one builder gives up and another does its work, it begins at 0 again.
///
/// # Errors
/// Those of [`build`], and [`BuildError::Cancelled`] when `proceed` says no.
pub fn build_with(
    mesh: Mesh<'_>,
    options: &BuildOptions,
    proceed: &mut dyn FnMut(u32, u32) -> bool,
) -> Result<Built, BuildError> {
    let _environment = rt_fenv::Environment::enter();
    let mut gathered = gather::gather(mesh, options.invalid)?;
    let references = take(&mut gathered.references);
    let mut control = Control { proceed, done: 0, all: references.len() as u32, steps: 0, asked: 0 };
    let (tree, builder, fallback) = grow(references, options.builder, options.max_leaf.max(1), &mut control)?;
    let report = BuildReport {
        builder,
        fallback,
        steps: control.steps,
        threads: parallel::threads(),
        triangles: gathered.primitive_count,
        dropped_degenerate: gathered.dropped_degenerate,
        dropped_invalid: gathered.dropped_invalid,
    };
    Ok(Built { scene: Arc::new(finish(&gathered, tree)?), report })
}

/// Whoever wants to know how far a tree is built, and may stop it; and what it cost so far.
struct Control<'a> {
    proceed: &'a mut dyn FnMut(u32, u32) -> bool,
    done: u32,
    all: u32,
    steps: u64,
    /// Steps after which `proceed` was asked last.
    asked: u64,
}

/// Steps between two words: some tenths of a millisecond.
const WORD: u64 = 1 << 14;

impl Control<'_> {
    /// So many more steps were taken.
    fn worked(&mut self, steps: u64) -> Result<(), BuildError> {
        self.steps += steps;
        if self.steps - self.asked < WORD {
            return Ok(());
        }
        self.asked = self.steps;
        if (self.proceed)(self.done, self.all) { Ok(()) } else { Err(BuildError::Cancelled) }
    }

    /// So much of everything is done.
    fn reached(&mut self, part: f32) {
        self.done = self.all.min((self.all as f32 * part) as u32);
    }

    /// Nothing is done any more.
    fn restart(&mut self) {
        self.done = 0;
    }
}

/// Room for `more` entries, or an error that says for what and how many bytes.
fn reserve<T>(vector: &mut Vec<T>, more: usize, what: &'static str) -> Result<(), BuildError> {
    let bytes = ((vector.len() as u64).saturating_add(more as u64)).saturating_mul(size_of::<T>() as u64);
    vector.try_reserve(more).map_err(|_| BuildError::OutOfMemory { what, bytes })
}

/// Room for so many entries.
fn reserved<T>(count: usize, what: &'static str) -> Result<Vec<T>, BuildError> {
    let mut vector = Vec::new();
    reserve(&mut vector, count, what)?;
    Ok(vector)
}

/// `count` times `value`.
fn filled<T: Clone>(value: T, count: usize, what: &'static str) -> Result<Vec<T>, BuildError> {
    let mut vector = reserved(count, what)?;
    vector.resize(count, value);
    Ok(vector)
}

/// Zeros, which cost nothing until they are written to.
fn zeroed<T: Zeroable>(count: usize, what: &'static str) -> Result<Vec<T>, BuildError> {
    let bytes = (count as u64).saturating_mul(size_of::<T>() as u64);
    try_zeroed_vec(count).map_err(|()| BuildError::OutOfMemory { what, bytes })
}

/// Builds with `builder` or, where that fails, with [`Builder::Sah`]; says which and why.
fn grow(
    references: Vec<Reference>,
    builder: Builder,
    max_leaf: u32,
    control: &mut Control<'_>,
) -> Result<(Tree, Builder, Option<Fallback>), BuildError> {
    let (builder, fallback) = match builder {
        Builder::Sah | Builder::SahSlow => (builder, None),
        Builder::Ploc(quality) => {
            if let Some(tree) = ploc::build(&references, quality, max_leaf, control)? {
                return Ok((tree, builder, None));
            }
            control.restart();
            (Builder::Sah, Some(Fallback::TooDeep))
        }
    };
    let tree = sah::build(references, max_leaf, builder == Builder::SahSlow, control)?;
    Ok((tree, builder, fallback))
}

/// What a builder makes of references: nodes with their boxes, and the references' positions in leaf order.
struct Tree {
    nodes: Vec<Node>,
    order: Vec<u32>,
}

impl Tree {
    fn empty() -> Self {
        Self { nodes: alloc::vec![Node::EMPTY], order: Vec::new() }
    }
}

/// Triangles that a thread puts in order at a time.
const CHUNK: usize = 1 << 13;

/// Puts triangles and ids in leaf order, and has the scene check everything.
fn finish(gathered: &Gathered, tree: Tree) -> Result<Scene, BuildError> {
    let Gathered { triangles, primitives, .. } = gathered;
    let Tree { mut nodes, order } = tree;
    let mut in_order = zeroed(order.len(), "the triangles in the tree's order")?;
    let mut ids = zeroed(order.len(), "the ids of triangles")?;
    let places = in_order.chunks_mut(CHUNK).zip(ids.chunks_mut(CHUNK)).zip(order.chunks(CHUNK));
    each(places.collect(), |((in_order, ids), order)| {
        for ((triangle, id), &i) in in_order.iter_mut().zip(ids).zip(order) {
            (*triangle, *id) = (triangles[i as usize], primitives[i as usize]);
        }
    });
    if !gathered.exact_references {
        fit(&mut nodes, &in_order);
    }
    Scene::new(SceneParts {
        nodes,
        triangles: in_order,
        primitives: ids,
        scale_exponent: gathered.scale_exponent,
        primitive_count: gathered.primitive_count,
    })
    .map_err(faulty)
}

/// What was wrong with a tree when it was checked.
const fn faulty(error: SceneError) -> BuildError {
    match error {
        SceneError::OutOfMemory { bytes } => BuildError::OutOfMemory { what: "the check of the tree", bytes },
        defect => BuildError::Scene(defect),
    }
}

/// The numbers below `count` in ranges, each of which is one thread's.
fn parts(count: usize) -> Vec<Range<usize>> {
    (0..count).step_by(CHUNK).map(|first| first..count.min(first + CHUNK)).collect()
}

/// A scene and how it came about.
#[derive(Clone, Debug)]
pub struct Built {
    /// The scene, to be shared by all who trace it.
    pub scene: Arc<Scene>,
    /// How it was built.
    pub report: BuildReport,
}

/// Most [`BuildReport::steps`] of any builder for n ≥ 1,000 triangles, as a multiple of n log₂ n. What comes near it is
/// [`PlocQuality::VerySlow`](crate::PlocQuality::VerySlow) on nested boxes.
pub const MOST_STEPS: f64 = 100.0;

/// How a scene was built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BuildReport {
    /// The builder whose tree it is.
    pub builder: Builder,
    /// Why that is not the one asked for; `None` when it is.
    pub fallback: Option<Fallback>,
    /// Boxes that were binned, compared or visited: what building cost, the same on every machine, and for n triangles
    /// of any mesh at most [`MOST_STEPS`] n log₂ n.
    pub steps: u64,
    /// The threads there were for it.
    pub threads: usize,
    /// Number of triangles given.
    pub triangles: u32,
    /// Number of triangles left out because they have no area.
    pub dropped_degenerate: u32,
    /// Number of triangles left out because a coordinate is NaN or infinite.
    pub dropped_invalid: u32,
}

/// Why [`Builder::Sah`] was used instead of the builder asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Fallback {
    /// The tree came out deeper than a traversal may go.
    TooDeep,
}

impl fmt::Display for Fallback {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TooDeep => "its tree was too deep",
        })
    }
}

/// Why a mesh was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum BuildError {
    /// A triangle names a vertex that does not exist.
    IndexOutOfRange {
        /// The triangle.
        triangle: u32,
        /// The index it names.
        index: u32,
        /// Number of vertices there are.
        vertices: usize,
    },
    /// A triangle of one of several meshes names a vertex that the mesh does not have.
    IndexInMesh {
        /// The mesh, from 0.
        mesh: u32,
        /// The triangle, in its mesh.
        triangle: u32,
        /// The index it names.
        index: u32,
        /// Number of vertices of the mesh.
        vertices: usize,
    },
    /// Triangles have NaN or infinite coordinates.
    NotFinite {
        /// The first of them.
        first: u32,
        /// How many there are.
        triangles: u32,
    },
    /// More triangles than 32-bit ids can tell apart.
    TooManyTriangles {
        /// Number of triangles given.
        triangles: usize,
    },
    /// There is no memory.
    OutOfMemory {
        /// For what.
        what: &'static str,
        /// How many bytes it takes.
        bytes: u64,
    },
    /// Whoever asked for the tree wants it no more.
    Cancelled,
    /// The tree failed its check: a defect of this crate, not of the mesh.
    Scene(SceneError),
}

impl fmt::Display for BuildError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::IndexOutOfRange { triangle, index, vertices } => {
                write!(f, "triangle {triangle} names vertex {index}, but there are only {vertices} vertices")
            }
            Self::IndexInMesh { mesh, triangle, index, vertices } => write!(
                f,
                "mesh {mesh}: triangle {triangle} names vertex {index}, but the mesh has only {vertices} vertices"
            ),
            Self::NotFinite { first, triangles } => write!(
                f,
                "triangle {first} has a NaN or infinite coordinate ({triangles} such in all): mend the mesh, or have \
                 such triangles dropped"
            ),
            Self::TooManyTriangles { triangles } => {
                write!(f, "{triangles} triangles are too many: at most {} can have an id; split the mesh", u32::MAX)
            }
            Self::OutOfMemory { what, bytes } => write!(f, "no memory for {what}: {bytes} bytes are needed"),
            Self::Cancelled => write!(f, "building the tree was stopped"),
            Self::Scene(_) => write!(f, "the builder made a faulty tree; please report this"),
        }
    }
}

impl core::error::Error for BuildError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Scene(error) => Some(error),
            _ => None,
        }
    }
}
