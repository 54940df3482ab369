//! Work on all cores: with the feature `parallel` on rayon's threads, where they can be started; without it here. What
//! comes of it is the same.

use alloc::vec::Vec;

/// Does `work` on every item; results are in the items' order.
pub(crate) fn each<T: Send, R: Send>(items: Vec<T>, work: impl Fn(T) -> R + Sync) -> Vec<R> {
    #[cfg(feature = "parallel")]
    if items.len() > 1 && threads() > 1 {
        use rayon::iter::{IntoParallelIterator, ParallelIterator};
        let settled = |item| {
            // Threads inherit their environment from whoever started them.
            let _environment = rt_fenv::Environment::enter();
            work(item)
        };
        return items.into_par_iter().map(settled).collect();
    }
    items.into_iter().map(work).collect()
}

/// Sorts entries that are all different.
pub(crate) fn sort<T: Ord + Send>(entries: &mut [T]) {
    #[cfg(feature = "parallel")]
    if threads() > 1 {
        return rayon::slice::ParallelSliceMut::par_sort_unstable(entries);
    }
    entries.sort_unstable();
}

/// How many threads there are for that.
#[cfg(feature = "parallel")]
pub(crate) fn threads() -> usize {
    extern crate std;
    // Rayon panics where its threads cannot be started (a limit of threads or memory), unless it is asked like this.
    static POOL: std::sync::LazyLock<bool> = std::sync::LazyLock::new(|| {
        use core::error::Error;
        let built = rayon::ThreadPoolBuilder::new().build_global();
        // An error without a cause says that there is a pool already.
        built.err().is_none_or(|error| error.source().is_none())
    });
    // On a thread of a pool that is the one meant.
    if rayon::current_thread_index().is_some() || *POOL { rayon::current_num_threads() } else { 1 }
}

/// How many threads there are for that.
#[cfg(not(feature = "parallel"))]
pub(crate) const fn threads() -> usize {
    1
}
