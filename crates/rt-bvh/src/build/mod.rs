//! From a mesh to a checked [`Scene`]: gathering, normalising, building, and what came of it.

mod gather;
#[cfg(feature = "obvhs")]
mod ploc;
mod sah;

use crate::{BuildOptions, Builder, Mesh};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt;
use gather::Gathered;
use rt_core::{Aabb, Child, Node, Scene, SceneError, SceneParts};

/// Builds a scene from `mesh`.
///
/// Triangles without area are left out, since no ray can hit them. Primitive ids are positions in `mesh.indices`
/// whatever is left out. An empty mesh gives an empty scene.
///
/// # Errors
/// When an index is not below the number of positions, a coordinate is not finite (unless those triangles are to be
/// dropped), or there are too many triangles for 32-bit ids.
pub fn build(mesh: Mesh<'_>, options: &BuildOptions) -> Result<Built, BuildError> {
    let _environment = rt_fenv::Environment::enter();
    let gathered = gather::gather(mesh, options.invalid)?;
    let (scene, builder, fallback) = grow(&gathered, options.builder, options.max_leaf.max(1))?;
    let report = BuildReport {
        builder,
        fallback,
        triangles: gathered.primitive_count,
        dropped_degenerate: gathered.dropped_degenerate,
        dropped_invalid: gathered.dropped_invalid,
    };
    Ok(Built { scene: Arc::new(scene), report })
}

/// Builds with `builder` or, where that fails, with [`Builder::Sah`]; says which and why.
fn grow(
    gathered: &Gathered,
    builder: Builder,
    max_leaf: u32,
) -> Result<(Scene, Builder, Option<Fallback>), BuildError> {
    let fallback = match builder {
        Builder::Sah => None,
        #[cfg(feature = "obvhs")]
        Builder::Ploc(quality) => {
            let scene = ploc::build(&gathered.references, quality, max_leaf).and_then(|tree| {
                // Too deep a tree is found by the scene's own check.
                finish(gathered, tree).map_err(|_| Fallback::TooDeep)
            });
            match scene {
                Ok(scene) => return Ok((scene, builder, None)),
                Err(reason) => Some(reason),
            }
        }
    };
    let scene = finish(gathered, sah::build(&gathered.references, max_leaf))?;
    Ok((scene, Builder::Sah, fallback))
}

/// What a builder makes of references: nodes with their boxes, and the references' positions in leaf order.
struct Tree {
    nodes: Vec<Node>,
    order: Vec<u32>,
}

/// Puts triangles and ids in leaf order, and has the scene check everything.
fn finish(gathered: &Gathered, tree: Tree) -> Result<Scene, BuildError> {
    let Gathered { triangles, primitives, .. } = gathered;
    let Tree { mut nodes, order } = tree;
    if !gathered.exact_references {
        fit(&mut nodes, &order, |i| triangles[i as usize].bounds());
    }
    Scene::new(SceneParts {
        nodes,
        triangles: order.iter().map(|&i| triangles[i as usize]).collect(),
        primitives: order.iter().map(|&i| primitives[i as usize]).collect(),
        scale_exponent: gathered.scale_exponent,
        primitive_count: gathered.primitive_count,
    })
    .map_err(BuildError::Scene)
}

/// Fits all boxes to those of what is in the leaves.
fn fit(nodes: &mut [Node], order: &[u32], bounds: impl Fn(u32) -> Aabb) {
    // Children come after their parents.
    for node in (0..nodes.len()).rev() {
        for side in 0..2 {
            nodes[node].bounds[side] = match nodes[node].child(side) {
                Child::Absent => Aabb::EMPTY,
                Child::Inner(child) => nodes[child as usize].bounds.iter().fold(Aabb::EMPTY, |all, b| all.union(*b)),
                Child::Leaf { first, count } => {
                    order[first as usize..][..count as usize].iter().fold(Aabb::EMPTY, |all, &i| all.union(bounds(i)))
                }
            };
        }
    }
}

/// A scene and how it came about.
#[derive(Clone, Debug)]
pub struct Built {
    /// The scene, to be shared by all who trace it.
    pub scene: Arc<Scene>,
    /// How it was built.
    pub report: BuildReport,
}

/// How a scene was built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BuildReport {
    /// The builder whose tree it is.
    pub builder: Builder,
    /// Why that is not the one asked for; `None` when it is.
    pub fallback: Option<Fallback>,
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
    /// There are fewer than three triangles, where every builder makes the same tree.
    FewTriangles,
    /// So many triangles share their centroid that clustering would take quadratic time.
    EqualCentroids,
    /// The tree came out deeper than a traversal may go.
    TooDeep,
}

impl fmt::Display for Fallback {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::FewTriangles => "fewer than three triangles",
            Self::EqualCentroids => "too many triangles with the same centroid",
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
    /// The tree failed its check: a defect of this crate, not of the mesh.
    Scene(SceneError),
}

impl fmt::Display for BuildError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::IndexOutOfRange { triangle, index, vertices } => {
                write!(f, "triangle {triangle} names vertex {index}, but there are only {vertices} vertices")
            }
            Self::NotFinite { first, triangles } => write!(
                f,
                "triangle {first} has a NaN or infinite coordinate ({triangles} such in all): mend the mesh, or have \
                 such triangles dropped"
            ),
            Self::TooManyTriangles { triangles } => {
                write!(f, "{triangles} triangles are too many: at most {} can have an id; split the mesh", u32::MAX)
            }
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
