//! What can go wrong with a card, provoked on purpose, and what else tests want of its kernels.

use rt_core::{DeviceError, DeviceErrorKind};
use rt_shaders::{Kernel, Layout, Purpose};

/// What a device is opened with that a test of a backend, or of a program that uses one, wants of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Trouble {
    /// This kernel runs in place of every one that traces. [`Purpose::Poisoned`]: hits are wrong. [`Purpose::Slow`]:
    /// launches hang. [`Purpose::TooWide`]: the kernel cannot be compiled. All are valid, so that no driver crashes.
    Kernel(Purpose),
    /// The device is lost when launch n is handed to it, counting from 0 and walks too, and from then on.
    LostAtLaunch(u32),
    /// Nothing goes wrong, but kernels that look for the nearest hit count in each ray how often it was visited since it was
    /// loaded. A walk by [`rt_core::ReducedWalk::LeafAsHit`] brings that number back in place of box tests.
    CountVisits,
}

impl Trouble {
    /// The kernel for a layout, a purpose and a tree's depth, or the one that `trouble` puts in its place.
    ///
    /// # Errors
    /// [`DeviceErrorKind::Unsupported`] when the tree is too deep.
    pub fn kernel(
        trouble: Option<Self>,
        layout: Layout,
        purpose: Purpose,
        depth: u32,
    ) -> Result<&'static Kernel, DeviceError> {
        let (layout, purpose) = match (trouble, purpose) {
            (Some(Self::Kernel(instead)), purpose) if purpose.traces() => (Layout::Two, instead),
            (Some(Self::CountVisits), Purpose::Closest) => (layout, Purpose::Visiting),
            (Some(Self::CountVisits), Purpose::ClosestCounted) => (layout, Purpose::VisitingCounted),
            (Some(Self::CountVisits), Purpose::LeafAsHit) => (Layout::Two, Purpose::Visits),
            _ => (layout, purpose),
        };
        rt_shaders::kernel(layout, purpose, depth).ok_or_else(|| {
            DeviceError::new(DeviceErrorKind::Unsupported, format!("no kernel traces a tree of depth {depth}"))
        })
    }
}
