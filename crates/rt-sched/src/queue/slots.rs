//! One range of tasks per device, each in one atomic word.

use super::atomics::{AtomicU64, Ordering};
// Not those of `atomics`, whose every order loom tries: nothing depends on a hint but the victim of a theft.
use alloc::boxed::Box;
use alloc::vec::Vec;
use core::ops::Range;
use core::sync::atomic as hint;
use rt_core::TaskId;

/// The lists of a schedule one behind another, never changed, and for each device the range of positions that is
/// reserved for it.
///
/// A range is one word, so taking from its front (the device) or its back (a thief) is one compare-and-swap. The word
/// is the whole state: whoever shortens a range owns what fell off, whatever happened to the word in between, and a
/// position is in no other range. Hence no tags against ABA are needed.
#[derive(Debug)]
pub(crate) struct Slots {
    order: Box<[TaskId]>,
    ranges: Box<[Slot]>,
    /// A bit for each device whose range may not be empty. Only a hint: who relies on nothing being left looks at the
    /// ranges.
    hints: Box<[hint::AtomicU64]>,
}

/// One device's word on its own cache line (64 bytes on all processors we know), so that devices that pop do not slow
/// one another down.
#[derive(Debug)]
#[repr(align(64))]
struct Slot(AtomicU64);

fn pack(range: &Range<u32>) -> u64 {
    u64::from(range.start) | (u64::from(range.end) << 32)
}

fn unpack(word: u64) -> Range<u32> {
    word as u32..(word >> 32) as u32
}

impl Slots {
    pub(crate) fn new(lists: &[Vec<TaskId>]) -> Self {
        let mut end = 0;
        let ranges = lists.iter().map(|list| {
            let start = end;
            end += list.len() as u32;
            Slot(AtomicU64::new(pack(&(start..end))))
        });
        let ranges = ranges.collect();
        let word =
            |lists: &[Vec<TaskId>]| lists.iter().rev().fold(0, |bits, list| bits << 1 | u64::from(!list.is_empty()));
        let hints = lists.chunks(64).map(|lists| hint::AtomicU64::new(word(lists))).collect();
        Self { ranges, order: lists.iter().flatten().copied().collect(), hints }
    }

    /// Devices whose range is probably not empty, each once, beginning near `from`.
    pub(crate) fn filled(&self, from: usize) -> impl Iterator<Item = usize> {
        let words = self.hints.len();
        (0..words).map(move |i| (from / 64 + i) % words).flat_map(|word| {
            let mut bits = self.hints[word].load(hint::Ordering::Relaxed);
            core::iter::from_fn(move || {
                let bit = (bits != 0).then(|| bits.trailing_zeros() as usize)?;
                bits &= bits - 1;
                Some(64 * word + bit)
            })
        })
    }

    /// Says that a device's range was found empty.
    pub(crate) fn note_empty(&self, device: usize) {
        let (hint, bit) = (&self.hints[device / 64], 1 << (device % 64));
        hint.fetch_and(!bit, hint::Ordering::Relaxed);
        if !self.range(device).is_empty() {
            hint.fetch_or(bit, hint::Ordering::Relaxed);
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.ranges.len()
    }

    /// The tasks at `range`.
    pub(crate) fn tasks(&self, range: Range<u32>) -> &[TaskId] {
        &self.order[range.start as usize..range.end as usize]
    }

    /// What is reserved for a device.
    pub(crate) fn range(&self, device: usize) -> Range<u32> {
        unpack(self.ranges[device].0.load(Ordering::Acquire))
    }

    /// Takes the first `count(range)` positions of what is reserved for a device. The range it counts is not empty.
    pub(crate) fn take_front(&self, device: usize, count: impl Fn(Range<u32>) -> u32) -> Range<u32> {
        let mut taken = 0..0;
        let shorten = |word| {
            let range = unpack(word);
            if range.is_empty() {
                return None;
            }
            let cut = range.start + count(range.clone()).min(range.end - range.start);
            taken = range.start..cut;
            Some(pack(&(cut..range.end)))
        };
        match self.ranges[device].0.fetch_update(Ordering::AcqRel, Ordering::Acquire, shorten) {
            Ok(_) => taken,
            Err(_) => 0..0,
        }
    }

    /// Takes the last `count` positions of a device's range if it is still `seen`.
    pub(crate) fn take_back(&self, device: usize, seen: &Range<u32>, count: u32) -> Option<Range<u32>> {
        let cut = seen.end - count.min(seen.end - seen.start);
        let word = &self.ranges[device].0;
        let swapped = word.compare_exchange(pack(seen), pack(&(seen.start..cut)), Ordering::AcqRel, Ordering::Relaxed);
        swapped.is_ok().then_some(cut..seen.end)
    }

    /// Reserves `range`, which the caller alone has claimed, for a device that has nothing reserved; `false` if it has.
    pub(crate) fn refill(&self, device: usize, range: &Range<u32>) -> bool {
        let fill = |word| unpack(word).is_empty().then_some(pack(range));
        let filled = self.ranges[device].0.fetch_update(Ordering::AcqRel, Ordering::Acquire, fill).is_ok();
        self.hints[device / 64].fetch_or(u64::from(filled) << (device % 64), hint::Ordering::Relaxed);
        filled
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::policy::{Block, Policy};
    use rt_core::{CostModel, Work};

    /// What two threads do to one word, step by step.
    ///
    /// Mutants: `take_back` that stores instead of comparing; `refill` that does not ask whether the range is empty;
    /// `take_front` that takes more than there is; `note_empty` that does not look again; `refill` without the hint.
    #[test]
    fn nothing_is_taken_twice() {
        let schedule = Block.schedule(&[Work::new(1.0, 1.0, 0.0); 10], &[CostModel::UNIT; 2]);
        let slots = Slots::new(schedule.lists());
        let seen = slots.range(0);
        assert_eq!(slots.take_front(0, |_| 2), 0..2, "the device was faster");
        assert_eq!(slots.take_back(0, &seen, 2), None, "so the thief must look again");
        let seen = slots.range(0);
        assert_eq!(slots.take_back(0, &seen, 2), Some(3..5));
        assert_eq!(slots.take_back(0, &seen, 2), None, "the other thief, too");
        assert!(!slots.refill(0, &(3..5)), "something is left");
        assert_eq!(slots.take_front(0, |_| 9), 2..3);
        assert_eq!(slots.take_front(0, |_| 9), 0..0);
        assert!(slots.refill(0, &(3..5)));
        assert_eq!((slots.range(0), slots.range(1)), (3..5, 5..10));
        assert_eq!(slots.tasks(3..6), [3, 4, 5]);
        assert!(slots.filled(1).eq([0, 1]));
        slots.note_empty(0);
        assert!(slots.filled(0).eq([0, 1]), "it is not empty");
        slots.take_front(0, |_| 9);
        slots.note_empty(0);
        assert!(slots.filled(0).eq([1]));
    }
}
