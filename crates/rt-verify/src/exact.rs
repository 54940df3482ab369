//! Where a ray meets one triangle, decided in whole numbers.
//!
//! Every finite `f32` is a whole number times a power of two. So after one common scaling, the edge functions of a ray
//! and a triangle (the signed volumes of J. Plücker's line coordinates) and the distance to its plane are whole
//! numbers of a few hundred bits, and every comparison made here is exact. Nothing is shared with the kernels but the
//! definition of the problem.

use core::cmp::Ordering;
use dashu_int::IBig;
use dashu_int::ops::Abs;
use rt_core::intersect::shear_axes;
use rt_core::{Ray, Triangle};

/// Binary logarithm of the share of its operands' magnitude that an edge function must have for its sign to be called
/// clear. No unit.
///
/// A kernel that shears in double precision (`rt_core::intersect`) errs by at most 10 roundings of 2⁻⁵³, so by less
/// than 2⁻⁴⁹ of the products that its edge function subtracts. Eight times that leaves room for devices which order or
/// contract the same operations differently, and is still a four-millionth of a single-precision rounding.
pub const EDGE_TOLERANCE_LOG2: i32 = -46;

/// [`EDGE_TOLERANCE_LOG2`] as a factor.
pub const EDGE_TOLERANCE: f64 = 1.0 / (1_u64 << -EDGE_TOLERANCE_LOG2) as f64;

/// Share of the greatest vertex distance by which a kernel's distance may err beyond its edge functions' errors: the
/// eight roundings of the weighted mean, four times over. No unit.
const DISTANCE_TOLERANCE: f64 = 32.0 / (1_u64 << 53) as f64;

/// A line's meeting with a triangle that is not clearly a miss.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Whether it is clearly a hit: all three edge functions have one sign, by more than [`EDGE_TOLERANCE`].
    pub certain: bool,
    /// Least and greatest distance, in units of the direction, that a kernel within the tolerances can find, before it
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
    fn new(point: glam::Vec3, exponent: i32, axes: [usize; 3]) -> Self {
        Self(axes.map(|axis| {
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
}

/// Bound on the products that a sheared edge function of `p` and `q` subtracts, axis 2 being the dominant one.
fn magnitude(p: &Point, q: &Point) -> IBig {
    let size = |point: &Point, axis: usize| point.0[axis].clone().abs() + point.0[2].clone().abs();
    size(p, 0) * size(q, 1) + size(p, 1) * size(q, 0)
}

/// `2^exponent`, for exponents between −1022 and 1023.
fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((1023 + exponent) as u64) << 52)
}

/// Decides how the line through a valid `ray` and a finite `triangle` meet; limits of `t` are not looked at.
///
/// `None` for a clear miss and for a triangle without area.
#[must_use]
pub fn contact(ray: &Ray, triangle: &Triangle) -> Option<Contact> {
    let axes = shear_axes(ray.direction);
    let places = [ray.origin, triangle.a, triangle.b, triangle.c];
    let exponent = common_exponent(places.into_iter().flat_map(|p| p.to_array()));
    let direction_exponent = common_exponent(ray.direction.to_array());
    let [origin, a, b, c] = places.map(|p| Point::new(p, exponent, axes));
    let d = Point::new(ray.direction, direction_exponent, axes);
    if b.minus(&a).cross(&c.minus(&a)).0.iter().all(|x| x.is_zero()) {
        return None;
    }
    let [a, b, c] = [a, b, c].map(|p| p.minus(&origin));
    let depth = d.0[2].clone();

    // Edge function and its tolerance, both times the depth of the direction, which the kernels divide by.
    let b_cross_c = b.cross(&c);
    let edges = [
        (-d.dot(&b_cross_c), magnitude(&b, &c)),
        (-d.dot(&c.cross(&a)), magnitude(&c, &a)),
        (-d.dot(&a.cross(&b)), magnitude(&a, &b)),
    ];
    let signs = [0, 1, 2].map(|i| {
        let (value, magnitude) = &edges[i];
        let tolerance = magnitude * depth.clone().abs();
        let clear = (value.clone().abs() << -EDGE_TOLERANCE_LOG2 as usize) > tolerance;
        if clear { value.cmp(&IBig::ZERO) } else { Ordering::Equal }
    });
    let seen = |sign| signs.contains(&sign);
    if seen(Ordering::Less) && seen(Ordering::Greater) {
        return None;
    }

    // Depth of the hit along the dominant axis, and how far a kernel's may lie from it.
    let float = |x: &IBig| x.to_f64().value();
    let determinant = edges.iter().map(|(value, _)| value).sum::<IBig>();
    let doubt = float(&edges.iter().map(|(_, m)| m).sum::<IBig>()) * float(&depth).abs() * EDGE_TOLERANCE;
    let depths = [&a, &b, &c].map(|p| float(&p.0[2]));
    let near = depths.into_iter().fold(f64::INFINITY, f64::min);
    let far = depths.into_iter().fold(f64::NEG_INFINITY, f64::max);
    let slack = near.abs().max(far.abs()) * DISTANCE_TOLERANCE;
    // Weights of one sign make a mean of the vertices' depths, whatever their errors.
    let mut range = [near - slack, far + slack];
    let room = float(&determinant).abs() - doubt;
    if room > 0.0 {
        let middle = -float(&a.dot(&b_cross_c)) / float(&determinant) * float(&depth);
        let error = doubt / room * (far - near) + slack;
        range = [range[0].max(middle - error), range[1].min(middle + error)];
        if range[0] > range[1] {
            // Missed, and by so much that no kernel can place it inside the triangle's depths.
            return None;
        }
    }
    let unit = power_of_two(exponent - direction_exponent) / float(&depth);
    let mut t = range.map(|depth| depth * unit);
    t.sort_by(f64::total_cmp);
    Some(Contact { certain: !seen(Ordering::Equal), t })
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

    // Guards against: a swapped sign in one edge function, a forgotten factor of the exponent, `<=` for `>`.
    #[test]
    fn clear_hits_clear_misses_and_edges_are_told_apart() {
        let hit = contact(&down(0.25, 0.25), &UNIT).expect("inside");
        assert!(hit.certain && hit.t[0] <= 1.5 && 1.5 <= hit.t[1] && hit.t[1] - hit.t[0] < 1e-12);
        assert_eq!(contact(&down(-0.25, 0.25), &UNIT), None);
        assert_eq!(contact(&down(0.5, 0.500_001), &UNIT), None);
        for on_edge in [down(0.0, 0.25), down(0.5, 0.5), down(0.0, 0.0), down(0.0, 1.0)] {
            assert!(!contact(&on_edge, &UNIT).expect("on an edge").certain);
        }
    }

    #[test]
    fn a_triangle_without_area_is_never_met_and_one_seen_edge_on_never_clearly() {
        let line = Triangle::new(Vec3::ZERO, Vec3::ONE, Vec3::splat(3.0));
        assert_eq!(contact(&Ray::new(Vec3::splat(-1.0), Vec3::ONE), &line), None);
        let along = contact(&Ray::new(Vec3::new(-1.0, 0.25, 0.0), Vec3::X), &UNIT).expect("in its plane");
        assert!(!along.certain && along.t[0] <= 1.0 && along.t[1] >= 2.0);
    }

    // The kernels' double precision cannot tell these from hits on the edge; whole numbers can, and say "doubtful".
    #[test]
    fn extremes_of_the_number_range_are_exact() {
        for scale in [1e-30_f32, 1.0, 1e30] {
            let ray = Ray::new(Vec3::new(0.25, 0.25, 3.0) * scale, Vec3::new(0.0, 0.0, -2.0));
            let hit = contact(&ray, &UNIT.scaled(scale)).expect("inside");
            let t = 1.5 * f64::from(scale);
            assert!(hit.certain && hit.t[0] < t * 1.000_001 && hit.t[1] > t * 0.999_999, "{hit:?}");
        }
        let far = Ray::new(Vec3::new(0.25, 0.25, 1e30), Vec3::new(0.0, 0.0, -1e-30));
        assert!(!contact(&far, &UNIT).expect("within the tolerance from so far away").certain);
    }
}
