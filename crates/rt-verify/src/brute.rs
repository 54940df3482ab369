//! Every triangle tested by `rt_core::intersect`: hits without a tree.
//!
//! Unlike [`crate::reference`] this shares the kernels' own code, and is a thousand times as fast.

use rt_core::intersect::{self, Shear};
use rt_core::{Hit, Ray, Triangle};

/// The nearest hit of `ray` with `triangles`, whose ids are their positions; the triangle `origin` is left out.
#[must_use]
pub fn closest(triangles: &[Triangle], ray: &Ray, origin: u32) -> Hit {
    closest_among(triangles, 0..triangles.len() as u32, ray, origin)
}

/// [`closest`] with the triangles named by `ids` only.
#[must_use]
pub fn closest_among(triangles: &[Triangle], ids: impl IntoIterator<Item = u32>, ray: &Ray, origin: u32) -> Hit {
    hits(triangles, ids, ray, origin).fold(Hit::MISS, |best, hit| if hit.is_before(&best) { hit } else { best })
}

/// Whether `ray` hits anything but the triangle `origin`.
#[must_use]
pub fn any(triangles: &[Triangle], ray: &Ray, origin: u32) -> bool {
    hits(triangles, 0..triangles.len() as u32, ray, origin).next().is_some()
}

/// Every hit of `ray` with what `shows` of the triangles, but for the triangle `origin`: in order of distance, and of
/// ids where that is the same.
#[must_use]
pub fn all(triangles: &[Triangle], ray: &Ray, origin: u32, shows: impl Fn(u32) -> bool) -> Vec<Hit> {
    let ids = (0..triangles.len() as u32).filter(|&id| shows(id));
    let mut all: Vec<Hit> = hits(triangles, ids, ray, origin).collect();
    all.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.primitive.cmp(&b.primitive)));
    all
}

fn hits(
    triangles: &[Triangle],
    ids: impl IntoIterator<Item = u32>,
    ray: &Ray,
    origin: u32,
) -> impl Iterator<Item = Hit> {
    let shear = ray.is_valid().then(|| Shear::new(ray, 0, f64::INFINITY));
    ids.into_iter().filter(move |&id| id != origin).filter_map(move |id| {
        let triangle = triangles.get(id as usize).filter(|triangle| triangle.is_finite())?;
        shear?.hit(triangle, [ray.tmin, ray.tmax], id)
    })
}

/// Whether a triangle can be hit at all: finite, and its area is not zero.
#[must_use]
pub fn has_area(triangle: &Triangle) -> bool {
    triangle.is_finite() && intersect::has_area(triangle)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    // Guards against: the higher id winning a tie, the origin's triangle hit, limits forgotten.
    #[test]
    fn nearest_then_lowest_id() {
        let at = |z: f32| Triangle::new(Vec3::new(-1.0, -1.0, z), Vec3::new(3.0, -1.0, z), Vec3::new(-1.0, 3.0, z));
        let triangles = [at(2.0), at(1.0), at(1.0), at(-1.0)];
        let ray = Ray::new(Vec3::ZERO, Vec3::Z);
        assert_eq!(closest(&triangles, &ray, u32::MAX).primitive, 1);
        assert_eq!(closest(&triangles, &ray, 1).primitive, 2);
        assert_eq!(closest(&triangles, &ray.with_range(1.5, 9.0), u32::MAX).primitive, 0);
        assert_eq!(closest(&triangles, &ray.with_range(1.5, 1.6), u32::MAX), Hit::MISS);
        assert!(any(&triangles, &ray, 1) && !any(&triangles[..1], &ray, 0));
        let ids = |origin, hidden| {
            all(&triangles, &ray, origin, |id| id != hidden).iter().map(|hit| hit.primitive).collect::<Vec<_>>()
        };
        assert_eq!((ids(u32::MAX, 9), ids(1, 9), ids(1, 2)), (vec![1, 2, 0], vec![2, 0], vec![0]));
    }
}
