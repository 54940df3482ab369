//! Rays, hits and boxes: `rtcore_ray.h` and `rtcore_common.h` of Embree 4, with room for what newer versions write.

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
    /// For the caller's use.
    pub id: c_uint,
    /// Must be 0.
    pub flags: c_uint,
}

impl RTCRay {
    /// A ray that may hit every geometry.
    #[must_use]
    pub const fn new(origin: [f32; 3], direction: [f32; 3], tnear: f32, tfar: f32) -> Self {
        let ([org_x, org_y, org_z], [dir_x, dir_y, dir_z]) = (origin, direction);
        let time = 0.0;
        Self { org_x, org_y, org_z, tnear, dir_x, dir_y, dir_z, time, tfar, mask: c_uint::MAX, id: 0, flags: 0 }
    }
}

/// A hit as Embree 4.2 has it, 32 bytes. Since 4.3 another number, `instPrimID`, follows `instID`, and each hit writes
/// it: see [`RTCRayHit`] for the room. A field for it would break `embree4-rs`, which lists all fields.
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
}

impl Default for RTCHit {
    fn default() -> Self {
        let none = RTC_INVALID_GEOMETRY_ID;
        Self { Ng_x: 0.0, Ng_y: 0.0, Ng_z: 0.0, u: 0.0, v: 0.0, primID: none, geomID: none, instID: [none] }
    }
}

/// A ray and its hit: 48 and 32 bytes, and 16 of room behind them, which the alignment makes. Embree 4.3 and later have
/// `instPrimID` in the first four of the sixteen.
#[repr(C, align(32))]
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
    /// For the caller's use.
    pub id: [c_uint; 16],
    /// Must be 0.
    pub flags: [c_uint; 16],
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

/// An axis-aligned box.
#[repr(C, align(16))]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RTCBounds {
    /// Smallest corner.
    pub lower_x: f32,
    /// Smallest corner.
    pub lower_y: f32,
    /// Smallest corner.
    pub lower_z: f32,
    /// Nothing.
    pub align0: f32,
    /// Largest corner.
    pub upper_x: f32,
    /// Largest corner.
    pub upper_y: f32,
    /// Largest corner.
    pub upper_z: f32,
    /// Nothing.
    pub align1: f32,
}

// The sizes that Embree's headers make, and the room that hits need.
const _: () = {
    assert!(size_of::<RTCRay>() == 48 && size_of::<RTCHit>() == 32);
    assert!(size_of::<RTCRayHit>() == 96 && core::mem::offset_of!(RTCRayHit, hit) == 48);
    assert!(size_of::<RTCRay16>() == 768 && size_of::<RTCHit16>() == 576 && size_of::<RTCRayHit16>() == 1344);
};
