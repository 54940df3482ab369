//! What to build from, and how.

use core::fmt;
use core::str::FromStr;
use glam::Vec3;

/// A triangle mesh, borrowed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Mesh<'a> {
    /// Vertex positions.
    pub positions: &'a [Vec3],
    /// For each triangle, the positions of its vertices in `positions`. A triangle's place here is its primitive id.
    pub indices: &'a [[u32; 3]],
}

impl<'a> Mesh<'a> {
    /// A mesh of positions that are kept as plain arrays. Nothing is copied.
    #[must_use]
    pub fn of_arrays(positions: &'a [[f32; 3]], indices: &'a [[u32; 3]]) -> Self {
        Self { positions: bytemuck::cast_slice(positions), indices }
    }
}

/// Which algorithm builds the tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Builder {
    /// Top-down by the surface area heuristic over binned centroids; then the largest fiftieth of all nodes is moved to
    /// where it costs less.
    #[default]
    Sah,
    /// The same with all nodes, twice: for scenes that are traced long. Scattered rays visit 2 to 18% fewer nodes than
    /// without either, and it takes about five times as long to build.
    SahSlow,
    /// Bottom-up locally ordered clustering and reinsertion.
    Ploc(PlocQuality),
}

/// How much is spent on clustering: the presets of the crate `obvhs` 0.4, from the fastest build to the fastest tree.
///
/// Its two slowest presets also split large triangles in space; that part is left out, since a triangle is in one leaf
/// only here.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum PlocQuality {
    /// `fastest_build`: one triangle per leaf, no reinsertion.
    Fastest,
    /// `very_fast_build`.
    VeryFast,
    /// `fast_build`.
    Fast,
    /// `medium_build`.
    #[default]
    Medium,
    /// `slow_build`, without spatial splits.
    Slow,
    /// `very_slow_build`, without spatial splits.
    VerySlow,
}

impl Builder {
    /// Every builder this build of the crate has, the default one first.
    pub const ALL: &'static [Self] = &[
        Self::Sah,
        Self::SahSlow,
        Self::Ploc(PlocQuality::Fastest),
        Self::Ploc(PlocQuality::VeryFast),
        Self::Ploc(PlocQuality::Fast),
        Self::Ploc(PlocQuality::Medium),
        Self::Ploc(PlocQuality::Slow),
        Self::Ploc(PlocQuality::VerySlow),
    ];

    /// The builder's name, as [`Builder::from_str`] reads it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sah => "sah",
            Self::SahSlow => "sah-slow",
            Self::Ploc(quality) => match quality {
                PlocQuality::Fastest => "ploc-fastest",
                PlocQuality::VeryFast => "ploc-very-fast",
                PlocQuality::Fast => "ploc-fast",
                PlocQuality::Medium => "ploc-medium",
                PlocQuality::Slow => "ploc-slow",
                PlocQuality::VerySlow => "ploc-very-slow",
            },
        }
    }
}

impl fmt::Display for Builder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Builder {
    type Err = UnknownBuilder;

    fn from_str(name: &str) -> Result<Self, UnknownBuilder> {
        Self::ALL.iter().copied().find(|builder| builder.name() == name).ok_or(UnknownBuilder)
    }
}

/// A name that is not a [`Builder`]'s; its message lists those that are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnknownBuilder;

impl fmt::Display for UnknownBuilder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "no such builder; there are")?;
        for (i, builder) in Builder::ALL.iter().enumerate() {
            write!(f, "{} {builder}", if i == 0 { "" } else { "," })?;
        }
        Ok(())
    }
}

impl core::error::Error for UnknownBuilder {}

/// What to do with triangles that have a NaN or infinite coordinate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum InvalidTriangles {
    /// Refuse the mesh.
    #[default]
    Refuse,
    /// Leave them out, count them, and go on.
    Drop,
}

/// How to build a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BuildOptions {
    /// The algorithm.
    pub builder: Builder,
    /// What to do with triangles that are not finite.
    pub invalid: InvalidTriangles,
    /// Most triangles in a leaf; 0 is treated as 1. Smaller leaves are made where that is expected to trace faster.
    pub max_leaf: u32,
}

impl Default for BuildOptions {
    /// [`Builder::Sah`], [`InvalidTriangles::Refuse`], leaves of at most 4 triangles.
    fn default() -> Self {
        Self { builder: Builder::Sah, invalid: InvalidTriangles::Refuse, max_leaf: 4 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;

    #[test]
    fn every_name_round_trips() {
        for &builder in Builder::ALL {
            assert_eq!(builder.to_string().parse(), Ok(builder));
        }
        let error = "embree".parse::<Builder>().expect_err("unknown");
        assert!(error.to_string().starts_with("no such builder; there are sah"));
    }
}
