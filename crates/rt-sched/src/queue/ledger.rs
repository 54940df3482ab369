//! Who holds which task: the bookkeeping that all queues share.

use super::Pop;
use super::atomics::{AtomicBool, AtomicU32, AtomicU64, AtomicUsize, Ordering};
use alloc::boxed::Box;
use alloc::vec::Vec;
use rt_core::TaskId;

/// Holder of a task that waits in a queue.
const NOBODY: u32 = u32::MAX;
/// Holder of a task that is finished.
const FINISHED: u32 = u32::MAX - 1;

/// For each task who holds it, which tasks are orphans of lost devices, and which devices are lost.
///
/// A task's holder is one word: `NOBODY → device → FINISHED`, and `device → NOBODY` when the device gives it up. The
/// last two steps compare and swap on the device's number, so only the holder can take them, and only once.
#[derive(Debug)]
pub(crate) struct Ledger {
    holders: Box<[AtomicU32]>,
    unfinished: AtomicUsize,
    /// One bit per task. Whoever clears a set bit owns the task.
    orphans: Box<[AtomicU64]>,
    /// At least the number of set bits: raised before bits are set, lowered after they are cleared.
    orphan_count: AtomicUsize,
    retired: Box<[AtomicBool]>,
    alive: AtomicUsize,
}

impl Ledger {
    pub(crate) fn new(tasks: usize, devices: usize) -> Self {
        Self {
            holders: (0..tasks).map(|_| AtomicU32::new(NOBODY)).collect(),
            unfinished: AtomicUsize::new(tasks),
            orphans: (0..tasks.div_ceil(64)).map(|_| AtomicU64::new(0)).collect(),
            orphan_count: AtomicUsize::new(0),
            retired: (0..devices).map(|_| AtomicBool::new(false)).collect(),
            alive: AtomicUsize::new(devices),
        }
    }

    /// Whether the device may launch nothing more: lost, or unknown.
    pub(crate) fn is_retired(&self, device: usize) -> bool {
        self.retired.get(device).is_none_or(|r| r.load(Ordering::Acquire))
    }

    /// Number of devices that are not lost.
    pub(crate) fn alive(&self) -> usize {
        self.alive.load(Ordering::Acquire)
    }

    /// Enters `device` as the holder of tasks that the caller alone has claimed.
    pub(crate) fn hand_out(&self, device: usize, tasks: &[TaskId]) {
        for &task in tasks {
            self.holders[task as usize].store(device as u32, Ordering::Release);
        }
    }

    /// Swaps the holder of a task from `device` to `to`; `false` if the device does not hold it.
    fn leave(&self, device: usize, task: TaskId, to: u32) -> bool {
        device < self.retired.len()
            && self.holders.get(task as usize).is_some_and(|holder| {
                holder.compare_exchange(device as u32, to, Ordering::AcqRel, Ordering::Relaxed).is_ok()
            })
    }

    pub(crate) fn finish(&self, device: usize, tasks: &[TaskId]) {
        let finished = tasks.iter().filter(|&&task| self.leave(device, task, FINISHED)).count();
        self.unfinished.fetch_sub(finished, Ordering::AcqRel);
    }

    /// Marks the device as lost and makes orphans of those of `unfinished` that it holds.
    pub(crate) fn retire(&self, device: usize, unfinished: &[TaskId]) {
        if self.retired.get(device).is_some_and(|r| !r.swap(true, Ordering::AcqRel)) {
            self.alive.fetch_sub(1, Ordering::AcqRel);
        }
        for &task in unfinished {
            if self.leave(device, task, NOBODY) {
                self.orphan(task);
            }
        }
    }

    /// Marks the device as no longer lost.
    pub(crate) fn readmit(&self, device: usize) {
        if self.retired.get(device).is_some_and(|r| r.swap(false, Ordering::AcqRel)) {
            self.alive.fetch_add(1, Ordering::AcqRel);
        }
    }

    /// Makes an orphan of a task that the caller alone has claimed.
    pub(crate) fn orphan(&self, task: TaskId) {
        self.orphan_count.fetch_add(1, Ordering::AcqRel);
        self.orphans[task as usize / 64].fetch_or(1 << (task % 64), Ordering::AcqRel);
    }

    /// Claims up to `share(number of orphans)` orphans, at least one if there is any, in increasing order.
    pub(crate) fn adopt(&self, share: impl Fn(usize) -> usize, out: &mut Vec<TaskId>) -> bool {
        let count = self.orphan_count.load(Ordering::Acquire);
        if count == 0 {
            return false;
        }
        let wanted = share(count).max(1);
        for (word, bits) in (0_u32..).zip(&self.orphans) {
            let mut seen = bits.load(Ordering::Acquire);
            while seen != 0 && out.len() < wanted {
                let lowest = seen & seen.wrapping_neg();
                seen ^= lowest;
                if bits.fetch_and(!lowest, Ordering::AcqRel) & lowest != 0 {
                    out.push(word * 64 + lowest.trailing_zeros());
                }
            }
            if out.len() >= wanted {
                break;
            }
        }
        self.orphan_count.fetch_sub(out.len(), Ordering::AcqRel);
        !out.is_empty()
    }

    /// The answer to a device for which there is no task.
    pub(crate) fn idle(&self) -> Pop {
        if self.unfinished.load(Ordering::Acquire) == 0 { Pop::Done } else { Pop::Wait }
    }

    pub(crate) fn unfinished_tasks(&self) -> Vec<TaskId> {
        let open = |(_, holder): &(TaskId, &AtomicU32)| holder.load(Ordering::Acquire) != FINISHED;
        (0..).zip(&self.holders).filter(open).map(|(task, _)| task).collect()
    }
}
