//! What a device holds for a scene, and what becomes of it when nobody waits for the device any more.

use crate::buffer::Buffer;
use crate::launch::Slot;
use crate::logical::Logical;
use crate::pipeline::Layout;
use crate::timeline::Timeline;
use crate::upload::{Resident, Uploader};
use rt_core::DeviceError;
use rt_gpu::Flight;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// What the device holds.
#[derive(Debug)]
pub(crate) struct Gpu {
    pub(crate) timeline: Timeline,
    pub(crate) uploader: Uploader,
    pub(crate) resident: Resident,
    /// The windows: as many rays in each but the last.
    pub(crate) rays: Vec<Buffer>,
    /// As many as kernels were in flight at once.
    pub(crate) slots: Vec<Slot>,
    /// Kernels in flight with the slot and the number of items of each.
    pub(crate) busy: Vec<(Flight, usize, u32)>,
}

impl Gpu {
    /// A slot without a launch in flight.
    pub(crate) fn free_slot(&mut self, logical: &Arc<Logical>, layout: &Arc<Layout>) -> Result<usize, DeviceError> {
        let Self { slots, busy, .. } = self;
        let free = (0..slots.len()).find(|index| busy.iter().all(|(_, slot, _)| slot != index));
        if free.is_none() {
            slots.push(Slot::new(logical, layout)?);
        }
        Ok(free.unwrap_or(slots.len() - 1))
    }
}

/// What a device may still write to though nobody waits for it any more: freed when it no longer does, or never.
#[derive(Debug, Default)]
pub(crate) struct Abandoned(Mutex<Vec<Gpu>>);

impl Abandoned {
    pub(crate) fn add(&self, gpu: Gpu) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(gpu);
    }

    /// Frees what the device is done with.
    pub(crate) fn sweep(&self) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).retain(|gpu| !gpu.timeline.idle(Duration::ZERO));
    }
}

impl Drop for Abandoned {
    fn drop(&mut self) {
        self.sweep();
        // Better lost than freed. What is lost holds the device, which so stays open.
        std::mem::take(self.0.get_mut().unwrap_or_else(PoisonError::into_inner)).into_iter().for_each(std::mem::forget);
    }
}
