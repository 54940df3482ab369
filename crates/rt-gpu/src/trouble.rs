//! What can go wrong with a card, provoked on purpose.

use rt_shaders::Purpose;

/// A trouble that a device is opened with, so that a test of a backend, or of a program that uses one, meets it truly.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Trouble {
    /// This kernel runs in place of every one that traces. [`Purpose::Poisoned`]: hits are wrong. [`Purpose::Slow`]:
    /// launches hang. [`Purpose::TooWide`]: the kernel cannot be compiled. All are valid, so that no driver crashes.
    Kernel(Purpose),
    /// The device is lost when launch n is handed to it, counting from 0 and walks too, and from then on.
    LostAtLaunch(u32),
}
