//! Opening CPU devices.

use crate::executor::Executor;
use crate::tracer::CpuTracer;
use core_affinity::CoreId;
use rt_core::{Capabilities, Clock, Counted, Device, DeviceError, DeviceInfo, Scene, Tracer};
use std::fmt;
use std::sync::Arc;

/// Launches a CPU device keeps in flight. Two hide the host's hand-over between launches.
const IN_FLIGHT: u32 = 2;

/// A set of cores of this machine.
#[derive(Debug)]
pub struct CpuDevice {
    info: DeviceInfo,
    executor: Arc<Executor>,
}

impl CpuDevice {
    /// Opens one device for each entry of `threads`, with that many threads (0: as many as cores are left).
    ///
    /// Cores are dealt in order and each device is pinned to its own. Where all devices together want more threads
    /// than there are cores, or the system does not let us pin, none is pinned.
    ///
    /// # Errors
    /// When the system cannot start a thread.
    pub fn open_all(threads: &[usize]) -> Result<Vec<Self>, OpenError> {
        let cores = core_affinity::get_core_ids().unwrap_or_default();
        let available = Self::cores();
        let asked: usize = threads.iter().sum();
        let rest = available.saturating_sub(asked).max(1);
        let wanted: Vec<usize> = threads.iter().map(|&n| if n == 0 { rest } else { n }).collect();
        let pin = wanted.iter().sum::<usize>() <= cores.len();
        let mut free = cores.into_iter();
        wanted
            .into_iter()
            .enumerate()
            .map(|(index, n)| {
                let own: Vec<CoreId> = if pin { free.by_ref().take(n).collect() } else { Vec::new() };
                Self::open(index, n, own)
            })
            .collect()
    }

    /// Number of cores this process may use, at least 1.
    #[must_use]
    pub fn cores() -> usize {
        std::thread::available_parallelism().map_or(1, usize::from)
    }

    fn open(index: usize, threads: usize, cores: Vec<CoreId>) -> Result<Self, OpenError> {
        let name = match cores.as_slice() {
            [] => format!("CPU {index} ({threads} {}, not pinned)", plural(threads, "thread")),
            [core] => format!("CPU {index} (core {})", core.id),
            [first, .., last] => format!("CPU {index} (cores {}-{})", first.id, last.id),
        };
        let executor = Executor::new(index, threads, cores).map_err(|source| OpenError { threads, source })?;
        let info = DeviceInfo::new(name, "cpu")
            .with_units(threads as u32)
            .with_in_flight(IN_FLIGHT)
            .with_capabilities(Capabilities::UNKNOWN.with_counts(Counted::SceneTree).with_defined_bits());
        Ok(Self { info, executor: Arc::new(executor) })
    }
}

fn plural(n: usize, word: &str) -> String {
    if n == 1 { word.to_owned() } else { format!("{word}s") }
}

impl Device for CpuDevice {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn tracer(&self, scene: Arc<Scene>, clock: Clock) -> Result<Box<dyn Tracer>, DeviceError> {
        Ok(Box::new(CpuTracer::new(Arc::clone(&self.executor), scene, clock, IN_FLIGHT)?))
    }
}

/// Why a CPU device could not be opened.
#[derive(Debug)]
pub struct OpenError {
    threads: usize,
    source: rayon::ThreadPoolBuildError,
}

impl fmt::Display for OpenError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "cannot start {} threads for a CPU device: ask for fewer", self.threads)
    }
}

impl std::error::Error for OpenError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        // What the system said; rayon's error says no more.
        self.source.source().or(Some(&self.source))
    }
}
