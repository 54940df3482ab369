//! Directions from uniform numbers, by additions, multiplications and square roots alone: the same bits everywhere.

use glam::DVec3;
use std::f64::consts::FRAC_PI_4;

/// Maps `[0, 1)²` to the open unit disc, equal areas to equal areas, and returns `(x, y)` and the squared radius.
///
/// The concentric map of P. Shirley and K. Chiu, *A Low Distortion Map Between Disk and Square*, JGT 2-3 (1997).
/// The numbers are multiples of 2⁻²⁴ (see [`rt_core::random::unit`]) and are taken at the middle of their step, so the
/// squared radius never exceeds `1 − 2⁻²³` and a direction raised from the disc is never in the surface.
pub(super) fn disc(uniform: [f32; 2]) -> (f64, f64, f64) {
    const HALF_STEP: f64 = 1.0 / 16_777_216.0;
    let [a, b] = uniform.map(|u| 2.0 * f64::from(u) - 1.0 + HALF_STEP);
    // Neither is ever 0, thanks to the half step.
    let steep = b.abs() > a.abs();
    let (radius, other) = if steep { (b, a) } else { (a, b) };
    let (sin, cos) = sin_cos(FRAC_PI_4 * (other / radius));
    let (along, across) = (radius * cos, radius * sin);
    let (x, y) = if steep { (across, along) } else { (along, across) };
    (x, y, radius * radius)
}

/// Sine and cosine for `|x| ≤ π/4` by Taylor's series, to 2 · 10⁻⁹: well below the single precision of a ray.
fn sin_cos(x: f64) -> (f64, f64) {
    // 1 / n! for the odd and the even n: multiplied, since divisions would take longer than all the rest.
    const ODD: [f64; 4] = [-1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0, 1.0 / 362_880.0];
    const EVEN: [f64; 5] = [-1.0 / 2.0, 1.0 / 24.0, -1.0 / 720.0, 1.0 / 40_320.0, -1.0 / 3_628_800.0];
    let q = x * x;
    let sin = x * (1.0 + q * (ODD[0] + q * (ODD[1] + q * (ODD[2] + q * ODD[3]))));
    let cos = 1.0 + q * (EVEN[0] + q * (EVEN[1] + q * (EVEN[2] + q * (EVEN[3] + q * EVEN[4]))));
    (sin, cos)
}

/// Two unit vectors at right angles to the unit vector `n` and to each other.
///
/// After T. Duff et al., *Building an Orthonormal Basis, Revisited*, JCGT 6-1 (2017).
pub(super) fn basis(n: DVec3) -> (DVec3, DVec3) {
    let sign = 1.0_f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    let tangent = DVec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x);
    let bitangent = DVec3::new(b, sign + n.y * n.y * a, -n.y);
    (tangent, bitangent)
}

/// A unit vector about the unit vector `normal`, with a probability proportional to the cosine between them.
///
/// N. Malley's method: points spread evenly over the disc, raised to the hemisphere.
pub(super) fn cosine_weighted(normal: DVec3, uniform: [f32; 2]) -> DVec3 {
    let (x, y, squared) = disc(uniform);
    let (tangent, bitangent) = basis(normal);
    tangent * x + bitangent * y + normal * (1.0 - squared).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rt_core::random;

    fn unit_vector() -> impl Strategy<Value = DVec3> {
        let component = || prop_oneof![Just(0.0), Just(-0.0), -1.0..1.0_f64, -1e-9..1e-9_f64];
        [component(), component(), component()].prop_filter_map("not zero", |v| DVec3::from(v).try_normalize())
    }

    proptest! {
        /// Guards: a right-angled frame for every normal. Fails with a sign that is always 1.
        #[test]
        fn basis_is_orthonormal(n in unit_vector()) {
            let (t, b) = basis(n);
            for (dot, expected) in [(t.dot(t), 1.0), (b.dot(b), 1.0), (t.dot(b), 0.0), (t.dot(n), 0.0), (b.dot(n), 0.0)] {
                prop_assert!((dot - expected).abs() < 1e-12, "{n}: {dot}");
            }
        }

        /// Guards: directions are of unit length and leave the surface. Fails without the half step in `disc`.
        #[test]
        fn directions_leave_the_surface(n in unit_vector(), u in 0..1_u32 << 24, v in 0..1_u32 << 24, end in any::<bool>()) {
            let unit = |w: u32| random::unit(w << 8);
            let uniform = if end { [0.0, unit(v)] } else { [unit(u), unit(v)] };
            let d = cosine_weighted(n, uniform);
            prop_assert!((d.length() - 1.0).abs() < 1e-8);
            prop_assert!(d.as_vec3().as_dvec3().dot(n) > 3e-4);
        }
    }

    #[test]
    fn series_agree_with_the_library() {
        for i in -1000..=1000 {
            let x = FRAC_PI_4 * f64::from(i) / 1000.0;
            let (sin, cos) = sin_cos(x);
            assert!((sin - x.sin()).abs() < 2e-9 && (cos - x.cos()).abs() < 2e-9, "{x}");
        }
    }

    #[test]
    fn moments_are_those_of_a_cosine() {
        // E[cos] = 2/3, E[cos²] = 1/2, E[x] = E[y] = E[xy] = 0, E[x²] = 1/4. Each has a variance below 1/4, so that six
        // standard deviations of the mean of n are below 3 / √n.
        const N: u32 = 200_000;
        let n = DVec3::new(0.6, -0.48, 0.64).normalize();
        let (t, b) = basis(n);
        let mut sums = [0.0; 6];
        for i in 0..N {
            let d = cosine_weighted(n, random::pair(3, i, 1));
            let (x, y, z) = (d.dot(t), d.dot(b), d.dot(n));
            for (sum, value) in sums.iter_mut().zip([z, z * z, x, y, x * y, x * x]) {
                *sum += value / f64::from(N);
            }
        }
        for (mean, expected) in sums.into_iter().zip([2.0 / 3.0, 0.5, 0.0, 0.0, 0.0, 0.25]) {
            assert!((mean - expected).abs() < 3.0 / f64::from(N).sqrt(), "{mean} instead of {expected}");
        }
    }
}
