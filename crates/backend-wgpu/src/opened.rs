//! An opened device, and wgpu's ways of saying that something went wrong, each as a [`DeviceError`].

use crate::error::OpenError;
use rt_core::{DeviceError, DeviceErrorKind};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Duration;
use wgpu::{Adapter, Buffer, BufferDescriptor, BufferUsages, Error, ErrorFilter, Features, PollError, PollType};

/// Smallest buffer: what the largest structure takes of which kernels read one without asking whether there is any.
const LEAST_BUFFER: u64 = 96;

/// An opened device and its queue.
#[derive(Debug)]
pub(crate) struct Opened {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    /// Greatest size of a storage buffer as a kernel sees it, in bytes.
    pub binding: u64,
    /// Greatest number of workgroups along an axis of a dispatch.
    pub groups: u32,
    /// Nanoseconds of one tick of a timestamp, where there are timestamps.
    pub tick: Option<f64>,
    faults: Arc<Faults>,
}

/// What wgpu says of the device outside of any call.
#[derive(Debug, Default)]
struct Faults {
    /// Why the device is of no more use.
    lost: OnceLock<String>,
    /// An error that no scope was open for.
    uncaptured: Mutex<Option<Error>>,
}

impl Opened {
    /// Opens a device with all the limits it has.
    pub(crate) fn new(adapter: &Adapter, name: &str) -> Result<Self, OpenError> {
        let request = adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("raybalance"),
            required_features: adapter.features() & Features::TIMESTAMP_QUERY,
            required_limits: adapter.limits(),
            ..Default::default()
        });
        let (device, queue) = pollster::block_on(request)
            .map_err(|error| OpenError::Refused { name: name.to_owned(), reason: error.to_string() })?;
        let opened = Self::of(device, queue);
        let told = Arc::clone(&opened.faults);
        opened.device.set_device_lost_callback(move |reason, message| {
            // Only the first reason counts.
            let _ = told.lost.set(format!("{reason:?}: {message}"));
        });
        let told = Arc::clone(&opened.faults);
        opened.device.on_uncaptured_error(Arc::new(move |error| {
            told.uncaptured.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
        }));
        Ok(opened)
    }

    /// A device that somebody else opened. What it calls when it is lost, and on errors, stays theirs: all that is done
    /// here is in scopes of errors.
    pub(crate) fn of(device: wgpu::Device, queue: wgpu::Queue) -> Self {
        let limits = device.limits();
        let has_time = device.features().contains(Features::TIMESTAMP_QUERY);
        let tick = has_time.then(|| f64::from(queue.get_timestamp_period()));
        Self {
            binding: limits.max_storage_buffer_binding_size.min(limits.max_buffer_size),
            groups: limits.max_compute_workgroups_per_dimension,
            device,
            queue,
            tick,
            faults: Arc::default(),
        }
    }

    /// An error if the device was lost, or something went wrong since the last call.
    pub(crate) fn check(&self) -> Result<(), DeviceError> {
        if let Some(reason) = self.faults.lost.get() {
            return Err(DeviceError::new(DeviceErrorKind::Lost, format!("the wgpu device was lost: {reason}")));
        }
        match self.faults.uncaptured.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(error) => Err(failed("go on", error, DeviceErrorKind::Lost)),
            None => Ok(()),
        }
    }

    /// Makes calls of wgpu, which are to `task`. What it objects to becomes an error, of kind `otherwise` unless memory
    /// is wanting.
    pub(crate) fn scoped<T>(
        &self,
        task: &str,
        otherwise: DeviceErrorKind,
        calls: impl FnOnce() -> T,
    ) -> Result<T, DeviceError> {
        self.check()?;
        let [memory, validation, internal] = [ErrorFilter::OutOfMemory, ErrorFilter::Validation, ErrorFilter::Internal]
            .map(|filter| self.device.push_error_scope(filter));
        let made = calls();
        // In the reverse of the order in which they were opened.
        let errors = [internal, validation, memory].map(|scope| pollster::block_on(scope.pop()));
        match errors.into_iter().flatten().next() {
            Some(error) => Err(failed(task, error, otherwise)),
            None => self.check().map(|()| made),
        }
    }

    /// A buffer of `size` bytes, and at least of [`LEAST_BUFFER`]; `what` names it in errors.
    pub(crate) fn buffer(&self, what: &str, size: u64, usage: BufferUsages) -> Result<Buffer, DeviceError> {
        let out_of_memory = |text: String| DeviceError::new(DeviceErrorKind::OutOfMemory, text);
        let size = size.max(LEAST_BUFFER);
        if size > self.binding {
            let binding = self.binding;
            return Err(out_of_memory(format!("{what} of {size} bytes: the device binds at most {binding} at once")));
        }
        let make = || {
            self.device.create_buffer(&BufferDescriptor { label: Some(what), size, usage, mapped_at_creation: false })
        };
        self.scoped("create a buffer", DeviceErrorKind::Lost, make).map_err(|error| match error.kind() {
            DeviceErrorKind::OutOfMemory => {
                let held = self.device.generate_allocator_report().map_or(0, |report| report.total_allocated_bytes);
                let text =
                    format!("{what} of {size} bytes does not fit: the device has no more than {held} bytes for us");
                out_of_memory(text).with_source(error)
            }
            _ => error,
        })
    }

    /// Waits until a submission is done, at most `limit`.
    pub(crate) fn wait(self: &Arc<Self>, done: wgpu::SubmissionIndex, limit: Duration) -> Result<(), DeviceError> {
        let wait = PollType::Wait { submission_index: Some(done), timeout: Some(limit) };
        // Unwind safe: the device is left alone afterwards.
        match catch_unwind(AssertUnwindSafe(|| self.device.poll(wait))) {
            Ok(Ok(_)) => self.check(),
            Ok(Err(PollError::Timeout)) => Err(self.hung(limit)),
            Ok(Err(error)) => Err(self.lose(&error.to_string())),
            Err(_) => Err(self.lose("wgpu panicked, as it does when a device is lost while it is waited for")),
        }
    }

    /// The error for a launch that was not done in time. From now on the device is of no use.
    pub(crate) fn hung(self: &Arc<Self>, limit: Duration) -> DeviceError {
        let _ = self.lose(&format!("a launch did not end within {} s", limit.as_secs_f64()));
        DeviceError::new(
            DeviceErrorKind::Hung,
            format!("the wgpu device did not finish a launch within {} s", limit.as_secs_f64()),
        )
    }

    /// Takes note that the device is of no more use, and never closes it: wgpu would wait for it without end.
    pub(crate) fn lose(self: &Arc<Self>, reason: &str) -> DeviceError {
        if self.faults.lost.set(reason.to_owned()).is_ok() {
            std::mem::forget(Arc::clone(self));
        }
        DeviceError::new(DeviceErrorKind::Lost, format!("the wgpu device was lost: {reason}"))
    }
}

fn failed(task: &str, error: Error, otherwise: DeviceErrorKind) -> DeviceError {
    let kind = if matches!(error, Error::OutOfMemory { .. }) { DeviceErrorKind::OutOfMemory } else { otherwise };
    DeviceError::new(kind, format!("the wgpu device failed to {task}: {error}")).with_source(error)
}
