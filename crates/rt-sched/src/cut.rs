//! How finely a stream is cut: tasks enough for devices to end together, and not so small that tracing takes longer.

use alloc::vec::Vec;
use rt_core::{Task, tasks_of};

/// Rays per task when nothing else is asked for: a 32 × 32 pixel tile of primary rays, the size of the paper's
/// Figure 1 at which tasks are still fine enough to balance and coarse enough to estimate.
pub const DEFAULT_TASK_SIZE: u32 = 1024;

/// Rays per task below which tracing itself takes longer: 1.5% with 256 on a processor, 4.5% with 128.
const LEAST_TASK_SIZE: u32 = 256;

/// Tasks a device from which on smaller ones are not worth what they cost where they are below
/// [`DEFAULT_TASK_SIZE`]: a queue that knows nothing then ends within a percent of the bound on equal devices, and
/// within some percent on others (docs/results/scheduling.md).
const ENOUGH: u32 = 64;

/// Tasks a device from which on smaller ones gain nothing, where they cost nothing.
const PLENTY: u32 = 256;

/// Cuts those tasks finer that are too large for so many devices to end together: that can be halved and are still
/// [`DEFAULT_TASK_SIZE`] and a 256th of a device's share or, where a 64th of it is less than that size, that are more
/// than a 64th, and two of the smallest size. `None` if there are none.
///
/// Nothing is known of costs and speeds here. A task that is large beside a device's share is a long time on a device
/// that is slower than thought, or if it is more expensive than thought; no order and no estimate of large tasks is as
/// good as small ones.
#[must_use]
pub fn finer(tasks: &[Task], devices: usize) -> Option<Vec<Task>> {
    let rays: u32 = tasks.iter().map(|task| task.rays).sum();
    let devices = u32::try_from(devices).unwrap_or(u32::MAX);
    let share = |parts: u32| rays / parts.saturating_mul(devices);
    if devices < 2 || rays == 0 {
        return None;
    }
    let (most, size) = match share(ENOUGH) {
        DEFAULT_TASK_SIZE.. => {
            let size = share(PLENTY).max(DEFAULT_TASK_SIZE);
            (size.saturating_mul(2) - 1, size)
        }
        most @ 512.. => (most, 512),
        most => (most, LEAST_TASK_SIZE),
    };
    let parts = |task: &Task| if task.rays > most { (task.rays / size).max(1) } else { 1 };
    let all: usize = tasks.iter().map(|task| parts(task) as usize).sum();
    if all == tasks.len() {
        return None;
    }
    let mut cut = Vec::with_capacity(all);
    for task in tasks {
        // All but the last of exactly one size: by that queues know that they were told nothing of their costs.
        match parts(task) {
            1 => cut.push(*task),
            parts => {
                let moved = |part: Task| Task { first: task.first + part.first, ..part };
                cut.extend(tasks_of(task.rays, task.rays.div_ceil(parts)).into_iter().map(moved));
            }
        }
    }
    Some(cut)
}

/// A stream of so many rays cut for so many devices: into tasks of [`DEFAULT_TASK_SIZE`] rays, or as [`finer`] says.
#[must_use]
pub fn cut_for(rays: u32, devices: usize) -> Vec<Task> {
    let tasks = tasks_of(rays, DEFAULT_TASK_SIZE);
    finer(&tasks, devices).unwrap_or(tasks)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Mutants: devices left out; a size that grows with them; no least size.
    #[test]
    fn devices_have_enough_tasks_where_rays_allow() {
        let size = |devices| cut_for(1 << 17, devices)[0].rays;
        assert_eq!([0, 1, 2, 3, 4, 5, 8, 1_000].map(size), [1024, 1024, 1024, 512, 512, 256, 256, 256]);
    }

    /// Mutants: `most` of all rays; only streams of few tasks that are cut; parts of all tasks alike.
    #[test]
    fn large_tasks_are_cut_and_small_ones_are_not() {
        let sizes = |tasks: &[Task], devices| finer(tasks, devices).map(|cut| cut.iter().map(|t| t.rays).collect());
        let four = tasks_of(1 << 20, 1 << 18);
        assert_eq!(sizes(&four, 1), None);
        assert_eq!(sizes(&four, 2), Some(alloc::vec![2048; 512]));
        assert_eq!(sizes(&four, 8), Some(alloc::vec![1024; 1024]));
        // Those that are no more than a 64th of a share too.
        assert_eq!(sizes(&tasks_of(1 << 20, 1 << 13), 2), Some(alloc::vec![2048; 512]));
        assert_eq!(sizes(&tasks_of(1 << 20, 1 << 11), 2), None);
        // One task that is large beside many that are not.
        let mut tasks = tasks_of(1 << 18, 1024);
        tasks.push(Task { first: 1 << 18, rays: 8 << 10 });
        let found: Vec<u32> = sizes(&tasks, 2).expect("one is cut");
        assert_eq!(found, [1024; 256 + 8]);
        // Of rays that are so few nothing smaller is made.
        assert_eq!(sizes(&tasks_of(10_000, 300), 8), None);
    }

    proptest! {
        /// Every ray stays in one task, in order, and every task was cut into equal parts.
        ///
        /// Mutant: parts that begin where rounding says and end by their size.
        #[test]
        fn parts_cover_the_tasks(rays in prop::collection::vec(0_u32..200_000, 1..40), devices in 0_usize..20) {
            let mut first = 0;
            let tasks: Vec<Task> = rays
                .iter()
                .map(|&rays| {
                    let task = Task { first, rays };
                    first += rays;
                    task
                })
                .collect();
            let cut = finer(&tasks, devices).unwrap_or_else(|| tasks.clone());
            let mut next = 0;
            for part in &cut {
                prop_assert_eq!(part.first, next);
                next = part.range().end;
            }
            prop_assert_eq!(next, first);
            prop_assert!(tasks.iter().all(|task| cut.iter().any(|part| part.first == task.first)));
            let small = cut.iter().filter(|part| part.rays < 256 && !tasks.contains(part)).count();
            prop_assert!(small <= tasks.len(), "the last of a task at most");
        }
    }
}
