//! The vocabulary and the seams of raybalance.
//!
//! Every other crate speaks in these types: what crosses to a device ([`Ray`], [`Hit`], [`Triangle`], [`Node`],
//! [`Scene`]), what is scheduled ([`Task`]), what a task costs ([`Work`], [`CostModel`]), and the traits that make
//! the parts exchangeable: [`Device`], [`Tracer`] and [`CostEstimator`], and [`Backend`] for lists of devices.
//!
//! Conventions: `t` is in units of the given direction's length; a hit has `tmin ≤ t ≤ tmax`; triangles are
//! two-sided; a hit point is `(1 − u − v)·A + u·B + v·C`; primitive ids are positions in the caller's index buffer
//! and keep their numbers when degenerate triangles are left out; angles are radians unless the name says degrees.
//!
//! The crate is `no_std` with `alloc` (the feature `std` adds a clock), holds no algorithm of building, scheduling or
//! tracing, and knows no device.
#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;
#[cfg(feature = "std")]
extern crate std;

pub mod arguments;
mod backend;
pub mod bounce;
mod camera;
mod causes;
#[cfg(feature = "std")]
pub mod clock;
mod cost;
mod device;
mod expansion;
mod info;
pub mod intersect;
pub mod morton;
pub mod random;
mod ray;
pub mod scale;
mod scene;
mod task;

pub use backend::Backend;
pub use bounce::BounceRays;
pub use camera::{Camera, CameraError, CameraRays, Raster};
pub use causes::with_causes;
pub use cost::{
    CostEstimator, CostModel, CountsToken, LaunchRecord, Observation, RayStream, Step, StreamKind, StreamRecord,
    TaskOutcome, Work,
};
pub use device::{
    Clock, Coherence, CountedTree, Device, DeviceError, DeviceErrorKind, Launch, RaySource, Span, StreamSpec, Ticket,
    Tracer, Traffic,
};
pub use info::{Capabilities, Counted, DeviceInfo};
pub use ray::{Aabb, Hit, Precision, Query, Ray, ReducedWalk, TestCounts, Triangle, Walk};
pub use scene::{
    Child, InParts, MAX_DEPTH, MovedParts, Node, PrimitiveIds, SCALE_EXPONENTS, Scene, SceneError, SceneParts,
};
pub use task::{RayMask, Task, TaskId, tasks_of};
