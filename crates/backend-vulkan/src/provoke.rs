//! Calls that tests know to be wrong, for the validation layer to object to.

use crate::buffer::{Buffer, Use};
use crate::commands::{Commands, Recorder};
use crate::device::VulkanDevice;
use rt_core::DeviceError;

impl VulkanDevice {
    /// Records a wrong call, which is never run: an error where the validation layer is at work, so that tests can tell
    /// that it is.
    ///
    /// # Errors
    /// What the layer said. Devices that were enumerated together share its messages.
    pub fn provoke_validation(&self) -> Result<(), DeviceError> {
        // The wrong way round: neither buffer was made for it.
        self.provoke([Use::Download, Use::Upload], |record, from, to| record.copy(from, to, 0, 4))
    }

    /// Records two copies to one place, the second of which does not wait for the first, and never runs them: an error
    /// where the validation layer looks at synchronisation too.
    ///
    /// # Errors
    /// As for [`VulkanDevice::provoke_validation`].
    pub fn provoke_race(&self) -> Result<(), DeviceError> {
        self.provoke([Use::Kernel, Use::Kernel], |record, from, to| {
            record.copy(from, to, 0, 4);
            record.copy(from, to, 0, 4);
        })
    }

    fn provoke(
        &self,
        purposes: [Use; 2],
        steps: impl FnOnce(&Recorder<'_>, &Buffer, &Buffer),
    ) -> Result<(), DeviceError> {
        let logical = &self.shared.logical;
        let [from, to] = purposes.map(|purpose| Buffer::new(logical, "a word", 4, purpose));
        let (from, to) = (from?, to?);
        Commands::new(logical)?.record(|record| steps(record, &from, &to))?;
        logical.check_validation()
    }
}
