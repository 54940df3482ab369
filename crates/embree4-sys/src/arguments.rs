//! What queries and callbacks are given: `rtcore_common.h`, `rtcore_geometry.h` and `rtcore_scene.h` of Embree 4.

use crate::enums::{RTC_INVALID_GEOMETRY_ID, RTCFeatureFlags, RTCRayQueryFlags};
use core::ffi::{c_int, c_uint, c_void};

/// The state of a query that callbacks may see. Libraries before 4.3 do not know `instPrimID`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RTCRayQueryContext {
    /// The instances that the query is in.
    pub instID: [c_uint; 1],
    /// The primitives of instance arrays that the query is in.
    pub instPrimID: [c_uint; 1],
}

impl Default for RTCRayQueryContext {
    fn default() -> Self {
        Self { instID: [RTC_INVALID_GEOMETRY_ID], instPrimID: [RTC_INVALID_GEOMETRY_ID] }
    }
}

/// What a filter function is given.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct RTCFilterFunctionNArguments {
    /// For each ray, −1 if it takes part; a filter sets 0 to reject its hit.
    pub valid: *mut c_int,
    /// The geometry's user data.
    pub geometryUserPtr: *mut c_void,
    /// The query's state.
    pub context: *mut RTCRayQueryContext,
    /// Rays, field by field.
    pub ray: *mut c_void,
    /// Hits, field by field.
    pub hit: *mut c_void,
    /// Number of rays.
    pub N: c_uint,
}

/// Accepts or rejects hits.
pub type RTCFilterFunctionN = Option<unsafe extern "C" fn(*const RTCFilterFunctionNArguments)>;

/// How a query for the nearest hit is made. Not to be copied, since it may point to what does not live long.
#[repr(C)]
#[derive(Debug)]
pub struct RTCIntersectArguments {
    /// Ways of working.
    pub flags: RTCRayQueryFlags,
    /// What the query may meet.
    pub feature_mask: RTCFeatureFlags,
    /// The query's state, or null.
    pub context: *mut RTCRayQueryContext,
    /// Accepts or rejects hits.
    pub filter: RTCFilterFunctionN,
    /// Intersects user geometry, of which there is none here: null.
    pub intersect: *mut c_void,
    /// For curves, in libraries that are configured for it.
    pub minWidthDistanceFactor: f32,
}

/// How a query for any hit is made: the same fields as [`RTCIntersectArguments`].
pub type RTCOccludedArguments = RTCIntersectArguments;

impl Default for RTCIntersectArguments {
    fn default() -> Self {
        Self {
            flags: RTCRayQueryFlags::INCOHERENT,
            feature_mask: RTCFeatureFlags::ALL,
            context: core::ptr::null_mut(),
            filter: None,
            intersect: core::ptr::null_mut(),
            minWidthDistanceFactor: 0.0,
        }
    }
}
