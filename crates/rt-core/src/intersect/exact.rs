//! What double precision leaves open, decided in exact arithmetic. Called for few pairs of ray and triangle, and so
//! apart from the code of all others.

use super::{Intersection, Shear, round_distance};
use crate::Triangle;
use crate::expansion::{Expansion, Vector, cross, difference, dot, dot_difference, volume_sign};
use crate::scale::pow2;
use core::cmp::Ordering;
use glam::DVec3;

/// How far a distance that is estimated from exact numbers may be from the right one, relative to it: far more than the
/// 2⁻⁴⁸ of two estimates and a quotient, far less than a rounding to single precision.
const ERROR: f64 = 1.0 / (1_u64 << 40) as f64;

/// Distances beyond this are beyond every number in single precision, and those below its reciprocal below every one.
const FAR: f64 = pow2(200);

/// The vertices relative to the origin.
fn relative(shear: &Shear, triangle: &Triangle) -> [Vector<2>; 3] {
    triangle.vertices().map(|p| difference(p.as_dvec3(), shear.origin))
}

/// The sheared `edges`, each off by at most `error`, where the exact ones have one sign; those that rounding gave the
/// other sign are 0 instead. `None` where the exact ones have both signs.
pub(super) fn signed(shear: &Shear, triangle: &Triangle, edges: [f64; 3], error: f64) -> Option<[f64; 3]> {
    let direction = shear.direction.as_dvec3();
    let [a, b, c] = relative(shear, triangle);
    let mut common = Ordering::Equal;
    let mut settle = |edge: f64, p, q| {
        let sign = if edge.abs() > error {
            if edge > 0.0 { Ordering::Greater } else { Ordering::Less }
        } else {
            // Shearing has divided it by the direction's largest component, with the other sign.
            let sign = volume_sign(p, q, direction);
            if shear.factors.z > 0.0 { sign.reverse() } else { sign }
        };
        match sign {
            Ordering::Equal => return Some(0.0),
            sign if common == sign.reverse() => return None,
            sign => common = sign,
        }
        Some(if (sign == Ordering::Greater) == (edge > 0.0) { edge } else { 0.0 })
    };
    let [u, v, w] = edges;
    Some([settle(u, &b, &c)?, settle(v, &c, &a)?, settle(w, &a, &b)?])
}

/// [`Shear::intersect`].
#[cold]
#[inline(never)]
pub(super) fn intersect(shear: &Shear, triangle: &Triangle) -> Option<Intersection> {
    let direction = shear.direction.as_dvec3();
    let [a, b, c] = relative(shear, triangle);
    // Most triangles that come here are seen edge-on or have no area, and are missed: signs are cheaper than numbers.
    let signs = [(&b, &c), (&c, &a), (&a, &b)].map(|(p, q)| volume_sign(p, q, direction));
    if signs.contains(&Ordering::Less) && signs.contains(&Ordering::Greater)
        || signs.iter().all(|&sign| sign == Ordering::Equal)
    {
        return None;
    }
    let normal = cross(&b, &c);
    let edges = [dot(&normal, direction), dot(&cross(&c, &a), direction), dot(&cross(&a, &b), direction)];
    let [u, v, w] = edges.each_ref().map(Expansion::estimate);
    // They have one sign, so nothing cancels.
    let determinant = u + v + w;
    let depth = dot_difference(&normal, &a);
    let (t, error) = match (depth.estimate() / determinant * pow2(shear.scale_exponent), depth.sign()) {
        (_, Ordering::Equal) => (0.0, 0.0),
        (t, _) if t.abs() > FAR => (f64::INFINITY.copysign(t), 0.0),
        // The quotient may have vanished, but not its sign.
        (t, _) if t.abs() < 1.0 / FAR => ((1.0 / FAR).copysign(t), 0.0),
        (t, _) => (t, t.abs() * ERROR),
    };
    Some(Intersection { t, error, u: v / determinant, v: w / determinant })
}

/// The distance of a triangle that the line meets, rounded once.
#[cold]
#[inline(never)]
pub(super) fn distance(shear: &Shear, triangle: &Triangle) -> f32 {
    let [a, b, c] = relative(shear, triangle);
    let depth = dot_difference(&cross(&b, &c), &a);
    // The same as that of vertices relative to the origin, with fewer terms.
    let determinant = dot(&normal(triangle), shear.direction.as_dvec3());
    let t = depth.estimate() / determinant.estimate() * pow2(shear.scale_exponent);
    if depth.sign() == Ordering::Equal {
        return 0.0;
    }
    if !(1.0 / FAR..=FAR).contains(&t.abs()) {
        return round_distance(if t.abs() > FAR { t } else { (1.0 / FAR).copysign(t) });
    }
    let [low, high] = [t - t.abs() * ERROR, t + t.abs() * ERROR].map(round_distance);
    if low == high {
        return low;
    }
    // The distance is rounded to one of two neighbours: which, says the number halfway between them. The one beyond the
    // largest number would be 2¹²⁸.
    let [x, y] = [low, high].map(|t| if t.is_finite() { f64::from(t) } else { pow2(128).copysign(t.into()) });
    let half = 0.5 * (x + y);
    let at_half = Expansion::<192>::product(&determinant, half * pow2(-shear.scale_exponent));
    let beyond = Expansion::<384>::sum(&depth, &at_half.negated()).sign();
    let beyond = if determinant.sign() == Ordering::Less { beyond.reverse() } else { beyond };
    match beyond {
        Ordering::Less => low,
        Ordering::Equal => round_distance(half),
        Ordering::Greater => high,
    }
}

/// [`super::has_area`].
#[cold]
#[inline(never)]
pub(super) fn has_area(triangle: &Triangle) -> bool {
    normal(triangle).iter().any(|component| component.sign() != Ordering::Equal)
}

/// `(b − a) × (c − a)`.
fn normal(triangle: &Triangle) -> Vector<16> {
    let [a, b, c]: [DVec3; 3] = triangle.vertices().map(|p| p.as_dvec3());
    cross(&difference(b, a), &difference(c, a))
}
