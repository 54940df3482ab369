//! Cost-based balancing of ray tracing over several devices: the facade and the driver.
//!
//! A [`Balancer`] holds one scene on several devices. It estimates what each task of a stream will cost, deals the
//! tasks, runs them with one host thread per device, and reports how close the result is to the best possible.
//!
//! ```
//! use rt_balance::{Balancer, Hit, Ray, cpu::CpuDevice};
//! use std::sync::Arc;
//!
//! // A renderer's own buffers: no file, no scene format.
//! let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
//! let indices = [[0, 1, 2]];
//! let devices: Vec<Arc<dyn rt_balance::Device>> =
//!     CpuDevice::open_all(&[1, 1])?.into_iter().map(|d| Arc::new(d) as _).collect();
//! let mut balancer = Balancer::for_mesh(&positions, &indices, &devices)?;
//!
//! let rays = vec![Ray::new([0.2, 0.2, 1.0].into(), [0.0, 0.0, -1.0].into()); 10_000];
//! let mut hits = vec![Hit::MISS; rays.len()];
//! let run = balancer.trace_rays(&rays, &mut hits)?;
//! assert!(hits.iter().all(|hit| hit.primitive == 0 && hit.t == 1.0));
//! println!("traced in {:.1} ms", 1e3 * run.report.makespan_s);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Features: each of `cpu` (default), `vulkan` and `wgpu` adds one re-export of a backend and nothing else. Any other
//! backend that implements [`Device`] and [`Tracer`] can be used beside them; the crate `rt-conformance` tests it. What
//! the seams speak in is re-exported, [`glam`] too, so that estimators, policies, builders and backends of one's own
//! need this crate alone: the folder `examples` has one of each.
//!
//! Current state and limits: results return to the host after every launch; rays in a slice are copied once per
//! stream; a stream has at most 2³² − 1 rays.
#![forbid(unsafe_code)]

mod answers;
mod balancer;
pub mod catalogue;
mod contain;
mod device_state;
mod device_thread;
#[cfg(feature = "cpu")]
pub mod devices;
mod error;
mod estimate;
mod limits;
mod measure;
pub mod middleware;
mod models;
mod output;
mod plan;
mod record;
mod reference;
pub mod replay;
pub mod report;
mod run;
pub mod stats;
mod stream;
mod unused;
mod update;
mod walk;

pub use answers::Audit;
pub use balancer::Balancer;
pub use error::BalanceError;
pub use estimate::Estimate;
pub use limits::Limits;
pub use reference::Reference;
use rt_core::clock;
pub use rt_core::clock::now as clock;
pub use rt_sched::queue::QueueKind;
pub use stream::{Control, DEFAULT_TASK_SIZE, Finished, Scheduling, Stream};
pub use unused::UnusedEstimate;
pub use update::{Cause, MOST_GROWTH, Update, Updated};

/// CPU devices (feature `cpu`).
#[cfg(feature = "cpu")]
pub use backend_cpu as cpu;

/// Graphics cards through Vulkan (feature `vulkan`).
#[cfg(feature = "vulkan")]
pub use backend_vulkan as vulkan;

/// Graphics cards through wgpu (feature `wgpu`).
#[cfg(feature = "wgpu")]
pub use backend_wgpu as wgpu;

// Whatever a signature above or a part of a caller's own may name, so that this crate is the only dependency they need.
pub use glam;
pub use rt_bvh::{
    BuildError, BuildOptions, BuildReport, Builder, Built, Fallback, InvalidTriangles, Mesh, PlocQuality, TreeStats,
    build, build_meshes, build_with, refit,
};
pub use rt_core::{
    Aabb, Backend, BounceRays, Camera, CameraError, CameraRays, Capabilities, Child, Clock, Coherence, CostEstimator,
    CostModel, Counted, CountedTree, CountsToken, Device, DeviceError, DeviceErrorKind, DeviceInfo, Hit, InParts,
    Launch, LaunchRecord, MAX_DEPTH, MovedParts, Node, Observation, Precision, PrimitiveIds, Query, Raster, Ray,
    RayMask, RaySource, RayStream, ReducedWalk, Scene, SceneError, SceneParts, Span, Step, StreamKind, StreamRecord,
    StreamSpec, Task, TaskId, TaskOutcome, TestCounts, Ticket, Tracer, Traffic, Triangle, Walk, Work, arguments,
    bounce, intersect, morton, random, tasks_of, with_causes,
};
pub use rt_sched::{Schedule, ScheduleError, estimate as estimators, policy as policies, queue as queues, sample};
