//! The functions that C calls: all `unsafe` code of this crate.
//!
//! What a caller must see to stands with each function in the header. Here a pointer that must not be null is checked
//! for it, and lengths for what an address space holds; the rest cannot be checked and is taken at its word.

use crate::failure::{Failure, call, with_last};
use crate::tracer::{rb_scene, rb_tracer};
use crate::types::{rb_counts, rb_hit, rb_mesh, rb_options, rb_ray, rb_run, rb_status};
use core::ffi::{CStr, c_char};
use rt_balance::{Finished, Mesh};

/// What is at a caller's pointer.
///
/// # Safety
/// It is null, or points to a value that stays as it is meanwhile.
unsafe fn read<'a, T>(pointer: *const T, argument: &str) -> Result<&'a T, Failure> {
    // SAFETY: what this function asks of its caller.
    unsafe { pointer.as_ref() }.ok_or_else(|| null(argument))
}

/// The `count` values at a caller's pointer, which may be null if there are none.
///
/// # Safety
/// It is null, or points to so many values that stay as they are meanwhile.
unsafe fn list<'a, T>(pointer: *const T, count: usize, argument: &str) -> Result<&'a [T], Failure> {
    check_list(pointer, count, argument)?;
    if count == 0 {
        return Ok(&[]);
    }
    // SAFETY: not null and aligned, no larger than memory can be; the values are there as this function's caller says.
    Ok(unsafe { core::slice::from_raw_parts(pointer, count) })
}

/// The same of values that are written.
///
/// # Safety
/// It is null, or points to so many values that nobody else reads or writes meanwhile.
unsafe fn list_mut<'a, T>(pointer: *mut T, count: usize, argument: &str) -> Result<&'a mut [T], Failure> {
    check_list(pointer, count, argument)?;
    if count == 0 {
        return Ok(&mut []);
    }
    // SAFETY: as in `list`, and nobody else has them.
    Ok(unsafe { core::slice::from_raw_parts_mut(pointer, count) })
}

fn check_list<T>(pointer: *const T, count: usize, argument: &str) -> Result<(), Failure> {
    if count == 0 {
        return Ok(());
    }
    if pointer.is_null() {
        return Err(null(argument));
    }
    if !pointer.is_aligned() {
        return Err(Failure::argument(format!("{argument}: not aligned to {} bytes", align_of::<T>())));
    }
    match count.checked_mul(size_of::<T>()) {
        Some(bytes) if isize::try_from(bytes).is_ok() => Ok(()),
        _ => Err(Failure::argument(format!("{argument}: {count} of them are more than memory holds"))),
    }
}

fn null(argument: &str) -> Failure {
    Failure::argument(format!("{argument}: null"))
}

/// Puts a new object where the caller wants its handle.
///
/// # Safety
/// The place is null, or can be written to.
unsafe fn hand_over<T>(
    place: *mut *mut T,
    argument: &str,
    make: impl FnOnce() -> Result<T, Failure>,
) -> Result<(), Failure> {
    if place.is_null() {
        return Err(null(argument));
    }
    // SAFETY: not null, and writable as this function's caller says.
    unsafe { place.write(core::ptr::null_mut()) };
    let handle = Box::into_raw(Box::new(make()?));
    // SAFETY: as above.
    unsafe { place.write(handle) };
    Ok(())
}

/// What went wrong in this thread's last call: a sentence that names the argument and says what to do, in UTF-8. Empty
/// if nothing did. It stays until this thread's next call.
#[unsafe(no_mangle)]
pub extern "C" fn rb_error() -> *const c_char {
    with_last(CStr::as_ptr)
}

/// Builds a scene of triangles. `positions` are three numbers for each of `vertices`, `indices` three vertices for each
/// of `triangles`; both are copied. All cores build. A hit's `primitive` is a triangle in this order.
///
/// # Safety
/// `positions` and `indices` point to so many numbers, and `scene` to where the handle goes: null after a failure.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rb_scene_new(
    positions: *const f32,
    vertices: usize,
    indices: *const u32,
    triangles: usize,
    scene: *mut *mut rb_scene,
) -> rb_status {
    call(|| {
        // SAFETY: the caller promises each of the lists, in threes: arrays of three have the alignment of one.
        let (positions, indices) = unsafe {
            (
                list(positions.cast::<[f32; 3]>(), vertices, "positions")?,
                list(indices.cast::<[u32; 3]>(), triangles, "indices")?,
            )
        };
        // SAFETY: the caller promises the place.
        unsafe { hand_over(scene, "scene", || rb_scene::new(positions, indices)) }
    })
}

/// Builds one scene of `count` meshes. A hit's `primitive` counts the triangles of one mesh after the other:
/// `rb_geometry_of` tells which mesh, and which of its triangles.
///
/// # Safety
/// `meshes` points to so many meshes, whose pointers lead to so many numbers as each says, and `scene` to where the
/// handle goes: null after a failure.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rb_scene_of_meshes(
    meshes: *const rb_mesh,
    count: usize,
    scene: *mut *mut rb_scene,
) -> rb_status {
    call(|| {
        // SAFETY: the caller promises the list.
        let meshes = unsafe { list(meshes, count, "meshes")? };
        let mut all = Vec::new();
        for (number, mesh) in meshes.iter().enumerate() {
            // SAFETY: the caller promises each of the lists, in threes: arrays of three have the alignment of one.
            let (positions, indices) = unsafe {
                (
                    list(mesh.positions.cast::<[f32; 3]>(), mesh.vertices, &format!("meshes[{number}].positions"))?,
                    list(mesh.indices.cast::<[u32; 3]>(), mesh.triangles, &format!("meshes[{number}].indices"))?,
                )
            };
            all.push((Mesh::of_arrays(positions, indices), mesh.mask));
        }
        // SAFETY: the caller promises the place.
        unsafe { hand_over(scene, "scene", || rb_scene::of_meshes(&all)) }
    })
}

/// Which of the meshes a hit's `primitive` belongs to, and its number there.
///
/// # Safety
/// `scene` is a scene; `geometry` and `triangle` each point to a number to write, or are null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rb_geometry_of(
    scene: *const rb_scene,
    primitive: u32,
    geometry: *mut u32,
    triangle: *mut u32,
) -> rb_status {
    call(|| {
        // SAFETY: the caller promises each of them, or null where that may be.
        let (scene, places) = unsafe { (read(scene, "scene")?, [geometry.as_mut(), triangle.as_mut()]) };
        let (geometry, triangle) = scene.geometry_of(primitive)?;
        for (place, number) in places.into_iter().zip([geometry, triangle]) {
            place.into_iter().for_each(|place| *place = number);
        }
        Ok(())
    })
}

/// Frees a scene; null is none. Tracers of it go on.
///
/// # Safety
/// `scene` comes from `rb_scene_new` and is not used any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rb_scene_free(scene: *mut rb_scene) {
    // SAFETY: what this function asks of its caller.
    unsafe { free(scene) }
}

/// Opens devices and brings a scene to them. `devices` is a list such as "cpu:2,vulkan:0@0.5" (threads; number of the
/// graphics card; speed, to try things out), or "auto": a device for each core, and every graphics card. Keep a tracer:
/// it learns what tests cost on each device and what rays cost in the scene.
///
/// # Safety
/// `scene` is a scene, `devices` ends with a zero byte, and `tracer` points to where the handle goes: null after a
/// failure.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rb_tracer_new(
    scene: *const rb_scene,
    devices: *const c_char,
    tracer: *mut *mut rb_tracer,
) -> rb_status {
    call(|| {
        // SAFETY: the caller promises a scene.
        let scene = unsafe { read(scene, "scene")? };
        if devices.is_null() {
            return Err(null("devices"));
        }
        // SAFETY: the caller promises the zero byte.
        let devices = unsafe { CStr::from_ptr(devices) };
        let devices = devices.to_str().map_err(|_| Failure::argument("devices: not in UTF-8"))?;
        // SAFETY: the caller promises the place.
        unsafe { hand_over(tracer, "tracer", || rb_tracer::new(scene, devices)) }
    })
}

/// Frees a tracer; null is none.
///
/// # Safety
/// `tracer` comes from `rb_tracer_new` and is not used any more, by other threads either.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rb_tracer_free(tracer: *mut rb_tracer) {
    // SAFETY: what this function asks of its caller.
    unsafe { free(tracer) }
}

/// Frees what a handle points to. A panic on the way ends here.
///
/// # Safety
/// The handle is null, or comes from `hand_over` and is not used any more.
unsafe fn free<T>(handle: *mut T) {
    if !handle.is_null() {
        // SAFETY: what this function asks of its caller.
        let object = unsafe { Box::from_raw(handle) };
        call(|| {
            drop(object);
            Ok(())
        });
    }
}

/// How many devices a tracer has; 0 for null.
///
/// # Safety
/// `tracer` is a tracer or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rb_tracer_devices(tracer: *const rb_tracer) -> usize {
    // SAFETY: the caller promises a tracer or null.
    unsafe { tracer.as_ref() }.map_or(0, |tracer| tracer.devices().len())
}

/// The name of a device, in the order of the list; null beyond the last. It stays as long as the tracer.
///
/// # Safety
/// `tracer` is a tracer or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rb_device_name(tracer: *const rb_tracer, device: usize) -> *const c_char {
    // SAFETY: the caller promises a tracer or null.
    let tracer = unsafe { tracer.as_ref() };
    tracer.and_then(|tracer| tracer.devices().get(device)).map_or(core::ptr::null(), |name| name.as_ptr())
}

/// Traces rays: `hits[i]` is the hit of `rays[i]`, unless `options` ask for several of each. `options` (null: the
/// usual), `counts` (null: not counted) and `run` (null: not told) may be left out. Rays are copied. One thread traces
/// at a time, others wait.
///
/// # Safety
/// `tracer` is a tracer; `rays`, `hits` and, unless null, `counts` point to `count` values each (`hits` to `most_hits`
/// times as many where that is above 1), which nobody else writes to meanwhile; `run` and `options` are null or point
/// to one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rb_trace(
    tracer: *const rb_tracer,
    rays: *const rb_ray,
    count: usize,
    options: *const rb_options,
    hits: *mut rb_hit,
    counts: *mut rb_counts,
    run: *mut rb_run,
) -> rb_status {
    call(|| {
        // SAFETY: the caller promises each of them, or null where that may be.
        let options = unsafe { options.as_ref() };
        // More than an address space holds is refused as such.
        let places = count.saturating_mul(options.map_or(1, |options| options.most_hits.max(1)) as usize);
        // SAFETY: likewise.
        let (tracer, rays, hits, counts) = unsafe {
            (
                read(tracer, "tracer")?,
                list(rays, count, "rays")?,
                list_mut(hits, places, "hits")?,
                if counts.is_null() { None } else { Some(list_mut(counts, count, "counts")?) },
            )
        };
        let told = |now: Finished<'_>| {
            if let Some(rb_options { finished: Some(finished), user, .. }) = options {
                // SAFETY: the caller's own function, called as its type says; hits lie there as long as it runs.
                unsafe { finished(*user, now.task.first, now.task.rays, now.hits.as_ptr().cast()) };
            }
        };
        let counts = counts.map(bytemuck::cast_slice_mut);
        let rays = bytemuck::cast_slice(rays);
        let told = tracer.trace(rays, options, bytemuck::cast_slice_mut(hits), counts, Some(&told))?;
        // SAFETY: null, or a place to write to, as the caller promises.
        if let Some(run) = unsafe { run.as_mut() } {
            *run = told;
        }
        Ok(())
    })
}

/// Ends the trace that is running, which returns `RB_CANCELLED` soon; if none is, the next one. From any thread, and
/// from a signal handler.
///
/// # Safety
/// `tracer` is a tracer or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rb_cancel(tracer: *const rb_tracer) {
    // SAFETY: the caller promises a tracer or null.
    if let Some(tracer) = unsafe { tracer.as_ref() } {
        tracer.cancel();
    }
}
