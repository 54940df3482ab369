//! Leaving a primitive out of a query: the one a ray starts on.

use crate::arguments::*;
use crate::enums::*;
use crate::rays::*;
use core::ffi::{c_uint, c_void};
use core::ptr::from_mut;

/// Positions of `u`, `v` and `primID` among the fields of a hit.
const HIT_FIELDS: [usize; 3] = [3, 4, 5];

/// Positions of `tfar` and `id` among the fields of a ray.
const RAY_FIELDS: [usize; 2] = [8, 10];

/// Most rays of a query.
pub(crate) const MOST: usize = 16;

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
    /// What each ray leaves out. Rays are told by their `id`, which is their place here: without AVX-512 packets of
    /// sixteen are traced ray by ray, and the filter sees one.
    left_out: [c_uint; MOST],
    /// For each ray the last hit that was let through: the only one, in a query for any hit.
    pub(crate) last: [Option<Occluder>; MOST],
}

impl FilterContext {
    /// For one ray, whose `id` says what it leaves out until here.
    pub(crate) fn of(ray: &mut RTCRay) -> Self {
        let mut left_out = [RTC_INVALID_GEOMETRY_ID; MOST];
        left_out[0] = core::mem::replace(&mut ray.id, 0);
        Self { context: RTCRayQueryContext::default(), left_out, last: [None; MOST] }
    }

    /// The same for sixteen.
    pub(crate) fn of_16(rays: &mut RTCRay16) -> Self {
        let left_out = core::mem::replace(&mut rays.id, core::array::from_fn(|place| place as c_uint));
        Self { context: RTCRayQueryContext::default(), left_out, last: [None; MOST] }
    }

    /// Arguments that point to this context, and must not be used when it is gone.
    pub(crate) fn arguments(&mut self, flags: RTCRayQueryFlags) -> RTCIntersectArguments {
        RTCIntersectArguments {
            flags: flags | RTCRayQueryFlags::INVOKE_ARGUMENT_FILTER,
            context: from_mut(self).cast(),
            filter: Some(filter),
            ..RTCIntersectArguments::default()
        }
    }
}

/// Rejects hits of the primitives that rays leave out.
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
        let (valid, [t, id], [u, v, primitive]) = unsafe {
            let field = |of: *mut c_void| move |field: usize| *of.cast::<c_uint>().add(field * count + i);
            (&mut *valid.add(i), RAY_FIELDS.map(field(ray)), HIT_FIELDS.map(field(hit)))
        };
        if *valid == 0 {
            continue;
        }
        let place = id as usize;
        if own.left_out.get(place) == Some(&primitive) {
            *valid = 0;
        } else if let Some(last) = own.last.get_mut(place) {
            *last = Some(Occluder { primitive, t: f32::from_bits(t), u: f32::from_bits(u), v: f32::from_bits(v) });
        }
    }
}

const _: () = {
    use core::mem::offset_of;
    let word = size_of::<c_uint>();
    assert!(offset_of!(RTCHit, u) == HIT_FIELDS[0] * word && offset_of!(RTCHit, v) == HIT_FIELDS[1] * word);
    assert!(offset_of!(RTCHit, primID) == HIT_FIELDS[2] * word);
    assert!(offset_of!(RTCRay, tfar) == RAY_FIELDS[0] * word && offset_of!(RTCRay, id) == RAY_FIELDS[1] * word);
    assert!(offset_of!(RTCRay16, id) == MOST * RAY_FIELDS[1] * word);
};
