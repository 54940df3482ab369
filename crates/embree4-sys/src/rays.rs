//! Rays and hits: `rtcore_ray.h` of Embree 4.

use crate::enums::RTC_INVALID_GEOMETRY_ID;
use core::ffi::{c_int, c_uint};

/// A ray segment.
#[repr(C, align(16))]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RTCRay {
    /// Origin.
    pub org_x: f32,
    /// Origin.
    pub org_y: f32,
    /// Origin.
    pub org_z: f32,
    /// Smallest accepted distance, not negative.
    pub tnear: f32,
    /// Direction.
    pub dir_x: f32,
    /// Direction.
    pub dir_y: f32,
    /// Direction.
    pub dir_z: f32,
    /// Moment, for motion blur.
    pub time: f32,
    /// Largest accepted distance; after a query the hit's, or −∞ where the ray is occluded.
    pub tfar: f32,
    /// Geometries whose mask has no bit in common are not hit.
    pub mask: c_uint,
    /// For the caller's use: here the primitive that filtered queries leave out, [`RTC_INVALID_GEOMETRY_ID`] for none.
    pub id: c_uint,
    /// Must be 0.
    pub flags: c_uint,
}

impl RTCRay {
    /// A ray that hits nothing, since it ends before it begins: it takes no part in a packet.
    pub const NOTHING: Self = Self::new([0.0; 3], [0.0, 0.0, 1.0], 1.0, -1.0);

    /// A ray that may hit every geometry.
    #[must_use]
    pub const fn new(origin: [f32; 3], direction: [f32; 3], tnear: f32, tfar: f32) -> Self {
        let ([org_x, org_y, org_z], [dir_x, dir_y, dir_z]) = (origin, direction);
        let (time, mask, id) = (0.0, c_uint::MAX, RTC_INVALID_GEOMETRY_ID);
        Self { org_x, org_y, org_z, tnear, dir_x, dir_y, dir_z, time, tfar, mask, id, flags: 0 }
    }

    /// The same ray, leaving out a primitive in filtered queries.
    #[must_use]
    pub const fn leaving_out(self, primitive: c_uint) -> Self {
        Self { id: primitive, ..self }
    }
}

/// A hit.
#[repr(C, align(16))]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RTCHit {
    /// Normal of the triangle, not normalised.
    pub Ng_x: f32,
    /// Normal of the triangle, not normalised.
    pub Ng_y: f32,
    /// Normal of the triangle, not normalised.
    pub Ng_z: f32,
    /// Weight of the second vertex.
    pub u: f32,
    /// Weight of the third vertex.
    pub v: f32,
    /// Position of the triangle in its mesh.
    pub primID: c_uint,
    /// The geometry, or [`RTC_INVALID_GEOMETRY_ID`] for a miss.
    pub geomID: c_uint,
    /// The instance.
    pub instID: [c_uint; 1],
    /// The primitive of an instance array. Libraries before 4.3, whose hits are shorter, do not write it.
    pub instPrimID: [c_uint; 1],
}

impl Default for RTCHit {
    fn default() -> Self {
        let (zero, none) = (0.0, RTC_INVALID_GEOMETRY_ID);
        let (primID, geomID, instID, instPrimID) = (none, none, [none], [none]);
        Self { Ng_x: zero, Ng_y: zero, Ng_z: zero, u: zero, v: zero, primID, geomID, instID, instPrimID }
    }
}

/// A ray and its hit.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RTCRayHit {
    /// The ray.
    pub ray: RTCRay,
    /// The hit.
    pub hit: RTCHit,
}

/// Sixteen rays.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RTCRay16 {
    /// Origins.
    pub org_x: [f32; 16],
    /// Origins.
    pub org_y: [f32; 16],
    /// Origins.
    pub org_z: [f32; 16],
    /// Smallest accepted distances.
    pub tnear: [f32; 16],
    /// Directions.
    pub dir_x: [f32; 16],
    /// Directions.
    pub dir_y: [f32; 16],
    /// Directions.
    pub dir_z: [f32; 16],
    /// Moments.
    pub time: [f32; 16],
    /// Largest accepted distances; after a query the hits'.
    pub tfar: [f32; 16],
    /// Masks.
    pub mask: [c_uint; 16],
    /// As in [`RTCRay`].
    pub id: [c_uint; 16],
    /// Must be 0.
    pub flags: [c_uint; 16],
}

impl RTCRay16 {
    /// Makes a ray the one at `slot`, below 16.
    #[inline]
    pub const fn set(&mut self, slot: usize, ray: &RTCRay) {
        (self.org_x[slot], self.org_y[slot], self.org_z[slot]) = (ray.org_x, ray.org_y, ray.org_z);
        (self.dir_x[slot], self.dir_y[slot], self.dir_z[slot]) = (ray.dir_x, ray.dir_y, ray.dir_z);
        (self.tnear[slot], self.time[slot], self.tfar[slot]) = (ray.tnear, ray.time, ray.tfar);
        (self.mask[slot], self.id[slot], self.flags[slot]) = (ray.mask, ray.id, ray.flags);
    }
}

/// Sixteen hits. Libraries before 4.3 do not write `instPrimID`.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RTCHit16 {
    /// Normals.
    pub Ng_x: [f32; 16],
    /// Normals.
    pub Ng_y: [f32; 16],
    /// Normals.
    pub Ng_z: [f32; 16],
    /// Weights of the second vertices.
    pub u: [f32; 16],
    /// Weights of the third vertices.
    pub v: [f32; 16],
    /// Triangles.
    pub primID: [c_uint; 16],
    /// Geometries, or [`RTC_INVALID_GEOMETRY_ID`] for misses.
    pub geomID: [c_uint; 16],
    /// Instances.
    pub instID: [[c_uint; 16]; 1],
    /// Primitives of instance arrays.
    pub instPrimID: [[c_uint; 16]; 1],
}

impl Default for RTCHit16 {
    fn default() -> Self {
        let (zero, none) = ([0.0; 16], [RTC_INVALID_GEOMETRY_ID; 16]);
        Self {
            Ng_x: zero,
            Ng_y: zero,
            Ng_z: zero,
            u: zero,
            v: zero,
            primID: none,
            geomID: none,
            instID: [none],
            instPrimID: [none],
        }
    }
}

/// Sixteen rays and their hits.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RTCRayHit16 {
    /// The rays.
    pub ray: RTCRay16,
    /// The hits.
    pub hit: RTCHit16,
}

/// Which of sixteen rays take part: −1 for those that do, 0 for others.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Valid16(pub [c_int; 16]);

// The sizes that the headers of Embree 4.3 and later make.
const _: () = {
    assert!(size_of::<RTCRay>() == 48 && size_of::<RTCHit>() == 48);
    assert!(size_of::<RTCRayHit>() == 96 && core::mem::offset_of!(RTCRayHit, hit) == 48);
    assert!(size_of::<RTCRay16>() == 768 && size_of::<RTCHit16>() == 576 && size_of::<RTCRayHit16>() == 1344);
};
