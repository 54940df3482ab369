//! What is passed by value.

/// How a call ended. `rb_error` has the words.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum rb_status {
    /// It did what it should.
    RB_OK = 0,
    /// An argument is wrong: the caller's mistake. Nothing has changed.
    RB_INVALID_ARGUMENT = 1,
    /// A device cannot be used, or every device failed.
    RB_DEVICE = 2,
    /// `rb_cancel` ended it. Hits of finished tasks are there.
    RB_CANCELLED = 3,
    /// The system has no memory for it.
    RB_OUT_OF_MEMORY = 4,
    /// A defect of this library; the handle must only be freed.
    RB_DEFECT = 5,
}

/// The points `origin + t * direction` with `tmin <= t <= tmax`. The direction need not have unit length. A ray that is
/// no number somewhere, has no direction or `tmin > tmax` misses.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct rb_ray {
    /// Where `t = 0`.
    pub origin: [f32; 3],
    /// Smallest accepted `t`.
    pub tmin: f32,
    /// Direction, of any finite length but zero.
    pub direction: [f32; 3],
    /// Largest accepted `t`; infinity is valid.
    pub tmax: f32,
}

/// A hit, or a miss: then `primitive` is `RB_MISS` and `t` is infinite.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct rb_hit {
    /// Distance in lengths of the ray's direction.
    pub t: f32,
    /// Barycentric weight of the second vertex.
    pub u: f32,
    /// Barycentric weight of the third vertex.
    pub v: f32,
    /// Which of the scene's triangles, from 0.
    pub primitive: u32,
}

/// The `primitive` of a ray that hits nothing.
pub const RB_MISS: u32 = 0xffff_ffff;

/// One of the meshes of a scene.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct rb_mesh {
    /// Three numbers for each vertex.
    pub positions: *const f32,
    /// Number of vertices.
    pub vertices: usize,
    /// Three vertices of this mesh for each triangle.
    pub indices: *const u32,
    /// Number of triangles.
    pub triangles: usize,
    /// Rays whose mask has none of these bits pass it by; 0: none does.
    pub mask: u32,
}

/// What finding a hit took: the same on every device.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct rb_counts {
    /// Box tests.
    pub boxes: u32,
    /// Triangle tests.
    pub triangles: u32,
}

/// Choices about a trace. All zero is the usual: the nearest hits, nothing known of the rays.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct rb_options {
    /// Not 0: some hit, if there is one, instead of the nearest.
    pub any_hit: u32,
    /// Not 0: rays that follow each other take similar paths, as neighbours of a picture do. It changes no hit.
    pub coherent: u32,
    /// Rays per task, which is what is dealt to devices; 0: 1,024.
    pub task_size: u32,
    /// Above 1: so many of the nearest hits of each ray, in order of distance. `hits` then has so many places for each
    /// ray in a row, and those beyond a ray's hits are misses. CPU devices alone trace that.
    pub most_hits: u32,
    /// Rays pass by meshes whose mask has none of these bits; 0: by none.
    pub mask: u32,
    /// Called with each task's hits once they are there, by the thread that traces; null: not. A task comes again where
    /// a device is not believed any more. It must return, and call nothing of this library but `rb_cancel`.
    pub finished:
        Option<unsafe extern "C" fn(user: *mut core::ffi::c_void, first: u32, rays: u32, hits: *const rb_hit)>,
    /// What `finished` is called with.
    pub user: *mut core::ffi::c_void,
}

/// How a trace went. Seconds, and shares without a unit.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct rb_run {
    /// From before the estimation until the last hit was there.
    pub makespan_s: f64,
    /// The estimation's part of it.
    pub estimate_s: f64,
    /// How much longer it took than if all devices had been busy to the end; NaN where that is not known.
    pub imbalance: f64,
    /// Number of tasks.
    pub tasks: u32,
}
