//! Leaves as planes: where a ray would have been shortened, without a triangle.

use super::super::slabs::LocalRay;
use super::super::walk::Visitor;
use core::ops::ControlFlow;
use glam::{DVec3, Vec3};
use rt_core::{Aabb, Hit, TestCounts, Triangle, random};

/// What a leaf's triangles are to a ray that entered its box: a plane that is met inside, and how often it is met. 16
/// bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct LeafPlane {
    /// The normal in octahedral coordinates (Q. Meyer and others, *On Floating-Point Normal Vectors*, 2010), in
    /// 1/32767.
    normal: [i16; 2],
    /// Distance of the plane from the origin along the normal, in local units.
    offset: f32,
    /// Share of the plane inside the box that triangles cover, in 0 ..= 1.
    coverage: f32,
    /// Diagonal of the box, in local units: no ray is longer inside.
    diagonal: f32,
}

/// A flat box is given this share of its diagonal as thickness, so that its volume over its width stays the area of
/// its section.
const LEAST_THICKNESS: f32 = 1e-4;

impl LeafPlane {
    /// The plane through the triangles' common centre, along their mean area normal.
    pub(super) fn of(triangles: &[Triangle], bounds: &Aabb) -> Self {
        let (mut normal, mut centre, mut area) = (DVec3::ZERO, DVec3::ZERO, 0.0);
        for triangle in triangles {
            let given = triangle.area_normal();
            // Triangles are two-sided: all normals to one side.
            let own = if given.dot(normal) < 0.0 { -given } else { given };
            let twice = own.length();
            normal += own;
            area += twice;
            centre += (triangle.a.as_dvec3() + triangle.b.as_dvec3() + triangle.c.as_dvec3()) * (twice / 3.0);
        }
        let unit = normal.try_normalize().unwrap_or(DVec3::Z);
        let centre = if area > 0.0 { centre / area } else { bounds.min.as_dvec3() };
        let diagonal = bounds.extent().length();
        let extent = bounds.extent().max(Vec3::splat(LEAST_THICKNESS * diagonal)).as_dvec3();
        // Mean area of sections of the box with this normal: its volume over its width.
        let section = extent.x * extent.y * extent.z / unit.abs().dot(extent);
        // Over all directions a ray meets the triangles, facing whatever way, as often as their common area says.
        let covered = 0.5 * area;
        let coverage = if section > 0.0 { (covered / section).min(1.0) as f32 } else { 1.0 };
        Self { normal: packed(unit), offset: unit.dot(centre) as f32, coverage, diagonal }
    }

    fn normal(&self) -> Vec3 {
        let [x, y] = self.normal.map(|n| f32::from(n) / 32_767.0);
        let z = 1.0 - x.abs() - y.abs();
        let fold = (-z).max(0.0);
        Vec3::new(x - fold.copysign(x), y - fold.copysign(y), z).normalize_or(Vec3::Z)
    }
}

fn packed(unit: DVec3) -> [i16; 2] {
    let flat = unit / (unit.x.abs() + unit.y.abs() + unit.z.abs());
    let [x, y] = if flat.z >= 0.0 {
        [flat.x, flat.y]
    } else {
        [(1.0 - flat.y.abs()).copysign(flat.x), (1.0 - flat.x.abs()).copysign(flat.y)]
    };
    [x, y].map(|n| (n * 32_767.0) as i16)
}

/// Counts tests; a leaf's plane shortens the ray as often as its triangles cover it.
pub(super) struct PlaneWalk<'a> {
    planes: &'a [LeafPlane],
    ray: LocalRay,
    limit: f32,
    /// Where the ray begins.
    begin: f32,
    /// Length of a unit of distance.
    length: f32,
    counts: TestCounts,
}

impl<'a> Visitor<'a> for PlaneWalk<'a> {
    type Data = [LeafPlane];
    const COUNTS: bool = true;

    #[inline]
    fn begin(planes: &'a [LeafPlane], ray: LocalRay, _excluded: u32) -> Self {
        let [begin, limit] = [ray.given.tmin, ray.given.tmax].map(|t| ray.local_limit(t));
        Self { planes, limit, begin, length: ray.direction.length(), ray, counts: TestCounts::default() }
    }

    #[inline(always)]
    fn ray(&self) -> &LocalRay {
        &self.ray
    }

    #[inline(always)]
    fn boxes(&mut self, count: u32) {
        self.counts.boxes += count;
    }

    #[inline(always)]
    fn limit(&self) -> f32 {
        self.limit
    }

    #[inline(always)]
    fn leaf(&mut self, entry: f32, first: u32, count: u32) -> ControlFlow<()> {
        self.counts.triangles += count;
        let plane = &self.planes[first as usize];
        let normal = plane.normal();
        let t = (plane.offset - normal.dot(self.ray.origin)) / normal.dot(self.ray.direction);
        // A ray that begins inside the box most likely begins on the leaf's own surface, and does not meet it again.
        // False for NaN: a ray in the plane is not shortened.
        if entry > self.begin && t >= entry && t <= self.limit && (t - entry) * self.length <= plane.diagonal {
            // The same ray always decides alike.
            let [word, ..] = random::pcg3d([t.to_bits(), self.ray.direction.x.to_bits(), first]);
            if random::unit(word) < plane.coverage {
                self.limit = t;
            }
        }
        ControlFlow::Continue(())
    }

    #[inline]
    fn finish(self) -> (Hit, TestCounts) {
        (Hit::MISS, self.counts)
    }
}
