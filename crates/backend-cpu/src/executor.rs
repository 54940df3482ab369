//! The threads of one CPU device.

use core_affinity::CoreId;
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use rayon::{ThreadPool, ThreadPoolBuilder};
use rt_fenv::Environment;
use std::sync::Arc;

/// Runs pieces of work on a device's own threads.
pub(crate) struct Executor {
    threads: usize,
    cores: Vec<CoreId>,
    /// Absent for a device of one thread: its tracer's thread does the work itself, which saves two hand-overs per
    /// launch.
    pool: Option<Arc<ThreadPool>>,
    /// Whether the threads serve others as well, whose floating-point environment they keep.
    is_shared: bool,
}

impl Executor {
    pub(crate) fn new(device: usize, threads: usize, cores: Vec<CoreId>) -> Result<Self, rayon::ThreadPoolBuildError> {
        let pool = if threads > 1 {
            let pinned = cores.clone();
            let builder = ThreadPoolBuilder::new()
                .num_threads(threads)
                .thread_name(move |i| format!("rt-cpu{device}-{i}"))
                .start_handler(move |i| {
                    rt_fenv::settle_thread();
                    if let Some(core) = pinned.get(i) {
                        core_affinity::set_for_current(*core);
                    }
                });
            Some(Arc::new(builder.build()?))
        } else {
            None
        };
        Ok(Self { threads, cores, pool, is_shared: false })
    }

    /// Threads that the caller has already.
    pub(crate) fn on(pool: Arc<ThreadPool>) -> Self {
        Self { threads: pool.current_num_threads(), cores: Vec::new(), pool: Some(pool), is_shared: true }
    }

    pub(crate) const fn threads(&self) -> usize {
        self.threads
    }

    /// Pins the calling thread if it is the one that will do the work.
    pub(crate) fn adopt_current_thread(&self) {
        if let (None, Some(core)) = (&self.pool, self.cores.first()) {
            core_affinity::set_for_current(*core);
        }
    }

    /// Calls `work` for every item, on all threads; `init` makes each thread's scratch.
    pub(crate) fn for_each<T: Send, S>(
        &self,
        items: Vec<T>,
        init: impl Fn() -> S + Send + Sync,
        work: impl Fn(&mut S, T) + Send + Sync,
    ) {
        match &self.pool {
            None => {
                let mut scratch = init();
                items.into_iter().for_each(|item| work(&mut scratch, item));
            }
            Some(pool) if self.is_shared => pool.install(|| {
                items.into_par_iter().for_each_init(init, |scratch, item| {
                    let _environment = Environment::enter();
                    work(scratch, item);
                });
            }),
            Some(pool) => pool.install(|| items.into_par_iter().for_each_init(init, work)),
        }
    }
}

impl std::fmt::Debug for Executor {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let cores: Vec<usize> = self.cores.iter().map(|c| c.id).collect();
        f.debug_struct("Executor").field("threads", &self.threads).field("cores", &cores).finish()
    }
}
