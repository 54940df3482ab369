//! Tasks: the pieces of a stream that are scheduled.

use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// Position of a task in its stream's task list.
pub type TaskId = u32;

/// A contiguous range of a stream's rays: what one device traces at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Task {
    /// Index of the first ray.
    pub first: u32,
    /// Number of rays.
    pub rays: u32,
}

impl Task {
    /// The ray indices of the task.
    #[must_use]
    pub const fn range(&self) -> Range<u32> {
        self.first..self.first + self.rays
    }
}

/// Cuts a stream of `rays` rays into tasks of `task_size` rays; the last one may be smaller.
///
/// A `task_size` of 0 is treated as 1. No rays make no tasks.
#[must_use]
pub fn tasks_of(rays: u32, task_size: u32) -> Vec<Task> {
    let size = task_size.max(1);
    let mut tasks = Vec::with_capacity(rays.div_ceil(size) as usize);
    let mut first = 0;
    while first < rays {
        let count = size.min(rays - first);
        tasks.push(Task { first, rays: count });
        first += count;
    }
    tasks
}

/// One bit per ray of a stream: set for rays whose hit is already known and need not be traced again.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RayMask {
    words: Vec<u64>,
}

impl RayMask {
    /// A mask for `rays` rays with every bit clear.
    #[must_use]
    pub fn new(rays: u32) -> Self {
        Self { words: vec![0; rays.div_ceil(64) as usize] }
    }

    /// Sets the bit of `ray`; a ray beyond the mask is ignored.
    pub fn insert(&mut self, ray: u32) {
        if let Some(word) = self.words.get_mut(ray as usize / 64) {
            *word |= 1 << (ray % 64);
        }
    }

    /// Whether the bit of `ray` is set; `false` beyond the mask.
    #[must_use]
    pub fn contains(&self, ray: u32) -> bool {
        self.words.get(ray as usize / 64).is_some_and(|word| word >> (ray % 64) & 1 == 1)
    }

    /// Number of set bits.
    #[must_use]
    pub fn count(&self) -> u32 {
        self.words.iter().map(|w| w.count_ones()).sum()
    }

    /// Number of set bits in a range of rays; the part beyond the mask counts 0.
    #[must_use]
    pub fn count_in(&self, rays: Range<u32>) -> u32 {
        let (first, last) = (rays.start as usize / 64, rays.end as usize / 64);
        let below = |ray: u32| (1_u64 << (ray % 64)) - 1;
        let word = |i: usize| self.words.get(i).copied().unwrap_or(0);
        if rays.is_empty() {
            0
        } else if first == last {
            (word(first) & below(rays.end) & !below(rays.start)).count_ones()
        } else {
            let inner = self.words.get(first + 1..last.min(self.words.len())).unwrap_or(&[]);
            (word(first) & !below(rays.start)).count_ones()
                + inner.iter().map(|w| w.count_ones()).sum::<u32>()
                + (word(last) & below(rays.end)).count_ones()
        }
    }

    /// The bits as 64-bit words, lowest ray in the lowest bit: the form a device uploads.
    #[must_use]
    pub fn words(&self) -> &[u64] {
        &self.words
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tasks_cover_every_ray_once() {
        for (rays, size) in [(0, 4), (1, 4), (4, 4), (9, 4), (10, 1), (3, 0)] {
            let tasks = tasks_of(rays, size);
            let all: Vec<u32> = tasks.iter().flat_map(Task::range).collect();
            assert_eq!(all, (0..rays).collect::<Vec<_>>());
        }
    }

    #[test]
    fn mask_remembers_only_its_own_rays() {
        let mut mask = RayMask::new(70);
        for ray in [0, 63, 64, 69, 1_000] {
            mask.insert(ray);
        }
        assert_eq!(mask.count(), 4);
        assert!(mask.contains(69) && !mask.contains(1) && !mask.contains(1_000));
        for (start, end) in [(0, 0), (0, 1), (1, 63), (0, 64), (63, 65), (64, 70), (0, 70), (0, 1_000), (500, 900)] {
            assert_eq!(
                mask.count_in(start..end),
                (start..end).filter(|&r| mask.contains(r)).count() as u32,
                "{start}..{end}"
            );
        }
    }
}
