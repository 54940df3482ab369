//! Where a ray meets one triangle, decided in whole numbers.
//!
//! Every finite `f32` is a whole number times a power of two. So after one common scaling, the edge functions of a ray
//! and a triangle (the signed volumes of J. Plücker's line coordinates) and the distance to its plane are whole
//! numbers of a few hundred bits, and every comparison made here is exact. Nothing is shared with the kernels but the
//! definition of the problem, which the documentation of `rt_core::intersect` gives.
//!
//! Beside the one right answer ([`hit`]) stands what a tracer may say that decides in double precision without such a
//! definition ([`contact`]): it may see the line as much as [`NEARNESS`] beside where it is.

use core::cmp::Ordering;
use dashu_int::IBig;
use dashu_int::ops::{Abs, BitTest, DivRem};
use glam::DVec3;
use rt_core::{Ray, Triangle};

/// Binary logarithm of [`NEARNESS`].
pub const NEARNESS_LOG2: i32 = -46;

/// How near a line must come to a triangle's edge for a careful tracer to mistake the side on which it passes: this
/// share of the distance from the ray's origin to the triangle's farthest vertex, at right angles to the ray. The scene
/// has no part in it.
///
/// A kernel that shears in double precision displaces a vertex by less than 5 roundings of 2⁻⁵³ of its distance, so by
/// less than 2⁻⁵⁰. Sixteen times that leaves room for devices which order or contract the same operations differently,
/// and is still a four-millionth of a single-precision rounding.
pub const NEARNESS: f64 = 1.0 / (1_u64 << -NEARNESS_LOG2) as f64;

/// A line's meeting with a triangle, as careful tracers may see it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// The distance of the exact hit, rounded once; `None` where there is none, but the line comes near.
    pub hit: Option<f32>,
    /// Whether it is a hit, and not near an edge.
    pub certain: bool,
    /// Least and greatest distance, in units of the direction, that a tracer within the tolerances can find, before it
    /// is rounded to single precision.
    pub t: [f64; 2],
}

/// Whole numbers `value · 2^−exponent`, exact.
struct Point([IBig; 3]);

/// Mantissa and exponent: `value = mantissa · 2^exponent`.
fn decode(value: f32) -> (i32, i32) {
    let bits = value.to_bits();
    let (biased, fraction) = (bits >> 23 & 0xff, (bits & 0x7f_ffff) as i32);
    let (mantissa, exponent) = if biased == 0 { (fraction, -149) } else { (fraction | 0x80_0000, biased as i32 - 150) };
    (if bits >> 31 == 0 { mantissa } else { -mantissa }, exponent)
}

/// The smallest exponent among the numbers that are not zero.
fn common_exponent(values: impl IntoIterator<Item = f32>) -> i32 {
    values.into_iter().filter(|&value| value != 0.0).map(|value| decode(value).1).min().unwrap_or(0)
}

impl Point {
    fn new(point: glam::Vec3, exponent: i32) -> Self {
        Self([0, 1, 2].map(|axis| {
            let (mantissa, own) = decode(point[axis]);
            if mantissa == 0 { IBig::ZERO } else { IBig::from(mantissa) << (own - exponent) as usize }
        }))
    }

    fn minus(&self, other: &Self) -> Self {
        Self(core::array::from_fn(|i| &self.0[i] - &other.0[i]))
    }

    fn cross(&self, other: &Self) -> Self {
        let (a, b) = (&self.0, &other.0);
        Self([&a[1] * &b[2] - &a[2] * &b[1], &a[2] * &b[0] - &a[0] * &b[2], &a[0] * &b[1] - &a[1] * &b[0]])
    }

    fn dot(&self, other: &Self) -> IBig {
        &self.0[0] * &other.0[0] + &self.0[1] * &other.0[1] + &self.0[2] * &other.0[2]
    }

    fn is_zero(&self) -> bool {
        self.0.iter().all(IBig::is_zero)
    }

    /// Rounded, component by component.
    fn float(&self) -> DVec3 {
        DVec3::from(self.0.each_ref().map(float))
    }

    /// About its length; the squares of its components would overflow.
    fn length(&self) -> f64 {
        let v = self.float();
        let largest = v.abs().max_element();
        if largest == 0.0 { 0.0 } else { (v / largest).length() * largest }
    }
}

fn float(x: &IBig) -> f64 {
    x.to_f64().value()
}

/// `2^exponent`, for exponents between −1022 and 1023.
fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((1023 + exponent) as u64) << 52)
}

/// A ray and a triangle in whole numbers.
struct Pair {
    direction: Point,
    /// The vertices relative to the origin.
    vertices: [Point; 3],
    /// The edge functions, opposite to each vertex.
    edges: [IBig; 3],
    determinant: IBig,
    /// The distance times the determinant, in units of 2^`unit`.
    depth: IBig,
    unit: i32,
}

impl Pair {
    fn new(ray: &Ray, triangle: &Triangle) -> Self {
        let places = [ray.origin, triangle.a, triangle.b, triangle.c];
        let exponent = common_exponent(places.into_iter().flat_map(|p| p.to_array()));
        let direction_exponent = common_exponent(ray.direction.to_array());
        let [origin, a, b, c] = places.map(|p| Point::new(p, exponent));
        let direction = Point::new(ray.direction, direction_exponent);
        let vertices = [a, b, c].map(|p| p.minus(&origin));
        let [a, b, c] = &vertices;
        let normal = b.cross(c);
        let edges = [direction.dot(&normal), direction.dot(&c.cross(a)), direction.dot(&a.cross(b))];
        let depth = a.dot(&normal);
        let determinant = edges.iter().sum();
        Self { direction, vertices, edges, determinant, depth, unit: exponent - direction_exponent }
    }

    /// Whether the line meets the triangle.
    fn meets(&self) -> bool {
        let seen = |sign| self.edges.iter().any(|edge| edge.cmp(&IBig::ZERO) == sign);
        seen(Ordering::Less) != seen(Ordering::Greater)
    }

    /// The distance to the triangle's plane, rounded as the definition says.
    fn distance(&self) -> f32 {
        rounded_ratio(&self.depth, &self.determinant, self.unit)
    }
}

/// `numerator / denominator · 2^exponent` in single precision: to nearest, to even where that is a draw, and to the
/// least number of its sign where it would vanish.
fn rounded_ratio(numerator: &IBig, denominator: &IBig, exponent: i32) -> f32 {
    if numerator.is_zero() {
        return 0.0;
    }
    let negative = (*numerator < IBig::ZERO) != (*denominator < IBig::ZERO);
    let [numerator, denominator] = [numerator, denominator].map(|x| x.clone().abs());
    // A quotient of 40 or 41 bits and, in the bit below, whether anything is left over: rounding it to fewer bits, of
    // which single precision has 24 at most, is rounding the ratio.
    let shift = 40 + denominator.bit_len() as i32 - numerator.bit_len() as i32;
    let (quotient, rest) = if shift >= 0 {
        (numerator << shift as usize).div_rem(&denominator)
    } else {
        numerator.div_rem(&(denominator << -shift as usize))
    };
    let odd = float(&((quotient << 1) + IBig::from(u8::from(!rest.is_zero()))));
    let exponent = exponent - shift - 1;
    let magnitude = match exponent {
        ..-400 => 0.0,
        400.. => f32::INFINITY,
        _ => (odd * power_of_two(exponent)) as f32,
    };
    let magnitude = if magnitude == 0.0 { f32::from_bits(1) } else { magnitude };
    if negative { -magnitude } else { magnitude }
}

/// The distance at which the line through a valid `ray` meets a finite `triangle`, rounded once; limits of `t` are not
/// looked at.
#[must_use]
pub fn hit(ray: &Ray, triangle: &Triangle) -> Option<f32> {
    let pair = Pair::new(ray, triangle);
    pair.meets().then(|| pair.distance())
}

/// How careful tracers may see the line through a valid `ray` and a finite `triangle`; limits of `t` are not looked at.
///
/// `None` for a clear miss and for a triangle without area.
#[must_use]
pub fn contact(ray: &Ray, triangle: &Triangle) -> Option<Contact> {
    let pair = Pair::new(ray, triangle);
    let [a, b, c] = &pair.vertices;
    let normal = b.minus(a).cross(&c.minus(a));
    if normal.is_zero() {
        return None;
    }
    let hit = pair.meets().then(|| pair.distance());
    let reach = [a, b, c].into_iter().map(Point::length).fold(0.0, f64::max);
    let near = gap(&pair) <= NEARNESS * reach;
    if hit.is_none() && !near {
        return None;
    }

    // In units of the direction's length, along it: every point of the triangle lies between its vertices.
    let length = pair.direction.length();
    let along = [a, b, c].map(|p| float(&p.dot(&pair.direction)) / length / length);
    let slack = 2.0 * NEARNESS * reach / length;
    let ends = [
        along.into_iter().fold(f64::INFINITY, f64::min) - slack,
        along.into_iter().fold(f64::NEG_INFINITY, f64::max) + slack,
    ];
    let mut range = ends;
    if !pair.determinant.is_zero() {
        // A line that is displaced meets the plane where that has risen or fallen.
        let determinant = float(&pair.determinant);
        let slope = normal.cross(&pair.direction).length() / determinant.abs();
        let middle = float(&pair.depth) / determinant;
        let error = slack * (slope + 1.0);
        let narrowed = [ends[0].max(middle - error), ends[1].min(middle + error)];
        if narrowed[0] <= narrowed[1] {
            range = narrowed;
        }
    }
    let unit = power_of_two(pair.unit);
    Some(Contact { hit, certain: hit.is_some() && !near, t: range.map(|t| t * unit) })
}

/// How far the line passes the triangle's nearest edge, seen along the line, in the unit of the vertices.
fn gap(pair: &Pair) -> f64 {
    // Seen along the line a vertex p is at p × d, but for a quarter turn and the length of d.
    let length = pair.direction.length();
    let seen = pair.vertices.each_ref().map(|p| p.cross(&pair.direction));
    let distance = |i: usize, j: usize, edge: &IBig| {
        let [p, q] = [&seen[i], &seen[j]];
        let side = q.minus(p);
        // Which of both ends or the points between them is nearest, is exact; how far that is, right to some roundings.
        if p.dot(&side) >= IBig::ZERO {
            p.length() / length
        } else if q.dot(&side) <= IBig::ZERO {
            q.length() / length
        } else {
            float(edge).abs() / side.length()
        }
    };
    let [a, b, c] = &pair.edges;
    distance(1, 2, a).min(distance(2, 0, b)).min(distance(0, 1, c))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    const UNIT: Triangle = Triangle::new(Vec3::ZERO, Vec3::X, Vec3::Y);

    fn down(x: f32, y: f32) -> Ray {
        Ray::new(Vec3::new(x, y, 3.0), Vec3::new(0.0, 0.0, -2.0))
    }

    #[test]
    fn numbers_are_taken_apart_exactly() {
        for value in [1.0, -0.75, 3e38, -1e-45, f32::MIN_POSITIVE, 16_777_217.0] {
            let (mantissa, exponent) = decode(value);
            assert_eq!(f64::from(mantissa) * power_of_two(exponent), f64::from(value));
        }
        assert_eq!(decode(-0.0).0, 0);
    }

    // Guards against: truncation, draws to odd, numbers that vanish or overflow the wrong way.
    #[test]
    fn ratios_are_rounded_as_the_processor_rounds() {
        let ratio = |n: i64, d: i64, e: i32| rounded_ratio(&IBig::from(n), &IBig::from(d), e);
        for (n, d) in
            [(1, 3), (-2, 3), (16_777_217, 1), (16_777_219, 1), (33_554_435, 2), (1, 1), (7, -5), (1 << 40, 3)]
        {
            assert_eq!(ratio(n, d, 0), (n as f64 / d as f64) as f32, "{n} / {d}");
            assert_eq!(ratio(n, d, -140), (n as f64 / d as f64 * power_of_two(-140)) as f32, "{n} / {d}");
        }
        let least = f32::from_bits(1);
        assert_eq!([ratio(1, 1, -149), ratio(3, 1, -151), ratio(1, 1, -150)], [least; 3]);
        assert_eq!([ratio(1, 1, -900), ratio(-1, 1, -900), ratio(0, 1, 0)], [least, -least, 0.0]);
        assert_eq!([ratio(1, 1, 128), ratio(-1, 1, 900)], [f32::INFINITY, f32::NEG_INFINITY]);
        // The largest number, the draw beyond it, and just before that.
        assert_eq!(ratio((1 << 24) - 1, 1, 104), f32::MAX);
        assert_eq!(ratio((1 << 25) - 1, 1, 103), f32::INFINITY);
        assert_eq!(ratio((1 << 35) - (1 << 10) - 1, 1, 93), f32::MAX);
    }

    // Guards against: a swapped sign in one edge function, a forgotten factor of the exponent, an edge that does not
    // belong.
    #[test]
    fn hits_misses_and_edges_are_told_apart() {
        let inside = contact(&down(0.25, 0.25), &UNIT).expect("inside");
        assert!(inside.certain && inside.t[0] <= 1.5 && 1.5 <= inside.t[1] && inside.t[1] - inside.t[0] < 1e-12);
        assert_eq!(inside.hit, Some(1.5));
        assert_eq!(contact(&down(-0.25, 0.25), &UNIT), None);
        assert_eq!(contact(&down(0.5, 0.500_001), &UNIT), None);
        for on_edge in [down(0.0, 0.25), down(0.5, 0.5), down(0.0, 0.0), down(0.0, 1.0)] {
            let contact = contact(&on_edge, &UNIT).expect("on an edge");
            assert_eq!((contact.certain, contact.hit, hit(&on_edge, &UNIT)), (false, Some(1.5), Some(1.5)));
        }
        for beside in [down(-1e-15, 0.25), down(0.25, -1e-15), down(-1e-15, -1e-15), down(1e-15, -1e-15)] {
            let contact = contact(&beside, &UNIT).expect("nearly on an edge");
            assert_eq!((contact.certain, contact.hit, hit(&beside, &UNIT)), (false, None, None));
        }
    }

    #[test]
    fn a_triangle_without_area_or_seen_edge_on_is_never_met() {
        let line = Triangle::new(Vec3::ZERO, Vec3::ONE, Vec3::splat(3.0));
        assert_eq!(contact(&Ray::new(Vec3::splat(-1.0), Vec3::ONE), &line), None);
        let ray = Ray::new(Vec3::new(-1.0, 0.25, 0.0), Vec3::X);
        let along = contact(&ray, &UNIT).expect("in its plane");
        assert!(along.hit.is_none() && along.t[0] <= 1.0 && along.t[1] >= 1.75, "{along:?}");
        assert_eq!(hit(&ray, &UNIT), None);
    }

    // Guards against: a tolerance that grows with products of coordinates, as it once did, or with anything but the
    // ray's own distances.
    #[test]
    fn nearness_is_a_share_of_the_distance_to_the_triangle() {
        for scale in [1e-30_f32, 1.0, 1e30] {
            let ray = Ray::new(Vec3::new(0.25, 0.25, 3.0) * scale, Vec3::new(0.0, 0.0, -2.0));
            let found = contact(&ray, &UNIT.scaled(scale)).expect("inside");
            let t = 1.5 * f64::from(scale);
            assert!(found.certain && found.t[0] < t * 1.000_001 && found.t[1] > t * 0.999_999, "{found:?}");
        }
        // From 2⁴⁰ away an edge is 2⁻⁶ wide, to both sides.
        let far = |x: f32| contact(&Ray::new(Vec3::new(x, 0.25, power_of_two(40) as f32), Vec3::NEG_Z), &UNIT);
        let certain = |x: f32| far(x).map(|contact| contact.certain);
        let width = power_of_two(-6) as f32;
        assert_eq!([certain(width * 1.01), certain(width * 0.99)], [Some(true), Some(false)]);
        assert_eq!([certain(width * -1.01), certain(width * -0.99)], [None, Some(false)]);
        // A triangle of size 10⁻¹⁴ passed by 10⁻⁵ from 700 away is clearly missed.
        let tiny = UNIT.scaled(1e-14);
        assert_eq!(contact(&Ray::new(Vec3::new(1e-5, 0.0, 700.0), Vec3::NEG_Z), &tiny), None);
    }
}
