//! Leaving a primitive out of a query: the one a ray starts on.

use crate::arguments::*;
use crate::enums::*;
use crate::rays::*;
use core::ffi::c_uint;
use core::ptr::from_mut;

/// Positions of `u`, `v` and `primID` among the fields of a hit.
const HIT_FIELDS: [usize; 3] = [3, 4, 5];

/// Position of `tfar` among the fields of a ray.
const DISTANCE_FIELD: usize = 8;

/// A triangle that hides what is behind it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Occluder {
    /// Its position in the mesh.
    pub primitive: c_uint,
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// Weight of the second vertex.
    pub u: f32,
    /// Weight of the third vertex.
    pub v: f32,
}

/// A query's context with what the filter needs behind it.
#[repr(C)]
pub(crate) struct FilterContext {
    /// First, so that a pointer to it is one to the whole.
    context: RTCRayQueryContext,
    /// The primitive that is not hit.
    skip: c_uint,
    /// The last hit that was let through: the only one, in a query for any hit.
    pub(crate) last: Option<Occluder>,
}

impl FilterContext {
    pub(crate) fn new(skip: c_uint) -> Self {
        Self { context: RTCRayQueryContext::default(), skip, last: None }
    }

    /// Arguments that point to this context, and must not be used when it is gone.
    pub(crate) fn arguments(&mut self) -> RTCIntersectArguments {
        RTCIntersectArguments {
            flags: RTCRayQueryFlags::INVOKE_ARGUMENT_FILTER,
            context: from_mut(self).cast(),
            filter: Some(filter),
            ..RTCIntersectArguments::default()
        }
    }
}

/// Makes a query that does not hit `primitive`: its arguments are given to `query`. The scene must have the flag
/// [`RTCSceneFlags::FILTER_FUNCTION_IN_ARGUMENTS`].
pub fn without<R>(primitive: c_uint, query: impl FnOnce(&RTCIntersectArguments) -> R) -> R {
    query(&FilterContext::new(primitive).arguments())
}

/// Rejects hits of the primitive that is to be left out.
///
/// # Safety
/// Embree calls it, for queries whose context is the first field of a [`FilterContext`].
unsafe extern "C" fn filter(arguments: *const RTCFilterFunctionNArguments) {
    // SAFETY: Embree gives valid arguments.
    let RTCFilterFunctionNArguments { valid, context, ray, hit, N, .. } = unsafe { *arguments };
    // SAFETY: `FilterContext::arguments` set the context, and nobody else looks at it during the query.
    let own = unsafe { &mut *context.cast::<FilterContext>() };
    let count = N as usize;
    for i in 0..count {
        // SAFETY: there are N of each; a field of a ray or a hit is an array of N numbers of 32 bits.
        let (valid, t, [u, v, primitive]) = unsafe {
            let field = |field: usize| *hit.cast::<c_uint>().add(field * count + i);
            (&mut *valid.add(i), *ray.cast::<f32>().add(DISTANCE_FIELD * count + i), HIT_FIELDS.map(field))
        };
        if *valid == 0 {
            continue;
        }
        if primitive == own.skip {
            *valid = 0;
        } else {
            own.last = Some(Occluder { primitive, t, u: f32::from_bits(u), v: f32::from_bits(v) });
        }
    }
}

const _: () = {
    use core::mem::offset_of;
    let word = size_of::<c_uint>();
    assert!(offset_of!(RTCHit, u) == HIT_FIELDS[0] * word && offset_of!(RTCHit, v) == HIT_FIELDS[1] * word);
    assert!(offset_of!(RTCHit, primID) == HIT_FIELDS[2] * word && offset_of!(RTCRay, tfar) == DISTANCE_FIELD * word);
};
