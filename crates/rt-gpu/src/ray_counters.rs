//! How many rays a device traced, how many of them the host, and how many it made.

use std::sync::atomic::{AtomicU64, Ordering};

/// Counts of rays that all tracers of a device add to.
#[derive(Debug, Default)]
pub struct RayCounters {
    rays: AtomicU64,
    on_host: AtomicU64,
    made: AtomicU64,
}

impl RayCounters {
    /// Rays of all launches and walks that were waited for.
    #[must_use]
    pub fn rays(&self) -> u64 {
        self.rays.load(Ordering::Relaxed)
    }

    /// Those among them that the kernel left to the host: in doubt, or with numbers too large or small for it.
    #[must_use]
    pub fn on_host(&self) -> u64 {
        self.on_host.load(Ordering::Relaxed)
    }

    /// Rays that the device made itself, each once a stream, when it was first asked for.
    #[must_use]
    pub fn made(&self) -> u64 {
        self.made.load(Ordering::Relaxed)
    }

    pub(crate) fn add_made(&self, rays: u32) {
        self.made.fetch_add(rays.into(), Ordering::Relaxed);
    }

    pub(crate) fn add(&self, rays: u32, on_host: usize) {
        self.rays.fetch_add(rays.into(), Ordering::Relaxed);
        self.on_host.fetch_add(on_host as u64, Ordering::Relaxed);
    }
}
