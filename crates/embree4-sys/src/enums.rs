//! Handles and enumerations of Embree 4's interface: `include/embree4/*.h` of its sources.
//!
//! Enumerations are numbers with names, since a newer library may return values that this list lacks.

use core::ffi::c_uint;
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

impl BitOr for RTCRayQueryFlags {
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
