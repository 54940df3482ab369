//! What a device's tracers have in common: its kernels, what is known of it, and what was left behind on it.

use crate::gpu::Abandoned;
use crate::logical::Logical;
use crate::options::Options;
#[cfg(feature = "test-support")]
use crate::options::Replacement;
use crate::pipeline::{self, Pipeline};
use rt_core::DeviceError;
use rt_gpu::{Faults, Trials};
use rt_shaders::{Kernel, Layout, Purpose};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// What a device's tracers have in common.
#[derive(Debug)]
pub(crate) struct Shared {
    pipelines: Mutex<HashMap<(Layout, Purpose, u32), Arc<Pipeline>>>,
    layout: Arc<pipeline::Layout>,
    pub faults: Faults,
    #[cfg(feature = "test-support")]
    kernels: Option<Replacement>,
    /// Whether it makes the host's camera rays, and those that leave surfaces; asked when the first are wanted.
    pub trials: Trials,
    pub abandoned: Abandoned,
    pub logical: Arc<Logical>,
}

impl Shared {
    pub(crate) fn new(options: &Options, layout: pipeline::Layout, logical: Arc<Logical>) -> Self {
        Self {
            pipelines: Mutex::default(),
            layout: Arc::new(layout),
            faults: options.faults(),
            #[cfg(feature = "test-support")]
            kernels: options.kernels,
            trials: Trials::default(),
            abandoned: Abandoned::default(),
            logical,
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
        let pipeline = Arc::new(Pipeline::new(&self.layout, kernel, &self.words(kernel))?);
        pipelines.insert(key, Arc::clone(&pipeline));
        Ok(pipeline)
    }

    fn words(&self, kernel: &'static Kernel) -> Vec<u32> {
        #[cfg(feature = "test-support")]
        if let Some(Replacement(words)) = self.kernels {
            return words(kernel);
        }
        kernel.spirv_with(self.logical.limits.float_controls)
    }

    pub(crate) const fn layout(&self) -> &Arc<pipeline::Layout> {
        &self.layout
    }
}
