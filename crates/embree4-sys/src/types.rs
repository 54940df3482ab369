//! The C types of Embree 4's interface: `include/embree4/*.h` of its sources.
//!
//! Enumerations are numbers with names, since a newer library may return values that this list lacks.

use core::ffi::{c_int, c_uint, c_void};
use core::ops::BitOr;

/// The id of no geometry, no primitive and no instance.
pub const RTC_INVALID_GEOMETRY_ID: c_uint = c_uint::MAX;

/// What an [`RTCDevice`] points to.
#[derive(Debug)]
#[repr(C)]
pub struct RTCDeviceTy {
    opaque: [u8; 0],
}

/// What an [`RTCScene`] points to.
#[derive(Debug)]
#[repr(C)]
pub struct RTCSceneTy {
    opaque: [u8; 0],
}

/// What an [`RTCGeometry`] points to.
#[derive(Debug)]
#[repr(C)]
pub struct RTCGeometryTy {
    opaque: [u8; 0],
}

/// A device: Embree's state and threads.
pub type RTCDevice = *mut RTCDeviceTy;
/// A scene: geometries and the tree over them.
pub type RTCScene = *mut RTCSceneTy;
/// A geometry, such as a triangle mesh.
pub type RTCGeometry = *mut RTCGeometryTy;

/// Defines an enumeration of C as a number with named values.
macro_rules! enumeration {
    ($(#[$doc:meta])* $name:ident { $($(#[$value_doc:meta])* $value:ident = $number:expr,)* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(transparent)]
        pub struct $name(pub c_uint);

        impl $name {
            $($(#[$value_doc])* pub const $value: Self = Self($number);)*
        }
    };
}

enumeration! {
    /// What went wrong.
    RTCError {
        /// Nothing.
        NONE = 0,
        /// Anything else; also that there is no library.
        UNKNOWN = 1,
        /// An argument is wrong.
        INVALID_ARGUMENT = 2,
        /// The call is not allowed at this point.
        INVALID_OPERATION = 3,
        /// There is not enough memory.
        OUT_OF_MEMORY = 4,
        /// The processor lacks instructions.
        UNSUPPORTED_CPU = 5,
        /// A callback cancelled the operation.
        CANCELLED = 6,
    }
}

enumeration! {
    /// How much time a build may take.
    RTCBuildQuality {
        /// Morton codes.
        LOW = 0,
        /// Binned surface area heuristic; what a scene has unless told otherwise.
        MEDIUM = 1,
        /// With spatial splits.
        HIGH = 2,
        /// Boxes are refitted.
        REFIT = 3,
    }
}

impl Default for RTCBuildQuality {
    fn default() -> Self {
        Self::MEDIUM
    }
}

enumeration! {
    /// Properties of a scene; to be combined with `|`.
    RTCSceneFlags {
        /// None.
        NONE = 0,
        /// Built for frequent changes.
        DYNAMIC = 1 << 0,
        /// Less memory.
        COMPACT = 1 << 1,
        /// Conservative box tests, and triangle tests by Plücker coordinates.
        ROBUST = 1 << 2,
        /// The filter function of a query's arguments is called.
        FILTER_FUNCTION_IN_ARGUMENTS = 1 << 3,
    }
}

impl Default for RTCSceneFlags {
    fn default() -> Self {
        Self::NONE
    }
}

impl BitOr for RTCSceneFlags {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

enumeration! {
    /// Kinds of geometry.
    RTCGeometryType {
        /// A triangle mesh.
        TRIANGLE = 0,
        /// Primitives with callbacks of the user's.
        USER = 120,
    }
}

enumeration! {
    /// What a buffer is for.
    RTCBufferType {
        /// Vertex indices.
        INDEX = 0,
        /// Vertices.
        VERTEX = 1,
    }
}

enumeration! {
    /// The elements of a buffer.
    RTCFormat {
        /// Three 32-bit unsigned integers.
        UINT3 = 0x5003,
        /// Three 32-bit floating-point numbers.
        FLOAT3 = 0x9003,
    }
}

enumeration! {
    /// What can be asked of a device.
    RTCDeviceProperty {
        /// The first part of the version.
        VERSION_MAJOR = 1,
        /// The second part of the version.
        VERSION_MINOR = 2,
        /// The third part of the version.
        VERSION_PATCH = 3,
    }
}

enumeration! {
    /// How a query is made; to be combined bit by bit.
    RTCRayQueryFlags {
        /// For incoherent rays.
        INCOHERENT = 0,
        /// The filter function of the arguments is called for every geometry.
        INVOKE_ARGUMENT_FILTER = 1 << 1,
        /// For coherent rays.
        COHERENT = 1 << 16,
    }
}

enumeration! {
    /// Kinds of primitives and callbacks that a query may meet.
    RTCFeatureFlags {
        /// Whatever there is.
        ALL = c_uint::MAX,
    }
}

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

/// What a bounds function is given.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct RTCBoundsFunctionArguments {
    /// The geometry's user data.
    pub geometryUserPtr: *mut c_void,
    /// The primitive.
    pub primID: c_uint,
    /// The moment.
    pub timeStep: c_uint,
    /// Where the box goes.
    pub bounds_o: *mut RTCBounds,
}

/// What an intersection function is given.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct RTCIntersectFunctionNArguments {
    /// For each ray, −1 if it takes part.
    pub valid: *mut c_int,
    /// The geometry's user data.
    pub geometryUserPtr: *mut c_void,
    /// The primitive.
    pub primID: c_uint,
    /// The query's state.
    pub context: *mut RTCRayQueryContext,
    /// Rays and hits, field by field.
    pub rayhit: *mut c_void,
    /// Number of rays.
    pub N: c_uint,
    /// The geometry.
    pub geomID: c_uint,
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

/// Gives the box of a primitive.
pub type RTCBoundsFunction = Option<unsafe extern "C" fn(*const RTCBoundsFunctionArguments)>;
/// Intersects rays with a primitive.
pub type RTCIntersectFunctionN = Option<unsafe extern "C" fn(*const RTCIntersectFunctionNArguments)>;
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
    /// Intersects user geometry.
    pub intersect: RTCIntersectFunctionN,
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
            intersect: None,
            minWidthDistanceFactor: 0.0,
        }
    }
}

// The sizes that Embree's headers make, and the room that hits need.
const _: () = {
    assert!(size_of::<RTCRay>() == 48 && size_of::<RTCHit>() == 32);
    assert!(size_of::<RTCRayHit>() == 96 && core::mem::offset_of!(RTCRayHit, hit) == 48);
    assert!(size_of::<RTCRay16>() == 768 && size_of::<RTCHit16>() == 576 && size_of::<RTCRayHit16>() == 1344);
};
