//! What a test makes go wrong with a card, and what else tests want of its kernels.

use rt_core::{DeviceError, DeviceErrorKind};
use rt_shaders::{Kernel, Layout, Purpose};
#[cfg(feature = "test-support")]
use std::sync::atomic::{AtomicU32, Ordering};

/// What a device is opened with that a test of a backend, or of a program that uses one, wants of it.
#[cfg(feature = "test-support")]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FaultInjection {
    /// This kernel runs in place of every one that traces. [`Purpose::Poisoned`]: hits are wrong. [`Purpose::Slow`]:
    /// launches hang. [`Purpose::TooWide`]: the kernel cannot be compiled. All are valid, so that no driver crashes.
    Kernel(Purpose),
    /// The device is lost when launch n is handed to it, counting from 0 and walks too, and from then on.
    LostAtLaunch(u32),
    /// Nothing goes wrong, but kernels that look for the nearest hit count in each ray how often it was visited since
    /// it was loaded. A walk by [`rt_core::ReducedWalk::LeafAsHit`] brings that number back in place of box tests.
    CountVisits,
}

/// The faults of an opened device: without the feature `test-support` there are none, and nothing to look up.
#[derive(Debug, Default)]
pub struct Faults {
    #[cfg(feature = "test-support")]
    injected: Option<FaultInjection>,
    /// Launches so far, walks too.
    #[cfg(feature = "test-support")]
    launches: AtomicU32,
}

impl Faults {
    /// Those that a test asks for.
    #[cfg(feature = "test-support")]
    #[must_use]
    pub fn of(injected: Option<FaultInjection>) -> Self {
        Self { injected, ..Self::default() }
    }

    /// The kernel for a layout, a purpose and a tree's depth, or the one that a fault puts in its place.
    ///
    /// # Errors
    /// [`DeviceErrorKind::Unsupported`] when the tree is too deep.
    pub fn kernel(&self, layout: Layout, purpose: Purpose, depth: u32) -> Result<&'static Kernel, DeviceError> {
        let (layout, purpose) = self.instead(layout, purpose);
        rt_shaders::kernel(layout, purpose, depth).ok_or_else(|| {
            DeviceError::new(DeviceErrorKind::Unsupported, format!("no kernel traces a tree of depth {depth}"))
        })
    }

    #[cfg(feature = "test-support")]
    fn instead(&self, layout: Layout, purpose: Purpose) -> (Layout, Purpose) {
        match (self.injected, purpose) {
            (Some(FaultInjection::Kernel(instead)), purpose) if purpose.traces() => (Layout::Two, instead),
            (Some(FaultInjection::CountVisits), Purpose::Closest) => (layout, Purpose::Visiting),
            (Some(FaultInjection::CountVisits), Purpose::ClosestCounted) => (layout, Purpose::VisitingCounted),
            (Some(FaultInjection::CountVisits), Purpose::LeafAsHit) => (Layout::Two, Purpose::Visits),
            _ => (layout, purpose),
        }
    }

    #[cfg(not(feature = "test-support"))]
    #[expect(clippy::unused_self, reason = "the same call with and without the feature")]
    const fn instead(&self, layout: Layout, purpose: Purpose) -> (Layout, Purpose) {
        (layout, purpose)
    }

    /// To be asked before each launch: whether it is to find the device lost.
    #[cfg(feature = "test-support")]
    pub fn lose_launch(&self) -> bool {
        let launch = self.launches.fetch_add(1, Ordering::Relaxed);
        self.injected == Some(FaultInjection::LostAtLaunch(launch))
    }

    /// To be asked before each launch: whether it is to find the device lost.
    #[cfg(not(feature = "test-support"))]
    #[must_use]
    pub const fn lose_launch(&self) -> bool {
        false
    }
}
