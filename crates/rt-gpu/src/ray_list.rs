//! Which rays a kernel traces: the shader's structure `RayList`, and where the answers belong.

use crate::ray_recipe::{Row, append_table};
use rt_core::{RayMask, Task};
use std::collections::BTreeMap;

/// Words in front of the table: the next item, lanes, items.
const HEADER: usize = 3;

/// The rays of one kernel that was or will be started, all of one window.
#[derive(Clone, Debug)]
pub struct RayList {
    words: Vec<u32>,
    items: u32,
    runs: Vec<Run>,
}

/// Consecutive rays whose answers belong to consecutive places.
#[derive(Clone, Copy, Debug)]
struct Run {
    /// The first one's number among the kernel's items, in the stream, and among the answers that were asked for.
    item: u32,
    ray: u32,
    place: u32,
}

impl RayList {
    /// What the kernel reads at binding 5. Lists and ranges name rays by their number in the window.
    #[must_use]
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    /// No ray: for a launch that only sees to it that the kernel is ready.
    #[must_use]
    pub fn nothing() -> Self {
        // The kernel's list must not be empty.
        Self { words: vec![0; HEADER + 2], items: 0, runs: Vec::new() }
    }

    /// Number of rays, and of answers: at least one, but for [`RayList::nothing`].
    #[must_use]
    pub const fn items(&self) -> u32 {
        self.items
    }

    /// Invocations to start: one for each ray, or fewer, which then take rays until none is left; at least one.
    #[must_use]
    pub fn lanes(&self) -> u32 {
        self.words[1].max(1)
    }

    fn new(runs: Vec<Run>, items: u32, first: u32, persistent: Option<u32>) -> Self {
        // The kernel's counter of items must not wrap around.
        let lanes = persistent.filter(|&lanes| items.checked_add(lanes).is_some()).unwrap_or(items).clamp(1, items);
        let mut words = vec![lanes, lanes, items];
        let ranges: Vec<[u32; 2]> = runs.iter().map(|run| [run.item, run.ray - first]).collect();
        append_table(&mut words, &ranges, items);
        Self { words, items, runs }
    }

    /// Its rays, in rows of consecutive ones.
    pub(crate) fn rows(&self) -> impl Iterator<Item = Row> + '_ {
        let ends = self.runs.iter().skip(1).map(|next| next.item).chain([self.items]);
        self.runs.iter().zip(ends).map(|(run, end)| Row { ray: run.ray, count: end - run.item })
    }

    /// The number in the stream, and the place among the answers, of item `item` and those that follow.
    pub(crate) fn from(&self, item: u32) -> impl Iterator<Item = (u32, u32)> + '_ {
        let mut at = self.runs.partition_point(|run| run.item <= item).saturating_sub(1);
        (item..self.items).map(move |item| {
            while self.runs.get(at + 1).is_some_and(|next| next.item <= item) {
                at += 1;
            }
            let run = self.runs[at];
            (run.ray + (item - run.item), run.place + (item - run.item))
        })
    }
}

/// Sorts rays by window.
#[derive(Debug)]
pub(crate) struct Sorter {
    window: u32,
    parts: BTreeMap<u32, (Vec<Run>, u32)>,
    place: u32,
}

impl Sorter {
    /// For windows of `window` rays, at least one.
    pub(crate) fn new(window: u32) -> Self {
        Self { window: window.max(1), parts: BTreeMap::new(), place: 0 }
    }

    /// The rays of a walk, in its order.
    pub(crate) fn rays(&mut self, rays: &[u32]) {
        rays.iter().for_each(|&ray| self.take(ray, 1));
    }

    /// The rays of tasks less those in `done`, whose places stay empty.
    pub(crate) fn tasks(&mut self, tasks: &[Task], done: Option<&RayMask>) {
        for task in tasks {
            let Some(mask) = done else {
                self.take(task.first, task.rays);
                continue;
            };
            let (mut ray, end) = (task.first, task.first + task.rays);
            while ray < end {
                let run = |wanted: bool| move |&ray: &u32| mask.contains(ray) == wanted;
                let left_out = (ray..end).take_while(run(true)).count() as u32;
                self.place += left_out;
                ray += left_out;
                let taken = (ray..end).take_while(run(false)).count() as u32;
                self.take(ray, taken);
                ray += taken;
            }
        }
    }

    /// Takes `count` rays from number `first` on.
    fn take(&mut self, first: u32, count: u32) {
        let (mut ray, end) = (first, first + count);
        while ray < end {
            let number = ray / self.window;
            let here = (end - ray).min(self.window - ray % self.window);
            let (runs, items) = self.parts.entry(number).or_default();
            let follows = runs.last().is_some_and(|last| {
                let length = *items - last.item;
                last.ray + length == ray && last.place + length == self.place
            });
            if !follows {
                runs.push(Run { item: *items, ray, place: self.place });
            }
            *items += here;
            ray += here;
            self.place += here;
        }
    }

    /// The windows with rays, and the rays of each, for kernels of `persistent` lanes or one for each ray.
    pub(crate) fn finish(self, persistent: Option<u32>) -> Vec<(u32, RayList)> {
        let list = |(window, (runs, items))| (window, RayList::new(runs, items, window * self.window, persistent));
        self.parts.into_iter().map(list).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::random;

    /// What a kernel makes of the words: for each item, the ray's number in the window.
    fn read(words: &[u32]) -> Vec<u32> {
        let (items, ranges, rays) = (words[2], words[HEADER], &words[HEADER + 1..]);
        let ray = |item: u32| {
            let of = |range: &[u32]| range[1] + item - range[0];
            rays.chunks_exact(2).take(ranges as usize).take_while(|range| range[0] <= item).last().map(of)
        };
        (0..items).map(|item| if ranges == 0 { rays[item as usize] } else { ray(item).expect("a range") }).collect()
    }

    /// Every ray that was asked for is in the list of its window once, and its place is that in the list of all. Fails
    /// when runs are joined across a ray that is left out, or a run is not cut where its window ends.
    #[test]
    fn lists_are_what_was_asked_for() {
        for seed in 0..300 {
            let below = |bound, index| random::below(bound, seed, index, 9);
            let stream = 200 + below(200, 0);
            let tasks: Vec<Task> = (0..below(6, 1))
                .map(|i| {
                    let first = below(stream, 10 + i);
                    Task { first, rays: below(stream - first + 1, 20 + i) }
                })
                .collect();
            let mut mask = RayMask::new(stream);
            let dense = below(40, 2);
            (0..stream).filter(|&ray| random::below(40, seed, ray, 3) < dense).for_each(|ray| mask.insert(ray));
            let done = (seed % 2 == 0).then_some(&mask);
            let window = 1 + below(stream + 50, 4);
            let mut sorter = Sorter::new(window);
            sorter.tasks(&tasks, done);
            let persistent = (seed % 3 == 0).then_some(1 + below(64, 5));

            let mut found = Vec::new();
            for (number, list) in sorter.finish(persistent) {
                let rays: Vec<u32> = read(list.words()).iter().map(|ray| number * window + ray).collect();
                let pairs: Vec<(u32, u32)> = list.from(0).collect();
                assert_eq!(rays, pairs.iter().map(|pair| pair.0).collect::<Vec<_>>());
                assert!(rays.iter().all(|ray| ray / window == number));
                assert_eq!((pairs.len(), list.words()[0]), (list.items() as usize, list.lanes()));
                assert_eq!(list.lanes(), persistent.unwrap_or(u32::MAX).min(list.items()));
                let middle = below(list.items(), 6);
                assert!(list.from(middle).eq(pairs[middle as usize..].iter().copied()));
                found.extend(pairs);
            }
            let all = (0..).zip(tasks.iter().flat_map(Task::range)).map(|(place, ray)| (ray, place));
            let mut wanted: Vec<(u32, u32)> =
                all.filter(|(ray, _)| !done.is_some_and(|mask| mask.contains(*ray))).collect();
            wanted.sort_unstable();
            found.sort_unstable();
            assert_eq!(found, wanted, "seed {seed}");
        }
    }

    /// A launch of whole tasks costs bytes for each task, not for each ray; scattered rays cost four bytes.
    #[test]
    fn tasks_are_uploaded_as_ranges_and_samples_as_a_list() {
        let words = |fill: &dyn Fn(&mut Sorter)| {
            let mut sorter = Sorter::new(u32::MAX);
            fill(&mut sorter);
            sorter.finish(None)[0].1.words().len() - HEADER - 1
        };
        let tasks = |apart: u32| (0..10).map(|i| Task { first: i * apart, rays: 1000 }).collect::<Vec<_>>();
        assert_eq!(words(&|sorter| sorter.tasks(&tasks(2000), None)), 20);
        assert_eq!(words(&|sorter| sorter.tasks(&tasks(1000), None)), 2, "neighbours are one range");
        let samples: Vec<u32> = (0..500).map(|i| i * 8).collect();
        assert_eq!(words(&|sorter| sorter.rays(&samples)), 500);
        let mut mask = RayMask::new(10_000);
        (0..10_000).step_by(100).for_each(|ray| mask.insert(ray));
        assert_eq!(words(&|sorter| sorter.tasks(&tasks(1000), Some(&mask))), 200);
    }

    #[test]
    fn a_counter_that_would_wrap_around_is_not_used() {
        let run = || vec![Run { item: 0, ray: 0, place: 0 }];
        assert_eq!(RayList::new(run(), u32::MAX - 5, 0, Some(64)).lanes(), u32::MAX - 5);
        assert_eq!(RayList::new(run(), u32::MAX - 64, 0, Some(64)).lanes(), 64);
        assert_eq!(RayList::new(run(), 10, 0, Some(0)).lanes(), 1);
    }
}
