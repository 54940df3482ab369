//! The sun of a scene.

use crate::View;
use glam::Vec3;
use rt_core::bounce::{Aim, basis};

/// A directional light with an angular radius, such as the sun.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    middle: Vec3,
    radii: [Vec3; 2],
}

/// Angular radius of the sun beside a camera, in radians: ten times the real one, for penumbras that one can see.
const RADIUS: f32 = 0.045;

/// Its height above the horizon.
const ELEVATION_DEGREES: f32 = 48.0;

/// How far it stands to the left of the camera, seen from the target.
const AZIMUTH_DEGREES: f32 = 50.0;

impl Sun {
    /// Angular radius of the sun as seen from the earth, in radians: half of 0.533 degrees.
    pub const REAL_RADIUS: f32 = 0.004_65;

    /// A sun in the direction `towards` (of any length), whose disc has the angular radius `radius` in radians; 0 gives
    /// hard shadows.
    ///
    /// `None` when `towards` is zero or not finite, or `radius` is not in `0 ≤ radius < π/2`.
    #[must_use]
    pub fn new(towards: Vec3, radius: f32) -> Option<Self> {
        let middle = towards.as_dvec3().try_normalize()?.as_vec3();
        if !(0.0..std::f32::consts::FRAC_PI_2).contains(&radius) {
            return None;
        }
        let (tangent, bitangent) = basis(middle);
        let size = libm::tan(f64::from(radius)) as f32;
        Some(Self { middle, radii: [tangent * size, bitangent * size] })
    }

    /// The sun that lights what `view` shows: above and behind the camera, to its left, so that shadows are seen.
    /// Pictures and measurements have the same one.
    #[must_use]
    pub fn beside(view: &View) -> Self {
        let up = view.up.try_normalize().unwrap_or(Vec3::Y);
        let back = (view.eye - view.target).reject_from_normalized(up).try_normalize();
        let back = back.unwrap_or_else(|| up.any_orthonormal_vector());
        let (sin_a, cos_a) = AZIMUTH_DEGREES.to_radians().sin_cos();
        let (sin_e, cos_e) = ELEVATION_DEGREES.to_radians().sin_cos();
        let left = back.cross(up);
        let towards = (back * cos_a + left * sin_a) * cos_e + up * sin_e;
        Self::new(towards, RADIUS).expect("a unit vector and a constant below a right angle make a sun")
    }

    /// Unit vector towards the middle of the sun.
    #[must_use]
    pub const fn direction(&self) -> Vec3 {
        self.middle
    }

    /// Where rays to the sun go: to points spread evenly over a flat disc that is as large as the sun seems.
    #[must_use]
    pub const fn aim(&self) -> Aim {
        Aim::Disc { middle: self.middle, radii: self.radii }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::random;

    #[test]
    fn suns_have_a_direction_and_a_size() {
        assert!(Sun::new(Vec3::ZERO, 0.1).is_none());
        assert!(Sun::new(Vec3::NAN, 0.1).is_none());
        assert!(Sun::new(Vec3::Y, -0.1).is_none());
        assert!(Sun::new(Vec3::Y, f32::NAN).is_none());
        assert!(Sun::new(Vec3::Y, 2.0).is_none());
        let sun = Sun::new(Vec3::new(0.0, 1e-20, 1e-20), Sun::REAL_RADIUS).unwrap();
        for i in 0..1000 {
            let d = sun.aim().direction(Vec3::Z, random::pair(1, i, 0)).as_dvec3();
            assert!((d.length() - 1.0).abs() < 3e-7);
            // Of so small an angle the cosine says too little in single precision.
            assert!(d.cross(sun.direction().as_dvec3()).length() <= f64::from(Sun::REAL_RADIUS) + 2e-7);
        }
        assert_eq!(Sun::new(Vec3::Y, 0.0).unwrap().aim().direction(Vec3::Z, [0.3, 0.9]).normalize(), Vec3::Y);
    }

    #[test]
    fn the_sun_stands_above_and_on_the_camera_s_side() {
        let view = View { eye: Vec3::new(0.0, 1.0, 5.0), target: Vec3::ZERO, up: Vec3::Y, fov_degrees: 45.0 };
        let sun = Sun::beside(&view).direction();
        assert!((sun.length() - 1.0).abs() < 1e-5 && sun.y > 0.5 && sun.z > 0.0, "{sun}");
        let odd = View { eye: Vec3::Y, target: Vec3::ZERO, up: Vec3::ZERO, ..view };
        assert!(Sun::beside(&odd).direction().is_finite());
    }
}
