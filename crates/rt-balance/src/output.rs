//! The caller's slices.

use crate::Finished;
use rt_core::{Hit, Launch, RayMask, Task, TestCounts};
use std::ops::Range;

/// Where hits and counts go. Only where rays have one hit each can hits be kept that were found before.
#[derive(Debug)]
pub(crate) struct Output<'a> {
    pub(crate) hits: &'a mut [Hit],
    /// How many hits each ray has.
    pub(crate) per_ray: usize,
    /// `None` where the caller has no room for counts, or the stream does not count.
    pub(crate) counts: Option<&'a mut [TestCounts]>,
}

impl Output<'_> {
    /// Writes the answer for one ray, of which there is one.
    pub(crate) fn set(&mut self, ray: u32, hit: Hit, count: TestCounts) {
        let ray = ray as usize;
        self.hits.get_mut(ray).into_iter().for_each(|out| *out = hit);
        self.counts.as_mut().and_then(|counts| counts.get_mut(ray)).into_iter().for_each(|out| *out = count);
    }

    /// What is there for a task.
    pub(crate) fn of(&self, task: Task) -> Finished<'_> {
        let range = task.first as usize..(task.first + task.rays) as usize;
        let counts = self.counts.as_ref().map(|counts| &counts[range.clone()]);
        Finished { task, hits: &self.hits[range.start * self.per_ray..range.end * self.per_ray], counts }
    }

    /// Writes a task's results, which begin at `from` in its launch; what is in `kept` is known already.
    pub(crate) fn write(&mut self, task: Task, launch: &Launch, from: usize, kept: Option<&RayMask>) {
        let (source, to) = (from..from + task.rays as usize, task.first as usize..(task.first + task.rays) as usize);
        let kept = kept.filter(|mask| mask.count_in(task.range()) > 0);
        let hits = |range: &Range<usize>| range.start * self.per_ray..range.end * self.per_ray;
        let (from, places) = (hits(&source), hits(&to));
        copy(&launch.hits[from], &mut self.hits[places], task.first, kept);
        if let Some(counts) = &mut self.counts {
            copy(&launch.counts[source], &mut counts[to], task.first, kept);
        }
    }
}

fn copy<T: Copy>(from: &[T], to: &mut [T], first: u32, kept: Option<&RayMask>) {
    let Some(kept) = kept else {
        to.copy_from_slice(from);
        return;
    };
    for ((ray, from), to) in (first..).zip(from).zip(to) {
        if !kept.contains(ray) {
            *to = *from;
        }
    }
}
