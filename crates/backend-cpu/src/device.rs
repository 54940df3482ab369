//! Opening CPU devices.

use crate::executor::Executor;
use crate::instructions::{self, InstructionsError};
use crate::launches::{Layout, Trees};
use crate::tracer::CpuTracer;
use core_affinity::CoreId;
use rt_core::{Capabilities, Clock, Counted, Device, DeviceError, DeviceInfo, Scene, Tracer};
use rt_simd::{Isa, Kernel};
use std::fmt;
use std::sync::Arc;

/// Launches a CPU device keeps in flight. Two hide the host's hand-over between launches.
const IN_FLIGHT: u32 = 2;

/// A set of cores of this machine.
#[derive(Debug)]
pub struct CpuDevice {
    info: DeviceInfo,
    executor: Arc<Executor>,
    kernel: Kernel,
    trees: Arc<Trees>,
}

impl CpuDevice {
    /// Opens one device for each entry of `threads`, with that many threads (0: as many as cores are left).
    ///
    /// Cores are dealt in order and each device is pinned to its own. Where all devices together want more threads
    /// than there are cores, or the system does not let us pin, none is pinned.
    ///
    /// They trace with the best instructions that the processor has, or with those that the environment variable
    /// `RAYBALANCE_ISA` names.
    ///
    /// # Errors
    /// When the system cannot start a thread, or `RAYBALANCE_ISA` asks for instructions that there are not.
    pub fn open_all(threads: &[usize]) -> Result<Vec<Self>, OpenError> {
        Self::open_all_with(threads, None)
    }

    /// The same with instructions of the caller's choice, whatever the environment says. Nearest hits are the same bits
    /// with each.
    ///
    /// # Errors
    /// When the system cannot start a thread, or the processor lacks the instructions.
    pub fn open_all_with(threads: &[usize], isa: Option<Isa>) -> Result<Vec<Self>, OpenError> {
        let kernel = instructions::kernel(isa).map_err(OpenError::Instructions)?;
        let trees = Arc::new(Trees::default());
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
                Self::open(index, n, own, kernel, Arc::clone(&trees))
            })
            .collect()
    }

    /// A device that works on the threads of a pool that the program has already. They are not pinned, and what they do
    /// for others beside is time that the device seems to take: its seconds are those that a thread computed for it.
    ///
    /// # Errors
    /// When `RAYBALANCE_ISA` asks for instructions that there are not.
    pub fn on_pool(pool: Arc<rayon::ThreadPool>) -> Result<Self, OpenError> {
        let kernel = instructions::kernel(None).map_err(OpenError::Instructions)?;
        let executor = Executor::on(pool);
        let threads = executor.threads();
        let name = format!("CPU pool ({threads} {}, {})", plural(threads, "thread"), kernel.isa());
        Ok(Self::with(name, executor, kernel, Arc::default()))
    }

    /// Number of cores this process may use, at least 1.
    #[must_use]
    pub fn cores() -> usize {
        std::thread::available_parallelism().map_or(1, usize::from)
    }

    /// The instructions with which it traces.
    #[must_use]
    pub const fn isa(&self) -> Isa {
        self.kernel.isa()
    }

    fn open(
        index: usize,
        threads: usize,
        cores: Vec<CoreId>,
        kernel: Kernel,
        trees: Arc<Trees>,
    ) -> Result<Self, OpenError> {
        let isa = kernel.isa();
        let name = match cores.as_slice() {
            [] => format!("CPU {index} ({threads} {}, not pinned, {isa})", plural(threads, "thread")),
            [core] => format!("CPU {index} (core {}, {isa})", core.id),
            [first, .., last] => format!("CPU {index} (cores {}-{}, {isa})", first.id, last.id),
        };
        let executor = Executor::new(index, threads, cores).map_err(|source| OpenError::Threads { threads, source })?;
        Ok(Self::with(name, executor, kernel, trees))
    }

    fn with(name: String, executor: Executor, kernel: Kernel, trees: Arc<Trees>) -> Self {
        let capabilities = Capabilities::UNKNOWN.with_counts(Counted::EitherTree).with_defined_bits();
        let info = DeviceInfo::new(name, "cpu")
            .with_units(executor.threads() as u32)
            .with_in_flight(IN_FLIGHT)
            .with_capabilities(capabilities.with_all_hits().with_masks());
        Self { info, executor: Arc::new(executor), kernel, trees }
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
        let (executor, layout) = (Arc::clone(&self.executor), Layout::new(self.kernel, Arc::clone(&self.trees)));
        Ok(Box::new(CpuTracer::new(executor, scene, layout, clock, IN_FLIGHT)?))
    }
}

/// Why a CPU device could not be opened.
#[derive(Debug)]
#[non_exhaustive]
pub enum OpenError {
    /// The system cannot start so many threads.
    Threads {
        /// How many were asked for.
        threads: usize,
        /// What the thread pool says.
        source: rayon::ThreadPoolBuildError,
    },
    /// There are no such instructions.
    Instructions(InstructionsError),
}

impl fmt::Display for OpenError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Threads { threads, .. } => {
                write!(f, "cannot start {threads} threads for a CPU device: ask for fewer")
            }
            Self::Instructions(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for OpenError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            // What the system said; rayon's error says no more.
            Self::Threads { source, .. } => source.source().or(Some(source)),
            Self::Instructions(_) => None,
        }
    }
}
