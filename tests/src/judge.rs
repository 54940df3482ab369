//! Who is right where tracers differ: answers of tracers that work in single precision, put to the exact reference.
//!
//! [`Verdict::is_right`] is for tracers that keep our definition of a hit. Others (Embree, obvhs, our own `fast`)
//! promise less: of hits at one distance any, a `t` that is as exact as their arithmetic, and of rays that come within
//! [`rt_verify::exact::NEARNESS`] of an edge either answer. So an answer of theirs is right, another of tied hits, or
//! an [`Error`] of a named kind.

use rt_core::{Hit, Query, Ray, Triangle};
use rt_verify::reference::{Nearest, Verdict, meeting};
use std::fmt;

/// Rounding error of one operation in single precision.
const U: f64 = 1.0 / (1 << 24) as f64;

/// What an answer is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Finding {
    /// What the exact reference says, or what it admits.
    Right,
    /// A triangle that is hit at the distance of the right one, to within the reference's tolerances: a tie.
    Tie,
    /// Wrong.
    Wrong(Error),
}

/// What is wrong with an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// Something is certainly hit, and nothing was reported.
    FalseMiss,
    /// The reported triangle is certainly not hit between the limits, or is the one that the ray starts on.
    FalseHit,
    /// The reported triangle is hit, but another one is certainly nearer.
    Order,
    /// The reported distance is farther from the exact one than rounding can bring it: see [`t_bound`].
    Distance,
}

/// How many answers were what.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Rays.
    pub rays: usize,
    /// Of these, [`Finding::Tie`].
    pub ties: usize,
    /// Of these, [`Error::FalseMiss`].
    pub false_misses: usize,
    /// Of these, [`Error::FalseHit`].
    pub false_hits: usize,
    /// Of these, [`Error::Order`].
    pub order: usize,
    /// Of these, [`Error::Distance`].
    pub distance: usize,
    /// The first wrong answer, for a person.
    pub first: Option<String>,
}

impl Tally {
    /// No rays.
    #[must_use]
    pub const fn new() -> Self {
        Self { rays: 0, ties: 0, false_misses: 0, false_hits: 0, order: 0, distance: 0, first: None }
    }

    /// Wrong answers of all kinds.
    #[must_use]
    pub const fn errors(&self) -> usize {
        self.false_misses + self.false_hits + self.order + self.distance
    }

    /// Takes in one more answer.
    pub fn add(&mut self, finding: Finding, describe: impl FnOnce() -> String) {
        self.rays += 1;
        match finding {
            Finding::Right => return,
            Finding::Tie => {
                self.ties += 1;
                return;
            }
            Finding::Wrong(Error::FalseMiss) => self.false_misses += 1,
            Finding::Wrong(Error::FalseHit) => self.false_hits += 1,
            Finding::Wrong(Error::Order) => self.order += 1,
            Finding::Wrong(Error::Distance) => self.distance += 1,
        }
        self.first.get_or_insert_with(describe);
    }

    /// Adds another tally.
    pub fn merge(&mut self, other: Self) {
        self.rays += other.rays;
        self.ties += other.ties;
        self.false_misses += other.false_misses;
        self.false_hits += other.false_hits;
        self.order += other.order;
        self.distance += other.distance;
        self.first = self.first.take().or(other.first);
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { rays, ties, false_misses, false_hits, order, distance, .. } = self;
        write!(
            f,
            "{} errors in {rays} rays ({false_misses} false misses, {false_hits} false hits, {order} not the nearest, \
             {distance} beside their distance), {ties} other ones of tied hits",
            self.errors()
        )
    }
}

/// Puts an answer to the reference. `triangles` are those that the verdict is about, `origin` the one left out.
#[must_use]
pub fn judge(triangles: &[Triangle], ray: &Ray, origin: u32, query: Query, verdict: &Verdict, hit: &Hit) -> Finding {
    if !hit.is_hit() {
        return if verdict.admits_presence(false) { Finding::Right } else { Finding::Wrong(Error::FalseMiss) };
    }
    let triangle = triangles.get(hit.primitive as usize).filter(|_| hit.primitive != origin && ray.is_valid());
    let Some((triangle, met)) = triangle.and_then(|t| Some((t, meeting(ray, hit.primitive, t)?))) else {
        return Finding::Wrong(Error::FalseHit);
    };
    let [low, high] = met.t.map(f64::from);
    let slack = t_bound(ray, triangle, low.abs().max(high.abs()));
    let t = f64::from(hit.t);
    if !(low - slack <= t && t <= high + slack) {
        return Finding::Wrong(Error::Distance);
    }
    let candidates = verdict.candidates();
    let tied = |other: &Nearest| met.t[0] <= other.t[1] && other.t[0] <= met.t[1];
    if query == Query::Any || candidates.iter().any(|c| c.primitive == hit.primitive) {
        Finding::Right
    } else if candidates.iter().any(tied) {
        Finding::Tie
    } else {
        Finding::Wrong(Error::Order)
    }
}

/// How far the `t` of a careful test in single precision may lie from the exact one, near `t`.
///
/// Such a test (T. Möller and B. Trumbore, 1997; or by Plücker coordinates, as Embree's robust one) computes
/// `t = (v · n) / (d · n)`, where `v` leads from the origin to a vertex and `n` is the normal, the product of two
/// edges. With `u` the error of one rounding, `r` the greatest coordinate of any vertex relative to the origin, and `e`
/// of any edge:
///
/// * An edge is a difference of vertices or of such relative vertices, so it errs by at most `4ur` in a coordinate.
/// * The normal then errs by `δ ≤ 4e·4ur + 6ue²` in a coordinate: two products of two edges each, and three roundings.
/// * An error of the normal shifts `t` only by the part that is not common to both products: the vector from the hit to
///   the vertex, at most `e` long in each of three coordinates where the hit lies in the triangle, times `δ`.
/// * The two dot products err by `5u` and `4u` of the sums of their terms' magnitudes, the quotient by `4u` of itself
///   (Embree multiplies by a reciprocal that one Newton step refines).
///
/// Infinite where the bound on the error reaches the divisor: the ray runs in the triangle's plane as far as single
/// precision can tell. Numbers that overflow or vanish in single precision are not covered.
#[must_use]
pub fn t_bound(ray: &Ray, triangle: &Triangle, t: f64) -> f64 {
    let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let [a, b, c] = triangle.vertices().map(|p| p.as_dvec3() - o);
    let r = [a, b, c].map(|p| p.abs().max_element()).into_iter().fold(0.0, f64::max);
    let edge_error = 4.0 * U * r;
    let e = [b - a, c - b, a - c].map(|p| p.abs().max_element()).into_iter().fold(0.0, f64::max) + edge_error;
    let normal_error = 4.0 * e * edge_error + 6.0 * U * e * e;
    let normal = (b - a).cross(c - a);
    let grown = normal.abs() + normal_error;
    // The farthest vertex stands for whichever of the three is used.
    let reach = [a, b, c].map(|p| p.abs().dot(grown)).into_iter().fold(0.0, f64::max);
    let depth = d.abs().dot(grown);
    let divisor = d.dot(normal).abs() - d.abs().element_sum() * normal_error - 4.0 * U * depth;
    if divisor <= 0.0 {
        return f64::INFINITY;
    }
    (3.0 * e * normal_error + 5.0 * U * reach + t * 4.0 * U * depth) / divisor + 4.0 * U * t
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use rt_core::intersect;
    use rt_verify::rays::{Aim, RayMaker};
    use rt_verify::reference::Reference;
    use rt_verify::shapes;

    fn at_depth(z: f32) -> Triangle {
        Triangle::new(Vec3::new(-1.0, -1.0, z), Vec3::new(3.0, -1.0, z), Vec3::new(-1.0, 3.0, z))
    }

    // Guards against: kinds of errors mixed up, ties that are errors, errors that are ties.
    #[test]
    fn every_kind_of_answer_is_told_from_the_others() {
        let aside = Triangle::new(Vec3::splat(9.0), Vec3::new(9.0, 10.0, 9.0), Vec3::new(10.0, 9.0, 9.0));
        let triangles = [at_depth(2.0), at_depth(1.0), at_depth(1.0), aside];
        let ray = Ray::new(Vec3::ZERO, Vec3::Z);
        let verdict = Reference::new(&triangles).resolve(&ray, u32::MAX);
        let hit = |primitive, t| Hit { t, u: 0.0, v: 0.0, primitive };
        let found = |query, hit: Hit| judge(&triangles, &ray, u32::MAX, query, &verdict, &hit);
        assert_eq!(found(Query::Closest, hit(1, 1.0)), Finding::Right);
        assert_eq!(found(Query::Closest, hit(2, 1.0)), Finding::Tie);
        assert_eq!(found(Query::Closest, hit(0, 2.0)), Finding::Wrong(Error::Order));
        assert_eq!(found(Query::Any, hit(0, 2.0)), Finding::Right);
        for query in [Query::Closest, Query::Any] {
            assert_eq!(found(query, hit(1, 1.001)), Finding::Wrong(Error::Distance));
            assert_eq!(found(query, hit(1, f32::NAN)), Finding::Wrong(Error::Distance));
            assert_eq!(found(query, hit(3, 9.0)), Finding::Wrong(Error::FalseHit));
            assert_eq!(found(query, hit(77, 1.0)), Finding::Wrong(Error::FalseHit));
            assert_eq!(found(query, Hit::MISS), Finding::Wrong(Error::FalseMiss));
        }
        let started = Reference::new(&triangles).resolve(&ray, 1);
        let itself = judge(&triangles, &ray, 1, Query::Closest, &started, &hit(1, 1.0));
        assert_eq!(itself, Finding::Wrong(Error::FalseHit));
    }

    /// `t` in single precision, every operation rounded: with edges of the triangle as Möller and Trumbore have them,
    /// and with edges between vertices relative to the origin, as Embree's robust test has them.
    fn single_precision(ray: &Ray, triangle: &Triangle) -> [f32; 2] {
        let [a, b, c] = triangle.vertices().map(|p| p - ray.origin);
        let edges = [[triangle.b - triangle.a, triangle.c - triangle.a], [b - a, c - a]];
        edges.map(|[e1, e2]| {
            let normal = e1.cross(e2);
            a.dot(normal) / ray.direction.dot(normal)
        })
    }

    // Guards against: a bound below what single precision does, such as the quotient's rounding alone, and one so wide
    // that it says nothing.
    #[test]
    fn the_bound_holds_for_single_precision_and_not_for_much_less() {
        let sets = [
            shapes::soup(300, 0.1, 1),
            shapes::soup(300, 1e-3, 7),
            shapes::needles(300, 1e-3, 2),
            shapes::grid(15, 0.2, 3),
        ];
        let (mut rays, mut tightest, mut closest) = (0, f64::INFINITY, 0.0_f64);
        for triangles in &sets {
            let maker = RayMaker::new(triangles, 5);
            for i in 0..3_000 {
                let (ray, _) = maker.ray(Aim::Interior, i);
                for triangle in triangles.iter().filter(|t| intersect::hit(&ray, t, 0).is_some()) {
                    let Some(met) = meeting(&ray, 0, triangle).filter(|met| met.certain) else { continue };
                    let exact = f64::from(met.t[0].midpoint(met.t[1]));
                    let bound = t_bound(&ray, triangle, exact.abs());
                    for t in single_precision(&ray, triangle) {
                        let error = (f64::from(t) - exact).abs();
                        assert!(error <= bound, "{error} > {bound} for {ray:?} and {triangle:?}");
                        closest = closest.max(error / bound);
                    }
                    (rays, tightest) = (rays + 1, tightest.min(bound / exact.abs()));
                }
            }
        }
        println!("{rays} rays; least bound {tightest:.1e} of t; greatest error {closest:.2} of its bound");
        assert!(rays > 5_000 && tightest < 1e-5 && closest > 0.02, "{rays} rays, {tightest}, {closest}");
    }
}
