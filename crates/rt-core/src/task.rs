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

    /// Sets the bits of a range of rays; the part beyond the mask is ignored.
    pub fn insert_all(&mut self, rays: Range<u32>) {
        if rays.is_empty() {
            return;
        }
        let (first, last) = (rays.start as usize / 64, (rays.end - 1) as usize / 64);
        let (from_start, to_end) = (u64::MAX << (rays.start % 64), u64::MAX >> (63 - (rays.end - 1) % 64));
        for (i, word) in self.words.iter_mut().enumerate().take(last + 1).skip(first) {
            *word |= if i == first { from_start } else { u64::MAX } & if i == last { to_end } else { u64::MAX };
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

    /// The rays of a range whose bits are set, in increasing order.
    pub fn set_in(&self, rays: Range<u32>) -> impl Iterator<Item = u32> {
        let (first, last) = (rays.start as usize / 64, rays.end.div_ceil(64) as usize);
        let words = self.words.get(first..last.min(self.words.len())).unwrap_or_default();
        let numbers = (first as u32 * 64..).step_by(64);
        let all = words.iter().zip(numbers).flat_map(|(&word, number)| {
            let set = core::iter::successors(Some(word), |rest| Some(rest & rest.wrapping_sub(1)));
            set.take_while(|&rest| rest != 0).map(move |rest| number + rest.trailing_zeros())
        });
        all.filter(move |ray| rays.contains(ray))
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

    /// Fails when the last word of a range is filled to its end, or the first one from its start.
    #[test]
    fn masks_take_ranges_as_they_take_rays() {
        for range in [0..0, 5..5, 0..1, 3..64, 0..64, 63..65, 64..128, 10..200, 190..700, 700..800] {
            let (mut whole, mut single) = (RayMask::new(200), RayMask::new(200));
            whole.insert(7);
            single.insert(7);
            whole.insert_all(range.clone());
            range.clone().for_each(|ray| single.insert(ray));
            // A mask of 200 rays has bits for 256.
            assert_eq!(whole, single, "{range:?}");
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
            let set: Vec<u32> = mask.set_in(start..end).collect();
            assert_eq!(set, (start..end).filter(|&r| mask.contains(r)).collect::<Vec<_>>(), "{start}..{end}");
        }
    }
}
