//! Rays, hits, triangles and counts: the plain data that crosses to a device.

use bytemuck::{Pod, Zeroable};
use core::num::NonZero;
use glam::Vec3;

/// A ray segment: the points `origin + t · direction` with `tmin ≤ t ≤ tmax`.
///
/// The direction need not have unit length; `t` counts in its length. 32 bytes, the layout of one row of the
/// `N × 8` float32 array that `raybalance trace` reads.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Ray {
    /// Where `t = 0`.
    pub origin: Vec3,
    /// Smallest accepted `t`.
    pub tmin: f32,
    /// Direction, of any finite length but zero.
    pub direction: Vec3,
    /// Largest accepted `t`; `+∞` is valid.
    pub tmax: f32,
}

impl Ray {
    /// The half line from `origin` along `direction`: `tmin = 0`, `tmax = ∞`.
    #[must_use]
    pub const fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, tmin: 0.0, direction, tmax: f32::INFINITY }
    }

    /// The same ray limited to `tmin ≤ t ≤ tmax`.
    #[must_use]
    pub const fn with_range(mut self, tmin: f32, tmax: f32) -> Self {
        self.tmin = tmin;
        self.tmax = tmax;
        self
    }

    /// Whether the ray can hit anything: finite origin and direction, a direction that is not zero, `tmin ≤ tmax`.
    /// An invalid ray is never an error; it misses.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        self.origin.is_finite() && self.direction.is_finite() && self.direction != Vec3::ZERO && self.tmin <= self.tmax
    }

    /// The point at `t`, rounded to single precision.
    #[must_use]
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + self.direction * t
    }
}

/// The nearest intersection of a ray, or [`Hit::MISS`]. 16 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Hit {
    /// Distance in units of the ray's direction; `+∞` for a miss.
    pub t: f32,
    /// Barycentric weight of the second vertex; 0 for a miss.
    pub u: f32,
    /// Barycentric weight of the third vertex; 0 for a miss.
    pub v: f32,
    /// Index of the triangle in the caller's index buffer; `u32::MAX` for a miss.
    pub primitive: u32,
}

impl Hit {
    /// No intersection: `t = ∞`, `primitive = u32::MAX`.
    pub const MISS: Self = Self { t: f32::INFINITY, u: 0.0, v: 0.0, primitive: u32::MAX };

    /// Whether the ray met a triangle.
    #[must_use]
    pub const fn is_hit(&self) -> bool {
        self.primitive != u32::MAX
    }

    /// The total order that makes ties deterministic: nearer first, then the lower primitive id.
    #[must_use]
    pub fn is_before(&self, other: &Self) -> bool {
        self.t < other.t || (self.t == other.t && self.primitive < other.primitive)
    }
}

/// Three vertices, 36 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Triangle {
    /// First vertex, `A`.
    pub a: Vec3,
    /// Second vertex, `B` (weight `u`).
    pub b: Vec3,
    /// Third vertex, `C` (weight `v`).
    pub c: Vec3,
}

impl Triangle {
    /// The triangle with vertices `a`, `b`, `c`.
    #[must_use]
    pub const fn new(a: Vec3, b: Vec3, c: Vec3) -> Self {
        Self { a, b, c }
    }

    /// The three vertices in order.
    #[must_use]
    pub const fn vertices(&self) -> [Vec3; 3] {
        [self.a, self.b, self.c]
    }

    /// Whether every coordinate is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.a.is_finite() && self.b.is_finite() && self.c.is_finite()
    }

    /// `(B − A) × (C − A)` in double precision: twice the area, along the normal. Not normalised.
    #[must_use]
    pub fn area_normal(&self) -> glam::DVec3 {
        let a = self.a.as_dvec3();
        (self.b.as_dvec3() - a).cross(self.c.as_dvec3() - a)
    }

    /// Smallest box around the vertices.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        Aabb { min: self.a.min(self.b).min(self.c), max: self.a.max(self.b).max(self.c) }
    }

    /// Every vertex multiplied by `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f32) -> Self {
        Self { a: self.a * factor, b: self.b * factor, c: self.c * factor }
    }
}

/// An axis-aligned box, 24 bytes. Empty when any `min > max`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Aabb {
    /// Smallest corner.
    pub min: Vec3,
    /// Largest corner.
    pub max: Vec3,
}

impl Aabb {
    /// The box that holds nothing and is the identity of [`Aabb::union`]. Finite, so that it may reach shaders.
    pub const EMPTY: Self = Self { min: Vec3::MAX, max: Vec3::MIN };

    /// Smallest box around both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Smallest box around this one and a point.
    #[must_use]
    pub fn with_point(self, point: Vec3) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    /// Whether the box holds nothing.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.min.cmpgt(self.max).any()
    }

    /// Edge lengths; negative when empty.
    #[must_use]
    pub fn extent(&self) -> Vec3 {
        self.max - self.min
    }

    /// Half the surface area, the quantity the surface area heuristic compares; 0 when empty.
    #[must_use]
    pub fn half_area(&self) -> f32 {
        let e = self.extent().max(Vec3::ZERO);
        e.x * (e.y + e.z) + e.y * e.z
    }

    /// Whether `other` lies inside, boundaries included. An empty box lies inside everything.
    #[must_use]
    pub fn contains(&self, other: &Self) -> bool {
        other.is_empty() || (self.min.cmple(other.min).all() && self.max.cmpge(other.max).all())
    }
}

/// How many box tests and triangle tests a traversal made: the unit of device-independent cost. 8 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct TestCounts {
    /// Ray–box tests; a two-wide node costs two.
    pub boxes: u32,
    /// Ray–triangle tests; a leaf costs as many as it holds triangles.
    pub triangles: u32,
}

/// What a stream asks of each ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Query {
    /// The nearest hit; ties go to the lowest primitive id.
    #[default]
    Closest,
    /// Whether anything is hit. The returned hit is one of the candidates, not always the nearest.
    Any,
    /// The nearest hits, in the order of [`Hit::is_before`]: every triangle that the ray meets, or the first `most` of
    /// them. Each ray has so many places in a row; those beyond its hits are misses.
    All {
        /// Places of a ray.
        most: NonZero<u32>,
    },
}

impl Query {
    /// Places for hits that each ray has: 1, but for [`Query::All`].
    #[inline]
    #[must_use]
    pub const fn hits_per_ray(self) -> usize {
        match self {
            Self::Closest | Self::Any => 1,
            Self::All { most } => most.get() as usize,
        }
    }
}

/// How carefully a ray is tested against triangles and boxes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Precision {
    /// Single-precision tests whose every doubtful sign is decided in double precision or exactly, conservative boxes:
    /// the same hits as [`Precision::Double`], watertight, at near the price of [`Precision::Fast`].
    #[default]
    Robust,
    /// Möller–Trumbore and plain slabs in single precision. Leaks on shared edges; only on request.
    Fast,
    /// Every triangle test in double precision, conservative boxes.
    Double,
}

impl Precision {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Robust, Self::Fast, Self::Double];

    /// The name that command lines and reports use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Robust => "robust",
            Self::Fast => "fast",
            Self::Double => "f64",
        }
    }
}

/// How far a ray is followed when only its cost is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Walk {
    /// Full traversal: exact counts, and hits worth keeping.
    Full,
    /// Reduced traversal: box and triangle tests are counted, triangles are not touched.
    Reduced(ReducedWalk),
}

/// What a reduced traversal does where a triangle would have shortened the ray. The paper does not say which it
/// meant: these are its two readings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ReducedWalk {
    /// A leaf entered counts as the hit: the ray is cut where it enters the leaf's box.
    #[default]
    LeafAsHit,
    /// The ray is never shortened: every leaf it passes is counted.
    Unshortened,
}

impl ReducedWalk {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::LeafAsHit, Self::Unshortened];
}
