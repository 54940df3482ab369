//! The seam of whoever has lists of devices: [`Backend`].

use crate::{Device, DeviceError};
use alloc::string::{String, ToString};
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;
use core::fmt::Debug;

/// Devices of one kind that lists name: what an entry such as `brute:2` stands for.
///
/// An entry is the name, and after a colon, if there is one, which device it is to be: what that says is the backend's
/// own.
pub trait Backend: Send + Sync + Debug {
    /// What its entries begin with. It has no comma, no colon, no `@` and no blank.
    fn name(&self) -> &str;

    /// What its entries look like, for people: `brute:THREADS`.
    fn form(&self) -> &str;

    /// Entries of the devices that there are, or may be, for people who ask: usually one of each.
    fn entries(&self) -> Vec<String> {
        vec![self.name().to_string()]
    }

    /// Whether an entry can be read, of which `which` is what follows the colon. Nothing is opened, so this says
    /// nothing of the machine.
    ///
    /// # Errors
    /// When it cannot; the message names neither entry nor list, and says what would do.
    fn check(&self, which: Option<&str>) -> Result<(), DeviceError>;

    /// Opens a device. Each call opens one, also of the same `which`.
    ///
    /// # Errors
    /// When the entry cannot be read, or its device cannot be used; the message says what to do.
    fn open(&self, which: Option<&str>) -> Result<Arc<dyn Device>, DeviceError>;
}
