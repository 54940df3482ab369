//! The functions of Embree's interface that are used here, each looked up in the library when it is loaded.

use crate::arguments::*;
use crate::enums::*;
use crate::library;
use crate::rays::*;
use core::ffi::{c_char, c_int, c_uint, c_void};
use core::ptr::null_mut;
use libloading::Library;

/// Defines the table of functions and, for each, a function of the same name with an answer for a missing library.
macro_rules! functions {
    ($($(#[$doc:meta])* $name:ident($($argument:ident: $type:ty),*) -> $result:ty, else $missing:expr;)*) => {
        /// The addresses of the functions in a library.
        #[derive(Debug)]
        pub(crate) struct Functions {
            $(pub(crate) $name: unsafe extern "C" fn($($type),*) -> $result,)*
        }

        impl Functions {
            /// Looks all of them up.
            ///
            /// # Errors
            /// With the linker's message about the first one that is missing.
            pub(crate) fn find(library: &Library) -> Result<Self, libloading::Error> {
                Ok(Self {
                    // SAFETY: these are the signatures of Embree 4's headers for these names; the caller keeps the
                    // library loaded for as long as the process runs.
                    $($name: unsafe { *library.get(concat!(stringify!($name), "\0").as_bytes())? },)*
                })
            }
        }

        $(
            $(#[$doc])*
            ///
            /// # Safety
            /// As Embree's manual says of the function of this name.
            #[inline]
            pub unsafe fn $name($($argument: $type),*) -> $result {
                match library::functions() {
                    // SAFETY: the caller keeps what Embree's manual asks; the signature is that of its headers.
                    Ok(functions) => unsafe { (functions.$name)($($argument),*) },
                    Err(_) => $missing,
                }
            }
        )*
    };
}

functions! {
    /// Makes a device; `config` is null or ends with a zero byte.
    rtcNewDevice(config: *const c_char) -> RTCDevice, else null_mut();
    /// Releases a device.
    rtcReleaseDevice(device: RTCDevice) -> (), else ();
    /// The device's first error since this was asked, or that of the thread's last failed [`rtcNewDevice`].
    rtcGetDeviceError(device: RTCDevice) -> RTCError, else RTCError::UNKNOWN;
    /// A number that describes the device or the library.
    rtcGetDeviceProperty(device: RTCDevice, property: RTCDeviceProperty) -> isize, else 0;
    /// Makes an empty scene.
    rtcNewScene(device: RTCDevice) -> RTCScene, else null_mut();
    /// Releases a scene.
    rtcReleaseScene(scene: RTCScene) -> (), else ();
    /// Sets the quality that the scene's tree is built with.
    rtcSetSceneBuildQuality(scene: RTCScene, quality: RTCBuildQuality) -> (), else ();
    /// Sets the scene's properties.
    rtcSetSceneFlags(scene: RTCScene, flags: RTCSceneFlags) -> (), else ();
    /// Adds a geometry and returns its id.
    rtcAttachGeometry(scene: RTCScene, geometry: RTCGeometry) -> c_uint, else RTC_INVALID_GEOMETRY_ID;
    /// Builds the tree.
    rtcCommitScene(scene: RTCScene) -> (), else ();
    /// Makes a geometry.
    rtcNewGeometry(device: RTCDevice, kind: RTCGeometryType) -> RTCGeometry, else null_mut();
    /// Releases a geometry.
    rtcReleaseGeometry(geometry: RTCGeometry) -> (), else ();
    /// Makes changes of a geometry known.
    rtcCommitGeometry(geometry: RTCGeometry) -> (), else ();
    /// Makes a buffer of a geometry and returns its memory.
    rtcSetNewGeometryBuffer(
        geometry: RTCGeometry,
        kind: RTCBufferType,
        slot: c_uint,
        format: RTCFormat,
        stride: usize,
        count: usize
    ) -> *mut c_void, else null_mut();
    /// Finds the nearest hit.
    rtcIntersect1(scene: RTCScene, rayhit: *mut RTCRayHit, arguments: *mut RTCIntersectArguments) -> (), else ();
    /// Finds the nearest hits of sixteen rays.
    rtcIntersect16(
        valid: *const c_int,
        scene: RTCScene,
        rayhit: *mut RTCRayHit16,
        arguments: *mut RTCIntersectArguments
    ) -> (), else ();
    /// Finds out whether anything is hit; then sets `tfar` to −∞.
    rtcOccluded1(scene: RTCScene, ray: *mut RTCRay, arguments: *mut RTCOccludedArguments) -> (), else ();
    /// The same for sixteen rays.
    rtcOccluded16(
        valid: *const c_int,
        scene: RTCScene,
        ray: *mut RTCRay16,
        arguments: *mut RTCOccludedArguments
    ) -> (), else ();
}
