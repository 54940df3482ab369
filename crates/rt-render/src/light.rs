//! The light of a picture: a sky, a soft sun, and what two surfaces hand each other.

use glam::Vec3;
use rt_scene::View;
use rt_scene::streams::Sun;

/// Radiance of the sun's disc times its solid angle, relative to a white sky of 1 (whose irradiance is π): a hazy sun,
/// which lights a surface that faces it somewhat more than the whole sky does and leaves shadows readable.
const SUN_IRRADIANCE: Vec3 = Vec3::new(5.6, 5.0, 4.2);

/// Share of the zenith's light that a path which ends on a surface is given: the bounces not traced.
const FILL: f32 = 0.3;

/// Sky and sun of one picture.
#[derive(Clone, Copy, Debug)]
pub struct Light {
    up: Vec3,
    pub(crate) sun: Sun,
    /// Distance over which a surface is felt to stand in the light's way.
    reach: f32,
}

impl Light {
    /// Light for the scene seen from `view`, of size `extent` (length of the diagonal of its bounds).
    #[must_use]
    pub fn new(view: &View, extent: f32) -> Self {
        let up = view.up.try_normalize().unwrap_or(Vec3::Y);
        // The distance to the subject, not the extent, says how large things are where the ground is huge.
        let reach = (0.25 * extent).min(view.eye.distance(view.target)).max(f32::MIN_POSITIVE);
        Self { up, sun: Sun::beside(view), reach }
    }

    /// Radiance from outside the scene along a direction of any length.
    pub(crate) fn sky(&self, direction: Vec3) -> Vec3 {
        const ZENITH: Vec3 = Vec3::new(0.30, 0.52, 0.95);
        const HORIZON: Vec3 = Vec3::new(0.86, 0.93, 1.0);
        const GROUND: Vec3 = Vec3::new(0.34, 0.33, 0.31);
        let height = direction.try_normalize().map_or(0.0, |d| d.dot(self.up));
        if height >= 0.0 { HORIZON.lerp(ZENITH, height.sqrt()) } else { HORIZON.lerp(GROUND, (-height * 8.0).min(1.0)) }
    }

    /// Light a surface sends on from the sun, per unit of albedo; `facing` is the cosine to the sun.
    pub(crate) fn sunlight(&self, facing: f32) -> Vec3 {
        SUN_IRRADIANCE * (facing.max(0.0) * core::f32::consts::FRAC_1_PI)
    }

    /// Stand-in for the light of bounces that are not traced: less where the surface met is near, after S. Zhukov,
    /// A. Iones and G. Kronin, *An Ambient Light Illumination Model* (1998).
    pub(crate) fn fill(&self, distance: f32) -> Vec3 {
        Vec3::new(0.8, 0.87, 1.0) * (FILL * (1.0 - (-distance / self.reach).exp()))
    }
}

/// Luminance of the 97th percentile of a picture's pixels after exposure: below the tone curve's shoulder, so that a
/// white floor in the sun still shows its shading.
const BRIGHT: f32 = 0.7;

/// Factor that brings a picture to a pleasant brightness: the 97th percentile of the luminance of lit pixels becomes
/// [`BRIGHT`], which neither a bright sky nor a dark corner moves much.
pub(crate) fn exposure<I: Iterator<Item = Vec3>>(radiance: impl Fn() -> I) -> f32 {
    let luminance = |c: Vec3| 0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z;
    let lit = || radiance().map(luminance).filter(|&l| l > 0.0 && l.is_finite()).map(f32::to_bits);
    // Positive numbers are in the order of their bits: of the upper half of those first, of the lower half then. So
    // nothing that grows with the picture is held.
    let (upper, rank) = selected(lit().map(|bits| bits >> 16), |count| count.saturating_sub(1) * 97 / 100);
    let (lower, _) = selected(lit().filter(|bits| bits >> 16 == upper).map(|bits| bits & 0xffff), |_| rank);
    match f32::from_bits(upper << 16 | lower) {
        0.0 => 1.0,
        bright => BRIGHT / bright,
    }
}

/// The number below 2¹⁶ that has the rank that is asked for (which is told how many there are) among `numbers`, and the
/// rank among those equal to it; 0 where there is none.
fn selected(numbers: impl Iterator<Item = u32>, rank: impl Fn(u64) -> u64) -> (u32, u64) {
    let mut counts = vec![0_u64; 1 << 16];
    let mut all = 0;
    for number in numbers {
        counts[number as usize] += 1;
        all += 1;
    }
    let mut rank = rank(all);
    for (number, count) in (0..).zip(counts) {
        if rank < count {
            return (number, rank);
        }
        rank -= count;
    }
    (0, 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light() -> Light {
        let view = View { eye: Vec3::new(0.0, 1.0, 5.0), target: Vec3::ZERO, up: Vec3::Y, fov_degrees: 45.0 };
        Light::new(&view, 10.0)
    }

    #[test]
    fn light_is_finite_everywhere() {
        for d in [Vec3::ZERO, Vec3::Y, Vec3::NEG_Y, Vec3::splat(1e30), Vec3::new(1e-30, 0.0, 0.0)] {
            assert!(light().sky(d).is_finite());
        }
        assert!(light().fill(f32::INFINITY).is_finite());
        assert!(light().fill(0.0) == Vec3::ZERO);
    }

    #[test]
    fn exposure_ignores_outliers() {
        let mut pixels = vec![Vec3::splat(0.5); 1000];
        pixels[0] = Vec3::splat(1e6);
        assert!((exposure(|| pixels.iter().copied()) - 2.0 * BRIGHT).abs() < 1e-3);
        assert_eq!(exposure(|| [Vec3::ZERO, Vec3::NAN].into_iter()), 1.0);
        assert_eq!(exposure(std::iter::empty), 1.0);
    }

    /// Fails when the lower half of the bits is left out, or a rank is counted from 1.
    #[test]
    fn exposure_is_that_of_the_sorted_luminances() {
        for count in [1, 2, 33, 100, 1234] {
            let number = |i: u32| rt_core::random::unit(rt_core::random::pcg3d([i, count, 0])[0]) + 1e-3;
            let pixels: Vec<Vec3> = (0..count).map(|i| Vec3::splat(number(i))).collect();
            let mut sorted: Vec<f32> = pixels.iter().map(|c| 0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z).collect();
            sorted.sort_by(f32::total_cmp);
            let expected = BRIGHT / sorted[(count as usize - 1) * 97 / 100];
            assert_eq!(exposure(|| pixels.iter().copied()), expected, "{count}");
        }
    }
}
