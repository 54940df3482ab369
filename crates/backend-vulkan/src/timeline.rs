//! A semaphore that counts the finished launches of one tracer.

use crate::error::failed;
use crate::logical::Logical;
use ash::vk;
use rt_core::{DeviceError, DeviceErrorKind};
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

/// A timeline semaphore: launch n sets it to n, starting from 1.
pub(crate) struct Timeline {
    logical: Arc<Logical>,
    raw: vk::Semaphore,
    submitted: u64,
}

impl fmt::Debug for Timeline {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Timeline").field("submitted", &self.submitted).finish_non_exhaustive()
    }
}

impl Timeline {
    pub(crate) fn new(logical: &Arc<Logical>) -> Result<Self, DeviceError> {
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        // SAFETY: the device is alive, has the feature enabled, and `info` lives until the call returns.
        let raw = unsafe { logical.raw().create_semaphore(&info, None) }.map_err(failed("create a semaphore"))?;
        Ok(Self { logical: Arc::clone(logical), raw, submitted: 0 })
    }

    /// Submits commands and returns the value that says they are done.
    pub(crate) fn submit(&mut self, commands: vk::CommandBuffer) -> Result<u64, DeviceError> {
        let value = self.submitted + 1;
        let (values, semaphores, commands) = ([value], [self.raw], [commands]);
        let mut timeline = vk::TimelineSemaphoreSubmitInfo::default().signal_semaphore_values(&values);
        let info = vk::SubmitInfo::default()
            .command_buffers(&commands)
            .signal_semaphores(&semaphores)
            .push_next(&mut timeline);
        self.logical.submit(&info)?;
        self.submitted = value;
        Ok(value)
    }

    /// Waits until launch `value` is done, at most `limit`.
    pub(crate) fn wait(&self, value: u64, limit: Duration) -> Result<(), DeviceError> {
        self.logical.check_lost("finish a launch")?;
        self.wait_for(value, limit).map_err(|source| match source {
            vk::Result::TIMEOUT => {
                DeviceError::new(DeviceErrorKind::Hung, format!("a Vulkan launch was not done within {limit:?}"))
            }
            source => self.logical.failed("finish a launch", source),
        })
    }

    /// Waits until everything that was submitted is done, at most `limit`; says whether it is. What a lost device had
    /// to do is done: it does nothing any more.
    pub(crate) fn idle(&self, limit: Duration) -> bool {
        self.submitted == 0
            || matches!(self.wait_for(self.submitted, limit), Ok(()) | Err(vk::Result::ERROR_DEVICE_LOST))
    }

    fn wait_for(&self, value: u64, limit: Duration) -> Result<(), vk::Result> {
        let (values, semaphores) = ([value], [self.raw]);
        let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        let nanoseconds = u64::try_from(limit.as_nanos()).unwrap_or(u64::MAX);
        // SAFETY: the semaphore is of this device.
        unsafe { self.logical.raw().wait_semaphores(&info, nanoseconds) }
    }
}

impl Drop for Timeline {
    fn drop(&mut self) {
        // SAFETY: the tracer waited for all launches before dropping it, or does not drop it.
        unsafe { self.logical.raw().destroy_semaphore(self.raw, None) };
    }
}
