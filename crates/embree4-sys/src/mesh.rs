//! A scene of one triangle mesh, safe to use.

use crate::arguments::{RTCIntersectArguments, RTCOccludedArguments};
use crate::enums::*;
use crate::filter::{FilterContext, MOST, Occluder};
use crate::functions::*;
use crate::library::{LoadError, version};
use crate::rays::*;
use core::fmt;
use core::ptr::{from_mut, null, null_mut};

/// A committed scene of one triangle mesh.
#[derive(Debug)]
pub struct Mesh {
    scene: Scene,
    /// Behind the scene, since fields are dropped in order.
    _device: Device,
}

/// Why a [`Mesh`] could not be made.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum MeshError {
    /// There is no library.
    Missing(LoadError),
    /// A triangle names a vertex that is not there.
    Vertex {
        /// The triangle.
        triangle: usize,
        /// Number of vertices.
        vertices: usize,
    },
    /// Embree refused.
    Embree {
        /// What was asked.
        what: &'static str,
        /// What it answered.
        error: RTCError,
    },
}

impl fmt::Display for MeshError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing(error) => error.fmt(f),
            Self::Vertex { triangle, vertices } => {
                write!(f, "triangle {triangle} names a vertex beyond the {vertices} that there are")
            }
            Self::Embree { what, error } => write!(f, "Embree could not {what}: error {}", error.0),
        }
    }
}

impl std::error::Error for MeshError {}

impl From<LoadError> for MeshError {
    fn from(error: LoadError) -> Self {
        Self::Missing(error)
    }
}

/// A device, released when dropped.
#[derive(Debug)]
struct Device(RTCDevice);

/// A scene, released when dropped.
#[derive(Debug)]
struct Scene(RTCScene);

/// A geometry, released when dropped.
#[derive(Debug)]
struct Geometry(RTCGeometry);

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: it was made by `rtcNewDevice`, and what needs it was released or holds it.
        unsafe { rtcReleaseDevice(self.0) }
    }
}

impl Drop for Scene {
    fn drop(&mut self) {
        // SAFETY: it was made by `rtcNewScene` and is used by nobody else.
        unsafe { rtcReleaseScene(self.0) }
    }
}

impl Drop for Geometry {
    fn drop(&mut self) {
        // SAFETY: it was made by `rtcNewGeometry`; a scene that it is attached to holds it.
        unsafe { rtcReleaseGeometry(self.0) }
    }
}

// SAFETY: Embree's objects belong to no thread.
unsafe impl Send for Mesh {}
// SAFETY: a committed scene may be queried by any number of threads, and nothing else is done with it.
unsafe impl Sync for Mesh {}

impl Device {
    /// Turns the device's last error into ours.
    fn check(&self, what: &'static str) -> Result<(), MeshError> {
        // SAFETY: the device is alive.
        match unsafe { rtcGetDeviceError(self.0) } {
            RTCError::NONE => Ok(()),
            error => Err(MeshError::Embree { what, error }),
        }
    }
}

impl Mesh {
    /// Builds a scene.
    ///
    /// # Errors
    /// When there is no library, a triangle names a vertex that is not there, or Embree refuses.
    pub fn new(
        vertices: &[[f32; 3]],
        triangles: &[[u32; 3]],
        flags: RTCSceneFlags,
        quality: RTCBuildQuality,
    ) -> Result<Self, MeshError> {
        version()?;
        let outside = |triangle: &[u32; 3]| triangle.iter().any(|&vertex| vertex as usize >= vertices.len());
        if let Some(triangle) = triangles.iter().position(outside) {
            return Err(MeshError::Vertex { triangle, vertices: vertices.len() });
        }
        // SAFETY: a null configuration is the default one.
        let device = Device(unsafe { rtcNewDevice(null()) });
        device.check("make a device")?;
        // SAFETY: the device is alive.
        let scene = Scene(unsafe { rtcNewScene(device.0) });
        device.check("make a scene")?;
        // SAFETY: the scene is alive and not in use.
        unsafe {
            rtcSetSceneFlags(scene.0, flags);
            rtcSetSceneBuildQuality(scene.0, quality);
        }
        if !triangles.is_empty() {
            let geometry = geometry(&device, vertices, triangles)?;
            // SAFETY: both are alive; the scene holds the geometry from here on.
            unsafe { rtcAttachGeometry(scene.0, geometry.0) };
        }
        // SAFETY: the scene is alive, and nobody else knows it yet.
        unsafe { rtcCommitScene(scene.0) };
        device.check("build the tree")?;
        Ok(Self { scene, _device: device })
    }

    /// The nearest hit.
    #[inline]
    #[must_use]
    pub fn closest(&self, ray: RTCRay) -> Option<RTCRayHit> {
        let mut rayhit = RTCRayHit { ray, hit: RTCHit::default() };
        // SAFETY: the scene is committed, and the hit has the room that every version of the library needs.
        unsafe { rtcIntersect1(self.scene.0, &raw mut rayhit, null_mut()) };
        (rayhit.hit.geomID != RTC_INVALID_GEOMETRY_ID).then_some(rayhit)
    }

    /// The nearest hit but for the primitive that the ray leaves out. The scene must have the flag
    /// [`RTCSceneFlags::FILTER_FUNCTION_IN_ARGUMENTS`]; without it, none is left out.
    #[must_use]
    pub fn closest_filtered(&self, ray: RTCRay) -> Option<RTCRayHit> {
        let mut rayhit = RTCRayHit { ray, hit: RTCHit::default() };
        let mut context = FilterContext::of(&mut rayhit.ray);
        let mut arguments = context.arguments(RTCRayQueryFlags::INCOHERENT);
        // SAFETY: the scene is committed; the hit has the room that every version of the library needs; context and
        // arguments outlive the query.
        unsafe { rtcIntersect1(self.scene.0, &raw mut rayhit, &raw mut arguments) };
        (rayhit.hit.geomID != RTC_INVALID_GEOMETRY_ID).then_some(rayhit)
    }

    /// The nearest hits of sixteen rays, which are coherent if `flags` say so; `geomID` says which of them are hits.
    #[inline]
    pub fn closest_16(&self, rays: &mut RTCRayHit16, flags: RTCRayQueryFlags) {
        let valid = Valid16([-1; 16]);
        let mut arguments = RTCIntersectArguments { flags, ..RTCIntersectArguments::default() };
        // SAFETY: the scene is committed; mask and rays have room for sixteen, and the alignment that packets need; the
        // arguments outlive the query.
        unsafe { rtcIntersect16(valid.0.as_ptr(), self.scene.0, from_mut(rays), &raw mut arguments) }
    }

    /// Whether each of sixteen rays hits anything: then its `tfar` becomes −∞.
    #[inline]
    pub fn occluded_16(&self, rays: &mut RTCRay16, flags: RTCRayQueryFlags) {
        let valid = Valid16([-1; 16]);
        let mut arguments = RTCOccludedArguments { flags, ..RTCOccludedArguments::default() };
        // SAFETY: the scene is committed; mask and rays have room for sixteen, and the alignment that packets need; the
        // arguments outlive the query.
        unsafe { rtcOccluded16(valid.0.as_ptr(), self.scene.0, from_mut(rays), &raw mut arguments) }
    }

    /// Whether the ray hits anything.
    #[inline]
    #[must_use]
    pub fn is_occluded(&self, mut ray: RTCRay) -> bool {
        // SAFETY: the scene is committed.
        unsafe { rtcOccluded1(self.scene.0, &raw mut ray, null_mut()) };
        ray.tfar == f32::NEG_INFINITY
    }

    /// Any triangle that the ray hits but for the primitive that it leaves out. The scene must have the flag
    /// [`RTCSceneFlags::FILTER_FUNCTION_IN_ARGUMENTS`]; without it, none is found.
    #[must_use]
    pub fn occluder(&self, mut ray: RTCRay) -> Option<Occluder> {
        let mut context = FilterContext::of(&mut ray);
        let mut arguments = context.arguments(RTCRayQueryFlags::INCOHERENT);
        // SAFETY: the scene is committed; context and arguments outlive the query.
        unsafe { rtcOccluded1(self.scene.0, &raw mut ray, &raw mut arguments) };
        if ray.tfar == f32::NEG_INFINITY { context.last[0] } else { None }
    }

    /// The same of sixteen rays, which are coherent if `flags` say so. What they leave out is forgotten.
    #[must_use]
    pub fn occluders_16(&self, rays: &mut RTCRay16, flags: RTCRayQueryFlags) -> [Option<Occluder>; MOST] {
        let valid = Valid16([-1; 16]);
        let mut context = FilterContext::of_16(rays);
        let mut arguments = context.arguments(flags);
        // SAFETY: the scene is committed; mask and rays have room for sixteen, and the alignment that packets need;
        // context and arguments outlive the query.
        unsafe { rtcOccluded16(valid.0.as_ptr(), self.scene.0, from_mut(rays), &raw mut arguments) };
        core::array::from_fn(|slot| context.last[slot].filter(|_| rays.tfar[slot] == f32::NEG_INFINITY))
    }
}

/// A committed geometry with copies of the vertices and triangles, whose indices were checked.
fn geometry(device: &Device, vertices: &[[f32; 3]], triangles: &[[u32; 3]]) -> Result<Geometry, MeshError> {
    // SAFETY: the device is alive.
    let geometry = Geometry(unsafe { rtcNewGeometry(device.0, RTCGeometryType::TRIANGLE) });
    device.check("make a geometry")?;
    buffer(&geometry, RTCBufferType::VERTEX, RTCFormat::FLOAT3, vertices);
    buffer(&geometry, RTCBufferType::INDEX, RTCFormat::UINT3, triangles);
    device.check("make buffers")?;
    // SAFETY: the geometry is alive.
    unsafe { rtcCommitGeometry(geometry.0) };
    device.check("take the mesh")?;
    Ok(geometry)
}

/// Makes a buffer and fills it; where that fails, the device knows the error.
fn buffer<T: Copy>(geometry: &Geometry, kind: RTCBufferType, format: RTCFormat, items: &[[T; 3]]) {
    // SAFETY: the geometry is alive; items are three numbers of 32 bits, as the formats say.
    unsafe {
        let memory = rtcSetNewGeometryBuffer(geometry.0, kind, 0, format, size_of::<[T; 3]>(), items.len());
        if !memory.is_null() {
            memory.cast::<[T; 3]>().copy_from_nonoverlapping(items.as_ptr(), items.len());
        }
    }
}
