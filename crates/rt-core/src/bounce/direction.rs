//! Directions from uniform numbers.

use super::exact::rsqrt;
use core::f32::consts::FRAC_PI_4;
use glam::Vec3;

/// Where rays go that leave a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Aim {
    /// About the normal, with a probability proportional to the cosine to it: diffuse light.
    Cosine,
    /// Towards points spread evenly over a flat disc, which every surface sees in the same direction: the sun.
    Disc {
        /// Unit vector to the disc's middle, which is at distance 1.
        middle: Vec3,
        /// Two radii at right angles to it and to each other.
        radii: [Vec3; 2],
    },
}

impl Aim {
    /// A unit vector, up to rounding, for two numbers of [`crate::random::unit`]. No component is −0.
    #[must_use]
    #[inline(always)]
    pub fn direction(&self, normal: Vec3, uniform: [f32; 2]) -> Vec3 {
        let (x, y, squared) = disc(uniform);
        let direction = match self {
            Self::Cosine => {
                // N. Malley's method: points spread evenly over the disc, raised to the hemisphere.
                let rest = 1.0 - squared;
                let (tangent, bitangent) = basis(normal);
                (tangent * x + bitangent * y) + normal * (rest * rsqrt(rest))
            }
            Self::Disc { middle, radii: [tangent, bitangent] } => {
                let to = (*middle + *tangent * x) + *bitangent * y;
                to * rsqrt((to.x * to.x + to.y * to.y) + to.z * to.z)
            }
        };
        Vec3::from_array(direction.to_array().map(|c| if c == 0.0 { 0.0 } else { c }))
    }
}

/// Maps `[0, 1)²` to the open unit disc, equal areas to equal areas, and returns `(x, y)` and the squared radius.
///
/// The concentric map of P. Shirley and K. Chiu, *A Low Distortion Map Between Disk and Square*, JGT 2-3 (1997).
/// The numbers are multiples of 2⁻²⁴ and are taken at the middle of their step, so the squared radius never exceeds
/// `1 − 2⁻²³` and a direction raised from the disc is never in the surface.
#[inline(always)]
fn disc(uniform: [f32; 2]) -> (f32, f32, f32) {
    const HALF_STEP: f32 = 1.0 / 16_777_216.0;
    // Exact, and neither is ever 0, thanks to the half step.
    let [a, b] = uniform.map(|u| (2.0 * u - 1.0) + HALF_STEP);
    let steep = b.abs() > a.abs();
    let (radius, other) = if steep { (b, a) } else { (a, b) };
    let squared = radius * radius;
    let inverse = rsqrt(squared);
    let (sin, cos) = sin_cos(FRAC_PI_4 * ((other * inverse) * (radius * inverse)));
    let (along, across) = (radius * cos, radius * sin);
    let (x, y) = if steep { (across, along) } else { (along, across) };
    (x, y, squared)
}

/// Sine and cosine for `|x|` up to a little more than π/4 by Taylor's series, to 2 · 10⁻⁹ before rounding.
#[inline(always)]
fn sin_cos(x: f32) -> (f32, f32) {
    // 1 / n! for the odd and the even n.
    const ODD: [f32; 4] = [-1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0, 1.0 / 362_880.0];
    const EVEN: [f32; 5] = [-1.0 / 2.0, 1.0 / 24.0, -1.0 / 720.0, 1.0 / 40_320.0, -1.0 / 3_628_800.0];
    let q = x * x;
    let sin = x * (1.0 + q * (ODD[0] + q * (ODD[1] + q * (ODD[2] + q * ODD[3]))));
    let cos = 1.0 + q * (EVEN[0] + q * (EVEN[1] + q * (EVEN[2] + q * (EVEN[3] + q * EVEN[4]))));
    (sin, cos)
}

/// Two unit vectors at right angles to the unit vector `n` and to each other.
///
/// After T. Duff et al., *Building an Orthonormal Basis, Revisited*, JCGT 6-1 (2017); the quotient is the square of a
/// reciprocal root.
#[must_use]
#[inline(always)]
pub fn basis(n: Vec3) -> (Vec3, Vec3) {
    let sign = if n.z < 0.0 { -1.0 } else { 1.0 };
    let root = rsqrt(1.0 + n.z.abs());
    let a = -sign * (root * root);
    let b = (n.x * n.y) * a;
    let tangent = Vec3::new(1.0 + sign * ((n.x * n.x) * a), sign * b, -sign * n.x);
    let bitangent = Vec3::new(b, sign + (n.y * n.y) * a, -n.y);
    (tangent, bitangent)
}
