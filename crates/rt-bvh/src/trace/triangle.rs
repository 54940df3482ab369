//! Ray–triangle tests in three precisions.
//!
//! # The filter of [`Robust`]
//!
//! [`Robust`] gives the hits of [`Double`] bit for bit: it only rejects, in single precision, triangles that the line
//! certainly misses, and asks the test that decides, [`Shear`], about the others. A line misses a triangle where one of
//! the exact edge functions is negative and another positive, so it suffices to bound the error of the same functions
//! in single precision.
//!
//! Let u = 2⁻²⁴, and m the greatest distance along an axis from the origin to the scene's box (so every coordinate
//! relative to the origin is at most m). Lower-order terms are covered by rounding the factors up.
//!
//! * A relative coordinate is off by u·m (one subtraction; the origin is exact but where it is subnormal, by 2⁻¹⁵⁰).
//! * A shear factor s has |s| ≤ 1 and is off by u (one division). s·z is off by 3·u·m: from z, from s, from the
//!   product.
//! * A sheared coordinate, the difference, is off by D = u·m + 3·u·m + u·2m ≤ 6.5·u·m, and is at most 2.01·m.
//! * In an edge function cx·by − cy·bx, let X and Y bound the computed |x| and |y| of the triangle. Errors of the
//!   factors change it by 2D·(X + Y) + 2D². The two products and the difference round off 4·u·X·Y, and X·Y ≤ (X + Y)²/4
//!   ≤ 1.01·m·(X + Y). Together E ≤ (13 + 4.1)·u·m·(X + Y) + 85·u²·m² < 18·u·m·(X + Y + 5·u·m).
//!
//! So: an edge function below −E is negative in exact arithmetic as well, and one above E positive. Underflow is
//! harmless as m is kept above 2⁻⁴⁰, where E exceeds 2⁻¹²². Overflow is harmless as the filter is switched off (E = ∞)
//! for m above 2⁶⁰.

use super::slabs::{LocalRay, U};
use core::ops::ControlFlow;
use glam::{Vec3, Vec3A, Vec3Swizzles};
use rt_core::intersect::{Intersection, Shear, shear_axes};
use rt_core::{Hit, Triangle};

/// Tests a ray against triangles.
pub(super) trait TriangleTest {
    fn new(ray: &LocalRay) -> Self;

    /// Whether the whole line meets the triangle, and about where.
    fn intersect(&self, triangle: &Triangle) -> Option<Intersection>;

    /// The hit of an intersection with this `triangle`; `None` outside the inclusive `limits`.
    fn resolve(&self, met: &Intersection, triangle: &Triangle, limits: [f32; 2], primitive: u32) -> Option<Hit>;

    /// Calls `meet` with the position of each triangle that the whole line meets, and where, until it breaks.
    #[inline]
    fn leaf<F>(&self, triangles: &[Triangle], mut meet: F) -> ControlFlow<()>
    where
        F: FnMut(usize, &Intersection) -> ControlFlow<()>,
    {
        for (i, triangle) in triangles.iter().enumerate() {
            if let Some(intersection) = self.intersect(triangle) {
                meet(i, &intersection)?;
            }
        }
        ControlFlow::Continue(())
    }
}

/// One ray's numbers of the single-precision filter.
#[derive(Clone, Copy, Debug)]
struct Filter {
    origin: Vec3,
    /// The direction's dominant axis.
    dominant: usize,
    /// Shear factors, in single precision.
    shear: [f32; 2],
    /// 18·u·m, or ∞.
    error: f32,
    /// 5·u·m.
    floor: f32,
}

/// The test that decides, for every triangle.
pub(super) struct Double(Shear);

impl TriangleTest for Double {
    #[inline]
    fn new(ray: &LocalRay) -> Self {
        Self(Shear::new(&ray.given, ray.scale_exponent, ray.reach.into()))
    }

    #[inline]
    fn intersect(&self, triangle: &Triangle) -> Option<Intersection> {
        self.0.intersect(triangle)
    }

    #[inline]
    fn resolve(&self, met: &Intersection, triangle: &Triangle, limits: [f32; 2], primitive: u32) -> Option<Hit> {
        self.0.resolve(met, triangle, limits, primitive)
    }
}

/// The same behind a single-precision filter.
pub(super) struct Robust {
    exact: Double,
    filter: Filter,
}

/// Smallest m that rays have, and largest, for which the filter's arithmetic, and that of wide boxes, neither
/// underflows nor overflows.
pub(super) const REACH: [f32; 2] = [1.0 / (1_u64 << 40) as f32, (1_u64 << 60) as f32];

impl TriangleTest for Robust {
    #[inline]
    fn new(ray: &LocalRay) -> Self {
        let direction = ray.given.direction;
        let [x, y, dominant] = shear_axes(direction);
        let reach = ray.reach;
        let filter = Filter {
            origin: ray.origin,
            dominant,
            shear: [direction[x] / direction[dominant], direction[y] / direction[dominant]],
            error: if reach <= REACH[1] { 18.0 * U * reach } else { f32::INFINITY },
            floor: 5.0 * U * reach,
        };
        Self { exact: Double::new(ray), filter }
    }

    /// Without the filter.
    #[inline]
    fn intersect(&self, triangle: &Triangle) -> Option<Intersection> {
        self.exact.intersect(triangle)
    }

    #[inline]
    fn leaf<F>(&self, triangles: &[Triangle], meet: F) -> ControlFlow<()>
    where
        F: FnMut(usize, &Intersection) -> ControlFlow<()>,
    {
        // One loop for each dominant axis, so that coordinates are picked at compile time.
        match self.filter.dominant {
            0 => self.sift::<1, 2, 0, F>(triangles, meet),
            1 => self.sift::<2, 0, 1, F>(triangles, meet),
            _ => self.sift::<0, 1, 2, F>(triangles, meet),
        }
    }

    #[inline]
    fn resolve(&self, met: &Intersection, triangle: &Triangle, limits: [f32; 2], primitive: u32) -> Option<Hit> {
        self.exact.resolve(met, triangle, limits, primitive)
    }
}

impl Robust {
    #[inline(always)]
    fn sift<const X: usize, const Y: usize, const Z: usize, F>(
        &self,
        triangles: &[Triangle],
        mut meet: F,
    ) -> ControlFlow<()>
    where
        F: FnMut(usize, &Intersection) -> ControlFlow<()>,
    {
        for (i, triangle) in triangles.iter().enumerate() {
            if self.filter.misses::<X, Y, Z>(triangle) {
                continue;
            }
            if let Some(intersection) = self.intersect(triangle) {
                meet(i, &intersection)?;
            }
        }
        ControlFlow::Continue(())
    }
}

impl Filter {
    /// Whether the line certainly misses the triangle.
    #[inline(always)]
    fn misses<const X: usize, const Y: usize, const Z: usize>(&self, triangle: &Triangle) -> bool {
        // Lane by vertex. An edge function is named by the vertex opposite to its edge.
        let axis = |axis: usize| {
            let [a, b, c] = triangle.vertices().map(|p| p.to_array());
            Vec3A::new(a[axis], b[axis], c[axis]) - Vec3A::splat(self.origin[axis])
        };
        let (x, y, z) = (axis(X), axis(Y), axis(Z));
        let (x, y) = (x - z * self.shear[0], y - z * self.shear[1]);
        let edges = x.zxy() * y.yzx() - y.zxy() * x.yzx();
        let error = (x.abs().max_element() + y.abs().max_element() + self.floor) * self.error;
        // False for NaN, which only an overflow can have made.
        edges.cmplt(Vec3A::splat(-error)).any() && edges.cmpgt(Vec3A::splat(error)).any()
    }
}

/// T. Möller and B. Trumbore, *Fast, Minimum Storage Ray/Triangle Intersection* (1997), in single precision.
pub(super) struct Fast {
    origin: Vec3,
    direction: Vec3,
    t_scale: f64,
}

impl TriangleTest for Fast {
    #[inline]
    fn new(ray: &LocalRay) -> Self {
        Self { origin: ray.origin, direction: ray.direction, t_scale: ray.t_scale }
    }

    #[inline]
    fn intersect(&self, triangle: &Triangle) -> Option<Intersection> {
        let (ab, ac) = (triangle.b - triangle.a, triangle.c - triangle.a);
        let p = self.direction.cross(ac);
        let reciprocal = 1.0 / ab.dot(p);
        let s = self.origin - triangle.a;
        let u = s.dot(p) * reciprocal;
        let q = s.cross(ab);
        let v = self.direction.dot(q) * reciprocal;
        // False for NaN: a triangle seen edge-on is missed.
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| {
            let t = ac.dot(q) * reciprocal;
            Intersection { t: f64::from(t) * self.t_scale, error: 0.0, u: u.into(), v: v.into() }
        })
    }

    #[inline]
    fn resolve(&self, met: &Intersection, _triangle: &Triangle, limits: [f32; 2], primitive: u32) -> Option<Hit> {
        met.rounded(limits, primitive)
    }
}
