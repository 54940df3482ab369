//! What a device's tracers have in common: its kernels, and what is known of it.

use crate::opened::Opened;
use crate::options::Options;
use crate::pipeline::Pipeline;
use rt_core::DeviceError;
use rt_gpu::{Faults, Trials};
use rt_shaders::{Kernel, Layout, Purpose};
use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// What a device's tracers have in common.
#[derive(Debug)]
pub(crate) struct Shared {
    pipelines: Mutex<HashMap<(Layout, Purpose, u32), Arc<Pipeline>>>,
    options: Options,
    /// Whether it makes the host's camera rays, and those that leave surfaces; asked when the first are wanted.
    pub trials: Trials,
    faults: Faults,
    pub opened: Arc<Opened>,
}

impl Shared {
    pub(crate) fn new(options: Options, opened: Opened) -> Self {
        Self {
            pipelines: Mutex::default(),
            options,
            trials: Trials::default(),
            faults: options.faults(),
            opened: Arc::new(opened),
        }
    }

    /// To be called before each launch: at the one that a test has chosen the device is closed under its feet.
    pub(crate) fn count_launch(&self) {
        if self.faults.lose_launch() {
            self.opened.device.destroy();
            // wgpu says so too, but after it has objected to the next call.
            let _ = self.opened.lose("a test closed it");
        }
    }

    /// The kernel for a layout, a purpose and a tree's depth; compiled once.
    pub(crate) fn pipeline(&self, layout: Layout, purpose: Purpose, depth: u32) -> Result<Arc<Pipeline>, DeviceError> {
        let kernel = self.faults.kernel(layout, purpose, depth)?;
        let mut pipelines = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        let key = (kernel.layout, kernel.purpose, kernel.stack);
        if let Some(pipeline) = pipelines.get(&key) {
            return Ok(Arc::clone(pipeline));
        }
        let (source, trusted) = self.source(kernel);
        let pipeline = Arc::new(Pipeline::new(&self.opened, kernel, &source, trusted)?);
        pipelines.insert(key, Arc::clone(&pipeline));
        Ok(pipeline)
    }

    /// A kernel's WGSL, and whether wgpu is to trust it.
    fn source(&self, kernel: &'static Kernel) -> (Cow<'static, str>, bool) {
        #[cfg(feature = "test-support")]
        if let Some(replace) = self.options.kernels {
            return (replace(kernel).into(), false);
        }
        (kernel.wgsl.into(), self.options.trusted)
    }
}
