//! Tracers: a scene on devices, and what was learnt about them.

use crate::errors::{DeviceError, argument, of_run};
use crate::interrupt::interruptible;
use crate::process;
use crate::rays::{Buffers, Limit, Points, Rays, rays};
use crate::run::{Outcome, Run};
use crate::scene::Scene;
use numpy::PyReadonlyArray2;
use pyo3::exceptions::{PyMemoryError, PyValueError};
use pyo3::prelude::*;
use rt_balance::catalogue::{Entry, Estimator, POLICIES, QUEUES, find};
use rt_balance::devices::{self, Opener};
use rt_balance::{
    Balancer, Coherence, Control, Device, Hit, Limits, Precision, Query, RaySource, Scheduling, Stream, StreamKind,
    StreamSpec, TestCounts, with_causes,
};
use rt_scene::prepare::Prepared;
use std::num::NonZero;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// Devices with a scene, and how their work is scheduled: one stream at a time.
#[derive(Debug)]
struct State {
    balancer: Balancer,
    scheduling: Scheduling,
}

/// A scene on devices.
#[pyclass(frozen, module = "raybalance._raybalance")]
#[derive(Debug)]
pub(crate) struct Tracer {
    scene: Arc<Prepared>,
    /// `None` once it is dropped.
    state: Mutex<Option<State>>,
    buffers: Mutex<Buffers>,
    devices: Vec<String>,
    precision: Precision,
    task_size: u32,
    seed: u32,
}

impl Drop for Tracer {
    fn drop(&mut self) {
        let state = self.state.get_mut().unwrap_or_else(PoisonError::into_inner).take();
        if !process::has_its_threads() {
            // They would be waited for.
            std::mem::forget(state);
        }
    }
}

#[pymethods]
impl Tracer {
    /// Opens the devices and brings the scene to them.
    #[new]
    #[expect(clippy::too_many_arguments, reason = "Python names them")]
    fn new(
        py: Python<'_>,
        scene: PyRef<'_, Scene>,
        devices: &str,
        queue: &str,
        policy: Option<&str>,
        estimator: &str,
        precision: Option<&str>,
        task_size: u32,
        seed: u32,
    ) -> PyResult<Self> {
        process::check()?;
        devices::check(devices).map_err(|error| argument("devices", &error))?;
        let scheduling = scheduling(queue, policy, estimator)?;
        let scene = Arc::clone(&scene.prepared);
        let precision = match precision {
            None => scene.precision,
            Some(name) => Precision::ALL.into_iter().find(|known| known.name() == name).ok_or_else(|| {
                let names = Precision::ALL.map(Precision::name).join(", ");
                PyValueError::new_err(format!("precision: `{name}` is none; there are {names}"))
            })?,
        };
        let opened = |cancel: &AtomicBool| {
            let opened = Opener::new().open(devices).map_err(|error| DeviceError::new_err(with_causes(&error)))?;
            let devices: Vec<Arc<dyn Device>> = opened.into_iter().map(|opened| opened.device).collect();
            let names = devices.iter().map(|device| device.info().name.clone()).collect();
            let control = Control { cancel: Some(cancel), ..Control::default() };
            let balancer = Balancer::open(Arc::clone(&scene.built.scene), &devices, &Limits::default(), control);
            Ok::<_, PyErr>((balancer.map_err(|error| of_run(&error))?, names))
        };
        let (balancer, devices) = interruptible(py, opened)??;
        let state = Mutex::new(Some(State { balancer, scheduling }));
        Ok(Self { scene, state, buffers: Mutex::default(), devices, precision, task_size, seed })
    }

    /// Names of the devices.
    #[getter]
    fn devices(&self) -> Vec<String> {
        self.devices.clone()
    }

    /// Schedules later streams so. What is known of the devices is kept, what estimators have learnt is not.
    fn schedule(&self, py: Python<'_>, queue: &str, policy: Option<&str>, estimator: &str) -> PyResult<()> {
        process::check()?;
        let scheduling = scheduling(queue, policy, estimator)?;
        py.detach(|| {
            let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(state) = &mut *state {
                state.scheduling = scheduling;
            }
        });
        Ok(())
    }

    /// Traces rays. Those that are no numbers somewhere are refused, or miss if `invalid_miss`.
    #[expect(clippy::too_many_arguments, reason = "Python names them")]
    fn run(
        &self,
        py: Python<'_>,
        origins: Points<'_>,
        directions: PyReadonlyArray2<'_, f32>,
        tmin: Limit<'_>,
        tmax: Limit<'_>,
        query: &str,
        most: u32,
        mask: u32,
        counts: bool,
        coherent: Option<bool>,
        invalid_miss: bool,
    ) -> PyResult<Run> {
        process::check()?;
        let start = Instant::now();
        let Rays { rays, invalid } = {
            let mut buffers = self.buffers.lock().unwrap_or_else(PoisonError::into_inner);
            rays(&mut buffers, &origins, &directions, &tmin, &tmax, self.scene.model.offset)?
        };
        if let Some((first, count)) = invalid.filter(|_| !invalid_miss) {
            return Err(PyValueError::new_err((first, count)));
        }
        self.buffers.lock().unwrap_or_else(PoisonError::into_inner).keep(&rays);
        let coherence = match coherent {
            None => Coherence::Unknown,
            Some(true) => Coherence::Coherent,
            Some(false) => Coherence::Incoherent,
        };
        let query = match (query, NonZero::new(most)) {
            ("closest", _) => Query::Closest,
            ("any", _) => Query::Any,
            ("all", Some(most)) => Query::All { most },
            _ => return Err(PyValueError::new_err("query: none that there is")),
        };
        let spec = StreamSpec { coherence, mask, ..StreamSpec::new(query, self.precision, counts) };
        let source = RaySource::Explicit { rays, origins: None };
        let stream =
            Stream { seed: self.seed, ..Stream::new(source, StreamKind::Custom, spec).with_task_size(self.task_size) };
        let outcome = interruptible(py, |cancel| self.trace(&stream, start, cancel))??;
        Ok(Run::new(Arc::clone(&self.scene), self.devices.clone(), self.seed, outcome))
    }
}

impl Tracer {
    fn trace(&self, stream: &Stream, start: Instant, cancel: &AtomicBool) -> PyResult<Outcome> {
        let rays = stream.source.len() as usize;
        let places = rays.checked_mul(stream.spec.query.hits_per_ray());
        let places = places.ok_or_else(|| PyMemoryError::new_err("max_hits: more than memory holds"))?;
        let mut hits = filled(Hit::MISS, places, "hits")?;
        let mut counts = stream.spec.counts.then(|| filled(TestCounts::default(), rays, "counts")).transpose()?;
        // A panic in a run leaves the balancer as it was.
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(State { balancer, scheduling }) = &mut *state else {
            return Err(DeviceError::new_err("the tracer is gone"));
        };
        let control = Control { cancel: Some(cancel), ..Control::default() };
        let run = balancer.trace(stream, scheduling, &mut hits, counts.as_deref_mut(), control);
        Ok(Outcome {
            hits,
            counts,
            run: run.map_err(|error| of_run(&error))?,
            queue: scheduling.queue.name(),
            policy: scheduling.policy_name(),
            seconds: start.elapsed().as_secs_f64(),
        })
    }
}

fn filled<T: Clone>(value: T, count: usize, what: &str) -> PyResult<Vec<T>> {
    let mut list = Vec::new();
    match list.try_reserve_exact(count) {
        Ok(()) => {
            list.resize(count, value);
            Ok(list)
        }
        Err(_) => Err(PyMemoryError::new_err(format!("no memory for {count} {what}: trace fewer rays at once"))),
    }
}

fn scheduling(queue: &str, policy: Option<&str>, estimator: &str) -> PyResult<Scheduling> {
    let queue = known("queue", QUEUES, queue)?.make;
    let policy = policy.map(|name| known("policy", POLICIES, name)).transpose()?;
    let estimator = estimator.parse::<Estimator>().map_err(|error| argument("estimator", &error))?;
    let scheduling = Scheduling {
        estimator: estimator.make(),
        policy: policy.map(|entry| (entry.make)()),
        queue: Box::new(queue),
        ..Scheduling::default()
    };
    scheduling.policy().map_err(|error| of_run(&error))?;
    Ok(scheduling)
}

fn known<T>(argument: &str, entries: &'static [Entry<T>], name: &str) -> PyResult<&'static Entry<T>> {
    find(entries, name).ok_or_else(|| {
        let names: Vec<&str> = entries.iter().map(|entry| entry.name).collect();
        PyValueError::new_err(format!("{argument}: `{name}` is none; there are {}", names.join(", ")))
    })
}
