//! What handles point to.

use crate::failure::Failure;
use crate::types::{rb_options, rb_run, rb_status};
use rt_balance::devices::Opener;
use rt_balance::report::StreamRun;
use rt_balance::{
    Balancer, BuildOptions, Coherence, Control, DEFAULT_TASK_SIZE, Device, Finished, Hit, Limits, Mesh, Query, Ray,
    RaySource, Scene, Scheduling, Stream, StreamKind, StreamSpec, TestCounts, build, build_meshes,
};
use std::ffi::CString;
use std::num::NonZero;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Triangles and the tree over them.
#[derive(Debug)]
pub struct rb_scene(pub(crate) Arc<Scene>);

/// A scene on devices, and what was learnt about them.
#[derive(Debug)]
pub struct rb_tracer {
    devices: Vec<CString>,
    /// One stream at a time.
    state: Mutex<(Balancer, Scheduling)>,
    /// Set until a trace has seen it.
    cancel: AtomicBool,
}

impl rb_scene {
    pub(crate) fn new(positions: &[[f32; 3]], indices: &[[u32; 3]]) -> Result<Self, Failure> {
        let built = build(Mesh::of_arrays(positions, indices), &BuildOptions::default())?;
        Ok(Self(built.scene))
    }

    /// Of several meshes, each with its mask; 0: all bits.
    pub(crate) fn of_meshes(meshes: &[(Mesh<'_>, u32)]) -> Result<Self, Failure> {
        let list: Vec<Mesh<'_>> = meshes.iter().map(|&(mesh, _)| mesh).collect();
        let scene = build_meshes(&list, &BuildOptions::default())?.scene;
        if meshes.iter().all(|&(_, mask)| mask == 0) {
            return Ok(Self(scene));
        }
        let mask = |&(mesh, mask): &(Mesh<'_>, u32)| {
            std::iter::repeat_n(if mask == 0 { u32::MAX } else { mask }, mesh.indices.len())
        };
        let masked = Arc::unwrap_or_clone(scene).with_masks(meshes.iter().flat_map(mask).collect());
        let masked = masked.map_err(|error| Failure::of(rb_status::RB_INVALID_ARGUMENT, &error))?;
        Ok(Self(Arc::new(masked)))
    }

    pub(crate) fn geometry_of(&self, primitive: u32) -> Result<(u32, u32), Failure> {
        self.0.geometry_of(primitive).ok_or_else(|| {
            let count = self.0.primitive_count();
            Failure::argument(format!("primitive: {primitive}, but the scene has {count} triangles"))
        })
    }
}

impl rb_tracer {
    pub(crate) fn new(scene: &rb_scene, list: &str) -> Result<Self, Failure> {
        rt_balance::devices::check(list).map_err(|error| {
            let Failure { message, .. } = Failure::of(rb_status::RB_INVALID_ARGUMENT, &error);
            Failure::argument(format!("devices: {message}"))
        })?;
        let opened = Opener::new().open(list).map_err(|error| Failure::of(rb_status::RB_DEVICE, &error))?;
        let devices: Vec<Arc<dyn Device>> = opened.into_iter().map(|opened| opened.device).collect();
        let name = |device: &Arc<dyn Device>| CString::new(device.info().name.replace('\0', " ")).unwrap_or_default();
        let names = devices.iter().map(name).collect();
        let balancer = Balancer::open(Arc::clone(&scene.0), &devices, &Limits::default(), Control::default())?;
        let state = Mutex::new((balancer, Scheduling::default()));
        Ok(Self { devices: names, state, cancel: AtomicBool::new(false) })
    }

    pub(crate) fn devices(&self) -> &[CString] {
        &self.devices
    }

    pub(crate) fn cancel(&self) {
        self.cancel.store(true, Ordering::Relaxed);
    }

    pub(crate) fn trace(
        &self,
        rays: &[Ray],
        options: Option<&rb_options>,
        hits: &mut [Hit],
        counts: Option<&mut [TestCounts]>,
        finished: Option<&dyn Fn(Finished<'_>)>,
    ) -> Result<rb_run, Failure> {
        if u32::try_from(rays.len()).is_err() {
            return Err(Failure::argument("rays: more than 2^32 - 1: trace them in parts"));
        }
        let chosen = |choice: fn(&rb_options) -> u32| options.map_or(0, choice);
        let query = match (chosen(|o| o.any_hit) != 0, NonZero::new(chosen(|o| o.most_hits)).filter(|n| n.get() > 1)) {
            (true, Some(_)) => return Err(Failure::argument("options: any_hit is one hit: leave most_hits 0")),
            (true, None) => Query::Any,
            (false, None) => Query::Closest,
            (false, Some(most)) => Query::All { most },
        };
        let mask = match chosen(|o| o.mask) {
            0 => u32::MAX,
            mask => mask,
        };
        let coherence = if chosen(|o| o.coherent) != 0 { Coherence::Coherent } else { Coherence::Unknown };
        let size = match chosen(|o| o.task_size) {
            0 => DEFAULT_TASK_SIZE,
            size => size,
        };
        let spec = StreamSpec { query, coherence, mask, counts: counts.is_some(), ..StreamSpec::default() };
        let source = RaySource::Explicit { rays: rays.into(), origins: None };
        let stream = Stream::new(source, StreamKind::Custom, spec).with_task_size(size);
        let control = Control { cancel: Some(&self.cancel), finished, ..Control::default() };
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let (balancer, scheduling) = &mut *state;
        let traced = balancer.trace(&stream, scheduling, hits, counts, control);
        if matches!(traced, Err(rt_balance::BalanceError::Cancelled { .. })) {
            self.cancel.store(false, Ordering::Relaxed);
        }
        let StreamRun { report, .. } = traced?;
        Ok(rb_run {
            makespan_s: report.makespan_s,
            estimate_s: report.estimate.seconds,
            imbalance: report.imbalance.unwrap_or(f64::NAN),
            tasks: report.tasks,
        })
    }
}
