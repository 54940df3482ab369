//! Leaving a primitive out of a query: the one a ray starts on.

use crate::types::*;
use core::ffi::c_uint;
use core::ptr::from_mut;

/// Position of `primID` among the fields of a hit.
const PRIMITIVE_FIELD: usize = 5;

/// A query's context with what the filter needs behind it.
#[repr(C)]
pub(crate) struct FilterContext {
    /// First, so that a pointer to it is one to the whole.
    context: RTCRayQueryContext,
    /// The primitive that is not hit.
    skip: c_uint,
    /// The last primitive that was let through: the hit one, in a query for any hit.
    pub(crate) last: c_uint,
}

impl FilterContext {
    pub(crate) fn new(skip: c_uint) -> Self {
        Self { context: RTCRayQueryContext::default(), skip, last: RTC_INVALID_GEOMETRY_ID }
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
    let RTCFilterFunctionNArguments { valid, context, hit, N, .. } = unsafe { *arguments };
    // SAFETY: `FilterContext::arguments` set the context, and nobody else looks at it during the query.
    let own = unsafe { &mut *context.cast::<FilterContext>() };
    for ray in 0..N as usize {
        // SAFETY: there are N of each; a field of a hit is an array of N numbers of 32 bits.
        let (valid, primitive) =
            unsafe { (&mut *valid.add(ray), *hit.cast::<c_uint>().add(PRIMITIVE_FIELD * N as usize + ray)) };
        if *valid == 0 {
            continue;
        }
        if primitive == own.skip {
            *valid = 0;
        } else {
            own.last = primitive;
        }
    }
}

const _: () = assert!(core::mem::offset_of!(RTCHit, primID) == PRIMITIVE_FIELD * size_of::<c_uint>());
