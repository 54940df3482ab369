//! Walks a list of rays on all devices in parallel.

use crate::device_state::{DeviceState, all_lost, cancelled};
use crate::device_thread::{Answer, Call, Done, Walked};
use crate::limits::{Heard, Limits, OVERRUN, after, earlier, hear};
use crate::record::WalkDone;
use crate::{BalanceError, Control};
use rt_core::{DeviceError, DeviceErrorKind, Hit, TestCounts, Walk};
use std::collections::VecDeque;
use std::ops::Range;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

/// Fewest samples worth a call to a device: below it the hand-over (some 10 µs) costs more than the rays.
const LEAST_CHUNK: usize = 256;

/// How many chunks each device is to have at least where samples are few: walks tell how fast devices are.
const CHUNKS: usize = 4;

/// Fewest samples that say anything of that.
const TELLING: usize = 16;

/// Chunks that a device has at a time, so that it goes on while the driver takes its answer; one before it has
/// answered, since nothing is known of its speed.
const AHEAD: usize = 2;

/// The share of what is left, in a device's fair share of it, that its next chunk takes, without a unit: with two
/// chunks at a time, half of it is left to mend what was thought of its speed.
const CHUNK_SHARE: f64 = 0.25;

/// What came of a walk.
#[derive(Debug, Default)]
pub(crate) struct Found {
    /// Of each ray.
    pub(crate) counts: Vec<TestCounts>,
    /// Of each ray; empty unless the walk was a full one.
    pub(crate) hits: Vec<Hit>,
    /// Which rays of the list each device walked.
    pub(crate) by: Vec<(Range<usize>, usize)>,
    pub(crate) walks: Vec<WalkDone>,
}

/// Walks `rays` on every device that is ready and has such a walk.
///
/// # Errors
/// When the caller cancels, or some rays were walked by no device: all failed, or those left have no such walk.
pub(crate) fn walk_on_all(
    members: &mut [DeviceState],
    rays: &Arc<Vec<u32>>,
    walk: Walk,
    limits: &Limits,
    control: Control<'_>,
) -> Result<Found, BalanceError> {
    let (to, answers) = channel();
    let ready = || members.iter().filter(|member| member.is_ready());
    let able = ready().filter(|member| member.info.capabilities.has_walk(walk));
    let walkers: Vec<Walker> = able.map(|member| Walker::new(member.index)).collect();
    // None of them has to be asked to know that.
    let unable = ready().next().filter(|_| walkers.is_empty()).map(|member| {
        let message = format!(
            "no device counts tests by the walk {walk:?}: choose another estimator, such as auto, or add a CPU device"
        );
        (member.index, DeviceError::new(DeviceErrorKind::Unsupported, message))
    });
    let walking = Walking {
        rays,
        walk,
        limits,
        control,
        open: Vec::new(),
        left: rays.len(),
        next: 0,
        by: Vec::new(),
        chunks: Vec::new(),
        least: (rays.len() / (CHUNKS * walkers.len().max(1))).clamp(TELLING, LEAST_CHUNK),
        walkers,
        slowest: 0.0,
        unable,
        to,
        answers,
        found: Found {
            counts: vec![TestCounts::default(); rays.len()],
            hits: vec![Hit::MISS; if walk == Walk::Full { rays.len() } else { 0 }],
            ..Found::default()
        },
    };
    walking.all(members)
}

/// A device that walks.
struct Walker {
    member: usize,
    /// Chunks that it was asked for, oldest first.
    asked: VecDeque<usize>,
    /// Since when it may have been at the oldest.
    since: Instant,
    /// Whether others do its chunks too.
    late: bool,
    /// Whether it gets more.
    able: bool,
    /// Rays that it has walked.
    walked: usize,
}

impl Walker {
    fn new(member: usize) -> Self {
        Self { member, asked: VecDeque::new(), since: Instant::now(), late: false, able: true, walked: 0 }
    }
}

struct Walking<'a> {
    rays: &'a Arc<Vec<u32>>,
    walk: Walk,
    limits: &'a Limits,
    control: Control<'a>,
    /// What was handed out so far.
    chunks: Vec<Range<usize>>,
    /// Rays of a chunk at least.
    least: usize,
    /// Chunks that nobody does any more, or that those who do them are late with; the next one last.
    open: Vec<usize>,
    /// The first ray that is in no chunk.
    next: usize,
    /// Rays without an answer.
    left: usize,
    /// Who answered.
    by: Vec<Option<usize>>,
    walkers: Vec<Walker>,
    /// Most seconds that a ray took.
    slowest: f64,
    /// The last device that has no such walk, and what it says.
    unable: Option<(usize, DeviceError)>,
    to: Sender<Answer>,
    answers: Receiver<Answer>,
    found: Found,
}

impl Walking<'_> {
    fn all(mut self, members: &mut [DeviceState]) -> Result<Found, BalanceError> {
        loop {
            for walker in 0..self.walkers.len() {
                self.feed(walker, members);
            }
            let waits = |walker: &Walker| !walker.asked.is_empty();
            // Whoever is not late is waited for, so that it is ready for what comes next.
            if self.left == 0 && !self.walkers.iter().any(|walker| waits(walker) && !walker.late) {
                break;
            }
            if !self.walkers.iter().any(waits) {
                return Err(match self.unable {
                    Some((index, source)) => BalanceError::Refused { device: members[index].info.name.clone(), source },
                    None => all_lost(members, 0),
                });
            }
            match hear(&self.answers, self.deadline(members), self.control) {
                Heard::Answer(answer) => self.take(answer, members),
                Heard::Late => self.look(members),
                Heard::Cancelled => return Err(cancelled()),
            }
        }
        for walker in self.walkers.iter().filter(|walker| walker.late && !walker.asked.is_empty()) {
            members[walker.member].set_late();
        }
        let by = self.by.into_iter().zip(self.chunks);
        self.found.by = by.filter_map(|(by, range)| Some((range, by?))).collect();
        Ok(self.found)
    }

    fn feed(&mut self, walker: usize, members: &mut [DeviceState]) {
        while let Some(chunk) = self.chunk_for(walker) {
            let walker = &mut self.walkers[walker];
            if walker.asked.is_empty() {
                walker.since = Instant::now();
            }
            walker.asked.push_back(chunk);
            let (rays, range) = (Arc::clone(self.rays), self.chunks[chunk].clone());
            members[walker.member].ask(Call::Walk { rays, range, walk: self.walk }, &self.to);
        }
    }

    /// The next chunk of a walker, if it is to have one.
    ///
    /// Chunks begin small and grow with what a walker has done (as C. Polychronopoulos and D. Kuck, *Guided
    /// Self-Scheduling*, 1987, but weighted by speeds found): all wait for the last, and one device may be a fiftieth
    /// as fast as another.
    fn chunk_for(&mut self, walker: usize) -> Option<usize> {
        let Walker { able, late, walked, ref asked, .. } = self.walkers[walker];
        let ahead = if walked == 0 { 1 } else { AHEAD };
        if !able || late || asked.len() >= ahead {
            return None;
        }
        while let Some(chunk) = self.open.pop() {
            if self.by[chunk].is_none() {
                return Some(chunk);
            }
        }
        let open = self.rays.len() - self.next;
        if open == 0 {
            return None;
        }
        let others = self.walkers.iter().enumerate().filter(|(i, other)| *i != walker && other.able && !other.late);
        let (mut all, mut fastest, mut others_walk) = (walked, 0, false);
        for (_, other) in others {
            all += other.walked;
            fastest = fastest.max(other.walked);
            others_walk |= !other.asked.is_empty();
        }
        // All began together, so rays walked are speeds. Whoever would be the last to end leaves what there is to
        // others.
        let seconds = |rays: usize, speed: usize| rays as f64 / speed.max(1) as f64;
        let least = self.least.min(open);
        if others_walk && walked > 0 && seconds(least, walked) > seconds(open, all - walked) + seconds(least, fastest) {
            return None;
        }
        let fair = open as f64 * walked as f64 / all.max(1) as f64;
        let size = ((CHUNK_SHARE * fair) as usize).min(2 * walked).max(self.least).min(open);
        self.chunks.push(self.next..self.next + size);
        self.by.push(None);
        self.next += size;
        Some(self.chunks.len() - 1)
    }

    /// When others are to do a walker's chunks too.
    fn late_at(&self, walker: &Walker) -> Option<Instant> {
        let rays = walker.asked.front().map_or(0, |&chunk| self.chunks[chunk].len());
        let expected = Duration::try_from_secs_f64(OVERRUN * self.slowest * rays as f64).unwrap_or(Duration::MAX);
        after(walker.since, self.limits.late).and_then(|at| after(at, expected))
    }

    fn deadline(&self, members: &[DeviceState]) -> Option<Instant> {
        let waiting = self.walkers.iter().filter(|walker| !walker.asked.is_empty());
        waiting.fold(None, |deadline, walker| {
            let late_at = if walker.late { None } else { self.late_at(walker) };
            earlier(deadline, earlier(late_at, members[walker.member].lost_at(self.limits)))
        })
    }

    /// Looks for devices that are late.
    fn look(&mut self, members: &mut [DeviceState]) {
        let now = Instant::now();
        for index in 0..self.walkers.len() {
            let walker = &self.walkers[index];
            let passed = |at: Option<Instant>| at.is_some_and(|at| at <= now);
            if walker.asked.is_empty() {
            } else if passed(members[walker.member].lost_at(self.limits)) {
                members[walker.member].give_up(self.limits);
                self.give_back(index);
                self.walkers[index].asked.clear();
                self.walkers[index].able = false;
            } else if !walker.late && passed(self.late_at(walker)) {
                self.give_back(index);
                self.walkers[index].late = true;
            }
        }
    }

    /// Has others do what a walker has not answered.
    fn give_back(&mut self, walker: usize) {
        let (by, asked) = (&self.by, &self.walkers[walker].asked);
        self.open.extend(asked.iter().filter(|&&chunk| by[chunk].is_none()));
    }

    fn take(&mut self, answer: Answer, members: &mut [DeviceState]) {
        let Answer { member, result, status } = answer;
        let Some(index) = self.walkers.iter().position(|walker| walker.member == member) else { return };
        members[member].answered(&status);
        match result {
            Ok(Done::Walked(walked)) => {
                let walker = &mut self.walkers[index];
                let chunk = walker.asked.pop_front();
                (walker.since, walker.late) = (Instant::now(), false);
                members[member].checked.add(walked.checked);
                if let Some(chunk) = chunk {
                    walker.walked += self.chunks[chunk].len();
                    self.keep(chunk, member, walked);
                }
            }
            Ok(_) => {}
            Err(error) => {
                if std::mem::replace(&mut self.walkers[index].able, false) {
                    self.give_back(index);
                }
                if status.lost {
                    members[member].fail(error);
                    self.walkers[index].asked.clear();
                } else {
                    // It is as it was, and will say the same of what else it was asked; the others walk.
                    self.walkers[index].asked.pop_front();
                    self.unable = Some((member, error));
                }
            }
        }
    }

    /// Takes a chunk's results, unless another device was faster.
    fn keep(&mut self, chunk: usize, member: usize, walked: Walked) {
        let range = self.chunks[chunk].clone();
        let Walked { counts, hits, span, .. } = walked;
        let rays = range.len();
        self.slowest = self.slowest.max(span.duration().as_secs_f64() / rays.max(1) as f64);
        self.found.walks.push(WalkDone {
            member,
            span,
            rays: rays as u32,
            boxes: counts.iter().map(|c| u64::from(c.boxes)).sum(),
            triangles: counts.iter().map(|c| u64::from(c.triangles)).sum(),
        });
        if self.by[chunk].is_some() {
            return;
        }
        self.by[chunk] = Some(member);
        self.left -= rays;
        self.found.counts[range.clone()].copy_from_slice(&counts);
        if !self.found.hits.is_empty() {
            self.found.hits[range].copy_from_slice(&hits);
        }
    }
}
